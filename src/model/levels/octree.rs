//! The octree over points along their Morton curve.

use std::ops::Range;

use crate::model::order::BITS;

/// Cells of a node along each axis. What a cell holds is merged.
const CELLS: u32 = 8;
/// Most points of a node on a surface that is not divided: two for each cell.
pub(in crate::model) const FEW: usize = 2 * (CELLS * CELLS) as usize;
/// The same in a volume, where cells beside each other hold points: two for each.
pub(in crate::model) const FEW_OF_VOLUME: usize = 2 * CELLS.pow(3) as usize;

/// A node before it has points of its own.
pub(in crate::model) struct Draft {
    /// The points below it, along the curve.
    pub(in crate::model) leaves: Range<usize>,
    /// Its children, by number; empty where it has none.
    pub(in crate::model) children: Range<u32>,
    /// Its edge is 2 to this, in cells of the codes.
    pub(in crate::model) bits: u32,
}

/// The edge of a cell of a node whose edge is 2 to `bits` is 2 to this.
pub(in crate::model) fn shift(bits: u32) -> u32 {
    bits.saturating_sub(CELLS.trailing_zeros())
}

/// All nodes over points by their codes, which rise: the root first, and children behind their parent. Nodes of up to
/// `few` points are not divided. Beside them the range of nodes of each depth.
pub(in crate::model) fn drafts(codes: &[u64], few: usize) -> (Vec<Draft>, Vec<Range<usize>>) {
    let mut drafts = vec![Draft { leaves: 0..codes.len(), children: 0..0, bits: BITS }];
    let mut depth = 0..1;
    let mut depths = Vec::new();
    while !depth.is_empty() {
        depths.push(depth.clone());
        for i in depth.clone() {
            let (leaves, mut bits) = (drafts[i].leaves.clone(), drafts[i].bits);
            if leaves.len() <= few {
                continue;
            }
            // Cubes with all points in one eighth are no nodes.
            let differ = codes[leaves.start] ^ codes[leaves.end - 1];
            bits = bits.min((u64::BITS - differ.leading_zeros()).div_ceil(3));
            drafts[i].bits = bits;
            if bits == 0 {
                continue;
            }
            let first = drafts.len() as u32;
            let mut start = leaves.start;
            while start < leaves.end {
                let eighth = |code: u64| code >> (3 * (bits - 1));
                let own = eighth(codes[start]);
                let end = start + codes[start..leaves.end].partition_point(|&code| eighth(code) == own);
                drafts.push(Draft { leaves: start..end, children: 0..0, bits: bits - 1 });
                start = end;
            }
            drafts[i].children = first..drafts.len() as u32;
        }
        depth = depth.end..drafts.len();
    }
    (drafts, depths)
}

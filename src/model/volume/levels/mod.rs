//! Levels of detail of volumes: fewer, larger kernels in place of many small ones.
//!
//! Each node of an octree over the centres has kernels of its own that replace all below it: one for each cell, with
//! the extinction, the mean and the covariance of those in it. What a picture misses by a node is measured when the
//! tree is built.
//!
//! Captures have none: their splats are never smaller than a pixel, so fewer of them look different
//! (docs/measurements/levels.md).

mod errors;
mod merge;
mod side;
#[cfg(test)]
mod tests;

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use glam::Vec3;
use rayon::prelude::*;

use crate::model::capture::{Gaussians, Optics};
use crate::model::levels::grid::Grid;
use crate::model::levels::octree::{Draft, FEW_OF_VOLUME, drafts, shift};
use crate::model::order::{BITS, morton_codes};
pub(crate) use errors::NodeError;
use merge::Kernel;

/// Measures of most factors that are kept: a scene has few, but where scales are animated.
const KEPT: usize = 8;

/// The tree of a volume.
#[derive(Debug)]
pub(crate) struct VolumeLevels {
    /// The root first, and children behind their parent.
    nodes: Vec<VolumeNode>,
    /// The kernels of the volume along their curve, by index.
    order: Vec<u32>,
    /// The kernels of all nodes that have children: those of a node one after the other.
    merged: Gaussians,
    /// What pictures miss by each node, by the power of 2 that multiplies extinctions.
    measured: Mutex<Vec<(i32, Arc<[NodeError]>)>>,
}

/// A node of the tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct VolumeNode {
    /// Corners of a box around all centres below it.
    pub(crate) corners: [Vec3; 2],
    /// Edge of its cells, which is the distance of its kernels, model units. 0 without children.
    pub(crate) spacing: f32,
    /// Its edge is 2 to this, in cells of the codes.
    bits: u32,
    /// Its kernels: places in the curve where it has no children, else merged ones.
    own: Range<u32>,
    /// Its children, by number; empty where it has none.
    pub(crate) children: Range<u32>,
}

impl VolumeNode {
    /// Has it no children?
    pub(crate) fn is_leaf(&self) -> bool {
        self.children.is_empty()
    }
}

impl VolumeLevels {
    /// The tree of a volume. `None` where it is no volume, has too few kernels for any level, or such as cannot be
    /// merged.
    pub(crate) fn of(volume: &Gaussians) -> Option<Self> {
        let is_volume = volume.optics != Optics::Alpha && volume.degree == 0;
        if !is_volume || volume.len() <= FEW_OF_VOLUME || u32::try_from(volume.len()).is_err() {
            return None;
        }
        let mut curve: Vec<(u64, u32)> = morton_codes(&volume.position);
        curve.par_sort_unstable();
        let (codes, order): (Vec<u64>, Vec<u32>) = curve.into_iter().unzip();
        let [low, high] = around(volume.position.iter().map(|&place| [place, place]));
        let grid = Grid::new(low, (high - low).max_element() / ((1_u32 << BITS) - 1) as f32);
        let (drafts, depths) = drafts(&codes, FEW_OF_VOLUME);
        let nodes = vec![VolumeNode::default(); drafts.len()];
        let mut levels = Self { nodes, order, merged: columns_of(volume), measured: Mutex::default() };
        levels.merge(volume, &drafts, depths, &grid);
        levels.merged.check().ok()?;
        shrink(&mut levels.merged);
        Some(levels)
    }

    /// What pictures miss by each node where extinctions are multiplied by `factor`: the scale of an object, times its
    /// opacity. Measured for the next power of 2 when it is first asked for.
    pub(crate) fn errors(&self, volume: &Gaussians, factor: f64) -> Arc<[NodeError]> {
        let power = libm::log2(factor).ceil().clamp(-100.0, 100.0) as i32;
        let kept = || self.measured.lock().unwrap_or_else(PoisonError::into_inner);
        let found = kept().iter().find(|(own, _)| *own == power).map(|(_, errors)| Arc::clone(errors));
        // No lock is held while they are measured, which takes all threads.
        found.unwrap_or_else(|| {
            let errors: Arc<[NodeError]> = errors::measure(self, volume, libm::exp2(power.into()) as f32).into();
            let mut kept = kept();
            if kept.len() == KEPT {
                kept.remove(0);
            }
            kept.push((power, Arc::clone(&errors)));
            errors
        })
    }

    /// Makes the nodes of drafts, and their kernels, from the bottom up.
    fn merge(&mut self, volume: &Gaussians, drafts: &[Draft], depths: Vec<Range<usize>>, grid: &Grid) {
        // The merged kernels of the nodes of the depth below: no others are held.
        let (mut first_below, mut all_below): (usize, Vec<Vec<Kernel>>) = (drafts.len(), Vec::new());
        for depth in depths.into_iter().rev() {
            let of_node = |i: usize| {
                let mut below = Vec::new();
                for child in drafts[i].children.clone().map(|child| child as usize) {
                    if drafts[child].children.is_empty() {
                        let leaves = &self.order[drafts[child].leaves.clone()];
                        below.extend(leaves.iter().map(|&i| Kernel::of(volume, i as usize)));
                    } else {
                        below.extend_from_slice(&all_below[child - first_below]);
                    }
                }
                merge_cells(&below, shift(drafts[i].bits), grid)
            };
            let made: Vec<Vec<Kernel>> = depth.clone().into_par_iter().map(of_node).collect();
            first_below = depth.start;
            for (i, own) in depth.zip(&made) {
                let (draft, children) = (&drafts[i], drafts[i].children.clone());
                self.nodes[i] = if children.is_empty() {
                    let leaves = &self.order[draft.leaves.clone()];
                    let corners = around(leaves.iter().map(|&i| [volume.position[i as usize]; 2]));
                    let own = draft.leaves.start as u32..draft.leaves.end as u32;
                    VolumeNode { corners, bits: draft.bits, own, ..VolumeNode::default() }
                } else {
                    let below = &self.nodes[children.start as usize..children.end as usize];
                    let corners = around(below.iter().map(|child| child.corners));
                    let start = self.merged.len() as u32;
                    for kernel in own {
                        kernel.push(&mut self.merged);
                    }
                    let own = start..self.merged.len() as u32;
                    VolumeNode { corners, spacing: grid.edge(shift(draft.bits)), bits: draft.bits, own, children }
                };
            }
            all_below = made;
        }
    }

    /// All nodes: the root first, and children behind their parent.
    pub(crate) fn nodes(&self) -> &[VolumeNode] {
        &self.nodes
    }

    /// Memory of the tree, bytes, with all measures that it may keep.
    pub(crate) fn bytes(&self) -> u64 {
        let measures = KEPT * self.nodes.len() * size_of::<NodeError>();
        self.merged.bytes() + (size_of_val(&*self.nodes) + size_of_val(&*self.order) + measures) as u64
    }

    /// The kernels of the nodes `cut` of the tree of `volume`, in their order.
    pub(crate) fn gather(&self, volume: &Gaussians, cut: &[u32]) -> Gaussians {
        let mut made = columns_of(volume);
        for (from, i) in cut.iter().flat_map(|&node| self.own(volume, node)) {
            made.position.push(from.position[i]);
            made.sigma.push(from.sigma[i]);
            made.rotation.push(from.rotation[i]);
            made.opacity.push(from.opacity[i]);
            made.base.push(from.base[i]);
            made.normal.extend(from.normal.get(i));
        }
        shrink(&mut made);
        made
    }

    /// The kernels of a node, each by what has it and its index there.
    fn own<'a>(&'a self, volume: &'a Gaussians, node: u32) -> impl Iterator<Item = (&'a Gaussians, usize)> {
        let node = &self.nodes[node as usize];
        let kernel = move |i: u32| {
            if node.is_leaf() { (volume, self.order[i as usize] as usize) } else { (&self.merged, i as usize) }
        };
        node.own.clone().map(kernel)
    }
}

/// A volume without kernels of the same kind as another.
fn columns_of(volume: &Gaussians) -> Gaussians {
    let Gaussians { optics, antialiased, turned, linear, .. } = *volume;
    Gaussians { optics, antialiased, turned, linear, ..Gaussians::default() }
}

/// Gives back what columns have grown beyond their length.
fn shrink(volume: &mut Gaussians) {
    volume.position.shrink_to_fit();
    volume.sigma.shrink_to_fit();
    volume.rotation.shrink_to_fit();
    volume.opacity.shrink_to_fit();
    volume.base.shrink_to_fit();
    volume.normal.shrink_to_fit();
}

/// The box around boxes, each by its corners.
fn around(boxes: impl Iterator<Item = [Vec3; 2]>) -> [Vec3; 2] {
    boxes.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], [a, b]| [low.min(a), high.max(b)])
}

/// Merges kernels in cells whose edge is 2 to `shift`.
fn merge_cells(below: &[Kernel], shift: u32, grid: &Grid) -> Vec<Kernel> {
    let cell = |kernel: &Kernel| grid.place(kernel.position, shift).to_array();
    let mut cells: Vec<([i32; 3], u32)> = below.iter().zip(0..).map(|(kernel, i)| (cell(kernel), i)).collect();
    cells.sort_unstable();
    let of_cell = |cell: &[([i32; 3], u32)]| Kernel::merge(&cell.iter().map(|(_, i)| &below[*i as usize]));
    cells.chunk_by(|a, b| a.0 == b.0).map(of_cell).collect()
}

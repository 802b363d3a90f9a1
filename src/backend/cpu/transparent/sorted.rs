//! Passes `sort` and `list`: splats in the order of depth, in lists by tile.
//!
//! The order is that of the depths of centres, and of indices where depths are equal. It is cut into parts of some
//! thousand splats, each sorted and listed by itself, in parallel; where the cuts lie changes nothing in the order.

use rayon::prelude::*;

use super::project::Projected;
use crate::backend::cpu::tiles::{Band, TileRect};
use crate::layout::GaussianSplat;

/// Gaussians of a chunk. Splat `i` of chunk `c` has the place `c * CHUNK + i`.
pub(super) const CHUNK: usize = 4096;
/// Splats of a part, about.
const PART: usize = 16_384;
/// Classes of depth from which parts are made.
const CLASSES: usize = 1 << 12;
/// Splats that touch more tiles than this are in a list of their own, so that the lists stay bounded.
const WIDE: usize = 64;

/// Where a splat stands in the order: its depth as an integer in the upper half, its place in the lower.
pub(super) type Rank = u64;

/// A depth as an integer of the same order; any finite depth.
pub(super) fn key_of(depth: f32) -> u32 {
    let bits = depth.to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

/// Splats of some objects in the order of depth. How far they lie behind one another was found once, for all samples
/// that share the order.
#[derive(Debug, Default)]
pub(super) struct Order {
    /// Ranks, rising, part by part.
    pub parts: Vec<Vec<Rank>>,
}

impl Order {
    /// Bytes of one splat.
    pub(super) const BYTES: usize = 2 * size_of::<Rank>();

    /// That of all splats of `chunks`.
    pub(super) fn of(chunks: &[Projected]) -> Self {
        let ranks = |(chunk, projected): (usize, &Projected)| -> Vec<Rank> {
            let place = |i: usize| (chunk * CHUNK + i) as u64;
            projected.splats.iter().enumerate().map(|(i, splat)| u64::from(key_of(splat.depth)) << 32 | place(i)).collect()
        };
        let ranks: Vec<Vec<Rank>> = chunks.par_iter().enumerate().map(ranks).collect();
        let mut parts = split(&ranks);
        drop(ranks);
        parts.par_iter_mut().for_each(|part| part.sort_unstable());
        Self { parts }
    }
}

/// Deals ranks out to parts, such that all of one part are less than those of the next.
fn split(ranks: &[Vec<Rank>]) -> Vec<Vec<Rank>> {
    let keys = || ranks.iter().flatten().map(|rank| (rank >> 32) as u32);
    let (Some(least), Some(greatest)) = (keys().min(), keys().max()) else { return Vec::new() };
    let shift = (u32::BITS - (greatest - least).leading_zeros()).saturating_sub(CLASSES.trailing_zeros());
    let class = |rank: Rank| (((rank >> 32) as u32 - least) >> shift) as usize;
    let mut counts = vec![0_usize; CLASSES];
    ranks.iter().flatten().for_each(|&rank| counts[class(rank)] += 1);
    let mut part_of = vec![0_usize; CLASSES];
    let mut sizes = vec![0];
    for (part, count) in part_of.iter_mut().zip(counts) {
        if sizes[sizes.len() - 1] + count > PART && sizes[sizes.len() - 1] > 0 {
            sizes.push(0);
        }
        *part = sizes.len() - 1;
        sizes[*part] += count;
    }
    let mut parts: Vec<Vec<Rank>> = sizes.into_iter().map(Vec::with_capacity).collect();
    ranks.iter().flatten().for_each(|&rank| parts[part_of[class(rank)]].push(rank));
    parts
}

/// The lists of the tiles of a band, for one part of an order.
#[derive(Debug, Default)]
struct Lists {
    /// For each tile, where its list starts in `entries`; one more at the end.
    starts: Vec<u32>,
    /// Indices into the part, rising.
    entries: Vec<u32>,
    /// Indices of the splats that touch more than `WIDE` tiles, rising.
    wide: Vec<u32>,
}

/// Splats of a time sample, in an order, by tile.
#[derive(Debug)]
pub(super) struct Listed<'a> {
    chunks: &'a [Projected],
    order: &'a Order,
    lists: Vec<Lists>,
}

impl<'a> Listed<'a> {
    /// Most bytes of one splat.
    pub(super) const BYTES: usize = WIDE * size_of::<u32>();

    /// Lists splats by the tiles of `band`.
    pub(super) fn new(chunks: &'a [Projected], order: &'a Order, band: &Band) -> Self {
        let lists = order.parts.par_iter().map(|part| list(chunks, part, band)).collect();
        Self { chunks, order, lists }
    }

    /// Nothing at all.
    pub(super) const fn none(order: &'a Order) -> Self {
        Self { chunks: &[], order, lists: Vec::new() }
    }

    /// Walks over the splats of a tile, the nearest first.
    pub(super) fn walk(&'a self, tile: &'a TileRect, index: usize) -> Walk<'a> {
        let mut walk = Walk { listed: self, tile, index, part: 0, list: &[], next: 0, merged: Vec::new() };
        walk.open();
        walk
    }
}

fn tiles_of(chunks: &[Projected], rank: Rank) -> [usize; 4] {
    let place = rank as u32 as usize;
    chunks[place / CHUNK].tiles[place % CHUNK].map(usize::from)
}

fn list(chunks: &[Projected], part: &[Rank], band: &Band) -> Lists {
    let mut lists = Lists { starts: vec![0; band.len() + 2], ..Lists::default() };
    let Lists { starts, entries, wide } = &mut lists;
    let first_row = band.tile_rows[0];
    // Each once from the chunks, which is what takes time.
    let spans: Vec<[u16; 4]> = part.iter().map(|&rank| tiles_of(chunks, rank).map(|tile| tile as u16)).collect();
    let rows = |span: &[u16; 4], visit: &mut dyn FnMut(usize, usize)| {
        let [x0, x1, y0, y1] = span.map(usize::from);
        if x0 > x1 || (x1 + 1 - x0) * (y1 + 1 - y0) > WIDE {
            return;
        }
        for y in y0..=y1 {
            visit((y - first_row) * band.tiles_x + x0, x1 + 1 - x0);
        }
    };
    // Counting sort: counts, then starts, then entries; `starts` is moved one ahead so that filling restores it.
    for (index, span) in spans.iter().enumerate() {
        let [x0, x1, y0, y1] = span.map(usize::from);
        if x0 <= x1 && (x1 + 1 - x0) * (y1 + 1 - y0) > WIDE {
            wide.push(index as u32);
        }
        rows(span, &mut |first, count| starts[first + 2..][..count].iter_mut().for_each(|start| *start += 1));
    }
    let mut sum = 0;
    for start in &mut *starts {
        sum += *start;
        *start = sum;
    }
    entries.resize(sum as usize, 0);
    for (index, span) in (0..).zip(&spans) {
        rows(span, &mut |first, count| {
            for next in &mut starts[first + 1..][..count] {
                entries[*next as usize] = index;
                *next += 1;
            }
        });
    }
    lists
}

/// The splats of one tile, the nearest first.
pub(super) struct Walk<'a> {
    listed: &'a Listed<'a>,
    tile: &'a TileRect,
    index: usize,
    part: usize,
    /// The list of the tile in `part`, where that part has no wide splats that touch the tile.
    list: &'a [u32],
    /// Else both together.
    merged: Vec<u32>,
    next: usize,
}

/// A splat of a walk.
#[derive(Clone, Copy)]
pub(super) struct Step<'a> {
    /// Its depth as an integer, and its index among all Gaussians of the frame.
    pub rank: (u32, u32),
    pub splat: &'a GaussianSplat,
    /// Velocity of its centre, where it is wanted.
    pub velocity: Option<&'a [f32; 2]>,
}

impl<'a> Walk<'a> {
    /// Opens the list of the tile in the current part, or in the next that has one.
    fn open(&mut self) {
        self.next = 0;
        while let Some(lists) = self.listed.lists.get(self.part) {
            let [from, to] = [0, 1].map(|i| lists.starts[self.index + i] as usize);
            self.list = &lists.entries[from..to];
            self.merged.clear();
            let part = &self.listed.order.parts[self.part];
            let [x, y] = self.tile.tile;
            let touches = |&&index: &&u32| {
                let [x0, x1, y0, y1] = tiles_of(self.listed.chunks, part[index as usize]);
                (x0..=x1).contains(&x) && (y0..=y1).contains(&y)
            };
            self.merged.extend(lists.wide.iter().filter(touches));
            if !self.merged.is_empty() {
                self.merged.extend_from_slice(self.list);
                self.merged.sort_unstable();
            }
            if !self.list.is_empty() || !self.merged.is_empty() {
                return;
            }
            self.part += 1;
        }
        self.list = &[];
        self.merged.clear();
    }
}

impl<'a> Iterator for Walk<'a> {
    type Item = Step<'a>;

    #[inline]
    fn next(&mut self) -> Option<Step<'a>> {
        loop {
            let list = if self.merged.is_empty() { self.list } else { &self.merged };
            if let Some(&index) = list.get(self.next) {
                self.next += 1;
                let listed = self.listed;
                let rank = listed.order.parts[self.part][index as usize];
                let place = rank as u32 as usize;
                let chunk = &listed.chunks[place / CHUNK];
                let splat = &chunk.splats[place % CHUNK];
                let velocity = chunk.velocities.get(place % CHUNK);
                return Some(Step { rank: ((rank >> 32) as u32, splat.index), splat, velocity });
            }
            if self.part >= self.listed.lists.len() {
                return None;
            }
            self.part += 1;
            self.open();
        }
    }
}

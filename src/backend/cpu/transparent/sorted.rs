//! Passes `sort` and `list`: splats in the order of depth, in lists by tile.
//!
//! The order is that of the depths of centres, and of indices where depths are equal. It is cut into parts of some
//! thousand splats, each sorted and listed by itself, in parallel; where the cuts lie changes nothing in the order.

use rayon::prelude::*;

use super::composite::SplatBatch;
use super::project::Projected;
use crate::backend::cpu::tiles::{Band, TILE, TileRect};
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

/// The order of depth of the splats of some objects, which several samples may share.
#[derive(Debug, Default)]
pub(super) struct Order {
    /// Ranks, rising, part by part.
    pub parts: Vec<Vec<Rank>>,
}

impl Order {
    /// Bytes of one splat.
    pub(super) const BYTES: usize = 2 * size_of::<Rank>();

    /// The order of all splats of `chunks`.
    pub(super) fn of(chunks: &[Projected]) -> Self {
        let ranks = |(chunk, projected): (usize, &Projected)| -> Vec<Rank> {
            let place = |i: usize| (chunk * CHUNK + i) as u64;
            projected
                .splats
                .iter()
                .enumerate()
                .map(|(i, splat)| u64::from(key_of(splat.depth)) << 32 | place(i))
                .collect()
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
pub(super) struct Lists {
    /// For each tile, where its list starts in `entries`; one more at the end.
    starts: Vec<u32>,
    /// Indices into the part, rising.
    entries: Vec<u32>,
    /// Indices of the splats that touch more than `WIDE` tiles, rising.
    wide: Vec<u32>,
}

/// The tiles that `bounds` touch: first and last column, first and last row. `None`: no tile.
fn tiles_of(bounds: [u16; 4]) -> Option<[usize; 4]> {
    let [x0, x1, ..] = bounds;
    (x0 <= x1).then(|| bounds.map(|pixel| usize::from(pixel) / TILE))
}

/// Number of tiles.
fn count([x0, x1, y0, y1]: [usize; 4]) -> usize {
    (x1 + 1 - x0) * (y1 + 1 - y0)
}

/// Lists in which a splat with these bounds is.
pub(super) fn tiles_listed(bounds: [u16; 4]) -> usize {
    tiles_of(bounds).map_or(0, |tiles| if count(tiles) > WIDE { 1 } else { count(tiles) })
}

/// Splats of a time sample, in an order, by tile.
#[derive(Clone, Copy, Debug)]
pub(super) struct Listed<'a> {
    pub chunks: &'a [Projected],
    pub order: &'a Order,
    pub lists: &'a [Lists],
}

impl<'a> Listed<'a> {
    /// Most bytes of one splat.
    pub(super) const BYTES: usize = WIDE * size_of::<u32>();

    #[inline(always)]
    fn bounds(&self, place: usize) -> [u16; 4] {
        self.chunks[place / CHUNK].bounds[place % CHUNK]
    }

    #[inline(always)]
    fn splat(&self, place: usize) -> &GaussianSplat {
        &self.chunks[place / CHUNK].splats[place % CHUNK]
    }

    #[inline(always)]
    fn velocity(&self, place: usize) -> Option<&[f32; 2]> {
        self.chunks[place / CHUNK].velocities.get(place % CHUNK)
    }

    /// May any splat touch the tile? Wide splats are not looked at one by one.
    pub(super) fn reaches(&self, index: usize) -> bool {
        self.lists.iter().any(|lists| lists.starts[index] < lists.starts[index + 1] || !lists.wide.is_empty())
    }

    /// Walks over the splats of a tile, the nearest first.
    pub(super) fn walk(self, tile: &'a TileRect, index: usize) -> Walk<'a> {
        let mut walk = Walk { listed: self, tile, index, part: 0, list: &[], next: 0, merged: Vec::new() };
        walk.open();
        walk
    }
}

fn place_of(rank: Rank) -> usize {
    rank as u32 as usize
}

/// Lists splats by the tiles of `band`.
pub(super) fn lists(chunks: &[Projected], order: &Order, band: &Band) -> Vec<Lists> {
    order.parts.par_iter().map(|part| list(chunks, part, band)).collect()
}

fn list(chunks: &[Projected], part: &[Rank], band: &Band) -> Lists {
    let mut lists = Lists { starts: vec![0; band.len() + 2], ..Lists::default() };
    let Lists { starts, entries, wide } = &mut lists;
    let first_row = band.tile_rows[0];
    // Each once from the chunks, which is what takes time.
    let bounds = part.iter().map(|&rank| chunks[place_of(rank) / CHUNK].bounds[place_of(rank) % CHUNK]);
    let bounds: Vec<[u16; 4]> = bounds.collect();
    let narrow = |bounds: [u16; 4]| tiles_of(bounds).filter(|&tiles| count(tiles) <= WIDE);
    let rows = |bounds: [u16; 4], visit: &mut dyn FnMut(usize, usize)| {
        let Some([x0, x1, y0, y1]) = narrow(bounds) else { return };
        for y in y0..=y1 {
            visit((y - first_row) * band.tiles_x + x0, x1 + 1 - x0);
        }
    };
    // Counting sort: counts, then starts, then entries; `starts` is moved one ahead so that filling restores it.
    for (index, &bounds) in bounds.iter().enumerate() {
        if narrow(bounds).is_none() && tiles_of(bounds).is_some() {
            wide.push(index as u32);
        }
        rows(bounds, &mut |first, count| starts[first + 2..][..count].iter_mut().for_each(|start| *start += 1));
    }
    let mut sum = 0;
    for start in &mut *starts {
        sum += *start;
        *start = sum;
    }
    entries.resize(sum as usize, 0);
    for (index, &bounds) in (0..).zip(&bounds) {
        rows(bounds, &mut |first, count| {
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
    listed: Listed<'a>,
    tile: &'a TileRect,
    index: usize,
    part: usize,
    /// The list of the tile in `part`, where that part has no wide splats that touch the tile.
    list: &'a [u32],
    /// Else both together.
    merged: Vec<u32>,
    next: usize,
}

impl Walk<'_> {
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
                let tiles = tiles_of(self.listed.bounds(place_of(part[index as usize])));
                tiles.is_some_and(|[x0, x1, y0, y1]| (x0..=x1).contains(&x) && (y0..=y1).contains(&y))
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

    fn rest(&self) -> &[u32] {
        let list = if self.merged.is_empty() { self.list } else { &self.merged };
        &list[self.next..]
    }

    /// The next splat's depth as an integer, and its index among all Gaussians of the frame.
    pub(super) fn peek(&self) -> Option<(u32, u32)> {
        let &index = self.rest().first()?;
        let rank = self.listed.order.parts[self.part][index as usize];
        Some(((rank >> 32) as u32, self.listed.splat(place_of(rank)).index))
    }

    /// Moves on over `count` splats of the open list.
    fn advance(&mut self, count: usize) {
        self.next += count;
        if self.rest().is_empty() {
            self.part += 1;
            self.open();
        }
    }

    /// Appends the next splat to `batch`, if `wants` its bounds.
    pub(super) fn take_one(&mut self, batch: &mut SplatBatch, wants: impl Fn([u16; 4]) -> bool) {
        if let Some(&index) = self.rest().first() {
            let place = place_of(self.listed.order.parts[self.part][index as usize]);
            if wants(self.listed.bounds(place)) {
                batch.push(self.listed.splat(place), self.listed.velocity(place));
            }
            self.advance(1);
        }
    }

    /// Appends the next splats to `batch`, those of which `wants` the bounds, as many as have room. False at the end.
    /// `all`: it wants all, so nobody need look at bounds, which takes time.
    pub(super) fn take(&mut self, batch: &mut SplatBatch, all: bool, wants: impl Fn([u16; 4]) -> bool) -> bool {
        let room = batch.room();
        let listed = self.listed;
        let count = self.rest().len().min(room);
        if count == 0 {
            return false;
        }
        let part = &listed.order.parts[self.part];
        // Places first: short loops have more loads under way than one long loop.
        let mut places = [0; SplatBatch::SIZE];
        for (place, &index) in places.iter_mut().zip(&self.rest()[..count]) {
            *place = place_of(part[index as usize]);
        }
        let mut kept = 0;
        if all {
            kept = count;
        } else {
            for i in 0..count {
                let place = places[i];
                places[kept] = place;
                kept += usize::from(wants(listed.bounds(place)));
            }
        }
        for &place in &places[..kept] {
            batch.push(listed.splat(place), listed.velocity(place));
        }
        self.advance(count);
        true
    }
}

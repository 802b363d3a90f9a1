//! Pass `bin`: the splats of one chunk to lists per tile, in surfel order.
//!
//! In: splats of a chunk. Out: for each tile of the chunk's own rectangle, the indices of the splats that may touch it. A
//! splat that touches very many tiles is listed once, apart, so that the lists stay bounded. Order-free.

use super::swept::Hull;
use super::tiles::{Band, TILE, TileRect};
use crate::layout::{Splat, SweptSplat};

/// Splats that touch more tiles than this are kept in a list of their own.
const WIDE: usize = 64;

/// What touches tiles.
pub(super) trait Tiled {
    /// First and last row of tiles.
    fn tile_rows(&self) -> [usize; 2];

    /// First and last tile column, in one of these rows; none if the first is not at most the last.
    fn tile_columns(&self, row: usize) -> [usize; 2];
}

impl Tiled for Splat {
    fn tile_rows(&self) -> [usize; 2] {
        [self.bounds[2], self.bounds[3]].map(tile_of)
    }

    fn tile_columns(&self, _row: usize) -> [usize; 2] {
        [self.bounds[0], self.bounds[1]].map(tile_of)
    }
}

impl Tiled for SweptSplat {
    fn tile_rows(&self) -> [usize; 2] {
        [self.bounds[2], self.bounds[3]].map(tile_of)
    }

    fn tile_columns(&self, row: usize) -> [usize; 2] {
        let [x0, x1] = [self.bounds[0], self.bounds[1]].map(tile_of);
        if x0 == x1 && self.bounds[2] / TILE as u16 == self.bounds[3] / TILE as u16 {
            return [x0, x1];
        }
        let (first, last) = ((row * TILE) as f32, (row * TILE + TILE - 1) as f32);
        let [first, last] = Hull::of(self).columns(first, last);
        if first > last { [1, 0] } else { [first as usize / TILE, last as usize / TILE] }
    }
}

fn tile_of(pixel: u16) -> usize {
    usize::from(pixel) / TILE
}

/// The binned splats of one chunk of surfels.
#[derive(Debug)]
pub(super) struct Binned<S = Splat> {
    /// Splats, in surfel order.
    pub splats: Vec<S>,
    /// What each shows: a number for each channel; empty where only weights are wanted.
    pub values: Vec<f32>,
    /// First tile column and row of the rectangle, and its width and height in tiles.
    rect: [usize; 4],
    /// For each tile of the rectangle, where its list starts in `entries`; one more at the end.
    starts: Vec<u32>,
    /// Indices into `splats`.
    entries: Vec<u32>,
    /// Indices of the splats that touch more than `WIDE` tiles.
    wide: Vec<u32>,
}

impl<S> Default for Binned<S> {
    fn default() -> Self {
        Self {
            splats: Vec::new(),
            values: Vec::new(),
            rect: [0; 4],
            starts: Vec::new(),
            entries: Vec::new(),
            wide: Vec::new(),
        }
    }
}

impl<S: Tiled> Binned<S> {
    /// Most bytes that a chunk of `surfels` surfels with `channels` values each can take in `band`.
    pub(super) fn most_bytes(surfels: usize, channels: usize, band: &Band) -> u64 {
        (surfels * (size_of::<S>() + channels * size_of::<f32>() + WIDE * size_of::<u32>())
            + (band.len() + 1) * size_of::<u32>()) as u64
    }

    /// Bytes that the chunk takes now.
    pub(super) fn bytes(&self) -> u64 {
        let words = self.starts.capacity() + self.entries.capacity() + self.wide.capacity();
        (self.splats.capacity() * size_of::<S>() + self.values.capacity() * size_of::<f32>() + words * size_of::<u32>())
            as u64
    }

    /// Lists `self.splats` by tile.
    pub(super) fn bin(&mut self) {
        let mut rect = [u16::MAX as usize, 0, u16::MAX as usize, 0];
        self.wide.clear();
        self.entries.clear();
        self.starts.clear();
        for (index, splat) in self.splats.iter().enumerate() {
            let [y0, y1] = splat.tile_rows();
            let mut touched = 0;
            let mut reach = [u16::MAX as usize, 0];
            for [x0, x1] in (y0..=y1).map(|row| splat.tile_columns(row)) {
                if x0 <= x1 {
                    touched += x1 + 1 - x0;
                    reach = [reach[0].min(x0), reach[1].max(x1)];
                }
            }
            if touched > WIDE {
                self.wide.push(index as u32);
            } else if touched > 0 {
                rect = [rect[0].min(reach[0]), rect[1].max(reach[1]), rect[2].min(y0), rect[3].max(y1)];
            }
        }
        if rect[0] > rect[1] {
            rect = [0, 0, 0, 0];
        }
        self.rect = [rect[0], rect[2], rect[1] + 1 - rect[0], rect[3] + 1 - rect[2]];
        let width = self.rect[2];
        // Counting sort: counts, then starts, then entries; `starts` is moved one ahead so that filling restores it.
        self.starts.resize(width * self.rect[3] + 2, 0);
        let starts = &mut self.starts;
        visit_listed(&self.splats, &self.wide, |_, row, [x0, x1]| {
            let row = (row - rect[2]) * width;
            for x in x0..=x1 {
                starts[row + x - rect[0] + 2] += 1;
            }
        });
        let mut sum = 0;
        for start in &mut *starts {
            sum += *start;
            *start = sum;
        }
        self.entries.resize(sum as usize, 0);
        let entries = &mut self.entries;
        visit_listed(&self.splats, &self.wide, |index, row, [x0, x1]| {
            let row = (row - rect[2]) * width;
            for x in x0..=x1 {
                let next = &mut starts[row + x - rect[0] + 1];
                entries[*next as usize] = index;
                *next += 1;
            }
        });
    }

    /// Indices of the splats that may touch `tile`, rising. `scratch` is used where two lists must be merged.
    pub(super) fn list<'a>(&'a self, tile: &TileRect, scratch: &'a mut Vec<u32>) -> &'a [u32] {
        let [x0, y0, width, height] = self.rect;
        let [x, y] = tile.tile;
        let entries = if (x0..x0 + width).contains(&x) && (y0..y0 + height).contains(&y) {
            let index = (y - y0) * width + x - x0;
            &self.entries[self.starts[index] as usize..self.starts[index + 1] as usize]
        } else {
            &[]
        };
        if self.wide.is_empty() {
            return entries;
        }
        scratch.clear();
        scratch.extend_from_slice(entries);
        scratch.extend(self.wide.iter().filter(|&&index| {
            let splat = &self.splats[index as usize];
            let [y0, y1] = splat.tile_rows();
            let columns = |y| {
                let [x0, x1] = splat.tile_columns(y);
                x0..=x1
            };
            (y0..=y1).contains(&y) && columns(y).contains(&x)
        }));
        scratch.sort_unstable();
        scratch
    }
}

/// Calls `visit(index, row, columns)` for each row of tiles that each splat touches, but for the splats in `wide`.
#[inline(always)]
fn visit_listed<S: Tiled>(splats: &[S], wide: &[u32], mut visit: impl FnMut(u32, usize, [usize; 2])) {
    let mut wide = wide.iter().copied().peekable();
    for (index, splat) in (0..).zip(splats) {
        if wide.next_if_eq(&index).is_some() {
            continue;
        }
        let [y0, y1] = splat.tile_rows();
        for row in y0..=y1 {
            let [x0, x1] = splat.tile_columns(row);
            if x0 <= x1 {
                visit(index, row, [x0, x1]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn splat(bounds: [u16; 4]) -> Splat {
        Splat { bounds, ..Splat::zeroed() }
    }

    #[test]
    fn lists_hold_each_splat_once_in_order() {
        let size = [32 * 12, 32 * 12];
        let last = 32 * 12 - 1;
        let splats = vec![
            splat([0, 5, 0, 5]),
            splat([30, 40, 30, 40]),
            splat([0, last, 0, last]), // wide: 144 tiles
            splat([33, 34, 0, 5]),
            splat([31, 31, 31, 31]),
            splat([352, last, 352, last]),
        ];
        let mut binned = Binned { splats: splats.clone(), ..Binned::default() };
        binned.bin();
        let band = Band::new(size, [0, 12]);
        let mut scratch = Vec::new();
        for index in 0..band.len() {
            let tile = band.tile(index);
            let [px, py] = tile.origin.map(|v| v as u16);
            let want: Vec<u32> = (0..splats.len() as u32)
                .filter(|&i| {
                    let [x0, x1, y0, y1] = splats[i as usize].bounds;
                    x0 < px + 32 && x1 >= px && y0 < py + 32 && y1 >= py
                })
                .collect();
            assert_eq!(binned.list(&tile, &mut scratch), want, "tile {:?}", tile.tile);
        }
    }

    #[test]
    fn no_splats_no_lists() {
        let mut binned: Binned<Splat> = Binned::default();
        binned.bin();
        let tile = Band::new([64, 64], [0, 2]).tile(0);
        assert!(binned.list(&tile, &mut Vec::new()).is_empty());
    }
}

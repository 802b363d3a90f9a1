//! Pass `bin`: the splats of one chunk to lists per tile, in surfel order.
//!
//! In: splats of a chunk. Out: for each tile of the chunk's own rectangle, the indices of the splats that may touch it.
//! Splats that touch very many tiles have a list of their own, so that the lists stay bounded. Order-free.

use super::swept::Hull;
use super::tiles::{Band, TILE, TileRect};
use crate::layout::{EwaSplat, Splat, SweptFilter, SweptSplat};

/// Splats that touch more tiles than this are in a list of their own.
const WIDE: usize = 64;

/// What touches tiles.
pub(in crate::backend) trait Tiled {
    /// Bytes of what a splat may have beside itself.
    const BESIDE: usize = 0;

    /// The pixels that may be touched, as `PixelRect::bounds` has them.
    fn bounds(&self) -> [u16; 4];

    /// First and last tile column in tile row `row`, if more than one tile is touched. None where the first is after
    /// the last.
    fn tile_columns(&self, _row: usize) -> [usize; 2] {
        let [x0, x1, _, _] = Span::of(self).0.map(usize::from);
        [x0, x1]
    }
}

impl Tiled for Splat {
    fn bounds(&self) -> [u16; 4] {
        self.bounds
    }
}

impl Tiled for EwaSplat {
    fn bounds(&self) -> [u16; 4] {
        self.listed_bounds
    }
}

impl Tiled for SweptSplat {
    const BESIDE: usize = size_of::<SweptFilter>();

    fn bounds(&self) -> [u16; 4] {
        self.bounds
    }

    fn tile_columns(&self, row: usize) -> [usize; 2] {
        let (first, last) = ((row * TILE) as f32, (row * TILE + TILE - 1) as f32);
        let [first, last] = Hull::of(self).columns(first, last);
        if first > last { [1, 0] } else { [first as usize / TILE, last as usize / TILE] }
    }
}

/// First and last column of tiles, then first and last row, about what a splat touches.
#[derive(Clone, Copy, Debug)]
struct Span([u16; 4]);

impl Span {
    /// Touches nothing.
    const NONE: Self = Self([0, 1, 1, 0]);

    #[inline(always)]
    fn of(splat: &(impl Tiled + ?Sized)) -> Self {
        Self(splat.bounds().map(|pixel| pixel / TILE as u16))
    }

    #[inline(always)]
    fn is_one_tile(self) -> bool {
        self.0[0] == self.0[1] && self.0[2] == self.0[3]
    }

    /// Calls `visit(row, columns)` for each row of tiles that the splat touches.
    #[inline(always)]
    fn rows(self, splat: &impl Tiled, mut visit: impl FnMut(usize, [usize; 2])) {
        let [x0, _, y0, y1] = self.0.map(usize::from);
        if self.is_one_tile() {
            return visit(y0, [x0, x0]);
        }
        for row in y0..=y1 {
            let columns = splat.tile_columns(row);
            if columns[0] <= columns[1] {
                visit(row, columns);
            }
        }
    }
}

/// The binned splats of one chunk of surfels.
#[derive(Debug)]
pub(in crate::backend) struct Binned<S = Splat> {
    /// Splats, in surfel order.
    pub splats: Vec<S>,
    /// The filtered kernel of each splat; empty where none is filtered.
    pub filters: Vec<SweptFilter>,
    /// What each shows: a number for each channel; empty where only weights are wanted.
    pub values: Vec<f32>,
    /// Scratch of `bin`, stored for its memory.
    spans: Vec<Span>,
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
            filters: Vec::new(),
            values: Vec::new(),
            spans: Vec::new(),
            rect: [0; 4],
            starts: Vec::new(),
            entries: Vec::new(),
            wide: Vec::new(),
        }
    }
}

impl<S: Tiled> Binned<S> {
    /// Most bytes that a chunk of `surfels` surfels with `channels` values each can take in `band`.
    pub(in crate::backend) fn most_bytes(surfels: usize, channels: usize, band: &Band) -> u64 {
        (surfels
            * (size_of::<S>() + S::BESIDE + size_of::<Span>() + channels * size_of::<f32>() + WIDE * size_of::<u32>())
            + (band.len() + 1) * size_of::<u32>()) as u64
    }

    /// Bytes that the chunk takes now.
    pub(in crate::backend) fn bytes(&self) -> u64 {
        let words = self.values.capacity() + self.starts.capacity() + self.entries.capacity() + self.wide.capacity();
        let of_splats = self.splats.capacity() * size_of::<S>() + self.spans.capacity() * size_of::<Span>();
        let of_splats = of_splats + self.filters.capacity() * size_of::<SweptFilter>();
        (of_splats + words * size_of::<u32>()) as u64
    }

    /// Lists `self.splats` by tile.
    pub(in crate::backend) fn bin(&mut self) {
        let Self { splats, spans, starts, entries, wide, .. } = self;
        wide.clear();
        entries.clear();
        starts.clear();
        spans.clear();
        spans.extend(splats.iter().map(Span::of));
        let mut rect = [u16::MAX as usize, 0, u16::MAX as usize, 0];
        for (index, (splat, span)) in splats.iter().zip(&mut *spans).enumerate() {
            let mut touched = 0;
            let mut grown = rect;
            span.rows(splat, |row, [x0, x1]| {
                touched += x1 + 1 - x0;
                grown = [grown[0].min(x0), grown[1].max(x1), grown[2].min(row), grown[3].max(row)];
            });
            if touched <= WIDE {
                rect = grown;
            } else {
                wide.push(index as u32);
                // Apart, so not listed.
                *span = Span::NONE;
            }
        }
        if rect[0] > rect[1] {
            rect = [0, 0, 0, 0];
        }
        self.rect = [rect[0], rect[2], rect[1] + 1 - rect[0], rect[3] + 1 - rect[2]];
        let [x, y, width, height] = self.rect;
        // Counting sort: counts, then starts, then entries; `starts` is moved one ahead so that filling restores it.
        starts.resize(width * height + 2, 0);
        for (splat, span) in splats.iter().zip(&*spans) {
            span.rows(splat, |row, [x0, x1]| {
                let first = (row - y) * width + x0 - x;
                starts[first + 2..first + x1 - x0 + 3].iter_mut().for_each(|start| *start += 1);
            });
        }
        let mut sum = 0;
        for start in &mut *starts {
            sum += *start;
            *start = sum;
        }
        entries.resize(sum as usize, 0);
        for (index, (splat, span)) in (0..).zip(splats.iter().zip(&*spans)) {
            span.rows(splat, |row, [x0, x1]| {
                let first = (row - y) * width + x0 - x;
                for next in &mut starts[first + 1..first + x1 - x0 + 2] {
                    entries[*next as usize] = index;
                    *next += 1;
                }
            });
        }
    }

    /// Indices of the splats that may touch `tile`, rising. `scratch` is used where two lists must be merged.
    pub(in crate::backend) fn list<'a>(&'a self, tile: &TileRect, scratch: &'a mut Vec<u32>) -> &'a [u32] {
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
            let mut touches = false;
            Span::of(splat).rows(splat, |row, [x0, x1]| touches |= row == y && (x0..=x1).contains(&x));
            touches
        }));
        scratch.sort_unstable();
        scratch
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

//! The CPU's passes of an interval one at a time, for comparison with another backend's.
//!
//! What they read is made by the constructors that rendering uses ([`Scope`], [`SweepGroup`], [`MapGroup`],
//! [`PublishedSweepGroup`]). Only tiles have another size.

use super::posed::{self, Posed, whole_chunks};
use super::tiles_of_edge::{put_rows, rect, take_rows, touches};
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::job::Job;
use crate::backend::cpu::paint::buffers::APRON_STRIDE;
use crate::backend::cpu::paint::visibility::visibility;
use crate::backend::cpu::published::map::{self, Map, MapTile};
use crate::backend::cpu::published::{self, MapGroup, PublishedMask, PublishedSweepGroup};
use crate::backend::cpu::resolve::TileFilm;
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::swept::{self, SweepGroup, slices};
use crate::backend::cpu::tile_buffers::{CoverageMask, TileBuffers};
use crate::backend::cpu::tile_runner::TileWork;
use crate::backend::cpu::tiles::{STRIDE, TILE};
use crate::backend::cpu::values;
use crate::layout::{FilteredSplat, SweptFilter, SweptSplat};

/// Sums of a tile: channel by channel, `edge` x `edge`; and when kernels cover.
#[derive(Clone, Debug, Default)]
pub(super) struct SweptSums {
    pub channels: Vec<Vec<f32>>,
    /// The times at which discs cover, and at which filtered kernels do, or the low-pass discs of published kernels.
    pub times: [Vec<u32>; 2],
    /// The other planes of the mask: one of published kernels, else three.
    pub weights: Vec<Vec<f32>>,
}

/// The map of one group, in tiles of another size than the CPU's own.
pub(super) struct MapTwins<'a> {
    pub group: MapGroup<'a>,
    /// Edge of a tile, at most 32 pixels.
    pub edge: usize,
}

impl MapTwins<'_> {
    /// Splats at mid-interval.
    pub(super) fn project(&self) -> Vec<Posed<'_>> {
        posed::project(&self.group.scope)
    }

    /// Thresholds of a tile of the map.
    pub(super) fn visibility(&self, splats: &[Posed<'_>], tile: [usize; 2]) -> Vec<f32> {
        let mut buffers = TileBuffers::default();
        buffers.paint.clear_depths(false, false);
        let rect = rect(&self.group.scope.band, tile, self.edge);
        for Posed { chunk, splats } in splats {
            let list = touches(splats.iter().map(|splat| splat.bounds), tile, self.edge);
            visibility(splats, &list, self.group.scope.depths(chunk), &rect, &mut buffers.paint);
        }
        take_rows(&buffers.paint.threshold, APRON_STRIDE, self.edge)
    }

    /// A tile of the map.
    pub(super) fn store(&self, tile: [usize; 2], thresholds: &[f32]) -> Vec<f32> {
        let mut buffers = TileBuffers::default();
        buffers.paint.clear_depths(false, false);
        put_rows(thresholds, &mut buffers.paint.threshold, APRON_STRIDE, self.edge);
        let mut out: MapTile = [f32::INFINITY; TILE * TILE];
        map::store(&rect(&self.group.scope.band, tile, self.edge), &buffers.paint.threshold, &mut out);
        take_rows(&out, TILE, self.edge)
    }

    /// The map, from its tiles in rows of `tiles_x`.
    pub(super) fn map(&self, tiles: &[Vec<f32>], tiles_x: usize) -> Map {
        let mut map = Map::default();
        let around = self.group.scope.band;
        let (edge, rows) = (self.edge, tiles.len() / tiles_x.max(1));
        for (index, out) in map.lay(&around).iter_mut().enumerate() {
            let [x0, y0] = around.tile(index).origin;
            for (i, out) in out.iter_mut().enumerate() {
                let (x, y) = (x0 + i % TILE, y0 + i / TILE);
                if x / edge < tiles_x && y / edge < rows {
                    *out = tiles[y / edge * tiles_x + x / edge][y % edge * edge + x % edge];
                }
            }
        }
        map
    }
}

/// The sums of a tile that passes `attribute` write, channel by channel.
fn channels_of(buffers: &TileBuffers, channels: usize, edge: usize) -> Vec<Vec<f32>> {
    (0..channels).map(|c| take_rows(&buffers.sums[c * STRIDE..], channels * STRIDE, edge)).collect()
}

/// The film that `resolve` makes of the sums of a tile: plane by plane, `edge` x `edge`. `put`: writes the masks.
fn film_of(
    scope: &Scope<'_>,
    edge: usize,
    tile: [usize; 2],
    sums: &SweptSums,
    put: impl FnOnce(&mut TileBuffers),
    resolve: impl FnOnce(&mut Job<'_, SweptSplat, TileFilm>),
) -> Vec<Vec<f32>> {
    let channels = scope.channels.count;
    let mut buffers = TileBuffers::default();
    buffers.clear_sums(channels);
    for (c, channel) in sums.channels.iter().enumerate() {
        put_rows(channel, &mut buffers.sums[c * STRIDE..], channels * STRIDE, edge);
    }
    put(&mut buffers);
    let (mut film, mut scratch) = (TileFilm::default(), Vec::new());
    resolve(&mut Job {
        chunks: &[],
        binned: &[],
        tile: rect(&scope.band, tile, edge),
        index: 0,
        buffers: &mut buffers,
        scratch: &mut scratch,
        out: &mut film,
        first: true,
    });
    (0..scope.planes.count).map(|p| take_rows(&film.values[p * TILE * TILE..], TILE, edge)).collect()
}

/// Writes planes of `edge` x `edge` to those of a tile.
fn put_planes<T: Copy, const N: usize>(from: &[Vec<T>], to: [&mut Vec<T>; N], edge: usize) {
    from.iter().zip(to).for_each(|(from, to)| put_rows(from, to, STRIDE, edge));
}

/// The kernels in motion of one group, in tiles of another size than the CPU's own.
pub(super) struct SweepTwins<'a> {
    pub group: SweepGroup<'a>,
    /// Edge of a tile, at most 32 pixels.
    pub edge: usize,
}

impl SweepTwins<'_> {
    fn scope(&self) -> &Scope<'_> {
        &self.group.scope
    }

    /// Kernels in motion, and their filtered kernels.
    pub(super) fn sweep(&self) -> Vec<Posed<'_, FilteredSplat>> {
        let kernels_of = |chunk| {
            let mut binned = Binned::default();
            self.group.project(&chunk, &mut binned);
            let both = binned.splats.into_iter().zip(binned.filters);
            Posed { chunk, splats: both.map(|(splat, filtered)| FilteredSplat { splat, filtered }).collect() }
        };
        whole_chunks(self.scope()).into_iter().map(kernels_of).collect()
    }

    /// Thresholds of a tile, slice by slice; then the nearest depths, where they are kept.
    pub(super) fn visibility(&self, kernels: &[Posed<'_, SweptSplat>], tile: [usize; 2]) -> Vec<Vec<f32>> {
        let count = self.group.interval.slices as usize;
        let mut buffers = TileBuffers::default();
        buffers.start_slices(count, self.scope().frame.keeps_nearest);
        let rect = rect(&self.scope().band, tile, self.edge);
        for Posed { chunk, splats } in kernels {
            let list = touches(splats.iter().map(|splat| splat.bounds), tile, self.edge);
            slices::visibility(splats, &list, self.scope().depths(chunk), &rect, &mut buffers.slices);
        }
        let planes = [&buffers.slices.threshold, &buffers.slices.nearest].into_iter().filter(|plane| !plane.is_empty());
        let slice = |plane: &[f32], i: usize| take_rows(&plane[i * STRIDE..], count * STRIDE, self.edge);
        planes.flat_map(|plane| (0..count).map(move |i| slice(plane, i))).collect()
    }

    /// Sums of a tile of the image, of which `slices` are those of [`Self::visibility`]. `filters`: the filtered
    /// kernels of each of `kernels`.
    pub(super) fn attribute(
        &self,
        kernels: &[Posed<'_, SweptSplat>],
        filters: &[Vec<SweptFilter>],
        tile: [usize; 2],
        slices: &[Vec<f32>],
    ) -> SweptSums {
        let channels = self.scope().channels.count;
        let mut buffers = TileBuffers::default();
        buffers.clear_sums(channels);
        buffers.coverage_mask.clear();
        let count = self.group.interval.slices as usize;
        buffers.start_slices(count, slices.len() > count);
        let planes = [&mut buffers.slices.threshold, &mut buffers.slices.nearest];
        for (plane, slices) in planes.into_iter().zip(slices.chunks(count)) {
            for (i, slice) in slices.iter().enumerate() {
                put_rows(slice, &mut plane[i * STRIDE..], count * STRIDE, self.edge);
            }
        }
        let rect = rect(&self.scope().band, tile, self.edge);
        for (Posed { chunk, splats }, filters) in kernels.iter().zip(filters) {
            let list = touches(splats.iter().map(|splat| splat.bounds), tile, self.edge);
            let mut values = Vec::new();
            values::values(splats, &self.scope().shown(chunk), &mut values);
            let swept = self.group.swept(chunk, &values);
            let TileBuffers { sums, coverage_mask, slices, .. } = &mut buffers;
            swept::attribute::attribute((splats, filters), &list, &swept, &rect, slices, sums, coverage_mask);
        }
        let CoverageMask { surface, filtered, loose, peak, side } = &buffers.coverage_mask;
        SweptSums {
            channels: channels_of(&buffers, channels, self.edge),
            times: [surface, filtered].map(|plane| take_rows(plane, STRIDE, self.edge)),
            weights: [loose, peak, side].map(|plane| take_rows(plane, STRIDE, self.edge)).to_vec(),
        }
    }

    /// Film of a tile after the group alone, not finished: plane by plane, `edge` x `edge`.
    pub(super) fn resolve(&self, tile: [usize; 2], sums: &SweptSums) -> Vec<Vec<f32>> {
        let put = |buffers: &mut TileBuffers| {
            buffers.coverage_mask.clear();
            let CoverageMask { surface, filtered, loose, peak, side } = &mut buffers.coverage_mask;
            put_planes(&sums.times, [surface, filtered], self.edge);
            put_planes(&sums.weights, [loose, peak, side], self.edge);
        };
        film_of(self.scope(), self.edge, tile, sums, put, |job| self.group.resolve(job))
    }
}

/// The published kernels in motion of one group, in tiles of another size than the CPU's own.
pub(super) struct PublishedTwins<'a> {
    pub group: PublishedSweepGroup<'a>,
    /// Edge of a tile, at most 32 pixels.
    pub edge: usize,
}

impl PublishedTwins<'_> {
    /// Kernels in motion.
    pub(super) fn sweep(&self) -> Vec<Posed<'_, SweptSplat>> {
        let kernels_of = |chunk| {
            let mut binned = Binned::default();
            self.group.project(&chunk, &mut binned);
            Posed { chunk, splats: binned.splats }
        };
        whole_chunks(&self.group.scope).into_iter().map(kernels_of).collect()
    }

    /// Sums of a tile of the image.
    pub(super) fn attribute(&self, kernels: &[Posed<'_, SweptSplat>], tile: [usize; 2]) -> SweptSums {
        let scope = &self.group.scope;
        let channels = scope.channels.count;
        let mut buffers = TileBuffers::default();
        buffers.clear_sums(channels);
        buffers.published_mask.clear();
        let rect = rect(&scope.band, tile, self.edge);
        for Posed { chunk, splats } in kernels {
            let list = touches(splats.iter().map(|splat| splat.bounds), tile, self.edge);
            let mut values = Vec::new();
            values::values(splats, &scope.shown(chunk), &mut values);
            let TileBuffers { sums, published_mask, .. } = &mut buffers;
            let swept = self.group.swept(chunk, &values);
            published::attribute::attribute(splats, &list, &swept, &rect, sums, published_mask);
        }
        let PublishedMask { surface, low_pass, loose } = &buffers.published_mask;
        SweptSums {
            channels: channels_of(&buffers, channels, self.edge),
            times: [surface, low_pass].map(|plane| take_rows(plane, STRIDE, self.edge)),
            weights: vec![take_rows(loose, STRIDE, self.edge)],
        }
    }

    /// Film of a tile after the group alone, not finished: plane by plane, `edge` x `edge`.
    pub(super) fn resolve(&self, tile: [usize; 2], sums: &SweptSums) -> Vec<Vec<f32>> {
        let put = |buffers: &mut TileBuffers| {
            buffers.published_mask.clear();
            let PublishedMask { surface, low_pass, loose } = &mut buffers.published_mask;
            put_planes(&sums.times, [surface, low_pass], self.edge);
            put_planes(&sums.weights, [loose], self.edge);
        };
        film_of(&self.group.scope, self.edge, tile, sums, put, |job| self.group.resolve(job))
    }
}

//! The CPU's passes of an interval one at a time, for comparison with another backend's.
//!
//! What they read is made by the constructors that rendering uses ([`Scope`], [`MapGroup`], [`SweepGroup`]). Only tiles
//! have another size.

use super::splat_twins::{self, Posed, whole_chunks};
use super::tiles_of_edge::{put_rows, rect, take_rows, touches};
use crate::backend::cpu::attribute::{self, Tally};
use crate::backend::cpu::chunk::Chunk;
use crate::backend::cpu::job::Job;
use crate::backend::cpu::resolve::TileFilm;
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::static_tile::StaticTile;
use crate::backend::cpu::swept::map::{self, Map, MapTile};
use crate::backend::cpu::swept::{self, MapGroup, SweepGroup, slices};
use crate::backend::cpu::tile_buffers::TileBuffers;
use crate::backend::cpu::tiles::{STRIDE, TILE};
use crate::backend::cpu::values;
use crate::backend::cpu::visibility;
use crate::layout::{Channels, FilteredSplat, SweptFilter, SweptSplat};
use crate::plan::Objects;

/// Sums of a tile: channel by channel, `edge` x `edge`; and when kernels cover.
#[derive(Clone, Debug, Default)]
pub(super) struct SweptSums {
    pub channels: Vec<Vec<f32>>,
    pub surface: Vec<u32>,
    pub low_pass: Vec<u32>,
    pub loose: Vec<f32>,
    /// Empty without full EWA.
    pub peak: Vec<f32>,
    pub side: Vec<f32>,
}

/// The map of one group, in tiles of another size than the CPU's own.
pub(super) struct MapTwins<'a> {
    pub group: MapGroup<'a>,
    /// Edge of a tile, at most 32 pixels.
    pub edge: usize,
}

impl MapTwins<'_> {
    /// Splats at mid-interval.
    pub(super) fn project(&self, objects: Objects) -> Vec<Posed> {
        splat_twins::project(&self.group.scope, objects)
    }

    /// Thresholds of a tile of the map.
    pub(super) fn visibility(&self, splats: &[Posed], tile: [usize; 2]) -> Vec<f32> {
        let mut buffers = TileBuffers::default();
        buffers.clear_threshold();
        let rect = rect(&self.group.scope.band, tile, self.edge);
        for Posed { chunk, splats } in splats {
            let list = touches(splats.iter().map(|splat| splat.bounds), tile, self.edge);
            let depths = self.group.scope.depths(chunk);
            visibility::visibility(splats, &list, depths, &rect, &mut buffers.threshold);
        }
        take_rows(&buffers.threshold, STRIDE, self.edge)
    }

    /// Sums of weights of a tile of the map.
    pub(super) fn density(&self, splats: &[Posed], tile: [usize; 2], thresholds: &[f32]) -> Vec<f32> {
        let mut buffers = TileBuffers::default();
        buffers.clear_threshold();
        buffers.clear_sums(1, 1);
        put_rows(thresholds, &mut buffers.threshold, STRIDE, self.edge);
        let (channels, rect) = (Channels::weights(), rect(&self.group.scope.band, tile, self.edge));
        for Posed { chunk, splats } in splats {
            let list = touches(splats.iter().map(|splat| splat.bounds), tile, self.edge);
            let TileBuffers { threshold, sums, .. } = &mut buffers;
            let mut tally = Tally { sums, sample_coverage: &mut [], nearest: &mut [] };
            attribute::attribute(splats, &list, &self.group.weights(chunk, &channels), &rect, threshold, &mut tally);
        }
        take_rows(&buffers.sums, STRIDE, self.edge)
    }

    /// A tile of the map; `density` is empty where weights were not summed.
    pub(super) fn store(&self, tile: [usize; 2], thresholds: &[f32], density: &[f32]) -> Vec<[f32; 2]> {
        let mut buffers = TileBuffers::default();
        buffers.clear_threshold();
        put_rows(thresholds, &mut buffers.threshold, STRIDE, self.edge);
        if !density.is_empty() {
            buffers.clear_sums(1, 1);
            put_rows(density, &mut buffers.sums, STRIDE, self.edge);
        }
        let mut out: MapTile = [[f32::INFINITY; 2]; TILE * TILE];
        let rect = rect(&self.group.scope.band, tile, self.edge);
        map::store(&rect, &buffers.threshold, &buffers.sums, &mut out);
        take_rows(&out, TILE, self.edge)
    }

    /// The map, from its tiles in rows of `tiles_x`.
    pub(super) fn map(&self, tiles: &[Vec<[f32; 2]>], tiles_x: usize) -> Map {
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

    /// Kernels in motion.
    pub(super) fn sweep(&self, objects: Objects) -> Vec<Posed<SweptSplat>> {
        let kernels_of = |chunk: Chunk| {
            let (mut splats, surfels) = (Vec::new(), &self.scope().frame.objects[chunk.object].surfels);
            let view = self.scope().view(&chunk);
            swept::project::project(&view, self.group.ellipsoid(), surfels, chunk.surfels.clone(), &mut splats);
            Posed { chunk, splats }
        };
        whole_chunks(self.scope(), objects).into_iter().map(kernels_of).collect()
    }

    /// Kernels in motion, and those that full EWA makes of them.
    pub(super) fn filtered_sweep(&self, objects: Objects) -> Vec<Posed<FilteredSplat>> {
        let kernels_of = |chunk: Chunk| {
            let (mut splats, mut filters) = (Vec::new(), Vec::new());
            let surfels = &self.scope().frame.objects[chunk.object].surfels;
            let (view, range) = (self.scope().view(&chunk), chunk.surfels.clone());
            let ellipsoid = self.group.ellipsoid();
            swept::project::project_filtered(&view, ellipsoid, surfels, range, &mut splats, &mut filters);
            let both = splats.into_iter().zip(filters).map(|(splat, filtered)| FilteredSplat { splat, filtered });
            Posed { chunk, splats: both.collect() }
        };
        whole_chunks(self.scope(), objects).into_iter().map(kernels_of).collect()
    }

    /// Thresholds of a tile, slice by slice; none where kernels have no slices. `thresholds`: those of static objects.
    pub(super) fn visibility(
        &self,
        kernels: &[Posed<SweptSplat>],
        tile: [usize; 2],
        thresholds: &[f32],
    ) -> Vec<Vec<f32>> {
        let count = self.slices();
        let mut buffers = TileBuffers::default();
        buffers.clear_threshold();
        put_rows(thresholds, &mut buffers.threshold, STRIDE, self.edge);
        buffers.start_slices(count);
        let rect = rect(&self.scope().band, tile, self.edge);
        for Posed { chunk, splats } in kernels.iter().filter(|_| count > 0) {
            let list = touches(splats.iter().map(|splat| splat.bounds), tile, self.edge);
            slices::visibility(splats, &list, self.scope().depths(chunk), &rect, &mut buffers.slices);
        }
        let slice = |i: usize| take_rows(&buffers.slices.threshold[i * STRIDE..], count * STRIDE, self.edge);
        (0..count).map(slice).collect()
    }

    fn slices(&self) -> usize {
        if self.group.kernel.has_slices() { self.group.interval.slices as usize } else { 0 }
    }

    /// Sums of a tile of the image, of which `thresholds` are those of static objects, and `slices` those of slices.
    /// `filters`: the filtered kernels of each of `kernels`; none without full EWA.
    pub(super) fn attribute(
        &self,
        kernels: &[Posed<SweptSplat>],
        filters: &[Vec<SweptFilter>],
        tile: [usize; 2],
        thresholds: &[f32],
        slices: &[Vec<f32>],
    ) -> SweptSums {
        let channels = self.scope().channels.count;
        let mut buffers = self.clear();
        put_rows(thresholds, &mut buffers.threshold, STRIDE, self.edge);
        buffers.start_slices(slices.len());
        for (i, slice) in slices.iter().enumerate() {
            put_rows(slice, &mut buffers.slices.threshold[i * STRIDE..], slices.len() * STRIDE, self.edge);
        }
        let rect = rect(&self.scope().band, tile, self.edge);
        for (i, Posed { chunk, splats }) in kernels.iter().enumerate() {
            let list = touches(splats.iter().map(|splat| splat.bounds), tile, self.edge);
            let mut values = Vec::new();
            values::values(splats, &self.scope().shown(chunk), &mut values);
            let swept = self.group.swept(chunk, &values);
            let TileBuffers { threshold, sums, coverage_mask, slices, .. } = &mut buffers;
            if let Some(filters) = filters.get(i) {
                swept::filtered::attribute((splats, filters), &list, &swept, &rect, slices, sums, coverage_mask);
            } else {
                swept::attribute::attribute(splats, &list, &swept, &rect, threshold, slices, sums, coverage_mask);
            }
        }
        let channel = |c: usize| take_rows(&buffers.sums[c * STRIDE..], channels * STRIDE, self.edge);
        SweptSums {
            channels: (0..channels).map(channel).collect(),
            surface: take_rows(&buffers.coverage_mask.surface, STRIDE, self.edge),
            low_pass: take_rows(&buffers.coverage_mask.low_pass, STRIDE, self.edge),
            loose: take_rows(&buffers.coverage_mask.loose, STRIDE, self.edge),
            peak: self.plane_of_filters(&buffers.coverage_mask.peak),
            side: self.plane_of_filters(&buffers.coverage_mask.side),
        }
    }

    /// Film of a tile after the group alone, not finished: plane by plane, `edge` x `edge`. `picture`: that of static
    /// objects, empty where there is none.
    pub(super) fn resolve(&self, tile: [usize; 2], sums: &SweptSums, picture: &[Vec<f32>]) -> Vec<Vec<f32>> {
        let (channels, planes) = (self.scope().channels.count, self.scope().planes.count);
        let mut buffers = self.clear();
        for (c, channel) in sums.channels.iter().enumerate() {
            put_rows(channel, &mut buffers.sums[c * STRIDE..], channels * STRIDE, self.edge);
        }
        put_rows(&sums.surface, &mut buffers.coverage_mask.surface, STRIDE, self.edge);
        put_rows(&sums.low_pass, &mut buffers.coverage_mask.low_pass, STRIDE, self.edge);
        put_rows(&sums.loose, &mut buffers.coverage_mask.loose, STRIDE, self.edge);
        if self.group.filters() {
            put_rows(&sums.peak, &mut buffers.coverage_mask.peak, STRIDE, self.edge);
            put_rows(&sums.side, &mut buffers.coverage_mask.side, STRIDE, self.edge);
        }
        let mut of_static = StaticTile::default();
        of_static.film.values.resize(planes * TILE * TILE, 0.0);
        for (p, plane) in picture.iter().enumerate() {
            put_rows(plane, &mut of_static.film.values[p * TILE * TILE..], TILE, self.edge);
        }
        let (mut film, mut scratch) = (TileFilm::default(), Vec::new());
        let mut job = Job {
            chunks: &[],
            binned: &[],
            tile: rect(&self.scope().band, tile, self.edge),
            index: 0,
            buffers: &mut buffers,
            scratch: &mut scratch,
            out: &mut film,
        };
        self.group.resolve(&mut job, Some(&of_static).filter(|_| !picture.is_empty()));
        (0..planes).map(|p| take_rows(&film.values[p * TILE * TILE..], TILE, self.edge)).collect()
    }

    /// A plane that only full EWA has.
    fn plane_of_filters(&self, plane: &[f32]) -> Vec<f32> {
        if plane.is_empty() { Vec::new() } else { take_rows(plane, STRIDE, self.edge) }
    }

    fn clear(&self) -> TileBuffers {
        let mut buffers = TileBuffers::default();
        buffers.clear_threshold();
        buffers.clear_sums(self.scope().channels.count, 1);
        buffers.clear_coverage_mask(self.group.filters());
        buffers
    }
}

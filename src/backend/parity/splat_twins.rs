//! The CPU's passes of splats one at a time, for comparison with another backend's.
//!
//! What they read is made by the constructors that rendering uses ([`Scope`]). Only tiles have another size.

use super::tiles_of_edge::{put_rows, rect, take_rows, touches};
use crate::backend::cpu::chunk::{Chunk, chunks};
use crate::backend::cpu::clocks::Clocks;
use crate::backend::cpu::paint::attribute::{Filter, attribute};
use crate::backend::cpu::paint::buffers::{APRON_STRIDE, DepthLayer};
use crate::backend::cpu::paint::visibility::visibility;
use crate::backend::cpu::paint::{Kernel, RasterRays};
use crate::backend::cpu::published::LowPassSplat;
use crate::backend::cpu::resolve::TileFilm;
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::tile_buffers::TileBuffers;
use crate::backend::cpu::tiles::{Band, STRIDE, TILE};
use crate::backend::cpu::values;
use crate::film::FilmPlanes;
use crate::frame::{Frame, PosedGroup, Position};
use crate::layout::{Channels, Splat};
use crate::options::Prefilter;

/// Splats, or kernels in motion, of one object at one sample, in surfel order. A static object has those of the first
/// sample.
#[derive(Clone, Debug)]
pub(super) struct Posed<'a, S = Splat> {
    pub chunk: Chunk<'a>,
    pub splats: Vec<S>,
}

/// Sums of a tile: channel by channel, `edge` x `edge`; what follows the channels only for groups of several samples.
#[derive(Clone, Debug, Default)]
pub(super) struct Sums {
    pub channels: Vec<Vec<f32>>,
    pub sample_coverage: Vec<f32>,
    pub coverage: Vec<f32>,
    /// Coverage by static objects.
    pub of_static: Vec<f32>,
}

/// What the CPU makes of a frame, whatever the group.
pub(super) struct Context {
    pub channels: Channels,
    pub planes: FilmPlanes,
    clocks: Clocks,
}

impl Context {
    pub(super) fn of(frame: &Frame) -> Self {
        Self { channels: Channels::of(frame), planes: frame.film_planes(), clocks: Clocks::default() }
    }

    /// A group in `band`, as rendering has it.
    pub(super) fn scope<'a>(
        &'a self,
        frame: &'a Frame,
        position: &'a Position,
        group: &'a PosedGroup,
        band: Band,
    ) -> Scope<'a> {
        let Self { channels, planes, clocks } = self;
        Scope { frame, raster: &position.raster, group, band, planes, channels, clusters: &[], clocks }
    }
}

/// One group, in tiles of another size than the CPU's own.
#[derive(Clone, Copy)]
pub(super) struct SplatTwins<'a> {
    pub scope: Scope<'a>,
    /// Edge of a tile, at most 32 pixels.
    pub edge: usize,
}

/// The whole raster of `position`.
pub(super) fn whole(position: &Position) -> Band {
    let size = position.raster.size;
    Band::new(size, [0, (size[1] as usize).div_ceil(TILE)])
}

/// The chunks of rendering, those of one object and sample together.
pub(super) fn whole_chunks<'a>(scope: &Scope<'a>) -> Vec<Chunk<'a>> {
    let mut whole: Vec<Chunk<'_>> = Vec::new();
    for chunk in chunks(scope.frame, scope.group, false).0 {
        match whole.last_mut() {
            Some(last) if (last.sample, last.object) == (chunk.sample, chunk.object) => {
                last.surfels.end = chunk.surfels.end;
            }
            _ => whole.push(chunk),
        }
    }
    whole
}

/// The splats of all opaque objects, as `K` projects them.
pub(super) fn project<'a, K: Kernel>(scope: &Scope<'a>) -> Vec<Posed<'a, K>> {
    let splats_of = |chunk: Chunk<'a>| {
        let mut splats = Vec::new();
        K::project(&scope.view(&chunk), chunk.model.surfels(), chunk.surfels.clone(), &mut splats);
        Posed { chunk, splats }
    };
    whole_chunks(scope).into_iter().map(splats_of).collect()
}

impl<'a> SplatTwins<'a> {
    /// Do splats have low-pass discs?
    fn low_pass(&self) -> bool {
        self.scope.frame.prefilter == Prefilter::Approx
    }

    pub(super) fn project(&self) -> Vec<Posed<'a>> {
        if !self.low_pass() {
            return project(&self.scope);
        }
        let discs = |posed: Posed<'a, LowPassSplat>| Posed {
            chunk: posed.chunk,
            splats: posed.splats.into_iter().map(|splat| splat.0).collect(),
        };
        project(&self.scope).into_iter().map(discs).collect()
    }

    /// Splats of `posed` that may touch the tile.
    fn list(&self, posed: &Posed<'_>, tile: [usize; 2]) -> Vec<u32> {
        touches(posed.splats.iter().map(|splat| splat.bounds), tile, self.edge)
    }

    /// Thresholds of a tile, and the depths of the nearest discs where they are kept: `edge` x `edge`.
    pub(super) fn visibility(&self, posed: &[Posed<'_>], tile: [usize; 2]) -> (Vec<f32>, Vec<f32>) {
        let mut buffers = TileBuffers::default();
        buffers.paint.clear_depths(false, self.scope.frame.keeps_nearest);
        let rect = rect(&self.scope.band, tile, self.edge);
        for posed in posed {
            let (list, depths) = (self.list(posed, tile), self.scope.depths(&posed.chunk));
            visibility(&posed.splats, &list, depths, &rect, &mut buffers.paint);
        }
        let plane = |plane: &[f32]| match plane {
            [] => Vec::new(),
            _ => take_rows(plane, APRON_STRIDE, self.edge),
        };
        (plane(&buffers.paint.threshold), plane(&buffers.paint.nearest))
    }

    pub(super) fn attribute(&self, posed: &[Posed<'_>], tile: [usize; 2], thresholds: &[f32], nearest: &[f32]) -> Sums {
        let mut buffers = self.with_depths(thresholds, nearest);
        let rect = rect(&self.scope.band, tile, self.edge);
        let sight = RasterRays::new(self.scope.frame.near, self.scope.raster);
        for posed in posed {
            self.scope.turn(&posed.chunk, &mut buffers);
            let mut values = Vec::new();
            values::values(&posed.splats, &self.scope.shown(&posed.chunk), &mut values);
            let attributes = self.scope.attributes(&posed.chunk, &values);
            let depths = self.scope.depths(&posed.chunk);
            let filter = Filter { attributes, depths, sight, start: 0, ceiling: &[] };
            let list = self.list(posed, tile);
            let TileBuffers { paint, group_coverage, .. } = &mut buffers;
            let coverage = &mut group_coverage.sample_coverage;
            if self.low_pass() {
                let splats: &[LowPassSplat] = bytemuck::cast_slice(&posed.splats);
                attribute(splats, &list, &filter, &rect, paint, coverage);
            } else {
                attribute(&posed.splats, &list, &filter, &rect, paint, coverage);
            }
        }
        self.scope.end_turns(&mut buffers);
        self.sums(&buffers)
    }

    fn sums(&self, buffers: &TileBuffers) -> Sums {
        let channels = self.scope.channels.count;
        let plane = |values: &[f32]| match values {
            [] => Vec::new(),
            _ => take_rows(values, STRIDE, self.edge),
        };
        let sums = &buffers.paint.sums[DepthLayer::Band as usize];
        let channel = |c: usize| take_rows(&sums[c * STRIDE..], buffers.paint.row, self.edge);
        Sums {
            channels: (0..channels).map(channel).collect(),
            sample_coverage: plane(&buffers.group_coverage.sample_coverage),
            coverage: plane(&buffers.group_coverage.coverage),
            of_static: plane(&buffers.group_coverage.of_static),
        }
    }

    /// Film of a tile after the group alone: plane by plane, `edge` x `edge`.
    pub(super) fn resolve(&self, tile: [usize; 2], thresholds: &[f32], sums: &Sums) -> Vec<Vec<f32>> {
        let mut buffers = self.with_depths(thresholds, &[]);
        let row = buffers.paint.row;
        for (c, channel) in sums.channels.iter().enumerate() {
            put_rows(channel, &mut buffers.paint.sums[DepthLayer::Band as usize][c * STRIDE..], row, self.edge);
        }
        put_rows(&sums.coverage, &mut buffers.group_coverage.coverage, STRIDE, self.edge);
        let mut film = TileFilm::default();
        let TileBuffers { paint, group_coverage, .. } = &buffers;
        let (scope, rect) = (&self.scope, rect(&self.scope.band, tile, self.edge));
        let resolve = if self.low_pass() { LowPassSplat::resolve } else { Splat::resolve };
        resolve(&scope.resolve(), &rect, 0, paint, &group_coverage.coverage, &mut film);
        (0..scope.planes.count).map(|p| take_rows(&film.values[p * TILE * TILE..], TILE, self.edge)).collect()
    }

    /// Buffers with these depths and no sums.
    fn with_depths(&self, thresholds: &[f32], nearest: &[f32]) -> TileBuffers {
        let mut buffers = TileBuffers::default();
        buffers.paint.clear_depths(false, !nearest.is_empty());
        put_rows(thresholds, &mut buffers.paint.threshold, APRON_STRIDE, self.edge);
        put_rows(nearest, &mut buffers.paint.nearest, APRON_STRIDE, self.edge);
        buffers.paint.clear_sums(self.scope.channels.count, false);
        buffers.clear_coverage(self.scope.group.samples.len());
        buffers
    }
}

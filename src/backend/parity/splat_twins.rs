//! The CPU's passes of splats one at a time, for comparison with another backend's.
//!
//! What they read is made by the constructors that rendering uses ([`Scope`]). Only tiles have another size.

use super::tiles_of_edge::{put_rows, rect, take_rows, touches};
use crate::backend::cpu::attribute::{self, Tally};
use crate::backend::cpu::chunk::{Chunk, chunks};
use crate::backend::cpu::clocks::Clocks;
use crate::backend::cpu::project;
use crate::backend::cpu::resolve::{self, TileFilm};
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::static_tile::StaticTile;
use crate::backend::cpu::tile_buffers::TileBuffers;
use crate::backend::cpu::tiles::{Band, ROWS, STRIDE, TILE};
use crate::backend::cpu::values;
use crate::backend::cpu::visibility;
use crate::film::FilmPlanes;
use crate::frame::{Frame, PosedGroup, Position};
use crate::layout::{Channels, Splat};
use crate::plan::Objects;

/// Splats, or kernels in motion, of one object at one sample, in surfel order. A static object has those of the first
/// sample.
#[derive(Clone, Debug)]
pub(super) struct Posed<S = Splat> {
    pub chunk: Chunk,
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

/// The static objects of a tile, `edge` x `edge`, and what a group that starts from them has before moving objects are
/// added.
pub(super) struct Restored {
    pub layer_thresholds: Vec<f32>,
    pub layer: Sums,
    pub nearest: Vec<f32>,
    pub sums: Sums,
    /// Thresholds where sums must be recomputed, else negative.
    pub limits: Vec<f32>,
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
pub(super) fn whole_chunks(scope: &Scope<'_>, objects: Objects) -> Vec<Chunk> {
    let mut whole: Vec<Chunk> = Vec::new();
    for chunk in chunks(scope.frame, scope.group, objects) {
        match whole.last_mut() {
            Some(last) if (last.sample, last.object) == (chunk.sample, chunk.object) => {
                last.surfels.end = chunk.surfels.end;
            }
            _ => whole.push(chunk),
        }
    }
    whole
}

/// The splats of some objects.
pub(super) fn project(scope: &Scope<'_>, objects: Objects) -> Vec<Posed> {
    let splats_of = |chunk: Chunk| {
        let mut splats = Vec::new();
        let surfels = &scope.frame.objects[chunk.object].surfels;
        project::project(&scope.view(&chunk), surfels, chunk.surfels.clone(), &mut splats);
        Posed { chunk, splats }
    };
    whole_chunks(scope, objects).into_iter().map(splats_of).collect()
}

impl SplatTwins<'_> {
    pub(super) fn project(&self) -> Vec<Posed> {
        project(&self.scope, Objects::All)
    }

    /// Splats of `posed` that may touch the tile.
    fn list(&self, posed: &Posed, tile: [usize; 2]) -> Vec<u32> {
        touches(posed.splats.iter().map(|splat| splat.bounds), tile, self.edge)
    }

    /// Thresholds of a tile, `edge` x `edge`.
    pub(super) fn visibility(&self, posed: &[Posed], tile: [usize; 2]) -> Vec<f32> {
        let mut buffers = TileBuffers::default();
        buffers.clear_threshold();
        let rect = rect(&self.scope.band, tile, self.edge);
        for posed in posed {
            let (list, depths) = (self.list(posed, tile), self.scope.depths(&posed.chunk));
            visibility::visibility(&posed.splats, &list, depths, &rect, &mut buffers.threshold);
        }
        take_rows(&buffers.threshold, STRIDE, self.edge)
    }

    pub(super) fn attribute(&self, posed: &[Posed], tile: [usize; 2], thresholds: &[f32]) -> Sums {
        let mut buffers = self.with_thresholds(thresholds);
        buffers.clear_sums(self.scope.channels.count, self.scope.group.samples.len());
        self.add(posed, tile, &mut buffers, &mut []);
        self.scope.end_turns(&mut buffers);
        self.sums(&buffers)
    }

    /// Starts pass `attribute` from the static objects of a tile.
    pub(super) fn restore(&self, posed: &[Posed], tile: [usize; 2], thresholds: &[f32]) -> Restored {
        let Scope { frame, channels, group, .. } = self.scope;
        let is_static = |posed: &&Posed| frame.objects[posed.chunk.object].is_static;
        let fixed: Vec<Posed> = posed.iter().filter(is_static).cloned().collect();
        let layer_thresholds = self.visibility(&fixed, tile);
        let mut buffers = self.with_thresholds(&layer_thresholds);
        buffers.clear_sums(channels.count, group.samples.len());
        let mut nearest = vec![f32::INFINITY; ROWS * STRIDE];
        self.add(&fixed, tile, &mut buffers, &mut nearest);
        let layer = StaticTile::with_sums(&buffers, nearest);
        let of_layer = self.sums(&buffers);
        let mut buffers = self.with_thresholds(thresholds);
        buffers.clear_sums(channels.count, group.samples.len());
        let limits =
            layer.restore(channels.count, &mut buffers).unwrap_or_else(|| vec![f32::NEG_INFINITY; ROWS * STRIDE]);
        Restored {
            layer_thresholds,
            layer: of_layer,
            nearest: take_rows(&layer.nearest, STRIDE, self.edge),
            sums: self.sums(&buffers),
            limits: take_rows(&limits, STRIDE, self.edge),
        }
    }

    /// Adds the splats of `posed` to the buffers' sums.
    fn add(&self, posed: &[Posed], tile: [usize; 2], buffers: &mut TileBuffers, nearest: &mut [f32]) {
        let rect = rect(&self.scope.band, tile, self.edge);
        for posed in posed {
            self.scope.turn(&posed.chunk, buffers);
            let mut values = Vec::new();
            values::values(&posed.splats, &self.scope.shown(&posed.chunk), &mut values);
            let attributes = self.scope.attributes(&posed.chunk, &values);
            let list = self.list(posed, tile);
            let TileBuffers { threshold, sums, group_coverage, .. } = &mut *buffers;
            let mut tally = Tally { sums, sample_coverage: &mut group_coverage.sample_coverage, nearest };
            attribute::attribute(&posed.splats, &list, &attributes, &rect, threshold, &mut tally);
        }
    }

    fn sums(&self, buffers: &TileBuffers) -> Sums {
        let channels = self.scope.channels.count;
        let plane = |values: &[f32]| match values {
            [] => Vec::new(),
            _ => take_rows(values, STRIDE, self.edge),
        };
        let channel = |c: usize| take_rows(&buffers.sums[c * STRIDE..], channels * STRIDE, self.edge);
        Sums {
            channels: (0..channels).map(channel).collect(),
            sample_coverage: plane(&buffers.group_coverage.sample_coverage),
            coverage: plane(&buffers.group_coverage.coverage),
            of_static: plane(&buffers.group_coverage.of_static),
        }
    }

    /// Film of a tile after the group alone: plane by plane, `edge` x `edge`.
    pub(super) fn resolve(&self, tile: [usize; 2], thresholds: &[f32], sums: &Sums) -> Vec<Vec<f32>> {
        let Scope { channels, planes, group, .. } = self.scope;
        let mut buffers = self.with_thresholds(thresholds);
        buffers.clear_sums(channels.count, group.samples.len());
        for (c, channel) in sums.channels.iter().enumerate() {
            put_rows(channel, &mut buffers.sums[c * STRIDE..], channels.count * STRIDE, self.edge);
        }
        put_rows(&sums.coverage, &mut buffers.group_coverage.coverage, STRIDE, self.edge);
        let mut film = TileFilm::default();
        let TileBuffers { threshold, sums, group_coverage, .. } = &buffers;
        let rect = rect(&self.scope.band, tile, self.edge);
        resolve::resolve(&self.scope.resolve(), &rect, threshold, sums, &group_coverage.coverage, &mut film);
        (0..planes.count).map(|p| take_rows(&film.values[p * TILE * TILE..], TILE, self.edge)).collect()
    }

    fn with_thresholds(&self, thresholds: &[f32]) -> TileBuffers {
        let mut buffers = TileBuffers::default();
        buffers.clear_threshold();
        put_rows(thresholds, &mut buffers.threshold, STRIDE, self.edge);
        buffers
    }
}

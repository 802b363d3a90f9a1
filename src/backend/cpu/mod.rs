//! The CPU backend: the passes, one file each, and one file for what each step does with them.
//!
//! Chunks of surfels are projected and listed by tile, in parallel. Then tiles go through the passes of a step, in
//! parallel. Two things save memory. The splats of a group that do not fit pass in batches, first for visibility, then
//! again for attributes. The image is cut into bands where the buffers of its tiles do not fit. Sums are always taken
//! in global surfel order, so the picture is the same to the bit.

pub(super) mod attribute;
pub(super) mod bin;
mod bounds;
pub(super) mod chunk;
pub(super) mod clocks;
pub(super) mod ewa;
pub(super) mod job;
mod land;
mod memory;
mod mirror;
mod patch;
pub(super) mod project;
pub(super) mod resolve;
pub(super) mod scope;
mod splat_group;
mod static_group;
pub(super) mod static_tile;
pub(super) mod swept;
pub(super) mod tile_buffers;
pub(super) mod tile_runner;
pub(super) mod tiles;
pub(super) mod transparent;
pub(super) mod values;
pub(super) mod visibility;
mod waste;

use std::sync::Arc;

use rayon::prelude::*;

use self::bin::Binned;
use self::chunk::{Chunk, chunks};
use self::clocks::Clocks;
use self::ewa::EwaGroup;
use self::memory::Budget;
use self::resolve::{RasterFilms, TileFilm, TiledFilm};
use self::scope::Scope;
use self::splat_group::SplatGroup;
use self::static_group::{StaticGroup, Stored};
use self::static_tile::{StaticLayer, StaticTile};
use self::swept::{Map, MapGroup, SweepGroup};
use self::tile_buffers::TileBuffers;
use self::tile_runner::TileRunner;
use self::tiles::{Band, TILE};
use self::transparent::{Fixed, SeeThroughGroup, TransparentGroup, TransparentMemory};
use self::waste::Wasted;
use super::clusters::{ClusterStore, Clusters};
use super::{Backend, BackendError, Meter, Rendered};
use crate::film::{FilmPlanes, Picture, develop};
use crate::frame::{Blocks, Frame, PosedRaster, Position};
use crate::layout::{Channels, EwaSplat, SweptSplat};
use crate::options::{Prefilter, SweptKernel};
use crate::plan::{EwaPass, LayerPass, MapPass, Objects, PosedInterval, SplatPass, StaticPass, Step, SweepPass};
use crate::stop::Stop;

/// Pictures whose memory is stored for later ones: as many as mode auto gives back.
const SPARE_PICTURES: usize = 3;

const _: () = assert!(TILE == Blocks::EDGE);

/// Executes plans with the threads of the current rayon pool.
#[derive(Debug, Default)]
pub struct Cpu {
    /// Stored between frames, so that its memory is used again.
    memory: Memory,
    clusters: ClusterStore,
    /// Films of rasters, for the next frame.
    films: Vec<TiledFilm>,
    /// Memory of pictures that were given back.
    pixels: Vec<Vec<[f32; 4]>>,
    /// The frame that was begun.
    done: Option<Rendered>,
    /// Counts steps, each once in each band.
    meter: Arc<Meter>,
    /// Ends a frame between two steps.
    stop: Arc<Stop>,
    /// Is it counted what bounds waste?
    counts_waste: bool,
}

/// What steps write, of which later steps and later frames use the memory again.
#[derive(Debug, Default)]
struct Memory {
    splats: Vec<Binned>,
    /// Splats of a static layer.
    static_splats: Vec<Binned>,
    kernels: Vec<Binned<SweptSplat>>,
    ewa: Vec<Binned<EwaSplat>>,
    /// For bands whose splats come in batches.
    buffers: Vec<TileBuffers>,
    map: Map,
    transparent: TransparentMemory,
}

impl Backend for Cpu {
    fn describe(&self) -> String {
        let threads = rayon::current_num_threads();
        format!("cpu ({threads} thread{})", if threads == 1 { "" } else { "s" })
    }

    fn in_flight(&self) -> usize {
        1
    }

    fn begin(&mut self, frame: Frame) -> Result<(), BackendError> {
        self.done = Some(self.render_whole(&frame)?);
        Ok(())
    }

    fn finish(&mut self) -> Result<Option<Rendered>, BackendError> {
        Ok(self.done.take())
    }

    fn render(&mut self, frame: Frame) -> Result<Rendered, BackendError> {
        self.render_whole(&frame)
    }

    fn watch(&mut self, meter: Arc<Meter>) {
        self.meter = meter;
    }

    fn count_waste(&mut self) {
        self.counts_waste = true;
    }

    fn heed(&mut self, stop: Arc<Stop>) {
        self.stop = stop;
    }

    fn stop(&self) -> Arc<Stop> {
        Arc::clone(&self.stop)
    }

    fn recycle(&mut self, picture: Picture) {
        if self.pixels.len() < SPARE_PICTURES {
            self.pixels.push(picture.rgba);
        }
    }
}

impl Cpu {
    fn render_whole(&mut self, frame: &Frame) -> Result<Rendered, BackendError> {
        let planes = frame.film_planes();
        let channels = Channels::of(frame);
        let budget = Budget::of(frame, &planes, &channels)?;
        let clocks = Clocks { wasted: self.counts_waste.then(Wasted::default), ..Clocks::default() };
        let clusters = self.clusters.of_frame(frame);
        let stride = frame.stride as usize;
        let areas = frame.rasters.iter().map(|raster| raster.area).collect();
        let mut films = RasterFilms { films: Vec::new(), areas, stride, samples: frame.samples() };
        let bands = |size: [u32; 2]| (size[1] as usize).div_ceil(TILE).div_ceil(budget.band_rows) as u64;
        let steps = |raster: &PosedRaster| raster.positions.iter().map(|p| p.steps.len() as u64).sum::<u64>();
        self.meter.begin(frame.rasters.iter().map(|raster| bands(raster.area.size) * steps(raster)).sum());
        for raster in &frame.rasters {
            let mut film = self.films.pop().unwrap_or_default();
            let size = raster.area.size;
            film.empty(size);
            let tiles_y = (size[1] as usize).div_ceil(TILE);
            for first in (0..tiles_y).step_by(budget.band_rows) {
                let rows = [first, (first + budget.band_rows).min(tiles_y)];
                let band = Band::new(size, rows);
                let film = &mut film.tiles[rows[0] * film.tiles_x..rows[1] * film.tiles_x];
                let offsets = transparent::offsets(raster);
                let mut fixed = Fixed::default();
                for position in &raster.positions {
                    let (planes, channels, clusters, clocks) = (&planes, &channels, &clusters[..], &clocks);
                    let place = Place { frame, position, band, planes, channels, clusters, clocks };
                    let (memory, meter, stop) = (&mut self.memory, &*self.meter, &*self.stop);
                    let fixed = &mut fixed;
                    Executor { place, budget: &budget, memory, film, meter, stop, offsets, fixed }.run();
                    if stop.is_set() {
                        return Err(BackendError::Stopped);
                    }
                }
            }
            films.films.push(film);
        }
        let wanted = |y| Blocks::columns(frame.wanted.as_ref(), y, frame.size[0] as usize, stride);
        let picture = develop(&films, frame.size, &frame.aovs, &frame.behind_film(), wanted, self.pixels.pop());
        self.films = films.films;
        Ok(Rendered { picture, stats: clocks.stats(frame) })
    }
}

/// Executes the steps of one sample position in one band.
struct Executor<'a> {
    place: Place<'a>,
    budget: &'a Budget,
    memory: &'a mut Memory,
    /// The band's part of the raster's film.
    film: &'a mut [TileFilm],
    meter: &'a Meter,
    stop: &'a Stop,
    /// Least and greatest offset of the raster's sample positions, raster pixels.
    offsets: [[f32; 2]; 2],
    /// What is transparent and static in the band.
    fixed: &'a mut Fixed,
}

/// Where the picture of a group goes: to the film, or where something transparent is laid over it first.
fn of_group<'a>(frame: &Frame, opaque: &'a mut Vec<TileFilm>, film: &'a mut [TileFilm]) -> &'a mut [TileFilm] {
    if frame.blending.is_none() {
        return film;
    }
    opaque.resize_with(film.len().max(opaque.len()), TileFilm::default);
    opaque.iter_mut().for_each(TileFilm::clear);
    &mut opaque[..film.len()]
}

/// One sample position in one band.
#[derive(Clone, Copy)]
struct Place<'a> {
    frame: &'a Frame,
    position: &'a Position,
    band: Band,
    planes: &'a FilmPlanes,
    channels: &'a Channels,
    clusters: &'a [Arc<Clusters>],
    clocks: &'a Clocks,
}

impl<'a> Place<'a> {
    /// Group `group` of the position, in `band`.
    fn scope(self, group: usize, band: Band) -> Scope<'a> {
        let Self { frame, position, planes, channels, clusters, clocks, .. } = self;
        let (raster, group) = (&position.raster, &position.groups[group]);
        Scope { frame, raster, group, band, planes, channels, clusters, clocks }
    }
}

impl Executor<'_> {
    fn run(mut self) {
        let mut layer = StaticLayer::default();
        let mut picture = Vec::new();
        for step in &self.place.position.steps {
            if self.stop.is_set() {
                return;
            }
            match *step {
                Step::StaticLayer { group } => layer = self.static_layer(group),
                Step::Splat { group } => self.splat(group, &layer),
                Step::Ewa { group } => self.ewa(group),
                Step::Transparent { group } => self.transparent(group),
                Step::StaticPicture { group } => picture = self.static_picture(group),
                Step::VisibilityMap { group, interval, objects, density } => {
                    self.visibility_map(group, interval.guard, objects, MapPass::order(density));
                }
                Step::Sweep { group, ref interval, kernel, objects } => {
                    self.sweep(group, interval, kernel, objects, &picture);
                }
                Step::Finish => {
                    self.film.par_iter_mut().for_each(|tile| swept::finish(self.place.planes, &mut tile.values));
                }
            }
            self.meter.advance();
        }
        if !layer.binned.is_empty() {
            self.memory.static_splats = layer.binned;
        }
    }

    /// The static objects at the position, if there is room for them.
    fn static_layer(&mut self, group: usize) -> StaticLayer {
        if !self.budget.layers {
            return StaticLayer::default();
        }
        let scope = self.place.scope(group, self.place.band);
        let with_film = scope.group.samples.len() == 1 && self.place.frame.has_one_view();
        let work = StaticGroup { scope, stored: Stored::Sums { with_film } };
        let chunks = chunks(self.place.frame, scope.group, Objects::Static);
        let splat_bytes = self.budget.splat_bytes / 2;
        let runner = TileRunner { work: &work, chunks: &chunks, passes: &StaticPass::ORDER, splat_bytes };
        let mut binned = std::mem::take(&mut self.memory.static_splats);
        if runner.batch(&chunks, &mut binned) < chunks.len() {
            self.memory.static_splats = binned;
            return StaticLayer::default();
        }
        binned.truncate(chunks.len());
        let mut tiles = vec![StaticTile::default(); self.place.band.len()];
        runner.run_at_once(&binned, &mut tiles);
        StaticLayer { chunks, binned, tiles }
    }

    /// One group, from the static layer on, if there is one.
    fn splat(&mut self, group: usize, layer: &StaticLayer) {
        let scope = self.place.scope(group, self.place.band);
        let objects = if layer.tiles.is_empty() { Objects::All } else { Objects::Moving };
        let chunks = chunks(self.place.frame, scope.group, objects);
        let work = SplatGroup { scope, layer };
        let splat_bytes = self.budget.splat_bytes;
        let Memory { splats, buffers, transparent, .. } = &mut *self.memory;
        let film = of_group(self.place.frame, &mut transparent.opaque, self.film);
        TileRunner { work: &work, chunks: &chunks, passes: &SplatPass::ORDER, splat_bytes }.run(splats, buffers, film);
    }

    /// One group, with filtered kernels.
    fn ewa(&mut self, group: usize) {
        let scope = self.place.scope(group, self.place.band);
        let chunks = chunks(self.place.frame, scope.group, Objects::All);
        normalise(self.place.frame, &chunks);
        let splat_bytes = self.budget.splat_bytes;
        let Memory { ewa, buffers, transparent, .. } = &mut *self.memory;
        let film = of_group(self.place.frame, &mut transparent.opaque, self.film);
        TileRunner { work: &EwaGroup { scope }, chunks: &chunks, passes: &EwaPass::ORDER, splat_bytes }
            .run(ewa, buffers, film);
    }

    /// What is transparent, over the picture of the same group.
    fn transparent(&mut self, group: usize) {
        self.see_through(group);
        let scope = self.place.scope(group, self.place.band);
        let splat_bytes = self.budget.transparent_bytes;
        let work = TransparentGroup { scope, offsets: self.offsets, splat_bytes };
        work.run(self.fixed, &mut self.memory.transparent, self.film);
    }

    /// The layers of see-through surfels.
    fn see_through(&mut self, group: usize) {
        let frame = self.place.frame;
        let scope = self.place.scope(group, self.place.band);
        let chunks = chunks(frame, scope.group, Objects::SeeThrough);
        let tiles = if chunks.is_empty() { 0 } else { scope.band.len() };
        let Memory { ewa, buffers, transparent, .. } = &mut *self.memory;
        let TransparentMemory { opaque, layers, .. } = transparent;
        layers.iter_mut().for_each(Vec::clear);
        layers.resize_with(tiles, Vec::new);
        if chunks.is_empty() {
            return;
        }
        normalise(frame, &chunks);
        let raster = scope.raster.for_see_through(frame.prefilter);
        let channels = scope.channels.with_opacity();
        let work = SeeThroughGroup { scope: Scope { raster: &raster, channels: &channels, ..scope }, opaque };
        let splat_bytes = self.budget.splat_bytes;
        TileRunner { work: &work, chunks: &chunks, passes: &LayerPass::ORDER, splat_bytes }.run(ewa, buffers, layers);
    }

    /// The picture of static objects, at the position and in the light of a group.
    fn static_picture(&mut self, group: usize) -> Vec<StaticTile> {
        let scope = self.place.scope(group, self.place.band);
        let chunks = chunks(self.place.frame, scope.group, Objects::Static);
        let work = StaticGroup { scope, stored: Stored::Film };
        let splat_bytes = self.budget.splat_bytes;
        let mut picture = vec![StaticTile::default(); self.place.band.len()];
        let Memory { splats, buffers, .. } = &mut *self.memory;
        TileRunner { work: &work, chunks: &chunks, passes: &StaticPass::ORDER, splat_bytes }.run(
            splats,
            buffers,
            &mut picture,
        );
        picture
    }

    /// The map of a group, with `guard` pixels around the band.
    fn visibility_map(&mut self, group: usize, guard: u32, objects: Objects, passes: &[MapPass]) {
        let scope = self.place.scope(group, self.place.band.guarded(guard));
        let chunks = chunks(self.place.frame, scope.group, objects);
        let work = MapGroup { scope };
        let splat_bytes = self.budget.splat_bytes;
        let Memory { splats, buffers, map, .. } = &mut *self.memory;
        let tiles = map.lay(&scope.band);
        TileRunner { work: &work, chunks: &chunks, passes, splat_bytes }.run(splats, buffers, tiles);
    }

    /// The kernels in motion of a group, before and behind the picture of static objects.
    fn sweep(
        &mut self,
        group: usize,
        interval: &PosedInterval,
        kernel: SweptKernel,
        objects: Objects,
        picture: &[StaticTile],
    ) {
        let scope = self.place.scope(group, self.place.band);
        let chunks = chunks(self.place.frame, scope.group, objects);
        let splat_bytes = self.budget.splat_bytes;
        if self.place.frame.prefilter == Prefilter::Ewa {
            normalise(self.place.frame, &chunks);
        }
        let Memory { kernels, buffers, map, .. } = &mut *self.memory;
        let work = SweepGroup { scope, interval, kernel, map, picture };
        TileRunner { work: &work, chunks: &chunks, passes: SweepPass::order(kernel.has_slices()), splat_bytes }
            .run(kernels, buffers, self.film);
    }
}

/// Computes the factors of all models before their chunks are worked on in parallel: each thread that found none would
/// compute all.
fn normalise(frame: &Frame, chunks: &[Chunk]) {
    for chunk in chunks {
        frame.objects[chunk.object].surfels.normalisation();
    }
}

//! The CPU backend: the passes, one file each, and one file for what each step does with them.
//!
//! Chunks of surfels are projected and listed by tile, in parallel. Then tiles go through the passes of a step, in
//! parallel. Two things save memory. The splats of a group that do not fit pass in batches, first for visibility, then
//! again for attributes. The image is cut into bands where the buffers of its tiles do not fit. Sums are always taken
//! in global surfel order, so the picture is the same to the bit.

pub(super) mod attribute;
pub(super) mod bin;
pub(super) mod bounds;
pub(super) mod chunk;
pub(super) mod clocks;
pub(super) mod columns;
pub(super) mod depths;
pub(super) mod job;
pub(super) mod land;
mod memory;
mod mirror;
pub(super) mod paint;
mod patch;
pub(super) mod project;
pub(super) mod published;
pub(super) mod resolve;
pub(super) mod scope;
pub(super) mod shadows;
pub(super) mod swept;
pub(super) mod tile_buffers;
pub(super) mod tile_runner;
pub(super) mod tiles;
pub(super) mod transparent;
pub(super) mod values;
pub(super) mod waste;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;

use self::bin::Binned;
use self::chunk::chunks;
use self::clocks::Clocks;
use self::memory::Budget;
use self::paint::{Kernel, PaintGroup, Painted};
use self::published::{LowPassSplat, Map, MapGroup, PublishedSweepGroup};
use self::resolve::{RasterFilms, TileFilm, TiledFilm};
use self::scope::Scope;
use self::shadows::Shadows;
use self::swept::SweepGroup;
use self::tile_buffers::TileBuffers;
use self::tile_runner::TileRunner;
use self::tiles::{Band, TILE};
use self::transparent::{Fixed, SeeThroughGroup, TransparentGroup, TransparentMemory};
use self::waste::Wasted;
use super::clusters::{ClusterStore, Clusters};
use super::{Backend, BackendError, Meter, Rendered};
use crate::film::{FilmPlanes, Picture, develop};
use crate::frame::{Blocks, Frame, PosedRaster, Position};
use crate::layout::{Channels, EwaSplat, Splat, SweptSplat};
use crate::options::SweptKernel;
use crate::plan::{LayerPass, MapPass, PaintPass, PosedInterval, Published, PublishedSweepPass, Step, SweepPass};
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
    /// The frames that were begun and not finished.
    done: VecDeque<Rendered>,
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
    discs: Splats<Splat>,
    filtered: Splats<EwaSplat>,
    low_pass: Splats<LowPassSplat>,
    /// Discs on the map.
    of_map: Vec<Binned>,
    kernels: Vec<Binned<SweptSplat>>,
    /// The films of what is at rest, tile by tile.
    at_rest: Vec<TileFilm>,
    /// For bands whose splats come in batches.
    buffers: Vec<TileBuffers>,
    map: Map,
    transparent: TransparentMemory,
    /// The shadow maps of the group that is worked on.
    shadows: Shadows,
}

/// Splats of step `Paint`, chunk by chunk.
#[derive(Debug)]
struct Splats<K> {
    binned: Vec<Binned<K>>,
    /// Chunks of what is at rest whose splats are at hand, for the position: they come first.
    at_rest: usize,
}

impl<K> Default for Splats<K> {
    fn default() -> Self {
        Self { binned: Vec::new(), at_rest: 0 }
    }
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
        let rendered = self.render_whole(&frame)?;
        self.done.push_back(rendered);
        Ok(())
    }

    fn finish(&mut self) -> Result<Option<Rendered>, BackendError> {
        Ok(self.done.pop_front())
    }

    fn abandon(&mut self) {
        self.done.pop_back();
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
                    let place = BandPosition { frame, position, band, planes, channels, clusters, clocks };
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
    place: BandPosition<'a>,
    budget: &'a Budget,
    memory: &'a mut Memory,
    /// The band's part of the raster's film.
    film: &'a mut [TileFilm],
    meter: &'a Meter,
    stop: &'a Stop,
    /// Least and greatest offset of the raster's sample positions, raster pixels.
    offsets: [[f32; 2]; 2],
    /// Transparent splats that are static in the band.
    fixed: &'a mut Fixed,
}

/// Where the picture of a group goes: to the film, or where something transparent is laid over it first.
fn of_group<'a>(frame: &Frame, laid: &'a mut TransparentMemory, film: &'a mut [TileFilm]) -> &'a mut [TileFilm] {
    if frame.blending.is_none() {
        return film;
    }
    let TransparentMemory { opaque, layers, .. } = laid;
    // Those of an earlier group. Where nothing is peeled, they would stay; they may be of another scene.
    layers.iter_mut().for_each(Vec::clear);
    opaque.resize_with(film.len().max(opaque.len()), TileFilm::default);
    opaque.iter_mut().for_each(TileFilm::clear);
    &mut opaque[..film.len()]
}

/// One sample position in one band.
#[derive(Clone, Copy)]
struct BandPosition<'a> {
    frame: &'a Frame,
    position: &'a Position,
    band: Band,
    planes: &'a FilmPlanes,
    channels: &'a Channels,
    clusters: &'a [Arc<Clusters>],
    clocks: &'a Clocks,
}

impl<'a> BandPosition<'a> {
    /// Group `group` of the position, in `band`.
    fn scope(self, group: usize, band: Band) -> Scope<'a> {
        let Self { frame, position, planes, channels, clusters, clocks, .. } = self;
        let (raster, group) = (&position.raster, &position.groups[group]);
        Scope { frame, raster, group, band, planes, channels, clusters, clocks, shadows: None }
    }
}

impl Executor<'_> {
    fn run(mut self) {
        self.memory.discs.at_rest = 0;
        self.memory.filtered.at_rest = 0;
        self.memory.at_rest.iter_mut().for_each(TileFilm::clear);
        for step in &self.place.position.steps {
            if self.stop.is_set() {
                return;
            }
            match *step {
                Step::Paint { group, shares_rest } if self.place.frame.has_filtered_kernels() => {
                    normalise(self.place.frame, false);
                    self.paint::<EwaSplat>(group, shares_rest, |memory| &mut memory.filtered);
                }
                Step::Paint { group, shares_rest } => {
                    self.paint::<Splat>(group, shares_rest, |memory| &mut memory.discs);
                }
                Step::Peel { group } => self.peel(group),
                Step::Composite { group } => self.composite(group),
                Step::Sweep { group, ref interval, kernel } => self.sweep(group, interval, kernel),
                Step::Published { group, part: Published::Instant } => {
                    self.paint::<LowPassSplat>(group, false, |memory| &mut memory.low_pass);
                }
                Step::Published { group, part: Published::Map { guard } } => self.map(group, guard),
                Step::Published { group, part: Published::Sweep { ref interval, kernel } } => {
                    self.published_sweep(group, interval, kernel);
                }
                Step::Finish => {
                    self.film.par_iter_mut().for_each(|tile| swept::finish(self.place.planes, &mut tile.values));
                }
            }
            self.meter.advance();
        }
    }

    /// One group of opaque surfels. With `shares_rest`, what is at rest is made once for all groups of the position.
    fn paint<K: Kernel>(&mut self, group: usize, shares_rest: bool, splats: fn(&mut Memory) -> &mut Splats<K>) {
        let scope = self.place.scope(group, self.place.band);
        let shadows = self.shadows(&scope);
        let scope = Scope { shadows: shadows.as_ref(), ..scope };
        let (chunks, at_rest) = chunks(self.place.frame, scope.group, false);
        let mut own = std::mem::take(splats(self.memory));
        let Memory { buffers, transparent, at_rest: films, .. } = &mut *self.memory;
        let film = of_group(self.place.frame, transparent, self.film);
        // The weights of a group's samples are in its coverage, so its film is no other group's.
        let shares_film = shares_rest && scope.group.samples.len() == 1;
        if shares_film {
            films.resize_with(film.len().max(films.len()), TileFilm::default);
        }
        let mut films = shares_film.then_some(films).into_iter().flatten();
        let mut tiles: Vec<Painted<'_>> = film.iter_mut().map(|film| Painted { film, at_rest: films.next() }).collect();
        let runner = TileRunner {
            work: &PaintGroup::new(scope),
            chunks: &chunks,
            passes: PaintPass::order(scope.frame.has_layers(K::FILTERED)),
            splat_bytes: self.budget.splat_bytes,
            at_rest,
            made: own.at_rest,
        };
        let at_hand = runner.run(&mut own.binned, buffers, &mut tiles);
        own.at_rest = if shares_rest { at_rest.min(at_hand) } else { 0 };
        *splats(self.memory) = own;
        self.memory.shadows = shadows.unwrap_or_default();
    }

    /// The shadow maps of a group; `None` where no light has shadows. All its samples share those of the middle one, as
    /// they share its shading.
    fn shadows(&mut self, scope: &Scope<'_>) -> Option<Shadows> {
        if !self.place.frame.has_shadows() {
            return None;
        }
        let start = Instant::now();
        let mut shadows = std::mem::take(&mut self.memory.shadows);
        let sample = &scope.group.samples[scope.group.samples.len() / 2];
        shadows.draw(scope.frame, sample, scope.raster, scope.clusters);
        scope.clocks.visibility.add(start);
        Some(shadows)
    }

    /// The map of a group, with `guard` pixels around the band.
    fn map(&mut self, group: usize, guard: u32) {
        let scope = self.place.scope(group, self.place.band.guarded(guard));
        let (chunks, at_rest) = chunks(self.place.frame, scope.group, false);
        let Memory { buffers, map, of_map, .. } = &mut *self.memory;
        let tiles = map.lay(&scope.band);
        let (passes, splat_bytes) = (&MapPass::ORDER, self.budget.splat_bytes);
        TileRunner { work: &MapGroup { scope }, chunks: &chunks, passes, splat_bytes, at_rest, made: 0 }
            .run(of_map, buffers, tiles);
    }

    /// The published kernels in motion of an interval.
    fn published_sweep(&mut self, group: usize, interval: &PosedInterval, kernel: SweptKernel) {
        let scope = self.place.scope(group, self.place.band);
        let shadows = self.shadows(&scope);
        let scope = Scope { shadows: shadows.as_ref(), ..scope };
        let (chunks, at_rest) = chunks(self.place.frame, scope.group, false);
        let Memory { buffers, map, kernels, .. } = &mut *self.memory;
        let work = PublishedSweepGroup { scope, interval, kernel, map };
        let (passes, splat_bytes) = (&PublishedSweepPass::ORDER, self.budget.splat_bytes);
        TileRunner { work: &work, chunks: &chunks, passes, splat_bytes, at_rest, made: 0 }
            .run(kernels, buffers, self.film);
        self.memory.shadows = shadows.unwrap_or_default();
    }

    /// Captures, volumes and the layers of see-through surfels, over the picture of the same group.
    fn composite(&mut self, group: usize) {
        let Memory { transparent, shadows, .. } = &mut *self.memory;
        // The opaque picture of the group, which was made just before, has drawn them.
        let shadows = self.place.frame.has_shadows().then_some(&*shadows);
        let scope = Scope { shadows, ..self.place.scope(group, self.place.band) };
        let splat_bytes = self.budget.transparent_bytes;
        let work = TransparentGroup { scope, offsets: self.offsets, splat_bytes };
        work.run(self.fixed, transparent, self.film);
    }

    /// The layers of see-through surfels.
    fn peel(&mut self, group: usize) {
        let frame = self.place.frame;
        let scope = self.place.scope(group, self.place.band);
        let (chunks, at_rest) = chunks(frame, scope.group, true);
        let tiles = if chunks.is_empty() { 0 } else { scope.band.len() };
        let Memory { filtered, buffers, transparent, shadows, .. } = &mut *self.memory;
        // As in `composite`.
        let shadows = frame.has_shadows().then_some(&*shadows);
        let TransparentMemory { opaque, layers, .. } = transparent;
        layers.iter_mut().for_each(Vec::clear);
        layers.resize_with(tiles, Vec::new);
        if chunks.is_empty() {
            return;
        }
        normalise(frame, true);
        // The splats of opaque surfels lose their place.
        filtered.at_rest = 0;
        let raster = scope.raster.for_see_through(frame.prefilter);
        let channels = scope.channels.with_opacity();
        let work = SeeThroughGroup { scope: Scope { raster: &raster, channels: &channels, shadows, ..scope }, opaque };
        let passes = &LayerPass::order(frame.has_layers(true));
        let splat_bytes = self.budget.splat_bytes;
        TileRunner { work: &work, chunks: &chunks, passes, splat_bytes, at_rest, made: 0 }.run(
            &mut filtered.binned,
            buffers,
            layers,
        );
    }

    /// The kernels in motion of an interval.
    fn sweep(&mut self, group: usize, interval: &PosedInterval, kernel: SweptKernel) {
        let scope = self.place.scope(group, self.place.band);
        let shadows = self.shadows(&scope);
        let scope = Scope { shadows: shadows.as_ref(), ..scope };
        let (chunks, at_rest) = chunks(self.place.frame, scope.group, false);
        normalise(self.place.frame, false);
        let Memory { kernels, buffers, .. } = &mut *self.memory;
        let work = SweepGroup { scope, interval, kernel };
        let (passes, splat_bytes) = (&SweepPass::ORDER, self.budget.splat_bytes);
        TileRunner { work: &work, chunks: &chunks, passes, splat_bytes, at_rest, made: 0 }
            .run(kernels, buffers, self.film);
        self.memory.shadows = shadows.unwrap_or_default();
    }
}

/// Computes the factors of the models of opaque or see-through surfels before their chunks are worked on in parallel:
/// each thread that found none would compute all.
fn normalise(frame: &Frame, see_through: bool) {
    let objects = frame.objects.iter().filter(|object| object.see_through == see_through);
    for model in objects.filter_map(|object| object.shape.surfels()) {
        model.surfels().normalisation();
    }
}

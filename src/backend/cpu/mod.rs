//! The CPU backend: the passes, one file each, and the order in which they run.
//!
//! Chunks of surfels go through `project` and `bin`, in parallel; then tiles go through `visibility`, `attribute` and
//! `resolve`, in parallel. Where the splats of a group do not fit into the memory allowed, they pass in waves, first for
//! visibility, then again for attributes; where the tiles' buffers do not fit, the image is cut into bands. Sums are taken in
//! global surfel order in every case, so the bytes depend on neither.

mod attribute;
mod bin;
mod layer;
mod lit;
mod pieces;
mod project;
mod resolve;
mod swept;
mod tiles;
#[cfg(all(test, feature = "gpu"))]
pub(super) mod twins;
mod visibility;

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use glam::Vec3;
use rayon::prelude::*;

use self::attribute::{Attributes, Tally};
use self::bin::{Binned, Tiled};
use self::layer::{Layer, LayerTile};
use self::lit::Faced;
use self::pieces::Pieces;
use self::project::View;
use self::resolve::{RasterFilms, Resolve, TileFilm, TiledFilm};
#[cfg(all(test, feature = "gpu"))]
pub(super) use self::swept::twins as swept_twins;
use self::swept::{Exposure, Footprint, Map, MapTile, Swept, Volume};
use self::tiles::{Band, STRIDE, TILE, TileBuffers, TileRect};
use self::visibility::Depths;
use super::{Backend, BackendError, Rendered, Stats};
use crate::film::{FilmPlanes, develop};
use crate::frame::{Blocks, Frame, PosedGroup};
use crate::layout::{Channels, Splat, SweptSplat};
use crate::plan::{KernelShape, Normalise, Pass, Prefilter, Shading, TemporalAlpha};

const _: () = assert!(TILE == Blocks::EDGE);

/// Surfels of a chunk.
const CHUNK: usize = 4096;

/// Executes plans with the threads of the current rayon pool.
#[derive(Debug, Default)]
pub struct Cpu {
    /// Kept between groups and frames, so that their memory is reused.
    binned: Vec<Binned>,
    /// Likewise, of what lies still.
    still: Vec<Binned>,
    /// Likewise, of kernels in motion.
    swept: Vec<Binned<SweptSplat>>,
    /// Likewise, for bands whose splats come in waves.
    buffers: Vec<TileBuffers>,
    /// Likewise, for kernels in motion.
    map: Map,
    /// The frame that was begun.
    done: Option<Rendered>,
}

/// Some surfels of one object at one sample of the group.
#[derive(Clone, Debug)]
struct Chunk {
    /// The first one for objects that lie still.
    sample: usize,
    object: usize,
    surfels: Range<usize>,
}

impl Backend for Cpu {
    fn describe(&self) -> String {
        let threads = rayon::current_num_threads();
        format!("cpu ({threads} thread{})", if threads == 1 { "" } else { "s" })
    }

    fn in_flight(&self) -> usize {
        1
    }

    fn begin(&mut self, frame: &Frame<'_>) -> Result<(), BackendError> {
        self.done = Some(self.render_whole(frame)?);
        Ok(())
    }

    fn finish(&mut self) -> Result<Option<Rendered>, BackendError> {
        Ok(self.done.take())
    }
}

impl Cpu {
    fn render_whole(&mut self, frame: &Frame<'_>) -> Result<Rendered, BackendError> {
        let planes = FilmPlanes::of(frame.aovs);
        let once = frame.swept.is_some_and(|swept| swept.normalise == Normalise::Once);
        let planes = if once { planes.pooled() } else { planes };
        let channels = Channels::of(frame);
        let budget = Budget::of(frame, &planes, &channels)?;
        let stride = frame.stride as usize;
        let mut films = RasterFilms { films: Vec::new(), stride, samples: frame.samples() };
        let clocks = Clocks::default();
        let pieces = match frame.wanted {
            Some(_) if frame.swept.is_none() => frame.objects.iter().map(|object| Pieces::of(object.surfels)).collect(),
            _ => Vec::new(),
        };
        for groups in frame.groups.chunk_by(|a, b| a.raster.phase == b.raster.phase) {
            let size = groups[0].raster.size;
            let mut film = TiledFilm::new(size);
            let tiles_y = (size[1] as usize).div_ceil(TILE);
            for first in (0..tiles_y).step_by(budget.band_rows) {
                let rows = [first, (first + budget.band_rows).min(tiles_y)];
                let band = Band::new(size, rows);
                let tiles = &mut film.tiles[rows[0] * film.tiles_x..rows[1] * film.tiles_x];
                for groups in groups.chunk_by(|a, b| a.raster == b.raster) {
                    let of_group = |group| Work {
                        frame,
                        group,
                        band,
                        planes: &planes,
                        channels: &channels,
                        layer: None,
                        pieces: &pieces,
                        clocks: &clocks,
                    };
                    let layer = if budget.layers && groups.len() > 1 {
                        self.layer(&of_group(&groups[0]), budget.splat_bytes)
                    } else {
                        None
                    };
                    for group in groups {
                        let work = Work { layer: layer.as_ref(), ..of_group(group) };
                        self.group(&work, budget.splat_bytes, tiles);
                    }
                    self.still = layer.map(|layer| layer.binned).unwrap_or_default();
                }
            }
            if frame.swept.is_some_and(|swept| once || swept.alpha == TemporalAlpha::Sum) {
                film.tiles.par_iter_mut().for_each(|tile| swept::finish(&planes, &mut tile.values));
            }
            films.films.push(film);
        }
        let picture = develop(&films, frame.size, frame.aovs, frame.background);
        Ok(Rendered { picture, stats: clocks.stats(frame) })
    }
}

/// How the allowed memory is shared out.
struct Budget {
    /// Rows of tiles that are rendered together.
    band_rows: usize,
    /// Bytes for splats and their lists.
    splat_bytes: u64,
    /// Is there room to keep what lies still?
    layers: bool,
}

impl Budget {
    fn of(frame: &Frame<'_>, planes: &FilmPlanes, channels: &Channels) -> Result<Self, BackendError> {
        // The largest raster is the first one.
        let raster = frame.groups.first().map_or(frame.size, |group| group.raster.size);
        let rasters = u64::from(frame.stride * frame.stride);
        let samples = frame.groups.iter().map(|group| group.samples.len()).max().unwrap_or(1);
        let [tiles_x, tiles_y] = raster.map(|pixels| u64::from(pixels).div_ceil(TILE as u64));
        let pixels = u64::from(frame.size[0]) * u64::from(frame.size[1]);
        // The film, the picture that it becomes, and its copy in the file's form.
        let film = rasters * tiles_x * tiles_y * TileFilm::bytes(planes.count) + 2 * pixels * 4 * planes.count as u64;
        // What the tiles of some rows need together, for as many rows as the bands shall have.
        let swept = frame.swept.is_some();
        let guard = frame.groups.iter().filter_map(|group| group.interval).map(|interval| interval.guard).max();
        let still = frame.objects.iter().any(|object| object.still);
        let layer = if still { LayerTile::bytes(channels.count, samples, planes.count) } else { 0 };
        let buffers_with = |rows: u64, layer: u64| {
            let band = Band::new(raster, [0, rows as usize]);
            let guarded = guard.map_or(0, |guard| band.guarded(guard).len() as u64);
            let tile = TileBuffers::bytes(channels.count, samples, swept) + layer;
            // Tiles of the map have fewer sums, but there are more of them.
            guarded * Map::bytes(1) + guarded.max(band.len() as u64) * tile
        };
        let threads = rayon::current_num_threads() as u64;
        let wave = |rows: u64| {
            let band = Band::new(raster, [0, rows as usize]);
            let guarded = guard.map_or(band, |guard| band.guarded(guard));
            let moving = if swept { Binned::<SweptSplat>::most_bytes(CHUNK, &band) } else { 0 };
            (threads + 1) * (Binned::<Splat>::most_bytes(CHUNK, &guarded) + moving)
        };
        let needed = frame.model_bytes + film + buffers_with(1, 0) + wave(1);
        if needed > frame.memory {
            let [width, height] = frame.size;
            return Err(BackendError::Memory {
                width,
                height,
                models: frame.model_bytes,
                needed,
                allowed: frame.memory,
            });
        }
        // Half of what is left for the tiles' buffers at the most; the rest for splats.
        let left = frame.memory - frame.model_bytes - film;
        let layers = buffers_with(1, layer) + wave(1) <= left / 2;
        let buffers = |rows: u64| buffers_with(rows, if layers { layer } else { 0 });
        let rows = (1..=tiles_y).rev().find(|&rows| buffers(rows) <= left / 2).unwrap_or(1);
        let splat_bytes = left.saturating_sub(buffers(rows)).max(wave(rows));
        Ok(Self { band_rows: rows as usize, splat_bytes, layers })
    }
}

/// One group in one band.
#[derive(Clone, Copy)]
struct Work<'a> {
    frame: &'a Frame<'a>,
    group: &'a PosedGroup,
    band: Band,
    planes: &'a FilmPlanes,
    channels: &'a Channels,
    /// What lies still, where it was splatted already.
    layer: Option<&'a Layer>,
    /// Of each object, where only some blocks are wanted.
    pieces: &'a [Pieces],
    clocks: &'a Clocks,
}

impl Cpu {
    /// What lies still in a group, if there is anything, and room to keep it.
    fn layer(&mut self, work: &Work<'_>, splat_bytes: u64) -> Option<Layer> {
        if work.frame.swept.is_some() {
            return None;
        }
        let chunks: Vec<Chunk> = work.still_chunks().collect();
        let mut binned = std::mem::take(&mut self.still);
        let tiles_of_layer = Tiles { work, chunks: &chunks, passes: &[], splat_bytes: splat_bytes / 2 };
        let fits = tiles_of_layer
            .wave(&chunks, &mut binned, &|chunk: &Chunk, binned: &mut _| work.project(chunk, binned))
            == chunks.len();
        if chunks.is_empty() || !fits {
            self.still = binned;
            return None;
        }
        binned.truncate(chunks.len());
        let mut tiles = vec![LayerTile::default(); work.band.len()];
        let same_view = work.frame.has_one_view();
        tiles.par_iter_mut().enumerate().for_each_init(
            || (TileBuffers::default(), Vec::new()),
            |(buffers, scratch), (index, out)| {
                let tile = work.band.tile(index);
                if !tiles_of_layer.wants(&tile) || binned.iter().all(|binned| binned.list(&tile, scratch).is_empty()) {
                    return;
                }
                buffers.clear_threshold();
                let mut job = Job { chunks: &chunks, binned: &binned, tile, buffers, scratch, out: &mut () };
                work.visibility(&mut job);
                job.buffers.clear_sums(work.channels.count, work.group.samples.len());
                let mut nearest = vec![f32::INFINITY; TILE * STRIDE];
                work.attribute(&mut job, &mut nearest);
                let mut film = TileFilm::default();
                if same_view && work.group.samples.len() == 1 {
                    let whole = Resolve { weight: 1.0, ..work.resolve() };
                    resolve::resolve(&whole, &tile, &buffers.threshold, &buffers.sums, &[], &mut film);
                }
                *out = LayerTile::of(buffers, &nearest, film);
            },
        );
        Some(Layer { chunks, binned, tiles })
    }

    fn group(&mut self, work: &Work<'_>, splat_bytes: u64, films: &mut [TileFilm]) {
        let chunks = work.chunks();
        let passes = work.frame.passes;
        let Some(kept) = passes.iter().position(|&pass| pass == Pass::Keep) else {
            let tiles = Tiles { work, chunks: &chunks, passes, splat_bytes };
            let project = |chunk: &Chunk, binned: &mut _| work.project(chunk, binned);
            let unmoved = |index, film: &mut _| work.add_still(index, film);
            tiles.run(&mut self.binned, &mut self.buffers, films, project, unmoved, |pass, job| work.tile(pass, job));
            return;
        };
        // Kernels in motion look up sources anywhere on the map, so it must be whole before they are added.
        let (still, moving) = passes.split_at(kept + 1);
        let guard = work.group.interval.map_or(0, |interval| interval.guard);
        let around = Work { band: work.band.guarded(guard), ..*work };
        let map = self.map.lay(&around.band);
        let tiles = Tiles { work: &around, chunks: &chunks, passes: still, splat_bytes };
        let project = |chunk: &Chunk, binned: &mut _| around.project(chunk, binned);
        tiles.run(
            &mut self.binned,
            &mut self.buffers,
            map,
            project,
            |_, _| false,
            |pass, job| around.map_tile(pass, job),
        );
        let map = &self.map;
        let tiles = Tiles { work, chunks: &chunks, passes: moving, splat_bytes };
        let project = |chunk: &Chunk, binned: &mut _| work.sweep(chunk, binned);
        tiles.run(
            &mut self.swept,
            &mut self.buffers,
            films,
            project,
            |_, _| false,
            |pass, mut job| {
                work.swept_tile(pass, map, &mut job);
            },
        );
    }
}

/// Passes of a group over the tiles of its band.
struct Tiles<'a> {
    work: &'a Work<'a>,
    chunks: &'a [Chunk],
    passes: &'a [Pass],
    /// Bytes for splats and their lists.
    splat_bytes: u64,
}

/// One tile in one pass.
struct Job<'a, S, O> {
    chunks: &'a [Chunk],
    /// The splats of `chunks`.
    binned: &'a [Binned<S>],
    tile: TileRect,
    buffers: &'a mut TileBuffers,
    scratch: &'a mut Vec<u32>,
    out: &'a mut O,
}

impl Tiles<'_> {
    /// Runs all passes; `project` makes the splats of a chunk, `tile` runs a pass on a tile. One output a tile. `unmoved` is asked for
    /// tiles without splats: true if it has dealt with the tile, which else goes through its passes where something lies still.
    fn run<S: Tiled + Send + Sync, O: Send>(
        &self,
        binned: &mut Vec<Binned<S>>,
        buffers: &mut Vec<TileBuffers>,
        outputs: &mut [O],
        project: impl Fn(&Chunk, &mut Binned<S>) + Sync,
        unmoved: impl Fn(usize, &mut O) -> bool + Sync,
        tile: impl Fn(Pass, Job<'_, S, O>) + Sync,
    ) {
        let &Self { work, chunks, .. } = self;
        let passes = || self.passes.iter().copied().filter(|pass| !pass.makes_splats());
        let taken = self.wave(chunks, binned, &project);
        if taken == chunks.len() {
            // All splats at hand: each tile goes through its passes at once, in buffers that stay in the cache.
            let binned = &binned[..taken];
            outputs.par_iter_mut().enumerate().for_each_init(
                || (TileBuffers::default(), Vec::new()),
                |(buffers, scratch), (index, out)| {
                    let rect = work.band.tile(index);
                    if !self.wants(&rect) {
                        return;
                    }
                    let empty = binned.iter().all(|binned| binned.list(&rect, scratch).is_empty());
                    if empty && (work.layer_tile(index).is_none() || unmoved(index, out)) {
                        return;
                    }
                    for pass in passes() {
                        work.prepare(pass, index, buffers, scratch);
                        tile(pass, Job { chunks, binned, tile: rect, buffers, scratch, out });
                    }
                },
            );
            return;
        }
        buffers.resize_with(outputs.len().max(buffers.len()), TileBuffers::default);
        let mut done = taken;
        let mut start = 0;
        for pass in passes() {
            let prepare = |scratch: &mut _, (index, buffers)| work.prepare(pass, index, buffers, scratch);
            buffers[..outputs.len()].par_iter_mut().enumerate().for_each_init(Vec::new, prepare);
            loop {
                let wave = &chunks[start..done];
                let splats = &binned[..wave.len()];
                buffers.par_iter_mut().zip(outputs.par_iter_mut()).enumerate().for_each_init(
                    Vec::new,
                    |scratch, (index, (buffers, out))| {
                        let rect = work.band.tile(index);
                        if !self.wants(&rect) {
                            return;
                        }
                        tile(pass, Job { chunks: wave, binned: splats, tile: rect, buffers, scratch, out });
                    },
                );
                if !pass.reads_splats() {
                    break;
                }
                // On to the next wave; after the last, back to the first for the next pass.
                start = if done == chunks.len() { 0 } else { done };
                done = start + self.wave(&chunks[start..], binned, &project);
                if start == 0 {
                    break;
                }
            }
        }
    }

    /// Is the tile rendered? All tiles of a map are.
    fn wants(&self, tile: &TileRect) -> bool {
        let [x, y] = tile.tile;
        self.work.frame.swept.is_some() || self.work.frame.wanted.as_ref().is_none_or(|blocks| blocks.at(x, y))
    }

    /// Projects and bins as many of `chunks` as fit into the memory for splats, at least one; returns how many.
    fn wave<S: Tiled + Send>(
        &self,
        chunks: &[Chunk],
        binned: &mut Vec<Binned<S>>,
        project: &(impl Fn(&Chunk, &mut Binned<S>) + Sync),
    ) -> usize {
        let most = Binned::<S>::most_bytes(CHUNK, &self.work.band);
        let least = rayon::current_num_threads();
        let mut used = 0;
        let mut done = 0;
        while done < chunks.len() {
            let fit = (self.splat_bytes.saturating_sub(used) / most) as usize;
            if fit < least && done > 0 {
                break;
            }
            let end = (done + fit.max(least)).min(chunks.len());
            binned.resize_with(binned.len().max(end), Binned::default);
            let slots = &mut binned[done..end];
            slots.par_iter_mut().zip(&chunks[done..end]).for_each(|(binned, chunk)| project(chunk, binned));
            used += slots.iter().map(Binned::bytes).sum::<u64>();
            done = end;
        }
        done
    }
}

impl Pass {
    /// Splats are made of surfels, not tile by tile.
    const fn makes_splats(self) -> bool {
        matches!(self, Self::Project | Self::Bin | Self::Sweep)
    }

    /// Reads the splats of a tile's list, and not only what was made of them.
    const fn reads_splats(self) -> bool {
        !matches!(self, Self::Resolve | Self::Keep | Self::SweptResolve)
    }
}

impl Work<'_> {
    /// Everything that the group must splat: first what lies still, once for all samples.
    fn chunks(&self) -> Vec<Chunk> {
        let still = self.still_chunks().filter(|_| self.layer.is_none());
        let samples = 0..self.group.samples.len();
        still.chain(samples.flat_map(|sample| self.chunks_of(sample, false))).collect()
    }

    fn still_chunks(&self) -> impl Iterator<Item = Chunk> {
        self.chunks_of(0, true)
    }

    /// The objects that lie still, or do not, at one sample.
    fn chunks_of(&self, sample: usize, still: bool) -> impl Iterator<Item = Chunk> {
        let objects = self.group.samples[sample].objects.iter().zip(&self.frame.objects).enumerate();
        let wanted = objects.filter(move |(_, (pose, object))| pose.visible && object.still == still);
        wanted.flat_map(move |(index, (_, object))| {
            let len = object.surfels.len();
            let chunks = (0..len).step_by(CHUNK).map(move |first| {
                let surfels = first..(first + CHUNK).min(len);
                Chunk { sample, object: index, surfels }
            });
            chunks.flat_map(move |chunk| {
                let parts = match self.pieces.get(index) {
                    Some(pieces) => pieces.wanted(&self.view(&chunk), chunk.surfels.clone()),
                    None => vec![chunk.surfels.clone()],
                };
                parts.into_iter().map(move |surfels| Chunk { surfels, ..chunk })
            })
        })
    }

    fn view(&self, chunk: &Chunk) -> View<'_> {
        View {
            object: &self.group.samples[chunk.sample].objects[chunk.object],
            raster: self.group.raster,
            pixels: self.band.pixels,
            corner: self.band.corner,
            wanted: self.frame.wanted.as_ref().filter(|_| self.frame.swept.is_none()),
            near: self.frame.near,
            low_pass: self.frame.prefilter == Prefilter::Approx,
            two_sided: self.frame.objects[chunk.object].two_sided,
        }
    }

    /// Passes `project` and `bin` of one chunk.
    fn project(&self, chunk: &Chunk, binned: &mut Binned) {
        let start = Instant::now();
        let surfels = self.frame.objects[chunk.object].surfels;
        binned.splats.clear();
        project::project(&self.view(chunk), surfels, chunk.surfels.clone(), &mut binned.splats);
        binned.bin();
        if self.frame.swept.is_none() {
            self.light(chunk, binned);
        }
        self.clocks.splats.fetch_add(binned.splats.len() as u64, Relaxed);
        self.clocks.project.add(start);
    }

    /// Pass `sweep` of one chunk.
    fn sweep(&self, chunk: &Chunk, binned: &mut Binned<SweptSplat>) {
        let start = Instant::now();
        let kernel = self.frame.swept.unwrap_or_default();
        let volume = Volume { ellipsoid: kernel.shape == KernelShape::Ellipsoid, stretch: kernel.stretch() as f32 };
        let surfels = self.frame.objects[chunk.object].surfels;
        binned.splats.clear();
        swept::project(&self.view(chunk), volume, surfels, chunk.surfels.clone(), &mut binned.splats);
        binned.bin();
        self.light(chunk, binned);
        self.clocks.splats.fetch_add(binned.splats.len() as u64, Relaxed);
        self.clocks.project.add(start);
    }

    /// Shades the splats of one chunk, where surfels are shaded.
    fn light<S: Faced>(&self, chunk: &Chunk, binned: &mut Binned<S>) {
        // Those of an earlier frame must go.
        binned.lit.clear();
        if self.frame.shading == Shading::Gouraud {
            lit::light(&binned.splats, &self.attributes(chunk, &[]), &mut binned.lit);
        }
    }

    /// Share that a sample of weight `weight` has in its group: 1 where it is alone.
    fn share(&self, weight: f32) -> f32 {
        let total: f32 = self.group.samples.iter().map(|sample| sample.weight).sum();
        if total > 0.0 { weight / total } else { 1.0 }
    }

    /// `lit`: what the splats of the chunk show.
    fn attributes<'b>(&'b self, chunk: &Chunk, lit: &'b [Vec3]) -> Attributes<'b> {
        let sample = &self.group.samples[chunk.sample];
        Attributes {
            sample,
            posed: &sample.objects[chunk.object],
            object: &self.frame.objects[chunk.object],
            channels: self.channels,
            near: self.frame.near,
            low_pass: if self.frame.prefilter == Prefilter::Approx { self.group.raster.low_pass } else { 0.0 },
            stride: self.frame.stride as f32,
            share: if self.frame.objects[chunk.object].still { 1.0 } else { self.share(sample.weight) },
            lit,
        }
    }

    /// What a group's pixels are resolved with.
    fn resolve(&self) -> Resolve<'_> {
        Resolve {
            sample: &self.group.samples[self.group.samples.len() / 2],
            weight: self.group.samples[0].weight,
            channels: self.channels,
            planes: self.planes,
            shading: self.frame.shading,
            raster: &self.group.raster,
        }
    }

    /// What lies still in tile `index`, where it was splatted already.
    fn layer_tile(&self, index: usize) -> Option<&LayerTile> {
        self.layer.and_then(|layer| layer.tiles.get(index)).filter(|tile| !tile.is_empty())
    }

    /// Adds what lies still to a tile into which nothing else moves; false if it must be resolved anew for this group.
    fn add_still(&self, index: usize, film: &mut TileFilm) -> bool {
        let Some(still) = self.layer_tile(index).map(|tile| &tile.film.values).filter(|values| !values.is_empty())
        else {
            return false;
        };
        let start = Instant::now();
        film.values.resize(still.len(), 0.0);
        let weight = self.group.samples[0].weight;
        film.values.iter_mut().zip(still).for_each(|(out, value)| *out += weight * value);
        self.clocks.resolve.add(start);
        true
    }

    /// Brings what `pass` will write to where it starts, in tile `index`.
    fn prepare(&self, pass: Pass, index: usize, buffers: &mut TileBuffers, scratch: &mut Vec<u32>) {
        match pass {
            Pass::Visibility => {
                buffers.clear_threshold();
                if let Some(still) = self.layer_tile(index) {
                    still.begin(&mut buffers.threshold);
                }
            }
            Pass::Density => buffers.clear_sums(1, 1),
            Pass::Attribute => {
                let start = Instant::now();
                buffers.clear_sums(self.channels.count, self.group.samples.len());
                let still = self.layer_tile(index).and_then(|still| still.recall(self.channels.count, buffers));
                if let (Some(layer), Some(mut anew)) = (self.layer, still) {
                    std::mem::swap(&mut buffers.threshold, &mut anew);
                    let tile = self.band.tile(index);
                    let mut job =
                        Job { chunks: &layer.chunks, binned: &layer.binned, tile, buffers, scratch, out: &mut () };
                    self.add_splats(&mut job, &mut []);
                    std::mem::swap(&mut buffers.threshold, &mut anew);
                }
                self.clocks.attribute.add(start);
            }
            Pass::SweptAttribute => {
                buffers.clear_threshold();
                buffers.clear_sums(self.channels.count, 1);
                buffers.clear_presence();
            }
            Pass::Project | Pass::Bin | Pass::Resolve | Pass::Keep | Pass::Sweep | Pass::SweptResolve => {}
        }
    }

    /// Pass `visibility` of one tile.
    fn visibility<O>(&self, job: &mut Job<'_, Splat, O>) {
        let start = Instant::now();
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            if list.is_empty() {
                continue;
            }
            let epsilon = self.group.samples[chunk.sample].objects[chunk.object].epsilon;
            let depths = Depths { near: self.frame.near, epsilon };
            visibility::visibility(&binned.splats, list, depths, &job.tile, &mut job.buffers.threshold);
        }
        self.clocks.visibility.add(start);
    }

    /// Pass `attribute` of one tile; `nearest` as in `Tally`.
    fn attribute<O>(&self, job: &mut Job<'_, Splat, O>, nearest: &mut [f32]) {
        let start = Instant::now();
        self.add_splats(job, nearest);
        self.clocks.attribute.add(start);
    }

    fn add_splats<O>(&self, job: &mut Job<'_, Splat, O>, nearest: &mut [f32]) {
        let TileBuffers { threshold, sums, union, .. } = &mut *job.buffers;
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            if list.is_empty() {
                continue;
            }
            if self.group.samples.len() > 1 && !self.frame.objects[chunk.object].still {
                union.turn(|sample| self.group.samples[sample].weight, chunk.sample);
            }
            let mut tally = Tally { sums, reach: &mut union.reach, nearest };
            attribute::attribute(
                &binned.splats,
                list,
                &self.attributes(chunk, &binned.lit),
                &job.tile,
                threshold,
                &mut tally,
            );
        }
    }

    /// A pass of one tile of the image.
    fn tile(&self, pass: Pass, mut job: Job<'_, Splat, TileFilm>) {
        match pass {
            Pass::Visibility => self.visibility(&mut job),
            Pass::Attribute => self.attribute(&mut job, &mut []),
            Pass::Resolve => {
                let start = Instant::now();
                let TileBuffers { threshold, sums, union, .. } = job.buffers;
                if self.group.samples.len() > 1 {
                    union.turn(|sample| self.group.samples[sample].weight, self.group.samples.len());
                }
                resolve::resolve(&self.resolve(), &job.tile, threshold, sums, &union.coverage, job.out);
                self.clocks.resolve.add(start);
            }
            // Of other halves of a plan, or not tile by tile; likewise below.
            Pass::Project
            | Pass::Bin
            | Pass::Density
            | Pass::Keep
            | Pass::Sweep
            | Pass::SweptAttribute
            | Pass::SweptResolve => {}
        }
    }

    /// A pass of one tile of the map.
    fn map_tile(&self, pass: Pass, mut job: Job<'_, Splat, MapTile>) {
        let start = Instant::now();
        match pass {
            Pass::Visibility => self.visibility(&mut job),
            Pass::Density => {
                let channels = Channels::weights();
                for (chunk, binned) in job.chunks.iter().zip(job.binned) {
                    let list = binned.list(&job.tile, job.scratch);
                    if list.is_empty() {
                        continue;
                    }
                    let attributes = Attributes { channels: &channels, ..self.attributes(chunk, &binned.lit) };
                    let TileBuffers { threshold, sums, .. } = &mut *job.buffers;
                    let mut tally = Tally { sums, reach: &mut [], nearest: &mut [] };
                    attribute::attribute(&binned.splats, list, &attributes, &job.tile, threshold, &mut tally);
                }
                self.clocks.visibility.add(start);
            }
            Pass::Keep => {
                swept::keep(&job.tile, &job.buffers.threshold, &job.buffers.sums, job.out);
                self.clocks.visibility.add(start);
            }
            Pass::Project
            | Pass::Bin
            | Pass::Attribute
            | Pass::Resolve
            | Pass::Sweep
            | Pass::SweptAttribute
            | Pass::SweptResolve => {}
        }
    }

    /// A pass of kernels in motion on one tile of the image.
    fn swept_tile(&self, pass: Pass, map: &Map, job: &mut Job<'_, SweptSplat, TileFilm>) {
        let start = Instant::now();
        let (Some(kernel), Some(interval)) = (self.frame.swept, &self.group.interval) else { return };
        let sum = kernel.alpha == TemporalAlpha::Sum;
        let TileBuffers { threshold, sums, union, presence } = &mut *job.buffers;
        match pass {
            Pass::SweptAttribute => {
                for (chunk, binned) in job.chunks.iter().zip(job.binned) {
                    let list = binned.list(&job.tile, job.scratch);
                    if list.is_empty() {
                        continue;
                    }
                    let swept = Swept {
                        attributes: self.attributes(chunk, &binned.lit),
                        footprint: Footprint::of(kernel),
                        source_samples: kernel.source_samples.0,
                        slope: interval.slope,
                        sum,
                        map,
                    };
                    swept::attribute(&binned.splats, list, &swept, &job.tile, sums, presence);
                }
                self.clocks.attribute.add(start);
            }
            Pass::SweptResolve => {
                let weight = self.group.samples[0].weight;
                let coverage = &mut union.coverage;
                swept::coverage(&Exposure { interval, weight, sum }, presence, coverage);
                if kernel.normalise == Normalise::Once {
                    swept::pool(weight, self.channels, self.planes, &job.tile, sums, coverage, &mut job.out.values);
                } else {
                    resolve::resolve(&self.resolve(), &job.tile, threshold, sums, coverage, job.out);
                }
                self.clocks.resolve.add(start);
            }
            Pass::Project
            | Pass::Bin
            | Pass::Visibility
            | Pass::Attribute
            | Pass::Resolve
            | Pass::Density
            | Pass::Keep
            | Pass::Sweep => {}
        }
    }
}

/// Time of one pass over all threads, nanoseconds.
#[derive(Debug, Default)]
struct Clock(AtomicU64);

impl Clock {
    fn add(&self, start: Instant) {
        self.0.fetch_add(start.elapsed().as_nanos() as u64, Relaxed);
    }

    fn total(&self) -> Duration {
        Duration::from_nanos(self.0.load(Relaxed))
    }
}

#[derive(Debug, Default)]
struct Clocks {
    project: Clock,
    visibility: Clock,
    attribute: Clock,
    resolve: Clock,
    splats: AtomicU64,
}

impl Clocks {
    fn stats(&self, frame: &Frame<'_>) -> Stats {
        Stats {
            splats: self.splats.load(Relaxed),
            project: self.project.total(),
            visibility: self.visibility.total(),
            attribute: self.attribute.total(),
            resolve: self.resolve.total(),
            ..Stats::of(frame)
        }
    }
}

//! The CPU backend: the passes, one file each, and the order in which they run.
//!
//! Chunks of surfels go through `project` and `bin`, in parallel; then tiles go through `visibility`, `attribute` and
//! `resolve`, in parallel. Where the splats of a group do not fit into the memory allowed, they pass in waves, first for
//! visibility, then again for attributes; where the tiles' buffers do not fit, the image is cut into bands. Sums are taken in
//! global surfel order in every case, so the bytes depend on neither.

mod attribute;
mod bin;
mod project;
mod resolve;
mod tiles;
#[cfg(all(test, feature = "gpu"))]
pub(super) mod twins;
mod visibility;

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use self::attribute::Attributes;
use self::bin::Binned;
use self::project::View;
use self::resolve::{RasterFilms, Resolve, TileFilm, TiledFilm};
use self::tiles::{Band, TILE, TileBuffers, TileRect};
use self::visibility::Depths;
use super::{Backend, BackendError, Rendered, Stats};
use crate::film::{FilmPlanes, develop};
use crate::frame::{Frame, PosedGroup};
use crate::layout::Channels;
use crate::plan::{Pass, Prefilter};

/// Surfels of a chunk.
const CHUNK: usize = 4096;

/// Executes plans with the threads of the current rayon pool.
#[derive(Debug, Default)]
pub struct Cpu {
    /// Kept between groups and frames, so that their memory is reused.
    binned: Vec<Binned>,
    /// Likewise, for bands whose splats come in waves.
    buffers: Vec<TileBuffers>,
    /// The frame that was begun.
    done: Option<Rendered>,
}

/// Some surfels of one object at one sample of the group.
#[derive(Clone, Debug)]
struct Chunk {
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
        let channels = Channels::of(frame);
        let budget = Budget::of(frame, &planes, &channels)?;
        let stride = frame.stride as usize;
        let mut films = RasterFilms { films: Vec::new(), stride, samples: frame.samples() };
        let clocks = Clocks::default();
        for groups in frame.groups.chunk_by(|a, b| a.raster.phase == b.raster.phase) {
            let size = groups[0].raster.size;
            let mut film = TiledFilm::new(size);
            let tiles_y = (size[1] as usize).div_ceil(TILE);
            for first in (0..tiles_y).step_by(budget.band_rows) {
                let rows = [first, (first + budget.band_rows).min(tiles_y)];
                let band = Band::new(size, rows);
                let tiles = &mut film.tiles[rows[0] * film.tiles_x..rows[1] * film.tiles_x];
                for group in groups {
                    let work = Work { frame, group, band, planes: &planes, channels: &channels, clocks: &clocks };
                    self.group(&work, budget.splat_bytes, tiles);
                }
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
        let row = tiles_x * TileBuffers::bytes(channels.count, samples);
        let threads = rayon::current_num_threads() as u64;
        let wave = |rows: u64| {
            let band = Band::new(raster, [0, rows as usize]);
            (threads + 1) * Binned::most_bytes(CHUNK, &band)
        };
        let needed = frame.model_bytes + film + row + wave(1);
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
        let rows = (left / 2 / row.max(1)).clamp(1, tiles_y.max(1));
        Ok(Self { band_rows: rows as usize, splat_bytes: left.saturating_sub(rows * row).max(wave(rows)) })
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
    clocks: &'a Clocks,
}

impl Cpu {
    fn group(&mut self, work: &Work<'_>, splat_bytes: u64, films: &mut [TileFilm]) {
        let chunks = work.chunks();
        let tile_passes: Vec<Pass> =
            work.frame.passes.iter().copied().filter(|pass| !matches!(pass, Pass::Project | Pass::Bin)).collect();
        let taken = self.wave(work, &chunks, splat_bytes);
        if taken == chunks.len() {
            // All splats at hand: each tile goes through its passes at once, in buffers that stay in the cache.
            let binned = &self.binned;
            films.par_iter_mut().enumerate().for_each_init(
                || (TileBuffers::default(), Vec::new()),
                |(buffers, scratch), (index, film)| {
                    let tile = work.band.tile(index);
                    if binned[..taken].iter().all(|binned| binned.list(&tile, scratch).is_empty()) {
                        return;
                    }
                    for &pass in &tile_passes {
                        work.prepare(pass, buffers);
                        work.tile(pass, &chunks, binned, &tile, buffers, scratch, film);
                    }
                },
            );
            return;
        }
        self.buffers.resize_with(films.len().max(self.buffers.len()), TileBuffers::default);
        let mut done = taken;
        let mut start = 0;
        for &pass in &tile_passes {
            self.buffers.par_iter_mut().for_each(|buffers| work.prepare(pass, buffers));
            loop {
                let wave = &chunks[start..done];
                let binned = &self.binned;
                self.buffers.par_iter_mut().zip(films.par_iter_mut()).enumerate().for_each_init(
                    Vec::new,
                    |scratch, (index, (buffers, film))| {
                        work.tile(pass, wave, binned, &work.band.tile(index), buffers, scratch, film);
                    },
                );
                if pass == Pass::Resolve {
                    break;
                }
                // On to the next wave; after the last, back to the first for the next pass.
                start = if done == chunks.len() { 0 } else { done };
                done = start + self.wave(work, &chunks[start..], splat_bytes);
                if start == 0 {
                    break;
                }
            }
        }
    }

    /// Projects and bins as many of `chunks` as fit into `splat_bytes`, at least one; returns how many.
    fn wave(&mut self, work: &Work<'_>, chunks: &[Chunk], splat_bytes: u64) -> usize {
        let most = Binned::most_bytes(CHUNK, &work.band);
        let least = rayon::current_num_threads();
        let mut used = 0;
        let mut done = 0;
        while done < chunks.len() {
            let fit = (splat_bytes.saturating_sub(used) / most) as usize;
            if fit < least && done > 0 {
                break;
            }
            let end = (done + fit.max(least)).min(chunks.len());
            self.binned.resize_with(self.binned.len().max(end), Binned::default);
            let slots = &mut self.binned[done..end];
            slots.par_iter_mut().zip(&chunks[done..end]).for_each(|(binned, chunk)| work.project(chunk, binned));
            used += slots.iter().map(Binned::bytes).sum::<u64>();
            done = end;
        }
        done
    }
}

impl Work<'_> {
    fn chunks(&self) -> Vec<Chunk> {
        let mut chunks = Vec::new();
        for (sample, posed) in self.group.samples.iter().enumerate() {
            for (object, pose) in posed.objects.iter().enumerate() {
                if !pose.visible {
                    continue;
                }
                let len = self.frame.objects[object].surfels.len();
                let ranges = (0..len).step_by(CHUNK).map(|first| first..(first + CHUNK).min(len));
                chunks.extend(ranges.map(|surfels| Chunk { sample, object, surfels }));
            }
        }
        chunks
    }

    /// Passes `project` and `bin` of one chunk.
    fn project(&self, chunk: &Chunk, binned: &mut Binned) {
        let start = Instant::now();
        let sample = &self.group.samples[chunk.sample];
        let view = View {
            object: &sample.objects[chunk.object],
            raster: self.group.raster,
            pixels: self.band.pixels,
            near: self.frame.near,
            low_pass: self.frame.prefilter == Prefilter::Approx,
            two_sided: self.frame.objects[chunk.object].two_sided,
        };
        binned.splats.clear();
        project::project(&view, self.frame.objects[chunk.object].surfels, chunk.surfels.clone(), &mut binned.splats);
        binned.bin();
        self.clocks.splats.fetch_add(binned.splats.len() as u64, Relaxed);
        self.clocks.project.add(start);
    }

    /// Share that a sample of weight `weight` has in its group: 1 where it is alone.
    fn share(&self, weight: f32) -> f32 {
        let total: f32 = self.group.samples.iter().map(|sample| sample.weight).sum();
        if total > 0.0 { weight / total } else { 1.0 }
    }

    /// Clears what `pass` will write.
    fn prepare(&self, pass: Pass, buffers: &mut TileBuffers) {
        match pass {
            Pass::Visibility => buffers.clear_threshold(),
            Pass::Attribute => buffers.clear_sums(self.channels.count, self.group.samples.len()),
            Pass::Project | Pass::Bin | Pass::Resolve => {}
        }
    }

    #[allow(clippy::too_many_arguments, reason = "a tile's inputs and outputs, each of another owner")]
    fn tile(
        &self,
        pass: Pass,
        chunks: &[Chunk],
        binned: &[Binned],
        tile: &TileRect,
        buffers: &mut TileBuffers,
        scratch: &mut Vec<u32>,
        film: &mut TileFilm,
    ) {
        let start = Instant::now();
        let TileBuffers { threshold, sums, union } = buffers;
        let several = self.group.samples.len() > 1;
        match pass {
            Pass::Project | Pass::Bin => {}
            Pass::Visibility => {
                for (chunk, binned) in chunks.iter().zip(binned) {
                    let list = binned.list(tile, scratch);
                    if list.is_empty() {
                        continue;
                    }
                    let epsilon = self.group.samples[chunk.sample].objects[chunk.object].epsilon;
                    let depths = Depths { near: self.frame.near, epsilon };
                    visibility::visibility(&binned.splats, list, depths, tile, threshold);
                }
                self.clocks.visibility.add(start);
            }
            Pass::Attribute => {
                for (chunk, binned) in chunks.iter().zip(binned) {
                    let list = binned.list(tile, scratch);
                    if list.is_empty() {
                        continue;
                    }
                    let sample = &self.group.samples[chunk.sample];
                    if several && chunk.sample != union.sample {
                        union.turn(self.group.samples[union.sample].weight, chunk.sample);
                    }
                    let attributes = Attributes {
                        sample,
                        posed: &sample.objects[chunk.object],
                        object: &self.frame.objects[chunk.object],
                        channels: self.channels,
                        near: self.frame.near,
                        low_pass: if self.frame.prefilter == Prefilter::Approx {
                            self.group.raster.low_pass
                        } else {
                            0.0
                        },
                        stride: self.frame.stride as f32,
                        share: self.share(sample.weight),
                        shading: self.frame.shading,
                    };
                    attribute::attribute(&binned.splats, list, &attributes, tile, threshold, sums, &mut union.reach);
                }
                self.clocks.attribute.add(start);
            }
            Pass::Resolve => {
                let samples = &self.group.samples;
                if several {
                    union.turn(samples[union.sample].weight, 0);
                }
                let resolve = Resolve {
                    sample: &samples[samples.len() / 2],
                    channels: self.channels,
                    planes: self.planes,
                    shading: self.frame.shading,
                    raster: &self.group.raster,
                };
                resolve::resolve(&resolve, tile, threshold, sums, &union.coverage, film);
                self.clocks.resolve.add(start);
            }
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

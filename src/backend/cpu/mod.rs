//! The CPU backend: the passes, one file each, and the order in which they run.
//!
//! Chunks of surfels go through `project` and `bin`, in parallel; then tiles go through `visibility`, `attribute` and
//! `resolve`, in parallel. Where the splats of a group do not fit into the memory allowed, they pass in waves, first for
//! visibility, then again for attributes; where the tiles' buffers do not fit, the image is cut into bands. Sums are taken in
//! global surfel order in every case, so the bytes depend on neither.

mod attribute;
mod bin;
mod budget;
mod clocks;
mod layer;
mod patch;
mod project;
mod resolve;
mod swept;
mod tiles;
#[cfg(all(test, feature = "gpu"))]
pub(super) mod twins;
mod values;
mod visibility;
mod waves;
mod work;

use rayon::prelude::*;

use self::bin::Binned;
use self::budget::Budget;
use self::clocks::Clocks;
use self::layer::{Layer, LayerTile};
use self::resolve::{RasterFilms, Resolve, TileFilm, TiledFilm};
#[cfg(all(test, feature = "gpu"))]
pub(super) use self::swept::twins as swept_twins;
use self::swept::{Map, StillTile};
use self::tiles::{Band, ROWS, STRIDE, TILE, TileBuffers};
use self::waves::{Job, Tiles};
use self::work::{Chunk, Work};
use super::clusters::ClusterStore;
use super::{Backend, BackendError, Rendered};
use crate::film::{FilmPlanes, Picture, develop};
use crate::frame::{Blocks, Frame};
use crate::layout::{Channels, Splat, SweptSplat};
use crate::options::{Normalise, TemporalAlpha};
use crate::plan::Pass;

/// Pictures whose memory is kept: those that mode auto gives back.
const SPARE_PICTURES: usize = 3;

const _: () = assert!(TILE == Blocks::EDGE);

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
    clusters: ClusterStore,
    /// Films of rasters, for the next frame.
    films: Vec<TiledFilm>,
    /// Of pictures that were given back.
    pixels: Vec<Vec<[f32; 4]>>,
    /// The frame that was begun.
    done: Option<Rendered>,
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

    fn recycle(&mut self, picture: Picture) {
        if self.pixels.len() < SPARE_PICTURES {
            self.pixels.push(picture.rgba);
        }
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
        let clusters = self.clusters.of_frame(frame);
        let (has_still_picture, one_view) = (frame.has_still_picture(), frame.has_one_view());
        for groups in frame.groups.chunk_by(|a, b| a.raster.phase == b.raster.phase) {
            let size = groups[0].raster.size;
            let mut film = self.films.pop().unwrap_or_default();
            film.empty(size);
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
                        still: None,
                        map: None,
                        clusters: &clusters,
                        clocks: &clocks,
                    };
                    let shared = budget.layers && groups.len() > 1;
                    let layer = if shared { self.layer(&of_group(&groups[0]), budget.splat_bytes) } else { None };
                    let mut still = Vec::new();
                    for (number, group) in groups.iter().enumerate() {
                        let work = Work { layer: layer.as_ref(), ..of_group(group) };
                        // Light at surfels may change from interval to interval.
                        if has_still_picture && (number == 0 || !one_view) {
                            still = self.picture_still(&work, budget.splat_bytes);
                        }
                        let work = Work { still: has_still_picture.then_some(&still), ..work };
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
        let wanted = |y| Blocks::columns(frame.wanted.as_ref(), y, frame.size[0] as usize, stride);
        let picture = develop(&films, frame.size, frame.aovs, frame.background, wanted, self.pixels.pop());
        self.films = films.films;
        Ok(Rendered { picture, stats: clocks.stats(frame) })
    }
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
                let mut job = Job { chunks: &chunks, binned: &binned, tile, index, buffers, scratch, out: &mut () };
                work.visibility(&mut job);
                job.buffers.clear_sums(work.channels.count, work.group.samples.len());
                let mut nearest = vec![f32::INFINITY; ROWS * STRIDE];
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

    /// The picture of what lies still, at the sample position of a group and in its light.
    fn picture_still(&mut self, work: &Work<'_>, splat_bytes: u64) -> Vec<StillTile> {
        let chunks: Vec<Chunk> = work.still_chunks().collect();
        let mut picture = vec![StillTile::default(); work.band.len()];
        let tiles = Tiles { work, chunks: &chunks, passes: &Pass::UNSWEPT, splat_bytes };
        let project = |chunk: &Chunk, binned: &mut _| work.project(chunk, binned);
        let picture_tile = |pass, job: Job<'_, Splat, _>| work.picture_still(pass, job);
        tiles.run(&mut self.binned, &mut self.buffers, &mut picture, project, |_, _| true, picture_tile);
        picture
    }

    fn group(&mut self, work: &Work<'_>, splat_bytes: u64, films: &mut [TileFilm]) {
        let chunks = work.chunks();
        let passes = work.frame.passes;
        let Some(kept) = passes.iter().position(|&pass| pass == Pass::Keep) else {
            let tiles = Tiles { work, chunks: &chunks, passes, splat_bytes };
            let project = |chunk: &Chunk, binned: &mut _| work.project(chunk, binned);
            let unmoved = |index, film: &mut _| work.layer_tile(index).is_none() || work.add_still(index, film);
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
            |_, _| true,
            |pass, job| {
                around.map_tile(pass, job);
            },
        );
        let work = &Work { map: Some(&self.map), ..*work };
        let tiles = Tiles { work, chunks: &chunks, passes: moving, splat_bytes };
        let project = |chunk: &Chunk, binned: &mut _| work.sweep(chunk, binned);
        let unmoved = |index: usize, film: &mut _| {
            work.show_still(index, film);
            true
        };
        tiles.run(&mut self.swept, &mut self.buffers, films, project, unmoved, |pass, mut job| {
            work.swept_tile(pass, &mut job);
        });
    }
}

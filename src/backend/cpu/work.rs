//! The passes of one group in one band: what each reads and writes, for a chunk of surfels or for a tile.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

use super::attribute::{self, Attributes, Tally};
use super::bin::Binned;
use super::clocks::Clocks;
use super::layer::{Layer, LayerTile};
use super::project::{self, View};
use super::resolve::{self, Resolve, TileFilm};
use super::swept::{self, Exposure, Footprint, Map, MapTile, StillTile, Swept, Volume};
use super::tiles::{Band, TileBuffers};
use super::values::{self, Faced, Shown};
use super::visibility::{self, Depths};
use super::waves::Job;
use crate::backend::clusters::Clusters;
use crate::film::FilmPlanes;
use crate::frame::{Frame, PosedGroup};
use crate::layout::{Channels, Splat, SweptSplat};
use crate::options::{KernelShape, Normalise, Prefilter, TemporalAlpha};
use crate::plan::Pass;

/// Surfels of a chunk.
pub(super) const CHUNK: usize = 4096;

/// Some surfels of one object at one sample of the group.
#[derive(Clone, Debug)]
pub(super) struct Chunk {
    /// The first one for objects that lie still.
    pub sample: usize,
    pub object: usize,
    pub surfels: Range<usize>,
}

/// One group in one band.
#[derive(Clone, Copy)]
pub(super) struct Work<'a> {
    pub frame: &'a Frame<'a>,
    pub group: &'a PosedGroup,
    pub band: Band,
    pub planes: &'a FilmPlanes,
    pub channels: &'a Channels,
    /// What lies still, where it was splatted already.
    pub layer: Option<&'a Layer>,
    /// The picture of what lies still, tile by tile, where it has one; once it is whole.
    pub still: Option<&'a [StillTile]>,
    /// Where kernels in motion look up sources, once it is whole.
    pub map: Option<&'a Map>,
    /// Of each object.
    pub clusters: &'a [Arc<Clusters>],
    pub clocks: &'a Clocks,
}

impl Work<'_> {
    /// Everything that the group must splat: first what lies still, once for all samples.
    pub(super) fn chunks(&self) -> Vec<Chunk> {
        let still = self.still_chunks().filter(|_| self.layer.is_none() && self.still.is_none());
        let samples = 0..self.group.samples.len();
        still.chain(samples.flat_map(|sample| self.chunks_of(sample, false))).collect()
    }

    pub(super) fn still_chunks(&self) -> impl Iterator<Item = Chunk> {
        self.chunks_of(0, true)
    }

    /// The objects that lie still, or do not, at one sample.
    pub(super) fn chunks_of(&self, sample: usize, still: bool) -> impl Iterator<Item = Chunk> {
        let objects = self.group.samples[sample].objects.iter().zip(&self.frame.objects).enumerate();
        let wanted = objects.filter(move |(_, (pose, object))| pose.visible && object.still == still);
        wanted.flat_map(move |(index, (_, object))| {
            let len = object.surfels.len();
            (0..len).step_by(CHUNK).map(move |first| {
                let surfels = first..(first + CHUNK).min(len);
                Chunk { sample, object: index, surfels }
            })
        })
    }

    pub(super) fn view(&self, chunk: &Chunk) -> View<'_> {
        View {
            object: &self.group.samples[chunk.sample].objects[chunk.object],
            raster: self.group.raster,
            pixels: self.band.pixels,
            corner: self.band.corner,
            wanted: self.frame.wanted.as_ref().filter(|_| self.frame.swept.is_none()),
            near: self.frame.near,
            low_pass: self.frame.prefilter == Prefilter::Approx,
            two_sided: self.frame.objects[chunk.object].two_sided,
            clusters: self.clusters.get(chunk.object).map(Arc::as_ref),
        }
    }

    /// Passes `project` and `bin` of one chunk.
    pub(super) fn project(&self, chunk: &Chunk, binned: &mut Binned) {
        let start = Instant::now();
        let surfels = self.frame.objects[chunk.object].surfels;
        binned.splats.clear();
        project::project(&self.view(chunk), surfels, chunk.surfels.clone(), &mut binned.splats);
        binned.bin();
        // On the map only depths and weights are wanted.
        if self.frame.swept.is_none() || self.frame.objects[chunk.object].still && self.frame.has_still_picture() {
            self.show(chunk, binned);
        }
        self.clocks.splats.fetch_add(binned.splats.len() as u64, Relaxed);
        self.clocks.project.add(start);
    }

    /// Pass `sweep` of one chunk.
    pub(super) fn sweep(&self, chunk: &Chunk, binned: &mut Binned<SweptSplat>) {
        let start = Instant::now();
        let kernel = self.frame.swept.unwrap_or_default();
        let volume = Volume { ellipsoid: kernel.shape == KernelShape::Ellipsoid, stretch: kernel.stretch() as f32 };
        let surfels = self.frame.objects[chunk.object].surfels;
        binned.splats.clear();
        swept::project(&self.view(chunk), volume, surfels, chunk.surfels.clone(), &mut binned.splats);
        binned.bin();
        self.show(chunk, binned);
        self.clocks.splats.fetch_add(binned.splats.len() as u64, Relaxed);
        self.clocks.project.add(start);
    }

    /// What the splats of one chunk show.
    fn show<S: Faced>(&self, chunk: &Chunk, binned: &mut Binned<S>) {
        let sample = &self.group.samples[chunk.sample];
        let shown = Shown {
            sample,
            posed: &sample.objects[chunk.object],
            object: &self.frame.objects[chunk.object],
            channels: self.channels,
            shading: self.frame.shading,
            near: self.frame.near,
            stride: self.frame.stride as f32,
        };
        values::values(&binned.splats, &shown, &mut binned.values);
    }

    /// Share that a sample of weight `weight` has in its group: 1 where it is alone.
    pub(super) fn share(&self, weight: f32) -> f32 {
        let total: f32 = self.group.samples.iter().map(|sample| sample.weight).sum();
        if total > 0.0 { weight / total } else { 1.0 }
    }

    /// `values`: what the splats of the chunk show.
    fn attributes<'b>(&'b self, chunk: &Chunk, values: &'b [f32]) -> Attributes<'b> {
        let sample = &self.group.samples[chunk.sample];
        Attributes {
            channels: self.channels,
            near: self.frame.near,
            low_pass: if self.frame.prefilter == Prefilter::Approx { self.group.raster.low_pass } else { 0.0 },
            share: if self.frame.objects[chunk.object].still { 1.0 } else { self.share(sample.weight) },
            values,
        }
    }

    /// What a group's pixels are resolved with.
    pub(super) fn resolve(&self) -> Resolve<'_> {
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
    pub(super) fn layer_tile(&self, index: usize) -> Option<&LayerTile> {
        self.layer.and_then(|layer| layer.tiles.get(index)).filter(|tile| !tile.is_empty())
    }

    /// Adds what lies still to a tile into which nothing else moves; false if it must be resolved anew for this group.
    pub(super) fn add_still(&self, index: usize, film: &mut TileFilm) -> bool {
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
    pub(super) fn prepare(&self, pass: Pass, index: usize, buffers: &mut TileBuffers, scratch: &mut Vec<u32>) {
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
                    let mut job = Job {
                        chunks: &layer.chunks,
                        binned: &layer.binned,
                        tile,
                        index,
                        buffers,
                        scratch,
                        out: &mut (),
                    };
                    self.add_splats(&mut job, &mut []);
                    std::mem::swap(&mut buffers.threshold, &mut anew);
                }
                self.clocks.attribute.add(start);
            }
            Pass::SweptAttribute => {
                buffers.clear_threshold();
                buffers.clear_sums(self.channels.count, 1);
                buffers.clear_presence();
                if let Some(still) = self.still_tile(index) {
                    still.begin(&mut buffers.threshold);
                }
            }
            Pass::Project | Pass::Bin | Pass::Resolve | Pass::Keep | Pass::Sweep | Pass::SweptResolve => {}
        }
    }

    /// What lies still in tile `index`, beside kernels in motion.
    fn still_tile(&self, index: usize) -> Option<&StillTile> {
        self.still.and_then(|tiles| tiles.get(index))
    }

    /// Adds what lies still, if it has a picture, to a tile into which no kernel moves.
    pub(super) fn show_still(&self, index: usize, film: &mut TileFilm) {
        let Some(still) = self.still_tile(index) else { return };
        let start = Instant::now();
        let (weight, tile) = (self.group.samples[0].weight, self.band.tile(index));
        still.show(weight, &[], self.planes.weight, &tile, film);
        self.clocks.resolve.add(start);
    }

    /// Pass `visibility` of one tile.
    pub(super) fn visibility<O>(&self, job: &mut Job<'_, Splat, O>) {
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
    pub(super) fn attribute<O>(&self, job: &mut Job<'_, Splat, O>, nearest: &mut [f32]) {
        let start = Instant::now();
        self.add_splats(job, nearest);
        self.clocks.attribute.add(start);
    }

    pub(super) fn add_splats<O>(&self, job: &mut Job<'_, Splat, O>, nearest: &mut [f32]) {
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
                &self.attributes(chunk, &binned.values),
                &job.tile,
                threshold,
                &mut tally,
            );
        }
    }

    /// A pass of one tile of the image.
    pub(super) fn tile(&self, pass: Pass, job: Job<'_, Splat, TileFilm>) {
        self.unswept(pass, job, |job| {
            let TileBuffers { threshold, sums, union, .. } = job.buffers;
            if self.group.samples.len() > 1 {
                union.turn(|sample| self.group.samples[sample].weight, self.group.samples.len());
            }
            resolve::resolve(&self.resolve(), &job.tile, threshold, sums, &union.coverage, job.out);
        });
    }

    /// A pass of one tile of the picture of what lies still.
    pub(super) fn picture_still(&self, pass: Pass, job: Job<'_, Splat, StillTile>) {
        self.unswept(pass, job, |job| {
            let whole = Resolve { weight: 1.0, ..self.resolve() };
            let TileBuffers { threshold, sums, .. } = job.buffers;
            job.out.threshold.clone_from(threshold);
            resolve::resolve(&whole, &job.tile, threshold, sums, &[], &mut job.out.film);
        });
    }

    /// A pass of what is not swept on one tile.
    fn unswept<O>(&self, pass: Pass, mut job: Job<'_, Splat, O>, resolve: impl FnOnce(Job<'_, Splat, O>)) {
        match pass {
            Pass::Visibility => self.visibility(&mut job),
            Pass::Attribute => self.attribute(&mut job, &mut []),
            Pass::Resolve => {
                let start = Instant::now();
                resolve(job);
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

    /// Pass `density` of one tile.
    pub(super) fn density<O>(&self, job: &mut Job<'_, Splat, O>) {
        let channels = Channels::weights();
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            if list.is_empty() {
                continue;
            }
            let attributes = Attributes { channels: &channels, ..self.attributes(chunk, &[]) };
            let TileBuffers { threshold, sums, .. } = &mut *job.buffers;
            let mut tally = Tally { sums, reach: &mut [], nearest: &mut [] };
            attribute::attribute(&binned.splats, list, &attributes, &job.tile, threshold, &mut tally);
        }
    }

    /// A pass of one tile of the map.
    pub(super) fn map_tile(&self, pass: Pass, mut job: Job<'_, Splat, MapTile>) {
        let start = Instant::now();
        match pass {
            Pass::Visibility => self.visibility(&mut job),
            Pass::Density => {
                self.density(&mut job);
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

    /// Pass `attribute` of kernels in motion, of one tile.
    fn add_swept<O>(&self, job: &mut Job<'_, SweptSplat, O>) {
        let (Some(kernel), Some(interval), Some(map)) = (self.frame.swept, &self.group.interval, self.map) else {
            return;
        };
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            if list.is_empty() {
                continue;
            }
            let swept = Swept {
                attributes: self.attributes(chunk, &binned.values),
                footprint: Footprint::of(kernel),
                source_samples: kernel.source_samples.0,
                slope: interval.slope,
                sum: kernel.alpha == TemporalAlpha::Sum,
                map,
            };
            let TileBuffers { threshold, sums, presence, .. } = &mut *job.buffers;
            swept::attribute(&binned.splats, list, &swept, &job.tile, threshold, sums, presence);
        }
    }

    /// A pass of kernels in motion on one tile of the image.
    pub(super) fn swept_tile(&self, pass: Pass, job: &mut Job<'_, SweptSplat, TileFilm>) {
        let start = Instant::now();
        let (Some(kernel), Some(interval)) = (self.frame.swept, &self.group.interval) else { return };
        match pass {
            Pass::SweptAttribute => {
                self.add_swept(job);
                self.clocks.attribute.add(start);
            }
            Pass::SweptResolve => {
                let TileBuffers { threshold, sums, union, presence } = &mut *job.buffers;
                let weight = self.group.samples[0].weight;
                let coverage = &mut union.coverage;
                let sum = kernel.alpha == TemporalAlpha::Sum;
                swept::coverage(&Exposure { interval, weight, sum }, presence, coverage);
                if kernel.normalise == Normalise::Once {
                    swept::pool(weight, self.channels, self.planes, &job.tile, sums, coverage, &mut job.out.values);
                } else {
                    resolve::resolve(&self.resolve(), &job.tile, threshold, sums, coverage, job.out);
                }
                if let Some(still) = self.still_tile(job.index) {
                    still.show(weight, coverage, self.planes.weight, &job.tile, job.out);
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

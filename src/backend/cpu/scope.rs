//! One group in one band: what its passes read, made the same way for every step and for the tests of parity.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

use glam::Vec3;

use super::attribute::Attributes;
use super::bin::Binned;
use super::chunk::Chunk;
use super::clocks::Clocks;
use super::depths::Depths;
use super::land::Strip;
use super::project::SurfelView;
use super::resolve::Resolve;
use super::shadows::Shadows;
use super::tile_buffers::TileBuffers;
use super::tiles::Band;
use super::values::{self, Faced, Shown};
use super::waste::{WasteView, Wasteful};
use crate::backend::clusters::Clusters;
use crate::film::FilmPlanes;
use crate::frame::{Frame, PosedGroup, PosedObject, Raster};
use crate::layout::Channels;
use crate::options::Prefilter;

/// One group in one band.
#[derive(Clone, Copy)]
pub(in crate::backend) struct Scope<'a> {
    pub frame: &'a Frame,
    /// The raster of the sample position.
    pub raster: &'a Raster,
    pub group: &'a PosedGroup,
    pub band: Band,
    pub planes: &'a FilmPlanes,
    pub channels: &'a Channels,
    /// One for each object; empty where they are not known.
    pub clusters: &'a [Arc<Clusters>],
    pub clocks: &'a Clocks,
    /// The shadow maps of the group; `None`: no light has shadows.
    pub shadows: Option<&'a Shadows>,
}

impl Scope<'_> {
    /// What `project` and `sweep` need for one chunk.
    pub(in crate::backend) fn view<'b>(&'b self, chunk: &Chunk<'b>) -> SurfelView<'b> {
        SurfelView {
            object: &self.group.samples[chunk.sample].objects[chunk.object],
            eyes: self.group.samples[chunk.sample].objects[chunk.object].eyes(),
            raster: *self.raster,
            pixels: self.band.pixels,
            corner: self.band.corner,
            wanted: self.frame.wanted.as_ref().filter(|_| self.frame.swept.is_none()),
            near: self.frame.near,
            centre_disc: 0.0,
            margin: 0.0,
            two_sided: self.frame.objects[chunk.object].two_sided,
            paths: chunk.model.paths(),
            clusters: self.clusters.get(chunk.object).map(Arc::as_ref),
        }
    }

    /// Where the values of one chunk come from.
    pub(in crate::backend) fn shown<'b>(&'b self, chunk: &Chunk<'b>) -> Shown<'b> {
        let sample = &self.group.samples[chunk.sample];
        Shown {
            sample,
            posed: &sample.objects[chunk.object],
            object: &self.frame.objects[chunk.object],
            model: chunk.model,
            channels: self.channels,
            shading: self.frame.shading,
            near: self.frame.near,
            stride: self.frame.stride as f32,
            focal: self.raster.focal,
            surroundings: self.frame.surroundings.as_ref(),
            pixel: self.raster.pixel / self.raster.focal,
            strip: Strip::of(self.raster).filter(|_| sample.objects[chunk.object].moves),
            shadows: self.shadows.filter(|_| self.frame.objects[chunk.object].receives),
            middle: self.middle(chunk),
        }
    }

    /// The object of a chunk in the middle of the group, if its shadows are of another place than its own.
    fn middle(&self, chunk: &Chunk<'_>) -> Option<(&PosedObject, Vec3)> {
        let middle = self.group.samples.len() / 2;
        let is_elsewhere = middle != chunk.sample || self.frame.objects[chunk.object].is_held;
        let sample = &self.group.samples[middle];
        let posed = &sample.objects[chunk.object];
        let has_other = self.shadows.is_some() && is_elsewhere && posed.visible;
        has_other.then(|| (posed, self.frame.place_of(chunk.object, sample)))
    }

    /// What `attribute` needs for one chunk, whose splats have `values`.
    pub(in crate::backend) fn attributes<'b>(&'b self, chunk: &Chunk<'_>, values: &'b [f32]) -> Attributes<'b> {
        let sample = &self.group.samples[chunk.sample];
        Attributes {
            channels: self.channels,
            world_from_view: sample.objects[chunk.object].world_from_view,
            share: if self.frame.objects[chunk.object].is_static { 1.0 } else { self.share(sample.weight) },
            values,
        }
    }

    /// Radius of the low-pass discs of published kernels, raster pixels; +0 without them.
    pub(in crate::backend) fn low_pass(&self) -> f32 {
        if self.frame.prefilter == Prefilter::Approx { self.raster.low_pass } else { 0.0 }
    }

    /// Share that a sample of weight `weight` has in its group: 1 where it is alone.
    fn share(&self, weight: f32) -> f32 {
        let total: f32 = self.group.samples.iter().map(|sample| sample.weight).sum();
        if total > 0.0 { weight / total } else { 1.0 }
    }

    /// The depth tolerance of one chunk.
    pub(in crate::backend) fn depths(&self, chunk: &Chunk<'_>) -> Depths {
        let epsilon = self.group.samples[chunk.sample].objects[chunk.object].epsilon;
        Depths { near: self.frame.near, epsilon }
    }

    /// What a group's pixels are resolved with.
    pub(in crate::backend) fn resolve(&self) -> Resolve<'_> {
        Resolve {
            sample: &self.group.samples[self.group.samples.len() / 2],
            weight: self.weight(),
            channels: self.channels,
            planes: self.planes,
            shading: self.frame.shading,
            surroundings: self.frame.surroundings.as_ref(),
            raster: self.raster,
            shadows: self.shadows,
        }
    }

    /// Share of the exposure of a group of one sample; 1 where the group's picture is not yet added to the film.
    pub(in crate::backend) fn weight(&self) -> f32 {
        if self.frame.blending.is_some() { 1.0 } else { self.group.samples[0].weight }
    }

    /// What turns the sums of a group's samples, whose weights are in them, into means.
    pub(in crate::backend) fn scale(&self) -> f32 {
        let samples = &self.group.samples;
        let total: f32 = samples.iter().map(|sample| sample.weight).sum();
        if samples.len() > 1 && total > 0.0 { 1.0 / total } else { 1.0 }
    }

    /// Starts the samples of a group that come before those of `chunk`; static objects belong to all.
    pub(in crate::backend) fn turn(&self, chunk: &Chunk<'_>, buffers: &mut TileBuffers) {
        if self.group.samples.len() > 1 && !self.frame.objects[chunk.object].is_static {
            buffers.group_coverage.turn(|sample| self.group.samples[sample].weight, chunk.sample);
        }
    }

    /// Ends the samples of a group that has several.
    pub(in crate::backend) fn end_turns(&self, buffers: &mut TileBuffers) {
        let samples = &self.group.samples;
        if samples.len() > 1 {
            buffers.group_coverage.turn(|sample| samples[sample].weight, samples.len());
        }
    }

    /// The values of the splats of one chunk.
    pub(in crate::backend) fn add_values<S: Faced>(&self, chunk: &Chunk<'_>, binned: &mut Binned<S>) {
        values::values(&binned.splats, &self.shown(chunk), &mut binned.values);
    }

    /// Makes splats with `make`; counts them and the time.
    pub(in crate::backend) fn timed<S: Wasteful>(&self, binned: &mut Binned<S>, make: impl FnOnce(&mut Binned<S>)) {
        let start = Instant::now();
        make(binned);
        self.clocks.splats.fetch_add(binned.splats.len() as u64, Relaxed);
        self.clocks.project.add(start);
        if let Some(wasted) = &self.clocks.wasted {
            let sight = WasteView {
                band: self.band,
                raster: self.raster,
                near: self.frame.near,
                low_pass: self.low_pass(),
                swept: self.frame.swept,
            };
            wasted.add(S::waste(binned, &sight));
        }
    }
}

//! Poses a scene at the sample times of an exposure: from a scene and its times to a [`Frame`].

use super::filters::{Filters, prefilter};
use super::poser::{Poser, Span};
use super::static_objects::{hold_static, with_positions};
use super::strips::{PosedStrip, Strips};
use super::{Frame, FrameObject, Panorama, PosedGroup, PosedRaster, PosedSample, Position, Raster};
use super::{blending, frame_object, model_bytes};
use crate::environment::Environment;
use crate::film::Background;
use crate::math::focal_length;
use crate::options::{BlurMode, RenderOptions, Shading, SweptKernel};
use crate::plan::{Exposure, Group, RasterExposure, TimeSample};
use crate::scene::pose::cuts;
use crate::scene::{Object, Scene};
use crate::stop::Stop;
use crate::time::FrameNumber;

/// Longest path over the raster within a slice of an interval, pixels.
const SLICE_PATH: u32 = 4;

impl Frame {
    /// Poses `scene` at every time sample that `mode` takes of frame `number`; `options` without their quality.
    pub fn new(scene: &Scene, number: impl Into<FrameNumber>, mode: BlurMode, options: &RenderOptions) -> Self {
        Self::until(scene, number.into(), mode, options, &Stop::default())
    }

    /// As [`new`](Self::new), but it ends soon after `stop` is set: then the frame lacks samples, and is of no use.
    pub fn until(scene: &Scene, number: FrameNumber, mode: BlurMode, options: &RenderOptions, stop: &Stop) -> Self {
        let [open, close] = [0.0, 1.0].map(|t| scene.shutter.frame_time(number.get(), t));
        let cuts = mode.swept().map_or_else(Vec::new, |_| cuts(scene, open, close));
        let mode = with_positions(scene, mode);
        let exposure = Exposure::new(mode, options.look.filter, options.look.seed, &scene.shutter, number.get(), &cuts);
        Self::posed(scene, number, &exposure, options, stop)
    }

    /// Poses `scene` at every time sample of `exposure`, which is one of frame `number`.
    pub fn exposed(scene: &Scene, number: FrameNumber, exposure: &Exposure, options: &RenderOptions) -> Self {
        Self::posed(scene, number, exposure, options, &Stop::default())
    }

    fn posed(scene: &Scene, number: FrameNumber, exposure: &Exposure, options: &RenderOptions, stop: &Stop) -> Self {
        let swept = exposure.groups().find_map(|group| group.sweep).map(|(_, kernel)| kernel);
        let prefilter = prefilter(scene, number, exposure, swept, options);
        let options = &RenderOptions { prefilter, ..options.clone() };
        let posing = Posing::new(scene, number, exposure, options);
        let mut rasters = posing.rasters(stop);
        share_guard(&mut rasters);
        let near = scene.camera.near as f32;
        let is_static = hold_static(scene, &mut rasters, exposure.stride, near);
        let camera_rests = scene.camera.rests();
        let of_frame = |(object, fixed)| frame_object(object, options, fixed, camera_rests);
        let objects: Vec<FrameObject> = scene.objects.iter().zip(is_static).map(of_frame).collect();
        let mirrors = objects.iter().any(|object| object.reflection > 0.0 && object.has_surfels());
        let mut frame = Self {
            size: posing.size,
            stride: exposure.stride,
            near,
            prefilter,
            blending: blending(scene),
            // Normals are not averaged over time (Wolf 2008, fig. 4.4).
            shading: if posing.swept.is_some() { Shading::Gouraud } else { options.look.shading },
            aovs: options.look.aovs.clone(),
            surroundings: scene.environment.as_ref().filter(|_| mirrors).map(Environment::surroundings),
            background: Background { colour: scene.image.background, transparent: scene.image.transparent },
            panorama: Panorama::of(scene, number, exposure.instant(), options.look.filter),
            leaves_background: false,
            memory: options.memory,
            model_bytes: model_bytes(scene),
            picture_bytes: 0,
            swept: posing.swept,
            objects,
            rasters,
            wanted: None,
            keeps_nearest: false,
        };
        frame.plan_steps();
        frame
    }
}

/// What the rasters of a frame are made from.
struct Posing<'a> {
    poser: Poser<'a>,
    exposure: &'a Exposure,
    /// The kernel that the steps sweep; `None` where samples are instants.
    swept: Option<SweptKernel>,
    /// Image size, pixels.
    size: [u32; 2],
    /// Focal length, pixels of the image.
    focal: f64,
    /// The strips of a rolling shutter; `None` where all pixels are exposed at once.
    strips: Option<Strips>,
    /// Does light pass through the surfels of any object?
    see_through: bool,
}

impl<'a> Posing<'a> {
    fn new(scene: &'a Scene, number: FrameNumber, exposure: &'a Exposure, options: &'a RenderOptions) -> Self {
        let size = [scene.image.width, scene.image.height];
        let focal = focal_length(f64::from(size[1]), scene.camera.fovy);
        let samples = exposure.groups().map(|group| group.samples.len()).sum();
        Self {
            poser: Poser { scene, number: number.get(), focal: focal / f64::from(exposure.stride), options },
            exposure,
            swept: exposure.groups().find_map(|group| group.sweep).map(|(_, kernel)| kernel),
            size,
            focal,
            strips: Strips::of(scene, number, exposure.ends(), samples, exposure.stride),
            see_through: scene.objects.iter().any(Object::is_see_through),
        }
    }

    /// All rasters, those of the first strip first. They lack samples once `stop` is set.
    fn rasters(&self, stop: &Stop) -> Vec<PosedRaster> {
        let Some(strips) = &self.strips else {
            return self.exposure.rasters.iter().map(|exposed| self.raster(exposed, None, stop)).collect();
        };
        let mut rasters = Vec::new();
        for shown in strips.ranges() {
            for exposed in &self.exposure.rasters {
                let whole = self.pixels(exposed, None);
                let strip = strips.strip(shown.clone(), self.apron(&whole), whole.size, exposed.phase);
                rasters.push(self.raster(exposed, Some(&strip), stop));
            }
        }
        rasters
    }

    /// One raster, or a strip of it.
    fn raster(&self, exposed: &RasterExposure, strip: Option<&PosedStrip>, stop: &Stop) -> PosedRaster {
        let raster = self.pixels(exposed, strip);
        let spread = self.filters(exposed).spread;
        let mut positions = Vec::with_capacity(exposed.positions.len());
        for position in &exposed.positions {
            if stop.is_set() {
                break;
            }
            let seed = self.poser.options.look.seed ^ u64::from(exposed.phase[1] << 16 | exposed.phase[0]) << 32;
            let group = |group: &Group| self.group(group, strip, raster.size, seed);
            let groups = position.groups.iter().map(group).collect();
            let offset = position.offset.map(|share| share * spread);
            positions.push(Position { raster: raster.at(offset, self.exposure.stride), groups, steps: Vec::new() });
        }
        PosedRaster { area: raster.area(strip), positions }
    }

    /// The pixels of a raster, or of a strip of it, without an offset.
    fn pixels(&self, exposed: &RasterExposure, strip: Option<&PosedStrip>) -> Raster {
        let lens = (self.focal, self.poser.scene.camera.shift);
        Raster::new(self.size, lens, self.exposure.stride, exposed.phase, strip).with_filters(&self.filters(exposed))
    }

    fn filters(&self, exposed: &RasterExposure) -> Filters {
        Filters::new(self.poser.options, self.swept, exposed.positions_of_picture, self.exposure.stride)
    }

    /// Pixels around a strip that filters reach.
    fn apron(&self, whole: &Raster) -> u32 {
        let peeled = if self.see_through { whole.for_see_through(self.poser.options.prefilter).apron() } else { 0 };
        whole.apron().max(peeled) as u32
    }

    /// A group on a raster of `size` pixels. `seed`: of points on lights.
    fn group(&self, group: &Group, strip: Option<&PosedStrip>, size: [u32; 2], seed: u64) -> PosedGroup {
        let interval = group.sweep.map(|(interval, _)| interval);
        let pose = |sample: &TimeSample| {
            let time = sample.time + strip.map_or(0.0, |strip| strip.delay);
            let span = interval.as_ref().map(Span::swept);
            let span = span.or_else(|| strip.and_then(|strip| Span::read_out(time, strip.half)));
            self.poser.sample(time, sample.weight, span.as_ref(), (group.number, seed))
        };
        let samples: Vec<PosedSample> = group.samples.iter().map(pose).collect();
        let sweep = group.sweep.map(|(interval, kernel)| (self.poser.interval(&interval, &samples, size), kernel));
        PosedGroup { samples, sweep }
    }
}

/// Gives all intervals of a frame the widest guard of any, and as many slices as it takes. One size of map serves them
/// all.
fn share_guard(rasters: &mut [PosedRaster]) {
    let groups = rasters.iter().flat_map(|raster| &raster.positions).flat_map(|position| &position.groups);
    let guards = groups.filter_map(|group| group.sweep).map(|(interval, _)| interval.guard);
    let guard = guards.max().unwrap_or(0);
    let slices = slices(guard);
    for group in rasters.iter_mut().flat_map(|raster| &mut raster.positions).flat_map(|position| &mut position.groups) {
        if let Some((interval, _)) = &mut group.sweep {
            (interval.guard, interval.slices) = (guard, slices);
        }
    }
}

/// Slices of an interval in which nothing moves farther than `guard` raster pixels from its middle. In a slice nothing
/// moves by more than [`SLICE_PATH`] pixels, as long as 32 slices suffice for that.
fn slices(guard: u32) -> u32 {
    (2 * guard).div_ceil(SLICE_PATH).next_power_of_two().min(32)
}

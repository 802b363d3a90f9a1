//! One frame, posed: everything that a backend needs to execute a plan, as plain values.
//!
//! Transforms are composed in `f64` and only then rounded, so that far-away world coordinates cost no precision.

use std::ops::Range;
use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3, Mat3, Vec3};

use crate::film::{Aov, Background};
use crate::model::{Material, Surfels};
use crate::options::{BlurMode, KernelWeight, Prefilter, RenderOptions, Shading, SweptKernel};
use crate::plan::{Interval, Pass, Plan, TimeSample};
use crate::scene::pose::{ObjectPose, camera_from_world, jumps, object_pose, object_velocity};
use crate::scene::{Light, Object, Scene};
use crate::shading::ShadingLight;

mod static_objects;

pub use self::static_objects::STILL_PATH;
use self::static_objects::hold_still;

/// One frame, posed.
#[derive(Clone, Debug)]
pub struct Frame<'a> {
    /// Image size, pixels.
    pub size: [u32; 2],
    /// Pixels from one pixel of a group's raster to the next, along both axes.
    pub stride: u32,
    /// Nearest visible depth, scene units.
    pub near: f32,
    /// Screen-space prefilter.
    pub prefilter: Prefilter,
    /// Where shading happens.
    pub shading: Shading,
    /// Extra channels.
    pub aovs: &'a [Aov],
    /// What shows where the film is not covered.
    pub background: Background,
    /// Bytes that the frame and its models may take.
    pub memory: u64,
    /// Bytes that the models take; a model shared by several objects counts once.
    pub model_bytes: u64,
    /// Bytes that pictures take which are kept beside the frame's own.
    pub picture_bytes: u64,
    /// Stages of each group, in order.
    pub passes: &'static [Pass],
    /// What kernels in motion sweep, where there are any.
    pub swept: Option<SweptKernel>,
    /// Objects that can be seen at some sample, in document order.
    pub objects: Vec<FrameObject<'a>>,
    /// Groups in the order in which they are added to the film; those of one raster stand together.
    pub groups: Vec<PosedGroup>,
    /// The parts of the image that are rendered; the others stay empty. `None`: all.
    pub wanted: Option<Blocks>,
}

/// Blocks of [`Blocks::EDGE`] x [`Blocks::EDGE`] raster pixels, the same of every raster: true where wanted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blocks {
    /// Blocks in a row.
    pub width: usize,
    /// Row by row.
    pub wanted: Vec<bool>,
}

impl Blocks {
    /// Raster pixels along the edge of a block.
    pub const EDGE: usize = 32;

    /// Blocks in a row and rows of them, for an image of `size` pixels whose rasters take every `stride`-th.
    pub fn count(size: [u32; 2], stride: u32) -> [usize; 2] {
        size.map(|pixels| (pixels.div_ceil(stride) as usize).div_ceil(Self::EDGE))
    }

    /// The columns of row `y` that lie in `wanted` blocks, of an image of `width` columns whose rasters take every `stride`-th.
    pub fn columns(wanted: Option<&Self>, y: usize, width: usize, stride: usize) -> Vec<Range<usize>> {
        let Some(blocks) = wanted else { return std::iter::once(0..width).collect() };
        let edge = Self::EDGE * stride;
        let columns = |x: usize| (x * edge).min(width)..((x + 1) * edge).min(width);
        (0..blocks.width).filter(|&x| blocks.at(x, y / edge)).map(columns).collect()
    }

    /// Is the block in column `x` and row `y` wanted? Those beyond the image are not.
    pub fn at(&self, x: usize, y: usize) -> bool {
        x < self.width && self.wanted.get(y * self.width + x).is_some_and(|&wanted| wanted)
    }
}

/// The pixels that a group is rendered for, as an image of their own: every `Frame::stride`-th pixel of the frame's image.
///
/// Raster pixel (i, j) is pixel (`phase.x` + i stride, `phase.y` + j stride) of the image. With stride 1 it is the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Raster {
    /// Raster pixels; an axis is 0 where the image is smaller than the phase.
    pub size: [u32; 2],
    /// Pixel of the image that the first raster pixel is.
    pub phase: [u32; 2],
    /// Where the camera's axis meets the raster, raster pixels.
    pub axis: [f32; 2],
    /// Focal length, raster pixels: (height / 2) / tan(fovy / 2) / stride.
    pub focal: f32,
    /// Radius of the low-pass disc of the approximate EWA filter, raster pixels (Botsch et al. 2005; thesis 4.2.3).
    pub low_pass: f32,
    /// Offset of the sample position from the raster pixel's centre, raster pixels.
    pub offset: [f32; 2],
}

impl Raster {
    /// For an image of `size` pixels with focal length `focal`.
    fn new(size: [u32; 2], focal: f64, stride: u32, phase: [u32; 2], offset: [f32; 2]) -> Self {
        let s = f64::from(stride);
        let axis = |i: usize| ((0.5 * f64::from(size[i]) - f64::from(phase[i]) - 0.5) / s + 0.5) as f32;
        Self {
            size: [0, 1].map(|i| size[i].saturating_sub(phase[i]).div_ceil(stride)),
            phase,
            axis: [axis(0), axis(1)],
            focal: (focal / s) as f32,
            low_pass: (std::f64::consts::SQRT_2 / s) as f32,
            offset: offset.map(|o| (f64::from(o) / s) as f32),
        }
    }
}

/// What of an object does not change over the frame.
#[derive(Clone, Copy, Debug)]
pub struct FrameObject<'a> {
    /// The surfels; shared, so that a backend can tell models apart for as long as it remembers them.
    pub surfels: &'a Arc<Surfels>,
    /// Material of the whole object; `None`: one a surfel, `surfels.material`.
    pub material: Option<Material>,
    /// Show back faces, with normals turned to the viewer.
    pub two_sided: bool,
    /// Posed alike in all samples: its splats are the first in the order of sums, and count once in a group.
    pub still: bool,
}

/// Posed samples that share one visibility test and one resolve.
#[derive(Clone, Debug)]
pub struct PosedGroup {
    /// At least one, rising in time.
    pub samples: Vec<PosedSample>,
    /// The pixels that it is rendered for.
    pub raster: Raster,
    /// The interval that its one sample stands for.
    pub interval: Option<PosedInterval>,
}

/// An interval of the exposure, for kernels in motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosedInterval {
    /// Share of the exposure of each 32nd of the interval.
    pub moments: [f32; 32],
    /// Change of the time weight from the middle of the interval to its end, over its mean; in [-1, 1].
    pub slope: f32,
    /// Pixels by which anything moves on the raster from the middle of an interval to its end: how far beyond the raster a kernel's
    /// source may lie; the most of all intervals. Half the raster's longer side at the most.
    pub guard: u32,
}

/// The scene at one time sample.
#[derive(Clone, Debug)]
pub struct PosedSample {
    /// Share of the exposure.
    pub weight: f32,
    /// Camera axes in world space: columns right, up, back.
    pub world_from_camera: Mat3,
    /// Lights, relative to the eye.
    pub lights: Vec<ShadingLight>,
    /// One a `Frame::objects` entry.
    pub objects: Vec<PosedObject>,
}

/// An object at one time sample.
///
/// *Screen space* here is (f X, -f Y, -Z) of camera space, f the focal length of the group's raster: a point's raster pixel is
/// its first two coordinates over the third (its depth), counted from the raster's `axis`, x right and y down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosedObject {
    /// False: skipped.
    pub visible: bool,
    /// Linear part of model space (relative to the model's origin) to screen space.
    pub screen_from_model: Mat3,
    /// Screen-space position of the model's origin.
    pub screen_origin: Vec3,
    /// The same for surfels' centres: over an interval, the mean pose; else `screen_from_model`.
    pub centre_from_model: Mat3,
    /// Screen-space position of the model's origin, likewise.
    pub centre_origin: Vec3,
    /// Half the difference of the poses at the interval's ends, linear part; else 0.
    pub motion_from_model: Mat3,
    /// Motion of the model's origin, likewise.
    pub motion_origin: Vec3,
    /// True where the centres' pose is not the axes' own.
    pub moves: bool,
    /// The eye in model space, relative to the model's origin.
    pub eye: Vec3,
    /// Time derivative of `screen_from_model`, per shutter; zero unless the velocity AOV is wanted.
    pub screen_rate: Mat3,
    /// Time derivative of `screen_origin`, per shutter.
    pub screen_origin_rate: Vec3,
    /// Model normals to world normals, up to length: the inverse transpose.
    pub normal_matrix: Mat3,
    /// World-space linear part, for surfel positions relative to the eye.
    pub world_from_model: Mat3,
    /// The model's origin relative to the eye, world axes.
    pub world_origin: Vec3,
    /// -1 for transforms that mirror, else 1.
    pub handedness: f32,
    /// Depth tolerance of the visibility rule, world units.
    pub epsilon: f32,
}

impl<'a> Frame<'a> {
    /// Poses `scene` at every time sample that `mode` takes of frame `number`; `options` without their quality.
    pub fn new(scene: &'a Scene, number: i64, mode: BlurMode, options: &'a RenderOptions) -> Self {
        Self::planned(scene, number, mode.swept(), options, &Self::plan(scene, number, mode, options))
    }

    fn plan(scene: &Scene, number: i64, mode: BlurMode, options: &RenderOptions) -> Plan {
        let jumps = mode.swept().map_or_else(Vec::new, |_| {
            let at = |t: f64| scene.shutter.frame_time(number as f64, t);
            jumps(scene, at(0.0), at(1.0))
        });
        Plan::new(mode, options.filter, options.seed, &scene.shutter, number as f64, &jumps)
    }

    /// Poses `scene` at every time sample of `plan`, which is one of frame `number`.
    pub fn planned(
        scene: &'a Scene,
        number: i64,
        swept: Option<SweptKernel>,
        options: &'a RenderOptions,
        plan: &Plan,
    ) -> Self {
        let size = [scene.image.width, scene.image.height];
        let focal = 0.5 * f64::from(size[1]) / libm::tan(0.5 * scene.camera.fovy);
        let poser = Poser { scene, number: number as f64, focal: focal / f64::from(plan.stride), options };
        let mut groups: Vec<PosedGroup> = plan
            .groups
            .iter()
            .map(|group| {
                let raster = Raster::new(size, focal, plan.stride, group.phase, group.offset);
                let pose = |sample: &TimeSample| poser.sample(sample.time, sample.weight, group.interval.as_ref());
                let samples: Vec<PosedSample> = group.samples.iter().map(pose).collect();
                let interval = group.interval.map(|interval| poser.interval(&interval, &samples, raster.size));
                PosedGroup { samples, raster, interval }
            })
            .collect();
        // One size of map for all intervals: on the GPU what lies still is kept behind it.
        let guard = groups.iter().filter_map(|group| group.interval).map(|interval| interval.guard).max();
        let guards = groups.iter_mut().filter_map(|group| group.interval.as_mut()).map(|interval| &mut interval.guard);
        guards.zip(guard.into_iter().cycle()).for_each(|(of_group, guard)| *of_group = guard);
        let near = scene.camera.near as f32;
        let times: Vec<f64> = plan.groups.iter().flat_map(|group| &group.samples).map(|sample| sample.time).collect();
        let still = hold_still(scene, &times, &mut groups, plan.stride, near);
        Self {
            size,
            stride: plan.stride,
            near,
            prefilter: options.prefilter,
            // Normals are not averaged over time (thesis fig. 4.4).
            shading: if swept.is_some() { Shading::Gouraud } else { options.shading },
            aovs: &options.aovs,
            background: Background { colour: scene.image.background, transparent: scene.image.transparent },
            memory: options.memory,
            model_bytes: model_bytes(scene),
            picture_bytes: 0,
            passes: plan.passes,
            swept,
            objects: scene
                .objects
                .iter()
                .zip(still)
                .map(|(object, still)| frame_object(object, options, still))
                .collect(),
            groups,
            wanted: None,
        }
    }
}

impl Frame<'_> {
    /// Does what lies still get a picture of its own, at each sample position, before and behind which kernels in motion are added?
    /// Their sources are looked up where things were at mid-interval; what lies still is at the pixel itself all the time. The thesis'
    /// own kernels, which know no densities, are added up with everything.
    pub fn has_still_picture(&self) -> bool {
        let seen = |object: usize| self.groups.first().is_some_and(|group| group.samples[0].objects[object].visible);
        let lies = |object: usize| self.objects[object].still && !self.objects[object].surfels.is_empty();
        (0..self.objects.len()).any(|object| lies(object) && seen(object))
            && self.swept.is_some_and(|swept| swept.weight == KernelWeight::Integral)
    }

    /// Are camera and lights the same in all samples?
    pub fn has_one_view(&self) -> bool {
        let mut samples = self.groups.iter().flat_map(|group| &group.samples);
        let Some(first) = samples.next() else { return true };
        samples.all(|s| s.world_from_camera == first.world_from_camera && s.lights == first.lights)
    }

    /// Time samples of a pixel.
    pub fn samples(&self) -> u32 {
        let groups = self.groups.chunk_by(|a, b| a.raster.phase == b.raster.phase).next().unwrap_or_default();
        groups.iter().map(|group| group.samples.len() as u32).sum()
    }
}

fn model_bytes(scene: &Scene) -> u64 {
    let mut models: Vec<_> = scene.objects.iter().map(|object| object.model.surfels()).collect();
    models.sort_by_key(|model| Arc::as_ptr(model));
    models.dedup_by_key(|model| Arc::as_ptr(model));
    models.iter().map(|model| model.bytes()).sum()
}

/// Material of the object: the scene's, else the file's, else the default (design section 2).
fn frame_object<'a>(object: &'a Object, options: &RenderOptions, still: bool) -> FrameObject<'a> {
    let material = match object.material {
        Some(material) => Some(material),
        None if object.model.material.is_empty() => Some(Material::default()),
        None => None,
    };
    FrameObject { surfels: object.model.surfels(), material, two_sided: options.two_sided || object.two_sided, still }
}

struct Poser<'a> {
    scene: &'a Scene,
    number: f64,
    /// Raster pixels.
    focal: f64,
    options: &'a RenderOptions,
}

impl Poser<'_> {
    fn sample(&self, time: f64, weight: f64, interval: Option<&Interval>) -> PosedSample {
        let camera = camera_from_world(self.scene, time);
        let world_from_camera = DMat3::from_mat4(camera).transpose();
        let eye = -(world_from_camera * camera.w_axis.truncate());
        PosedSample {
            weight: weight as f32,
            world_from_camera: world_from_camera.as_mat3(),
            lights: self.scene.lights.iter().map(|light| shading_light(light, eye)).collect(),
            objects: self.scene.objects.iter().map(|object| self.object(object, time, &camera, interval)).collect(),
        }
    }

    /// Camera-from-model transform (the model relative to its origin) at scene time `time`.
    fn camera_from_model(&self, object: &Object, time: f64) -> DMat4 {
        camera_from_world(self.scene, time)
            * object_pose(self.scene, object, time).world_from_model
            * DMat4::from_translation(object.model.origin)
    }

    /// An interval whose one sample is `samples`, on a raster of `size`.
    fn interval(&self, interval: &Interval, samples: &[PosedSample], size: [u32; 2]) -> PosedInterval {
        let half = |range: std::ops::Range<usize>| interval.moments[range].iter().sum::<f64>();
        let (early, late) = (half(0..16), half(16..32));
        // The linear weight 1 + s tau has (1 + s/2)/2 of its integral in the later half.
        let slope = if early + late > 0.0 { (2.0 * (late - early) / (early + late)).clamp(-1.0, 1.0) } else { 0.0 };
        let most = f64::from(size[0].max(size[1]) / 2);
        let near = self.scene.camera.near;
        let posed = samples.iter().flat_map(|sample| self.scene.objects.iter().zip(&sample.objects));
        let drifts = posed
            .filter(|(object, posed)| posed.visible && posed.moves && !object.bounds().is_empty())
            .flat_map(|(object, posed)| {
                object.bounds().corners().map(|corner| {
                    let p = (corner - object.model.origin).as_vec3();
                    let centre = (posed.centre_from_model * p + posed.centre_origin).as_dvec3();
                    let motion = (posed.motion_from_model * p + posed.motion_origin).as_dvec3();
                    let (from, to) = (centre - motion, centre + motion);
                    if from.z.min(to.z) < near {
                        return most;
                    }
                    let on_raster = |p: DVec3| p.truncate() / p.z;
                    let drift = |end: DVec3| (on_raster(end) - on_raster(centre)).abs().max_element();
                    drift(from).max(drift(to))
                })
            });
        let largest = drifts.fold(0.0, |a: f64, b| if b.is_nan() { most } else { a.max(b) });
        let guard = if largest > 0.0 { (largest + 2.0).ceil().min(most) as u32 } else { 0 };
        PosedInterval { moments: interval.moments.map(|share| share as f32), slope: slope as f32, guard }
    }

    fn object(&self, object: &Object, time: f64, camera: &DMat4, interval: Option<&Interval>) -> PosedObject {
        // blur="false": object and camera are posed at the frame number (design section 2).
        let (time, camera) =
            if object.blur { (time, *camera) } else { (self.number, camera_from_world(self.scene, self.number)) };
        let ObjectPose { world_from_model, visible } = object_pose(self.scene, object, time);
        let to_origin = DMat4::from_translation(object.model.origin);
        let camera_from_model = camera * world_from_model * to_origin;
        let screen = self.screen(&camera_from_model);
        // The line that surfels travel over an interval: their mean place, by Simpson's rule, and half the difference of its ends.
        let (centre, motion) =
            interval.filter(|_| object.blur).map_or((screen, (DMat3::ZERO, DVec3::ZERO)), |interval| {
                let [from, to] = interval.ends.map(|time| self.camera_from_model(object, time));
                let middle = camera_from_model;
                (self.screen(&(middle + ((from + to) * 0.5 - middle) / 3.0)), self.screen(&((to - from) * 0.5)))
            });
        let linear = DMat3::from_mat4(world_from_model);
        let det = linear.determinant();
        let (rate, origin_rate) = if self.options.aovs.contains(&Aov::Velocity) && object.blur {
            let velocity = object_velocity(self.scene, object, time) * to_origin;
            self.screen(&velocity)
        } else {
            (DMat3::ZERO, DVec3::ZERO)
        };
        // Rotation of the camera that posed the object: normals and positions are kept in world axes.
        let world_from_camera = DMat3::from_mat4(camera).transpose();
        let epsilon = self
            .options
            .epsilon
            .or(object.epsilon)
            .unwrap_or_else(|| f64::from(object.model.median_radius()) * libm::cbrt(det.abs()));
        PosedObject {
            visible: visible && det != 0.0,
            screen_from_model: screen.0.as_mat3(),
            screen_origin: screen.1.as_vec3(),
            centre_from_model: centre.0.as_mat3(),
            centre_origin: centre.1.as_vec3(),
            motion_from_model: motion.0.as_mat3(),
            motion_origin: motion.1.as_vec3(),
            moves: motion != (DMat3::ZERO, DVec3::ZERO),
            eye: -(screen.0.inverse() * screen.1).as_vec3(),
            screen_rate: rate.as_mat3(),
            screen_origin_rate: origin_rate.as_vec3(),
            normal_matrix: normal_matrix(&linear).as_mat3(),
            world_from_model: linear.as_mat3(),
            world_origin: (world_from_camera * camera_from_model.w_axis.truncate()).as_vec3(),
            handedness: if det < 0.0 { -1.0 } else { 1.0 },
            epsilon: epsilon as f32,
        }
    }

    /// Camera space to screen space, as linear part and origin.
    fn screen(&self, m: &DMat4) -> (DMat3, DVec3) {
        let k = DMat3::from_diagonal(DVec3::new(self.focal, -self.focal, -1.0));
        (k * DMat3::from_mat4(*m), k * m.w_axis.truncate())
    }
}

/// Inverse transpose up to a positive factor, finite for singular matrices: the cofactors, with the determinant's sign.
fn normal_matrix(m: &DMat3) -> DMat3 {
    let (a, b, c) = (m.x_axis, m.y_axis, m.z_axis);
    let cofactors = DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b));
    let size = cofactors.x_axis.length().max(cofactors.y_axis.length()).max(cofactors.z_axis.length());
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    if size > 0.0 { cofactors * (sign / size) } else { cofactors }
}

fn shading_light(light: &Light, eye: DVec3) -> ShadingLight {
    match *light {
        Light::Ambient { colour } => ShadingLight::Ambient { colour: colour.as_vec3() },
        Light::Directional { direction, colour } => {
            ShadingLight::Directional { towards: (-direction).as_vec3(), colour: colour.as_vec3() }
        }
        Light::Point { position, colour } => {
            ShadingLight::Point { position: (position - eye).as_vec3(), colour: colour.as_vec3() }
        }
    }
}

//! The scene at the time of one sample. Each pose is exact, none is interpolated. What does not change over the frame
//! is computed once.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DMat4, DVec3};
use rayon::prelude::*;

use super::error::ReferenceError;
use super::gaussians::blend::Blend;
use super::gaussians::tree::{GaussianKernel, Tree};
use super::moving::{Hierarchy, Shares};
use super::options::{Meshes, ReferenceOptions};
use super::sky::Sky;
use super::traverse::Hit;
use super::volumes::kernel::VolumeKernel;
use crate::environment::Environment;
use crate::film::{Backdrop, Background};
use crate::math::{focal_length, norm};
use crate::model::mesh::{Mesh, MeshSurface};
use crate::model::paths::{Elapsed, elapsed};
use crate::model::{Gaussians, Material, Surfels};
use crate::options::PixelFilter;
use crate::sampling::gaussian_offset;
use crate::scene::pose::{ObjectPoser, camera_from_world};
use crate::scene::{Drawing, Light, Object, Scene, Shape, Sphere, Surface, SurfelModel};
use crate::shading::ShadingLight;
use crate::stop::Stop;
use crate::time::FrameNumber;

/// One frame of a scene, ready for rays.
#[derive(Debug)]
pub(super) struct World<'a> {
    pub scene: &'a Scene,
    pub options: &'a ReferenceOptions,
    /// Image size, pixels.
    pub size: [u32; 2],
    /// Focal length, pixels.
    pub focal: f64,
    pub bodies: Vec<Body<'a>>,
    /// Hierarchies. Objects with the same model share one.
    pub models: Vec<Hierarchy<'a>>,
    /// Objects that show captures, in the order of objects.
    pub captures: Vec<Transparent<'a>>,
    /// Trees of captures. Objects that show the same Gaussians of one share a tree.
    pub trees: Vec<Tree<GaussianKernel>>,
    /// Objects that show volumes, in the order of objects.
    pub volumes: Vec<Volume<'a>>,
    /// Trees of volumes.
    pub volume_trees: Vec<Tree<VolumeKernel>>,
    /// The image's blending of captures.
    pub blend: Blend,
    /// The environment's light without shadows; `None` where it is no light.
    smooth_sky: Option<ShadingLight>,
    /// The environment, where it is a light with shadows.
    pub sky: Option<Sky<'a>>,
    /// The camera's pose if it does not move.
    fixed_camera: Option<CameraPose>,
    /// The camera's pose at the frame number.
    pub frame_camera: CameraPose,
    /// Ends work with it without a result.
    stop: Option<&'a Stop>,
}

/// Pose of the camera at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CameraPose {
    /// Rotation with the columns right, up, back.
    pub world_from_camera: DMat3,
    pub eye: DVec3,
}

/// An object that shows a capture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Transparent<'a> {
    /// Number of the object.
    pub body: usize,
    /// Number of the tree.
    pub tree: usize,
    pub gaussians: &'a Gaussians,
    /// Opacities shrink where Gaussians are widened.
    pub antialias: bool,
    /// Greatest `reach` of the tree's Gaussians.
    pub reach: f64,
}

/// An object that shows a volume.
#[derive(Clone, Copy, Debug)]
pub(super) struct Volume<'a> {
    /// Number of the object.
    pub body: usize,
    /// Number of the tree.
    pub tree: usize,
    pub gaussians: &'a Gaussians,
}

/// What rays can hit of an object.
#[derive(Clone, Copy, Debug)]
pub(super) enum Form {
    /// A model: the number of its hierarchy.
    Model(usize),
    /// A capture: the number of its tree.
    Gaussians(usize),
    /// A volume: the number of its tree.
    Volume(usize),
    Sphere(Sphere),
    Nothing,
}

/// An object over a whole frame: the parts that do not depend on the time.
#[derive(Debug)]
pub(super) struct Body<'a> {
    pub object: &'a Object,
    pub surfels: &'a Surfels,
    pub form: Form,
    /// How its surface looks. A volume has the material alone.
    pub surface: Surface,
    /// How its Gaussians are drawn.
    pub drawing: Drawing,
    /// Light passes through its surfels.
    pub see_through: bool,
    /// Units of time of its paths in a shutter.
    pub pace: f64,
    /// The frame number, and the frames per second.
    number: f64,
    rate: f64,
    poser: ObjectPoser<'a>,
    /// The pose if it does not change.
    fixed: Option<BodyPose>,
    /// Depth tolerance if it does not change, world units.
    epsilon: Option<f64>,
}

/// Pose of an object at one time.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyPose {
    /// Linear part of the transform, and the place of the model's origin.
    pub world_from_model: DAffine3,
    /// Inverse of the linear part.
    pub model_from_world: DMat3,
    /// Depth tolerance of the visibility rule, world units.
    pub epsilon: f64,
}

impl BodyPose {
    /// Transforms a normal from model to world space by the inverse transpose, and makes it a unit vector.
    pub(super) fn normal(&self, normal: DVec3) -> DVec3 {
        (self.model_from_world.transpose() * normal).normalize_or_zero()
    }
}

impl<'a> World<'a> {
    /// Builds the hierarchies and poses static objects. What is finished of that is told.
    ///
    /// # Errors
    /// A capture does not fit into memory, or stands before an environment as background. It was stopped.
    pub(super) fn new(
        scene: &'a Scene,
        frame: FrameNumber,
        options: &'a ReferenceOptions,
        (told, stop): (&(dyn Fn(f64) + Sync), Option<&'a Stop>),
    ) -> Result<Self, ReferenceError> {
        if let Some(object) = scene.capture_before_panorama() {
            return Err(ReferenceError::Panorama { object: object.name.clone() });
        }
        let number = frame.get();
        let mut distinct: Vec<&'a Object> = Vec::new();
        let exposure = scene.shutter.whole_exposure(number);
        let travelled = |object: &Object| exposure.map(|time| object.travelled(scene.frames.rate, number, time));
        let alike = |a: &Object, b: &Object| {
            let (paths, others) = (
                a.shape.surfels().and_then(SurfelModel::own_paths),
                b.shape.surfels().and_then(SurfelModel::own_paths),
            );
            Arc::ptr_eq(a.shape.surfels_or_none(), b.shape.surfels_or_none())
                && paths.map(Arc::as_ptr) == others.map(Arc::as_ptr)
                && (a.shape.paths().is_empty() || travelled(a) == travelled(b))
        };
        let (mut shown, mut volumes): (Vec<Shown<'_>>, Vec<Shown<'_>>) = Default::default();
        let bodies: Vec<Body<'a>> = scene
            .objects
            .iter()
            .map(|object| {
                let drawing = object.shape.drawing(object.opacity).unwrap_or_default();
                let form = match &object.shape {
                    Shape::Sphere { sphere, .. } => Form::Sphere(*sphere),
                    Shape::Gaussians { model, .. } => Form::Gaussians(tree_of(&mut shown, model.gaussians(), drawing)),
                    Shape::Volume { model, .. } => Form::Volume(tree_of(&mut volumes, model.gaussians(), drawing)),
                    Shape::Surfels { model, .. } if !model.surfels().is_empty() => {
                        Form::Model(distinct.iter().position(|other| alike(other, object)).unwrap_or_else(|| {
                            distinct.push(object);
                            distinct.len() - 1
                        }))
                    }
                    Shape::Surfels { .. } | Shape::Sequence { .. } => Form::Nothing,
                };
                Body::new(scene, object, form, number, options)
            })
            .collect();
        let stopped = || stop.is_some_and(Stop::is_set);
        let weight = |count: usize| count.max(1) as f64;
        let surfels = |object: &Object| weight(object.shape.surfels_or_none().len());
        let kernels = shown.iter().chain(&volumes).map(|(gaussians, _)| weight(gaussians.len())).sum::<f64>();
        let meter = Shares::new(distinct.iter().map(|object| surfels(object)).sum::<f64>() + kernels, told);
        let build = |object: &'a Object| {
            let add = |share: f64| meter.add(share * surfels(object));
            if let Some(mesh) = traced_mesh(object, options) {
                let hierarchy = Hierarchy::of_triangles(MeshSurface::new(mesh), object.shape.origin());
                add(1.0);
                return hierarchy;
            }
            let (surfels, paths) = (object.shape.surfels_or_none(), object.shape.paths());
            Hierarchy::new(surfels, &paths, (travelled(object), options.rays(scene)), (&add, &stopped))
        };
        let models = distinct.into_par_iter().map(build).collect();
        let trees = shown.into_iter().map(|(g, drawing)| {
            let tree = Tree::new(g, &drawing, |i| GaussianKernel::of(g, &drawing, i).filter(|_| !stopped()));
            meter.add(weight(g.len()));
            tree
        });
        let trees = trees.collect::<Result<Vec<_>, _>>()?;
        let captures = bodies.iter().enumerate().filter_map(|(body, of)| Transparent::of(body, of, &trees)).collect();
        let volume_trees = volumes.into_iter().map(|(g, drawing)| {
            let tree = Tree::new(g, &drawing, |i| VolumeKernel::of(g, &drawing, i).filter(|_| !stopped()));
            meter.add(weight(g.len()));
            tree
        });
        let volume_trees = volume_trees.collect::<Result<_, _>>()?;
        let volumes = bodies.iter().enumerate().filter_map(|(body, of)| Volume::of(body, of)).collect();
        if stopped() {
            return Err(ReferenceError::Stopped);
        }
        let frame_camera = CameraPose::new(&camera_from_world(scene, number));
        Ok(Self {
            scene,
            options,
            size: [scene.image.width, scene.image.height],
            focal: focal_length(f64::from(scene.image.height), scene.camera.fovy),
            bodies,
            models,
            captures,
            trees,
            volumes,
            volume_trees,
            blend: Blend::of(scene),
            smooth_sky: scene.sky().map(Sky::smooth),
            sky: scene.sky().filter(|sky| options.look.shadows && sky.shadows).map(Sky::new),
            fixed_camera: scene.camera.rests().then_some(frame_camera),
            frame_camera,
            stop,
        })
    }

    /// Does nobody wait any more?
    pub(super) fn is_stopped(&self) -> bool {
        self.stop.is_some_and(Stop::is_set)
    }

    /// What the pixels of a window are composited over: its first pixel and its size.
    pub(super) fn backdrop(&self, frame: f64, origin: [u32; 2], [width, height]: [u32; 2]) -> Backdrop {
        let background = Background { colour: self.scene.image.background, transparent: self.scene.image.transparent };
        let Some(environment) = self.scene.panorama() else { return Backdrop::plain(background) };
        // Nobody looks at it once it was stopped.
        let row = |y: u32| {
            let width = if self.is_stopped() { 0 } else { width };
            (0..width).map(move |x| self.mean_behind(environment, frame, [origin[0] + x, origin[1] + y]))
        };
        let picture =
            (0..height).into_par_iter().flat_map_iter(row).map(|colour| colour.as_vec3().to_array()).collect();
        Backdrop { background, picture: Some(picture) }
    }

    /// The environment in a pixel, averaged over the pixel and the exposure: a lattice of places and times.
    fn mean_behind(&self, environment: &Environment, frame: f64, pixel: [u32; 2]) -> DVec3 {
        /// Places along an axis, and times where the camera moves. Each place has times of its own.
        const PLACES: u32 = 4;
        const TIMES: u32 = 4;
        let times = if self.fixed_camera.is_some() { 1 } else { TIMES };
        let count = PLACES * PLACES * times;
        let mut sum = DVec3::ZERO;
        for i in 0..count {
            let place = [i % PLACES, i / PLACES % PLACES];
            let offset = place.map(|place| (f64::from(place) + 0.5) / f64::from(PLACES));
            // The golden ratio spreads the times of neighbouring places evenly.
            let share = (0.5 + f64::from(i) * 0.618_033_988_749_894_9).fract();
            let time = self.time(frame, pixel, self.scene.shutter.weight.time_of(share));
            let film = match self.options.look.filter {
                PixelFilter::Box => offset,
                PixelFilter::Point => [0.5; 2],
                PixelFilter::Gaussian { sigma } => gaussian_offset(offset).map(|offset| 0.5 + sigma * offset),
            };
            sum += self.behind(environment, [0, 1].map(|axis| f64::from(pixel[axis]) + film[axis]), time);
        }
        sum / f64::from(count)
    }

    /// Scene time (frames) at which the shutter of a pixel has the time `t`, in [0, 1].
    pub(super) fn time(&self, frame: f64, pixel: [u32; 2], t: f64) -> f64 {
        let shutter = &self.scene.shutter;
        let axis = shutter.readout.direction.axis();
        let place = (f64::from(pixel[axis]) + 0.5) / f64::from(self.size[axis]);
        let delay = if shutter.readout.rolls() { shutter.readout.delay(place) } else { 0.0 };
        shutter.frame_time(frame, t) + delay
    }

    /// The environment on the ray through a film point (pixels) at scene time `time` (frames).
    pub(super) fn behind(&self, environment: &Environment, film: [f64; 2], time: f64) -> DVec3 {
        environment.radiance((self.camera(time).world_from_camera * self.direction(film)).normalize())
    }

    /// The camera at scene time `time` (frames).
    pub(super) fn camera(&self, time: f64) -> CameraPose {
        self.fixed_camera.unwrap_or_else(|| CameraPose::new(&camera_from_world(self.scene, time)))
    }

    /// Camera-space direction of depth 1 through a film point (pixels).
    pub(super) fn direction(&self, film: [f64; 2]) -> DVec3 {
        let [w, h] = self.size.map(f64::from);
        let shift = self.scene.camera.shift;
        DVec3::new((film[0] - (0.5 + shift.x) * w) / self.focal, ((0.5 + shift.y) * h - film[1]) / self.focal, -1.0)
    }

    /// The film point (pixels) of a point in camera space: [`direction`](Self::direction) backwards.
    pub(super) fn film(&self, p: DVec3) -> [f64; 2] {
        let [w, h] = self.size.map(f64::from);
        let (shift, depth) = (self.scene.camera.shift, -p.z);
        [(0.5 + shift.x) * w + self.focal * p.x / depth, (0.5 + shift.y) * h - self.focal * p.y / depth]
    }

    /// The lights relative to `eye`, without shadows.
    pub(super) fn lights(&self, eye: DVec3, out: &mut Vec<ShadingLight>) {
        out.clear();
        let lights = self.scene.lights.iter().map(|light| match *light {
            Light::Ambient { colour } => ShadingLight::Ambient { colour: colour.as_vec3() },
            Light::Directional { direction, colour, .. } => {
                ShadingLight::Directional { towards: (-direction).as_vec3(), colour: colour.as_vec3(), shadows: false }
            }
            Light::Point { position, colour, .. } => {
                ShadingLight::Point { position: (position - eye).as_vec3(), colour: colour.as_vec3(), shadows: false }
            }
        });
        out.extend(lights.chain(self.smooth_sky));
    }

    /// The light of the whole environment, as nine harmonics of a normal; `None` where it is no light.
    pub(super) const fn smooth_sky(&self) -> Option<[glam::Vec3; 9]> {
        match self.smooth_sky {
            Some(ShadingLight::Harmonics { terms }) => Some(terms),
            _ => None,
        }
    }

    /// The triangles that rays meet of an object; `None` where they meet anything else.
    pub(super) fn surface(&self, body: &Body<'_>) -> Option<&MeshSurface<'a>> {
        let Form::Model(model) = body.form else { return None };
        self.models[model].surface()
    }

    /// Opacity of a hit of a see-through object, in [0, 1].
    pub(super) fn opacity(&self, hit: &Hit) -> f64 {
        let body = &self.bodies[hit.object as usize];
        let own = match self.surface(body) {
            Some(surface) => surface.point(hit.element, [hit.u, hit.v]).opacity,
            None => body.surfels.opacity.get(hit.element as usize).copied().unwrap_or(1.0),
        };
        (body.object.opacity * f64::from(own)).clamp(0.0, 1.0)
    }

    /// Surfels of the distinct models whose surfels are traced.
    pub(super) fn surfels(&self) -> u64 {
        let of_model = |m| self.bodies.iter().find(|b| matches!(b.form, Form::Model(n) if n == m));
        let traced = (0..self.models.len()).filter(|&m| self.models[m].surface().is_none());
        traced.filter_map(of_model).map(|body| body.surfels.len() as u64).sum()
    }

    /// Triangles of the distinct models whose triangles are traced.
    pub(super) fn triangles(&self) -> u64 {
        let surfaces = self.models.iter().filter_map(Hierarchy::surface);
        surfaces.map(|surface| surface.triangles().len() as u64).sum()
    }

    /// Gaussians of the distinct captures and volumes.
    pub(super) fn gaussians(&self) -> u64 {
        let captures: usize = self.trees.iter().map(|tree| tree.kernels().len()).sum();
        let volumes: usize = self.volume_trees.iter().map(|tree| tree.kernels().len()).sum();
        (captures + volumes) as u64
    }

    /// Memory of all hierarchies, bytes.
    pub(super) fn bytes(&self) -> u64 {
        let surfels: u64 = self.models.iter().map(Hierarchy::bytes).sum();
        let captures: u64 = self.trees.iter().map(Tree::bytes).sum();
        surfels + captures + self.volume_trees.iter().map(Tree::bytes).sum::<u64>()
    }

    /// The pose of the camera that sees an object, if it is the same for every sample.
    pub(super) fn camera_of(&self, body: &Body<'_>) -> Option<CameraPose> {
        if body.object.blur { self.fixed_camera } else { Some(self.frame_camera) }
    }

    /// Is an object shown as at the frame's number before a camera that moves? Then it is elsewhere in the world.
    pub(super) fn is_held(&self, body: &Body<'_>) -> bool {
        !body.object.blur && self.fixed_camera.is_none()
    }

    /// True if light passes through anything.
    pub(super) fn is_see_through(&self) -> bool {
        !self.captures.is_empty() || !self.volumes.is_empty() || self.bodies.iter().any(|body| body.see_through)
    }

    /// True if the lights relative to the eye are the same for every sample.
    pub(super) fn fixed_lights(&self) -> bool {
        self.fixed_camera.is_some()
    }
}

impl<'a> Transparent<'a> {
    fn of(body: usize, of: &Body<'a>, trees: &[Tree<GaussianKernel>]) -> Option<Self> {
        let Form::Gaussians(tree) = of.form else { return None };
        let gaussians: &'a Gaussians = of.object.shape.gaussians()?.gaussians();
        let antialias = of.drawing.antialias.unwrap_or(gaussians.antialiased);
        let reach = trees[tree].kernels().iter().map(|kernel| kernel.reach).fold(0.0, f64::max);
        Some(Self { body, tree, gaussians, antialias, reach })
    }
}

impl<'a> Volume<'a> {
    fn of(body: usize, of: &Body<'a>) -> Option<Self> {
        let Form::Volume(tree) = of.form else { return None };
        Some(Self { body, tree, gaussians: of.object.shape.gaussians()?.gaussians() })
    }
}

/// The mesh whose triangles are traced in place of an object's surfels.
fn traced_mesh<'a>(object: &'a Object, options: &ReferenceOptions) -> Option<&'a Mesh> {
    let model = object.shape.surfels().filter(|_| options.meshes == Meshes::Triangles)?;
    // Points that move by themselves bend the mesh in ways that it does not know.
    model.mesh().filter(|_| model.paths().is_empty()).map(|mesh| &**mesh)
}

/// Gaussians, and how they are shown.
type Shown<'a> = (&'a Gaussians, Drawing);

/// The number of the tree of Gaussians that are shown in this way.
fn tree_of<'a>(shown: &mut Vec<Shown<'a>>, gaussians: &'a Gaussians, drawing: Drawing) -> usize {
    let same = |&(other, its): &Shown<'_>| {
        std::ptr::eq(other, gaussians) && (its.opacity, its.crop) == (drawing.opacity, drawing.crop)
    };
    shown.iter().position(same).unwrap_or_else(|| {
        shown.push((gaussians, drawing));
        shown.len() - 1
    })
}

impl CameraPose {
    fn new(camera_from_world: &DMat4) -> Self {
        let world_from_camera = DMat3::from_mat4(*camera_from_world).transpose();
        Self { world_from_camera, eye: -(world_from_camera * camera_from_world.w_axis.truncate()) }
    }
}

impl<'a> Body<'a> {
    fn new(scene: &'a Scene, object: &'a Object, form: Form, number: f64, options: &ReferenceOptions) -> Self {
        let mut body = Self {
            object,
            surfels: object.shape.surfels_or_none(),
            form,
            surface: Surface {
                material: object.shape.material(),
                ..object.shape.surface().copied().unwrap_or_default()
            },
            drawing: object.shape.drawing(object.opacity).unwrap_or_default(),
            see_through: matches!(form, Form::Model(_)) && object.is_see_through(),
            pace: if object.blur {
                (scene.shutter.close - scene.shutter.open) * object.time_units(scene.frames.rate)
            } else {
                0.0
            },
            number,
            rate: scene.frames.rate,
            poser: ObjectPoser::new(scene, object),
            fixed: None,
            // Triangles hide what is behind them.
            epsilon: if traced_mesh(object, options).is_some() {
                Some(0.0)
            } else {
                options.look.epsilon.or(object.epsilon)
            },
        };
        // Motions by formula keep lengths; keyframes of the scale do not. Without such keyframes the tolerance is
        // constant.
        if object.animation.as_ref().is_none_or(|binding| !binding.node.has_scale()) {
            body.epsilon = body.pose(number).map(|pose| pose.epsilon).or(body.epsilon);
        }
        if body.poser.is_fixed() || !object.blur {
            body.fixed = body.pose(number);
            if body.fixed.is_none() {
                body.form = Form::Nothing;
            }
        }
        body
    }

    /// Pose at scene time `time` (frames), or at the frame number if the object does not blur. `None` if it is hidden
    /// or has no extent.
    pub(super) fn pose_at(&self, time: f64) -> Option<BodyPose> {
        self.fixed.or_else(|| self.pose(time))
    }

    /// Factors on the columns of the paths of its surfels at scene time `time` (frames).
    pub(super) fn elapsed(&self, time: f64) -> Elapsed<f64> {
        let moves = !self.object.shape.paths().is_empty();
        if moves { elapsed(self.object.travelled(self.rate, self.number, time)) } else { [0.0; 3] }
    }

    /// True if the pose does not change over the frame.
    pub(super) fn is_fixed(&self) -> bool {
        self.fixed.is_some()
    }

    /// A sphere in the world that holds a model's sphere at all scene times from `from` to `to` (frames). The model's
    /// sphere is about `centre` relative to the model's origin. `None` if no such sphere is known.
    pub(super) fn swept_sphere(&self, centre: DVec3, radius: f64, from: f64, to: f64) -> Option<(DVec3, f64)> {
        match &self.fixed {
            Some(pose) => {
                let radius = radius * norm(&pose.world_from_model.matrix3);
                Some((pose.world_from_model.transform_point3(centre), radius))
            }
            None => self.poser.swept_sphere(centre + self.surfels.origin, radius, from, to),
        }
    }

    fn pose(&self, time: f64) -> Option<BodyPose> {
        let mut world_from_model = self.poser.at(time)?;
        world_from_model.translation += world_from_model.matrix3 * self.surfels.origin;
        let linear = world_from_model.matrix3;
        let (a, b, c) = (linear.x_axis, linear.y_axis, linear.z_axis);
        let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
        let det = a.dot(bc);
        if det == 0.0 {
            return None;
        }
        let model_from_world = DMat3::from_cols(bc, ca, ab).transpose() * (1.0 / det);
        let epsilon = self.epsilon.unwrap_or_else(|| f64::from(self.object.shape.tolerance()) * libm::cbrt(det.abs()));
        Some(BodyPose { world_from_model, model_from_world, epsilon })
    }

    /// Material of a surfel: that of the scene; without it that of the file; without both the default.
    pub(super) fn material(&self, surfel: usize) -> Material {
        self.surface.material.or_else(|| self.surfels.material.get(surfel).copied()).unwrap_or_default()
    }
}

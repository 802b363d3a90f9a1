//! Poses of all objects at one time sample, composed in `f64` and rounded once.

use glam::{DMat3, DMat4, DVec3, Mat3, Vec3};

use crate::film::Aov;
use crate::model::Optics;
use crate::model::paths::{Elapsed, elapsed};
use crate::options::RenderOptions;
use crate::plan::{Interval, PosedInterval};
use crate::sampling::light_point;
use crate::scene::pose::{ObjectPose, camera_from_world, object_pose, object_velocity};
use crate::scene::{Light, Object, Scene};
use crate::shading::ShadingLight;

/// Least depth at which Gaussians of captures are drawn, in units of the model (Kerbl et al. 2023, their program).
/// Nearer ones would fill the image.
const NEAR_OF_GAUSSIANS: f64 = 0.2;

/// The scene at one time sample.
#[derive(Clone, Debug)]
pub struct PosedSample {
    /// Scene time, frames; with the delay of the strip that a rolling shutter reads out.
    pub time: f64,
    /// Share of the exposure.
    pub weight: f32,
    /// Camera axes in world space: columns right, up, back.
    pub world_from_camera: Mat3,
    /// Lights, relative to the eye.
    pub lights: Vec<ShadingLight>,
    /// Where a shadow catcher is in the light of a sky, of which the last light is one direction: what comes from all,
    /// as [`ShadingLight::Harmonics`].
    pub sky: Option<[Vec3; 9]>,
    /// Number of its points on lights, with what differs between classes of pixels.
    pub number: u64,
    /// Where held objects are in the world.
    pub held: Held,
    /// One per entry of `Frame::objects`.
    pub objects: Vec<PosedObject>,
}

/// How the view of the frame's number, in which held objects are shown, lies to that of a time sample.
///
/// A place relative to the eye of the sample, world axes, at which its camera shows a held object, is in the world at
/// `turn` times itself, plus `shift`, relative to the same eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// The camera's axes of the frame's number times the inverse of the sample's.
    pub turn: Mat3,
    /// The eye of the frame's number relative to that of the sample, world axes.
    pub shift: Vec3,
}

/// An object at one time sample.
///
/// *Screen space* here is (f X, -f Y, -Z) of camera space, f the focal length of the group's raster: a point's raster
/// pixel is its first two coordinates over the third (its depth), counted from the raster's `axis`, x right and y down.
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
    /// Half the difference of the poses at the interval's ends, times the kernels' stretch, linear part; of a strip
    /// that is read out, half the difference between its last and its first row; else 0.
    pub motion_from_model: Mat3,
    /// Motion of the model's origin, likewise.
    pub motion_origin: Vec3,
    /// Factors on the columns of the surfels' paths: what the centres travelled by themselves; over an interval, the
    /// mean by Simpson's rule. 0 where they do not move by themselves.
    pub elapsed: Elapsed<f32>,
    /// The same for what the centres move by themselves in half an interval, times the kernels' stretch; else 0.
    pub advance: Elapsed<f32>,
    /// Units of time of the paths in a shutter; 0 unless the velocity AOV is wanted.
    pub pace: f32,
    /// True where the pose of the centres differs from that of the axes.
    pub moves: bool,
    /// The eye in model space, relative to the model's origin.
    pub eye: Vec3,
    /// Time derivative of `screen_from_model`, per shutter; zero unless the velocity AOV is wanted.
    pub screen_rate: Mat3,
    /// Time derivative of `screen_origin`, per shutter.
    pub screen_origin_rate: Vec3,
    /// Model normals to world normals, up to length: the inverse transpose.
    pub normal_matrix: Mat3,
    /// Half the difference of the same between the last and the first row of a strip that is read out; else 0.
    pub normal_motion: Mat3,
    /// World-space linear part, for surfel positions relative to the eye.
    pub world_from_model: Mat3,
    /// The model's origin relative to the eye, world axes.
    pub world_origin: Vec3,
    /// -1 for transforms that mirror, else 1.
    pub handedness: f32,
    /// Depth tolerance of the visibility rule, world units; of a volume the depth of a layer.
    pub epsilon: f32,
    /// Least depth at which its Gaussians are drawn, world units.
    pub near: f32,
    /// Where its surfels are spheres: world units to a unit of a radius. 0 where they are discs.
    pub spheres: f32,
    /// The axes of its camera in the world: columns right, down, forward.
    pub world_from_view: Mat3,
}

impl PosedObject {
    /// The eye in model space when the first and the last row of a strip are read out; else where it is.
    pub fn eyes(&self) -> [Vec3; 2] {
        if !self.moves {
            return [self.eye; 2];
        }
        [-1.0, 1.0].map(|time| {
            let linear = self.centre_from_model + self.motion_from_model * time;
            -(linear.inverse() * (self.centre_origin + self.motion_origin * time))
        })
    }
}

/// A span of time in which all motion is steady.
#[derive(Clone, Copy)]
pub(super) struct Span {
    /// Scene times, frames.
    ends: [f64; 2],
    /// Factor on the motion.
    stretch: f64,
    /// The mean place is the place of the middle, moved by 1 / `parts` of the way to the mean of both ends.
    parts: f64,
    /// Do normals turn?
    turns: bool,
}

impl Span {
    /// An interval that kernels sweep. Their mean place is that by Simpson's rule.
    pub(super) fn swept(interval: &Interval) -> Self {
        Self { ends: interval.ends, stretch: interval.stretch, parts: 3.0, turns: false }
    }

    /// A strip that is read out around `time`, `half` frames to both sides; `None` where that is 0. Halfway to the mean
    /// of both ends, no place is far from its own.
    pub(super) fn read_out(time: f64, half: f64) -> Option<Self> {
        let ends = [time - half, time + half];
        (half != 0.0).then_some(Self { ends, stretch: 1.0, parts: 2.0, turns: true })
    }
}

/// A map from model space, as its linear part and where the model's origin lands.
type Affine = (DMat3, DVec3);

/// Poses the scene at the times of one frame.
pub(super) struct Poser<'a> {
    pub scene: &'a Scene,
    /// The frame number.
    pub number: f64,
    /// Focal length, raster pixels.
    pub focal: f64,
    pub options: &'a RenderOptions,
}

impl Poser<'_> {
    /// The scene at `time`, which has share `weight` of the exposure; over `span`, if it stands for one. `lit`: number
    /// and seed of its points on lights.
    pub(super) fn sample(&self, time: f64, weight: f64, span: Option<&Span>, lit: (u32, u64)) -> PosedSample {
        let camera = camera_from_world(self.scene, time);
        let world_from_camera = DMat3::from_mat4(camera).transpose();
        let eye = eye(&camera);
        let of_frame = camera_from_world(self.scene, self.number);
        PosedSample {
            time,
            weight: weight as f32,
            world_from_camera: world_from_camera.as_mat3(),
            lights: self.lights(eye, lit),
            sky: self.whole_sky(),
            number: u64::from(lit.0) ^ lit.1,
            held: Held {
                turn: (DMat3::from_mat4(of_frame).transpose() * world_from_camera.transpose()).as_mat3(),
                shift: (self::eye(&of_frame) - eye).as_vec3(),
            },
            objects: self.scene.objects.iter().map(|object| self.object(object, time, &camera, span)).collect(),
        }
    }

    /// The lights before `eye`, each at a point of its own where it has shadows.
    fn lights(&self, eye: DVec3, (number, seed): (u32, u64)) -> Vec<ShadingLight> {
        let light = |(index, light): (u64, &Light)| {
            let shadows = self.options.look.shadows && light.has_shadows();
            let point = shadows.then(|| light_point(number, seed, index));
            shading_light(light, eye, point)
        };
        let mut lights: Vec<_> = (0..).zip(&self.scene.lights).map(light).collect();
        let Some(sky) = self.scene.sky() else { return lights };
        if !self.options.look.shadows || !sky.shadows {
            lights.push(ShadingLight::Harmonics { terms: sky.harmonics() });
            return lights;
        }
        // One direction, with a map of its own: more cost what they save (docs/measurements/environments.md).
        let [down, across, _] = light_point(number, seed, lights.len() as u64);
        let (towards, colour) = sky.drawn([down, across]);
        let (towards, colour) = (towards.as_vec3(), colour.as_vec3());
        lights.push(ShadingLight::Directional { towards, colour, shadows: true });
        lights
    }

    /// The light of the whole sky, where shadow catchers need it.
    fn whole_sky(&self) -> Option<[Vec3; 9]> {
        let sky = self.scene.sky().filter(|sky| self.options.look.shadows && sky.shadows)?;
        self.scene.objects.iter().any(|object| object.shadow_catcher).then(|| sky.harmonics())
    }

    /// Camera-from-model transform (the model relative to its origin) at scene time `time`.
    fn camera_from_model(&self, object: &Object, time: f64) -> DMat4 {
        camera_from_world(self.scene, time)
            * object_pose(self.scene, object, time).world_from_model
            * DMat4::from_translation(object.shape.origin())
    }

    /// An interval whose one sample is `samples`, on a raster of `size`.
    pub(super) fn interval(&self, interval: &Interval, samples: &[PosedSample], size: [u32; 2]) -> PosedInterval {
        let half = |range: std::ops::Range<usize>| interval.moments[range].iter().sum::<f64>();
        let (early, late) = (half(0..16), half(16..32));
        // The linear weight 1 + s tau has (1 + s/2)/2 of its integral in the later half.
        let slope = if early + late > 0.0 { (2.0 * (late - early) / (early + late)).clamp(-1.0, 1.0) } else { 0.0 };
        let posed = samples.iter().flat_map(|sample| self.scene.objects.iter().zip(&sample.objects));
        let moving = posed.filter(|(object, posed)| posed.visible && posed.moves && !object.shape.bounds().is_empty());
        let near = self.scene.camera.near;
        let farthest = moving.map(|(object, posed)| farthest(object, posed, near)).fold(0.0, f64::max);
        let most = f64::from(size[0].max(size[1]) / 2);
        let guard = if farthest > 0.0 { (farthest + 2.0).ceil().min(most) as u32 } else { 0 };
        PosedInterval { moments: interval.moments.map(|share| share as f32), slope: slope as f32, guard, slices: 1 }
    }

    /// An object at `time`, for which `camera` is the camera; over `span`, if the sample stands for one.
    fn object(&self, object: &Object, time: f64, camera: &DMat4, span: Option<&Span>) -> PosedObject {
        // blur="false": object and camera are posed at the frame number.
        let (time, camera) =
            if object.blur { (time, *camera) } else { (self.number, camera_from_world(self.scene, self.number)) };
        let pose = object_pose(self.scene, object, time);
        let camera_from_model = camera * pose.world_from_model * DMat4::from_translation(object.shape.origin());
        let still = self.still(object, time, &pose, &camera, &camera_from_model);
        let Some(span) = span.filter(|_| object.blur) else { return still };
        let (centre, motion) = self.line(object, &camera_from_model, span);
        let (travelled, advance) = self.own_line(object, time, span);
        PosedObject {
            centre_from_model: centre.0.as_mat3(),
            centre_origin: centre.1.as_vec3(),
            motion_from_model: motion.0.as_mat3(),
            motion_origin: motion.1.as_vec3(),
            elapsed: travelled.map(|factor| factor as f32),
            advance: advance.map(|factor| factor as f32),
            moves: motion != (DMat3::ZERO, DVec3::ZERO) || advance != [0.0; 3],
            normal_motion: self.normal_motion(object, &pose, span).as_mat3(),
            ..still
        }
    }

    /// An object with this pose at `time`, before `camera`, without motion.
    fn still(
        &self,
        object: &Object,
        time: f64,
        pose: &ObjectPose,
        camera: &DMat4,
        camera_from_model: &DMat4,
    ) -> PosedObject {
        let linear = DMat3::from_mat4(pose.world_from_model);
        let det = linear.determinant();
        let screen = self.screen(camera_from_model);
        let (screen_from_model, screen_origin) = (screen.0.as_mat3(), screen.1.as_vec3());
        let (rate, pace) = self.velocity(object, time);
        let (epsilon, near) = self.depths(object, libm::cbrt(det.abs()));
        let is_spheres = object.shape.surfels_or_none().spheres;
        let Mat3 { x_axis: right, y_axis: up, z_axis: back } = DMat3::from_mat4(*camera).transpose().as_mat3();
        PosedObject {
            visible: pose.visible && det != 0.0,
            screen_from_model,
            screen_origin,
            centre_from_model: screen_from_model,
            centre_origin: screen_origin,
            motion_from_model: Mat3::ZERO,
            motion_origin: Vec3::ZERO,
            elapsed: self.travelled(object, time).map(|factor| factor as f32),
            advance: [0.0; 3],
            pace: pace as f32,
            moves: false,
            eye: -(screen.0.inverse() * screen.1).as_vec3(),
            screen_rate: rate.0.as_mat3(),
            screen_origin_rate: rate.1.as_vec3(),
            normal_matrix: normal_matrix(&linear, &linear).as_mat3(),
            normal_motion: Mat3::ZERO,
            world_from_model: linear.as_mat3(),
            world_origin: relative_to_eye(camera, camera_from_model).as_vec3(),
            // The discs of spheres show their fronts, whatever a transform mirrors.
            handedness: if det < 0.0 && !is_spheres { -1.0 } else { 1.0 },
            epsilon: epsilon as f32,
            near: near as f32,
            spheres: if is_spheres { libm::cbrt(det.abs()) as f32 } else { 0.0 },
            world_from_view: Mat3::from_cols(right, -up, -back),
        }
    }

    /// The line along which surfels travel during a span: their mean place, and half the difference of its ends, times
    /// the kernels' stretch. `middle` is the camera-from-model transform at its middle.
    fn line(&self, object: &Object, middle: &DMat4, span: &Span) -> (Affine, Affine) {
        let [from, to] = span.ends.map(|time| self.camera_from_model(object, time));
        let mean = *middle + ((from + to) * 0.5 - *middle) / span.parts;
        (self.screen(&mean), self.screen(&((to - from) * (0.5 * span.stretch))))
    }

    /// The same for what surfels travel by themselves: factors on the columns of their paths.
    fn own_line(&self, object: &Object, time: f64, span: &Span) -> (Elapsed<f64>, Elapsed<f64>) {
        let middle = self.travelled(object, time);
        let [from, to] = span.ends.map(|time| self.travelled(object, time));
        let mean = |i: usize| (from[i] + (2.0 * span.parts - 2.0) * middle[i] + to[i]) / (2.0 * span.parts);
        let advance = |i: usize| (to[i] - from[i]) * (0.5 * span.stretch);
        (std::array::from_fn(mean), std::array::from_fn(advance))
    }

    /// Factors on the columns of the surfels' paths at `time`; 0 where they do not move by themselves.
    fn travelled(&self, object: &Object, time: f64) -> Elapsed<f64> {
        let moves = !object.shape.paths().is_empty();
        if moves { elapsed(object.travelled(self.scene.frames.rate, self.number, time)) } else { [0.0; 3] }
    }

    /// Time derivative of the pose, per shutter, and units of time of the surfels' paths in a shutter; 0 unless the
    /// velocity layer is wanted.
    fn velocity(&self, object: &Object, time: f64) -> (Affine, f64) {
        if !self.options.look.aovs.contains(&Aov::Velocity) || !object.blur {
            return ((DMat3::ZERO, DVec3::ZERO), 0.0);
        }
        let velocity = object_velocity(self.scene, object, time) * DMat4::from_translation(object.shape.origin());
        let shutter = self.scene.shutter.close - self.scene.shutter.open;
        (self.screen(&velocity), shutter * object.time_units(self.scene.frames.rate))
    }

    /// Half the difference of the normal matrices at the ends of a span in which normals turn, with the factor that
    /// `pose` has; else 0.
    fn normal_motion(&self, object: &Object, pose: &ObjectPose, span: &Span) -> DMat3 {
        if !span.turns || object.is_fixed() {
            return DMat3::ZERO;
        }
        let linear = |pose: &ObjectPose| DMat3::from_mat4(pose.world_from_model);
        let at = |time: f64| normal_matrix(&linear(&object_pose(self.scene, object, time)), &linear(pose));
        let [from, to] = span.ends.map(at);
        (to - from) * 0.5
    }

    /// Tolerance of the visibility rule and least depth of Gaussians, world units. `scale`: of the model.
    fn depths(&self, object: &Object, scale: f64) -> (f64, f64) {
        let (tolerance, nearest) = match object.shape.gaussians().map(|model| model.gaussians().optics) {
            None => (object.shape.tolerance(), 0.0),
            Some(Optics::Alpha) => (object.shape.tolerance(), NEAR_OF_GAUSSIANS),
            Some(Optics::Extinction { layer }) => (layer, 0.0),
        };
        let epsilon = self.options.look.epsilon.or(object.epsilon).unwrap_or_else(|| f64::from(tolerance) * scale);
        (epsilon, self.scene.camera.near.max(nearest * scale))
    }

    /// Camera space to screen space.
    fn screen(&self, m: &DMat4) -> Affine {
        let k = DMat3::from_diagonal(DVec3::new(self.focal, -self.focal, -1.0));
        (k * DMat3::from_mat4(*m), k * m.w_axis.truncate())
    }
}

/// Farthest that the pose of an object moves a point of it from the middle of an interval, raster pixels; infinite
/// where a point comes nearer than `near`.
fn farthest(object: &Object, posed: &PosedObject, near: f64) -> f64 {
    let farther = |most: f64, (p, advance): (Vec3, Vec3)| most.max(drift(posed, p, advance, near));
    let paths = object.shape.paths();
    if paths.is_empty() {
        let corners =
            object.shape.bounds().corners().map(|corner| ((corner - object.shape.origin()).as_vec3(), Vec3::ZERO));
        return corners.into_iter().fold(0.0, farther);
    }
    let points = object.shape.positions().iter().enumerate().map(|(i, &position)| {
        let advance = posed.centre_from_model * paths.sum(i, posed.advance);
        (paths.place(position, i, posed.elapsed), advance)
    });
    points.fold(0.0, farther)
}

/// Distance from the middle of an interval to the farther end of the path of a point, raster pixels. `p`: the point, in
/// model space relative to the model's origin. `advance`: half of what it travels by itself, in screen space. Infinite
/// where it comes nearer than `near`, or is not finite.
fn drift(posed: &PosedObject, p: Vec3, advance: Vec3, near: f64) -> f64 {
    let centre = (posed.centre_from_model * p + posed.centre_origin).as_dvec3();
    let motion = (posed.motion_from_model * p + posed.motion_origin + advance).as_dvec3();
    let (from, to) = (centre - motion, centre + motion);
    if from.z.min(to.z) < near {
        return f64::INFINITY;
    }
    let on_raster = |p: DVec3| p.truncate() / p.z;
    let drift = |end: DVec3| (on_raster(end) - on_raster(centre)).abs().max_element();
    let farther = drift(from).max(drift(to));
    if farther.is_nan() { f64::INFINITY } else { farther }
}

/// The eye of a camera with this pose.
fn eye(camera_from_world: &DMat4) -> DVec3 {
    -(DMat3::from_mat4(*camera_from_world).transpose() * camera_from_world.w_axis.truncate())
}

/// The model's origin relative to the eye, world axes. `camera` posed the object.
fn relative_to_eye(camera: &DMat4, camera_from_model: &DMat4) -> DVec3 {
    let world_from_camera = DMat3::from_mat4(*camera).transpose();
    world_from_camera * camera_from_model.w_axis.truncate()
}

/// Inverse transpose up to a positive factor, finite for singular matrices: the cofactors, with the determinant's sign.
/// The factor makes the longest column of `unit`'s have length 1.
fn normal_matrix(m: &DMat3, unit: &DMat3) -> DMat3 {
    let cofactors = |m: &DMat3| {
        let (a, b, c) = (m.x_axis, m.y_axis, m.z_axis);
        DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b))
    };
    let of_unit = cofactors(unit);
    let size = of_unit.x_axis.length().max(of_unit.y_axis.length()).max(of_unit.z_axis.length());
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    if size > 0.0 { cofactors(m) * (sign / size) } else { cofactors(m) }
}

/// A light as shaders see it. `point`: in the unit cube, where the light has shadows; then it shines from there.
fn shading_light(light: &Light, eye: DVec3, point: Option<[f64; 3]>) -> ShadingLight {
    let shadows = point.is_some();
    match *light {
        Light::Ambient { colour } => ShadingLight::Ambient { colour: colour.as_vec3() },
        Light::Directional { direction, colour, angle, .. } => {
            let towards = point.map_or(-direction, |point| in_cone(-direction, angle, point));
            ShadingLight::Directional { towards: towards.as_vec3(), colour: colour.as_vec3(), shadows }
        }
        Light::Point { position, colour, radius, .. } => {
            let position = position + point.map_or(DVec3::ZERO, |point| in_ball(point) * radius);
            ShadingLight::Point { position: (position - eye).as_vec3(), colour: colour.as_vec3(), shadows }
        }
    }
}

/// A direction at most half of `angle` away from the unit vector `axis`: equal solid angles for equal areas of the unit
/// square.
fn in_cone(axis: DVec3, angle: f64, [a, b, _]: [f64; 3]) -> DVec3 {
    // 1 - cos t = 2 sin^2(t / 2), which keeps its digits where t is small.
    let half = a.sqrt() * libm::sin(0.25 * angle);
    let (cosine, sine) = (1.0 - 2.0 * half * half, 2.0 * half * (1.0 - half * half).sqrt());
    let (u, v) = axis.any_orthonormal_pair();
    let turn = std::f64::consts::TAU * b;
    axis * cosine + (u * libm::cos(turn) + v * libm::sin(turn)) * sine
}

/// A point of the unit ball with density 1 / sqrt(1 - r^2), as three parts of a unit quaternion have it that is drawn
/// evenly (Shoemake 1992): from everywhere it is seen as an even disc.
fn in_ball([a, b, c]: [f64; 3]) -> DVec3 {
    let (first, second) = ((1.0 - a).sqrt(), a.sqrt());
    let [b, c] = [b, c].map(|turn| std::f64::consts::TAU * turn);
    DVec3::new(first * libm::sin(b), first * libm::cos(b), second * libm::sin(c))
}

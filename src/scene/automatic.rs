//! What a scene leaves open and its objects decide: the frames, the lights and the camera. Scenes made in code and
//! scene files have the same defaults.

use glam::DVec3;

use super::model::SurfelModel;
use super::pose::object_pose;
use super::shape::Shape;
use super::values::{Camera, FrameRange, ImageSettings, Light, Object, Scene};
use crate::files::Seen;
use crate::math::Bounds;
use crate::time::Shutter;

/// Frames a second where neither the scene nor an animation says it: film.
pub(crate) const RATE: f64 = 24.0;
/// Last frame of a scene that moves by formula alone: one second of film.
const LAST: i64 = 24;
/// Room around the objects, as a factor on the distance from their front.
const MARGIN: f64 = 1.05;
/// Where the eye is from the middle of meshes: in front, above and to the right. So three sides of a box show.
const ABOVE_RIGHT: DVec3 = DVec3::new(0.6, 0.5, 1.0);

impl Scene {
    /// A scene of these objects; what a scene file may leave out is as there.
    ///
    /// The image has 1024 x 768 pixels and a black background. The frames are those of the animations' keys; else 0 to
    /// 24 if an object moves, else 0 alone. The shutter is open from a quarter of a frame before the frame number to a
    /// quarter after it. There is a directional light from the upper right front, and some ambient light. The camera
    /// looks along -z, or at meshes alone from above right, and sees all objects in all frames ([`Camera::automatic`]).
    /// Objects without a name are called `object1`, `object2`, ...
    pub fn new(objects: impl IntoIterator<Item = Object>) -> Self {
        let mut objects: Vec<Object> = objects.into_iter().collect();
        for (object, number) in objects.iter_mut().zip(1..) {
            if object.name.is_empty() {
                object.name = format!("object{number}");
            }
        }
        let mut scene = Self {
            name: "scene".to_owned(),
            image: ImageSettings::default(),
            frames: frames(&GivenFrames::default(), &objects, None, false, None),
            shutter: Shutter::default(),
            camera: Camera::new(DVec3::ZERO, DVec3::NEG_Z),
            lights: lights(),
            environment: None,
            objects,
            files: Seen::new(),
        };
        scene.camera = Camera::automatic(&scene);
        scene
    }
}

impl Camera {
    /// A camera that looks along -z, with +y up and a field of view of 40 degrees, and sees all objects of `scene` in
    /// all its frames, on an image of its size. The scene's own camera plays no part. Where all objects are meshes, it
    /// looks from above right.
    pub fn automatic(scene: &Scene) -> Self {
        camera(scene, &GivenCamera::default())
    }
}

/// The words of a scene file about its frames.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct GivenFrames {
    pub(crate) first: Option<i64>,
    pub(crate) last: Option<i64>,
    /// Frames per second.
    pub(crate) rate: Option<f64>,
}

/// The frames of a scene: what is given, else the union of the ranges of all keys, else by whether an object moves.
///
/// `camera`: the range of its keys, seconds. `camera_moves`: by formula. `file_rate` is the rate that an animation file
/// gives, frames per second.
pub(crate) fn frames(
    given: &GivenFrames,
    objects: &[Object],
    camera: Option<(f64, f64)>,
    camera_moves: bool,
    file_rate: Option<f64>,
) -> FrameRange {
    if let Some([first, last]) = of_sequences(objects)
        && given.first.is_none()
        && given.last.is_none()
    {
        let rate = range(given, std::iter::empty(), file_rate, false).rate;
        return FrameRange { first, last, rate };
    }
    let bindings = objects.iter().filter_map(|object| object.animation.as_ref());
    let moving = camera_moves || objects.iter().any(|object| !object.motions.is_empty());
    range(given, bindings.map(|binding| binding.node.range()).chain(camera), file_rate, moving)
}

/// The frames from the first to the last of `keys`, seconds, at `rate` frames per second.
pub(crate) fn frames_of_keys(keys: (f64, f64), rate: f64) -> FrameRange {
    range(&GivenFrames { rate: Some(rate), ..GivenFrames::default() }, std::iter::once(keys), None, false)
}

/// The frames at which the files of all sequences are shown.
fn of_sequences(objects: &[Object]) -> Option<[i64; 2]> {
    let specs = objects.iter().filter_map(|object| object.shape.sequence()).map(|files| files.spec());
    let frames = specs.map(|spec| {
        let [first, last] = [spec.first, spec.last].map(|number| spec.frame_of(number).clamp(-1e9, 1e9));
        [first.ceil() as i64, last.floor() as i64]
    });
    let [first, last] = frames.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])?;
    Some([first, last.max(first)])
}

/// As [`frames`]; `keys` are the ranges of the keys, seconds.
fn range(
    given: &GivenFrames,
    keys: impl Iterator<Item = (f64, f64)>,
    file_rate: Option<f64>,
    moving: bool,
) -> FrameRange {
    // Keys that stand on a frame may miss it by rounding in the conversion to seconds and back.
    const SLACK: f64 = 1e-6;
    let rate = given.rate.or(file_rate.filter(|r| r.is_finite() && *r > 0.0)).unwrap_or(RATE);
    let union = keys.filter(|(a, b)| a.is_finite() && b.is_finite()).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let (first, last) = match union {
        Some((a, b)) => {
            let first = (a * rate - SLACK).ceil().clamp(-1e9, 1e9) as i64;
            let last = (b * rate + SLACK).floor().clamp(-1e9, 1e9) as i64;
            // All keys between two frames: the frame before them.
            (first.min(last), last)
        }
        None => (0, if moving { LAST } else { 0 }),
    };
    // The end that is given wins; the other end makes room.
    let (first, last) = match (given.first, given.last) {
        (Some(first), None) => (first, last.max(first)),
        (None, Some(last)) => (first.min(last), last),
        (None, None) => (first, last),
        (Some(first), Some(last)) => (first, last),
    };
    FrameRange { first, last, rate }
}

/// A key light from the upper right front, and a little ambient light.
pub(crate) fn lights() -> Vec<Light> {
    let direction = DVec3::new(-0.5, -1.0, -0.8);
    vec![
        Light::directional(direction / direction.length(), DVec3::splat(0.9)),
        Light::Ambient { colour: DVec3::splat(0.3) },
    ]
}

/// The words of a scene file about its camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GivenCamera {
    pub(crate) eye: Option<DVec3>,
    /// Point that it looks at.
    pub(crate) at: Option<DVec3>,
    /// `None`: up as captures have it where all objects are captures that stand so, else +y.
    pub(crate) up: Option<DVec3>,
    /// Radians.
    pub(crate) fovy: f64,
    pub(crate) near: Option<f64>,
}

impl Default for GivenCamera {
    fn default() -> Self {
        Self { eye: None, at: None, up: None, fovy: Camera::FOVY_DEGREES.to_radians(), near: None }
    }
}

/// The direction of up where nothing is said. Captures have y down, as the cameras had that they were made from; their
/// viewers look from +z, too. Volumes have y up.
pub(super) fn upwards(scene: &Scene) -> DVec3 {
    let is_upside_down = |object: &Object| {
        let pose = object_pose(scene, object, scene.frames.first as f64).world_from_model;
        matches!(object.shape, Shape::Gaussians { .. }) && pose.transform_vector3(DVec3::NEG_Y).y < 0.0
    };
    let all = !scene.objects.is_empty() && scene.objects.iter().all(is_upside_down);
    if all { DVec3::NEG_Y } else { DVec3::Y }
}

/// From what it looks at to the eye, and to the right and upwards in its image: unit vectors.
fn direction(scene: &Scene, up: DVec3) -> [DVec3; 3] {
    let all = !scene.objects.is_empty()
        && scene.objects.iter().all(|object| object.shape.surfels().is_some_and(SurfelModel::is_mesh));
    let out = if all { ABOVE_RIGHT.normalize() } else { DVec3::Z };
    // Where the camera looks along `up` it is refused anyway.
    let right = up.cross(out).normalize_or(DVec3::X);
    [out, right, out.cross(right)]
}

/// Completes a camera. Where its eye or the point that it looks at is missing, it sees all objects at all times,
/// looking along -z, or at meshes alone from above right.
pub(crate) fn camera(scene: &Scene, given: &GivenCamera) -> Camera {
    let GivenCamera { eye, at: target, up, fovy, near } = *given;
    let up = up.unwrap_or_else(|| upwards(scene));
    if let (Some(eye), Some(at)) = (eye, target) {
        return Camera { up, fovy, near: near.unwrap_or(Camera::NEAR), ..Camera::new(eye, at) };
    }
    let bounds = swept_bounds(scene);
    let tan = (0.5 * fovy).tan();
    let aspect = f64::from(scene.image.width) / f64::from(scene.image.height);
    let [out, right, above] = direction(scene, up);
    let needed = |corner: DVec3| {
        let p = corner - bounds.centre();
        p.dot(out) + MARGIN * (p.dot(above).abs() / tan).max(p.dot(right).abs() / (tan * aspect))
    };
    let distance = bounds.corners().map(needed).into_iter().fold(0.0, f64::max);
    let distance = if distance > 0.0 && distance.is_finite() { distance } else { 1.0 };
    let grid = Grid::new(distance);
    let at = target.unwrap_or_else(|| grid.vector(bounds.centre()));
    let away = grid.above(distance + (at - bounds.centre()).length());
    // Along an axis the distance is a short number already.
    let eye = eye.unwrap_or_else(|| if out == DVec3::Z { at + out * away } else { grid.vector(at + out * away) });
    let eye = grid.exact(eye);
    // A near plane that cuts no small scene away.
    let near = near.unwrap_or_else(|| Camera::NEAR.min(grid.number((eye - at).length() * 1e-3)).max(1e-9));
    Camera { up, fovy, near, automatic: true, ..Camera::new(eye, at) }
}

/// Box around all visible objects at all times of the scene's frames, shutter included.
fn swept_bounds(scene: &Scene) -> Bounds {
    // Four poses a frame, within a total that stays well under a second.
    const MOST_POSES: usize = 200_000;
    let [from, _] = scene.shutter.whole_exposure(scene.frames.first as f64);
    let [_, to] = scene.shutter.whole_exposure(scene.frames.last as f64);
    let most = (MOST_POSES / scene.objects.len().max(1)).clamp(8, 2000);
    let steps = ((4.0 * (to - from)).ceil() as usize).clamp(2, most);
    let mut all = Bounds::default();
    for only_visible in [true, false] {
        for object in &scene.objects {
            if object.shape.core().is_empty() {
                continue;
            }
            for i in 0..=if object.is_fixed() { 0 } else { steps } {
                let time = from + (to - from) * i as f64 / steps as f64;
                let bounds = object.core_at(scene.frames.rate, time);
                let pose = object_pose(scene, object, time);
                if only_visible && !pose.visible {
                    continue;
                }
                let m = pose.world_from_model;
                let radius = f64::from(object.shape.median_radius()) * libm::cbrt(m.determinant().abs());
                for corner in bounds.corners() {
                    let p = m.transform_point3(corner);
                    if p.is_finite() {
                        all.add(p - DVec3::splat(radius));
                        all.add(p + DVec3::splat(radius));
                    }
                }
            }
        }
        if !all.is_empty() {
            break;
        }
    }
    all
}

/// Rounds to about four digits of a size, so that the automatic camera's numbers are short.
pub(super) struct Grid {
    decimals: usize,
    /// For sizes of 1000 and more: powers of ten before the point.
    step: f64,
}

impl Grid {
    pub(super) fn new(size: f64) -> Self {
        let exponent = 3 - size.log10().floor() as i32;
        Self { decimals: exponent.clamp(0, 300) as usize, step: 10_f64.powi((-exponent).clamp(0, 300)) }
    }

    /// The nearest number on the grid; through decimal text, so that it prints as short as it looks.
    pub(super) fn number(&self, x: f64) -> f64 {
        let x = if self.decimals == 0 { (x / self.step).round() * self.step } else { x };
        format!("{x:.*}", self.decimals).parse().unwrap_or(x) + 0.0
    }

    /// A number on the grid that is not below `x`.
    fn above(&self, x: f64) -> f64 {
        let unit = if self.decimals == 0 { self.step } else { 0.1_f64.powi(self.decimals as i32) };
        self.number(x + 0.5 * unit)
    }

    pub(super) fn vector(&self, v: DVec3) -> DVec3 {
        DVec3::new(self.number(v.x), self.number(v.y), self.number(v.z))
    }

    /// `v` on the grid where it already was up to rounding.
    fn exact(&self, v: DVec3) -> DVec3 {
        let rounded = self.vector(v);
        DVec3::select((rounded - v).abs().cmple(1e-9 * v.abs()), rounded, v)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::math::Trs;
    use crate::model::Surfels;
    use crate::scene::Motion;
    use crate::scene::pose::camera_from_world;

    /// A scene with one object whose surfels fill a box around (3, 1, -2).
    fn boxed(motion: Motion, image: (u32, u32), transform: Trs) -> Scene {
        let half = Vec3::new(1.0, 0.5, 0.25);
        let surfels = Surfels {
            origin: DVec3::new(3.0, 1.0, -2.0),
            position: vec![-half, half],
            axis_u: vec![0.01 * Vec3::X; 2],
            axis_v: vec![0.01 * Vec3::Y; 2],
            normal: vec![Vec3::Z; 2],
            colour: vec![Vec3::ONE; 2],
            ..Surfels::default()
        };
        let mut object = Object::new(surfels);
        object.transform = transform;
        object.motions = vec![motion];
        let mut scene = Scene::new([object]);
        (scene.image.width, scene.image.height) = image;
        scene
    }

    #[test]
    fn the_camera_sees_all_and_is_not_far_away() {
        let still = Motion::Linear { velocity: DVec3::ZERO };
        let far = Motion::Linear { velocity: DVec3::new(0.5, 0.25, -1.0) };
        let turn = Motion::Rotation { axis: DVec3::Z, per_frame: 0.26, centre: DVec3::X };
        let scaled = |scale: f64| Trs { scale: DVec3::splat(scale), ..Trs::default() };
        let away = Trs { translate: DVec3::new(5e6, -2e6, 1e6), ..Trs::default() };
        for (motion, image, transform) in [
            (still, (640, 480), Trs::default()),
            (far, (1000, 100), Trs::default()),
            (turn, (100, 900), Trs::default()),
            (still, (640, 480), scaled(1e-4)),
            (still, (640, 480), scaled(-1e5)),
            (turn, (640, 480), away),
        ] {
            let mut scene = boxed(motion, image, transform);
            scene.camera = Camera::automatic(&scene);
            let tan = (0.5 * scene.camera.fovy).tan();
            let aspect = f64::from(image.0) / f64::from(image.1);
            let (mut widest, mut highest) = (0.0_f64, 0.0_f64);
            for i in -1..=97 {
                let time = f64::from(i) / 4.0;
                let pose = object_pose(&scene, &scene.objects[0], time);
                let view = camera_from_world(&scene, time) * pose.world_from_model;
                for corner in scene.objects[0].shape.bounds().corners() {
                    let p = view.transform_point3(corner);
                    assert!(-p.z > scene.camera.near, "{p} {:?}", scene.camera);
                    widest = widest.max(p.x.abs() / (-p.z * tan * aspect));
                    highest = highest.max(p.y.abs() / (-p.z * tan));
                }
            }
            let most = widest.max(highest);
            assert!(most < 1.0 && most > 0.4, "{most} {:?}", scene.camera);
        }
    }

    #[test]
    fn a_given_eye_or_target_is_kept() {
        let scene = boxed(Motion::Linear { velocity: DVec3::ZERO }, (640, 480), Trs::default());
        let given =
            |eye, at| camera(&scene, &GivenCamera { eye, at, fovy: 0.5, near: Some(0.2), ..GivenCamera::default() });
        let eye = DVec3::new(10.0, 10.0, 10.0);
        let from_eye = given(Some(eye), None);
        assert_eq!((from_eye.eye, from_eye.at), (eye, DVec3::new(3.0, 1.0, -2.0)));
        assert_eq!((from_eye.fovy, from_eye.near, from_eye.automatic), (0.5, 0.2, true));
        let target = DVec3::new(3.0, 1.5, -2.0);
        let to_target = given(None, Some(target));
        assert_eq!((to_target.at, to_target.eye.x, to_target.eye.y), (target, 3.0, 1.5));
        assert!(to_target.eye.z > 0.0);
    }

    fn of(given: &GivenFrames, keys: &[(f64, f64)], rate: Option<f64>, moving: bool) -> (i64, i64, f64) {
        let f = range(given, keys.iter().copied(), rate, moving);
        (f.first, f.last, f.rate)
    }

    #[test]
    fn frames_are_the_union_of_the_keys() {
        let none = GivenFrames::default();
        assert_eq!(of(&none, &[], None, false), (0, 0, 24.0));
        assert_eq!(of(&none, &[], None, true), (0, 24, 24.0));
        let keys = [(1.0 / 24.0, 49.0 / 24.0), (5.0 / 24.0, 60.0 / 24.0)];
        assert_eq!(of(&none, &keys, Some(24.0), false), (1, 60, 24.0));
        // 0.1 s to 0.95 s at 10 frames a second: frames 1 to 9.
        assert_eq!(of(&none, &[(0.1, 0.95)], Some(10.0), true), (1, 9, 10.0));
        assert_eq!(of(&none, &[(0.12, 0.95)], Some(10.0), true), (2, 9, 10.0));
        // All keys between two frames: one frame.
        assert_eq!(of(&none, &[(0.11, 0.12)], Some(10.0), true), (1, 1, 10.0));
    }

    #[test]
    fn what_is_given_wins() {
        let keys = [(0.0, 1.0)];
        let spec = GivenFrames { first: Some(5), last: None, rate: Some(30.0) };
        assert_eq!(of(&spec, &keys, Some(24.0), false), (5, 30, 30.0));
        let spec = GivenFrames { first: Some(50), last: None, rate: None };
        assert_eq!(of(&spec, &keys, Some(24.0), false), (50, 50, 24.0));
        let spec = GivenFrames { first: None, last: Some(-3), rate: None };
        assert_eq!(of(&spec, &keys, Some(24.0), false), (-3, -3, 24.0));
    }

    #[test]
    fn a_scene_of_objects_has_the_defaults_of_a_scene_file() {
        let scene = boxed(Motion::Linear { velocity: DVec3::X }, (1024, 768), Trs::default());
        assert_eq!((scene.image, scene.shutter.clone()), (ImageSettings::default(), Shutter::default()));
        assert_eq!(scene.frames, FrameRange { first: 0, last: 24, rate: 24.0 });
        assert_eq!(scene.objects[0].name, "object1");
        assert_eq!(scene.lights.len(), 2);
        assert!(scene.camera.automatic);
        let mut named = scene.objects[0].clone();
        (named.name, named.motions) = ("box".to_owned(), Vec::new());
        let scene = Scene::new([named, Object::new(Surfels::default())]);
        assert_eq!((scene.frames.first, scene.frames.last), (0, 0));
        assert_eq!(scene.objects.iter().map(|object| object.name.as_str()).collect::<Vec<_>>(), ["box", "object2"]);
    }

    #[test]
    fn the_grid_rounds_to_short_numbers() {
        assert_eq!(Grid::new(4.321_987).number(0.123_456), 0.123);
        assert_eq!(Grid::new(4.321_987).above(4.321_01), 4.322);
        assert_eq!(Grid::new(76_543.2).number(76_543.2), 76_540.0);
    }
}

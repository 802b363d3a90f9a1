//! What a scene leaves out and its content decides: the frames and the camera.

use glam::DVec3;

use super::document::{CameraSpec, FramesSpec};
use crate::math::Bounds;
use crate::scene::pose::object_pose;
use crate::scene::{Camera, FrameRange, Scene};

/// Frames a second where neither the scene nor an animation says it: film.
const RATE: f64 = 24.0;
/// Last frame of a scene that moves by formula alone: one second of film.
const LAST: i64 = 24;
/// Field of view of a camera that the scene leaves out, degrees.
pub(super) const FOVY_DEGREES: f64 = 40.0;
/// Nearest visible depth by default, scene units.
pub(super) const NEAR: f64 = 0.01;
/// Room around the objects, as a factor on the distance from their front.
const MARGIN: f64 = 1.05;

/// The frames of a scene: what is given, else the union of the key ranges (`keys`, seconds), else by `moving`.
pub(super) fn frames(
    spec: &FramesSpec,
    keys: impl Iterator<Item = (f64, f64)>,
    file_rate: Option<f64>,
    moving: bool,
) -> FrameRange {
    // Keys that stand on a frame may miss it by rounding in the conversion to seconds and back.
    const SLACK: f64 = 1e-6;
    let rate = spec.rate.or(file_rate.filter(|r| r.is_finite() && *r > 0.0)).unwrap_or(RATE);
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
    // What is given wins; the other end makes room.
    let (first, last) = match (spec.first, spec.last) {
        (Some(first), None) => (first, last.max(first)),
        (None, Some(last)) => (first.min(last), last),
        (None, None) => (first, last),
        (Some(first), Some(last)) => (first, last),
    };
    FrameRange { first, last, rate }
}

/// Completes a camera that lacks its eye or its target, so that it sees all objects at all times; looks along -z.
pub(super) fn camera(scene: &Scene, spec: Option<&CameraSpec>) -> Camera {
    let up = spec.map_or(DVec3::Y, |s| s.up);
    let fovy = spec.map_or(FOVY_DEGREES.to_radians(), |s| s.fovy);
    let (eye, target) = (spec.and_then(|s| s.eye), spec.and_then(|s| s.target));
    let near = spec.and_then(|s| s.near);
    if let (Some(eye), Some(at)) = (eye, target) {
        return Camera { eye, at, up, fovy, near: near.unwrap_or(NEAR), animation: None, automatic: false };
    }
    let bounds = swept_bounds(scene);
    let half = 0.5 * bounds.size();
    let tan = (0.5 * fovy).tan();
    let aspect = f64::from(scene.image.width) / f64::from(scene.image.height);
    let distance = half.z + MARGIN * (half.y / tan).max(half.x / (tan * aspect));
    let distance = if distance > 0.0 && distance.is_finite() { distance } else { 1.0 };
    let grid = Grid::new(distance);
    let at = target.unwrap_or_else(|| grid.vector(bounds.centre()));
    let eye = eye.unwrap_or_else(|| at + DVec3::new(0.0, 0.0, grid.above(distance + (at - bounds.centre()).length())));
    let eye = grid.exact(eye);
    // A near plane that cuts no small scene away.
    let near = near.unwrap_or_else(|| NEAR.min(grid.number((eye - at).length() * 1e-3)).max(1e-9));
    Camera { eye, at, up, fovy, near, animation: None, automatic: true }
}

/// Box around all visible objects at all times of the scene's frames, shutter included.
fn swept_bounds(scene: &Scene) -> Bounds {
    // Four poses a frame, within a total that stays well under a second.
    const MOST_POSES: usize = 200_000;
    let from = scene.frames.first as f64 + scene.shutter.open;
    let to = scene.frames.last as f64 + scene.shutter.close;
    let most = (MOST_POSES / scene.objects.len().max(1)).clamp(8, 2000);
    let steps = ((4.0 * (to - from)).ceil() as usize).clamp(2, most);
    let mut all = Bounds::default();
    for only_visible in [true, false] {
        for object in scene.objects.iter().filter(|o| !o.bounds.is_empty()) {
            let still = object.animation.is_none() && object.motions.is_empty();
            for i in 0..=if still { 0 } else { steps } {
                let pose = object_pose(scene, object, from + (to - from) * i as f64 / steps as f64);
                if only_visible && !pose.visible {
                    continue;
                }
                let m = pose.world_from_model;
                let radius = f64::from(object.median_radius) * libm::cbrt(m.determinant().abs());
                for corner in object.bounds.corners() {
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
struct Grid {
    decimals: usize,
    /// For sizes of 1000 and more: powers of ten before the point.
    step: f64,
}

impl Grid {
    fn new(size: f64) -> Self {
        let exponent = 3 - size.log10().floor() as i32;
        Self { decimals: exponent.clamp(0, 300) as usize, step: 10_f64.powi((-exponent).clamp(0, 300)) }
    }

    /// The nearest number on the grid; through decimal text, so that it prints as short as it looks.
    fn number(&self, x: f64) -> f64 {
        let x = if self.decimals == 0 { (x / self.step).round() * self.step } else { x };
        format!("{x:.*}", self.decimals).parse().unwrap_or(x) + 0.0
    }

    /// A number on the grid that is not below `x`.
    fn above(&self, x: f64) -> f64 {
        let unit = if self.decimals == 0 { self.step } else { 0.1_f64.powi(self.decimals as i32) };
        self.number(x + 0.5 * unit)
    }

    fn vector(&self, v: DVec3) -> DVec3 {
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
    use std::sync::Arc;

    use super::*;
    use crate::math::Trs;
    use crate::scene::pose::camera_from_world;
    use crate::scene::{ImageSettings, Motion, Object};
    use crate::time::Shutter;

    /// A scene with one object that fills a box around (3, 1, -2).
    fn boxed(motion: Motion, image: (u32, u32), transform: Trs) -> Scene {
        let centre = DVec3::new(3.0, 1.0, -2.0);
        let half = DVec3::new(1.0, 0.5, 0.25);
        let object = Object {
            name: String::new(),
            model_path: "m".into(),
            model: Arc::default(),
            radius_scale: 1.0,
            colour_space: None,
            transform,
            animation: None,
            motions: vec![motion],
            place: Trs::default(),
            material: None,
            epsilon: None,
            blur: true,
            two_sided: false,
            median_radius: 0.01,
            bounds: [centre - half, centre + half].into_iter().collect(),
            sphere: None,
        };
        Scene {
            name: String::new(),
            image: ImageSettings { width: image.0, height: image.1, ..ImageSettings::default() },
            frames: FrameRange { first: 0, last: 24, rate: 24.0 },
            shutter: Shutter::default(),
            camera: camera_at(DVec3::ZERO),
            lights: Vec::new(),
            objects: vec![object],
        }
    }

    fn camera_at(eye: DVec3) -> Camera {
        Camera { eye, at: eye - DVec3::Z, up: DVec3::Y, fovy: 1.0, near: 0.01, animation: None, automatic: false }
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
            scene.camera = camera(&scene, None);
            let tan = (0.5 * scene.camera.fovy).tan();
            let aspect = f64::from(image.0) / f64::from(image.1);
            let (mut widest, mut highest) = (0.0_f64, 0.0_f64);
            for i in -1..=97 {
                let time = f64::from(i) / 4.0;
                let pose = object_pose(&scene, &scene.objects[0], time);
                let view = camera_from_world(&scene, time) * pose.world_from_model;
                for corner in scene.objects[0].bounds.corners() {
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
        let spec =
            |eye, target| CameraSpec { at: 0, eye, target, up: DVec3::Y, fovy: 0.5, near: Some(0.2), animation: None };
        let eye = DVec3::new(10.0, 10.0, 10.0);
        let from_eye = camera(&scene, Some(&spec(Some(eye), None)));
        assert_eq!((from_eye.eye, from_eye.at), (eye, DVec3::new(3.0, 1.0, -2.0)));
        assert_eq!((from_eye.fovy, from_eye.near, from_eye.automatic), (0.5, 0.2, true));
        let target = DVec3::new(3.0, 1.5, -2.0);
        let to_target = camera(&scene, Some(&spec(None, Some(target))));
        assert_eq!((to_target.at, to_target.eye.x, to_target.eye.y), (target, 3.0, 1.5));
        assert!(to_target.eye.z > 0.0);
    }

    fn of(spec: &FramesSpec, keys: &[(f64, f64)], rate: Option<f64>, moving: bool) -> (i64, i64, f64) {
        let f = frames(spec, keys.iter().copied(), rate, moving);
        (f.first, f.last, f.rate)
    }

    #[test]
    fn frames_are_the_union_of_the_keys() {
        let none = FramesSpec::default();
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
        let spec = FramesSpec { first: Some(5), last: None, rate: Some(30.0) };
        assert_eq!(of(&spec, &keys, Some(24.0), false), (5, 30, 30.0));
        let spec = FramesSpec { first: Some(50), last: None, rate: None };
        assert_eq!(of(&spec, &keys, Some(24.0), false), (50, 50, 24.0));
        let spec = FramesSpec { first: None, last: Some(-3), rate: None };
        assert_eq!(of(&spec, &keys, Some(24.0), false), (-3, -3, 24.0));
    }

    #[test]
    fn the_grid_rounds_to_short_numbers() {
        assert_eq!(Grid::new(4.321_987).number(0.123_456), 0.123);
        assert_eq!(Grid::new(4.321_987).above(4.321_01), 4.322);
        assert_eq!(Grid::new(76_543.2).number(76_543.2), 76_540.0);
    }
}

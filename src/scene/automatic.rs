//! What a scene leaves out and its content decides: the frames and the camera.

use glam::DVec3;

use super::document::{CameraSpec, FramesSpec};
use super::{Camera, FrameRange, Scene};
use crate::math::Bounds;
use crate::pose::object_pose;

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
    use super::*;

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

//! What the camera can see of an object: whether it stands within the object's box, and why a frame shows nothing of
//! it.

use std::fmt;

use glam::{DMat4, DVec2, DVec3};

use super::pose::{camera_from_world, object_pose};
use super::sequence::Sequence;
use super::values::{Object, Scene};
use crate::time::FrameNumber;

/// Most poses of all objects of a scene that are looked at.
const MOST_POSES: usize = 200_000;

/// True if the camera stands within the object's box at some time of the scene's frames, shutter included.
///
/// The box is that of the surfels' centres, grown by the median radius. Times are four a frame, within a total for all
/// objects of the scene that stays under a second.
pub(crate) fn camera_enters(scene: &Scene, object: &Object) -> bool {
    if object.bounds().is_empty() {
        return false;
    }
    let margin = DVec3::splat(f64::from(object.model.median_radius()));
    let [from, _] = scene.shutter.whole_exposure(scene.frames.first as f64);
    let [_, to] = scene.shutter.whole_exposure(scene.frames.last as f64);
    let most = (MOST_POSES / scene.objects.len().max(1)).clamp(8, 2000);
    let rests = scene.camera.rests() && object.is_fixed();
    let steps = if rests { 1 } else { ((4.0 * (to - from)).ceil() as usize).clamp(2, most) };
    (0..=steps).any(|i| {
        let time = from + (to - from) * i as f64 / steps as f64;
        let pose = object_pose(scene, object, time).world_from_model;
        let bounds = object.bounds_at(scene.frames.rate, time);
        let (low, high) = (bounds.min - margin, bounds.max + margin);
        let eye = (camera_from_world(scene, time) * pose).inverse().transform_point3(DVec3::ZERO);
        eye.cmpge(low).all() && eye.cmple(high).all()
    })
}

/// The likely cause why a frame shows nothing of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unseen {
    /// It has no surfels.
    Empty,
    /// Its animation hides it.
    Hidden,
    /// No file of its sequence belongs to the frame.
    NoFile,
    /// All of it is behind the camera, or nearer than `near`.
    Behind,
    /// It is beside, above or below the image.
    Outside,
    /// It is smaller than a pixel, or seen edge-on.
    Small,
    /// It shows its backs, and they are left out.
    FacingAway,
    /// It is as dark or as bright as the background.
    LikeBackground,
}

impl fmt::Display for Unseen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Empty => "without surfels",
            Self::Hidden => "hidden by an animation",
            Self::NoFile => "without a file of its sequence",
            Self::Behind => "behind the camera",
            Self::Outside => "outside the image",
            Self::Small => "too small",
            Self::FacingAway => "facing away (twoSided=\"true\" in the scene shows backs)",
            Self::LikeBackground => "of the background's colour (does light reach it?)",
        })
    }
}

/// The likely cause why frame `frame` shows nothing of `object`, judged by its box at mid-exposure. `drawn`: splats
/// were projected onto the image all the same.
pub fn why_unseen(scene: &Scene, object: &Object, frame: FrameNumber, drawn: bool) -> Unseen {
    let bounds = object.bounds();
    if bounds.is_empty() {
        return Unseen::Empty;
    }
    let time = frame.get() + 0.5 * (scene.shutter.open + scene.shutter.close);
    let bounds = object.bounds_at(scene.frames.rate, time);
    let pose = object_pose(scene, object, time);
    if !pose.visible {
        return Unseen::Hidden;
    }
    let files = |sequence: &Sequence| sequence.spec().has_files(time, time);
    if object.sequence.as_ref().is_some_and(|sequence| !files(sequence)) {
        return Unseen::NoFile;
    }
    let camera_from_model: DMat4 = camera_from_world(scene, time) * pose.world_from_model;
    // Right, up and depth in front of the camera.
    let corners =
        bounds.corners().map(|corner| camera_from_model.transform_point3(corner) * DVec3::new(1.0, 1.0, -1.0));
    let radius = f64::from(object.model.median_radius()) * libm::cbrt(pose.world_from_model.determinant().abs());
    let camera = &scene.camera;
    if corners.iter().all(|p| p.z < camera.near) {
        return Unseen::Behind;
    }
    let up = (0.5 * camera.fovy).tan();
    let right = up * f64::from(scene.image.width) / f64::from(scene.image.height);
    let beyond = |out: &dyn Fn(&DVec3) -> f64| corners.iter().all(|p| out(p) > radius);
    let DVec2 { x, y } = camera.shift * 2.0;
    let is_outside = beyond(&|p| p.x - (1.0 - x) * right * p.z)
        || beyond(&|p| -p.x - (1.0 + x) * right * p.z)
        || beyond(&|p| p.y - (1.0 + y) * up * p.z)
        || beyond(&|p| -p.y - (1.0 - y) * up * p.z);
    if is_outside {
        return Unseen::Outside;
    }
    if drawn {
        return Unseen::LikeBackground;
    }
    let nearest = corners.iter().map(|p| p.z).fold(f64::INFINITY, f64::min).max(camera.near);
    let extent = norm_of(&camera_from_model) * bounds.size().length() + 2.0 * radius;
    if extent / (nearest * up) * 0.5 * f64::from(scene.image.height) < 1.0
        || object.two_sided
        || object.model.gaussians().is_some()
    {
        return Unseen::Small;
    }
    Unseen::FacingAway
}

/// Greatest length that a unit axis becomes.
fn norm_of(m: &DMat4) -> f64 {
    [m.x_axis, m.y_axis, m.z_axis].into_iter().map(|axis| axis.truncate().length()).fold(0.0, f64::max)
}

//! Whether the camera stands within an object's box.

use glam::DVec3;

use super::pose::{camera_from_world, object_pose};
use super::values::{Object, Scene};

/// Most poses of all objects of a scene that are looked at.
const MOST_POSES: usize = 200_000;

/// True if the camera stands within the object's box at some time of the scene's frames, shutter included.
///
/// The box is that of the surfels' centres, grown by the median radius. Times are four a frame, within a total for all
/// objects of the scene that stays under a second.
pub(crate) fn camera_enters(scene: &Scene, object: &Object) -> bool {
    if object.shape.bounds().is_empty() {
        return false;
    }
    let margin = DVec3::splat(f64::from(object.shape.median_radius()));
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

//! How fine a mesh has to be sampled for a scene: 2.25 spacings a pixel where the object is nearest.

use glam::{DMat3, DVec3};

use super::pose::{camera_from_world, object_pose};
use super::values::{Object, Scene};
use crate::math::norm;

/// Least and greatest number of surfels of a mesh that a scene asks for.
pub(crate) const SURFELS: [f64; 2] = [20_000.0, 3_000_000.0];

/// Spacings of a mesh along a pixel. They blur textures: with 2 of them a random blob has a FLIP of .0105 against its
/// triangles, with 2.25 it has .0096 (docs/measurements/meshes.md).
const FINENESS: f64 = 2.25;

/// Most poses that are looked at.
const POSES: i64 = 16;

/// The spacing for the size of a pixel on the object where it is nearest to the camera, model units; `None` if it is
/// never visible.
///
/// The poses are those of up to 16 frames spread evenly over the scene's frames, the first and the last among them, at
/// mid-exposure. The nearest place is that of the object's box. A camera within the box looks from `near`.
pub(crate) fn wanted_spacing(scene: &Scene, object: &Object) -> Option<f64> {
    let bounds = object.shape.bounds();
    if bounds.is_empty() {
        return None;
    }
    let (first, last) = (scene.frames.first, scene.frames.last);
    let poses = last.saturating_sub(first).saturating_add(1).clamp(1, POSES);
    let mid = 0.5 * (scene.shutter.open + scene.shutter.close);
    let pixel = 2.0 * libm::tan(0.5 * scene.camera.fovy) / f64::from(scene.image.height);
    let at = |i: i64| {
        let share = if poses > 1 { i as f64 / (poses - 1) as f64 } else { 0.0 };
        let frame = (first as f64 + (last as f64 - first as f64) * share).round();
        let pose = object_pose(scene, object, frame + mid);
        let camera_from_model = camera_from_world(scene, frame + mid) * pose.world_from_model;
        let eye = camera_from_model.inverse().transform_point3(DVec3::ZERO);
        let nearest = camera_from_model.transform_point3(eye.clamp(bounds.min, bounds.max)).length();
        let spacing = pixel / FINENESS * nearest.max(scene.camera.near) / norm(&DMat3::from_mat4(camera_from_model));
        (pose.visible && spacing.is_finite() && spacing > 0.0).then_some(spacing)
    };
    (0..poses).filter_map(at).reduce(f64::min)
}

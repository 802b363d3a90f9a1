//! How fine the parts of a mesh have to be sampled for a scene: 2.25 spacings a pixel.

use glam::DVec2;

use super::pose::{camera_from_world, fovy, object_pose};
use super::values::{Object, Scene};
use crate::model::mesh::{Fineness, Lens};

/// Least and greatest number of surfels of a mesh that a scene asks for.
pub(crate) const SURFELS: [f64; 2] = [20_000.0, 3_000_000.0];

/// Spacings of a mesh along a pixel. They blur textures: with 2 of them a random blob has a FLIP of .0105 against its
/// triangles, with 2.25 it has .0096 (docs/measurements/meshes.md).
const FINENESS: f64 = 2.25;

/// Most poses that are looked at.
const POSES: i64 = 16;

/// The spacings for the size of a pixel on the object, by distance from the camera, and wider well beside the image.
/// Empty if it is never visible.
///
/// The poses are those of up to 16 frames spread evenly over the scene's frames, the first and the last among them, at
/// mid-exposure. Nothing counts as nearer than the camera's `near`.
pub(crate) fn wanted_fineness(scene: &Scene, object: &Object) -> Fineness {
    let mut fineness = Fineness::default();
    let (first, last) = (scene.frames.first, scene.frames.last);
    let poses = last.saturating_sub(first).saturating_add(1).clamp(1, POSES);
    let mid = 0.5 * (scene.shutter.open + scene.shutter.close);
    let size = DVec2::new(scene.image.width.into(), scene.image.height.into());
    let middle = scene.camera.shift * size * DVec2::new(-1.0, 1.0);
    for i in 0..poses {
        let share = if poses > 1 { i as f64 / (poses - 1) as f64 } else { 0.0 };
        let frame = (first as f64 + (last as f64 - first as f64) * share).round();
        let pixel = 2.0 * libm::tan(0.5 * fovy(scene, frame)) / size.y;
        let window = [middle - 0.5 * size, middle + 0.5 * size].map(|corner| corner * pixel);
        let lens = Lens { near: scene.camera.near, window, spacing: pixel / FINENESS };
        let pose = object_pose(scene, object, frame + mid);
        if pose.visible {
            let camera_from_model = camera_from_world(scene, frame + mid) * pose.world_from_model;
            fineness.add(camera_from_model, lens);
        }
    }
    fineness
}

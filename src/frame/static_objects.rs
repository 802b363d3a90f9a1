//! Which objects are static during the exposure, so that a backend can splat them once for the time samples of a
//! position.

use glam::Vec3;

use super::{PosedObject, PosedRaster, PosedSample};
use crate::scene::Scene;

/// Longest path over the screen during the exposure of an object that counts as static, pixels.
pub const STATIC_PATH: f32 = 0.25;

/// Whether each object is static. Surfels whose path is shorter than [`STATIC_PATH`] are held at their pose of
/// mid-exposure; a capture is static where its pose never changes.
///
/// `times` are those of the samples of `rasters`, one after the other; `stride` and `near` are the frame's.
pub(super) fn find_static(
    scene: &Scene,
    times: &[f64],
    rasters: &mut [PosedRaster],
    stride: u32,
    near: f32,
) -> Vec<bool> {
    let mut order: Vec<usize> = (0..times.len()).collect();
    order.sort_by(|&a, &b| times[a].total_cmp(&times[b]));
    (0..scene.objects.len())
        .map(|object| {
            let poses: Vec<&PosedObject> = samples(rasters).map(|sample| &sample.objects[object]).collect();
            let Some(first) = poses.first() else { return true };
            let differs = |pose: &PosedObject| pose.visible != first.visible || pose.elapsed != first.elapsed;
            if poses.iter().any(|pose| pose.moves || differs(pose)) {
                return false;
            }
            if !first.visible || poses.iter().all(|pose| pose == first) {
                return true;
            }
            let object_of_scene = &scene.objects[object];
            // Gaussians may be far larger than the box of their centres, and a short path may change their order.
            if object_of_scene.model.gaussians().is_some() {
                return false;
            }
            let origin = object_of_scene.model.origin;
            let drifts = object_of_scene.bounds().corners().map(|corner| {
                let corner = (corner - origin).as_vec3();
                path(order.iter().map(|&i| poses[i]), corner, near) * stride as f32
            });
            let is_static = !object_of_scene.bounds().is_empty() && drifts.into_iter().all(|drift| drift < STATIC_PATH);
            if is_static {
                let middle = *poses[order[order.len() / 2]];
                let positions = rasters.iter_mut().flat_map(|raster| &mut raster.positions);
                for sample in positions.flat_map(|p| &mut p.groups).flat_map(|group| &mut group.samples) {
                    sample.objects[object] = middle;
                }
            }
            is_static
        })
        .collect()
}

fn samples(rasters: &[PosedRaster]) -> impl Iterator<Item = &PosedSample> {
    let positions = rasters.iter().flat_map(|raster| &raster.positions);
    positions.flat_map(|position| &position.groups).flat_map(|group| &group.samples)
}

/// Length of the path of a point of the model over the raster, raster pixels; infinite where it comes nearer than
/// `near`.
fn path<'a>(poses: impl Iterator<Item = &'a PosedObject>, point: Vec3, near: f32) -> f32 {
    let mut length = 0.0;
    let mut last = None;
    for pose in poses {
        let p = pose.screen_from_model * point + pose.screen_origin;
        if p.z.is_nan() || p.z < near {
            return f32::INFINITY;
        }
        let here = p.truncate() / p.z;
        length += last.map_or(0.0, |last| here.distance(last));
        last = Some(here);
    }
    length
}

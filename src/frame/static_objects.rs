//! Which objects lie still during the exposure, so that a backend need not splat them anew for each time sample.

use glam::Vec3;

use super::{PosedGroup, PosedObject, PosedSample};
use crate::scene::Scene;

/// Longest screen path over the exposure that still counts as lying still, pixels.
pub const STILL_PATH: f32 = 0.25;

/// For each object: does it lie still? One that moves by less than [`STILL_PATH`] is held at its pose of mid-exposure.
///
/// `times` are those of the samples of `groups`, one after the other; `stride` and `near` are the frame's.
pub(super) fn hold_still(scene: &Scene, times: &[f64], groups: &mut [PosedGroup], stride: u32, near: f32) -> Vec<bool> {
    let mut order: Vec<usize> = (0..times.len()).collect();
    order.sort_by(|&a, &b| times[a].total_cmp(&times[b]));
    (0..scene.objects.len())
        .map(|object| {
            let poses: Vec<&PosedObject> = samples(groups).map(|sample| &sample.objects[object]).collect();
            let Some(first) = poses.first() else { return true };
            if poses.iter().any(|pose| pose.moves || pose.visible != first.visible) {
                return false;
            }
            if !first.visible || poses.iter().all(|pose| pose == first) {
                return true;
            }
            let object_of_scene = &scene.objects[object];
            let origin = object_of_scene.model.origin;
            let drifts = object_of_scene.bounds().corners().map(|corner| {
                let corner = (corner - origin).as_vec3();
                path(order.iter().map(|&i| poses[i]), corner, near) * stride as f32
            });
            let still = !object_of_scene.bounds().is_empty() && drifts.into_iter().all(|drift| drift < STILL_PATH);
            if still {
                let middle = *poses[order[order.len() / 2]];
                for sample in groups.iter_mut().flat_map(|group| &mut group.samples) {
                    sample.objects[object] = middle;
                }
            }
            still
        })
        .collect()
}

fn samples(groups: &[PosedGroup]) -> impl Iterator<Item = &PosedSample> {
    groups.iter().flat_map(|group| &group.samples)
}

/// Way of a point of the model over the raster, raster pixels; infinite where it comes nearer than `near`.
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

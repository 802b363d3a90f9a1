//! Path lengths of surfels on the screen.

use glam::{DVec2, DVec3};

use crate::math::focal_length;
use crate::scene::pose::{camera_from_world, object_pose};
use crate::scene::{Object, Scene};
use crate::time::FrameNumber;

/// Most surfels of an object whose paths are measured.
const MEASURED: usize = 4096;
/// Straight parts of a measured path.
const INTERVALS: u32 = 4;

/// Length of the longest path of a surfel over the image during the exposure of frame `number`, pixels. Parts of a path
/// outside the image do not count.
pub(super) fn longest(scene: &Scene, number: FrameNumber) -> f64 {
    scene.objects.iter().map(|object| of_object(scene, object, number)).fold(0.0, f64::max)
}

fn of_object(scene: &Scene, object: &Object, number: FrameNumber) -> f64 {
    let [width, height] = [scene.image.width, scene.image.height].map(f64::from);
    let focal = focal_length(height, scene.camera.fovy);
    let poses: Vec<_> = (0..=INTERVALS)
        .filter_map(|i| {
            let t = if object.blur { f64::from(i) / f64::from(INTERVALS) } else { 0.5 };
            let time = scene.shutter.frame_time(number.get(), t);
            let pose = object_pose(scene, object, time);
            pose.visible.then(|| camera_from_world(scene, time) * pose.world_from_model)
        })
        .collect();
    // An object that appears or disappears counts as one that crosses the image.
    if poses.is_empty() {
        return 0.0;
    }
    if poses.len() <= INTERVALS as usize {
        return width.max(height);
    }
    if !object.blur || poses.iter().all(|pose| *pose == poses[0]) {
        return 0.0;
    }
    let step = object.model.len().div_ceil(MEASURED).max(1);
    let on_image = |p: DVec2| p.x.abs() <= 0.5 * width && p.y.abs() <= 0.5 * height;
    let length_of = |position: DVec3| {
        let mut length = 0.0;
        let mut last: Option<DVec2> = None;
        for pose in &poses {
            let p = pose.transform_point3(position);
            let here = (-p.z >= scene.camera.near).then(|| p.truncate() * (focal / -p.z));
            if let (Some(from), Some(to)) = (last, here)
                && (on_image(from) || on_image(to))
            {
                length += from.distance(to);
            }
            last = here;
        }
        length
    };
    let positions = object.model.position.iter().step_by(step);
    positions.map(|p| length_of(p.as_dvec3() + object.model.origin)).fold(0.0, f64::max)
}

//! Path lengths of surfels and Gaussians on the screen.

use glam::{DMat4, Mat4, Vec2, Vec3};
use rayon::prelude::*;

use crate::math::focal_length;
use crate::model::paths::{Elapsed, elapsed};
use crate::scene::pose::{camera_from_world, object_pose};
use crate::scene::{Object, Scene};
use crate::time::FrameNumber;

/// Most surfels of an object whose paths are measured.
const MEASURED: usize = 4096;
/// The same of all objects together, as far as each keeps at least [`LEAST`].
const MEASURED_TOGETHER: usize = 1 << 20;
/// Surfels of an object that are measured however many objects there are.
const LEAST: usize = 32;
/// Straight parts of a measured path.
const INTERVALS: u32 = 16;

/// Length of the longest path of a surfel over the image during the exposure of frame `number`, pixels. Parts of a path
/// outside the image do not count, nor do those on which its object is hidden.
pub(super) fn longest(scene: &Scene, number: FrameNumber) -> f64 {
    let most = (MEASURED_TOGETHER / scene.objects.len().max(1)).clamp(LEAST, MEASURED);
    let delays = scene.shutter.readout.some_delays();
    let of_parts = |parts: &[Object]| {
        let at = |delay: &f64| parts.iter().map(|part| of_object(scene, part, number, *delay, most)).sum::<f64>();
        delays.iter().map(at).fold(0.0, f64::max)
    };
    // Parts of an object follow one another in time.
    let objects: Vec<&[Object]> = scene.objects.chunk_by(|_, next| next.is_part()).collect();
    objects.into_par_iter().map(of_parts).reduce(|| 0.0, f64::max)
}

/// The same for `object`, by the paths of about `most` surfels, while the pixels are exposed that are read out with
/// this delay (frames).
fn of_object(scene: &Scene, object: &Object, number: FrameNumber, delay: f64, most: usize) -> f64 {
    if !object.blur {
        return 0.0;
    }
    let focal = focal_length(f64::from(scene.image.height), scene.camera.fovy) as f32;
    let [width, height] = [scene.image.width, scene.image.height].map(|pixels| pixels as f32);
    let near = scene.camera.near as f32;
    let paths = object.shape.paths();
    let origin = object.shape.origin();
    let poses = (0..=INTERVALS).map(|i| {
        let time = scene.shutter.frame_time(number.get(), f64::from(i) / f64::from(INTERVALS)) + delay;
        let pose = object_pose(scene, object, time);
        let travelled = if paths.is_empty() { 0.0 } else { object.travelled(scene.frames.rate, number.get(), time) };
        let elapsed = elapsed(travelled).map(|factor| factor as f32);
        // In single precision, whose errors are far below a pixel.
        let camera_from_model = || camera_from_world(scene, time) * pose.world_from_model;
        pose.visible.then(|| ((camera_from_model() * DMat4::from_translation(origin)).as_mat4(), elapsed))
    });
    let poses: Vec<Option<(Mat4, Elapsed<f32>)>> = poses.collect();
    if poses.iter().all(|pose| *pose == poses[0]) {
        return 0.0;
    }
    let step = object.shape.elements().div_ceil(most).max(1);
    let axis = scene.camera.shift.as_vec2() * Vec2::new(width, height);
    // y is up here, and down in the image.
    let on_image = |p: Vec2| (p.x + axis.x).abs() <= 0.5 * width && (axis.y - p.y).abs() <= 0.5 * height;
    let length_of = |index: usize, position: Vec3| {
        let mut length = 0.0_f32;
        let mut last: Option<Vec2> = None;
        for pose in &poses {
            let p = pose.map(|(pose, elapsed)| pose.transform_point3(paths.place(position, index, elapsed)));
            let here = p.filter(|p| -p.z >= near).map(|p| p.truncate() * (focal / -p.z));
            if let (Some(from), Some(to)) = (last, here)
                && (on_image(from) || on_image(to))
            {
                length += from.distance(to);
            }
            last = here;
        }
        length
    };
    let positions = object.shape.positions().iter().enumerate().step_by(step);
    positions.map(|(index, &position)| length_of(index, position)).fold(0.0, f32::max).into()
}

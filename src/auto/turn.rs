//! How far objects turn from one time sample to the next.

use glam::{DMat4, DQuat};

use crate::math::angle_between;
use crate::scene::pose::{camera_from_world, object_pose};
use crate::scene::{Object, Scene};
use crate::time::FrameNumber;

/// Parts of the exposure in which nothing is taken to turn by more than half a turn.
const INTERVALS: u32 = 64;

/// Largest angle by which an object turns before the camera during the exposure of frame `number`, radians, all turns
/// together.
pub(super) fn largest(scene: &Scene, number: FrameNumber) -> f64 {
    let delays = scene.shutter.readout.some_delays();
    let of = |object| delays.iter().map(move |&delay| of_object(scene, object, number, delay)).fold(0.0, f64::max);
    scene.objects.iter().map(of).fold(0.0, f64::max)
}

fn of_object(scene: &Scene, object: &Object, number: FrameNumber, delay: f64) -> f64 {
    if !object.blur || object.is_fixed() && scene.camera.rests() {
        return 0.0;
    }
    let turn = |i: u32| {
        let time = scene.shutter.frame_time(number.get(), f64::from(i) / f64::from(INTERVALS)) + delay;
        let pose: DMat4 = camera_from_world(scene, time) * object_pose(scene, object, time).world_from_model;
        pose.to_scale_rotation_translation().1
    };
    let turns: Vec<DQuat> = (0..=INTERVALS).map(turn).collect();
    let angles = turns.windows(2).map(|pair| angle_between(pair[0], pair[1]));
    angles.filter(|angle| angle.is_finite()).sum()
}

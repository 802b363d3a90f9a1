//! Where things are at a time: scene and frame time to transforms.

use glam::{DMat3, DMat4, DVec3};

use crate::math::rotation;
use crate::scene::{Camera, Motion, Object, Scene};

/// An object at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectPose {
    /// Model space to world space.
    pub world_from_model: DMat4,
    /// False where the animation hides the object.
    pub visible: bool,
}

/// World-space pose of an object at scene time `frame_time` (frames).
pub fn object_pose(scene: &Scene, object: &Object, frame_time: f64) -> ObjectPose {
    let mut m = object.transform.matrix();
    let mut visible = true;
    if let Some(binding) = &object.animation {
        let state = binding.node.at(seconds(scene, frame_time), binding.interpolation);
        visible = state.visible;
        m = state.transform.matrix() * m;
    }
    for motion in &object.motions {
        m = motion_matrix(motion, frame_time) * m;
    }
    ObjectPose { world_from_model: object.place.matrix() * m, visible }
}

/// Rigid transform from world space to camera space (-z forward, +y up) at scene time `frame_time` (frames).
pub fn camera_from_world(scene: &Scene, frame_time: f64) -> DMat4 {
    let camera = &scene.camera;
    camera.animation.as_ref().map_or_else(
        || look_at(camera),
        |binding| {
            let state = binding.node.at(seconds(scene, frame_time), binding.interpolation);
            // Scale on a camera node means nothing: only its axes and position count.
            let mut rigid = state.transform;
            rigid.scale = DVec3::ONE;
            rigid_inverse(&rigid.matrix())
        },
    )
}

fn seconds(scene: &Scene, frame_time: f64) -> f64 {
    frame_time / scene.frames.rate
}

fn motion_matrix(motion: &Motion, frame_time: f64) -> DMat4 {
    match *motion {
        Motion::Linear { velocity } => DMat4::from_translation(velocity * frame_time),
        Motion::Rotation { axis, per_frame, centre } => {
            let r = rotation(axis, per_frame * frame_time);
            DMat4::from_mat3_translation(r, centre - r * centre)
        }
    }
}

fn look_at(camera: &Camera) -> DMat4 {
    let back = (camera.eye - camera.at).normalize();
    let right = camera.up.cross(back).normalize();
    let up = back.cross(right);
    rigid_inverse(&DMat4::from_mat3_translation(DMat3::from_cols(right, up, back), camera.eye))
}

/// Inverse of a rotation and translation.
fn rigid_inverse(m: &DMat4) -> DMat4 {
    let r = DMat3::from_mat4(*m).transpose();
    DMat4::from_mat3_translation(r, -(r * m.w_axis.truncate()))
}

//! Objects and cameras that go through poses of a program.

use std::path::PathBuf;

use glam::DMat4;

use super::values::AnimationBinding;
use crate::anim::{Chain, Interpolation, NodeMotion};
use crate::limits::Invalid;

impl AnimationBinding {
    /// A motion through poses at `frames`, in a scene of `rate` frames per second, for [`Object::animation`] or
    /// [`Camera::animation`].
    ///
    /// A pose takes the space of the node to the world: an object's model after its `transform`, or a camera that looks
    /// along its -z with +y up. Between two poses the translation and each scale change at constant speed, and the
    /// rotation turns at constant speed the shorter way (slerp). Before the first and after the last pose, the node
    /// rests. A camera ignores scale. For curved paths, give a pose for each frame or more.
    ///
    /// A scene file cannot hold such a motion, which has no file.
    ///
    /// ```
    /// use splatblur::glam::{DMat4, DVec3};
    /// use splatblur::{AnimationBinding, Camera};
    ///
    /// let frames = [0.0, 12.0, 24.0];
    /// let poses = [0.0, 0.5, 2.0].map(|x| DMat4::from_translation(DVec3::new(x, 0.0, 5.0)));
    /// let mut camera = Camera::new(DVec3::ZERO, DVec3::NEG_Z);
    /// camera.animation = Some(AnimationBinding::from_poses(24.0, &frames, &poses)?);
    /// # Ok::<(), splatblur::Invalid>(())
    /// ```
    ///
    /// # Errors
    /// There is no pose, or not one for each time; times do not rise; a number is out of its bounds; a matrix is
    /// singular, not finite, or more than translation, rotation and scale; some mirror and some do not.
    ///
    /// [`Object::animation`]: super::Object::animation
    /// [`Camera::animation`]: super::Camera::animation
    pub fn from_poses(rate: f64, frames: &[f64], poses: &[DMat4]) -> Result<Self, Invalid> {
        let node = NodeMotion::from(Chain::through(rate, frames, poses)?);
        Ok(Self { path: PathBuf::new(), node, interpolation: Interpolation::Linear })
    }
}

//! The views of a dataset, in the order in which its readers have them.

use glam::DMat4;

use super::files::{Role, files};
use super::{MIDDLE, Recipe, shaken};
use crate::limits::Invalid;
use crate::math::focal_length;
use crate::scene::Scene;
use crate::scene::pose::{camera_from_world, fovy};
use crate::time::FrameNumber;

/// The picture of a frame in `images/`, and its camera.
pub(super) struct View {
    /// The name of the file, without its folder.
    pub(super) name: String,
    pub(super) frame: FrameNumber,
    /// The camera in the middle of the shutter: it looks along -z, and +y is up.
    pub(super) camera_from_world: DMat4,
    /// Focal length, pixels.
    pub(super) focal: f64,
}

/// The views of these frames, sorted by name.
///
/// # Errors
/// Poses of a camera that shakes are out of their bounds.
pub(super) fn views(scene: &Scene, frames: &[FrameNumber], recipe: &Recipe, seed: u64) -> Result<Vec<View>, Invalid> {
    let view = |&frame: &FrameNumber| {
        let time = scene.shutter.frame_time(frame.get(), MIDDLE);
        Ok(View {
            name: picture(scene, frame, recipe).rsplit('/').next().unwrap_or_default().to_owned(),
            frame,
            camera_from_world: camera_from_world(&*shaken(scene, frame, recipe, seed)?, time),
            focal: focal_of(scene, frame),
        })
    };
    let mut views = frames.iter().map(view).collect::<Result<Vec<View>, Invalid>>()?;
    views.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(views)
}

/// The picture of a frame among those that readers find: the blurred one, or the sharp one of a view that is held out.
pub(super) fn picture(scene: &Scene, frame: FrameNumber, recipe: &Recipe) -> String {
    let wanted = if recipe.holds_out(frame) { Role::Held } else { Role::Blur };
    let file = files(&scene.name, frame, recipe).into_iter().find(|file| file.role == wanted);
    file.map_or_else(String::new, |file| file.path)
}

/// Focal length of a frame, pixels.
pub(super) fn focal_of(scene: &Scene, frame: FrameNumber) -> f64 {
    focal_length(f64::from(scene.image.height), fovy(scene, frame.get()))
}

/// Where the camera's axis meets the image, pixels from its left upper corner.
pub(super) fn principal_point(scene: &Scene) -> [f64; 2] {
    let size = [scene.image.width, scene.image.height].map(f64::from);
    [(0.5 + scene.camera.shift.x) * size[0], (0.5 + scene.camera.shift.y) * size[1]]
}

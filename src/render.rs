//! The driver: a scene and a frame number to a picture.

use crate::backend::{Backend, BackendError};
use crate::frame::Frame;
use crate::plan::RenderOptions;
use crate::scene::Scene;

pub use crate::backend::{Rendered, Stats};

/// Renders one frame of a scene.
///
/// # Errors
/// The backend cannot render the frame within its limits, or the scene holds what only the reference can show.
pub fn render_frame(
    backend: &mut dyn Backend,
    scene: &Scene,
    frame: i64,
    options: &RenderOptions,
) -> Result<Rendered, BackendError> {
    if let Some(object) = scene.objects.iter().find(|object| object.sphere.is_some()) {
        return Err(BackendError::Sphere { object: object.name.clone() });
    }
    backend.render(&Frame::new(scene, frame, options))
}

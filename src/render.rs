//! The driver: a scene and a frame number to a picture.

use crate::backend::{Backend, BackendError};
use crate::frame::Frame;
use crate::plan::RenderOptions;
use crate::scene::Scene;

pub use crate::backend::{Rendered, Stats};

/// Renders one frame of a scene.
///
/// # Errors
/// The backend cannot render the frame within its limits.
pub fn render_frame(
    backend: &mut dyn Backend,
    scene: &Scene,
    frame: i64,
    options: &RenderOptions,
) -> Result<Rendered, BackendError> {
    backend.render(&Frame::new(scene, frame, options))
}

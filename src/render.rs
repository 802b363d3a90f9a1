//! The driver: a scene and a frame number to a picture.

use std::time::Duration;

use crate::backend::BackendError;
use crate::backend::cpu::Cpu;
use crate::film::Picture;
use crate::plan::RenderOptions;
use crate::scene::Scene;

/// What one frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stats {
    /// Time samples.
    pub samples: u64,
    /// Surfels posed, over all time samples.
    pub surfels: u64,
    /// Splats that reached the image, over all time samples.
    pub splats: u64,
    /// CPU time of `project` and `bin`, over all threads.
    pub project: Duration,
    /// CPU time of `visibility`, over all threads.
    pub visibility: Duration,
    /// CPU time of `attribute`, over all threads.
    pub attribute: Duration,
    /// CPU time of `resolve`, over all threads.
    pub resolve: Duration,
}

/// A picture, and what it took.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// The picture.
    pub picture: Picture,
    /// What it took.
    pub stats: Stats,
}

/// Renders one frame of a scene.
///
/// # Errors
/// The backend cannot render the frame within its limits.
pub fn render_frame(
    _cpu: &mut Cpu,
    scene: &Scene,
    _frame: i64,
    _options: &RenderOptions,
) -> Result<Rendered, BackendError> {
    let (width, height) = (scene.image.width, scene.image.height);
    let rgba = vec![[0.0; 4]; width as usize * height as usize];
    Ok(Rendered { picture: Picture { width, height, rgba, layers: Vec::new() }, stats: Stats::default() })
}

//! Machines that execute a plan.

pub mod cpu;

use std::time::Duration;

use crate::film::Picture;
use crate::frame::Frame;

/// A machine that executes plans. It knows passes, and nothing about blur modes, scenes or files.
pub trait Backend {
    /// Name and size of the machine, for people.
    fn describe(&self) -> String;

    /// Executes a frame's plan.
    ///
    /// # Errors
    /// The frame does not fit into the machine's limits.
    fn render(&mut self, frame: &Frame<'_>) -> Result<Rendered, BackendError>;
}

/// A picture, and what it took.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// The picture.
    pub picture: Picture,
    /// What it took.
    pub stats: Stats,
}

/// Why a backend could not render.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BackendError {
    /// An ideal sphere has no surfels to splat.
    #[error("object `{object}` is an ideal sphere, which only the reference can show")]
    Sphere {
        /// Name of the object.
        object: String,
    },
    /// The frame does not fit into the memory that it may take.
    #[error(
        "a frame of {width} x {height} and models of {models} bytes need at least {needed} bytes, but may take {allowed} \
         (--memory)"
    )]
    Memory {
        /// Image width.
        width: u32,
        /// Image height.
        height: u32,
        /// Bytes of the models.
        models: u64,
        /// Smallest workable budget, bytes.
        needed: u64,
        /// Budget, bytes.
        allowed: u64,
    },
}

/// What one frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stats {
    /// Time samples.
    pub samples: u64,
    /// Surfels posed, over all time samples.
    pub surfels: u64,
    /// Splats projected onto the image, over all time samples; where they pass in waves (`--memory`), once for each pass.
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

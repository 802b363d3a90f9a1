//! The CPU backend.

use crate::backend::BackendError;
use crate::film::Picture;
use crate::plan::RenderOptions;
use crate::scene::Scene;

/// Executes plans on the CPU, with the threads of the current rayon pool.
#[derive(Debug, Default)]
pub struct Cpu {}

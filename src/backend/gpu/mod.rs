//! The GPU backend: the passes as compute programs (`shaders/`), on any device that wgpu reaches.
//!
//! Surfels of a group are cut into waves, the image into bands, so that every buffer fits; nothing is read back before the
//! frame is done. Lists are in global surfel order and floats are summed by one invocation for each pixel, so the same frame
//! gives the same bytes on the same device. What is on the device, and who writes it: docs/architecture.md.

mod bindings;
mod buffers;
mod clock;
mod device;
mod execute;
mod film;
mod layout;
mod models;
mod programs;
mod schedule;
#[cfg(test)]
mod tests;

use self::buffers::Buffers;
use self::clock::Clock;
use self::device::Device;
pub use self::device::{AdapterReport, Choice, adapters};
use self::models::Models;
use self::programs::Pipelines;
use super::{Backend, BackendError, Rendered};
use crate::frame::Frame;

/// Executes plans on a GPU, or on a processor that pretends to be one.
#[derive(Debug)]
pub struct Gpu {
    machine: Machine,
}

/// The device and everything that is kept on it between frames.
#[derive(Debug)]
struct Machine {
    device: Device,
    pipelines: Pipelines,
    models: Models,
    buffers: Buffers,
    clock: Option<Clock>,
}

impl Gpu {
    /// Opens the best of the adapters that are wanted.
    ///
    /// # Errors
    /// There is none, or it lacks what the passes need.
    pub fn open(choice: &Choice) -> Result<Self, BackendError> {
        let device = Device::open(choice)?;
        let buffers = Buffers::new(&device)?;
        let clock = Clock::new(&device)?;
        device.check()?;
        Ok(Self {
            machine: Machine { device, pipelines: Pipelines::default(), models: Models::default(), buffers, clock },
        })
    }

    /// Name of the adapter.
    pub fn adapter(&self) -> &str {
        &self.machine.device.adapter.name
    }

    /// Bytes of a buffer that a program can reach.
    fn most_bytes(&self) -> u64 {
        self.machine.device.most_bytes()
    }
}

impl Backend for Gpu {
    fn describe(&self) -> String {
        format!("gpu ({})", self.adapter())
    }

    fn render(&mut self, frame: &Frame<'_>) -> Result<Rendered, BackendError> {
        self.execute(frame)
    }
}

//! Machines that execute a plan.

mod clusters;
pub mod cpu;
mod error;
#[cfg(feature = "gpu")]
pub mod gpu;
mod stats;

use crate::film::Picture;
use crate::frame::Frame;

pub use self::error::BackendError;
pub use self::stats::{Achieved, Rendered, Stats};

/// A machine that executes plans. It knows passes, and nothing about blur modes, scenes or files.
pub trait Backend: Send {
    /// Name and size of the machine, for people.
    fn describe(&self) -> String;

    /// Frames that may be begun and not finished: one where `begin` does the work, two where the host can prepare the next
    /// while the device renders.
    fn in_flight(&self) -> usize;

    /// Begins to execute a frame's plan. Frames are finished in the order in which they were begun.
    ///
    /// # Errors
    /// The frame does not fit into the machine's limits.
    fn begin(&mut self, frame: &Frame<'_>) -> Result<(), BackendError>;

    /// Finishes the oldest frame. `None`: there is none, or it turned out to need more room, which there is now; it must be
    /// begun again.
    ///
    /// # Errors
    /// The frame does not fit into the machine's limits.
    fn finish(&mut self) -> Result<Option<Rendered>, BackendError>;

    /// Takes back a picture that is no longer needed, so that a later one can have its memory.
    fn recycle(&mut self, _picture: Picture) {}

    /// Executes a frame's plan, with no other under way.
    ///
    /// # Errors
    /// The frame does not fit into the machine's limits.
    fn render(&mut self, frame: &Frame<'_>) -> Result<Rendered, BackendError> {
        loop {
            self.begin(frame)?;
            if let Some(rendered) = self.finish()? {
                return Ok(rendered);
            }
        }
    }
}

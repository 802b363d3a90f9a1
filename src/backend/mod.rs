//! Backends: what executes a plan.

mod clusters;
pub mod cpu;
mod error;
#[cfg(feature = "gpu")]
pub mod gpu;
mod meter;
#[cfg(all(test, feature = "gpu"))]
mod parity;
mod stats;

use std::sync::Arc;

use crate::film::Picture;
use crate::frame::Frame;
use crate::stop::Stop;

pub use self::error::BackendError;
pub use self::meter::{Meter, Reading};
pub use self::stats::{Achieved, GpuCalls, Pixels, Rendered, Stats, Waste};

/// What executes plans. It knows the steps of a frame, and nothing about blur modes, scenes or files.
pub trait Backend: Send {
    /// Its name and size, for people.
    fn describe(&self) -> String;

    /// Frames of a sequence that may be under way together. One where [`begin`](Self::begin) does the work; two where
    /// the host can prepare a frame while the device renders another. A frame may take several renderings.
    fn in_flight(&self) -> usize;

    /// Begins to execute a frame's plan. Frames are finished in the order in which they were begun.
    ///
    /// # Errors
    /// The frame does not fit into the limits of the backend.
    fn begin(&mut self, frame: Frame) -> Result<(), BackendError>;

    /// Finishes the oldest frame; `None` where none is under way. A frame that turns out to need more memory is
    /// rendered again.
    ///
    /// # Errors
    /// The frame does not fit into the limits of the backend.
    fn finish(&mut self) -> Result<Option<Rendered>, BackendError>;

    /// Takes back a picture that is no longer needed, so that a later one can have its memory.
    fn recycle(&mut self, _picture: Picture) {}

    /// Counts its steps on `meter` from now on, where it can tell them apart.
    fn watch(&mut self, _meter: Arc<Meter>) {}

    /// Counts from now on what bounds of splats waste ([`Stats::waste`]), where it can.
    fn count_waste(&mut self) {}

    /// Ends a frame with [`BackendError::Stopped`] soon after `stop` is set, where it can end before the frame does.
    fn heed(&mut self, stop: Arc<Stop>);

    /// What it heeds.
    fn stop(&self) -> Arc<Stop>;

    /// Gives up the frame that was begun last and is not finished, if there is any.
    fn abandon(&mut self);

    /// Executes a frame's plan, with no other under way.
    ///
    /// # Errors
    /// The frame does not fit into the limits of the backend.
    fn render(&mut self, frame: Frame) -> Result<Rendered, BackendError> {
        self.begin(frame)?;
        let Some(rendered) = self.finish()? else { unreachable!("a frame was begun") };
        Ok(rendered)
    }
}

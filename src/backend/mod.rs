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

    /// Frames that may be begun and not finished. One where `begin` does the work; two where the host can prepare the
    /// next frame while the device renders.
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

    /// Executes a frame's plan, with no other under way.
    ///
    /// # Errors
    /// The frame does not fit into the limits of the backend.
    fn render(&mut self, frame: Frame) -> Result<Rendered, BackendError>;

    /// The same for two frames, which are made when they are needed. A backend may have both under way.
    ///
    /// # Errors
    /// As [`Self::render`], or those of making a frame.
    fn render_two(
        &mut self,
        frame: &dyn Fn(usize) -> Result<Frame, BackendError>,
    ) -> Result<[Rendered; 2], BackendError> {
        Ok([self.render(frame(0)?)?, self.render(frame(1)?)?])
    }
}

//! Machines that execute a plan.

mod clusters;
pub mod cpu;
#[cfg(feature = "gpu")]
pub mod gpu;

use std::fmt;
use std::time::Duration;

use crate::film::Picture;
use crate::frame::Frame;

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
    /// There is no device to render on.
    #[error(
        "there is no graphics adapter{wanted} (found: {found}); a GPU needs its Vulkan driver and the Vulkan loader (Debian: \
         libvulkan1), a software device mesa-vulkan-drivers"
    )]
    NoAdapter {
        /// What it was looked for by, with a space in front; empty for any.
        wanted: String,
        /// Names of those that there are.
        found: String,
    },
    /// The device refused, or lacks something.
    #[error("{adapter}: {what}")]
    Device {
        /// Name of the adapter.
        adapter: String,
        /// What it says or lacks.
        what: String,
    },
}

impl BackendError {
    /// Refuses a frame that needs more bytes than it may take, `needed` being the least with which its backend can work.
    fn check_memory(frame: &Frame<'_>, needed: u64) -> Result<(), Self> {
        if needed <= frame.memory {
            return Ok(());
        }
        let [width, height] = frame.size;
        Err(Self::Memory { width, height, models: frame.model_bytes, needed, allowed: frame.memory })
    }
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
    /// Time of `project`: on the CPU that of all threads, `bin` included; on a device as its clock has it.
    pub project: Duration,
    /// Time of `bin`, where it is measured apart.
    pub bin: Duration,
    /// Time of `visibility`.
    pub visibility: Duration,
    /// Time of `attribute`.
    pub attribute: Duration,
    /// Time of `resolve`.
    pub resolve: Duration,
    /// What mode auto reached.
    pub achieved: Option<Achieved>,
}

/// What mode auto reached, and by what.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Achieved {
    /// Root mean squared error of the display values, as estimated.
    pub error: f64,
    /// Longest way of a surfel over the screen, pixels.
    pub way: f64,
    /// Time samples that each pixel began with.
    pub samples: u32,
    /// Time samples of a pixel where there are most.
    pub most_samples: u32,
    /// Pixels of the lattice whose pixels see different times, along both axes.
    pub interleave: u32,
    /// Blocks of the image.
    pub blocks: u32,
    /// Blocks that were refined.
    pub refined: u32,
    /// Blocks that needed more samples than are allowed.
    pub capped: u32,
}

impl fmt::Display for Achieved {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { error, samples, most_samples, refined, blocks, capped, .. } = self;
        write!(f, "error {error:.4} with {samples} samples of a pixel")?;
        if most_samples > samples {
            write!(f, ", up to {most_samples} in {refined} of {blocks} blocks")?;
        }
        if *capped > 0 {
            write!(f, "; {capped} blocks needed more than are allowed (--samples-max)")?;
        }
        Ok(())
    }
}

impl Stats {
    /// Adds what another part of the same frame took.
    pub(crate) fn add(&mut self, other: &Self) {
        self.samples += other.samples;
        self.surfels += other.surfels;
        self.splats += other.splats;
        self.project += other.project;
        self.bin += other.bin;
        self.visibility += other.visibility;
        self.attribute += other.attribute;
        self.resolve += other.resolve;
    }

    /// Samples and surfels of a frame, before anything is measured.
    fn of(frame: &Frame<'_>) -> Self {
        let samples: u64 = frame.groups.iter().map(|group| group.samples.len() as u64).sum();
        let surfels: u64 = frame.objects.iter().map(|object| object.surfels.len() as u64).sum();
        Self { samples, surfels: samples * surfels, ..Self::default() }
    }
}

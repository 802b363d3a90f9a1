//! A picture, and what it took.

use std::fmt;
use std::time::Duration;

use crate::film::Picture;
use crate::frame::Frame;

/// A picture, and what it took.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// The picture.
    pub picture: Picture,
    /// What it took.
    pub stats: Stats,
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
    pub(super) fn of(frame: &Frame) -> Self {
        let samples: u64 = frame.groups().map(|group| group.samples.len() as u64).sum();
        let surfels: u64 = frame.objects.iter().map(|object| object.surfels.len() as u64).sum();
        Self { samples, surfels: samples * surfels, ..Self::default() }
    }
}

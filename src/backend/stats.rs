//! A picture, and the statistics of rendering it.

use std::fmt;
use std::time::Duration;

use crate::film::Picture;
use crate::frame::Frame;

/// A rendered frame: the picture, and the statistics of rendering it.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// The picture.
    pub picture: Picture,
    /// Counts and times.
    pub stats: Stats,
}

/// Counts and times of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stats {
    /// Time samples.
    pub samples: u64,
    /// Surfels and Gaussians posed, over all time samples.
    pub surfels: u64,
    /// Splats projected onto the image, over all time samples. A splat counts once for each batch that it is in: where
    /// memory is short ([`RenderOptions::memory`]), splats pass in batches.
    ///
    /// [`RenderOptions::memory`]: crate::options::RenderOptions::memory
    pub splats: u64,
    /// Pixels, over all groups of time samples, at which more layers of see-through surfels lie one behind the other
    /// than are composited ([`LAYERS`](crate::plan::LAYERS)). The farther ones are left out there.
    pub left_out: u64,
    /// Time of `project`. On the CPU: the sum over all threads. On a GPU: by the device's clock.
    pub project: Duration,
    /// Time of `sort`, of splats of captures.
    pub sort: Duration,
    /// Time of `bin`.
    pub bin: Duration,
    /// Time of `visibility`.
    pub visibility: Duration,
    /// Time of `attribute`.
    pub attribute: Duration,
    /// Time of `composite`, of splats of captures.
    pub composite: Duration,
    /// Time of `resolve`.
    pub resolve: Duration,
    /// The result of mode auto; `None` for a blur mode with given samples.
    pub achieved: Option<Achieved>,
    /// Estimated error by colours and outlines that surfels leave out which take the place of finer ones
    /// ([`Detail`](crate::options::Detail)): root mean square of display values over the image.
    pub detail: f64,
    /// Calls to the device that the frame took; `None` on the CPU.
    pub gpu: Option<GpuCalls>,
    /// What bounds of splats waste, where it was counted: on the CPU, where someone asked for it.
    pub waste: Waste,
}

/// Calls to a GPU, which cost time beside the work of its passes; and how well passes that walk over lists of splats
/// use it (docs/gpu.md).
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct GpuCalls {
    /// Submissions to its queue.
    pub submissions: u64,
    /// Times that the host waited for it while it had no other work, so that it stood still afterwards.
    pub waits: u64,
    /// Buffers that were mapped into the host's memory.
    pub maps: u64,
    /// Dispatches.
    pub dispatches: u64,
    /// Writes to its buffers.
    pub writes: u64,
    /// Bind groups that were made.
    pub bind_groups: u64,
    /// Bytes of all writes.
    pub bytes_up: u64,
    /// Bytes that were copied to those.
    pub bytes_down: u64,
    /// Sum over the passes that walk over lists of the entries of the longest list: steps that come one after the
    /// other.
    pub chain: u64,
    /// Number of those passes.
    pub walks: u64,
    /// Mean over them of the share of a large GPU (270,336 invocations) that pixels of tiles with entries keep busy, in
    /// \[0, 1\].
    pub fill: f64,
}

impl std::ops::AddAssign for GpuCalls {
    fn add_assign(&mut self, other: Self) {
        let Self {
            submissions,
            waits,
            maps,
            dispatches,
            writes,
            bind_groups,
            bytes_up,
            bytes_down,
            chain,
            walks,
            fill,
        } = other;
        let filled = self.fill * self.walks as f64 + fill * walks as f64;
        self.submissions += submissions;
        self.waits += waits;
        self.maps += maps;
        self.dispatches += dispatches;
        self.writes += writes;
        self.bind_groups += bind_groups;
        self.bytes_up += bytes_up;
        self.bytes_down += bytes_down;
        self.chain += chain;
        self.walks += walks;
        self.fill = if self.walks > 0 { filled / self.walks as f64 } else { 0.0 };
    }
}

/// The pixels that passes look at for each splat, and those that it covers. A splat that is tight in its bounds covers
/// pi / 4 of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Waste {
    /// Pass `visibility`: discs.
    pub visibility: Pixels,
    /// Pass `attribute`: kernels, with what a prefilter adds to them.
    pub attribute: Pixels,
    /// Pass `composite`: Gaussians of captures, and kernels of volumes.
    pub composite: Pixels,
}

/// Pixels, summed over splats. Pixels and splats count as often as a pass looks at them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pixels {
    /// Within the bounds of the splats, whole pixels.
    pub bounded: u64,
    /// Pixels among them that the splats cover, hidden or not.
    pub covered: u64,
}

impl Pixels {
    /// Bounded over covered; `None` where nothing was counted or covered.
    pub fn waste(self) -> Option<f64> {
        (self.covered > 0).then(|| self.bounded as f64 / self.covered as f64)
    }
}

impl std::ops::AddAssign for Pixels {
    fn add_assign(&mut self, other: Self) {
        self.bounded += other.bounded;
        self.covered += other.covered;
    }
}

/// The result of mode auto: the error that it estimates, and the samples that it took.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Achieved {
    /// Estimated root mean square error of the display values, [`Stats::detail`] included.
    pub error: f64,
    /// Longest path of a surfel over the screen during the exposure, pixels.
    #[serde(rename = "way")]
    pub path_length: f64,
    /// Largest angle by which an object turns from one of the first time samples to the next, degrees. What repeats at
    /// that angle, as the spokes of a wheel do, seems to stand still, and the estimate does not see that.
    pub turn: f64,
    /// Time samples that each pixel began with.
    pub samples: u32,
    /// Time samples of the pixel that has most.
    pub most_samples: u32,
    /// Edge of the lattice of interleaved sampling, pixels: 1, 2 or 4.
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
        let Self { error, turn, samples, most_samples, refined, blocks, capped, .. } = self;
        write!(f, "error {error:.4} with {samples} samples of a pixel")?;
        if most_samples > samples {
            write!(f, ", up to {most_samples} in {refined} of {blocks} blocks")?;
        }
        if *capped > 0 {
            write!(f, "; {capped} blocks needed more than are allowed (ErrorTarget::samples_max)")?;
        }
        if *turn >= Self::WIDE_TURN {
            write!(
                f,
                "; something turns by {turn:.0} degrees from sample to sample: what repeats at that angle (spokes) \
                 seems to stand, and the estimate does not see it"
            )?;
        }
        Ok(())
    }
}

impl Achieved {
    /// From this turn on, degrees, spokes of wheels may stand: few wheels have more than 30.
    const WIDE_TURN: f64 = 12.0;
}

impl Stats {
    /// Adds the counts and times of another part of the same frame.
    pub(crate) fn add(&mut self, other: &Self) {
        self.samples += other.samples;
        self.surfels += other.surfels;
        self.splats += other.splats;
        self.left_out += other.left_out;
        self.project += other.project;
        self.sort += other.sort;
        self.bin += other.bin;
        self.visibility += other.visibility;
        self.attribute += other.attribute;
        self.composite += other.composite;
        self.resolve += other.resolve;
        if let Some(calls) = other.gpu {
            *self.gpu.get_or_insert_default() += calls;
        }
        self.waste.visibility += other.waste.visibility;
        self.waste.attribute += other.waste.attribute;
        self.waste.composite += other.waste.composite;
    }

    /// Adds the error by detail that is left out to what is stated.
    pub(crate) fn add_detail(&mut self, error: f64) {
        self.detail = self.detail.hypot(error);
        if let Some(achieved) = &mut self.achieved {
            achieved.error = achieved.error.hypot(error);
        }
    }

    /// Samples and surfels of a frame, before anything is measured.
    pub(super) fn of(frame: &Frame) -> Self {
        let samples: u64 = frame.groups().map(|group| group.samples.len() as u64).sum();
        let surfels: u64 = frame.objects.iter().map(|object| object.shape.elements() as u64).sum();
        Self { samples, surfels: samples * surfels, ..Self::default() }
    }
}

//! What one group of time samples accumulates in one tile.

use super::paint::PaintBuffers;
use super::published::PublishedMask;
use super::tiles::{ROWS, STRIDE, TILE};
use super::transparent::see_through::cover::PeelBuffers;

/// What one group accumulates in one tile.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct TileBuffers {
    /// Weighted sums of kernels in motion: for each of `ROWS` rows, for each channel, `STRIDE` floats.
    pub sums: Vec<f32>,
    /// Coverage by the samples of a group that has several; empty for a group of one sample.
    pub group_coverage: GroupCoverage,
    /// When kernels in motion cover; empty where there are none.
    pub coverage_mask: CoverageMask,
    /// The same of published kernels.
    pub published_mask: PublishedMask,
    /// The visibility of kernels in motion; empty where there are none.
    pub slices: Slices,
    /// Depths and sums of kernels at instants.
    pub paint: PaintBuffers,
    /// What see-through surfels cover; empty where there are none.
    pub peel: PeelBuffers,
}

/// The visibility of kernels in motion in each slice of the interval: for each of `TILE` rows, for each slice,
/// `STRIDE` floats.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Slices {
    /// Number of slices, a power of two, at most 32.
    pub count: usize,
    /// Greatest visible depth, +inf where nothing covers.
    pub threshold: Vec<f32>,
    /// Depth of the nearest kernel, likewise; empty where all objects have one tolerance.
    pub nearest: Vec<f32>,
}

/// When kernels in motion cover, one bit each 32nd of the interval: `TILE` rows of `STRIDE`.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct CoverageMask {
    /// Discs.
    pub surface: Vec<u32>,
    /// Filtered kernels.
    pub filtered: Vec<u32>,
    /// Sum of the weights of what covers, visible or hidden; where the sum of weights is the coverage, sum of all
    /// visible weights.
    pub loose: Vec<f32>,
    /// The same sum of weight times peak, and of weights that are negative for kernels that show their backs.
    pub peak: Vec<f32>,
    pub side: Vec<f32>,
}

/// Coverage by the samples of a group, one after the other: `ROWS` rows of `STRIDE`.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct GroupCoverage {
    /// Sample whose splats are being added; `None` while static objects are added.
    pub sample: Option<usize>,
    /// Coverage by that sample, not yet cut at 1: at least 1 where a splat covers, else the weights of the low-pass
    /// discs.
    pub sample_coverage: Vec<f32>,
    /// The part of `sample_coverage` that all samples share: coverage by static objects.
    pub of_static: Vec<f32>,
    /// Sum over the samples before it: weight times coverage.
    pub coverage: Vec<f32>,
}

impl GroupCoverage {
    /// Ends all samples before sample `next`; `weights`: weight of each sample.
    pub(in crate::backend) fn turn(&mut self, weights: impl Fn(usize) -> f32, next: usize) {
        let first = self.sample.unwrap_or_else(|| {
            self.of_static.copy_from_slice(&self.sample_coverage);
            0
        });
        for sample in first..next {
            let weight = weights(sample);
            let covered = self.coverage.iter_mut().zip(&mut self.sample_coverage).zip(&self.of_static);
            for ((coverage, of_sample), of_static) in covered {
                *coverage += weight * if *of_sample < 1.0 { *of_sample } else { 1.0 };
                *of_sample = *of_static;
            }
        }
        self.sample = Some(next);
    }
}

impl CoverageMask {
    /// For an interval.
    pub(in crate::backend) fn clear(&mut self) {
        let Self { surface, filtered, loose, peak, side } = self;
        for plane in [surface, filtered] {
            plane.clear();
            plane.resize(TILE * STRIDE, 0);
        }
        for plane in [loose, peak, side] {
            plane.clear();
            plane.resize(TILE * STRIDE, 0.0);
        }
    }
}

impl TileBuffers {
    /// For an interval.
    pub(in crate::backend) fn clear_sums(&mut self, channels: usize) {
        self.sums.clear();
        self.sums.resize(ROWS * channels * STRIDE, 0.0);
    }

    /// For a group of `samples` samples.
    pub(in crate::backend) fn clear_coverage(&mut self, samples: usize) {
        let floats = if samples > 1 { ROWS * STRIDE } else { 0 };
        let GroupCoverage { sample, sample_coverage, of_static, coverage } = &mut self.group_coverage;
        *sample = None;
        for plane in [sample_coverage, of_static, coverage] {
            plane.clear();
            plane.resize(floats, 0.0);
        }
    }

    /// For `count` slices of an interval. `nearest`: with the depth of the nearest kernel.
    pub(in crate::backend) fn start_slices(&mut self, count: usize, nearest: bool) {
        let floats = TILE * count * STRIDE;
        self.slices.count = count;
        for (plane, floats) in
            [(&mut self.slices.threshold, floats), (&mut self.slices.nearest, if nearest { floats } else { 0 })]
        {
            plane.clear();
            plane.resize(floats, f32::INFINITY);
        }
    }

    /// Bytes of a tile's buffers beside those of kernels at instants, for groups of `samples` samples. `slices`: planes
    /// of the slices of kernels in motion, if there are any.
    pub(in crate::backend) const fn bytes(channels: usize, samples: usize, slices: Option<usize>) -> u64 {
        let group_coverage = if samples > 1 { 3 } else { 0 };
        let swept = match slices {
            Some(slices) => channels + 6 + slices,
            None => 0,
        };
        ((group_coverage + swept) * ROWS * STRIDE * size_of::<f32>()) as u64
    }
}

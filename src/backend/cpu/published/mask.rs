//! What pass `attribute` of published kernels in motion writes beside sums.

use crate::backend::cpu::tiles::{STRIDE, TILE};

/// When published kernels cover, one bit each 32nd of the interval: `TILE` rows of `STRIDE`.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct PublishedMask {
    /// Kernels.
    pub surface: Vec<u32>,
    /// Low-pass discs.
    pub low_pass: Vec<u32>,
    /// Sum of the weights of low-pass discs beyond those of their kernels; where the sum of weights is the coverage,
    /// sum of all weights.
    pub loose: Vec<f32>,
}

impl PublishedMask {
    /// For an interval.
    pub(in crate::backend) fn clear(&mut self) {
        for plane in [&mut self.surface, &mut self.low_pass] {
            plane.clear();
            plane.resize(TILE * STRIDE, 0);
        }
        self.loose.clear();
        self.loose.resize(TILE * STRIDE, 0.0);
    }
}

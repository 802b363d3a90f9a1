//! What a surfel counts beside others of its model.

use crate::model::Surfels;

/// Normalisation of a model's kernels, and its mean.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend::cpu) struct Shares<'a> {
    factors: &'a [f32],
    mean: f32,
}

/// The normalisation of one kernel, and the mean over its model.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend::cpu) struct Share {
    factor: f32,
    mean: f32,
}

impl<'a> Shares<'a> {
    /// The shares of `surfels`, computed unless they are known.
    pub(in crate::backend::cpu) fn of(surfels: &'a Surfels) -> Self {
        Self { factors: surfels.normalisation(), mean: surfels.mean_normalisation() }
    }

    /// Every kernel counts 1.
    #[cfg(test)]
    pub(in crate::backend::cpu) const ONE: Self = Self { factors: &[], mean: 1.0 };

    /// The share of one surfel.
    #[inline(always)]
    pub(in crate::backend::cpu) fn at(&self, surfel: usize) -> Share {
        Share { factor: self.factors.get(surfel).copied().unwrap_or(1.0), mean: self.mean }
    }
}

impl Share {
    /// Every kernel counts 1.
    #[cfg(test)]
    pub(in crate::backend::cpu) const ONE: Self = Self { factor: 1.0, mean: 1.0 };

    /// Weight of the kernel at its centre (docs/math.md, section 3). The narrower the filter is beside it (`peak` near
    /// 1), the more all kernels of a model count alike, as they do in a picture without filter. The wider the filter
    /// is, the more each counts for the area that is its own.
    #[inline(always)]
    pub(in crate::backend::cpu) fn weight(self, peak: f32) -> f32 {
        peak * (self.factor + peak * (self.mean - self.factor))
    }

    /// Weight of coverage alone: the area that is the kernel's own, however large it is.
    #[inline(always)]
    pub(in crate::backend::cpu) fn coverage(self, peak: f32) -> f32 {
        peak * self.factor
    }

    /// Weight of a kernel that is not filtered.
    #[inline(always)]
    pub(in crate::backend::cpu) fn unfiltered(self) -> f32 {
        self.mean
    }
}

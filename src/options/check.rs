//! Whether options can be rendered with: every number within the bounds that their texts have ([`crate::limits`]).

use super::{BlurMode, ErrorTarget, KernelShape, KernelWeight, PixelFilter, Quality, RenderOptions, SweptKernel};
use crate::limits::{self, Invalid, check_count};

impl RenderOptions {
    /// Checks all numbers. A renderer does it by itself. Whether [`RenderOptions::memory`] is enough is found when the
    /// frame is known.
    ///
    /// # Errors
    /// The first that is out of its bounds, or does not go with another.
    pub fn check(&self) -> Result<(), Invalid> {
        match self.quality {
            Quality::Mode(mode) => mode.check(),
            Quality::Error(target) => target.check(),
        }
        .map_err(|e| e.within("quality"))?;
        self.look.check().map_err(|e| e.within("look"))
    }
}

impl PixelFilter {
    /// Checks the width of a Gaussian.
    pub(crate) fn check(self) -> Result<(), Invalid> {
        match self {
            Self::Box | Self::Point => Ok(()),
            Self::Gaussian { sigma } => limits::SIGMA.check("filter.sigma", sigma),
        }
    }
}

impl ErrorTarget {
    fn check(self) -> Result<(), Invalid> {
        limits::ERROR.check("error", self.error)?;
        limits::WHITE.check("white", self.white)?;
        check_count("samples_max", self.samples_max, &limits::SAMPLES_MAX)?;
        check_count("pixel_samples", self.pixel_samples, &limits::COUNT)
    }
}

impl BlurMode {
    fn check(self) -> Result<(), Invalid> {
        let positions =
            |positions: Option<u32>| positions.map_or(Ok(()), |n| check_count("pixel_samples", n, &limits::COUNT));
        match self {
            Self::Still { pixel_samples } => positions(Some(pixel_samples)),
            Self::Supersample { samples, pixel_samples, .. } => {
                check_count("samples", samples, &limits::COUNT)?;
                positions(pixel_samples)
            }
            Self::Bucket { buckets, samples, pixel_samples, .. } => {
                check_count("buckets", buckets, &limits::COUNT)?;
                check_count("samples", samples, &limits::COUNT)?;
                if !Self::fits(buckets, samples) {
                    let expected = format!("buckets times samples of at most {}", limits::MAX_SAMPLES);
                    return Err(Invalid::new("buckets", format_args!("{buckets} of {samples} samples"), expected));
                }
                positions(pixel_samples)
            }
            Self::Volumetric { intervals, pixel_samples, swept } => {
                check_count("intervals", intervals, &limits::COUNT)?;
                positions(pixel_samples)?;
                swept.check().map_err(|e| e.within("swept"))
            }
        }
    }

    /// Are so many buckets of so many samples not too many?
    pub(super) fn fits(buckets: u32, samples: u32) -> bool {
        u64::from(buckets) * u64::from(samples) <= u64::from(limits::MAX_SAMPLES)
    }
}

impl SweptKernel {
    fn check(self) -> Result<(), Invalid> {
        check_count("source_samples", self.source_samples.0, &limits::SOURCE_SAMPLES)?;
        limits::OVERLAP.check("overlap", self.overlap.0)?;
        if self.weighs_as_its_shape() {
            return Ok(());
        }
        let expected = format!("{} where the shape is {}", KernelWeight::Integral, KernelShape::Tube);
        Err(Invalid::new("weight", self.weight, expected))
    }

    /// False for a weight that is of ellipsoids, of a tube.
    pub(super) fn weighs_as_its_shape(self) -> bool {
        self.weight == KernelWeight::Integral || self.shape == KernelShape::Ellipsoid
    }
}

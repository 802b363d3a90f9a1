//! What the kernels of mode `volumetric` sweep, how they weigh and add up, and that as text.

use std::fmt;
use std::str::FromStr;

use super::OptionError;
use super::counts::number;
use super::words::words;
use crate::limits::{OVERLAP, SOURCE_SAMPLES};

/// How volumetric kernels weigh and add up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SweptKernel {
    /// The volume that a kernel sweeps.
    pub shape: KernelShape,
    /// Its weight on a ray. All but [`KernelWeight::Integral`] are of [`KernelShape::Ellipsoid`] only.
    pub weight: KernelWeight,
    /// Places on the ray within a kernel whose sources are tested for visibility (Wolf 2008, eq. C.41). Kernels of
    /// [`KernelWeight::Integral`] are tested slice by slice in its place.
    pub source_samples: SourceSamples,
    /// How far kernels of neighbouring intervals overlap.
    pub overlap: Overlap,
    /// Where temporal alpha comes from.
    pub alpha: TemporalAlpha,
    /// When colours are divided by weights.
    pub normalise: Normalise,
}

impl SweptKernel {
    /// As published (Wolf 2008). Kernels of neighbouring intervals overlap (figure 5.2(e) shows that they must).
    pub const PUBLISHED: Self = Self {
        shape: KernelShape::Ellipsoid,
        weight: KernelWeight::Chord,
        source_samples: SourceSamples(1),
        overlap: Overlap(1.0),
        alpha: TemporalAlpha::Sum,
        normalise: Normalise::Once,
    };

    /// Whether a film is complete only after all intervals: where colours are divided once, or coverage is a sum.
    pub(crate) fn needs_finish(self) -> bool {
        self.normalise == Normalise::Once || self.alpha == TemporalAlpha::Sum
    }

    /// Whether kernels weigh as published, with visibility at mid-interval alone.
    pub(crate) fn is_published(self) -> bool {
        self.weight != KernelWeight::Integral
    }
}

/// What differs from the defaults, as in `+kernel=ellipsoid+source-samples=4`; nothing for the defaults.
impl fmt::Display for SweptKernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let default = Self::default();
        if (Self { source_samples: default.source_samples, ..*self }) == Self::PUBLISHED {
            write!(f, "+published")?;
        } else {
            if self.shape != default.shape {
                write!(f, "+kernel={}", self.shape)?;
            }
            if self.weight != default.weight {
                write!(f, "+kernel-weight={}", self.weight)?;
            }
            if self.overlap != default.overlap {
                write!(f, "+overlap={}", self.overlap)?;
            }
            if self.alpha != default.alpha {
                write!(f, "+alpha={}", self.alpha)?;
            }
            if self.normalise != default.normalise {
                write!(f, "+normalise={}", self.normalise)?;
            }
        }
        if self.source_samples == default.source_samples {
            Ok(())
        } else {
            write!(f, "+source-samples={}", self.source_samples)
        }
    }
}

/// Places on the ray within a kernel whose sources are tested for visibility, 1 to 64.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SourceSamples(pub u32);

impl Default for SourceSamples {
    fn default() -> Self {
        Self(1)
    }
}

impl fmt::Display for SourceSamples {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for SourceSamples {
    type Err = OptionError;

    fn from_str(text: &str) -> Result<Self, OptionError> {
        number(text, SOURCE_SAMPLES).map(Self)
    }
}

/// Half-axis of a kernel along its motion, in spacings of the intervals, 0.1 to 4.
///
/// At 0.5 kernels of neighbouring intervals meet end to end, and each travels as far as its surfel does. At 1 each
/// reaches the middles of the neighbouring intervals (Wolf 2008, chapter 5, figure 5.2(e)). Its weight is that of one
/// interval whatever its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap(pub f64);

impl Overlap {
    /// Motion of a kernel divided by the motion of its surfel during the interval.
    pub(crate) fn stretch(self) -> f64 {
        2.0 * self.0
    }
}

impl Default for Overlap {
    fn default() -> Self {
        Self(0.5)
    }
}

impl fmt::Display for Overlap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for Overlap {
    type Err = OptionError;

    fn from_str(text: &str) -> Result<Self, OptionError> {
        let spacings = text.parse().ok().filter(|&spacings| OVERLAP.holds(spacings));
        spacings.map(Self).ok_or_else(|| OptionError::value(format!("a number {OVERLAP}"), text))
    }
}

/// The volume that a kernel sweeps over an interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum KernelShape {
    /// The 2D kernel moved along: equal weight at all times (Heinzle et al. 2010).
    #[default]
    Tube,
    /// 2D Gaussian times a 1D Gaussian along the motion (Wolf 2008, appendix C).
    Ellipsoid,
}

words!(KernelShape, "shape of a kernel", [Tube = "tube", Ellipsoid = "ellipsoid"]);

/// The weight of a kernel on a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum KernelWeight {
    /// The integral over time.
    #[default]
    Integral,
    /// By the length of the ray's chord (Wolf 2008, eq. 4.12); of the ellipsoid only.
    Chord,
    /// The line integral of the 3D Gaussian between the ray's two intersections with the ellipsoid (Wolf 2008, eq. C.16
    /// and C.38), for which the chord stands; of the ellipsoid only.
    Line,
}

words!(KernelWeight, "weight of a kernel", [Integral = "integral", Chord = "chord", Line = "line"]);

/// Where temporal alpha comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TemporalAlpha {
    /// The times at which any kernel covers the pixel.
    #[default]
    Union,
    /// The sum of all weights, clamped to 1 (Wolf 2008, 4.1.2, figure 5.3).
    Sum,
}

words!(TemporalAlpha, "temporal alpha", [Union = "union", Sum = "sum"]);

/// When colours are divided by weights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Normalise {
    /// For each interval, before the intervals are added up.
    #[default]
    Interval,
    /// Once, at the end (Wolf 2008, 4.1.2).
    Once,
}

words!(Normalise, "time to normalise", [Interval = "interval", Once = "once"]);

//! How motion becomes blur: blur modes, errors to aim at, and both as text.
//!
//! The text is `NAME[:COUNTS][+OPTION=VALUE]...`, as in `supersample:8+interleave=2`, `bucket:8x4` or
//! `auto:0.01+samples-max=64`. [`super::ModeParts`] reads it; `Display` here writes it. Equal values have equal texts.

use std::fmt;

use super::{Interleave, Lattice, OptionError, SweptKernel, Times};
use crate::limits::{ERROR, WHITE};

/// How motion becomes blur.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BlurMode {
    /// No motion: everything at the frame number, averaged over sub-pixel offsets.
    Still {
        /// Sub-pixel positions, 1 to [`super::MAX_SAMPLES`].
        pixel_samples: u32,
    },
    /// Temporal supersampling (Wolf 2008, 3.6.1 and 4.3). Each time sample has its own visibility test, normalisation
    /// and shading.
    Supersample {
        /// Time samples of a pixel, 1 to [`super::MAX_SAMPLES`].
        samples: u32,
        /// Sub-pixel positions, >= 1. Fewer than samples are shared out, more are several for each. `None`: one for
        /// each.
        pixel_samples: Option<u32>,
        /// Which pixels share their times.
        interleave: Interleave,
        /// Where the times lie.
        times: Times,
    },
    /// Time bucketing (Wolf 2008, 3.6.2 and 4.4). Each bucket has one visibility test, normalisation and shading; all
    /// its time samples contribute their attributes.
    Bucket {
        /// Buckets of a pixel, >= 1. Buckets times samples: at most [`super::MAX_SAMPLES`].
        buckets: u32,
        /// Time samples of a bucket, >= 1.
        samples: u32,
        /// Sub-pixel positions, >= 1. Fewer than buckets are shared out, more are several for each. `None`: one for
        /// each.
        pixel_samples: Option<u32>,
        /// Which pixels share their times.
        interleave: Interleave,
        /// Where the times lie.
        times: Times,
    },
    /// Volumetric kernels (Wolf 2008, 3.6.3 and 4.1.2). Each kernel sweeps a volume over an interval of the shutter.
    /// Each interval has one visibility test, normalisation and shading.
    Volumetric {
        /// Intervals of the shutter, 1 to [`super::MAX_SAMPLES`].
        intervals: u32,
        /// Sub-pixel positions, >= 1. Fewer than intervals are shared out, more are several for each. `None`: one for
        /// each.
        pixel_samples: Option<u32>,
        /// What kernels sweep, and how they add up.
        swept: SweptKernel,
    },
}

impl BlurMode {
    /// Plain supersampling with `samples` time samples, >= 1.
    pub const fn supersample(samples: u32) -> Self {
        Self::interleaved(samples, Interleave::None)
    }

    /// Supersampling with `samples` time samples, >= 1, each at its own sub-pixel position.
    pub const fn interleaved(samples: u32, interleave: Interleave) -> Self {
        Self::Supersample { samples, pixel_samples: None, interleave, times: Times::Even }
    }

    /// What kernels sweep; `None` in modes whose kernels do not move.
    pub const fn swept(self) -> Option<SweptKernel> {
        match self {
            Self::Volumetric { swept, .. } => Some(swept),
            Self::Still { .. } | Self::Supersample { .. } | Self::Bucket { .. } => None,
        }
    }
}

/// As in `still:16`, `supersample:8+interleave=2`, `bucket:8x4`, `volumetric:3+published`.
impl fmt::Display for BlurMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (interleaved, times, pixel_samples, swept) = match *self {
            Self::Still { pixel_samples } => return write!(f, "still:{pixel_samples}"),
            Self::Supersample { samples, pixel_samples, interleave, times } => {
                write!(f, "supersample:{samples}")?;
                (interleave, times, pixel_samples, None)
            }
            Self::Bucket { buckets, samples, pixel_samples, interleave, times } => {
                write!(f, "bucket:{buckets}x{samples}")?;
                (interleave, times, pixel_samples, None)
            }
            Self::Volumetric { intervals, pixel_samples, swept } => {
                write!(f, "volumetric:{intervals}")?;
                (Interleave::None, Times::Even, pixel_samples, Some(swept))
            }
        };
        if let Some(positions) = pixel_samples {
            write!(f, "+pixel-samples={positions}")?;
        }
        if interleaved != Interleave::None {
            write!(f, "+interleave={interleaved}")?;
        }
        if times != Times::Even {
            write!(f, "+times={times}")?;
        }
        swept.map_or(Ok(()), |swept| swept.fmt(f))
    }
}

/// An error that a frame may have. Mode `auto` finds the samples for it ([`crate::auto`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorTarget {
    /// Largest error of a block of the image, 0.0001 to 1: the root mean square of the differences of display values.
    pub error: f64,
    /// Most time samples of a pixel, 4 to [`super::MAX_SAMPLES`].
    pub samples_max: u32,
    /// Sub-pixel positions of static objects at the target [`Self::GOOD`], >= 1. Half as many at twice the error, up to
    /// four times as many at a quarter; a multiple of four is used. Where nothing moves there are twice as many.
    pub pixel_samples: u32,
    /// Which pixels share their times.
    pub interleave: Lattice,
    /// Brightest light that is compared, white is 1; 1 to 65,504. Where it is more than 1, the error also holds for the
    /// picture that is exposed so that this light is white.
    pub white: f64,
}

impl ErrorTarget {
    /// For quick looks. FLIP in the worst twentieth of blocks is .033 in the median of the shipped scenes.
    pub const DRAFT: f64 = 0.05;
    /// The default. FLIP .017 there.
    pub const GOOD: f64 = 0.025;
    /// FLIP .007 there (docs/measurements/scenes.md).
    pub const FINAL: f64 = 0.0125;

    /// The brightest light that is compared: a number from 1 to 65504.
    pub(super) fn parse_white(text: &str) -> Result<f64, OptionError> {
        let number = text.parse().ok().filter(|&white| WHITE.holds(white));
        number.ok_or_else(|| OptionError::value("a number from 1 to 65504, where white is 1", text))
    }

    /// An error: `draft`, `good`, `final`, or a number from 0.0001 to 1.
    ///
    /// # Errors
    /// The text is none of these.
    pub fn parse_error(text: &str) -> Result<f64, OptionError> {
        match text {
            "draft" => Ok(Self::DRAFT),
            "good" => Ok(Self::GOOD),
            "final" => Ok(Self::FINAL),
            _ => {
                let number = text.parse().ok().filter(|&error| ERROR.holds(error));
                number.ok_or_else(|| OptionError::value("draft, good, final, or a number from 0.0001 to 1", text))
            }
        }
    }
}

impl Default for ErrorTarget {
    fn default() -> Self {
        Self { error: Self::GOOD, samples_max: 256, pixel_samples: 8, interleave: Lattice::Auto, white: 1.0 }
    }
}

/// The error, and what differs from the defaults, as in `0.015+samples-max=64`.
impl fmt::Display for ErrorTarget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let default = Self::default();
        write!(f, "{}", self.error)?;
        if self.samples_max != default.samples_max {
            write!(f, "+samples-max={}", self.samples_max)?;
        }
        if self.pixel_samples != default.pixel_samples {
            write!(f, "+pixel-samples={}", self.pixel_samples)?;
        }
        if self.interleave != default.interleave {
            write!(f, "+interleave={}", self.interleave)?;
        }
        if self.white != default.white {
            write!(f, "+white={}", self.white)?;
        }
        Ok(())
    }
}

/// How good a frame is to be: a blur mode with its samples, or an error for which samples are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quality {
    /// This mode.
    Mode(BlurMode),
    /// As many time samples as this error takes ([`crate::auto`]).
    Error(ErrorTarget),
}

impl Default for Quality {
    fn default() -> Self {
        Self::Error(ErrorTarget::default())
    }
}

impl From<BlurMode> for Quality {
    fn from(mode: BlurMode) -> Self {
        Self::Mode(mode)
    }
}

impl From<ErrorTarget> for Quality {
    fn from(target: ErrorTarget) -> Self {
        Self::Error(target)
    }
}

/// As [`BlurMode`] and [`ErrorTarget`] are written, the latter after `auto:`.
impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mode(mode) => mode.fmt(f),
            Self::Error(target) => write!(f, "auto:{target}"),
        }
    }
}

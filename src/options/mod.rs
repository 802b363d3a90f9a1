//! What a person chooses: how frames are rendered.
//!
//! Every option has one text. `Display` writes it and `FromStr` reads it. The command line, studies, JSON and the
//! headers of files all use it. `FromStr` refuses values that are out of range. So does [`RenderOptions::check`],
//! for values that are set in code.

mod aov;
mod blur;
mod check;
mod counts;
mod detail;
mod error;
mod filter;
mod look;
mod parts;
mod swept;
mod weight;
mod words;

use std::fmt;
use std::str::FromStr;

pub use self::aov::in_order;
pub use self::blur::{BlurMode, ErrorTarget, Quality};
pub use self::counts::{count, samples_max};
pub use self::detail::Detail;
pub use self::error::OptionError;
pub use self::filter::PixelFilter;
pub use self::look::Look;
pub use self::parts::{ModeName, ModeParts};
pub use self::swept::{KernelShape, KernelWeight, Normalise, Overlap, SourceSamples, SweptKernel, TemporalAlpha};
pub(crate) use self::words::words;
pub use crate::limits::MAX_SAMPLES;

/// Interleaved time sampling: the pixels of an S x S lattice fall into S^2 classes, each with times of its own.
/// Neighbouring pixels see different times (Keller and Heidrich 2001, for rays).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interleave {
    /// All pixels see the same times.
    #[default]
    None,
    /// A 2 x 2 lattice.
    Two,
    /// A 4 x 4 lattice.
    Four,
}

impl Interleave {
    /// Pixels from one pixel of a class to the next, along both axes: 1, 2 or 4.
    pub const fn stride(self) -> u32 {
        match self {
            Self::None => 1,
            Self::Two => 2,
            Self::Four => 4,
        }
    }

    /// The one with this stride; `None` where there is none.
    pub const fn with_stride(stride: u32) -> Option<Self> {
        match stride {
            1 => Some(Self::None),
            2 => Some(Self::Two),
            4 => Some(Self::Four),
            _ => None,
        }
    }

    /// The first pixel of each class, column and row, row by row.
    pub(crate) fn phases(self) -> impl Iterator<Item = [u32; 2]> {
        let stride = self.stride();
        (0..stride * stride).map(move |class| [class % stride, class / stride])
    }

    /// The seed of the sub-pixel offsets of the class of pixel `phase`: each class has offsets of its own.
    pub(crate) fn seed_of(self, phase: [u32; 2], seed: u64) -> u64 {
        seed.wrapping_add(u64::from(self.order(phase)) << 32)
    }

    /// Place of the class of pixel `phase` in Bayer order, 0..stride^2: consecutive classes are far apart.
    pub(crate) fn order(self, phase: [u32; 2]) -> u32 {
        let [x, y] = phase;
        let bits = self.stride().trailing_zeros();
        (0..bits).fold(0, |order, bit| order << 2 | ((x ^ y) >> bit & 1) << 1 | y >> bit & 1)
    }
}

/// The stride.
impl fmt::Display for Interleave {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.stride().fmt(f)
    }
}

/// The stride, or `none` for 1.
impl FromStr for Interleave {
    type Err = OptionError;

    fn from_str(text: &str) -> Result<Self, OptionError> {
        if text == "none" {
            return Ok(Self::None);
        }
        text.parse().ok().and_then(Self::with_stride).ok_or_else(|| OptionError::value("none, 1, 2 or 4", text))
    }
}

/// The lattice of mode auto.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Lattice {
    /// The one that suits the motion and the error: 2 x 2 where time samples are far apart and the error is loose.
    #[default]
    Auto,
    /// This one, whatever the motion. Without one no pattern is woven into the picture, which costs more samples.
    Fixed(Interleave),
}

impl Lattice {
    /// The texts, in order, for helps and messages.
    pub const WORDS: &'static str = "none, auto, 2 or 4";
}

/// `auto`, `none`, `2` or `4`.
impl fmt::Display for Lattice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Fixed(Interleave::None) => f.write_str("none"),
            Self::Fixed(interleave) => interleave.fmt(f),
        }
    }
}

/// As it is written, and `1` for `none`, as other modes have it.
impl FromStr for Lattice {
    type Err = OptionError;

    fn from_str(text: &str) -> Result<Self, OptionError> {
        match text {
            "auto" => Ok(Self::Auto),
            "none" => Ok(Self::Fixed(Interleave::None)),
            _ => text.parse().map(Self::Fixed).map_err(|_| OptionError::value(Self::WORDS, text)),
        }
    }
}

/// Where time samples lie within the shutter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Times {
    /// The middles of equal strata, each with the integral of the time weight over its stratum.
    #[default]
    Even,
    /// A random time in each of as many equal shares of the exposure (Wolf 2008, 4.5: a jittered grid).
    Stratified,
    /// Random times, independent of each other, in proportion to the time weight (Wolf 2008, 3.6.4).
    Random,
}

words!(Times, "choice of times", [Even = "even", Stratified = "stratified", Random = "random"]);

/// Screen-space prefilter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Prefilter {
    /// A pixel counts as near a splat as the nearer of its object-space kernel and a screen-space disc (Botsch et al.
    /// 2005; Wolf 2008, 4.2.3).
    Approx,
    /// Object-space kernels, each convolved with a Gaussian as wide as the sample grid needs (Ren et al. 2002,
    /// section 4; Zwicker et al. 2002, section 6). Not for the kernel weights chord and line.
    Ewa,
    /// Object-space kernels alone.
    None,
    /// Full EWA where it is seen: with fewer than four sub-pixel positions, and where splats lie much closer than
    /// positions. Elsewhere none, in half of the time. The approximation for the kernel weights chord and line, whose
    /// weights add up to nothing.
    #[default]
    Auto,
}

words!(Prefilter, "prefilter", [Approx = "approx", Ewa = "ewa", None = "none", Auto = "auto"]);

/// Where shading happens.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shading {
    /// Per pixel, with the averaged normal (deferred; Wolf 2008, 4.1.1).
    #[default]
    Phong,
    /// Per surfel.
    Gouraud,
}

words!(Shading, "shading", [Phong = "phong", Gouraud = "gouraud"]);

/// How frames are rendered. The defaults are those of the command line.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Blur mode, or the error that samples are found for. Default: [`ErrorTarget::default`].
    pub quality: Quality,
    /// Screen-space prefilter. Default: [`Prefilter::Auto`].
    pub prefilter: Prefilter,
    /// How fine the surfels are that show. Default: [`Detail::Auto`].
    pub detail: Detail,
    /// What a reference has in common with it: filter, shading, sides, tolerance, seed and extra channels.
    pub look: Look,
    /// Bytes that a frame and the models may take together. Default: 2^30. The picture does not depend on it.
    pub memory: u64,
    /// Smooth the finished picture along the motion ([`crate::reconstruct`])? Default: no.
    pub reconstruct: bool,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            quality: Quality::default(),
            prefilter: Prefilter::Auto,
            detail: Detail::Auto,
            look: Look::default(),
            memory: 1 << 30,
            reconstruct: false,
        }
    }
}

#[cfg(test)]
pub(crate) mod tests;

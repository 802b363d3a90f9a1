//! Pixel filters as text: `box`, `point`, `gaussian:1`.

use std::fmt;
use std::str::FromStr;

use super::OptionError;
use crate::limits::{Range, SIGMA};
use crate::sampling::{gaussian_offsets, pixel_offsets};

/// What part of the image plane a pixel is a mean of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PixelFilter {
    /// Mean over the pixel's square: each time sample has its own sub-pixel offset.
    #[default]
    Box,
    /// Pixel centres.
    Point,
    /// Mean over a disc of radius 2 sigma about the pixel's centre, weighted by a Gaussian.
    Gaussian {
        /// Standard deviation of the Gaussian before the cut, pixels, 0.25 to 4.
        sigma: f64,
    },
}

impl PixelFilter {
    /// The texts, in order, for helps and messages.
    pub const WORDS: &'static [&'static str] = &["box", "point", "gaussian[:SIGMA]"];
    /// Where the Gaussian is cut, standard deviations: where kernels are cut too.
    const CUT: f64 = 2.0;

    /// `n` offsets from the pixel's centre, pixels, that go with the time samples 0..n in order.
    pub(crate) fn offsets(self, n: u32, seed: u64) -> Vec<[f32; 2]> {
        match self {
            Self::Box => pixel_offsets(n, seed),
            Self::Point => vec![[0.0; 2]],
            Self::Gaussian { sigma } => gaussian_offsets(n, seed, sigma),
        }
    }

    /// Farthest offset of a single draw from the pixel's centre along either axis, pixels. Few `offsets`, whose mean
    /// square is corrected, may lie a little beyond.
    pub(crate) fn reach(self) -> f64 {
        match self {
            Self::Box => 0.5,
            Self::Point => 0.0,
            Self::Gaussian { sigma } => Self::CUT * sigma,
        }
    }
}

impl fmt::Display for PixelFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Box => f.pad("box"),
            Self::Point => f.pad("point"),
            Self::Gaussian { sigma } => f.pad(&format!("gaussian:{sigma}")),
        }
    }
}

impl FromStr for PixelFilter {
    type Err = OptionError;

    fn from_str(text: &str) -> Result<Self, OptionError> {
        match text.split_once(':').map_or((text, None), |(name, sigma)| (name, Some(sigma))) {
            ("box", None) => Ok(Self::Box),
            ("point", None) => Ok(Self::Point),
            ("gaussian", None) => Ok(Self::Gaussian { sigma: 1.0 }),
            ("gaussian", Some(sigma)) => {
                let value = sigma.parse().ok().filter(|&sigma| SIGMA.holds(sigma));
                let Range(least, most) = SIGMA;
                let expected = format!("gaussian:SIGMA with a standard deviation of {least} to {most} pixels");
                value.map(|sigma| Self::Gaussian { sigma }).ok_or_else(|| OptionError::value(expected, text))
            }
            _ => Err(OptionError::Word { what: "pixel filter", found: text.to_owned(), known: Self::WORDS.join(", ") }),
        }
    }
}

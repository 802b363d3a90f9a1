//! How far a picture is from another: error metrics of colour, and others of alpha.
//!
//! Colour is compared as it is stored: premultiplied by alpha, that is, seen over black. *Linear* metrics take the
//! linear light of the files, without any clamp; *display* metrics take what a screen shows, sRGB-encoded and clamped
//! to [0, 1]. The second picture is the reference; where a formula is symmetric it does not matter. Sums run row by row
//! in `f64`, in a fixed order. A value that is not finite makes every metric of its kind (colour or alpha) NaN: no
//! value is left out. Formulas: docs/compare.md.

mod display;
mod filter;
pub mod flip;
mod json;
mod limit;
mod metric;
mod pairs;
mod pixels;
pub mod ssim;

use crate::film::Picture;

pub use self::display::{encode, gamma_rmse};
pub use self::json::{number, values};
pub use self::limit::{Limit, LimitError, Over, Shown};
pub use self::metric::{Metric, Sense};
pub use self::pairs::{Pair, PairError, pairs};
pub use self::pixels::{AlphaErrors, ColourErrors, RELATIVE_EPSILON, Worst};

/// Why two pictures could not be compared.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum CompareError {
    /// The sizes differ.
    #[error("the pictures differ in size: {} x {} and {} x {} pixels", .a.0, .a.1, .b.0, .b.1)]
    Sizes {
        /// Width and height of the first.
        a: (u32, u32),
        /// Width and height of the second.
        b: (u32, u32),
    },
    /// A picture without pixels, or one whose pixels do not fit its size.
    #[error("a picture of {width} x {height} with {pixels} pixels cannot be compared")]
    Pixels {
        /// Width.
        width: u32,
        /// Height.
        height: u32,
        /// Pixels found.
        pixels: usize,
    },
    /// SSIM has a window of a fixed size.
    #[error("SSIM needs pictures of at least {0} x {0} pixels; these have {width} x {height}", ssim::WINDOW)]
    Small {
        /// Width.
        width: u32,
        /// Height.
        height: u32,
    },
    /// Nothing to pool.
    #[error("there are no pictures to compare")]
    Nothing,
}

/// The errors of one picture against another, or of a sequence against another.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Compared pairs.
    pub frames: u64,
    /// Pixels of all pairs.
    pub pixels: u64,
    /// Pixels with a value that is not finite, in the first and in the second picture.
    pub non_finite: [u64; 2],
    /// Colour, linear.
    pub colour: ColourErrors,
    /// Mean squared error of the display values.
    pub gamma_mse: f64,
    /// Alpha.
    pub alpha: AlphaErrors,
    /// Mean SSIM of the display values; `None` where it was not asked for.
    pub ssim: Option<f64>,
    /// Mean FLIP; `None` where it was not asked for.
    pub flip: Option<f64>,
}

impl Comparison {
    /// Compares `a` with the reference `b`. SSIM and FLIP take long: they are made only where `metrics` has them.
    ///
    /// # Errors
    /// The sizes differ, there are no pixels, or SSIM is asked for of pictures smaller than its window.
    pub fn new(a: &Picture, b: &Picture, metrics: &[Metric]) -> Result<Self, CompareError> {
        check(a, b)?;
        let ssim = metrics.contains(&Metric::Ssim).then(|| ssim::mean(a, b)).transpose()?;
        let flip = metrics.contains(&Metric::Flip).then(|| flip::mean(a, b)).transpose()?;
        let gamma_mse = gamma_rmse(a, b)?.powi(2);
        let (colour, alpha, non_finite) = pixels::compare(a, b);
        Ok(Self { frames: 1, pixels: a.rgba.len() as u64, non_finite, colour, gamma_mse, alpha, ssim, flip })
    }

    /// The errors of a sequence from those of its frames. Squared errors, absolute errors, biases, SSIM and FLIP are
    /// averaged, each frame with the same weight; roots and logarithms come after. The worst pixel is that of all
    /// frames.
    ///
    /// # Errors
    /// There is no frame.
    pub fn pooled(frames: &[Self]) -> Result<Self, CompareError> {
        let n = frames.len() as f64;
        let first = frames.first().ok_or(CompareError::Nothing)?;
        let mean = |value: &dyn Fn(&Self) -> f64| frames.iter().map(value).sum::<f64>() / n;
        let optional = |value: fn(&Self) -> Option<f64>| {
            let values: Option<Vec<f64>> = frames.iter().map(value).collect();
            values.map(|v| v.iter().sum::<f64>() / n)
        };
        let worst = |value: fn(&Self) -> Worst| {
            frames.iter().enumerate().skip(1).fold(value(first), |worst, (frame, f)| {
                let other = Worst { frame, ..value(f) };
                if other.is_worse_than(&worst) { other } else { worst }
            })
        };
        Ok(Self {
            frames: frames.iter().map(|f| f.frames).sum(),
            pixels: frames.iter().map(|f| f.pixels).sum(),
            non_finite: [0, 1].map(|i| frames.iter().map(|f| f.non_finite[i]).sum()),
            colour: ColourErrors {
                mse: mean(&|f| f.colour.mse),
                relative_mse: mean(&|f| f.colour.relative_mse),
                mae: mean(&|f| f.colour.mae),
                bias: [0, 1, 2].map(|c| mean(&|f| f.colour.bias[c])),
                worst: worst(|f| f.colour.worst),
            },
            gamma_mse: mean(&|f| f.gamma_mse),
            alpha: AlphaErrors {
                mse: mean(&|f| f.alpha.mse),
                mae: mean(&|f| f.alpha.mae),
                bias: mean(&|f| f.alpha.bias),
                worst: worst(|f| f.alpha.worst),
            },
            ssim: optional(|f| f.ssim),
            flip: optional(|f| f.flip),
        })
    }

    /// A metric as one number; `None` for SSIM and FLIP where they were not asked for.
    pub fn value(&self, metric: Metric) -> Option<f64> {
        Some(match metric {
            Metric::Mse => self.colour.mse,
            Metric::Rmse => self.colour.mse.sqrt(),
            Metric::RelMse => self.colour.relative_mse,
            Metric::Mae => self.colour.mae,
            Metric::Bias => self.colour.bias.into_iter().map(f64::abs).fold(0.0, larger),
            Metric::Worst => self.colour.worst.difference,
            Metric::GammaRmse => self.gamma_mse.sqrt(),
            // 20 log10(1/rmse); the peak of display values is 1. Equal pictures have an infinite one.
            Metric::Psnr => -10.0 * libm::log10(self.gamma_mse),
            Metric::Ssim => self.ssim?,
            Metric::Flip => self.flip?,
            Metric::AlphaRmse => self.alpha.mse.sqrt(),
            Metric::AlphaMae => self.alpha.mae,
            Metric::AlphaBias => self.alpha.bias.abs(),
            Metric::AlphaWorst => self.alpha.worst.difference,
            Metric::NonFinite => (self.non_finite[0] + self.non_finite[1]) as f64,
        })
    }
}

/// The `metrics` of `a` against the reference `b`, in the order in which they are asked for. [`Comparison`] has all at
/// once, with the worst pixel.
///
/// ```
/// use splatblur::compare::{Metric, compare};
///
/// let a = splatblur::Picture { width: 2, height: 1, rgba: vec![[0.5, 0.5, 0.5, 1.0]; 2], layers: Vec::new() };
/// let b = splatblur::Picture { rgba: vec![[0.25, 0.5, 0.5, 1.0]; 2], ..a.clone() };
/// let [mae, worst] = compare(&a, &b, &[Metric::Mae, Metric::Worst])?;
/// assert_eq!((mae, worst), (0.25 / 3.0, 0.25));
/// # Ok::<(), splatblur::compare::CompareError>(())
/// ```
///
/// # Errors
/// The sizes differ, there are no pixels, or SSIM is asked for of pictures smaller than its window.
pub fn compare<const N: usize>(a: &Picture, b: &Picture, metrics: &[Metric; N]) -> Result<[f64; N], CompareError> {
    let comparison = Comparison::new(a, b, metrics)?;
    // Each has a value, because it was asked for.
    Ok(metrics.map(|metric| comparison.value(metric).unwrap_or(f64::NAN)))
}

/// The larger of two; NaN where one is, which `max` would drop.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// Two pictures of one size, with pixels.
fn check(a: &Picture, b: &Picture) -> Result<(), CompareError> {
    for p in [a, b] {
        let (width, height, pixels) = (p.width, p.height, p.rgba.len());
        if pixels == 0 || pixels as u64 != u64::from(width) * u64::from(height) {
            return Err(CompareError::Pixels { width, height, pixels });
        }
    }
    let (a, b) = ((a.width, a.height), (b.width, b.height));
    if a == b { Ok(()) } else { Err(CompareError::Sizes { a, b }) }
}

/// The mean of a row-major map, summed row by row; NaN where any value is.
pub fn mean(map: &[f32], width: usize) -> f64 {
    map.chunks(width.max(1)).map(|row| row.iter().map(|&v| f64::from(v)).sum::<f64>()).sum::<f64>() / map.len() as f64
}

#[cfg(test)]
mod tests;

//! Metrics that look at each pixel by itself, in linear light.

use crate::film::Picture;

/// The constant of the relative MSE, (a - b)^2 / (b^2 + this).
pub const RELATIVE_EPSILON: f64 = 0.01;

/// Errors of linear colour; means over pixels and channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourErrors {
    /// Mean of (a - b)^2.
    pub mse: f64,
    /// Mean of (a - b)^2 / (b^2 + [`RELATIVE_EPSILON`]).
    pub relative_mse: f64,
    /// Mean of |a - b|.
    pub mae: f64,
    /// Mean of a - b, for r, g, b.
    pub bias: [f64; 3],
    /// The pixel with the largest |a - b| of any channel.
    pub worst: Worst,
}

/// Errors of alpha; means over pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlphaErrors {
    /// Mean of (a - b)^2.
    pub mse: f64,
    /// Mean of |a - b|.
    pub mae: f64,
    /// Mean of a - b.
    pub bias: f64,
    /// The pixel with the largest |a - b|.
    pub worst: Worst,
}

/// The worst pixel: the first one that is not finite, else the first in reading order with the largest difference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Worst {
    /// Index of the pair in the sequence.
    pub frame: usize,
    /// Column.
    pub x: u32,
    /// Row, from the top.
    pub y: u32,
    /// |a - b|, the largest of the channels; NaN where a value is not finite.
    pub difference: f64,
}

impl Worst {
    /// Whether this is strictly worse; NaN is the worst.
    pub(super) fn is_worse_than(&self, other: &Self) -> bool {
        match (self.difference.is_nan(), other.difference.is_nan()) {
            (true, old) => !old,
            (false, true) => false,
            (false, false) => self.difference > other.difference,
        }
    }
}

/// Colour, alpha, and how many pixels of either picture are not finite.
pub(super) fn compare(a: &Picture, b: &Picture) -> (ColourErrors, AlphaErrors, [u64; 2]) {
    let width = a.width as usize;
    let n = a.rgba.len() as f64;
    let (mut squares, mut relative, mut absolute, mut bias) = ([0.0; 4], 0.0, [0.0; 4], [0.0; 4]);
    let (mut worst_colour, mut worst_alpha) = (Worst::default(), Worst::default());
    for (y, (row_a, row_b)) in a.rgba.chunks(width).zip(b.rgba.chunks(width)).enumerate() {
        let (mut row_squares, mut row_relative, mut row_absolute, mut row_bias) = ([0.0; 4], 0.0, [0.0; 4], [0.0; 4]);
        for (x, (pa, pb)) in row_a.iter().zip(row_b).enumerate() {
            let mut largest = [0.0_f64; 2];
            for c in 0..4 {
                let (va, vb) = (f64::from(pa[c]), f64::from(pb[c]));
                // Infinity minus a number is no error that could be averaged.
                let d = if va.is_finite() && vb.is_finite() { va - vb } else { f64::NAN };
                row_squares[c] += d * d;
                row_absolute[c] += d.abs();
                row_bias[c] += d;
                if c < 3 {
                    row_relative += d * d / (vb * vb + RELATIVE_EPSILON);
                }
                largest[c / 3] = super::larger(largest[c / 3], d.abs());
            }
            for (worst, difference) in [&mut worst_colour, &mut worst_alpha].into_iter().zip(largest) {
                let here = Worst { frame: 0, x: x as u32, y: y as u32, difference };
                if here.is_worse_than(worst) {
                    *worst = here;
                }
            }
        }
        for c in 0..4 {
            squares[c] += row_squares[c];
            absolute[c] += row_absolute[c];
            bias[c] += row_bias[c];
        }
        relative += row_relative;
    }
    let colour = ColourErrors {
        mse: squares[..3].iter().sum::<f64>() / (3.0 * n),
        relative_mse: relative / (3.0 * n),
        mae: absolute[..3].iter().sum::<f64>() / (3.0 * n),
        bias: [0, 1, 2].map(|c| bias[c] / n),
        worst: worst_colour,
    };
    let alpha = AlphaErrors { mse: squares[3] / n, mae: absolute[3] / n, bias: bias[3] / n, worst: worst_alpha };
    (colour, alpha, [non_finite(a), non_finite(b)])
}

fn non_finite(picture: &Picture) -> u64 {
    picture.rgba.iter().filter(|pixel| pixel.iter().any(|v| !v.is_finite())).count() as u64
}

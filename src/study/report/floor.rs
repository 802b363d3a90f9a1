//! The floor: the errors that a reference's own noise makes, below which nothing is seen with it.

use super::ztest::errors;
use crate::compare::{CompareError, flip};
use crate::film::Picture;
use crate::sampling::hash;

/// The errors that a picture without any error has against a reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Floor {
    /// Root mean square of the standard error over pixels and r, g, b, linear.
    pub rmse: f64,
    /// Mean FLIP of the reference with noise of its standard error, against itself. The noise is normal, with one
    /// number for all channels of a pixel: mostly the time for which a surface covers the pixel is uncertain, which
    /// moves all channels. The numbers depend on the pixel only.
    pub flip: f64,
}

impl Floor {
    /// `None`: the reference has no standard error.
    ///
    /// # Errors
    /// The reference has no pixels, or more values than pixels.
    pub fn of(reference: &Picture) -> Result<Option<Self>, CompareError> {
        let Some(errors) = errors(reference) else { return Ok(None) };
        let squares: f64 = errors.iter().map(|plane| plane.iter().map(|&e| f64::from(e).powi(2)).sum::<f64>()).sum();
        let rmse = (squares / (3.0 * reference.rgba.len() as f64)).sqrt();
        let (width, height) = (reference.width, reference.height);
        let mut noisy = Picture { width, height, rgba: reference.rgba.clone(), layers: Vec::new() };
        for (i, pixel) in noisy.rgba.iter_mut().enumerate() {
            let normal = normal(i as u64);
            for (value, plane) in pixel.iter_mut().zip(errors) {
                *value += plane.get(i).copied().unwrap_or(f32::NAN) * normal;
            }
        }
        Ok(Some(Self { rmse, flip: flip::mean(&noisy, reference)? }))
    }

    /// The floor of a sequence: the root of the mean square, and the mean.
    pub fn pooled(floors: impl ExactSizeIterator<Item = Self>) -> Self {
        let n = floors.len().max(1) as f64;
        let (squares, flips) = floors.fold((0.0, 0.0), |(s, f), floor| (s + floor.rmse.powi(2), f + floor.flip));
        Self { rmse: (squares / n).sqrt(), flip: flips / n }
    }
}

/// A normal number for a pixel (Box and Muller 1958).
fn normal(pixel: u64) -> f32 {
    let uniform = |stream: u64| (f64::from(hash(pixel, stream)) + 0.5) / 4_294_967_296.0;
    let (radius, angle) = ((-2.0 * libm::log(uniform(0))).sqrt(), std::f64::consts::TAU * uniform(1));
    (radius * libm::cos(angle)) as f32
}

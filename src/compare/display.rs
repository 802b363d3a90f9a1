//! What a screen shows of a picture: sRGB-encoded, clamped to [0, 1].

use rayon::prelude::*;

use super::CompareError;
use crate::film::Picture;
use crate::math::srgb;

/// Display values of a picture over black, one row-major plane a channel. NaN stays NaN; infinities become NaN.
pub fn encode(picture: &Picture) -> [Vec<f32>; 3] {
    [0, 1, 2].map(|c| picture.rgba.par_iter().map(|pixel| srgb::from_linear(shown(pixel[c]))).collect())
}

/// Linear light as a screen can show it, in [0, 1]; NaN where the value is not finite.
pub(super) fn shown(linear: f32) -> f32 {
    if linear.is_finite() { linear.clamp(0.0, 1.0) } else { f32::NAN }
}

/// Root mean squared error of the display values, over pixels and r, g, b.
///
/// # Errors
/// The sizes differ, or there are no pixels.
pub fn gamma_rmse(a: &Picture, b: &Picture) -> Result<f64, CompareError> {
    super::check(a, b)?;
    let (width, n) = (a.width as usize, a.rgba.len() as f64);
    let row_sums: Vec<f64> = a
        .rgba
        .par_chunks(width)
        .zip(b.rgba.par_chunks(width))
        .map(|(row_a, row_b)| row_a.iter().zip(row_b).map(squares).sum::<f64>())
        .collect();
    Ok((row_sums.iter().sum::<f64>() / (3.0 * n)).sqrt())
}

/// The sum of the squared differences of the display values of r, g, b.
fn squares((a, b): (&[f32; 4], &[f32; 4])) -> f64 {
    let difference = |c: usize| {
        if a[c] == b[c] && a[c].is_finite() {
            // Most pixels of two renderings of one scene are alike, and the curve is slow.
            return 0.0;
        }
        f64::from(srgb::from_linear(shown(a[c]))) - f64::from(srgb::from_linear(shown(b[c])))
    };
    (0..3).map(|c| difference(c).powi(2)).sum()
}

//! Structural similarity (Wang, Bovik, Sheikh and Simoncelli 2004, eq. 13), on display values.
//!
//! Gaussian window of 11 x 11 pixels with sigma 1.5, K1 = 0.01, K2 = 0.03, L = 1, population variances. The mean is
//! over the windows that are wholly in the picture and over r, g and b.

use super::filter::{Size, gaussian, separable};
use super::{CompareError, check, display, mean as mean_of};
use crate::film::Picture;

/// Width of the window in pixels, and the least size of a picture.
pub const WINDOW: u32 = 11;

const SIGMA: f64 = 1.5;
const RADIUS: usize = WINDOW as usize / 2;
const C1: f32 = 0.01 * 0.01;
const C2: f32 = 0.03 * 0.03;

/// The mean SSIM; 1 for equal pictures.
///
/// # Errors
/// The sizes differ, or the pictures are smaller than the window.
pub fn mean(a: &Picture, b: &Picture) -> Result<f64, CompareError> {
    check(a, b)?;
    let size = Size { width: a.width as usize, height: a.height as usize };
    if a.width.min(a.height) < WINDOW {
        return Err(CompareError::Small { width: a.width, height: a.height });
    }
    let channels = display::encode(a).into_iter().zip(display::encode(b));
    Ok(channels.map(|(a, b)| channel(&a, &b, size)).sum::<f64>() / 3.0)
}

fn channel(a: &[f32], b: &[f32], size: Size) -> f64 {
    let window = gaussian(SIGMA, RADIUS);
    let blurred = |plane: &[f32]| separable(plane, size, &window, &window);
    let product = |p: &[f32], q: &[f32]| blurred(&p.iter().zip(q).map(|(p, q)| p * q).collect::<Vec<_>>());
    let (mean_a, mean_b) = (blurred(a), blurred(b));
    let (aa, bb, ab) = (product(a, a), product(b, b), product(a, b));
    let similarity = |i: usize| {
        let (ma, mb) = (mean_a[i], mean_b[i]);
        let (var_a, var_b, cov) = (aa[i] - ma * ma, bb[i] - mb * mb, ab[i] - ma * mb);
        (2.0 * ma * mb + C1) * (2.0 * cov + C2) / ((ma * ma + mb * mb + C1) * (var_a + var_b + C2))
    };
    let inner_width = size.width - 2 * RADIUS;
    let inner: Vec<f32> = (RADIUS..size.height - RADIUS)
        .flat_map(|y| (RADIUS..size.width - RADIUS).map(move |x| y * size.width + x))
        .map(similarity)
        .collect();
    mean_of(&inner, inner_width)
}

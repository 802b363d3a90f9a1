//! Separable convolution of row-major planes. Pixels beyond the border have the values of the border.

use rayon::prelude::*;

/// A plane's size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    pub(super) width: usize,
    pub(super) height: usize,
}

/// Convolves rows with `horizontal`, then columns with `vertical`; both have an odd length. It is a correlation: weight
/// k goes with the pixel that is k - radius away.
pub(super) fn separable(plane: &[f32], size: Size, horizontal: &[f32], vertical: &[f32]) -> Vec<f32> {
    let Size { width, height } = size;
    let radius = horizontal.len() / 2;
    let mut rows = vec![0.0; plane.len()];
    rows.par_chunks_mut(width).zip(plane.par_chunks(width)).for_each(|(out, row)| {
        let (Some(&first), Some(&last)) = (row.first(), row.last()) else { return };
        let mut padded = vec![first; radius];
        padded.extend_from_slice(row);
        padded.resize(width + 2 * radius, last);
        for (k, &weight) in horizontal.iter().enumerate() {
            out.iter_mut().zip(&padded[k..]).for_each(|(sum, &v)| *sum += weight * v);
        }
    });
    let radius = vertical.len() / 2;
    let mut result = vec![0.0; plane.len()];
    result.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (k, &weight) in vertical.iter().enumerate() {
            let source = (y + k).saturating_sub(radius).min(height - 1) * width;
            out.iter_mut().zip(&rows[source..source + width]).for_each(|(sum, &v)| *sum += weight * v);
        }
    });
    result
}

/// Samples of exp(-x^2 / (2 sigma^2)) at -radius..=radius, normalised to sum 1.
pub(super) fn gaussian(sigma: f64, radius: usize) -> Vec<f32> {
    let samples = gaussian_samples(sigma, radius);
    let sum: f64 = samples.iter().sum();
    samples.iter().map(|v| (v / sum) as f32).collect()
}

/// Samples of exp(-x^2 / (2 sigma^2)) at -radius..=radius.
pub(super) fn gaussian_samples(sigma: f64, radius: usize) -> Vec<f64> {
    offsets(radius).map(|x| libm::exp(-x * x / (2.0 * sigma * sigma))).collect()
}

/// -radius..=radius.
pub(super) fn offsets(radius: usize) -> impl Iterator<Item = f64> {
    (0..=2 * radius).map(move |i| i as f64 - radius as f64)
}

//! Are the differences from a reference larger than its standard error explains?

use crate::film::{Aov, Picture};

/// Least standard error of a value: where a reference has found none, rounding remains.
pub const FLOOR: f64 = 1e-4;

/// Chance that a picture without error fails anywhere.
pub const SIGNIFICANCE: f64 = 0.01;

/// The planes of r, g, b of a reference's standard error.
pub(super) fn errors(reference: &Picture) -> Option<[&[f32]; 3]> {
    let layer = reference.layers.iter().find(|layer| layer.aov == Aov::Error)?;
    let [r, g, b, _] = &layer.planes[..] else { return None };
    Some([r, g, b])
}

/// Share of the values (pixels times r, g, b) that pass a two-sided z-test against the reference, whose standard error
/// is taken as at least [`FLOOR`]. Šidák's correction for the number of values: a picture whose every difference is
/// normal noise of that size has all values passing with a chance of 1 - [`SIGNIFICANCE`]. `None` where the reference
/// has no such layer or the sizes differ. Values that are not finite fail.
pub fn pass_rate(picture: &Picture, reference: &Picture) -> Option<f64> {
    let errors = errors(reference)?;
    let n = picture.rgba.len();
    if n == 0 || reference.rgba.len() != n || errors.iter().any(|plane| plane.len() != n) {
        return None;
    }
    let values = 3.0 * n as f64;
    // 1 - (1 - s)^(1/values), without cancellation.
    let least = -libm::expm1(libm::log1p(-SIGNIFICANCE) / values);
    let passes = |i: usize, c: usize| {
        let error = f64::from(errors[c][i]).max(FLOOR);
        let z = (f64::from(picture.rgba[i][c]) - f64::from(reference.rgba[i][c])) / error;
        libm::erfc(z.abs() / std::f64::consts::SQRT_2) >= least
    };
    let passed = (0..n).flat_map(|i| (0..3).map(move |c| (i, c))).filter(|&(i, c)| passes(i, c)).count();
    Some(passed as f64 / values)
}

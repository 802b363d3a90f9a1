//! Screen bounds: extents of kernels, and the pixels that they may touch (docs/math.md, section 2).

/// Slack of screen bounds, pixels plus a share of the size: they must not be too small by rounding.
const SLACK: f32 = 1e-3;
const SLACK_SHARE: f32 = 1e-5;

/// Ends of the ellipse along one axis, relative to the projected centre and widened to the low-pass disc: the roots of
/// d22 k^2 - 2 d02 k + d00 = 0 for d22 < 0.
#[inline(always)]
pub(super) fn extent(d00: f32, d02: f32, d22: f32, inverse22: f32, low_pass: f32) -> (f32, f32) {
    let disc = d02 * d02 - d00 * d22;
    let half = (if disc > 0.0 { disc } else { 0.0 }).sqrt() * -inverse22;
    let middle = d02 * inverse22;
    let (low, high) = (middle - half, middle + half);
    (if low < -low_pass { low } else { -low_pass }, if high > low_pass { high } else { low_pass })
}

/// Pixel indices of [low, high] about `reference`, with slack and not rounded.
#[inline(always)]
pub(super) fn index_range(reference: f32, low: f32, high: f32) -> (f32, f32) {
    let slack = SLACK + SLACK_SHARE * (high - low) + reference.abs() * f32::EPSILON;
    (reference + low - slack - 0.5, reference + high + slack - 0.5)
}

/// First and last pixel whose sample position may be in [low, high] about `reference`, cut to [first, last]. None where
/// the first is after the last, or a NaN.
#[inline(always)]
pub(super) fn pixel_range(reference: f32, low: f32, high: f32, first: i32, last: i32) -> (f32, f32) {
    let (a, b) = index_range(reference, low, high);
    let (a, b) = (a.ceil(), b.floor());
    // A NaN stays one, and fails the comparison of first with last.
    let a = if a < first as f32 { first as f32 } else { a };
    let b = if b > last as f32 { last as f32 } else { b };
    (a, b)
}

/// A whole number from 0 to 65535 as an integer. A cast saturates, which would block vector code.
#[inline(always)]
pub(super) fn whole(x: f32) -> u16 {
    /// 2^23: adding it leaves the number in the low bits of the mantissa.
    const SHIFT: f32 = 8_388_608.0;
    ((x + SHIFT).to_bits() & 0xffff) as u16
}

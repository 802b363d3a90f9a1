//! The sRGB transfer curve (IEC 61966-2-1). No other file knows it.

use super::fast;
use super::simd::dispatch;

/// Linear light of an sRGB-encoded value. Both are nominally in [0, 1]; the function is odd about 0.
pub fn to_linear(encoded: f32) -> f32 {
    linear(f64::from(encoded)) as f32
}

/// sRGB-encoded value of linear light. Both are nominally in [0, 1]; the function is odd about 0.
pub fn from_linear(linear: f32) -> f32 {
    encoded(f64::from(linear)) as f32
}

/// [`to_linear`] in double precision.
pub fn linear(encoded: f64) -> f64 {
    let e = encoded.abs();
    let linear = if e <= 0.040_45 { e / 12.92 } else { libm::pow((e + 0.055) / 1.055, 2.4) };
    linear.copysign(encoded)
}

/// [`from_linear`] in double precision.
pub fn encoded(linear: f64) -> f64 {
    let l = linear.abs();
    let encoded = if l <= 0.003_130_8 { l * 12.92 } else { 1.055 * libm::pow(l, 1.0 / 2.4) - 0.055 };
    encoded.copysign(linear)
}

/// [`from_linear`] for a value in [0, 1] by a polynomial. Absolute error below 1e-6, and many times as fast.
#[inline(always)]
pub fn from_linear_nearly(linear: f32) -> f32 {
    let steep = 1.055 * fast::pow(linear, 1.0 / 2.4) - 0.055;
    if linear <= 0.003_130_8 { linear * 12.92 } else { steep }
}

/// [`to_linear`] for a value from 0 on by a polynomial. Relative error below 1e-5.
#[inline(always)]
pub fn to_linear_nearly(encoded: f32) -> f32 {
    let steep = fast::pow((encoded + 0.055) * (1.0 / 1.055), 2.4);
    if encoded <= 0.040_45 { encoded * (1.0 / 12.92) } else { steep }
}

/// Replaces linear light by the nearest of the codes 0..=`top` to its sRGB-encoded value. Values are clipped; NaN
/// becomes 0.
///
/// The codes are exactly those of [`from_linear`]. That slow function is called only near the middle between two codes,
/// where the fast curve cannot decide.
pub fn encode(values: &mut [f32], top: f32) {
    // Twice the error of the fast curve, so that rounding is included.
    const SLACK: f32 = 2e-6;
    let mut nearly = [0.0; 256];
    for values in values.chunks_mut(nearly.len()) {
        let nearly = &mut nearly[..values.len()];
        nearly.copy_from_slice(values);
        curve(nearly, top, 0.5);
        for (value, nearly) in values.iter_mut().zip(nearly) {
            let (low, high) = ((*nearly - SLACK * top) as u32, (*nearly + SLACK * top) as u32);
            *value = if low == high { low } else { nearest_code(from_linear(*value), top) } as f32;
        }
    }
}

/// Replaces linear light by its sRGB-encoded value. Values are clipped to [0, 1]; NaN becomes 0. Absolute error below
/// 1e-6.
pub fn encode_nearly(values: &mut [f32]) {
    curve(values, 1.0, 0.0);
}

dispatch! {
    /// The fast curve from `add` to `top + add`.
    fn curve(values: &mut [f32], top: f32, add: f32) = curve_body
}

#[inline(always)]
fn curve_body(values: &mut [f32], top: f32, add: f32) {
    for value in values {
        let clipped = if *value > 0.0 { *value } else { 0.0 };
        let clipped = if clipped < 1.0 { clipped } else { 1.0 };
        *value = from_linear_nearly(clipped) * top + add;
    }
}

/// The nearest of the codes 0..=`top` to a value. Values are clipped; NaN becomes 0.
pub fn nearest_code(value: f32, top: f32) -> u32 {
    (value.clamp(0.0, 1.0) * top).round() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        // IEC 61966-2-1: 0.5 encodes to 0.735357, and 188/255 is about half of the light.
        assert!((from_linear(0.5) - 0.735_357).abs() < 1e-6);
        assert!((to_linear(188.0 / 255.0) - 0.502_886).abs() < 1e-6);
        assert_eq!(to_linear(0.0), 0.0);
        assert!((to_linear(1.0) - 1.0).abs() < 1e-7);
    }

    #[test]
    fn the_quick_curve_is_the_curve() {
        let worst = (0..=1_000_000)
            .map(|i| i as f32 * 1e-6)
            .map(|l| (from_linear_nearly(l) - from_linear(l)).abs())
            .fold(0.0, f32::max);
        assert!(worst < 1e-6, "{worst}");
    }

    #[test]
    fn many_values_are_encoded_as_one_is() {
        let mut values = [-1.0, 0.0, 0.001, 0.2, 0.7, 1.0, 3.0, f32::NAN];
        let wanted = values.map(|value: f32| if value > 0.0 { from_linear_nearly(value.min(1.0)) } else { 0.0 });
        encode_nearly(&mut values);
        assert!(values.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-7), "{values:?}, not {wanted:?}");
    }

    #[test]
    fn the_quick_curve_back_is_the_curve() {
        let steps = (1..=4_000_000).map(|i| i as f32 * 1e-6);
        let worst = steps.map(|e| (to_linear_nearly(e) / to_linear(e) - 1.0).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-5, "{worst}");
    }

    /// The values are steps through [0, 1] and beyond it, NaN and infinity, and the floats around the middle between
    /// any two codes.
    #[test]
    fn codes_are_those_of_the_curve() {
        for top in [255.0, 65_535.0] {
            let steps = (0..=500_000).map(|i| (i as f32 - 1000.0) * 2.005e-6);
            let middles = (0..top as u32).flat_map(|code| {
                let bits = to_linear((code as f32 + 0.5) / top).to_bits();
                (0..9).map(move |i| f32::from_bits(bits + i - 4))
            });
            let wild = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0, 1e-40, f32::MAX];
            let mut last = 0;
            for linear in steps.chain(middles).chain(wild) {
                let want = nearest_code(from_linear(linear), top);
                let mut code = [linear];
                encode(&mut code, top);
                assert_eq!(code[0], want as f32, "{linear} of {top}");
                last = last.max(want);
            }
            assert_eq!(last, top as u32);
        }
    }

    #[test]
    fn round_trip_of_every_byte() {
        for b in 0..=255_u8 {
            let e = f32::from(b) / 255.0;
            assert_eq!((from_linear(to_linear(e)) * 255.0).round() as u8, b);
        }
    }
}

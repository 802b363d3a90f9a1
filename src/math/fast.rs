//! Elementary functions as `f32` polynomials.
//!
//! They give the same bits on every CPU, and have no branches, so loops over pixels vectorise. `mul_add` is never used:
//! rounding is part of the contract between a pass and its twin. The coefficients are those of Chebyshev interpolation
//! in f64.

/// The reconstruction kernel exp(-2 r^2) for r^2 in [0, 1] (docs/math.md, eq. 4; Wolf 2008, eq. 4.3).
///
/// Absolute error below 3e-7 (the kernel's peak is 1). It is a polynomial in y = 2 r^2 - 1 and has no meaning outside
/// [0, 1].
#[inline(always)]
pub fn kernel(r2: f32) -> f32 {
    const C: [f32; 8] = [
        0.367_879_37,
        -0.367_879_4,
        0.183_942_06,
        -0.061_313_726,
        0.015_316_665,
        -0.003_063_919_3,
        0.000_529_479_4,
        -0.000_075_304_9,
    ];
    let y = 2.0 * r2 - 1.0;
    let mut p = C[7];
    p = p * y + C[6];
    p = p * y + C[5];
    p = p * y + C[4];
    p = p * y + C[3];
    p = p * y + C[2];
    p = p * y + C[1];
    p * y + C[0]
}

/// (erf(b) - erf(a)) / (b - a) for a and b in [-sqrt 2, sqrt 2] (docs/math.md, eq. 13). At a = b it is the derivative,
/// 2/sqrt(pi) exp(-a^2).
///
/// erf(x) = x P(x^2), where P is a polynomial in y = x^2 - 1. With P' the divided difference of P over [a^2, b^2], the
/// slope is P(a^2) + b (a + b) P', so nothing cancels where a and b are close. Absolute error below 5e-7.
#[inline(always)]
pub fn erf_slope(a: f32, b: f32) -> f32 {
    const C: [f32; 9] = [
        0.842_700_8,
        -0.213_796_65,
        0.056_570_612,
        -0.012_549_916,
        0.002_333_079_2,
        -0.000_370_040_27,
        0.000_051_028_65,
        -0.000_006_363_161,
        0.000_000_689_541_5,
    ];
    let y = a * a - 1.0;
    let z = b * b - 1.0;
    // Horner's rule at y, and Horner's rule at z for the quotient that the first one leaves.
    let mut p = C[8];
    let mut slope = C[8];
    let mut i = 7;
    while i > 0 {
        p = p * y + C[i];
        slope = slope * z + p;
        i -= 1;
    }
    p = p * y + C[0];
    p + b * (a + b) * slope
}

/// 2^x for x clamped to [-126, 126]; relative error below 3e-7.
#[inline(always)]
pub fn exp2(x: f32) -> f32 {
    let x = if x > -126.0 { x } else { -126.0 };
    exp2_within(if x < 126.0 { x } else { 126.0 })
}

/// 1.5 * 2^23: adding it leaves the nearest integer in the low mantissa bits.
///
/// A saturating cast would block vector code.
pub const ROUND: f32 = 12_582_912.0;

/// 2^x for x in [-126, 126]; relative error below 3e-7. Beyond, it is any number.
#[inline(always)]
pub fn exp2_within(x: f32) -> f32 {
    const C: [f32; 7] =
        [1.0, std::f32::consts::LN_2, 0.240_226_5, 0.055_503_27, 0.009_618_026, 0.001_340_043_2, 0.000_154_697_32];
    let shifted = x + ROUND;
    let whole = shifted - ROUND;
    let f = x - whole;
    let mut p = C[6];
    p = p * f + C[5];
    p = p * f + C[4];
    p = p * f + C[3];
    p = p * f + C[2];
    p = p * f + C[1];
    p = p * f + C[0];
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}

/// log2(x) for normal x > 0; absolute error below 2e-7 + 1e-7 |log2 x|.
#[inline(always)]
pub fn log2(x: f32) -> f32 {
    const C: [f32; 4] = [2.885_39, 0.961_798_85, 0.576_714_5, 0.431_733];
    const SQRT_HALF_BITS: u32 = 0x3f35_04f3;
    // x = m 2^e with m in [sqrt(1/2), sqrt(2))
    let offset = x.to_bits().wrapping_sub(SQRT_HALF_BITS);
    let e = (offset as i32) >> 23;
    let m = f32::from_bits(x.to_bits().wrapping_sub((e as u32) << 23));
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let mut p = C[3];
    p = p * z + C[2];
    p = p * z + C[1];
    p = p * z + C[0];
    e as f32 + s * p
}

/// log2 of the least value of [`pow`]. Smaller values cannot be seen, and their products would be denormal numbers,
/// with which processors are slow.
const LEAST_POWER: f32 = -90.0;

/// base^exponent for base >= 0 and exponent >= 0; 0^0 = 1. It is at least 2^-90; above, its relative error is
/// below about 1e-6 (1 + exponent |log2 base|).
#[inline(always)]
pub fn pow(base: f32, exponent: f32) -> f32 {
    let base = if base > f32::MIN_POSITIVE { base } else { f32::MIN_POSITIVE };
    let power = exponent * log2(base);
    exp2(if power > LEAST_POWER { power } else { LEAST_POWER })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernel_is_the_gaussian() {
        let worst = (0..=100_000)
            .map(|i| {
                let r2 = i as f32 / 100_000.0;
                (f64::from(kernel(r2)) - (-2.0 * f64::from(r2)).exp()).abs()
            })
            .fold(0.0, f64::max);
        assert!(worst < 3e-7, "{worst}");
        assert!((kernel(0.0) - 1.0).abs() < 3e-7);
    }

    #[test]
    fn erf_slope_is_the_difference_quotient() {
        let places: Vec<f32> = (-200..=200).map(|i| i as f32 / 200.0 * std::f32::consts::SQRT_2).collect();
        let mut worst = 0.0_f64;
        for &a in &places {
            for b in places.iter().copied().chain([a + 1e-3, a + 1e-6, a]) {
                let (x, z) = (f64::from(a), f64::from(b));
                // The quotient of libm's own values cancels for close a and b. There the truth is the mean of the
                // derivative by Simpson's rule.
                let slope = |x: f64| 2.0 / std::f64::consts::PI.sqrt() * (-x * x).exp();
                let want = if (z - x).abs() > 1e-2 {
                    (libm::erf(z) - libm::erf(x)) / (z - x)
                } else {
                    (slope(x) + 4.0 * slope(0.5 * (x + z)) + slope(z)) / 6.0
                };
                worst = worst.max((f64::from(erf_slope(a, b)) - want).abs());
            }
        }
        assert!(worst < 5e-7, "{worst}");
    }

    #[test]
    fn exp2_is_exact_to_rounding() {
        let worst = (-1_250_000..=1_250_000)
            .map(|i| {
                let x = i as f32 * 1e-4;
                (f64::from(exp2(x)) / f64::from(x).exp2() - 1.0).abs()
            })
            .fold(0.0, f64::max);
        assert!(worst < 3e-7, "{worst}");
        assert_eq!(exp2(0.0), 1.0);
        assert_eq!(exp2(10.0), 1024.0);
        assert!(exp2(-1e9) > 0.0 && exp2(1e9).is_finite());
    }

    #[test]
    fn log2_is_exact_to_rounding() {
        for i in 1..200_000 {
            let x = i as f32 * 1.7e-4;
            let want = f64::from(x).log2();
            assert!((f64::from(log2(x)) - want).abs() < 2e-7 + 1e-7 * want.abs(), "{x}");
        }
        assert_eq!(log2(1.0), 0.0);
        assert_eq!(log2(8.0), 3.0);
    }

    #[test]
    fn pow_of_the_ends() {
        assert_eq!(pow(0.0, 0.0), 1.0);
        assert!((1e-28..1e-26).contains(&pow(0.0, 30.0)));
        assert_eq!(pow(1.0, 30.0), 1.0);
        assert!((pow(0.9, 30.0) - 0.042_391_16).abs() < 1e-6);
    }
}

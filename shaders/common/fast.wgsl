// Elementary functions as polynomials. Twin: src/math/fast.rs, which has the same coefficients and states the errors.

// exp(-2 r^2) from r^2 in [0, 1].
fn kernel(r2: Floats) -> Floats {
    let y = 2.0 * r2 - 1.0;
    var p = Floats(-0.0000753049);
    p = p * y + 0.0005294794;
    p = p * y - 0.0030639193;
    p = p * y + 0.015316665;
    p = p * y - 0.061313726;
    p = p * y + 0.18394206;
    p = p * y - 0.3678794;
    return p * y + 0.36787937;
}

// 2^x for x clamped to [-126, 126].
fn power_of_two(exponent: f32) -> f32 {
    let x = clamp(exponent, -126.0, 126.0);
    let whole = round(x);
    let f = x - whole;
    var p = 0.00015469732;
    p = p * f + 0.0013400432;
    p = p * f + 0.009618026;
    p = p * f + 0.05550327;
    p = p * f + 0.2402265;
    p = p * f + 0.6931472;
    p = p * f + 1.0;
    return bitcast<f32>(bitcast<u32>(p) + (bitcast<u32>(i32(whole)) << 23u));
}

// log2(x) for normal x > 0.
fn log_of_two(x: f32) -> f32 {
    // Here x = m 2^e with m in [sqrt(1/2), sqrt(2)).
    let e = bitcast<i32>(bitcast<u32>(x) - 0x3f3504f3u) >> 23u;
    let m = bitcast<f32>(bitcast<u32>(x) - (bitcast<u32>(e) << 23u));
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    var p = 0.431733;
    p = p * z + 0.5767145;
    p = p * z + 0.96179885;
    p = p * z + 2.88539;
    return f32(e) + s * p;
}

// base^exponent for base >= 0 and exponent >= 0; 0^0 = 1. It is at least 2^-90.
fn power(base: f32, exponent: f32) -> f32 {
    return power_of_two(max(exponent * log_of_two(max(base, 1.17549435e-38)), -90.0));
}

// (erf(b) - erf(a)) / (b - a) for a and b in [-sqrt 2, sqrt 2]; WGSL has no erf.
fn erf_slope(a: f32, b: f32) -> f32 {
    let y = a * a - 1.0;
    let z = b * b - 1.0;
    // Horner's rule at y, and Horner's rule at z for the quotient that the first one leaves.
    var p = 0.0000006895415;
    var slope = p;
    p = p * y - 0.000006363161;
    slope = slope * z + p;
    p = p * y + 0.00005102865;
    slope = slope * z + p;
    p = p * y - 0.00037004027;
    slope = slope * z + p;
    p = p * y + 0.0023330792;
    slope = slope * z + p;
    p = p * y - 0.012549916;
    slope = slope * z + p;
    p = p * y + 0.056570612;
    slope = slope * z + p;
    p = p * y - 0.21379665;
    slope = slope * z + p;
    p = p * y + 0.8427008;
    return p + b * (a + b) * slope;
}

// Elementary functions as polynomials. Twin: src/math/fast.rs, which states the errors; the same coefficients.

// exp(-2 r^2) from r^2 in [0, 1].
fn kernel(r2: vec4<f32>) -> vec4<f32> {
    let y = 2.0 * r2 - 1.0;
    var p = vec4<f32>(-0.0000753049);
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
    // x = m 2^e with m in [sqrt(1/2), sqrt(2))
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

// base^exponent for base >= 0 and exponent >= 0; 0^0 = 1.
fn power(base: f32, exponent: f32) -> f32 {
    return power_of_two(exponent * log_of_two(max(base, 1.17549435e-38)));
}

// erf(x), WGSL has none.
fn erf(x: f32) -> f32 {
    let y = clamp(x, -3.92, 3.92);
    let z = y * y;
    var p = 0.0000020347786;
    p = p * z + 0.0002874759;
    p = p * z + 0.003868139;
    p = p * z + 0.053059906;
    p = p * z + 0.19275954;
    p = p * z + 1.128379;
    var q = 0.000038070917;
    q = q * z + 0.001188071;
    q = q * z + 0.015171919;
    q = q * z + 0.11508277;
    q = q * z + 0.50416034;
    q = q * z + 1.0;
    return clamp(y * p / q, -1.0, 1.0);
}

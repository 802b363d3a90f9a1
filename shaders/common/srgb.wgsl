// The sRGB transfer curve by polynomials. Twins: from_linear_nearly and to_linear_nearly of src/math/srgb.rs, which
// state the errors.

// For values from 0 on.
fn from_linear(linear: f32) -> f32 {
    let steep = 1.055 * power(linear, 1.0f / 2.4f) - 0.055;
    return select(steep, linear * 12.92, linear <= 0.0031308);
}

// For values from 0 on.
fn to_linear(encoded: f32) -> f32 {
    let steep = power((encoded + 0.055) * (1.0f / 1.055f), 2.4);
    return select(steep, encoded * (1.0f / 12.92f), encoded <= 0.04045);
}

// What all floats have.

// The bits decide: comparisons with a NaN mean nothing in WGSL.
fn finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

fn all_finite(v: vec3<f32>) -> bool {
    return finite(v.x) && finite(v.y) && finite(v.z);
}

// Rounding of a coordinate, as a share of the coordinates that it is made of: 8 EPSILON.
const ROUNDING: f32 = 9.536743e-7;

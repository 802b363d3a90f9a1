// No light has shadows.

// The share of a light that reaches a place.
fn reaching(light: Light, normal: vec3<f32>, place: vec3<f32>) -> f32 {
    return 1.0;
}

// No sky has any, either.
fn sky_at() -> u32 {
    return 0u;
}

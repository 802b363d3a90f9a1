// Includes: shadows/lookup shadows/light
// The shadows of pixels: each asks the maps.

// The share of a light that reaches a place.
fn reaching(light: Light, normal: vec3<f32>, place: vec3<f32>) -> f32 {
    if light.colour.w == 0.0 { return 1.0; }
    if !faces_light(light, normal, place) { return 0.0; }
    return select(0.0, 1.0, is_lit(u32(light.colour.w) - 1u, place));
}

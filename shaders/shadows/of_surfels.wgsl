// Includes: common/types shadows/light
// The shadows of splats: `shadow_surfels` has left what reaches them in the place of their colours.

// The share of a light that reaches a place.
fn reaching(light: Light, normal: vec3<f32>, place: vec3<f32>) -> f32 {
    // Shadows fall on some objects alone.
    if light.colour.w == 0.0 || (u32(segment.normal[2].w) & 1u) == 0u { return 1.0; }
    if !faces_light(light, normal, place) { return 0.0; }
    let number = u32(light.colour.w) - 1u;
    let mask = u32(values[values_at + number / LIGHTS_OF_MASK]);
    return select(0.0, 1.0, ((mask >> (number % LIGHTS_OF_MASK)) & 1u) != 0u);
}

// Includes: shadows/lookup shadows/light
// The shadows of pixels: each asks the maps.

// Where maps have what the camera shows at `shown`: they are those of the middle of a strip, and held objects are
// elsewhere. Twin: SeenSurface::asked of src/backend/cpu/resolve.rs.
fn in_world(shown: vec3<f32>) -> vec3<f32> {
    let place = shown + moved;
    if !is_held { return place; }
    let at = view_at(SHADOW_LIGHTS, 0u);
    return apply(array<vec4<f32>, 3>(lights[at].vector, lights[at].colour, lights[at + 1u].vector), place);
}

// The share of a light that reaches a place.
fn reaching(light: Light, normal: vec3<f32>, place: vec3<f32>) -> f32 {
    if light.colour.w == 0.0 { return 1.0; }
    var seen = 0.0;
    if faces_light(light, normal, place) {
        seen = select(0.0, 1.0, is_lit(u32(light.colour.w) - 1u, in_world(place), false));
    }
    return 1.0 - receives * (1.0 - seen);
}

// The first record of the light of a whole sky: behind the views of lights and the two of held objects.
fn sky_at() -> u32 {
    return view_at(SHADOW_LIGHTS, 0u) + 2u;
}

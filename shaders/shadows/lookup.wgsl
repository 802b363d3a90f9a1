// Includes: shadows/casters common/numbers
// Does light reach a place? Twin: Shadows::seen and ShadowMap::lights of src/backend/cpu/shadows/.

@group(1) @binding(39) var<storage, read> maps: array<u32>;
@group(1) @binding(40) var<storage, read> casters: array<vec4<f32>>;

// Does light `light`, of those with shadows, reach `place`, relative to the eye in world axes? It does outside the map.
// Captures keep no light from captures.
fn is_lit(light: u32, place: vec3<f32>, of_capture: bool) -> bool {
    let face = facing(light, place);
    let of_light = light_view(light, face);
    let map = map_of(light, face, slice_of(depth_of(place)));
    let size = vec2<u32>(maps[map + SIZE], maps[map + SIZE + 1u]);
    if size.x == 0u { return true; }
    let p = on_plane(of_light, place);
    let corner = bitcast<vec2<f32>>(vec2<u32>(maps[map + CORNER], maps[map + CORNER + 1u]));
    let at = (p.xy - corner) / bitcast<f32>(maps[map + TEXEL]);
    if !(all(at >= vec2<f32>(0.0)) && all(at < vec2<f32>(size))) { return true; }
    let texel = vec2<u32>(at);
    let word = texels_of(light) + maps[map + FIRST_TEXEL] + texel.y * size.x + texel.x;
    if !is_before(light, maps[word], of_light, place, p.z) { return false; }
    if CAPTURE_WORD == 0u || of_capture { return true; }
    return is_before(light, maps[word + CAPTURE_WORD * room()], of_light, place, p.z);
}

// Does a place lie before the end of light by a caster, counted from 1, or is there none? `distance`: along the axis of
// the view.
fn is_before(light: u32, number: u32, of_light: LightView, place: vec3<f32>, distance: f32) -> bool {
    if number == 0u { return true; }
    let caster = caster_of(light, number - 1u);
    let plane = casters[caster];
    let length_of_place = sqrt(dot3(place, place));
    if of_light.is_point {
        // m r is at least -1 / distance, times the distance.
        return dot3(plane.xyz, place - of_light.origin) + 1.0 + ROUNDING * (1.0 + length_of_place / distance) >= 0.0;
    }
    let rounding = ROUNDING * (length_of_place + abs(distance));
    return dot3(plane.xyz, casters[caster + 1u].xyz - place) + plane.w + rounding >= 0.0;
}

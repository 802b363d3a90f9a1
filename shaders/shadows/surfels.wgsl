// Includes: common/types common/views common/work common/segment common/paths common/channels shadows/lookup
// Includes: shadows/light
// A program of pass `attribute`, before it shades: which lights reach the centres of splats.
// Twin: Shadows::seen of src/backend/cpu/shadows/mod.rs.
//   in   segments, geometry, touched
//        lights, maps, casters
//   out  values   of each splat, in place of its colour: for each light with shadows a bit, 24 in a float
// One invocation per surfel of a segment.

@group(1) @binding(0) var<storage, read> geometry: array<f32>;
@group(1) @binding(3) var<storage, read> lights: array<Light>;
@group(1) @binding(5) var<storage, read> touched: array<u32>;
@group(1) @binding(19) var<storage, read_write> values: array<f32>;

@compute @workgroup_size(256)
fn shadow_surfels(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = surfel_of(group.x, lane);
    if index >= segment.surfels { return; }
    view = views[segment.view];
    let slot = segment.first_slot + index;
    if touched[slot] == 0u { return; }
    let place = apply(segment.world, placed(3u * (segment.first_surfel + index)));
    for (var first = 0u; first < SHADOW_LIGHTS; first += LIGHTS_OF_MASK) {
        var mask = 0u;
        for (var light = first; light < min(first + LIGHTS_OF_MASK, SHADOW_LIGHTS); light += 1u) {
            if is_lit(light, place) { mask |= 1u << (light - first); }
        }
        values[slot * VALUES + first / LIGHTS_OF_MASK] = f32(mask);
    }
}

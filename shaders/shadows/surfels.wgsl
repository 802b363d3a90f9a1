// Includes: common/types common/views common/work common/segment common/paths common/channels shadows/lookup
// Includes: shadows/light
// A program of pass `attribute`, before it shades: which lights reach the centres of splats.
// Twin: Shadows::seen of src/backend/cpu/shadows/mod.rs, asked where surfels are in the middle of the group.
//   in   segments, geometry, touched
//        lights, maps, casters
//   out  values   of each splat, in place of its colour: for each light with shadows a bit, 24 in a float
// One invocation per surfel of a segment.

@group(1) @binding(0) var<storage, read> geometry: array<f32>;
@group(1) @binding(3) var<storage, read> lights: array<Light>;
@group(1) @binding(5) var<storage, read> touched: array<u32>;
@group(1) @binding(19) var<storage, read_write> values: array<f32>;

// A surfel in the middle of the group, relative to the eye of the middle, with the normal of its disc, of any length
// and side; then the same, turned as at its own time. Twin: Moved of src/backend/cpu/shadows/moved.rs, which says why.
struct Moved {
    place: vec3<f32>,
    normal: vec3<f32>,
    turned_place: vec3<f32>,
    turned_normal: vec3<f32>,
}

// Surfel `surfel` of the surfel buffer. Afterwards the segment is that of the middle.
fn moved_of(surfel: u32) -> Moved {
    let now = segment.world;
    segment = segments[segment.middle];
    let at = 3u * surfel;
    let centre = placed(at);
    let u = column_of(at, 3u);
    let v = column_of(at, 6u);
    let origin = vec3<f32>(segment.world[0].w, segment.world[1].w, segment.world[2].w);
    return Moved(
        apply(segment.world, centre),
        cross(apply_linear(segment.world, u), apply_linear(segment.world, v)),
        apply_linear(now, centre) + origin,
        cross(apply_linear(now, u), apply_linear(now, v)),
    );
}

// Where it asks the maps of a light.
fn asked(of_light: LightView, surfel: Moved) -> vec3<f32> {
    var towards = -of_light.along;
    var turned = towards;
    if of_light.is_point {
        towards = of_light.origin - surfel.place;
        turned = of_light.origin - surfel.turned_place;
    }
    let is_before = dot3(surfel.normal, towards) > 0.0;
    return select(surfel.turned_place, surfel.place, is_before == (dot3(surfel.turned_normal, turned) > 0.0));
}

@compute @workgroup_size(256)
fn shadow_surfels(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = surfel_of(group.x, lane);
    if index >= segment.surfels { return; }
    view = views[segment.view];
    let slot = segment.first_slot + index;
    if touched[slot] == 0u { return; }
    let surfel = segment.first_surfel + index;
    let moves = segment.middle != segment.index;
    var moved: Moved;
    moved.place = apply(segment.world, placed(3u * surfel));
    if moves { moved = moved_of(surfel); }
    for (var first = 0u; first < SHADOW_LIGHTS; first += LIGHTS_OF_MASK) {
        var mask = 0u;
        for (var light = first; light < min(first + LIGHTS_OF_MASK, SHADOW_LIGHTS); light += 1u) {
            var place = moved.place;
            if moves { place = asked(light_view(light, 0u), moved); }
            if is_lit(light, place, false) { mask |= 1u << (light - first); }
        }
        values[slot * VALUES + first / LIGHTS_OF_MASK] = f32(mask);
    }
}

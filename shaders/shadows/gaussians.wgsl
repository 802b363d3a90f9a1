// Includes: common/types common/views common/work common/fast common/srgb common/gaussian transparent/colour
// Includes: shadows/lookup shadows/light
// A program of pass `project` of Gaussians: what shadows take from the colours of captures, and the colours of lit
// volumes on which shadows fall.
// Twin: emission.rs of src/backend/cpu/transparent/.  Math: docs/math.md, section 17.
//   in   segments, lights, maps, casters
//        geometry    of captures and volumes
//        looks       of volumes
//   out  gaussians   their colours
// One invocation per Gaussian of a segment.

@group(1) @binding(0) var<storage, read> geometry: array<f32>;
@group(1) @binding(32) var<storage, read_write> gaussians: array<DeviceGaussian>;

// Are colours those of a display?
override CODED: bool = false;

@compute @workgroup_size(256)
fn shadow_gaussians(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = work_of(group.x);
    segment = segments[item.x];
    let index = 256u * item.y + lane;
    if index >= segment.count || (segment.flags & FLAG_RECEIVES) == 0u { return; }
    view = views[segment.view];
    let slot = segment.first_slot + index;
    let bounds = unpack(gaussians[slot].bounds);
    if bounds.x > bounds.y { return; }
    let at = 3u * index;
    if (segment.flags & FLAG_VOLUME) != 0u {
        let own = colour_of(index, vec3<f32>(geometry[at], geometry[at + 1u], geometry[at + 2u]));
        gaussians[slot].colour = array<f32, 3>(own.x, own.y, own.z);
        return;
    }
    let place = apply(segment.world, vec3<f32>(geometry[at], geometry[at + 1u], geometry[at + 2u]));
    var all_light = vec3<f32>(0.0);
    var taken = vec3<f32>(0.0);
    for (var i = view.first_light; i < view.first_light + view.lights; i += 1u) {
        let light = lights[i];
        if light.vector.w == HARMONICS {
            // What it shows a normal is 1/4 of it in the mean over normals.
            all_light += 4.0 * light.colour.xyz;
            i += HARMONIC_RECORDS - 1u;
            continue;
        }
        var radiance = light.colour.xyz;
        if light.vector.w != AMBIENT && light.vector.w != DIRECTIONAL {
            let d = light.vector.xyz - place;
            radiance *= 1.0 / max(dot3(d, d), 1e-30);
        }
        all_light += radiance;
        if light.colour.w != 0.0 && !is_lit(u32(light.colour.w) - 1u, place, true) { taken += radiance; }
    }
    if all(taken == vec3<f32>(0.0)) { return; }
    let left = vec3<f32>(
        left_of(all_light.x, taken.x), left_of(all_light.y, taken.y), left_of(all_light.z, taken.z),
    );
    let own = gaussians[slot].colour;
    let shown = vec3<f32>(darkened(own[0], left.x), darkened(own[1], left.y), darkened(own[2], left.z));
    gaussians[slot].colour = array<f32, 3>(shown.x, shown.y, shown.z);
}

// The share of a light that reaches the centre of a kernel, at a place relative to the eye.
fn reaching(light: Light, normal: vec3<f32>, place: vec3<f32>) -> f32 {
    if light.colour.w == 0.0 { return 1.0; }
    if !faces_light(light, normal, place) { return 0.0; }
    return select(0.0, 1.0, is_lit(u32(light.colour.w) - 1u, place, false));
}

// The share of light that is left.
fn left_of(all_light: f32, taken: f32) -> f32 {
    if all_light > taken { return 1.0 - taken / all_light; }
    return select(1.0, 0.0, taken > 0.0);
}

// A number of a colour of which that share is left.
fn darkened(shown: f32, left: f32) -> f32 {
    if !CODED { return left * shown; }
    return from_linear(left * to_linear(shown));
}

// Includes: common/types common/views common/work common/wanted shadows/posed shadows/receive
// What the views of lights show of receivers: of all surfels that the camera may see.
// Twin: Fit::of of src/backend/cpu/shadows/fit.rs.
//   in   segments, geometry   of all surfels; opaque ones receive
//        lights               their views
//        wanted
//   out  maps                 bounds of receivers, as shadows/maps.wgsl has them; 0 before
// One invocation per surfel of a segment, in any order.

@group(1) @binding(0) var<storage, read> geometry: array<f32>;
@group(1) @binding(3) var<storage, read> lights: array<Light>;

// The bounds of a ball on the plane of a view, least x and y first; the first are greater than the last where it is
// beside or behind.
fn bounds_on(of_light: LightView, place: vec3<f32>, radius: f32) -> vec4<f32> {
    if !of_light.is_point { return vec4<f32>(place.xy - radius, place.xy + radius); }
    if place.z <= -radius { return vec4<f32>(1.0, 1.0, -1.0, -1.0); }
    if place.z <= 2.0 * radius { return vec4<f32>(-1.0, -1.0, 1.0, 1.0); }
    let at = place.xy / place.z;
    let extent = 2.0 * radius / place.z * (1.0 + abs(at));
    return vec4<f32>(max(at - extent, vec2<f32>(-1.0)), min(at + extent, vec2<f32>(1.0)));
}

@compute @workgroup_size(256)
fn shadow_fit(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = surfel_of(group.x, lane);
    if index >= segment.surfels || (segment.flags & IS_RECEIVER) == 0u { return; }
    view = views[segment.view];
    let of_surfel = 3u * (segment.first_surfel + index);
    let centre = apply(segment.world, placed(of_surfel));
    let u = column_of(of_surfel, 3u);
    let v = column_of(of_surfel, 6u);
    // A map stretches by no more than the root of the sum of the squares of its entries.
    let x = segment.world[0].xyz;
    let y = segment.world[1].xyz;
    let z = segment.world[2].xyz;
    let radius = sqrt(dot3(u, u) + dot3(v, v)) * sqrt(dot3(x, x) + dot3(y, y) + dot3(z, z));
    let at = vec2<f32>(dot3(view.camera[0].xyz, centre), -dot3(view.camera[1].xyz, centre));
    let depth = depth_of(centre);
    if !sees(at, depth, radius) || !wants(at, depth, radius) { return; }
    let nearest = max(depth - radius, view.near);
    let last = slice_of(depth + radius);
    for (var light = 0u; light < SHADOW_LIGHTS; light += 1u) {
        for (var face = 0u; face < FACES; face += 1u) {
            let of_light = light_view(light, face);
            // Parallel rays have one view.
            if face > 0u && !of_light.is_point { break; }
            let place = turned(of_light, centre - of_light.origin);
            let bounds = bounds_on(of_light, place, radius);
            for (var slice = slice_of(nearest); slice <= last; slice += 1u) {
                // A large surfel is seen in part: what a slice shows of it is within the slice.
                let within = lights[slice_at(light, face, slice)];
                let low = max(bounds.xy, within.vector.xy);
                let high = min(bounds.zw, within.vector.zw);
                if !all(low <= high) { continue; }
                let map = map_of(light, face, slice);
                raise(map, key_of(high.x));
                raise(map + 1u, key_of(high.y));
                raise(map + 2u, ~key_of(low.x));
                raise(map + 3u, ~key_of(low.y));
                raise(map + 4u, ~key_of(max(nearest, within.colour.y)));
                raise(map + 5u, key_of(min(place.z + radius, within.colour.x)));
            }
        }
    }
}

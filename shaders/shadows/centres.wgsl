// Includes: common/types common/views common/work shadows/receive transparent/segment
// What the views of lights show of the centres of Gaussians on which shadows fall. They ask maps although they may lie
// beside the image, where what they show reaches into it.
// Twins: Fit::of of src/backend/cpu/shadows/fit.rs, centres.rs.
//   in   segments, geometry   of captures
//        lights               their views
//        wanted
//   out  maps                 bounds of receivers, as shadows/maps.wgsl has them
// One invocation per Gaussian of a segment, in any order.

@group(1) @binding(0) var<storage, read> geometry: array<f32>;
@group(1) @binding(3) var<storage, read> lights: array<Light>;

// Standard deviations beyond which nothing is seen of a Gaussian.
const REACH_OF_CENTRE: f32 = 4.5;

@compute @workgroup_size(256)
fn shadow_centres(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = work_of(group.x);
    segment = segments[item.x];
    let index = 256u * item.y + lane;
    if index >= segment.count { return; }
    view = views[segment.view];
    let position_at = 3u * index;
    let sigma_at = 3u * (segment.count + index);
    let position = vec3<f32>(geometry[position_at], geometry[position_at + 1u], geometry[position_at + 2u]);
    let centre = apply(segment.world, position);
    // A map stretches by no more than the root of the sum of the squares of its entries.
    let x = segment.world[0].xyz;
    let y = segment.world[1].xyz;
    let z = segment.world[2].xyz;
    let sigma = max(max(geometry[sigma_at], geometry[sigma_at + 1u]), geometry[sigma_at + 2u]);
    let radius = REACH_OF_CENTRE * sqrt(dot3(x, x) + dot3(y, y) + dot3(z, z)) * sigma;
    let at = vec2<f32>(dot3(view.camera[0].xyz, centre), -dot3(view.camera[1].xyz, centre));
    let depth = depth_of(centre);
    if !(depth >= view.near) || !sees(at, depth, radius) || !wants(at, depth, radius) { return; }
    let slice = slice_of(depth);
    for (var light = 0u; light < SHADOW_LIGHTS; light += 1u) {
        let face = facing(light, centre);
        let of_light = light_view(light, face);
        let place = on_plane(of_light, centre);
        let map = map_of(light, face, slice);
        raise(map, key_of(place.x));
        raise(map + 1u, key_of(place.y));
        raise(map + 2u, ~key_of(place.x));
        raise(map + 3u, ~key_of(place.y));
        raise(map + 4u, ~key_of(depth));
        raise(map + 5u, key_of(place.z));
    }
}

// Includes: common/types common/views common/work shadows/posed
// The planes of surfels, each moved away from a light by the tolerance of its object: the ends of light.
// Twin: Caster::of of src/backend/cpu/shadows/map.rs.
//   in   segments, geometry   of all opaque surfels, seen by the camera or not
//        lights               their views
//   out  casters              as shadows/casters.wgsl has them
// One invocation per surfel of a segment, for all lights.

@group(1) @binding(0) var<storage, read> geometry: array<f32>;
@group(1) @binding(3) var<storage, read> lights: array<Light>;
@group(1) @binding(40) var<storage, read_write> casters: array<vec4<f32>>;

// Least cosine between a surface and the light for which the tolerance along the ray grows.
const GRAZING: f32 = 0.1;

@compute @workgroup_size(256)
fn shadow_planes(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = surfel_of(group.x, lane);
    if index >= segment.surfels { return; }
    view = views[segment.view];
    let disc = disc_of(index);
    let normal = cross(disc.u, disc.v);
    let length_of_normal = sqrt(dot3(normal, normal));
    for (var light = 0u; light < SHADOW_LIGHTS; light += 1u) {
        let of_light = light_view(light, 0u);
        let c = disc.centre - of_light.origin;
        let distance = sqrt(dot3(c, c));
        let away = dot3(normal, c);
        let along = select(dot3(normal, of_light.along), away / distance, of_light.is_point);
        let cosine = max(abs(along / length_of_normal), GRAZING);
        let rounding = ROUNDING * (sqrt(dot3(disc.centre, disc.centre)) + distance);
        let tolerance = max(segment.epsilon, rounding) / cosine;
        var first = vec4<f32>(normal * (1.0 / along), tolerance);
        var second = vec4<f32>(disc.centre, 1.0);
        if of_light.is_point {
            first = vec4<f32>(normal * (-1.0 / away) / (1.0 + tolerance / distance), 0.0);
            second = vec4<f32>(0.0, 0.0, 0.0, 1.0);
        }
        if !(all_finite(first.xyz) && finite(tolerance) && all_finite(second.xyz)) { second.w = 0.0; }
        let at = caster_of(light, segment.first_slot + index);
        casters[at] = first;
        casters[at + 1u] = second;
    }
}

// Includes: common/types common/views common/work shadows/posed shadows/splats
// The planes of surfels, each moved away from a light by the tolerance of its object: the ends of light.
// Twin: Caster::of of src/backend/cpu/shadows/caster.rs.
//   in   segments, geometry, looks   of all surfels, seen by the camera or not
//        lights                      their views
//   out  casters                     as shadows/casters.wgsl has them
// One invocation per surfel of a segment, for all lights.

@group(1) @binding(0) var<storage, read> geometry: array<f32>;
@group(1) @binding(1) var<storage, read> looks: array<f32>;
@group(1) @binding(3) var<storage, read> lights: array<Light>;
@group(1) @binding(40) var<storage, read_write> casters: array<vec4<f32>>;

// Least cosine between a surface and the light for which the tolerance along the ray grows.
const GRAZING: f32 = 0.1;

// Opacity of surfel `index` of the segment.
fn opacity_of(index: u32) -> f32 {
    if (segment.flags & SEE_THROUGH) == 0u { return 1.0; }
    var own = 1.0;
    let before = select(6u, 10u, (segment.flags & HAS_MATERIALS) != 0u) * segment.buffer_surfels;
    if (segment.flags & HAS_OPACITIES) != 0u { own = looks[before + segment.first_surfel + index]; }
    return segment.normal[0].w * own;
}

@compute @workgroup_size(256)
fn shadow_planes(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = surfel_of(group.x, lane);
    if index >= segment.surfels { return; }
    view = views[segment.view];
    let are_splats = (segment.flags & ARE_SPLATS) != 0u;
    var disc: Disc;
    var opacity = 1.0;
    if !are_splats { opacity = opacity_of(index); }
    for (var light = 0u; light < SHADOW_LIGHTS; light += 1u) {
        let of_light = light_view(light, 0u);
        if are_splats {
            disc = splat_of(index, light, of_light);
        } else {
            disc = disc_of(index, of_light);
        }
        let normal = cross(disc.u, disc.v);
        let length_of_normal = sqrt(dot3(normal, normal));
        let c = disc.centre - of_light.origin;
        let distance = sqrt(dot3(c, c));
        let away = dot3(normal, c);
        let along = select(dot3(normal, of_light.along), away / distance, of_light.is_point);
        let cosine = max(abs(along / length_of_normal), GRAZING);
        let rounding = ROUNDING * (sqrt(dot3(disc.centre, disc.centre)) + distance);
        let tolerance = max(segment.epsilon, rounding) / cosine;
        var first = vec4<f32>(normal * (1.0 / along), tolerance);
        var second = vec4<f32>(disc.centre, opacity);
        if of_light.is_point {
            let factor = 1.0 + tolerance / distance;
            first = vec4<f32>(normal * (-1.0 / away) / factor, factor);
            second = vec4<f32>(0.0, 0.0, 0.0, opacity);
        }
        let is_plane = length_of_normal > 0.0 && all_finite(first.xyz);
        if !(is_plane && finite(tolerance) && all_finite(second.xyz)) { second.w = -1.0; }
        let at = caster_of(light, number_of(index));
        casters[at] = first;
        casters[at + 1u] = second;
        if are_splats {
            casters[at + 2u] = vec4<f32>(disc.centre, 0.0);
            casters[at + 3u] = vec4<f32>(disc.u, 0.0);
            casters[at + 4u] = vec4<f32>(disc.v, 0.0);
        }
    }
}

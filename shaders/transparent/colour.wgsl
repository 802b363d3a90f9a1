// Includes: common/types common/shading common/srgb transparent/segment
// The colour of a Gaussian as the eye sees it: its own, by direction, or lit.
// Twins: src/backend/cpu/transparent/emission.rs, harmonics.rs.
// A program that uses this declares `reaching`: the share of a light that reaches a place.

@group(1) @binding(1) var<storage, read> looks: array<f32>;
@group(1) @binding(3) var<storage, read> lights: array<Light>;

// Do shadows fall on a volume that is lit? Program `shadow_gaussians` finds its colours.
fn is_shaded_volume() -> bool {
    let all_flags = FLAG_VOLUME | FLAG_LIT | FLAG_RECEIVES;
    return (segment.flags & all_flags) == all_flags;
}

// The colour of a Gaussian as the eye sees it, in the numbers of the image.
fn colour_of(i: u32, position: vec3<f32>) -> vec3<f32> {
    if segment.tint.w != 0.0 { return segment.tint.xyz; }
    let at = 3u * i;
    var own = vec3<f32>(looks[at], looks[at + 1u], looks[at + 2u]);
    if segment.harmonics_used > 0u {
        own += harmonics(i, unit_or_zero(position - segment.eye));
    }
    own = max(own, vec3<f32>(0.0));
    if (segment.flags & FLAG_LIT) != 0u { own = lit(i, own, position); }
    if (segment.flags & FLAG_ENCODE) == 0u { return own; }
    return vec3<f32>(from_linear(own.x), from_linear(own.y), from_linear(own.z));
}

// `colour` lit once for the whole kernel, with the normal on the side of the eye (Zwicker et al. 2002, sections 4.2
// and 7.1). Ambient light alone reaches what has no normal.
fn lit(i: u32, colour: vec3<f32>, position: vec3<f32>) -> vec3<f32> {
    let at = 3u * (segment.count * (1u + segment.harmonics_each) + i);
    let world = apply(segment.world, position);
    var normal = vec3<f32>(looks[at], looks[at + 1u], looks[at + 2u]);
    normal = unit_or_zero(apply_linear(segment.normal, normal));
    if normal.x * world.x + normal.y * world.y + normal.z * world.z > 0.0 { normal = -normal; }
    var material = segment.material;
    if all(normal == vec3<f32>(0.0)) { material = vec4<f32>(material.x, 0.0, 0.0, material.w); }
    return shade(segment.first_light, segment.lights, material, colour, normal, world, unit_or_zero(-world));
}

fn unit_or_zero(v: vec3<f32>) -> vec3<f32> {
    let inverse = 1.0 / sqrt(v.x * v.x + v.y * v.y + v.z * v.z);
    if !finite(inverse) || inverse <= 0.0 { return vec3<f32>(0.0); }
    return v * inverse;
}

// What the harmonics add to the colour of a Gaussian that is seen along the unit vector `d`. Real harmonics of degrees
// 1 to 3 with the Condon-Shortley sign.
fn harmonics(i: u32, d: vec3<f32>) -> vec3<f32> {
    let xx = d.x * d.x;
    let yy = d.y * d.y;
    let zz = d.z * d.z;
    // From degree 1 on, each from -degree to degree.
    var basis = array<f32, 15>(
        -0.48860251 * d.y,
        0.48860251 * d.z,
        -0.48860251 * d.x,
        1.0925484 * d.x * d.y,
        -1.0925484 * d.y * d.z,
        0.31539157 * (2.0 * zz - xx - yy),
        -1.0925484 * d.x * d.z,
        0.5462742 * (xx - yy),
        -0.5900436 * d.y * (3.0 * xx - yy),
        2.8906114 * d.x * d.y * d.z,
        -0.4570458 * d.y * (4.0 * zz - xx - yy),
        0.37317634 * d.z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.4570458 * d.x * (4.0 * zz - xx - yy),
        1.4453057 * d.z * (xx - yy),
        -0.5900436 * d.x * (xx - 3.0 * yy),
    );
    let first = 3u * (segment.count + segment.harmonics_each * i);
    var sum = vec3<f32>(0.0);
    for (var k = 0u; k < segment.harmonics_used; k += 1u) {
        let at = first + 3u * k;
        sum += vec3<f32>(looks[at], looks[at + 1u], looks[at + 2u]) * basis[k];
    }
    return sum;
}

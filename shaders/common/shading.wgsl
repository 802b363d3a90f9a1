// The shading equation. Twin: src/shading.rs.  Math: docs/math.md, eq. 7; Wolf 2008, 4.1.1.

// Diffuse and specular factor of a light in the unit direction `towards`. Twin: shading::lobes.
fn lobes(n: vec3<f32>, towards: vec3<f32>, eye: vec3<f32>, shininess: f32) -> vec2<f32> {
    let nl = n.x * towards.x + n.y * towards.y + n.z * towards.z;
    let nv = n.x * eye.x + n.y * eye.y + n.z * eye.z;
    let lv = towards.x * eye.x + towards.y * eye.y + towards.z * eye.z;
    let rv = 2.0 * nl * nv - lv;
    return vec2<f32>(max(nl, 0.0), power(max(rv, 0.0), shininess));
}

// Length of the normal that shades, given the squared length of the mean of unit normals. Twin: shading::agreement.
fn agreement(length2: f32) -> f32 {
    let length = sqrt(length2);
    let faded = 0.72 + 2.0 * (length - 0.72);
    return min(select(length, faded, length > 0.72), 1.0);
}

// What a white surface shows of light from all around: nine harmonics, from record `first` on.
// Twin: shading::smooth_light.
fn smooth_light(first: u32, n: vec3<f32>) -> vec3<f32> {
    let xx = n.x * n.x;
    let zz = n.z * n.z;
    var sum = lights[first].colour.xyz;
    sum += lights[first].vector.xyz * n.x;
    sum += lights[first + 1u].colour.xyz * n.y;
    sum += lights[first + 1u].vector.xyz * n.z;
    sum += lights[first + 2u].colour.xyz * (n.x * n.y);
    sum += lights[first + 2u].vector.xyz * (n.y * n.z);
    sum += lights[first + 3u].colour.xyz * (2.0 * n.x * n.z);
    sum += lights[first + 3u].vector.xyz * (xx - zz);
    sum += lights[first + 4u].colour.xyz * (2.0 * n.y * n.y - (xx + zz));
    return max(sum, vec3<f32>(0.0));
}

// Shades a surface point. `material` is (ambient, diffuse, specular, shininess). `position` is relative to the eye and
// only needed for point lights and shadows. `eye` is the unit direction to the eye. A program that uses this declares
// `reaching`: the share of a light that reaches a place.
fn shade(
    first_light: u32, count: u32, material: vec4<f32>, colour: vec3<f32>, normal: vec3<f32>, position: vec3<f32>,
    eye: vec3<f32>,
) -> vec3<f32> {
    var lit = vec3<f32>(0.0);
    for (var i = first_light; i < first_light + count; i += 1u) {
        let light = lights[i];
        if light.vector.w == AMBIENT {
            lit += material.x * colour * light.colour.xyz;
            continue;
        }
        if light.vector.w == HARMONICS {
            lit += material.y * colour * smooth_light(i, normal);
            i += HARMONIC_RECORDS - 1u;
            continue;
        }
        var towards = light.vector.xyz;
        var radiance = light.colour.xyz;
        if light.vector.w != DIRECTIONAL {
            let d = light.vector.xyz - position;
            let inverse = 1.0 / max(d.x * d.x + d.y * d.y + d.z * d.z, 1e-30);
            towards = d * sqrt(inverse);
            radiance = radiance * inverse;
        }
        radiance = radiance * reaching(light, normal, position);
        let factors = lobes(normal, towards, eye, material.w);
        lit += radiance * (material.y * factors.x * colour + material.z * factors.y);
    }
    return lit;
}

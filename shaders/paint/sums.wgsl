// The sums of a quad: how they are loaded, added to and stored. Math: docs/math.md, eq. 6.

// The sums of one quad.
struct Sums {
    weight: vec4<f32>,
    red: vec4<f32>,
    green: vec4<f32>,
    blue: vec4<f32>,
    normal_x: vec4<f32>,
    normal_y: vec4<f32>,
    normal_z: vec4<f32>,
    depth: vec4<f32>,
    velocity_x: vec4<f32>,
    velocity_y: vec4<f32>,
    ambient: vec4<f32>,
    diffuse: vec4<f32>,
    specular: vec4<f32>,
    shininess: vec4<f32>,
    reflection: vec4<f32>,
    opacity: vec4<f32>,
    sample_coverage: vec4<f32>,
    coverage: vec4<f32>,
    static_coverage: vec4<f32>,
    peak: vec4<f32>,
    side: vec4<f32>,
    discs: vec4<f32>,
    // The turn that `sample_coverage` belongs to: 0 for static objects, then one for each sample in order.
    turn: u32,
}

// Ends all turns before `next`. The part of the pixel that a sample covers counts with the sample's weight. Static
// objects are in every sample.
fn turn(sum: ptr<function, Sums>, next: u32) {
    var at = (*sum).turn;
    if at == 0u {
        (*sum).static_coverage = (*sum).sample_coverage;
        at = 1u;
    }
    for (; at < next; at += 1u) {
        (*sum).coverage += segments[at - 1u].weight * min((*sum).sample_coverage, vec4<f32>(1.0));
        (*sum).sample_coverage = (*sum).static_coverage;
    }
    (*sum).turn = next;
}

// Adds the values of a slot. `depth` must be finite where the weight is 0.
fn add_values(sum: ptr<function, Sums>, slot: u32, weight: vec4<f32>, depth: vec4<f32>) {
    var next = slot * VALUES;
    (*sum).weight += weight;
    (*sum).red += weight * values[next];
    (*sum).green += weight * values[next + 1u];
    (*sum).blue += weight * values[next + 2u];
    next += 3u;
    if NORMAL != 0u {
        (*sum).normal_x += weight * values[next];
        (*sum).normal_y += weight * values[next + 1u];
        (*sum).normal_z += weight * values[next + 2u];
        next += 3u;
    }
    if DEPTH != 0u {
        (*sum).depth += depth * weight;
    }
    if VELOCITY != 0u {
        (*sum).velocity_x += weight * values[next];
        (*sum).velocity_y += weight * values[next + 1u];
        next += 2u;
    }
    if MATERIAL != 0u {
        (*sum).ambient += weight * values[next];
        (*sum).diffuse += weight * values[next + 1u];
        (*sum).specular += weight * values[next + 2u];
        (*sum).shininess += weight * values[next + 3u];
        next += 4u;
    }
    if REFLECTION != 0u {
        (*sum).reflection += weight * values[next];
        next += 1u;
    }
    if OPACITY != 0u { (*sum).opacity += weight * values[next]; }
}

fn load_sums(sum: ptr<function, Sums>, at: u32) {
    (*sum).weight = sums[at];
    (*sum).red = sums[at + TILE_QUADS];
    (*sum).green = sums[at + 2u * TILE_QUADS];
    (*sum).blue = sums[at + 3u * TILE_QUADS];
    if NORMAL != 0u {
        (*sum).normal_x = sums[at + NORMAL * TILE_QUADS];
        (*sum).normal_y = sums[at + (NORMAL + 1u) * TILE_QUADS];
        (*sum).normal_z = sums[at + (NORMAL + 2u) * TILE_QUADS];
    }
    if DEPTH != 0u {
        (*sum).depth = sums[at + DEPTH * TILE_QUADS];
    }
    if VELOCITY != 0u {
        (*sum).velocity_x = sums[at + VELOCITY * TILE_QUADS];
        (*sum).velocity_y = sums[at + (VELOCITY + 1u) * TILE_QUADS];
    }
    if MATERIAL != 0u {
        (*sum).ambient = sums[at + MATERIAL * TILE_QUADS];
        (*sum).diffuse = sums[at + (MATERIAL + 1u) * TILE_QUADS];
        (*sum).specular = sums[at + (MATERIAL + 2u) * TILE_QUADS];
        (*sum).shininess = sums[at + (MATERIAL + 3u) * TILE_QUADS];
    }
    if REFLECTION != 0u { (*sum).reflection = sums[at + REFLECTION * TILE_QUADS]; }
    if OPACITY != 0u { (*sum).opacity = sums[at + OPACITY * TILE_QUADS]; }
    if SAMPLE_COVERAGE != 0u {
        (*sum).sample_coverage = sums[at + SAMPLE_COVERAGE * TILE_QUADS];
        (*sum).coverage = sums[at + (SAMPLE_COVERAGE + 1u) * TILE_QUADS];
        (*sum).static_coverage = sums[at + (SAMPLE_COVERAGE + 2u) * TILE_QUADS];
    }
    if PEAK != 0u {
        (*sum).peak = sums[at + PEAK * TILE_QUADS];
        (*sum).side = sums[at + (PEAK + 1u) * TILE_QUADS];
        (*sum).discs = sums[at + (PEAK + 2u) * TILE_QUADS];
    }
}

fn store_sums(sum: ptr<function, Sums>, at: u32) {
    sums[at] = (*sum).weight;
    sums[at + TILE_QUADS] = (*sum).red;
    sums[at + 2u * TILE_QUADS] = (*sum).green;
    sums[at + 3u * TILE_QUADS] = (*sum).blue;
    if NORMAL != 0u {
        sums[at + NORMAL * TILE_QUADS] = (*sum).normal_x;
        sums[at + (NORMAL + 1u) * TILE_QUADS] = (*sum).normal_y;
        sums[at + (NORMAL + 2u) * TILE_QUADS] = (*sum).normal_z;
    }
    if DEPTH != 0u {
        sums[at + DEPTH * TILE_QUADS] = (*sum).depth;
    }
    if VELOCITY != 0u {
        sums[at + VELOCITY * TILE_QUADS] = (*sum).velocity_x;
        sums[at + (VELOCITY + 1u) * TILE_QUADS] = (*sum).velocity_y;
    }
    if MATERIAL != 0u {
        sums[at + MATERIAL * TILE_QUADS] = (*sum).ambient;
        sums[at + (MATERIAL + 1u) * TILE_QUADS] = (*sum).diffuse;
        sums[at + (MATERIAL + 2u) * TILE_QUADS] = (*sum).specular;
        sums[at + (MATERIAL + 3u) * TILE_QUADS] = (*sum).shininess;
    }
    if REFLECTION != 0u { sums[at + REFLECTION * TILE_QUADS] = (*sum).reflection; }
    if OPACITY != 0u { sums[at + OPACITY * TILE_QUADS] = (*sum).opacity; }
    if SAMPLE_COVERAGE != 0u {
        sums[at + SAMPLE_COVERAGE * TILE_QUADS] = (*sum).sample_coverage;
        sums[at + (SAMPLE_COVERAGE + 1u) * TILE_QUADS] = (*sum).coverage;
        sums[at + (SAMPLE_COVERAGE + 2u) * TILE_QUADS] = (*sum).static_coverage;
    }
    if PEAK != 0u {
        sums[at + PEAK * TILE_QUADS] = (*sum).peak;
        sums[at + (PEAK + 1u) * TILE_QUADS] = (*sum).side;
        sums[at + (PEAK + 2u) * TILE_QUADS] = (*sum).discs;
    }
}

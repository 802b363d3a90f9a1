// The sums of an invocation's pixels: how they are loaded, added to and stored. Math: docs/math.md, eq. 6.

// Size of a plane of a tile, in `Floats`.
fn plane() -> u32 {
    return TILE_PIXELS / width();
}

// The sums of the pixels.
struct Sums {
    weight: Floats,
    red: Floats,
    green: Floats,
    blue: Floats,
    normal_x: Floats,
    normal_y: Floats,
    normal_z: Floats,
    depth: Floats,
    velocity_x: Floats,
    velocity_y: Floats,
    ambient: Floats,
    diffuse: Floats,
    specular: Floats,
    shininess: Floats,
    reflection: Floats,
    receives: Floats,
    catcher: Floats,
    held: Floats,
    moved_x: Floats,
    moved_y: Floats,
    moved_z: Floats,
    opacity: Floats,
    sample_coverage: Floats,
    coverage: Floats,
    static_coverage: Floats,
    peak: Floats,
    side: Floats,
    discs: Floats,
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
        (*sum).coverage += segments[view.first_segment + at - 1u].weight * min((*sum).sample_coverage, Floats(1.0));
        (*sum).sample_coverage = (*sum).static_coverage;
    }
    (*sum).turn = next;
}

// Adds the values of a slot. `depth` must be finite where the weight is 0.
fn add_values(sum: ptr<function, Sums>, slot: u32, weight: Floats, depth: Floats) {
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
    if RECEIVES != 0u {
        (*sum).receives += weight * values[next];
        next += 1u;
    }
    if CATCHER != 0u {
        (*sum).catcher += weight * values[next];
        next += 1u;
    }
    if HELD != 0u {
        (*sum).held += weight * values[next];
        next += 1u;
    }
    if MOVED != 0u {
        (*sum).moved_x += weight * values[next];
        (*sum).moved_y += weight * values[next + 1u];
        (*sum).moved_z += weight * values[next + 2u];
        next += 3u;
    }
    if OPACITY != 0u { (*sum).opacity += weight * values[next]; }
}

fn load_sums(sum: ptr<function, Sums>, at: u32) {
    (*sum).weight = sums[at];
    (*sum).red = sums[at + plane()];
    (*sum).green = sums[at + 2u * plane()];
    (*sum).blue = sums[at + 3u * plane()];
    if NORMAL != 0u {
        (*sum).normal_x = sums[at + NORMAL * plane()];
        (*sum).normal_y = sums[at + (NORMAL + 1u) * plane()];
        (*sum).normal_z = sums[at + (NORMAL + 2u) * plane()];
    }
    if DEPTH != 0u {
        (*sum).depth = sums[at + DEPTH * plane()];
    }
    if VELOCITY != 0u {
        (*sum).velocity_x = sums[at + VELOCITY * plane()];
        (*sum).velocity_y = sums[at + (VELOCITY + 1u) * plane()];
    }
    if MATERIAL != 0u {
        (*sum).ambient = sums[at + MATERIAL * plane()];
        (*sum).diffuse = sums[at + (MATERIAL + 1u) * plane()];
        (*sum).specular = sums[at + (MATERIAL + 2u) * plane()];
        (*sum).shininess = sums[at + (MATERIAL + 3u) * plane()];
    }
    if REFLECTION != 0u { (*sum).reflection = sums[at + REFLECTION * plane()]; }
    if RECEIVES != 0u { (*sum).receives = sums[at + RECEIVES * plane()]; }
    if CATCHER != 0u { (*sum).catcher = sums[at + CATCHER * plane()]; }
    if HELD != 0u { (*sum).held = sums[at + HELD * plane()]; }
    if MOVED != 0u {
        (*sum).moved_x = sums[at + MOVED * plane()];
        (*sum).moved_y = sums[at + (MOVED + 1u) * plane()];
        (*sum).moved_z = sums[at + (MOVED + 2u) * plane()];
    }
    if OPACITY != 0u { (*sum).opacity = sums[at + OPACITY * plane()]; }
    if SAMPLE_COVERAGE != 0u {
        (*sum).sample_coverage = sums[at + SAMPLE_COVERAGE * plane()];
        (*sum).coverage = sums[at + (SAMPLE_COVERAGE + 1u) * plane()];
        (*sum).static_coverage = sums[at + (SAMPLE_COVERAGE + 2u) * plane()];
    }
    if PEAK != 0u {
        (*sum).peak = sums[at + PEAK * plane()];
        (*sum).side = sums[at + (PEAK + 1u) * plane()];
        (*sum).discs = sums[at + (PEAK + 2u) * plane()];
    }
}

fn store_sums(sum: ptr<function, Sums>, at: u32) {
    sums[at] = (*sum).weight;
    sums[at + plane()] = (*sum).red;
    sums[at + 2u * plane()] = (*sum).green;
    sums[at + 3u * plane()] = (*sum).blue;
    if NORMAL != 0u {
        sums[at + NORMAL * plane()] = (*sum).normal_x;
        sums[at + (NORMAL + 1u) * plane()] = (*sum).normal_y;
        sums[at + (NORMAL + 2u) * plane()] = (*sum).normal_z;
    }
    if DEPTH != 0u {
        sums[at + DEPTH * plane()] = (*sum).depth;
    }
    if VELOCITY != 0u {
        sums[at + VELOCITY * plane()] = (*sum).velocity_x;
        sums[at + (VELOCITY + 1u) * plane()] = (*sum).velocity_y;
    }
    if MATERIAL != 0u {
        sums[at + MATERIAL * plane()] = (*sum).ambient;
        sums[at + (MATERIAL + 1u) * plane()] = (*sum).diffuse;
        sums[at + (MATERIAL + 2u) * plane()] = (*sum).specular;
        sums[at + (MATERIAL + 3u) * plane()] = (*sum).shininess;
    }
    if REFLECTION != 0u { sums[at + REFLECTION * plane()] = (*sum).reflection; }
    if RECEIVES != 0u { sums[at + RECEIVES * plane()] = (*sum).receives; }
    if CATCHER != 0u { sums[at + CATCHER * plane()] = (*sum).catcher; }
    if HELD != 0u { sums[at + HELD * plane()] = (*sum).held; }
    if MOVED != 0u {
        sums[at + MOVED * plane()] = (*sum).moved_x;
        sums[at + (MOVED + 1u) * plane()] = (*sum).moved_y;
        sums[at + (MOVED + 2u) * plane()] = (*sum).moved_z;
    }
    if OPACITY != 0u { sums[at + OPACITY * plane()] = (*sum).opacity; }
    if SAMPLE_COVERAGE != 0u {
        sums[at + SAMPLE_COVERAGE * plane()] = (*sum).sample_coverage;
        sums[at + (SAMPLE_COVERAGE + 1u) * plane()] = (*sum).coverage;
        sums[at + (SAMPLE_COVERAGE + 2u) * plane()] = (*sum).static_coverage;
    }
    if PEAK != 0u {
        sums[at + PEAK * plane()] = (*sum).peak;
        sums[at + (PEAK + 1u) * plane()] = (*sum).side;
        sums[at + (PEAK + 2u) * plane()] = (*sum).discs;
    }
}

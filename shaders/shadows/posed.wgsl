// Includes: common/segment common/paths common/numbers shadows/casters
// Surfels of shadow maps, posed.

struct Disc {
    centre: vec3<f32>,
    u: vec3<f32>,
    v: vec3<f32>,
}

// Surfel `index` of the segment, relative to the eye, in world axes.
fn disc_of(index: u32) -> Disc {
    let at = 3u * (segment.first_surfel + index);
    let u = apply_linear(segment.world, column_of(at, 3u));
    return Disc(apply(segment.world, placed(at)), u, apply_linear(segment.world, column_of(at, 6u)));
}

// Pass `attribute`: sums the attributes of the splats that pass the depth test, with their weights.
// Twins: src/backend/cpu/values.rs, paint/attribute.rs, published/low_pass.rs.  Math: docs/math.md, eq. 6 and 10.
//
// `splat_values`, one invocation per surfel of a segment:
//   in   segment, travels, geometry, looks, lights, environment
//   out  values    for each slot: colour, then normal, velocity, material, reflection and opacity where wanted
// `sum_attributes`, one workgroup per tile, one invocation per quad of pixels; sums are in registers, in list order:
//   in   splats, list, starts, wide, thresholds, values; segments: sample of a splat, its weight and share
//   out  sums      for each tile, for each channel, its quads: weight, colour, then normal, depth, velocity and
//                  material where they are wanted. In groups of several samples three channels follow: the sample
//                  coverage of the current sample, the coverage by the samples before it, and the sample coverage of
//                  static objects

@group(0) @binding(1) var<uniform> segment: Segment;
@group(1) @binding(0) var<storage, read> geometry: array<f32>;
@group(1) @binding(1) var<storage, read> looks: array<f32>;
@group(1) @binding(2) var<storage, read> segments: array<Segment>;
@group(1) @binding(3) var<storage, read> lights: array<Light>;
@group(1) @binding(4) var<storage, read> splats: array<Splat>;
@group(1) @binding(5) var<storage, read> touched: array<u32>;
@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(17) var<storage, read> thresholds: array<vec4<f32>>;
@group(1) @binding(18) var<storage, read_write> written_values: array<f32>;
@group(1) @binding(19) var<storage, read> values: array<f32>;
@group(1) @binding(23) var<storage, read> travels: array<Travel>;
@group(1) @binding(20) var<storage, read_write> sums: array<vec4<f32>>;

// First channel of each quantity; 0 if it is not wanted. They are those of `Channels` in src/layout.rs.
override NORMAL: u32 = 0u;
override DEPTH: u32 = 0u;
override VELOCITY: u32 = 0u;
override MATERIAL: u32 = 0u;
// First of three channels for the coverage in groups of several samples; 0 in other groups. They are the sample
// coverage of the current sample, the coverage by the samples before it, and the sample coverage of static objects.
override SAMPLE_COVERAGE: u32 = 0u;
// Channel of the reflection coefficient; 0 without it.
override REFLECTION: u32 = 0u;
// Channel of the opacity; 0 without it.
override OPACITY: u32 = 0u;
// Number of channels, and number of floats of a splat in `values`.
override CHANNELS: u32 = 4u;
override VALUES: u32 = 3u;
override GOURAUD: bool = false;
// First of three channels of full EWA: weight times peak, weights that are negative for backs, and discs that cover; 0
// without it.
override PEAK: u32 = 0u;
// Size of a slot's content in splats, and the part of it that has the flags.
override SPLATS: u32 = 1u;
override PART: u32 = 0u;

@compute @workgroup_size(256)
fn splat_values(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= segment.surfels { return; }
    let slot = segment.first_slot + id.x;
    if touched[slot] == 0u { return; }
    let surfel = segment.first_surfel + id.x;
    let at = 3u * surfel;
    let column = 3u * segment.buffer_surfels;
    var normal = vec3<f32>(looks[at], looks[at + 1u], looks[at + 2u]);
    var turned_normal = apply_linear(segment.normal, normal);
    let place = splats[SPLATS * slot + PART].reference;
    if view.strip != 0.0 && splats[SPLATS * slot + PART].centre_depth > 0.0 {
        // When the row is read out on which the centre lands.
        let half = abs(view.strip);
        let time = clamp((select(place.x, place.y, view.strip > 0.0) - half) / half, -1.0, 1.0);
        turned_normal += time * apply_linear(travels[segment.index].turn, normal);
    }
    normal = unit(turned_normal);
    if (splats[SPLATS * slot + PART].flags & FLAG_BACK) != 0u {
        normal = -normal;
    }
    var colour = vec3<f32>(looks[column + at], looks[column + at + 1u], looks[column + at + 2u]);
    let mipmap = u32(segment.normal[2].w) * segment.buffer_surfels;
    if mipmap > 0u { colour = of_texture(colour, mipmap + 3u * MIPMAP_LEVELS * surfel, texture_variance(at, column)); }
    var material = segment.material;
    if (segment.flags & 2u) != 0u {
        let m = 2u * column + 4u * surfel;
        material = vec4<f32>(looks[m], looks[m + 1u], looks[m + 2u], looks[m + 3u]);
    }
    let position = placed(at);
    if GOURAUD {
        let world = apply(segment.world, position);
        let eye = unit(-world);
        colour = shade(segment.first_light, view.lights, material, colour, normal, world, eye);
        if FACE != 0u && segment.normal[1].w > 0.0 {
            let pixel = view.pixel / view.focal;
            colour += surroundings(mirrored(normal, eye), pixel * pixel) * segment.normal[1].w;
        }
    }
    var next = slot * VALUES;
    written_values[next] = colour.x;
    written_values[next + 1u] = colour.y;
    written_values[next + 2u] = colour.z;
    next += 3u;
    if NORMAL != 0u {
        written_values[next] = normal.x;
        written_values[next + 1u] = normal.y;
        written_values[next + 2u] = normal.z;
        next += 3u;
    }
    if VELOCITY != 0u {
        // The derivative of (x, y) = (X, Y) / depth, in pixels of the image. It is 0 where the centre has no image.
        let p = apply(segment.screen, position);
        let own = apply_linear(segment.screen, own_velocity(at) * travels[segment.index].pace);
        let rate = apply(segment.rate, position) + own;
        var velocity = vec2<f32>(0.0);
        if p.z >= view.near {
            let over = 1.0 / p.z;
            velocity = vec2<f32>((rate.x - p.x * over * rate.z) * over, (rate.y - p.y * over * rate.z) * over);
        }
        written_values[next] = velocity.x * view.stride;
        written_values[next + 1u] = velocity.y * view.stride;
        next += 2u;
    }
    if MATERIAL != 0u {
        written_values[next] = material.x;
        written_values[next + 1u] = material.y;
        written_values[next + 2u] = material.z;
        written_values[next + 3u] = material.w;
        next += 4u;
    }
    if REFLECTION != 0u {
        written_values[next] = segment.normal[1].w;
        next += 1u;
    }
    if OPACITY != 0u {
        let before = select(6u, 10u, (segment.flags & 2u) != 0u) * segment.buffer_surfels;
        var own = 1.0;
        if (segment.flags & 4u) != 0u { own = looks[before + surfel]; }
        written_values[next] = segment.normal[0].w * own;
    }
}

// Variance of the filter of level 0 of a texture, squares of a surfel's cut-off radius.
const TEXTURE_VARIANCE: f32 = 0.288675 * 0.288675;
// Levels above 0, and the variance of the last one in those of level 0.
const MIPMAP_LEVELS: u32 = 4u;
const MOST_VARIANCE: f32 = 256.0;
// What the longer axis of a pixel's image on the surface counts in the variance of the filter of its texture.
const OF_LONGER: f32 = 0.7;

// The colour of a texture under a Gaussian of `variance`, in those of level 0: from 1 to `MOST_VARIANCE`. It is linear
// in the variance between two levels. `finest` is level 0; the others are at `levels`.
fn of_texture(finest: vec3<f32>, levels: u32, variance: f32) -> vec3<f32> {
    var finer = 0u;
    var of_finer = variance;
    while finer + 1u < MIPMAP_LEVELS && of_finer >= 4.0 {
        of_finer *= 0.25;
        finer += 1u;
    }
    let to = levels + 3u * finer;
    var from_colour = finest;
    if finer > 0u { from_colour = vec3<f32>(looks[to - 3u], looks[to - 2u], looks[to - 1u]); }
    let to_colour = vec3<f32>(looks[to], looks[to + 1u], looks[to + 2u]);
    return from_colour + (to_colour - from_colour) * ((of_finer - 1.0) * (1.0 / 3.0));
}

// The variance of the filter of a surfel's texture, in those of level 0. `at`: where the surfel's position is.
// Twin: texture_variance of src/backend/cpu/values.rs.
fn texture_variance(at: u32, column: u32) -> f32 {
    let c = apply(segment.screen, placed(at));
    let at_u = at + column;
    let u = apply_linear(segment.screen, vec3<f32>(geometry[at_u], geometry[at_u + 1u], geometry[at_u + 2u]));
    let at_v = at_u + column;
    let v = apply_linear(segment.screen, vec3<f32>(geometry[at_v], geometry[at_v + 1u], geometry[at_v + 2u]));
    let over = 1.0 / c.z;
    let x = c.x * over;
    let y = c.y * over;
    let ux = (u.x - x * u.z) * over;
    let uy = (u.y - y * u.z) * over;
    let vx = (v.x - x * v.z) * over;
    let vy = (v.y - y * v.z) * over;
    let area = ux * vy - uy * vx;
    let half = 0.5 * (ux * ux + uy * uy + vx * vx + vy * vy);
    let product = area * area;
    let longer = half + sqrt(max(half * half - product, 0.0));
    let of_pixel = OF_LONGER * (longer / product) + (1.0 - OF_LONGER) / longer;
    let variance = view.footprint * view.footprint * of_pixel * (1.0 / TEXTURE_VARIANCE);
    if !(variance > 1.0) || c.z < view.near { return 1.0; }
    return min(variance, MOST_VARIANCE);
}

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

@compute @workgroup_size(4, 16)
fn sum_attributes(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) quad: vec3<u32>) {
    let index = tile.y * view.tiles.x + tile.x;
    let in_tile = quad.y * 4u + quad.x;
    let column = tile.x * TILE + quad.x * 4u;
    let row = (view.first_tile_row + tile.y) * TILE + quad.y;
    let limit = thresholds[index * TILE_QUADS + in_tile];
    if all(limit == vec4<f32>(UNWANTED)) { return; }
    var walk = walk_of(index);
    let at = index * CHANNELS * TILE_QUADS + in_tile;
    var sum: Sums;
    sum.turn = view.first_turn;
    if view.resumes != 0u {
        if SAMPLE_COVERAGE == 0u && !has_next(walk) { return; }
        load_sums(&sum, at);
    }
    while has_next(walk) {
        add_splat(&sum, next_slot(&walk), limit, column, row);
    }
    if SAMPLE_COVERAGE != 0u && sum.turn < view.last_turn {
        turn(&sum, view.last_turn);
    }
    store_sums(&sum, at);
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

fn add_splat(sum: ptr<function, Sums>, slot: u32, limit: vec4<f32>, column: u32, row: u32) {
    let bounds = unpack(splats[slot].bounds);
    if !touches(bounds, column, row) { return; }
    let splat = splats[slot];
    var share = 1.0;
    if SAMPLE_COVERAGE != 0u {
        let segment_index = splat.flags >> 1u;
        share = segments[segment_index].share;
        let its_turn = segments[segment_index].flags >> 3u;
        if its_turn != (*sum).turn {
            turn(sum, its_turn);
        }
    }
    let at = hit(splat, column, row);
    let plane_depth = 1.0 / at.inverse_depth;
    let inside = at.inside & (at.inverse_depth <= vec4<f32>(view.most_inverse_depth));
    let none = vec4<f32>(NONE);
    let r3d = select(none, at.scaled_r2 * (plane_depth * plane_depth), inside);
    let with_low_pass = view.low_pass > 0.0 && splat.centre_depth > 0.0;
    let r2d = select(none, (at.x * at.x + at.y * at.y) * view.low_pass_scale, with_low_pass);
    let depth = select(vec4<f32>(splat.centre_depth), plane_depth, inside);
    let r2 = min(r2d, r3d);
    let within = in_columns(bounds, column);
    let hits = (inside | (r2 <= vec4<f32>(1.0))) & within;
    let passes = hits & (depth <= limit);
    let zero = vec4<f32>(0.0);
    let unshared = select(zero, kernel(min(r2, vec4<f32>(1.0))), hits);
    if SAMPLE_COVERAGE != 0u {
        // A hidden splat covers the pixel, too: what hides it covers it.
        (*sum).sample_coverage += select(unshared, vec4<f32>(1.0), inside & within);
    }
    if !any(passes) { return; }
    let weight = select(zero, unshared * share, passes);
    add_values(sum, slot, weight, select(zero, depth, passes));
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

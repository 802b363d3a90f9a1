// Pass `composite`: the Gaussians of a tile, front to back.
// Twins: src/backend/cpu/transparent/composite.rs, accumulators.rs.  Math: docs/math.md, sections 11 and 12.
//   in   splats, list, starts, wide   output of `gather` and `bin`: in the order of depth
//        thresholds                   T of opaque surfels, where the view has any
//   in and out  sums   for each tile, for each channel, its quads: transmittance, red, green, blue, and where they are
//                      wanted the depth, then the velocity; then the same of the open layer of a volume, with its
//                      optical depth first and its number last
// One workgroup per tile, one invocation per quad of pixels. Slabs of depth come one after the other, the nearest
// first.

@group(1) @binding(4) var<storage, read> splats: array<DeviceGaussian>;
@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(17) var<storage, read> thresholds: array<vec4<f32>>;
@group(1) @binding(20) var<storage, read_write> sums: array<vec4<f32>>;

// All channels.
override CHANNELS: u32 = 4u;
// Those that splats have: 4, with depth 5, with velocity 7.
override OWN: u32 = 4u;
// The first channel of the open layer; 0 where there are no volumes.
override OPEN: u32 = 0u;
// Do thresholds lie as those of full EWA, with an apron around each tile?
override APRONS: bool = false;

// Largest alpha of a splat (Kerbl et al. 2023, their program).
const MOST_ALPHA: f32 = 0.99;
// A pixel whose transmittance is below this takes no more.
const OPAQUE: f32 = 1e-4;

// What is in front of a quad, or the open layer of a volume: `through` then holds its optical depth in powers of 1/2.
struct Composite {
    through: vec4<f32>,
    red: vec4<f32>,
    green: vec4<f32>,
    blue: vec4<f32>,
    depth: vec4<f32>,
    velocity_x: vec4<f32>,
    velocity_y: vec4<f32>,
}

// The quad, and what it has beside its sum.
struct Quad {
    column: u32,
    row: u32,
    limit: vec4<f32>,
    // Number of the open layer.
    layer: u32,
}

@compute @workgroup_size(4, 16)
fn composite(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) place: vec3<u32>) {
    let tile_place = vec2<u32>(tile.x, view.first_tile_row + tile.y);
    if !is_wanted(tile_place) { return; }
    let index = tile.y * view.tiles.x + tile.x;
    let in_tile = place.y * 4u + place.x;
    let at = index * CHANNELS * TILE_QUADS + in_tile;
    var quad: Quad;
    quad.column = tile_place.x * TILE + place.x * 4u;
    quad.row = tile_place.y * TILE + place.y;
    var walk = walk_of(index);
    // What is still open ends with the last slab.
    let has_rest = OPEN != 0u && view.ends != 0u;
    var sum: Composite;
    var open: Composite;
    sum.through = vec4<f32>(1.0);
    if view.resumes != 0u {
        if !has_next(walk) && !has_rest { return; }
        load(&sum, at);
        if OPEN != 0u {
            load(&open, at + OPEN * TILE_QUADS);
            quad.layer = number_at(at);
        }
    }
    // Nothing is composited outside the image.
    let columns = vec4<u32>(quad.column, quad.column + 1u, quad.column + 2u, quad.column + 3u);
    let outside = (columns > vec4<u32>(u32(view.pixels.y))) | vec4<bool>(quad.row > u32(view.pixels.w));
    var limit = vec4<f32>(NONE);
    if view.has_opaque != 0u {
        if APRONS {
            limit = thresholds[depths_of(index) + threshold_place(place.xy)];
        } else {
            limit = thresholds[index * TILE_QUADS + in_tile];
        }
    }
    quad.limit = select(limit, vec4<f32>(UNWANTED), outside);
    while has_next(walk) && any((sum.through >= vec4<f32>(OPAQUE)) & (quad.limit > vec4<f32>(UNWANTED))) {
        add_splat(&sum, &open, next_slot(&walk), &quad);
    }
    if has_rest { close_layer(&sum, &open, vec4<bool>(true)); }
    store(&sum, at);
    if OPEN != 0u && !has_rest {
        store(&open, at + OPEN * TILE_QUADS);
        let number = vec2<u32>(quad.layer & 0xffffu, quad.layer >> 16u);
        sums[at + (OPEN + OWN) * TILE_QUADS] = vec4<f32>(vec2<f32>(number), 0.0, 0.0);
    }
}

// Number of the open layer, whose halves are stored as floats.
fn number_at(at: u32) -> u32 {
    let stored = vec4<u32>(sums[at + (OPEN + OWN) * TILE_QUADS]);
    return stored.x | (stored.y << 16u);
}

fn powers_of_two(exponent: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(
        power_of_two(exponent.x),
        power_of_two(exponent.y),
        power_of_two(exponent.z),
        power_of_two(exponent.w),
    );
}

fn add_splat(
    sum: ptr<function, Composite>, open: ptr<function, Composite>, slot: u32, quad: ptr<function, Quad>,
) {
    if !touches(unpack(splats[slot].bounds), (*quad).column, (*quad).row) { return; }
    let splat = splats[slot];
    let x = f32((*quad).column) + vec4<f32>(0.0, 1.0, 2.0, 3.0) + 0.5 - splat.reference.x + view.offset.x;
    let y = f32((*quad).row) + 0.5 - splat.reference.y + view.offset.y;
    let away = y - splat.slope * x;
    let exponent = splat.peak - splat.along * (x * x) - splat.across * (away * away);
    let value = powers_of_two(exponent);
    let before = vec4<f32>(splat.depth) <= (*quad).limit;
    if OPEN != 0u && splat.layer > 0u {
        let shows = (exponent >= vec4<f32>(least_power(splat.peak))) & before;
        if !any(shows) { return; }
        if (*quad).layer != splat.layer {
            close_layer(sum, open, vec4<bool>(true));
            (*quad).layer = splat.layer;
        }
        let depth = select(vec4<f32>(0.0), value, shows);
        (*open).through += depth;
        add(open, splat, depth);
        return;
    }
    let reaches = (exponent >= vec4<f32>(-LOG2_FAINTEST)) & before;
    if OPEN != 0u { close_layer(sum, open, reaches); }
    let through = (*sum).through;
    let shows = reaches & (through >= vec4<f32>(OPAQUE));
    let alpha = select(vec4<f32>(0.0), min(value, vec4<f32>(MOST_ALPHA)), shows);
    let share = through * alpha;
    (*sum).through = through - share;
    add(sum, splat, share);
}

// Adds what a splat has, times `share`, to all channels but the first.
fn add(sum: ptr<function, Composite>, splat: DeviceGaussian, share: vec4<f32>) {
    (*sum).red += share * splat.colour[0];
    (*sum).green += share * splat.colour[1];
    (*sum).blue += share * splat.colour[2];
    if OWN > 4u { (*sum).depth += share * splat.depth; }
    if OWN > 5u {
        (*sum).velocity_x += share * splat.velocity.x;
        (*sum).velocity_y += share * splat.velocity.y;
    }
}

// Composites the open layer of the pixels that are `wanted`.
fn close_layer(sum: ptr<function, Composite>, open: ptr<function, Composite>, wanted: vec4<bool>) {
    let zero = vec4<f32>(0.0);
    let before = (*sum).through;
    let depth = select(zero, (*open).through, wanted & (before >= vec4<f32>(OPAQUE)));
    let through = powers_of_two(-depth);
    let is_open = depth > zero;
    let share = select(zero, (1.0 - through) / select(vec4<f32>(1.0), depth, is_open), is_open);
    let factor = before * share;
    (*sum).through = before * through;
    (*sum).red += factor * (*open).red;
    (*sum).green += factor * (*open).green;
    (*sum).blue += factor * (*open).blue;
    (*open).through = select((*open).through, zero, wanted);
    (*open).red = select((*open).red, zero, wanted);
    (*open).green = select((*open).green, zero, wanted);
    (*open).blue = select((*open).blue, zero, wanted);
    if OWN > 4u {
        (*sum).depth += factor * (*open).depth;
        (*open).depth = select((*open).depth, zero, wanted);
    }
    if OWN > 5u {
        (*sum).velocity_x += factor * (*open).velocity_x;
        (*sum).velocity_y += factor * (*open).velocity_y;
        (*open).velocity_x = select((*open).velocity_x, zero, wanted);
        (*open).velocity_y = select((*open).velocity_y, zero, wanted);
    }
}

fn load(sum: ptr<function, Composite>, at: u32) {
    (*sum).through = sums[at];
    (*sum).red = sums[at + TILE_QUADS];
    (*sum).green = sums[at + 2u * TILE_QUADS];
    (*sum).blue = sums[at + 3u * TILE_QUADS];
    if OWN > 4u { (*sum).depth = sums[at + 4u * TILE_QUADS]; }
    if OWN > 5u {
        (*sum).velocity_x = sums[at + 5u * TILE_QUADS];
        (*sum).velocity_y = sums[at + 6u * TILE_QUADS];
    }
}

fn store(sum: ptr<function, Composite>, at: u32) {
    sums[at] = (*sum).through;
    sums[at + TILE_QUADS] = (*sum).red;
    sums[at + 2u * TILE_QUADS] = (*sum).green;
    sums[at + 3u * TILE_QUADS] = (*sum).blue;
    if OWN > 4u { sums[at + 4u * TILE_QUADS] = (*sum).depth; }
    if OWN > 5u {
        sums[at + 5u * TILE_QUADS] = (*sum).velocity_x;
        sums[at + 6u * TILE_QUADS] = (*sum).velocity_y;
    }
}

// Pass `composite`: the Gaussians of a tile, front to back.
// Twin: src/backend/cpu/transparent/composite.rs.  Math: docs/math.md, section 11.
//   in   splats, list, starts, wide   output of `gather` and `bin`: in the order of depth
//        thresholds                   T of opaque surfels, where the view has any
//   in and out  sums   for each tile, for each channel, its quads: transmittance, red, green, blue, and where they are
//                      wanted the depth, then the velocity
// One workgroup per tile, one invocation per quad of pixels. Slabs of depth come one after the other, the nearest
// first.

@group(1) @binding(4) var<storage, read> splats: array<DeviceGaussian>;
@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(17) var<storage, read> thresholds: array<vec4<f32>>;
@group(1) @binding(20) var<storage, read_write> sums: array<vec4<f32>>;

// 4, with depth 5, with velocity 7.
override CHANNELS: u32 = 4u;
// Do thresholds lie as those of full EWA, with an apron around each tile?
override APRONS: bool = false;

// Largest alpha of a splat (Kerbl et al. 2023, their program).
const MOST_ALPHA: f32 = 0.99;
// A pixel whose transmittance is below this takes no more.
const OPAQUE: f32 = 1e-4;

struct Composite {
    through: vec4<f32>,
    red: vec4<f32>,
    green: vec4<f32>,
    blue: vec4<f32>,
    depth: vec4<f32>,
    velocity_x: vec4<f32>,
    velocity_y: vec4<f32>,
}

@compute @workgroup_size(4, 16)
fn composite(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) quad: vec3<u32>) {
    let place = vec2<u32>(tile.x, view.first_tile_row + tile.y);
    if !is_wanted(place) { return; }
    let index = tile.y * view.tiles.x + tile.x;
    let in_tile = quad.y * 4u + quad.x;
    let at = index * CHANNELS * TILE_QUADS + in_tile;
    let column = place.x * TILE + quad.x * 4u;
    let row = place.y * TILE + quad.y;
    var walk = walk_of(index);
    var sum: Composite;
    sum.through = vec4<f32>(1.0);
    if view.resumes != 0u {
        if !has_next(walk) { return; }
        load(&sum, at);
    }
    // Nothing is composited outside the image.
    let columns = vec4<u32>(column, column + 1u, column + 2u, column + 3u);
    let outside = (columns > vec4<u32>(u32(view.pixels.y))) | vec4<bool>(row > u32(view.pixels.w));
    var limit = vec4<f32>(NONE);
    if view.has_opaque != 0u {
        if APRONS {
            limit = thresholds[depths_of(index) + threshold_place(quad.xy)];
        } else {
            limit = thresholds[index * TILE_QUADS + in_tile];
        }
    }
    limit = select(limit, vec4<f32>(UNWANTED), outside);
    while has_next(walk) && any((sum.through >= vec4<f32>(OPAQUE)) & (limit > vec4<f32>(UNWANTED))) {
        add_splat(&sum, next_slot(&walk), limit, column, row);
    }
    store(&sum, at);
}

fn add_splat(sum: ptr<function, Composite>, slot: u32, limit: vec4<f32>, column: u32, row: u32) {
    if !touches(unpack(splats[slot].bounds), column, row) { return; }
    let splat = splats[slot];
    let x = f32(column) + vec4<f32>(0.0, 1.0, 2.0, 3.0) + 0.5 - splat.reference.x + view.offset.x;
    let y = f32(row) + 0.5 - splat.reference.y + view.offset.y;
    let away = y - splat.slope * x;
    let exponent = splat.peak - splat.along * (x * x) - splat.across * (away * away);
    let opacity = vec4<f32>(
        power_of_two(exponent.x),
        power_of_two(exponent.y),
        power_of_two(exponent.z),
        power_of_two(exponent.w),
    );
    let through = (*sum).through;
    let shows = (exponent >= vec4<f32>(-LOG2_FAINTEST))
        & (through >= vec4<f32>(OPAQUE))
        & (vec4<f32>(splat.depth) <= limit);
    let alpha = select(vec4<f32>(0.0), min(opacity, vec4<f32>(MOST_ALPHA)), shows);
    let share = through * alpha;
    (*sum).through = through - share;
    (*sum).red += share * splat.colour[0];
    (*sum).green += share * splat.colour[1];
    (*sum).blue += share * splat.colour[2];
    if CHANNELS > 4u { (*sum).depth += share * splat.depth; }
    if CHANNELS > 5u {
        (*sum).velocity_x += share * splat.velocity.x;
        (*sum).velocity_y += share * splat.velocity.y;
    }
}

fn load(sum: ptr<function, Composite>, at: u32) {
    (*sum).through = sums[at];
    (*sum).red = sums[at + TILE_QUADS];
    (*sum).green = sums[at + 2u * TILE_QUADS];
    (*sum).blue = sums[at + 3u * TILE_QUADS];
    if CHANNELS > 4u { (*sum).depth = sums[at + 4u * TILE_QUADS]; }
    if CHANNELS > 5u {
        (*sum).velocity_x = sums[at + 5u * TILE_QUADS];
        (*sum).velocity_y = sums[at + 6u * TILE_QUADS];
    }
}

fn store(sum: ptr<function, Composite>, at: u32) {
    sums[at] = (*sum).through;
    sums[at + TILE_QUADS] = (*sum).red;
    sums[at + 2u * TILE_QUADS] = (*sum).green;
    sums[at + 3u * TILE_QUADS] = (*sum).blue;
    if CHANNELS > 4u { sums[at + 4u * TILE_QUADS] = (*sum).depth; }
    if CHANNELS > 5u {
        sums[at + 5u * TILE_QUADS] = (*sum).velocity_x;
        sums[at + 6u * TILE_QUADS] = (*sum).velocity_y;
    }
}

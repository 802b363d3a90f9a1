// Includes: common/types common/views common/fast common/wanted common/hit common/list common/depths common/gaussian
// Includes: common/srgb
// Pass `composite`: the Gaussians of a tile, front to back.
// Twins: src/backend/cpu/transparent/composite.rs, accumulators.rs.  Math: docs/math.md, sections 11 and 12.
//   in   splats, list, starts, wide   output of `gather` and `bin`: in the order of depth
//        thresholds                   T of opaque surfels, where the view has any
//        layers                       of see-through surfels, where the view has any: the films of peel.wgsl
//   in and out  sums   for each tile, for each channel, its quads: transmittance, red, green, blue, and where they are
//                      wanted the depth, then the velocity, then the normal; then the first of these of the open layer
//                      of a volume, with its optical depth first and its number last; then the number of the next layer
//                      of see-through surfels
// One workgroup per tile of each view, one invocation per quad of pixels. Slabs of depth come one after the other, the
// nearest first. Lists may be walked over in stretches.

@group(1) @binding(4) var<storage, read> splats: array<DeviceGaussian>;
@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(17) var<storage, read> thresholds: array<vec4<f32>>;
@group(1) @binding(20) var<storage, read_write> sums: array<vec4<f32>>;
@group(1) @binding(36) var<storage, read> layers: array<f32>;

// All channels.
override CHANNELS: u32 = 4u;
// Those that splats have: 4, with depth 5, with velocity 7.
override OWN: u32 = 4u;
// The first channel of the open layer; 0 where there are no volumes.
override OPEN: u32 = 0u;
// First of three channels: normals, of see-through surfels alone; 0 where they are not wanted.
override NORMAL: u32 = 0u;
// Channel of the next layer of see-through surfels; 0 where there are none.
override NEXT: u32 = 0u;
// As in peel.wgsl, and as in resolve.wgsl.
override MOST_LAYERS: u32 = 8u;
override DEPTH_PLANE: u32 = 0u;
override NORMAL_PLANE: u32 = 0u;
override VELOCITY_PLANE: u32 = 0u;
// Planes of the film of a layer.
override LAYER_PLANES: u32 = 4u;
// Is the image composited in coded values?
override CODED: bool = false;

// Largest alpha of a splat (Kerbl et al. 2023, their program).
const MOST_ALPHA: f32 = 0.99;
// A pixel whose transmittance is below this takes no more.
const OPAQUE: f32 = 1e-4;

// The composite in front of a quad, or the open layer of a volume: `through` then holds its optical depth in powers of
// 1/2.
struct Composite {
    through: vec4<f32>,
    red: vec4<f32>,
    green: vec4<f32>,
    blue: vec4<f32>,
    depth: vec4<f32>,
    velocity_x: vec4<f32>,
    velocity_y: vec4<f32>,
    normal_x: vec4<f32>,
    normal_y: vec4<f32>,
    normal_z: vec4<f32>,
}

// The quad, and what it has beside its sum.
struct Quad {
    column: u32,
    row: u32,
    limit: vec4<f32>,
    // Number of the open layer.
    layer: u32,
    // First pixel in the first layer of see-through surfels.
    surfels_at: u32,
    // Number and depth of the next layer of see-through surfels.
    next: vec4<u32>,
    next_depth: vec4<f32>,
}

@compute @workgroup_size(4, 16)
fn composite(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) place: vec3<u32>) {
    view = views[tile.z];
    let tile_place = vec2<u32>(tile.x, view.first_tile_row + tile.y);
    if !has_tile(tile.xy) || !is_wanted(tile_place) { return; }
    let index = tile_of(tile.xy);
    let in_tile = place.y * 4u + place.x;
    let at = index * CHANNELS * TILE_QUADS + in_tile;
    var quad: Quad;
    quad.column = tile_place.x * TILE + place.x * 4u;
    quad.row = tile_place.y * TILE + place.y;
    var walk = stretch_of(walk_of(index));
    // A layer that is still open ends with the last stretch of the last slab.
    let has_rest = (OPEN != 0u || NEXT != 0u) && (view.flags & LAST_SLAB) != 0u;
    var sum: Composite;
    var open: Composite;
    sum.through = vec4<f32>(1.0);
    if view.resumes != 0u {
        if !has_next(walk) && !has_rest { return; }
        load(&sum, at);
        if NORMAL != 0u {
            sum.normal_x = sums[at + NORMAL * TILE_QUADS];
            sum.normal_y = sums[at + (NORMAL + 1u) * TILE_QUADS];
            sum.normal_z = sums[at + (NORMAL + 2u) * TILE_QUADS];
        }
        if OPEN != 0u {
            load(&open, at + OPEN * TILE_QUADS);
            quad.layer = number_at(at);
        }
    }
    let has_layers = NEXT != 0u && (view.flags & SEE_THROUGH_SURFELS) != 0u;
    quad.next = vec4<u32>(MOST_LAYERS);
    quad.next_depth = vec4<f32>(NONE);
    if has_layers {
        quad.surfels_at = index * MOST_LAYERS * LAYER_PLANES * TILE_PIXELS + 4u * in_tile;
        var first = vec4<u32>(0u);
        if view.resumes != 0u { first = vec4<u32>(sums[at + NEXT * TILE_QUADS]); }
        for (var i = 0u; i < 4u; i += 1u) { find_next(&quad, i, first[i]); }
    }
    // Nothing is composited outside the image.
    let columns = vec4<u32>(quad.column, quad.column + 1u, quad.column + 2u, quad.column + 3u);
    let outside = (columns > vec4<u32>(u32(view.pixels.y))) | vec4<bool>(quad.row > u32(view.pixels.w));
    var limit = vec4<f32>(NONE);
    if (view.flags & OPAQUE_SURFELS) != 0u {
        limit = thresholds[depths_of(index) + threshold_place(place.xy)];
    }
    quad.limit = select(limit, vec4<f32>(UNWANTED), outside);
    while has_next(walk) && any((sum.through >= vec4<f32>(OPAQUE)) & (quad.limit > vec4<f32>(UNWANTED))) {
        add_splat(&sum, &open, next_slot(&walk), &quad);
    }
    if has_rest {
        if has_layers { pass_surfels(&sum, &open, &quad, vec4<bool>(true), NONE, true); }
        if OPEN != 0u { close_layer(&sum, &open, vec4<bool>(true)); }
    }
    store(&sum, at);
    if NORMAL != 0u {
        sums[at + NORMAL * TILE_QUADS] = sum.normal_x;
        sums[at + (NORMAL + 1u) * TILE_QUADS] = sum.normal_y;
        sums[at + (NORMAL + 2u) * TILE_QUADS] = sum.normal_z;
    }
    if has_rest { return; }
    if NEXT != 0u { sums[at + NEXT * TILE_QUADS] = vec4<f32>(quad.next); }
    if OPEN != 0u {
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
    let is_volume = OPEN != 0u && splat.layer > 0u;
    let faintest = select(-LOG2_FAINTEST, least_power(splat.peak), is_volume);
    let reaches = (exponent >= vec4<f32>(faintest)) & (vec4<f32>(splat.depth) <= (*quad).limit);
    if is_volume && !any(reaches) { return; }
    // Called in one place alone: some software devices take turns of its loops where no pixel takes them, too.
    if NEXT != 0u { pass_surfels(sum, open, quad, reaches, splat.depth, false); }
    if is_volume {
        if (*quad).layer != splat.layer {
            close_layer(sum, open, vec4<bool>(true));
            (*quad).layer = splat.layer;
        }
        let depth = select(vec4<f32>(0.0), value, reaches);
        (*open).through += depth;
        add(open, splat, depth);
        return;
    }
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

// Composites the layers of see-through surfels that are nearer than `depth`, or `all`, in the pixels that are `wanted`.
fn pass_surfels(
    sum: ptr<function, Composite>, open: ptr<function, Composite>, quad: ptr<function, Quad>, wanted: vec4<bool>,
    depth: f32, all: bool,
) {
    loop {
        let nearer = ((*quad).next_depth < vec4<f32>(depth)) | vec4<bool>(all);
        let due = wanted & nearer & ((*quad).next < vec4<u32>(MOST_LAYERS));
        if !any(due) { return; }
        if OPEN != 0u { close_layer(sum, open, due); }
        for (var i = 0u; i < 4u; i += 1u) {
            if !due[i] { continue; }
            let number = (*quad).next[i];
            add_surfels(sum, i, (*quad).surfels_at + number * LAYER_PLANES * TILE_PIXELS + i);
            find_next(quad, i, number + 1u);
        }
    }
}

// Finds the next layer of surfels at pixel `i` of the quad, from number `first` on.
fn find_next(quad: ptr<function, Quad>, i: u32, first: u32) {
    var number = first;
    var depth = NONE;
    for (; number < MOST_LAYERS; number += 1u) {
        let at = (*quad).surfels_at + number * LAYER_PLANES * TILE_PIXELS + i;
        if layers[at + 3u * TILE_PIXELS] > 0.0 {
            // What only filters reach has no depth of its own; it lies behind all that has.
            depth = layers[at + (LAYER_PLANES - 1u) * TILE_PIXELS];
            break;
        }
    }
    (*quad).next[i] = number;
    (*quad).next_depth[i] = depth;
}

// Composites pixel `i` of a layer of surfels, whose first plane has it at `at`.
fn add_surfels(sum: ptr<function, Composite>, i: u32, at: u32) {
    let through = (*sum).through[i];
    let alpha = layers[at + 3u * TILE_PIXELS];
    var colour = vec3<f32>(layers[at], layers[at + TILE_PIXELS], layers[at + 2u * TILE_PIXELS]);
    if CODED {
        colour = alpha
            * vec3<f32>(from_linear(colour.x / alpha), from_linear(colour.y / alpha), from_linear(colour.z / alpha));
    }
    (*sum).red[i] += through * colour.x;
    (*sum).green[i] += through * colour.y;
    (*sum).blue[i] += through * colour.z;
    if OWN > 4u && DEPTH_PLANE != 0u { (*sum).depth[i] += through * layers[at + DEPTH_PLANE * TILE_PIXELS]; }
    if OWN > 5u && VELOCITY_PLANE != 0u {
        (*sum).velocity_x[i] += through * layers[at + VELOCITY_PLANE * TILE_PIXELS];
        (*sum).velocity_y[i] += through * layers[at + (VELOCITY_PLANE + 1u) * TILE_PIXELS];
    }
    if NORMAL != 0u {
        (*sum).normal_x[i] += through * layers[at + NORMAL_PLANE * TILE_PIXELS];
        (*sum).normal_y[i] += through * layers[at + (NORMAL_PLANE + 1u) * TILE_PIXELS];
        (*sum).normal_z[i] += through * layers[at + (NORMAL_PLANE + 2u) * TILE_PIXELS];
    }
    (*sum).through[i] = through * (1.0 - alpha);
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

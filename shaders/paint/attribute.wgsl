// Pass `attribute` (program `sum_attributes`): sums the attributes of the splats that pass the depth test, with their
// weights. Filtered kernels have four layers by depth; solid pixels, groups of several samples, and kernels without a
// filter have the band alone. A layer that is peeled off has the first two, and only splats from the floor to T.
// Twin: src/backend/cpu/paint/attribute.rs.  Math: docs/math.md, eq. 6, and section 3.
//   in   splats, list, starts, wide, thresholds, values
//        segments  sample and tolerance of a splat, its weight and share
//   out  sums      for each tile, for each layer, for each channel, its quads: weight, colour, then what else
//                  common/channels.wgsl has, where it is wanted
// One workgroup per tile, one invocation per quad of pixels. A first walk over the list adds the band, a second one the
// other layers where there are any. Sums stay in registers, in list order.

@group(1) @binding(2) var<storage, read> segments: array<Segment>;
@group(1) @binding(4) var<storage, read> splats: array<Kernel>;
@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(17) var<storage, read> thresholds: array<vec4<f32>>;
@group(1) @binding(19) var<storage, read> values: array<f32>;
@group(1) @binding(20) var<storage, read_write> sums: array<vec4<f32>>;

// What the splats of a quad are held against.
struct Quad {
    column: u32,
    row: u32,
    // T and the threshold behind it; UNWANTED where the pixel is solid.
    first: vec4<f32>,
    second: vec4<f32>,
    // Depth of the nearest disc, where objects have limits of their own.
    nearest: vec4<f32>,
    open: vec4<bool>,
    // Between these lies what is peeled off.
    floor: vec4<f32>,
    ceiling: vec4<f32>,
}

@compute @workgroup_size(4, 16)
fn sum_attributes(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) place: vec3<u32>) {
    let index = tile.y * view.tiles.x + tile.x;
    let in_tile = place.y * 4u + place.x;
    var quad: Quad;
    quad.column = tile.x * TILE + place.x * 4u;
    quad.row = (view.first_tile_row + tile.y) * TILE + place.y;
    quad.first = thresholds[depths_of(index) + threshold_place(place.xy)];
    if PEEL {
        if thresholds[depths_of(index) + state_place()].x == 0.0 { return; }
        quad.floor = thresholds[depths_of(index) + floor_place() + threshold_place(place.xy)];
        quad.ceiling = min(quad.first, thresholds[depths_of(index) + ceiling_place() + in_tile]);
    }
    if NEAREST { quad.nearest = thresholds[nearest_of(index) + in_tile]; }
    if all(quad.first == vec4<f32>(UNWANTED)) { return; }
    quad.second = vec4<f32>(UNWANTED);
    if LAYERS > 1u {
        quad.second = thresholds[depths_of(index) + second_place() + in_tile];
    }
    quad.open = quad.second > vec4<f32>(UNWANTED);
    var walk = walk_of(index);
    if view.resumes != 0u && SAMPLE_COVERAGE == 0u && !has_next(walk) { return; }
    let tile_at = index * LAYERS * CHANNELS * TILE_QUADS + in_tile;
    let layer_size = CHANNELS * TILE_QUADS;
    let band_at = tile_at + select(0u, BAND * layer_size, LAYERS > 1u);
    var band = Sums();
    band.turn = view.first_turn;
    if view.resumes != 0u { load_sums(&band, band_at); }
    var has_others = false;
    while has_next(walk) {
        has_others |= add_to_band(&band, next_slot(&walk), quad);
    }
    if SAMPLE_COVERAGE != 0u && band.turn < view.last_turn { turn(&band, view.last_turn); }
    store_sums(&band, band_at);
    if !any(quad.open) || (view.resumes != 0u && !has_others) { return; }
    var front = Sums();
    var second = Sums();
    var rest = Sums();
    if view.resumes != 0u {
        load_sums(&front, tile_at + FRONT * layer_size);
        if LAYERS > 2u {
            load_sums(&second, tile_at + SECOND * layer_size);
            load_sums(&rest, tile_at + REST * layer_size);
        }
    }
    walk = walk_of(index);
    while has_others && has_next(walk) {
        add_to_others(&front, &second, &rest, next_slot(&walk), quad);
    }
    store_sums(&front, tile_at + FRONT * layer_size);
    if LAYERS > 2u {
        store_sums(&second, tile_at + SECOND * layer_size);
        store_sums(&rest, tile_at + REST * layer_size);
    }
}

// A kernel on the rays through a quad. Where layers are peeled off it is nothing outside the current one.
fn see_in_layer(splat: Kernel, quad: Quad) -> Seen {
    var seen = see(splat, quad.column, quad.row);
    if PEEL {
        let in_layer = (seen.depth > quad.floor) & (seen.depth <= quad.ceiling);
        seen.weight = select(vec4<f32>(0.0), seen.weight, in_layer);
        seen.disc = seen.disc & in_layer;
    }
    return seen;
}

// The pixels of a quad in which a splat is before the band, and in it. Each pixel has it in one layer; behind a solid
// pixel's band, in none.
struct Place {
    before: vec4<bool>,
    in_band: vec4<bool>,
}

fn place_of(seen: Seen, epsilon: f32, quad: Quad) -> Place {
    let tolerance = tolerance_at(seen.depth, epsilon);
    let limit = limit_of(tolerance, quad.first, quad.nearest);
    let before = quad.open & (seen.depth < limit - 2.0 * tolerance) & !seen.disc;
    return Place(before, !before & (seen.depth <= limit));
}

// Adds a splat to the sums of the band. True if another layer has it, too.
fn add_to_band(band: ptr<function, Sums>, slot: u32, quad: Quad) -> bool {
    if !touches(weight_bounds(splats[slot]), quad.column, quad.row) { return false; }
    let splat = splats[slot];
    let segment_index = disc_of(splat).flags >> 1u;
    let seen = see_in_layer(splat, quad);
    let zero = vec4<f32>(0.0);
    if SAMPLE_COVERAGE != 0u {
        let its_turn = segments[segment_index].flags >> 3u;
        if its_turn != (*band).turn { turn(band, its_turn); }
        // A hidden splat covers the pixel, too: what hides it covers it.
        (*band).sample_coverage += select(seen.weight, vec4<f32>(1.0), seen.disc);
        let tolerance = tolerance_at(seen.depth, segments[segment_index].epsilon);
        let shows = seen.depth <= limit_of(tolerance, quad.first, quad.nearest);
        let weight = select(zero, seen.weight * segments[segment_index].share, shows);
        if any(weight > zero) { add_values(band, slot, weight, select(zero, seen.depth, weight > zero)); }
        return false;
    }
    let place = place_of(seen, segments[segment_index].epsilon, quad);
    add_to_layer(band, slot, splat, seen, place.in_band);
    return any(quad.open & !place.in_band & (seen.disc | (seen.weight > zero)));
}

// Adds a splat to the sums of the layers other than the band.
fn add_to_others(
    front: ptr<function, Sums>, second: ptr<function, Sums>, rest: ptr<function, Sums>, slot: u32, quad: Quad,
) {
    if !touches(weight_bounds(splats[slot]), quad.column, quad.row) { return; }
    let splat = splats[slot];
    let seen = see_in_layer(splat, quad);
    let place = place_of(seen, segments[disc_of(splat).flags >> 1u].epsilon, quad);
    let behind = quad.open & !place.before & !place.in_band;
    let next = behind & (seen.depth <= quad.second);
    let last = behind & !next;
    add_to_layer(front, slot, splat, seen, place.before);
    add_to_layer(second, slot, splat, seen, next);
    add_to_layer(rest, slot, splat, seen, last);
    (*rest).discs += select(vec4<f32>(0.0), vec4<f32>(1.0), last & seen.disc);
}

// Adds a splat to the sums of a layer in the pixels of which that layer `takes` it.
fn add_to_layer(sum: ptr<function, Sums>, slot: u32, splat: Kernel, seen: Seen, takes: vec4<bool>) {
    let zero = vec4<f32>(0.0);
    let weight = select(zero, seen.weight, takes);
    if !any(weight > zero) { return; }
    add_values(sum, slot, weight, select(zero, seen.depth, weight > zero));
    if PEAK != 0u {
        (*sum).peak += weight * peak_of(splat);
        (*sum).side += weight * select(1.0, -1.0, (disc_of(splat).flags & FLAG_BACK) != 0u);
    }
}

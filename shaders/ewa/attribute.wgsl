// Pass `attribute` of full EWA (program `ewa_attribute`): weighted sums of the attributes of splats, in four layers by
// depth. Solid pixels, and groups of several samples, have the band alone. What is peeled off has the first two, and no
// splats but those from the floor to T.
// Twin: src/backend/cpu/paint/attribute.rs.  Math: docs/math.md, section 3.
//   in   splats, list, starts, wide, thresholds, values
//        segments  sample and tolerance of a splat, its weight and share
//   out  sums      for each tile, for each layer, the channels of sum_attributes; then the sum of weight times peak,
//                  the sum of weights that is negative for backs, and the number of discs of the last layer that cover
//                  the pixel. Groups of several samples have the channels of their coverage instead
// One workgroup per tile, one invocation per quad of pixels. A first walk over the list adds the band, a second one the
// other layers where there are any. Sums stay in registers, in list order.

// `splats` of attribute.wgsl, for this program.
@group(1) @binding(4) var<storage, read> filtered_splats: array<EwaSplat>;

// Number of layers.
override LAYERS: u32 = 1u;
// Places of the layers: before the nearest disc that covers the pixel by more than the tolerance, at it, at the next
// one, and behind that. Where there is one layer alone it is the band, at place 0.
const FRONT: u32 = 0u;
const BAND: u32 = 1u;
const SECOND: u32 = 2u;
const REST: u32 = 3u;

// What the splats of a quad are held against.
struct Quad {
    column: u32,
    row: u32,
    // T and the threshold behind it; UNWANTED where the pixel is solid.
    first: vec4<f32>,
    second: vec4<f32>,
    open: vec4<bool>,
    // Between these lies what is peeled off.
    floor: vec4<f32>,
    ceiling: vec4<f32>,
}

@compute @workgroup_size(4, 16)
fn ewa_attribute(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) place: vec3<u32>) {
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

// A filtered splat on the rays through a quad.
struct Seen {
    weight: vec4<f32>,
    // Of its plane; of its centre where the ray misses the plane.
    depth: vec4<f32>,
    // True where the disc covers the pixel.
    disc: vec4<bool>,
}

fn form(c: vec2<f32>, at: Hit) -> vec4<f32> {
    return c.x * at.x + c.y * at.y;
}

fn see(splat: EwaSplat, quad: Quad) -> Seen {
    let at = hit(splat.disc, quad.column, quad.row);
    let within = in_columns(unpack(splat.filtered_bounds), quad.column);
    let one = vec4<f32>(1.0);
    let in_view = (at.inverse_depth > vec4<f32>(0.0)) & (at.inverse_depth <= vec4<f32>(view.most_inverse_depth));
    let plane_depth = 1.0 / at.inverse_depth;
    let u = form(splat.u, at);
    let v = form(splat.v, at);
    let px = form(vec2<f32>(splat.p[0], splat.p[1]), at);
    let py = form(vec2<f32>(splat.p[1], splat.p[2]), at);
    let nearer = 1.0 - form(splat.shrink, at);
    let over = 1.0 / nearer;
    let quarter_variance = 0.25 * view.sigma * view.sigma;
    var r2 = (u * u + v * v) * (over * over) + quarter_variance * (px * px + py * py);
    var shown = nearer > vec4<f32>(0.0);
    if splat.crossing != 0u {
        r2 = at.scaled_r2 * (plane_depth * plane_depth);
        shown = at.inside & in_view;
    }
    let hits = shown & (r2 <= one) & within;
    let weight = splat.weight * kernel(select(one, r2, r2 < one));
    var seen = Seen(
        select(vec4<f32>(0.0), weight, hits),
        select(vec4<f32>(splat.disc.centre_depth), plane_depth, in_view),
        at.inside & in_view & within,
    );
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
    let before = quad.open & (seen.depth < quad.first - 2.0 * tolerance) & !seen.disc;
    return Place(before, !before & (seen.depth <= quad.first));
}

// Adds a splat to the sums of the band. True if another layer has it, too.
fn add_to_band(band: ptr<function, Sums>, slot: u32, quad: Quad) -> bool {
    if !touches(unpack(filtered_splats[slot].filtered_bounds), quad.column, quad.row) { return false; }
    let splat = filtered_splats[slot];
    let segment_index = splat.disc.flags >> 1u;
    let seen = see(splat, quad);
    let zero = vec4<f32>(0.0);
    if SAMPLE_COVERAGE != 0u {
        let its_turn = segments[segment_index].flags >> 3u;
        if its_turn != (*band).turn { turn(band, its_turn); }
        // A hidden splat covers the pixel, too: what hides it covers it.
        (*band).sample_coverage += select(seen.weight, vec4<f32>(1.0), seen.disc);
        let weight = select(zero, seen.weight * segments[segment_index].share, seen.depth <= quad.first);
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
    if !touches(unpack(filtered_splats[slot].filtered_bounds), quad.column, quad.row) { return; }
    let splat = filtered_splats[slot];
    let seen = see(splat, quad);
    let place = place_of(seen, segments[splat.disc.flags >> 1u].epsilon, quad);
    let behind = quad.open & !place.before & !place.in_band;
    let next = behind & (seen.depth <= quad.second);
    let last = behind & !next;
    add_to_layer(front, slot, splat, seen, place.before);
    add_to_layer(second, slot, splat, seen, next);
    add_to_layer(rest, slot, splat, seen, last);
    (*rest).discs += select(vec4<f32>(0.0), vec4<f32>(1.0), last & seen.disc);
}

// Adds a splat to the sums of a layer in the pixels of which that layer `takes` it.
fn add_to_layer(sum: ptr<function, Sums>, slot: u32, splat: EwaSplat, seen: Seen, takes: vec4<bool>) {
    let zero = vec4<f32>(0.0);
    let weight = select(zero, seen.weight, takes);
    if !any(weight > zero) { return; }
    add_values(sum, slot, weight, select(zero, seen.depth, weight > zero));
    (*sum).peak += weight * splat.peak;
    (*sum).side += weight * select(1.0, -1.0, (splat.disc.flags & FLAG_BACK) != 0u);
}

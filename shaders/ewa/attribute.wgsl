// Pass `attribute` of full EWA (program `ewa_attribute`): weighted sums of the attributes of splats, in four layers by
// depth. Solid pixels, and groups of several samples, have the band alone.
// Twin: src/backend/cpu/ewa/attribute.rs.  Math: docs/math.md, section 3.
//   in   splats, list, starts, wide, thresholds, values
//        segments  sample and tolerance of a splat, its weight and share
//   out  sums      for each tile, for each layer, the channels of sum_attributes; then the sum of weight times peak,
//                  the sum of weights that is negative for backs, and the number of discs of the last layer that cover
//                  the pixel. Groups of several samples have the channels of their coverage instead
// One workgroup per tile, one invocation per quad of pixels. A walk over the list adds one layer, so that its sums stay
// in registers, in list order.

// `splats` of attribute.wgsl, for this program.
@group(1) @binding(4) var<storage, read> filtered_splats: array<EwaSplat>;

// Number of layers.
override LAYERS: u32 = 1u;
// Before the nearest disc that covers the pixel by more than the tolerance, at it, at the next one, and behind that.
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
}

@compute @workgroup_size(4, 16)
fn ewa_attribute(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) place: vec3<u32>) {
    let index = tile.y * view.tiles.x + tile.x;
    let in_tile = place.y * 4u + place.x;
    var quad: Quad;
    quad.column = tile.x * TILE + place.x * 4u;
    quad.row = (view.first_tile_row + tile.y) * TILE + place.y;
    quad.first = thresholds[depths_of(index) + threshold_place(place.xy)];
    if all(quad.first == vec4<f32>(UNWANTED)) { return; }
    quad.second = vec4<f32>(UNWANTED);
    if LAYERS > 1u {
        quad.second = thresholds[depths_of(index) + second_place() + in_tile];
    }
    quad.open = quad.second > vec4<f32>(UNWANTED);
    let whole_walk = walk_of(index);
    if view.resumes != 0u && SAMPLE_COVERAGE == 0u && !has_next(whole_walk) { return; }
    // The band comes first, and its walk finds out which layers have splats, a bit each.
    var layers = 1u << BAND;
    let walks = select(1u, LAYERS, any(quad.open));
    for (var i = 0u; i < walks; i += 1u) {
        let layer = (BAND + i) % 4u;
        let has_splats = (layers >> layer & 1u) != 0u;
        if view.resumes != 0u && !has_splats { continue; }
        let layer_at = index * LAYERS + select(0u, layer, LAYERS > 1u);
        let at = layer_at * CHANNELS * TILE_QUADS + in_tile;
        var sum = Sums();
        sum.turn = view.first_turn;
        if view.resumes != 0u { load_sums(&sum, at); }
        var walk = whole_walk;
        while has_splats && has_next(walk) {
            layers |= add_filtered(&sum, next_slot(&walk), quad, layer);
        }
        if SAMPLE_COVERAGE != 0u && sum.turn < view.last_turn { turn(&sum, view.last_turn); }
        store_sums(&sum, at);
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
    return Seen(
        select(vec4<f32>(0.0), weight, hits),
        select(vec4<f32>(splat.disc.centre_depth), plane_depth, in_view),
        at.inside & in_view & within,
    );
}

// Adds a splat to the sums of `layer`. Returns the layers to which it belongs.
fn add_filtered(sum: ptr<function, Sums>, slot: u32, quad: Quad, layer: u32) -> u32 {
    if !touches(unpack(filtered_splats[slot].filtered_bounds), quad.column, quad.row) { return 0u; }
    let splat = filtered_splats[slot];
    let segment_index = splat.disc.flags >> 1u;
    let seen = see(splat, quad);
    let zero = vec4<f32>(0.0);
    if SAMPLE_COVERAGE != 0u {
        let its_turn = segments[segment_index].flags >> 2u;
        if its_turn != (*sum).turn { turn(sum, its_turn); }
        // A hidden splat covers the pixel, too: what hides it covers it.
        (*sum).sample_coverage += select(seen.weight, vec4<f32>(1.0), seen.disc);
        let weight = select(zero, seen.weight * segments[segment_index].share, seen.depth <= quad.first);
        if any(weight > zero) { add_values(sum, slot, weight, select(zero, seen.depth, weight > zero)); }
        return 0u;
    }
    // Each splat belongs to one layer of a pixel; behind a solid pixel's band, to none.
    let tolerance = tolerance_at(seen.depth, segments[segment_index].epsilon);
    let before = quad.open & (seen.depth < quad.first - 2.0 * tolerance) & !seen.disc;
    let band = !before & (seen.depth <= quad.first);
    let behind = quad.open & !before & !band;
    let second = behind & (seen.depth <= quad.second);
    let rest = behind & !second;
    var takes = band;
    if layer == FRONT { takes = before; }
    if layer == SECOND { takes = second; }
    if layer == REST { takes = rest; }
    let weight = select(zero, seen.weight, takes);
    if any(weight > zero) {
        add_values(sum, slot, weight, select(zero, seen.depth, weight > zero));
        (*sum).peak += weight * splat.peak;
        (*sum).side += weight * select(1.0, -1.0, (splat.disc.flags & FLAG_BACK) != 0u);
    }
    if layer == REST {
        (*sum).discs += select(zero, vec4<f32>(1.0), rest & seen.disc);
    }
    let shows = seen.weight > zero;
    return select(0u, 1u << FRONT, any(before & shows))
        | select(0u, 1u << SECOND, any(second & shows))
        | select(0u, 1u << REST, any(rest & (shows | seen.disc)));
}

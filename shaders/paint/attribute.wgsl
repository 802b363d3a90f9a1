// Includes: common/types common/views common/fast common/channels common/hit common/list paint/rest paint/both_walks
// Includes: common/depths paint/kernel paint/sums paint/bend
// Pass `attribute` (program `sum_attributes`): sums the attributes of the splats that pass the depth test, with their
// weights. Filtered kernels have four layers by depth; solid pixels, groups of several samples, and kernels without a
// filter have the band alone. A layer that is peeled off has the first two, and only splats from the floor to T.
// Twin: src/backend/cpu/paint/attribute.rs.  Math: docs/math.md, eq. 6, and section 3.
//   in   splats, list, starts, wide, thresholds, values
//        segments  sample and tolerance of a splat, its weight and share
//   out  sums      for each tile, for each layer, for each channel, its quads: weight, colour, then what else
//                  common/channels.wgsl has, where it is wanted
// A first walk over the list adds the band, a second one the other layers where there are any. Sums stay in registers,
// in list order. How invocations share a tile and its list: attribute_quads.wgsl, attribute_pixels.wgsl.

@group(1) @binding(2) var<storage, read> segments: array<Segment>;
@group(1) @binding(4) var<storage, read> splats: array<Kernel>;
@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(17) var<storage, read> thresholds: array<Floats>;
@group(1) @binding(19) var<storage, read> values: array<f32>;
@group(1) @binding(20) var<storage, read_write> sums: array<Floats>;

// What the splats of an invocation's pixels are held against.
struct Pixels {
    column: u32,
    row: u32,
    // T and the threshold behind it; UNWANTED where the pixel is solid.
    first: Floats,
    second: Floats,
    // Depth of the nearest disc, where objects have limits of their own.
    nearest: Floats,
    open: Bools,
    // Between these lies what is peeled off.
    floor: Floats,
    ceiling: Floats,
}

// Where the sums of the pixels are, in the band, and the size of a layer.
struct Sites {
    tile: u32,
    band: u32,
    layer: u32,
}

// The pixels of tile `tile` from `at` on, the first column and the row in it.
fn pixels_of(tile: vec2<u32>, at: vec2<u32>) -> Pixels {
    let index = tile_of(tile);
    let depths_at = depths_of(index);
    let quad = vec2<u32>(at.x / 4u, at.y);
    let in_tile = quad.y * 4u + quad.x;
    var pixels: Pixels;
    pixels.column = tile.x * TILE + at.x;
    pixels.row = (view.first_tile_row + tile.y) * TILE + at.y;
    pixels.first = thresholds[place_in(depths_at + threshold_place(quad), at.x)];
    if PEEL {
        pixels.floor = thresholds[place_in(depths_at + floor_place() + threshold_place(quad), at.x)];
        let ceiling = thresholds[place_in(depths_at + ceiling_place() + in_tile, at.x)];
        pixels.ceiling = min(pixels.first, ceiling);
    }
    if NEAREST { pixels.nearest = thresholds[place_in(nearest_of(index) + in_tile, at.x)]; }
    pixels.second = Floats(UNWANTED);
    if LAYERS > 1u {
        pixels.second = thresholds[place_in(depths_at + second_place() + in_tile, at.x)];
    }
    pixels.open = pixels.second > Floats(UNWANTED);
    return pixels;
}

// False where nothing is to be added to tile `index`: what is peeled off it is at its end.
fn is_live(index: u32) -> bool {
    return !PEEL || first_of(thresholds[place_in(depths_of(index) + state_place(), 0u)]) != 0.0;
}

// Where the sums of the pixels of tile `index` are that begin at `at`.
fn sites_of(index: u32, at: vec2<u32>) -> Sites {
    let layer = CHANNELS * plane();
    let tile = index * LAYERS * layer + place_in(at.y * 4u + at.x / 4u, at.x);
    return Sites(tile, tile + select(0u, BAND * layer, LAYERS > 1u), layer);
}

// A kernel on the rays through the pixels. Where layers are peeled off it is nothing outside the current one.
fn see_in_layer(splat: Kernel, pixels: Pixels) -> Seen {
    var seen = see(splat, pixels.column, pixels.row);
    if PEEL {
        let in_layer = (seen.depth > pixels.floor) & (seen.depth <= pixels.ceiling);
        seen.weight = select(Floats(0.0), seen.weight, in_layer);
        seen.disc = seen.disc & in_layer;
    }
    return seen;
}

// The pixels in which a splat is before the band, and in it. Each pixel has it in one layer; behind a solid
// pixel's band, in none.
struct Place {
    before: Bools,
    in_band: Bools,
}

fn place_of(seen: Seen, epsilon: f32, pixels: Pixels) -> Place {
    let tolerance = tolerance_at(seen.depth, epsilon);
    let limit = limit_of(tolerance, pixels.first, pixels.nearest);
    let before = pixels.open & (seen.depth < limit - 2.0 * tolerance) & !seen.disc;
    return Place(before, !before & (seen.depth <= limit));
}

// Adds a splat to the sums of the band. True if another layer has it, too.
fn add_to_band(band: ptr<function, Sums>, slot: u32, splat: Kernel, pixels: Pixels) -> bool {
    let segment_index = disc_of(splat).flags >> 1u;
    let seen = see_in_layer(splat, pixels);
    let zero = Floats(0.0);
    if SAMPLE_COVERAGE != 0u {
        let its_turn = segments[segment_index].flags >> 3u;
        if its_turn != (*band).turn { turn(band, its_turn); }
        // A hidden splat covers the pixel, too: what hides it covers it.
        (*band).sample_coverage += select(seen.weight, Floats(1.0), seen.disc);
        let tolerance = tolerance_at(seen.depth, segments[segment_index].epsilon);
        let shows = seen.depth <= limit_of(tolerance, pixels.first, pixels.nearest);
        let weight = select(zero, seen.weight * segments[segment_index].share, shows);
        if any_of(weight > zero) {
            add_values(band, slot, weight, select(zero, seen.depth, weight > zero));
            bend_normals(band, slot, splat, weight, pixels);
        }
        return false;
    }
    let place = place_of(seen, segments[segment_index].epsilon, pixels);
    add_to_layer(band, slot, splat, seen, place.in_band, pixels);
    return any_of(pixels.open & !place.in_band & (seen.disc | (seen.weight > zero)));
}

// Adds a splat to the sums of the layers other than the band.
fn add_to_others(
    front: ptr<function, Sums>, second: ptr<function, Sums>, rest: ptr<function, Sums>, slot: u32, splat: Kernel,
    pixels: Pixels,
) {
    let seen = see_in_layer(splat, pixels);
    let place = place_of(seen, segments[disc_of(splat).flags >> 1u].epsilon, pixels);
    let behind = pixels.open & !place.before & !place.in_band;
    let next = behind & (seen.depth <= pixels.second);
    let last = behind & !next;
    add_to_layer(front, slot, splat, seen, place.before, pixels);
    add_to_layer(second, slot, splat, seen, next, pixels);
    add_to_layer(rest, slot, splat, seen, last, pixels);
    (*rest).discs += select(Floats(0.0), Floats(1.0), last & seen.disc);
}

// Adds a splat to the sums of a layer in the pixels of which that layer `takes` it.
fn add_to_layer(
    sum: ptr<function, Sums>, slot: u32, splat: Kernel, seen: Seen, takes: Bools, pixels: Pixels,
) {
    let zero = Floats(0.0);
    let weight = select(zero, seen.weight, takes);
    if !any_of(weight > zero) { return; }
    add_values(sum, slot, weight, select(zero, seen.depth, weight > zero));
    bend_normals(sum, slot, splat, weight, pixels);
    if PEAK != 0u {
        (*sum).peak += weight * peak_of(splat);
        (*sum).side += weight * select(1.0, -1.0, (disc_of(splat).flags & FLAG_BACK) != 0u);
    }
}

// Adds what the normals of a sphere are more than that of its disc.
fn bend_normals(sum: ptr<function, Sums>, slot: u32, splat: Kernel, weight: Floats, pixels: Pixels) {
    if NORMAL == 0u || !is_sphere(disc_of(splat)) { return; }
    add_bend(sum, disc_of(splat), slot * VALUES + 3u, weight, pixels.column, pixels.row);
}

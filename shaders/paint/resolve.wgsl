// Pass `resolve`: composites the layers of a pixel, front to back, shades them, and adds them to the film with the time
// weight.
// Twins: src/backend/cpu/paint/resolve.rs, published/resolve.rs.  Math: docs/math.md, eq. 6 to 8 and 10, and section 3.
//   in   thresholds   depths of each tile, as common/depths.wgsl has them
//        rest         output of paint/rest.wgsl
//        sums         of each layer
//        lights, environment
//   out  film         for each tile, for each plane, its pixels: premultiplied colour and alpha; then depth, normal and
//                     velocity where they are wanted
//        rest_film    the same of what is at rest, with weight 1, where the groups of a position share it
// One invocation per pixel. The order of pixels does not matter. Groups are added in their order, one dispatch each.

@group(1) @binding(17) var<storage, read> thresholds: array<f32>;
@group(1) @binding(38) var<storage, read> rest: array<u32>;
@group(1) @binding(39) var<storage, read_write> rest_film: array<f32>;

// Is the film of what is at rest being made?
var<private> makes_rest: bool;

fn deposit(at: u32, value: f32) {
    if makes_rest {
        rest_film[at] += value;
    } else {
        film[at] += value;
    }
}

@compute @workgroup_size(16, 16)
fn resolve(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) pixel: vec3<u32>) {
    let index = tile.y * view.tiles.x + tile.x;
    let in_tile = pixel.y * TILE + pixel.x;
    let shares = (view.flags & SHARES_REST) != 0u && (rest[index] & RESTS) != 0u;
    if !shares {
        add_group(index, tile.xy, pixel.xy, view.weight);
        return;
    }
    let film_at = index * PLANES * TILE_PIXELS + in_tile;
    if (rest[index] & KNOWN) == 0u {
        for (var plane = 0u; plane < PLANES; plane += 1u) { rest_film[film_at + plane * TILE_PIXELS] = 0.0; }
        makes_rest = true;
        add_group(index, tile.xy, pixel.xy, 1.0);
    }
    for (var plane = 0u; plane < PLANES; plane += 1u) {
        let at = film_at + plane * TILE_PIXELS;
        film[at] += view.weight * rest_film[at];
    }
}

// Adds what one group shows at a pixel, times `weight`.
fn add_group(index: u32, tile: vec2<u32>, pixel: vec2<u32>, weight: f32) {
    let in_tile = pixel.y * TILE + pixel.x;
    let depths_at = depths_of(index);
    let first = thresholds[4u * (depths_at + threshold_place(vec2<u32>(pixel.x / 4u, pixel.y))) + pixel.x % 4u];
    if first == UNWANTED { return; }
    if LAYERS == 1u {
        let sum_at = index * CHANNELS * TILE_PIXELS + in_tile;
        let sum = sums[sum_at];
        if !(sum > 0.0) { return; }
        // Where no disc covers the pixel, only low-pass discs do: their weights are the coverage.
        var share = Share(select(min(sum, 1.0), 1.0, first < NONE), weight, true);
        if SAMPLE_COVERAGE != 0u { share = Share(sums[sum_at + (SAMPLE_COVERAGE + 1u) * TILE_PIXELS], 1.0, true); }
        add_pixel(index, tile, pixel, sum_at, share);
        return;
    }
    let second = thresholds[4u * (depths_at + second_place()) + in_tile];
    let solid = second == UNWANTED;
    // Where discs cover all around, the last layer closes what is left: the surface has no holes.
    var closing = LAYERS;
    if thresholds[4u * (depths_at + rim_place()) + in_tile] == 0.0 && !solid {
        for (var layer = 0u; layer < LAYERS; layer += 1u) {
            if sums[(index * LAYERS + layer) * CHANNELS * TILE_PIXELS + in_tile] > 0.0 { closing = layer; }
        }
    }
    var left = 1.0;
    for (var layer = 0u; layer < LAYERS; layer += 1u) {
        if solid && layer != BAND { continue; }
        let sum_at = (index * LAYERS + layer) * CHANNELS * TILE_PIXELS + in_tile;
        if !(sums[sum_at] > 0.0) { continue; }
        var covered = false;
        if layer == BAND { covered = first < NONE; }
        if layer == SECOND { covered = second < NONE; }
        if layer == REST { covered = sums[sum_at + (PEAK + 2u) * TILE_PIXELS] > 0.0; }
        var coverage = coverage_of_layer(sum_at, covered);
        if solid || layer == closing { coverage = 1.0; }
        let share = min(coverage, left);
        left -= share;
        add_pixel(index, tile, pixel, sum_at, Share(share, weight, layer == BAND));
    }
}

// Includes: common/types common/views common/fast common/channels common/shading common/environment common/depths
// Includes: resolve paint/rest
// Pass `resolve`: composites the layers of a pixel, front to back, shades them, and adds them to the film with the time
// weight.
// Twins: src/backend/cpu/paint/resolve.rs, published/resolve.rs.  Math: docs/math.md, eq. 6 to 8 and 10, and section 3.
//   in   thresholds   depths of each tile, as common/depths.wgsl has them
//        sums         of each layer
//        lights, environment
//        starts       output of `bin`
//   out  film         for each tile, for each plane, its pixels: premultiplied colour and alpha; then depth, normal and
//                     velocity where they are wanted
// One invocation per pixel. The order of pixels does not matter. The groups of a round that add to the same part of the
// film are added in their order.

@group(1) @binding(17) var<storage, read> thresholds: array<f32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;

// Planes of a film that has all layers.
const MOST_PLANES: u32 = 11u;
// What a group shows at the pixel, plane by plane.
var<private> shown: array<f32, MOST_PLANES>;

fn deposit(at: u32, value: f32) {
    shown[at / TILE_PIXELS] += value;
}

@compute @workgroup_size(16, 16)
fn resolve(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) pixel: vec3<u32>) {
    let end = tile.z + views[tile.z].same_film;
    let in_tile = pixel.y * TILE + pixel.x;
    // The view at rest whose tile is shown, after its number 1; 0 for none.
    var known = 0u;
    for (var number = tile.z; number < end; number += 1u) {
        view = views[number];
        if !has_tile(tile.xy) || (view.flags & IS_REST) != 0u { continue; }
        let at_rest = rests(tile.xy);
        // Groups that follow each other show the same tile at rest.
        if !at_rest || known != view.rest + 1u {
            for (var plane = 0u; plane < PLANES; plane += 1u) { shown[plane] = 0.0; }
            var index = tile_of(tile.xy);
            if at_rest { index = rest_tile_of(tile.xy); }
            show_group(index, tile.xy, pixel.xy);
            known = select(0u, view.rest + 1u, at_rest);
        }
        // The coverage of several samples holds their weights.
        var weight = view.weight;
        if SAMPLE_COVERAGE != 0u { weight = 1.0; }
        let at = film_tile_of(tile.xy) * PLANES * TILE_PIXELS + in_tile;
        for (var plane = 0u; plane < PLANES; plane += 1u) {
            film[at + plane * TILE_PIXELS] += weight * shown[plane];
        }
    }
}

// Finds what one group shows at a pixel, whose depths and sums are those of tile `index`.
fn show_group(index: u32, tile: vec2<u32>, pixel: vec2<u32>) {
    let in_tile = pixel.y * TILE + pixel.x;
    let depths_at = depths_of(index);
    let first = thresholds[4u * (depths_at + threshold_place(vec2<u32>(pixel.x / 4u, pixel.y))) + pixel.x % 4u];
    if first == UNWANTED { return; }
    if LAYERS == 1u {
        let sum_at = index * CHANNELS * TILE_PIXELS + in_tile;
        let sum = sums[sum_at];
        if !(sum > 0.0) { return; }
        // Where no disc covers the pixel, only low-pass discs do: their weights are the coverage.
        var share = Share(select(min(sum, 1.0), 1.0, first < NONE), 1.0, true);
        if SAMPLE_COVERAGE != 0u { share = Share(sums[sum_at + (SAMPLE_COVERAGE + 1u) * TILE_PIXELS], 1.0, true); }
        add_pixel(0u, tile, pixel, sum_at, share);
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
        add_pixel(0u, tile, pixel, sum_at, Share(share, 1.0, layer == BAND));
    }
}

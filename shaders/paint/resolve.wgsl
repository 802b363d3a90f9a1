// Pass `resolve`: composites the layers of a pixel, front to back, shades them, and adds them to the film with the time
// weight.
// Twins: src/backend/cpu/paint/resolve.rs, published/resolve.rs.  Math: docs/math.md, eq. 6 to 8 and 10, and section 3.
//   in   thresholds   depths of each tile, as common/depths.wgsl has them
//        sums         of each layer
//        lights, environment
//   out  film         for each tile, for each plane, its pixels: premultiplied colour and alpha; then depth, normal and
//                     velocity where they are wanted
// One invocation per pixel. The order of pixels does not matter. Groups are added in their order, one dispatch each.

@group(1) @binding(17) var<storage, read> thresholds: array<f32>;

@compute @workgroup_size(16, 16)
fn resolve(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) pixel: vec3<u32>) {
    let index = tile.y * view.tiles.x + tile.x;
    let in_tile = pixel.y * TILE + pixel.x;
    let depths_at = depths_of(index);
    let first = thresholds[4u * (depths_at + threshold_place(vec2<u32>(pixel.x / 4u, pixel.y))) + pixel.x % 4u];
    if first == UNWANTED { return; }
    if LAYERS == 1u {
        let sum_at = index * CHANNELS * TILE_PIXELS + in_tile;
        let sum = sums[sum_at];
        if !(sum > 0.0) { return; }
        // Where no disc covers the pixel, only low-pass discs do: their weights are the coverage.
        var share = Share(select(min(sum, 1.0), 1.0, first < NONE), view.weight, true);
        if SAMPLE_COVERAGE != 0u { share = Share(sums[sum_at + (SAMPLE_COVERAGE + 1u) * TILE_PIXELS], 1.0, true); }
        add_pixel(index, tile.xy, pixel.xy, sum_at, share);
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
        add_pixel(index, tile.xy, pixel.xy, sum_at, Share(share, view.weight, layer == BAND));
    }
}

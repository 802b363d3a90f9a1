// Pass `resolve` of full EWA (program `ewa_resolve`): composites the layers of a pixel, front to back, and adds them to
// the film with the time weight.
// Twin: src/backend/cpu/paint/resolve.rs.  Math: docs/math.md, section 3.
//   in   thresholds   depths of each tile, as common/ewa.wgsl has them
//        sums         of each layer
//        lights, environment
//   out  film
// One invocation per pixel.

// As in ewa/attribute.wgsl.
override LAYERS: u32 = 1u;
const FRONT: u32 = 0u;
const BAND: u32 = 1u;
const SECOND: u32 = 2u;
const REST: u32 = 3u;
// First of three channels: weight times peak, weights that are negative for backs, and discs.
override PEAK: u32 = 0u;

@compute @workgroup_size(16, 16)
fn ewa_resolve(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) pixel: vec3<u32>) {
    let index = tile.y * view.tiles.x + tile.x;
    let in_tile = pixel.y * TILE + pixel.x;
    let depths_at = depths_of(index);
    let first = thresholds[4u * (depths_at + threshold_place(vec2<u32>(pixel.x / 4u, pixel.y))) + pixel.x % 4u];
    if first == UNWANTED { return; }
    if LAYERS == 1u {
        let sum_at = index * CHANNELS * TILE_PIXELS + in_tile;
        if !(sums[sum_at] > 0.0) { return; }
        let covered = sums[sum_at + (SAMPLE_COVERAGE + 1u) * TILE_PIXELS];
        add_pixel(index, tile.xy, pixel.xy, sum_at, Share(covered, 1.0, true));
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
        let weight = sums[sum_at];
        if !(weight > 0.0) { continue; }
        let peak_at = sum_at + PEAK * TILE_PIXELS;
        var covered = false;
        if layer == BAND { covered = first < NONE; }
        if layer == SECOND { covered = second < NONE; }
        if layer == REST { covered = sums[peak_at + 2u * TILE_PIXELS] > 0.0; }
        // Of a thin sheet both sides are there; they cover once.
        let sum = 0.5 * (weight + abs(sums[peak_at + TILE_PIXELS]));
        // What filtering leaves of the kernels' peaks, and a share of the rest: where half is left, discs tell outlines
        // better than sums, which miss what kernels lose towards their rims.
        let lost = 1.0 - sums[peak_at] * (1.0 / weight);
        let hard = 1.0 - lost * lost;
        var coverage = hard * select(0.0, 1.0, covered) + (1.0 - hard) * min(sum, 1.0);
        if solid || layer == closing { coverage = 1.0; }
        let share = min(coverage, left);
        left -= share;
        add_pixel(index, tile.xy, pixel.xy, sum_at, Share(share, view.weight, layer == BAND));
    }
}

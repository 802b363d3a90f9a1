// Pass `resolve` for kernels in motion: turns the times at which kernels cover into coverage, and pools colours that
// are normalised once.
// Twins: src/backend/cpu/swept/resolve.rs, published/coverage.rs.  Math: docs/math.md, eq. 18, 19 and 20b.
//   in   sums, lights
//        coverage_mask   of each pixel
//        moments         share of the exposure of each 32nd of the interval
//   out  film
// `swept_resolve` adds a group as `resolve` does; `pool` adds its sums without dividing them. `finish` comes once,
// after all groups.
// One invocation per pixel.

@group(1) @binding(25) var<storage, read> coverage_mask: array<u32>;
@group(1) @binding(26) var<storage, read> moments: array<f32>;

// If true, the coverage is the sum of weights.
override SUM: bool = false;
// Plane of the sum of weights. It is the plane of alpha where there is none.
override WEIGHT_PLANE: u32 = 3u;

// If true, kernels weigh as published.
override PUBLISHED: bool = false;

// By how much sums of weights on a surface may be off from 1, over the square of the mean peak of the kernels.
const NOISE: f32 = 2.0;

// The share of the exposure in which a pixel is covered, where it is no sum. `at`: the first of the pixel's masks.
fn coverage_of_masks(at: u32) -> f32 {
    let surface = coverage_mask[at];
    let either = surface | coverage_mask[at + TILE_PIXELS];
    let sum = bitcast<f32>(coverage_mask[at + 2u * TILE_PIXELS]);
    let peak = bitcast<f32>(coverage_mask[at + 3u * TILE_PIXELS]);
    let side = bitcast<f32>(coverage_mask[at + 4u * TILE_PIXELS]);
    var by_discs = 0.0;
    var most = 0.0;
    for (var i = 0u; i < 32u; i += 1u) {
        by_discs += select(0.0, moments[i], ((surface >> i) & 1u) != 0u);
        most += select(0.0, moments[i], ((either >> i) & 1u) != 0u);
    }
    if surface == 0xffffffffu { by_discs = view.weight; }
    if either == 0xffffffffu { most = view.weight; }
    let large = select(1.0, peak / sum, sum > 0.0);
    let hard = 1.0 - (1.0 - large) * (1.0 - large);
    // A thin two-sided sheet counts with the larger of its sides' sums.
    let weight = view.weight * (0.5 * (sum + abs(side)));
    // The time for which discs cover, as far as the weights may be off by noise.
    let noise = 1.0 + NOISE * (large * large);
    let soft = min(max(min(by_discs, weight * noise), weight / noise), most);
    return hard * by_discs + (1.0 - hard) * soft;
}

// The share of the exposure in which a pixel is covered.
fn coverage(index: u32, in_tile: u32) -> f32 {
    let at = select(5u, 3u, PUBLISHED) * index * TILE_PIXELS + in_tile;
    if !PUBLISHED && !SUM { return coverage_of_masks(at); }
    var loose = view.weight * bitcast<f32>(coverage_mask[at + 2u * TILE_PIXELS]);
    if SUM { return loose; }
    let surface = coverage_mask[at];
    if surface == 0xffffffffu { return view.weight; }
    let others = coverage_mask[at + TILE_PIXELS] & ~surface;
    var covers = 0.0;
    var reached = 0.0;
    for (var i = 0u; i < 32u; i += 1u) {
        covers += select(0.0, moments[i], ((surface >> i) & 1u) != 0u);
        reached += select(0.0, moments[i], ((others >> i) & 1u) != 0u);
    }
    // At times when only low-pass discs cover the pixel, the sum of their weights is the coverage, up to the length of
    // those times.
    return covers + min(loose, reached);
}

@compute @workgroup_size(16, 16)
fn swept_resolve(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) pixel: vec3<u32>) {
    let index = tile.y * view.tiles.x + tile.x;
    let in_tile = pixel.y * TILE + pixel.x;
    let covered = coverage(index, in_tile);
    let sum_at = index * CHANNELS * TILE_PIXELS + in_tile;
    if sums[sum_at] > 0.0 {
        add_pixel(index, tile.xy, pixel.xy, sum_at, Share(covered, 1.0, false));
    }
}

@compute @workgroup_size(16, 16)
fn pool(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) pixel: vec3<u32>) {
    let index = tile.y * view.tiles.x + tile.x;
    let in_tile = pixel.y * TILE + pixel.x;
    let sum_at = index * CHANNELS * TILE_PIXELS + in_tile;
    let at = index * PLANES * TILE_PIXELS + in_tile;
    let weight = view.weight;
    film[at + WEIGHT_PLANE * TILE_PIXELS] += weight * sums[sum_at];
    add(at, mean(sum_at, 1u, 1.0), Share(1.0, weight, false));
    let covered = coverage(index, in_tile);
    film[at + 3u * TILE_PIXELS] += covered;
    if DEPTH_PLANE != 0u {
        film[at + DEPTH_PLANE * TILE_PIXELS] += weight * sums[sum_at + DEPTH * TILE_PIXELS];
    }
    if NORMAL_PLANE != 0u {
        add(at + NORMAL_PLANE * TILE_PIXELS, mean(sum_at, NORMAL, 1.0), Share(1.0, weight, false));
    }
    if VELOCITY_PLANE != 0u {
        let x = at + VELOCITY_PLANE * TILE_PIXELS;
        film[x] += weight * sums[sum_at + VELOCITY * TILE_PIXELS];
        film[x + TILE_PIXELS] += weight * sums[sum_at + (VELOCITY + 1u) * TILE_PIXELS];
    }
}

// Clamps the coverage, and divides the other planes by the sum of weights.
@compute @workgroup_size(16, 16)
fn finish(
    @builtin(workgroup_id) tile: vec3<u32>, @builtin(num_workgroups) tiles: vec3<u32>,
    @builtin(local_invocation_id) pixel: vec3<u32>,
) {
    let at = (tile.y * tiles.x + tile.x) * PLANES * TILE_PIXELS + pixel.y * TILE + pixel.x;
    let alpha = min(film[at + 3u * TILE_PIXELS], 1.0);
    let total = film[at + WEIGHT_PLANE * TILE_PIXELS];
    let scale = select(0.0, alpha / total, total > 0.0);
    for (var plane = 0u; plane < PLANES; plane += 1u) {
        film[at + plane * TILE_PIXELS] *= scale;
    }
    film[at + 3u * TILE_PIXELS] = alpha;
}

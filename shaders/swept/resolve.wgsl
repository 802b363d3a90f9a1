// Includes: common/types common/views common/fast common/shading common/unshadowed common/environment common/channels
// Includes: resolve
// Pass `resolve` for kernels in motion: turns the times at which kernels cover into coverage, and pools colours that
// are normalised once. `coverage` is in swept/coverage.wgsl, or in published/coverage.wgsl.
// Twin: src/backend/cpu/swept/resolve.rs.
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

@compute @workgroup_size(16, 16)
fn swept_resolve(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) pixel: vec3<u32>) {
    let end = tile.z + views[tile.z].same_film;
    for (var number = tile.z; number < end; number += 1u) {
        view = views[number];
        if !has_tile(tile.xy) { continue; }
        let index = tile_of(tile.xy);
        let in_tile = pixel.y * TILE + pixel.x;
        let covered = coverage(index, in_tile);
        let sum_at = index * CHANNELS * TILE_PIXELS + in_tile;
        if sums[sum_at] > 0.0 {
            add_pixel(film_tile_of(tile.xy), tile.xy, pixel.xy, sum_at, Share(covered, 1.0, false));
        }
    }
}

@compute @workgroup_size(16, 16)
fn pool(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) pixel: vec3<u32>) {
    let end = tile.z + views[tile.z].same_film;
    for (var number = tile.z; number < end; number += 1u) {
        view = views[number];
        if has_tile(tile.xy) { pool_interval(tile.xy, pixel.y * TILE + pixel.x); }
    }
}

// Adds pixel `in_tile` of a tile of the view.
fn pool_interval(tile: vec2<u32>, in_tile: u32) {
    let index = tile_of(tile);
    let sum_at = index * CHANNELS * TILE_PIXELS + in_tile;
    let at = film_tile_of(tile) * PLANES * TILE_PIXELS + in_tile;
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
fn finish(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) pixel: vec3<u32>) {
    view = views[0];
    let at = film_tile_of(tile.xy) * PLANES * TILE_PIXELS + pixel.y * TILE + pixel.x;
    let alpha = min(film[at + 3u * TILE_PIXELS], 1.0);
    let total = film[at + WEIGHT_PLANE * TILE_PIXELS];
    let scale = select(0.0, alpha / total, total > 0.0);
    for (var plane = 0u; plane < PLANES; plane += 1u) {
        film[at + plane * TILE_PIXELS] *= scale;
    }
    film[at + 3u * TILE_PIXELS] = alpha;
}

fn deposit(at: u32, value: f32) {
    film[at] += value;
}

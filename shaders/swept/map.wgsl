// Pass `store` of the map: writes the visible surface at mid-interval into a map of the band and the guard band around
// it.
// Twin: src/backend/cpu/swept/map.rs.
//   in   thresholds, and sums that hold the weights alone
//   out  map       tile after tile, for each pixel: depth threshold and inverse density, both NONE where there is no
//                  kernel
// One invocation per pixel. The end of the dispatch is the barrier: kernels in motion look up sources anywhere on the
// map.

@group(1) @binding(17) var<storage, read> thresholds: array<f32>;
@group(1) @binding(20) var<storage, read> sums: array<f32>;
@group(1) @binding(24) var<storage, read_write> map: array<vec2<f32>>;

// If false, weights are not summed.
override DENSITY: bool = true;

@compute @workgroup_size(16, 16)
fn store_map(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) pixel: vec3<u32>) {
    let at = (tile.y * view.tiles.x + tile.x) * TILE_PIXELS + pixel.y * TILE + pixel.x;
    var inverse = 1.0;
    if DENSITY {
        inverse = select(NONE, 1.0 / sums[at], sums[at] > 0.0);
    }
    map[at] = vec2<f32>(thresholds[at], inverse);
}

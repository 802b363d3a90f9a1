// Includes: common/types common/views
// Pass `store` of the map: writes the visible surface at mid-interval into a map of the band and the guard band around
// it.
// Twin: src/backend/cpu/published/map.rs.
//   in   thresholds
//   out  map       tile after tile, for each pixel: depth threshold, NONE where there is no kernel
// One invocation per pixel. The end of the dispatch is the barrier: kernels in motion look up sources anywhere on the
// map.

@group(1) @binding(17) var<storage, read> thresholds: array<f32>;
@group(1) @binding(24) var<storage, read_write> map: array<f32>;

@compute @workgroup_size(16, 16)
fn store_map(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) pixel: vec3<u32>) {
    view = views[tile.z];
    let at = tile_of(tile.xy) * TILE_PIXELS + pixel.y * TILE + pixel.x;
    map[at] = thresholds[at];
}

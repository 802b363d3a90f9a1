// Includes: swept/slices common/list
// Pass `visibility` for kernels in motion: the depth threshold of each slice of the interval, and its least depth where
// objects have several tolerances. This program begins them, and takes the wide kernels. Then visibility_entries.wgsl
// takes all others.
//   in   splats, starts, wide   output of `sweep` and `bin`; no entry of `list`
//        segments  epsilon of a kernel's object
//   in and out  map   for each tile, for each slice, its pixels: thresholds, NONE where nothing covers the middle of
//                  the slice; behind those of all tiles the least depths, likewise
// One workgroup per tile, one invocation per pixel. The order of kernels does not change a minimum.

@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(24) var<storage, read_write> map: array<f32>;

@compute @workgroup_size(16, 16)
fn swept_visibility(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) in_tile: vec3<u32>) {
    view = views[tile.z];
    if !has_tile(tile.xy) { return; }
    let index = tile_of(tile.xy);
    let pixel = vec2<u32>(tile.x, view.first_tile_row + tile.y) * TILE + in_tile.xy;
    let at = in_tile.y * TILE + in_tile.x;
    let slices = slices_of(index, at);
    let nearest = nearest_of(index, at);
    if view.resumes == 0u {
        for (var slice = 0u; slice < SLICES; slice += 1u) {
            map[slices + slice * TILE_PIXELS] = NONE;
            if NEAREST { map[nearest + slice * TILE_PIXELS] = NONE; }
        }
    }
    var walk = walk_of(index);
    walk.next = walk.end;
    walk = stretch_of(walk);
    while has_next(walk) {
        let kernel = covered_at(next_slot(&walk), pixel);
        for (var slice = kernel.first; slice <= kernel.last; slice += 1u) {
            let depth = depth_in(kernel, slice);
            if depth == NONE { continue; }
            let place = slices + slice * TILE_PIXELS;
            map[place] = min(map[place], depth + tolerance_at(depth, kernel.epsilon));
            if NEAREST {
                let nearest_place = nearest + slice * TILE_PIXELS;
                map[nearest_place] = min(map[nearest_place], depth);
            }
        }
    }
}

// Includes: common/types common/views common/fast common/swept common/swept_filter common/sweep common/ray common/list
// Pass `visibility` for kernels in motion: the depth threshold of each slice of the interval, and its least depth where
// objects have several tolerances.
// Twin: src/backend/cpu/swept/slices.rs.  Math: docs/math.md, section 7.
//   in   splats, list, starts, wide   output of `sweep` and `bin`
//        segments  epsilon of a kernel's object
//   in and out  map   for each tile, for each slice, its pixels: thresholds, NONE where nothing covers the middle of
//                  the slice; behind those of all tiles the least depths, likewise
// One workgroup per tile, one invocation per pixel. The order of kernels does not change a minimum.

@group(1) @binding(2) var<storage, read> segments: array<Segment>;
@group(1) @binding(4) var<storage, read> splats: array<SweptSplat>;
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
    var walk = stretch_of(walk_of(index));
    while has_next(walk) {
        lower(next_slot(&walk), pixel, slices, nearest);
    }
}

// Lowers the thresholds, and the nearest depths, of the slices whose middle a kernel covers.
fn lower(slot: u32, pixel: vec2<u32>, slices: u32, nearest: u32) {
    let bounds = unpack(splats[slot].bounds);
    if pixel.x < bounds.x || pixel.x > bounds.y || pixel.y < bounds.z || pixel.y > bounds.w { return; }
    let place = vec2<f32>(pixel);
    if !in_hull(slot, place) { return; }
    let splat = splats[slot];
    let x = place.x + 0.5 - splat.reference.x;
    let y = place.y + 0.5 - splat.reference.y;
    let i = splat.inverse_depth;
    let w = form(i, x, y);
    let path = Path(
        vec2<f32>(form(splat.u, x, y), form(splat.v, x, y)),
        vec2<f32>(form(splat.u_rate, x, y), form(splat.v_rate, x, y)),
        w,
    );
    let k = i[0] * splat.motion[0] + i[1] * splat.motion[1] + i[2] * splat.motion[2];
    let span = beyond_near(view.near * w - 1.0, k, reciprocal(k), covered(sweep_of(path, 0.0)));
    if !(w > 0.0 && span.x < span.y) { return; }
    let epsilon = segments[splat.flags >> SEGMENT_SHIFT].epsilon;
    let plane = vec2<f32>(1.0 / w, k / w);
    let ends = slices_in(span);
    for (var slice = ends.x; slice <= ends.y; slice += 1u) {
        let middle = slice_times(slice).y;
        if span.x < middle && middle < span.y {
            let depth = plane.x + middle * plane.y;
            let at = slices + slice * TILE_PIXELS;
            map[at] = min(map[at], depth + tolerance_at(depth, epsilon));
            if NEAREST {
                let nearest_at = nearest + slice * TILE_PIXELS;
                map[nearest_at] = min(map[nearest_at], depth);
            }
        }
    }
}

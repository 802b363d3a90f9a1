// Includes: swept/slices common/entries
// The part of pass `visibility` for kernels in motion that takes the entries of lists, after swept/visibility.wgsl:
// each lowers the slices of its tile. The map is in and out.

@group(1) @binding(24) var<storage, read_write> map: array<atomic<u32>>;

@compute @workgroup_size(PIECE)
fn swept_entries(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = entry_at(group, lane);
    if !has_entry(entry) { return; }
    let tile = load_tile_of(entry);
    let index = tile_of(tile);
    let slot = list[entry];
    let first = first_pixel(tile);
    let bounds = bounds_in(unpack(splats[slot].bounds), first, 0u);
    for (var y = bounds.z; y <= bounds.w; y += 1) {
        for (var x = bounds.x; x <= bounds.y; x += 1) {
            let in_tile = TILE * u32(y) + u32(x);
            let kernel = covered_at(slot, first + vec2<u32>(u32(x), u32(y)));
            for (var slice = kernel.first; slice <= kernel.last; slice += 1u) {
                let depth = depth_in(kernel, slice);
                if depth == NONE { continue; }
                lower(slices_of(index, in_tile) + slice * TILE_PIXELS, depth + tolerance_at(depth, kernel.epsilon));
                if NEAREST { lower(nearest_of(index, in_tile) + slice * TILE_PIXELS, depth); }
            }
        }
    }
}

fn lower(place: u32, depth: f32) {
    if depth < bitcast<f32>(atomicLoad(&map[place])) { atomicMin(&map[place], bitcast<u32>(depth)); }
}

// Includes: paint/entries
// The part of pass `visibility` that takes the entries of lists, after paint/visibility.wgsl: each lowers the depths of
// its tile. Thresholds are in and out.

@compute @workgroup_size(PIECE)
fn visibility_entries(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = entry_at(group, lane);
    if !has_entry(entry) { return; }
    let tile = load_tile_of(entry);
    let depths_at = 4u * depths_of(tile_of(tile));
    if PEEL && depth_at(depths_at + 4u * state_place()) == 0.0 { return; }
    let disc = disc_of(splats[list[entry]]);
    let first = first_pixel(tile);
    let bounds = bounds_in(unpack(disc.bounds), first, apron());
    for (var y = bounds.z; y <= bounds.w; y += 1) {
        for (var x = bounds.x; x <= bounds.y; x += 1) {
            let met = meet(disc, u32(i32(first.x) + x), u32(i32(first.y) + y));
            if !met.covers { continue; }
            let place = place_around(x, y);
            if PEEL && met.depth <= depth_at(depths_at + 4u * floor_place() + place) { continue; }
            lower(depths_at + place, met.threshold);
            if NEAREST && min(x, y) >= 0 && max(x, y) < i32(TILE) {
                lower(4u * nearest_of(tile_of(tile)) + TILE * u32(y) + u32(x), met.depth);
            }
        }
    }
}

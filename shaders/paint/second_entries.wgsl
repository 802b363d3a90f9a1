// Includes: paint/entries
// The part of pass `second` that takes the entries of lists, after paint/second.wgsl: each lowers the second thresholds
// of its tile. Thresholds are in and out.

@compute @workgroup_size(PIECE)
fn second_entries(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = entry_at(group, lane);
    if !has_entry(entry) { return; }
    let tile = load_tile_of(entry);
    let disc = disc_of(splats[list[entry]]);
    let own = view.number;
    lower_behind(tile, disc);
    if (view.flags & IS_REST) == 0u { return; }
    // Splats at rest are in the tiles of all views that share them, which have limits of their own.
    for (var other = own + 1u; other < views[0].views; other += 1u) {
        if views[other].rest != own { continue; }
        view = views[other];
        lower_behind(tile, disc);
    }
}

// Lowers the second thresholds of a tile of the view by a disc, where it lies behind the limit of its object.
fn lower_behind(tile: vec2<u32>, disc: Splat) {
    if rests(tile) { return; }
    let index = tile_of(tile);
    let depths_at = 4u * depths_of(index);
    let first = first_pixel(tile);
    let bounds = bounds_in(unpack(disc.bounds), first, 0u);
    for (var y = bounds.z; y <= bounds.w; y += 1) {
        for (var x = bounds.x; x <= bounds.y; x += 1) {
            let in_tile = TILE * u32(y) + u32(x);
            let second_at = depths_at + 4u * second_place() + in_tile;
            // Solid pixels have none.
            if depth_at(second_at) < 0.0 { continue; }
            let met = meet(disc, first.x + u32(x), first.y + u32(y));
            let least = depth_at(depths_at + place_around(x, y));
            var nearest = least;
            if NEAREST { nearest = depth_at(4u * nearest_of(index) + in_tile); }
            if met.covers && met.depth > limit_of(met.tolerance, least, nearest) { lower(second_at, met.threshold); }
        }
    }
}

// Includes: common/at_once paint/discs_at_once paint/second
// Pass `second` by pixels: one invocation per pixel. They read the tile's list together.

@compute @workgroup_size(LANES)
fn second(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    view = views[tile.z];
    if !has_tile(tile.xy) { return; }
    let index = tile_of(tile.xy);
    let place = vec2<u32>(tile.x, view.first_tile_row + tile.y);
    if !is_wanted(place) || rests(tile.xy) { return; }
    if PEEL {
        if lane == 0u { live = u32(is_peeled_on(index)); }
        if workgroupUniformLoad(&live) == 0u { return; }
    }
    let at = in_panels(lane, 0u, TILE / PANEL_COLUMNS);
    let in_tile = at.y * 4u + at.x / 4u;
    let column = place.x * TILE + at.x;
    let row = place.y * TILE + at.y;
    let depths_at = depths_of(index);
    let second_at = place_in(depths_at + second_place() + in_tile, at.x);
    var second = NONE;
    if view.resumes == 0u {
        for (var i = lane; i < 4u * guarded_quads(); i += LANES) {
            invert(place * TILE, i / 4u, i % 4u, thresholds[4u * depths_at + i]);
        }
        workgroupBarrier();
        let pixel = begun(at, thresholds[place_in(depths_at + epsilon_place() + in_tile, at.x)]);
        thresholds[place_in(depths_at + rim_place() + in_tile, at.x)] = pixel.x;
        second = pixel.y;
    } else {
        second = thresholds[second_at];
    }
    let is_open = !PEEL && second > UNWANTED;
    if any_lane(lane, is_open) {
        let first = thresholds[place_in(depths_at + threshold_place(vec2<u32>(at.x / 4u, at.y)), at.x)];
        var nearest = first;
        if NEAREST { nearest = thresholds[place_in(nearest_of(index) + in_tile, at.x)]; }
        let walk = walk_at(tile.xy);
        let entries = entries_of(walk);
        for (var before = 0u; before < entries; before += AT_ONCE) {
            read_discs(lane, walk, before, entries, vec2<i32>(place * TILE), TILE / PANEL_COLUMNS, 0u);
            for (var word = 0u; word < WORDS && is_open; word += 1u) {
                var left = mask_of(lane, word);
                while left != 0u {
                    let k = 32u * word + firstTrailingBit(left);
                    left &= left - 1u;
                    if !touches(unpack(discs_read[k].bounds), column, row) { continue; }
                    second = lowered_behind(second, discs_read[k], epsilons_read[k], first, nearest, column, row);
                }
            }
        }
    }
    thresholds[second_at] = second;
}

// Includes: common/at_once paint/discs_at_once
// Pass `visibility` by pixels: one workgroup per tile, one invocation per pixel of it, and then of its apron. They read
// the tile's list together.

@compute @workgroup_size(LANES)
fn visibility(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    view = views[tile.z];
    if !has_tile(tile.xy) { return; }
    let index = tile_of(tile.xy);
    let place = vec2<u32>(tile.x, view.first_tile_row + tile.y);
    if PEEL {
        if lane == 0u { live = u32(is_peeled_on(index)); }
        if workgroupUniformLoad(&live) == 0u { return; }
    }
    if rests(tile.xy) { return; }
    if !is_wanted(place) {
        for (var i = lane; i < 4u * depth_quads(); i += LANES) {
            thresholds[4u * depths_of(index) + i] = UNWANTED;
        }
        return;
    }
    let walk = walk_at(tile.xy);
    let entries = entries_of(walk);
    if view.resumes != 0u && entries == 0u { return; }
    let first = vec2<i32>(place * TILE) - vec2<i32>(vec2<u32>(4u * apron_quads(), apron()));
    let in_row = 4u * row_quads() / PANEL_COLUMNS;
    let rows = (TILE + 2u * apron() + PANEL_ROWS - 1u) / PANEL_ROWS;
    for (var done = 0u; done < in_row * rows; done += PANELS) {
        let at = in_panels(lane, done, in_row);
        let site = site_of(index, place, at);
        var depths = depths_before(site);
        for (var before = 0u; before < entries; before += AT_ONCE) {
            read_discs(lane, walk, before, entries, first, in_row, done);
            for (var word = 0u; word < WORDS; word += 1u) {
                var left = mask_of(lane, word);
                while left != 0u {
                    let k = 32u * word + firstTrailingBit(left);
                    left &= left - 1u;
                    if touches(unpack(discs_read[k].bounds), site.column, site.row) {
                        depths = lowered(depths, discs_read[k], epsilons_read[k], site.column, site.row);
                    }
                }
            }
        }
        store_depths(site, depths);
    }
}

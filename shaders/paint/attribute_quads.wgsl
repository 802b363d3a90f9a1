// Pass `attribute` by quads: one workgroup per tile, one invocation per quad. Each walks over the list by itself.

@compute @workgroup_size(4, 16)
fn sum_attributes(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) place: vec3<u32>) {
    view = views[tile.z];
    if !has_tile(tile.xy) { return; }
    let index = tile_of(tile.xy);
    if !is_live(index) || rests(tile.xy) { return; }
    let at = vec2<u32>(4u * place.x, place.y);
    let pixels = pixels_of(tile.xy, at);
    if all(pixels.first == Floats(UNWANTED)) { return; }
    let sites = sites_of(index, at);
    var walk = walk_at(tile.xy);
    if view.resumes != 0u && SAMPLE_COVERAGE == 0u && !has_next(walk) { return; }
    var band = Sums();
    band.turn = view.first_turn;
    if view.resumes != 0u { load_sums(&band, sites.band); }
    var has_others = false;
    while has_next(walk) {
        let slot = next_slot(&walk);
        if !touches(weight_bounds(splats[slot]), pixels.column, pixels.row) { continue; }
        has_others |= add_to_band(&band, slot, splats[slot], pixels);
    }
    if SAMPLE_COVERAGE != 0u && band.turn < view.last_turn { turn(&band, view.last_turn); }
    store_sums(&band, sites.band);
    if !any_of(pixels.open) || (view.resumes != 0u && !has_others) { return; }
    var front = Sums();
    var second = Sums();
    var rest = Sums();
    if view.resumes != 0u {
        load_sums(&front, sites.tile + FRONT * sites.layer);
        if LAYERS > 2u {
            load_sums(&second, sites.tile + SECOND * sites.layer);
            load_sums(&rest, sites.tile + REST * sites.layer);
        }
    }
    walk = walk_at(tile.xy);
    while has_others && has_next(walk) {
        let slot = next_slot(&walk);
        if !touches(weight_bounds(splats[slot]), pixels.column, pixels.row) { continue; }
        add_to_others(&front, &second, &rest, slot, splats[slot], pixels);
    }
    store_sums(&front, sites.tile + FRONT * sites.layer);
    if LAYERS > 2u {
        store_sums(&second, sites.tile + SECOND * sites.layer);
        store_sums(&rest, sites.tile + REST * sites.layer);
    }
}

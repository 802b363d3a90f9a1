// Includes: common/at_once
// Pass `attribute` by pixels: one workgroup per tile, one invocation per pixel. They read the tile's list together.

var<workgroup> slots_read: array<u32, AT_ONCE>;
var<workgroup> kernels_read: array<Kernel, AT_ONCE>;

@compute @workgroup_size(LANES)
fn sum_attributes(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    view = views[tile.z];
    if !has_tile(tile.xy) { return; }
    let index = tile_of(tile.xy);
    if rests(tile.xy) { return; }
    let at = in_panels(lane);
    let pixels = pixels_of(tile.xy, at);
    // That is so in all pixels of a tile or in none.
    if !any_lane(lane, is_live(index) && pixels.first != UNWANTED) { return; }
    let sites = sites_of(index, at);
    let walk = walk_at(tile.xy);
    if view.resumes != 0u && SAMPLE_COVERAGE == 0u && !has_next(walk) { return; }
    let entries = entries_of(walk);
    var band = Sums();
    band.turn = view.first_turn;
    if view.resumes != 0u { load_sums(&band, sites.band); }
    var has_others = false;
    for (var before = 0u; before < entries; before += AT_ONCE) {
        read_kernels(lane, tile.xy, walk, before, entries);
        for (var word = 0u; word < WORDS; word += 1u) {
            var left = mask_of(lane, word);
            while left != 0u {
                let k = 32u * word + firstTrailingBit(left);
                left &= left - 1u;
                if !touches(weight_bounds(kernels_read[k]), pixels.column, pixels.row) { continue; }
                has_others |= add_to_band(&band, slots_read[k], kernels_read[k], pixels);
            }
        }
    }
    if SAMPLE_COVERAGE != 0u && band.turn < view.last_turn { turn(&band, view.last_turn); }
    store_sums(&band, sites.band);
    if LAYERS == 1u { return; }
    let has_layers = pixels.open && !(view.resumes != 0u && !has_others);
    let others_at_all = any_lane(lane, has_others);
    var front = Sums();
    var second = Sums();
    var rest = Sums();
    if has_layers && view.resumes != 0u {
        load_sums(&front, sites.tile + FRONT * sites.layer);
        if LAYERS > 2u {
            load_sums(&second, sites.tile + SECOND * sites.layer);
            load_sums(&rest, sites.tile + REST * sites.layer);
        }
    }
    for (var before = 0u; others_at_all && before < entries; before += AT_ONCE) {
        read_kernels(lane, tile.xy, walk, before, entries);
        for (var word = 0u; word < WORDS && has_others; word += 1u) {
            var left = mask_of(lane, word);
            while left != 0u {
                let k = 32u * word + firstTrailingBit(left);
                left &= left - 1u;
                if !touches(weight_bounds(kernels_read[k]), pixels.column, pixels.row) { continue; }
                add_to_others(&front, &second, &rest, slots_read[k], kernels_read[k], pixels);
            }
        }
    }
    if has_layers {
        store_sums(&front, sites.tile + FRONT * sites.layer);
        if LAYERS > 2u {
            store_sums(&second, sites.tile + SECOND * sites.layer);
            store_sums(&rest, sites.tile + REST * sites.layer);
        }
    }
}

// Reads the entries of a walk from entry `before` on.
fn read_kernels(lane: u32, tile: vec2<u32>, walk: Walk, before: u32, entries: u32) {
    workgroupBarrier();
    clear_masks(lane);
    workgroupBarrier();
    if lane < AT_ONCE && before + lane < entries {
        let slot = entry_of(walk, before + lane);
        slots_read[lane] = slot;
        kernels_read[lane] = splats[slot];
        let first = vec2<i32>(vec2<u32>(tile.x, view.first_tile_row + tile.y) * TILE);
        mark(lane, weight_bounds(splats[slot]), first);
    }
    workgroupBarrier();
}

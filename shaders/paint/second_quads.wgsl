// Includes: paint/second
// Pass `second` by quads: one invocation per quad. Each walks over the tile's list by itself.

@compute @workgroup_size(4, 16)
fn second(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(local_invocation_id) quad: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    view = views[tile.z];
    if !has_tile(tile.xy) { return; }
    let index = tile_of(tile.xy);
    let place = vec2<u32>(tile.x, view.first_tile_row + tile.y);
    if !is_wanted(place) || rests(tile.xy) { return; }
    if PEEL {
        if lane == 0u { live = u32(is_peeled_on(index)); }
        if workgroupUniformLoad(&live) == 0u { return; }
    }
    let column = place.x * TILE + 4u * quad.x;
    let row = place.y * TILE + quad.y;
    let depths_at = depths_of(index);
    let second_at = depths_at + second_place() + lane;
    var second = vec4<f32>(NONE);
    if view.resumes == 0u {
        for (var i = lane; i < guarded_quads(); i += TILE_QUADS) {
            for (var k = 0u; k < 4u; k += 1u) { invert(place * TILE, i, k, thresholds[depths_at + i][k]); }
        }
        workgroupBarrier();
        let epsilon = thresholds[depths_at + epsilon_place() + lane];
        var rim = vec4<f32>(0.0);
        for (var i = 0u; i < 4u; i += 1u) {
            let pixel = begun(vec2<u32>(4u * quad.x + i, quad.y), epsilon[i]);
            rim[i] = pixel.x;
            second[i] = pixel.y;
        }
        thresholds[depths_at + rim_place() + lane] = rim;
    } else {
        second = thresholds[second_at];
    }
    if !PEEL && any(second > vec4<f32>(UNWANTED)) {
        let first = thresholds[depths_at + threshold_place(quad.xy)];
        var nearest = first;
        if NEAREST { nearest = thresholds[nearest_of(index) + lane]; }
        var walk = walk_at(tile.xy);
        while has_next(walk) {
            let slot = next_slot(&walk);
            if !touches(unpack(disc_of(splats[slot]).bounds), column, row) { continue; }
            let disc = disc_of(splats[slot]);
            second = lowered_behind(second, disc, segments[disc.flags >> 1u].epsilon, first, nearest, column, row);
        }
    }
    thresholds[second_at] = second;
}

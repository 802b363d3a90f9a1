// Pass `visibility` by quads: one workgroup per tile, one invocation per quad. A device waits long for each entry of a
// list; so the invocations of a tile read one entry each, and then walk over what all have read.

// Invocations of a tile: enough for the tile, and with a filter for an apron of two pixels at once.
override INVOCATIONS: u32 = select(64u, 128u, FILTERED);
// Discs that are read at once, and the epsilons of their objects.
const READ: u32 = 64u;
var<workgroup> discs_read: array<Splat, READ>;
var<workgroup> epsilons_read: array<f32, READ>;

@compute @workgroup_size(INVOCATIONS)
fn visibility(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    view = views[tile.z];
    if !has_tile(tile.xy) { return; }
    let index = tile_of(tile.xy);
    let place = vec2<u32>(tile.x, view.first_tile_row + tile.y);
    let depths_at = depths_of(index);
    if PEEL {
        if lane == 0u { live = u32(is_peeled_on(index)); }
        if workgroupUniformLoad(&live) == 0u { return; }
    }
    if rests(tile.xy) { return; }
    if !is_wanted(place) {
        for (var i = lane; i < depth_quads(); i += INVOCATIONS) {
            thresholds[depths_at + i] = Floats(UNWANTED);
        }
        return;
    }
    let walk = walk_at(tile.xy);
    if view.resumes != 0u && !has_next(walk) { return; }
    let first = walk.end - walk.next;
    let entries = first + walk.later_end - walk.later;
    let first_wide = walk.end_wide - walk.next_wide;
    let wide_entries = first_wide + walk.later_end_wide - walk.later_wide;
    for (var before = 0u; before < guarded_quads(); before += INVOCATIONS) {
        let i = before + lane;
        let site = site_of(index, place, vec2<u32>(4u * (i % row_quads()), i / row_quads()));
        var depths = depths_before(site);
        for (var next = 0u; next < entries; next += READ) {
            let count = min(READ, entries - next);
            if lane < count {
                let entry = next + lane;
                let at = select(walk.later + (entry - first), walk.next + entry, entry < first);
                let disc = disc_of(splats[list[at]]);
                discs_read[lane] = disc;
                epsilons_read[lane] = segments[disc.flags >> 1u].epsilon;
            }
            workgroupBarrier();
            for (var k = 0u; k < count; k += 1u) {
                if touches(unpack(discs_read[k].bounds), site.column, site.row) {
                    depths = lowered(depths, discs_read[k], epsilons_read[k], site.column, site.row);
                }
            }
            workgroupBarrier();
        }
        for (var i = 0u; i < wide_entries; i += 1u) {
            let k = select(walk.later_wide + (i - first_wide), walk.next_wide + i, i < first_wide);
            if touches(unpack(disc_of(splats[wide[k]]).bounds), site.column, site.row) {
                let disc = disc_of(splats[wide[k]]);
                depths = lowered(depths, disc, segments[disc.flags >> 1u].epsilon, site.column, site.row);
            }
        }
        store_depths(site, depths);
    }
}

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
    let index = tile.y * view.tiles.x + tile.x;
    let place = vec2<u32>(tile.x, view.first_tile_row + tile.y);
    let depths_at = depths_of(index);
    if PEEL {
        if lane == 0u { live = u32(is_peeled_on(index)); }
        if workgroupUniformLoad(&live) == 0u { return; }
    }
    if !is_wanted(place) || is_at_hand(index) {
        for (var i = lane; i < depth_quads(); i += INVOCATIONS) {
            thresholds[depths_at + i] = Floats(UNWANTED);
        }
        return;
    }
    let first = starts[index];
    let end = starts[index + 1u];
    let wide_splats = starts[view.tiles.x * view.tiles.y + 1u];
    if view.resumes != 0u && first == end && wide_splats == 0u { return; }
    for (var before = 0u; before < guarded_quads(); before += INVOCATIONS) {
        let i = before + lane;
        let site = site_of(index, place, vec2<u32>(4u * (i % row_quads()), i / row_quads()));
        var depths = depths_before(site);
        for (var next = first; next < end; next += READ) {
            let count = min(READ, end - next);
            if lane < count {
                let disc = disc_of(splats[list[next + lane]]);
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
        for (var k = 0u; k < wide_splats; k += 1u) {
            if touches(unpack(disc_of(splats[wide[k]]).bounds), site.column, site.row) {
                let disc = disc_of(splats[wide[k]]);
                depths = lowered(depths, disc, segments[disc.flags >> 1u].epsilon, site.column, site.row);
            }
        }
        store_depths(site, depths);
    }
}

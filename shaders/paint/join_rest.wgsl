// Includes: common/types common/views paint/rest common/depths
// The end of pass `visibility` where groups share what is at rest: their own depths are no more than its depths.
// One workgroup per tile, one invocation per quad. Thresholds are in and out; tiles at rest are left alone.

@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(17) var<storage, read_write> thresholds: array<Floats>;

@compute @workgroup_size(64)
fn join_rest(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    view = views[tile.z];
    if !has_tile(tile.xy) || view.rest == view.number || shares(tile.xy) { return; }
    let own = tile_of(tile.xy);
    let rest = rest_tile_of(tile.xy);
    for (var i = lane; i < guarded_quads(); i += 64u) {
        let at = depths_of(own) + i;
        thresholds[at] = min(thresholds[at], thresholds[depths_of(rest) + i]);
    }
    if NEAREST {
        let at = nearest_of(own) + lane;
        thresholds[at] = min(thresholds[at], thresholds[nearest_of(rest) + lane]);
    }
}

// Includes: common/wanted paint/rest paint/meet
// Pass `visibility`: T(x, t) = min over discs covering x of (depth + epsilon), per pixel; with a filter for each tile
// and the apron around it. Where objects have several tolerances, the least depth of the tile's pixels, too.
// This program begins the depths of tiles, and takes the wide splats. Then visibility_entries.wgsl takes all others,
// and join_rest.wgsl what is at rest for several groups.
// Twin: src/backend/cpu/paint/visibility.rs.  Math: docs/math.md, eq. 5, and section 3.
//   in   splats, starts, wide   output of `project` and `bin`
//        segments               epsilon of a splat's object
//   in and out  thresholds   depths of each tile, as common/depths.wgsl has them; T is NONE where no disc covers the
//                            pixel, and all is UNWANTED in tiles that are not wanted; tiles at rest are left alone
// Of a layer that is peeled off, discs behind the floor alone count, and there is no second threshold.
// One workgroup per tile, one invocation per quad. The order of splats does not change a minimum, so batches may come
// one after the other.

@group(1) @binding(2) var<storage, read> segments: array<Segment>;
@group(1) @binding(4) var<storage, read> splats: array<Kernel>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(17) var<storage, read_write> thresholds: array<Floats>;

// Invocations of a tile: enough for the tile, and with a filter for an apron of two pixels at once.
override INVOCATIONS: u32 = select(64u, 128u, FILTERED);

@compute @workgroup_size(INVOCATIONS)
fn visibility(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    view = views[tile.z];
    if !has_tile(tile.xy) || shares(tile.xy) { return; }
    let index = tile_of(tile.xy);
    if PEEL && thresholds[depths_of(index) + state_place()].x == 0.0 { return; }
    let place = vec2<u32>(tile.x, view.first_tile_row + tile.y);
    if !is_wanted(place) {
        for (var i = lane; i < depth_quads(); i += INVOCATIONS) {
            thresholds[depths_of(index) + i] = Floats(UNWANTED);
        }
        return;
    }
    let wide_at = view.round_tiles + 1u + view.number;
    let first_wide = starts[wide_at];
    let end_wide = starts[wide_at + 1u];
    if view.resumes != 0u && first_wide == end_wide { return; }
    for (var i = lane; i < guarded_quads(); i += INVOCATIONS) {
        let at = vec2<u32>(4u * (i % row_quads()), i / row_quads());
        // Left of the tile and above it these are below 0, and wrap.
        let in_tile = at - vec2<u32>(4u * apron_quads(), apron());
        let column = place.x * TILE + in_tile.x;
        let row = place.y * TILE + in_tile.y;
        let threshold_at = depths_of(index) + i;
        let nearest_at = nearest_of(index) + in_tile.y * 4u + in_tile.x / 4u;
        let is_own = all(in_tile < vec2<u32>(TILE));
        var floor = Floats(0.0);
        if PEEL {
            let floor_at = depths_of(index) + floor_place() + i;
            // The layer before it reached to its T.
            if view.resumes == 0u { thresholds[floor_at] = thresholds[threshold_at]; }
            floor = thresholds[floor_at];
        }
        var threshold = Floats(NONE);
        var nearest = Floats(NONE);
        if view.resumes != 0u {
            threshold = thresholds[threshold_at];
            if NEAREST && is_own { nearest = thresholds[nearest_at]; }
        }
        for (var k = first_wide; k < end_wide; k += 1u) {
            if !touches(unpack(disc_of(splats[wide[k]]).bounds), column, row) { continue; }
            let met = meet(disc_of(splats[wide[k]]), column, row);
            var counts = met.covers;
            if PEEL { counts = counts & (met.depth > floor); }
            threshold = min(threshold, select(Floats(NONE), met.threshold, counts));
            nearest = min(nearest, select(Floats(NONE), met.depth, counts));
        }
        thresholds[threshold_at] = threshold;
        if NEAREST && is_own { thresholds[nearest_at] = nearest; }
    }
}

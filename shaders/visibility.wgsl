// Pass `visibility`: T(x, t) = min over splats covering x of (depth + epsilon), per pixel.
// Twin: src/backend/cpu/paint/visibility.rs.  Math: docs/math.md, eq. 5.
//   in   splats, list, starts, wide   output of `bin`
//        segments                     epsilon of a splat's object
//   out  thresholds                   tile after tile, four pixels of a row together; NONE where no splat covers the
//                                     pixel, UNWANTED in tiles that are not wanted
// One workgroup per tile, one invocation per quad of pixels. The order of splats does not change a minimum, so
// batches may come one after the other. A device waits long for each entry of a list; so the invocations of a tile read
// one entry each, and then walk over what all have read.

@group(1) @binding(2) var<storage, read> segments: array<Segment>;
@group(1) @binding(4) var<storage, read> splats: array<Splat>;
@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(17) var<storage, read_write> thresholds: array<vec4<f32>>;

// Smallest depth tolerance as a share of the depth: 4 units in the last place.
const LEAST_EPSILON: f32 = 4.0 * EPSILON;

// Splats that are read at once, and the epsilons of their objects.
const AT_ONCE: u32 = 64u;
var<workgroup> splats_read: array<Splat, AT_ONCE>;
var<workgroup> epsilons_read: array<f32, AT_ONCE>;

@compute @workgroup_size(4, 16)
fn visibility(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(local_invocation_id) quad: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = tile.y * view.tiles.x + tile.x;
    let at = index * TILE_QUADS + quad.y * 4u + quad.x;
    let column = tile.x * TILE + quad.x * 4u;
    let row = (view.first_tile_row + tile.y) * TILE + quad.y;
    if !is_wanted(vec2<u32>(tile.x, view.first_tile_row + tile.y)) {
        thresholds[at] = vec4<f32>(UNWANTED);
        return;
    }
    let first = starts[index];
    let end = starts[index + 1u];
    let wide_splats = starts[view.tiles.x * view.tiles.y + 1u];
    var threshold = vec4<f32>(NONE);
    if view.resumes != 0u {
        if first == end && wide_splats == 0u { return; }
        threshold = thresholds[at];
    }
    for (var next = first; next < end; next += AT_ONCE) {
        let count = min(AT_ONCE, end - next);
        if lane < count {
            let splat = splats[list[next + lane]];
            splats_read[lane] = splat;
            epsilons_read[lane] = segments[splat.flags >> 1u].epsilon;
        }
        workgroupBarrier();
        for (var i = 0u; i < count; i += 1u) {
            let bounds = unpack(splats_read[i].bounds);
            if touches(bounds, column, row) {
                threshold = lowered(threshold, splats_read[i], epsilons_read[i], bounds, column, row);
            }
        }
        workgroupBarrier();
    }
    for (var i = 0u; i < wide_splats; i += 1u) {
        let bounds = unpack(splats[wide[i]].bounds);
        if touches(bounds, column, row) {
            let splat = splats[wide[i]];
            threshold = lowered(threshold, splat, segments[splat.flags >> 1u].epsilon, bounds, column, row);
        }
    }
    thresholds[at] = threshold;
}

// The threshold, lowered by a splat of an object with tolerance `tolerance`.
fn lowered(
    threshold: vec4<f32>,
    splat: Splat,
    tolerance: f32,
    bounds: vec4<u32>,
    column: u32,
    row: u32,
) -> vec4<f32> {
    let at = hit(splat, column, row);
    let depth = 1.0 / at.inverse_depth;
    let epsilon = max(vec4<f32>(tolerance), LEAST_EPSILON * depth);
    let covers = at.inside & (at.inverse_depth <= vec4<f32>(view.most_inverse_depth)) & in_columns(bounds, column);
    let candidate = select(vec4<f32>(NONE), depth + epsilon, covers);
    return min(candidate, threshold);
}

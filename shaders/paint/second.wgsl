// Includes: common/wanted paint/rest paint/meet
// Pass `second`, of filtered kernels: the minimum of `visibility` over the discs behind the limits of their objects;
// and which pixels are solid, or near a rim.
// This program begins the second thresholds of tiles, and takes the wide splats. Then second_entries.wgsl takes all
// others.
// Twin: src/backend/cpu/paint/visibility.rs.  Math: docs/math.md, section 3.
//   in   as of paint/visibility.wgsl
//   in and out  thresholds   depths of each tile, as common/depths.wgsl has them
// One workgroup per tile, one invocation per quad.

@group(1) @binding(2) var<storage, read> segments: array<Segment>;
@group(1) @binding(4) var<storage, read> splats: array<Kernel>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(17) var<storage, read_write> thresholds: array<Floats>;

// Inverse depths of the tile and its apron: 0 where nothing covers, OUTSIDE beyond the image.
const EDGE: u32 = 32u;
const OUTSIDE: f32 = -1.0;
var<workgroup> inverse_depths: array<f32, EDGE * EDGE>;
// Is there more to peel off the tile?
var<workgroup> live: u32;

@compute @workgroup_size(4, 16)
fn second(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(local_invocation_id) quad: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    view = views[tile.z];
    if !has_tile(tile.xy) || rests(tile.xy) { return; }
    let index = tile_of(tile.xy);
    let depths_at = depths_of(index);
    let place = vec2<u32>(tile.x, view.first_tile_row + tile.y);
    if !is_wanted(place) { return; }
    if PEEL {
        if lane == 0u { live = u32(thresholds[depths_at + state_place()].x != 0.0); }
        if workgroupUniformLoad(&live) == 0u { return; }
    }
    let column = place.x * TILE + 4u * quad.x;
    let row = place.y * TILE + quad.y;
    let first = thresholds[depths_at + threshold_place(quad.xy)];
    var nearest = first;
    if NEAREST { nearest = thresholds[nearest_of(index) + lane]; }
    let second_at = depths_at + second_place() + lane;
    var second = vec4<f32>(NONE);
    if view.resumes == 0u {
        for (var i = lane; i < guarded_quads(); i += TILE_QUADS) {
            for (var k = 0u; k < 4u; k += 1u) { invert(place * TILE, i, k, thresholds[depths_at + i][k]); }
        }
        workgroupBarrier();
        // The depths that show here.
        var reach = tolerance_at(first, view.epsilon);
        if NEAREST { reach = first - nearest; }
        var rim = vec4<f32>(0.0);
        for (var i = 0u; i < 4u; i += 1u) {
            let at = vec2<u32>(4u * quad.x + i, quad.y) + vec2<u32>(4u * apron_quads(), apron());
            let uncovered = is_rim(at);
            rim[i] = select(0.0, 1.0, uncovered);
            second[i] = select(UNWANTED, NONE, uncovered || is_bent(at, reach[i]));
        }
        thresholds[depths_at + rim_place() + lane] = rim;
    } else {
        second = thresholds[second_at];
    }
    if !PEEL {
        let of_rest = view.round_tiles + 1u + view.rest;
        if view.rest != view.number {
            second = behind_wide(second, of_rest, first, nearest, column, row);
        }
        second = behind_wide(second, view.round_tiles + 1u + view.number, first, nearest, column, row);
    }
    thresholds[second_at] = second;
}

// The second thresholds, lowered by the wide splats of a view, whose place among `starts` is `wide_at`.
fn behind_wide(before: Floats, wide_at: u32, first: Floats, nearest: Floats, column: u32, row: u32) -> Floats {
    var second = before;
    for (var k = starts[wide_at]; k < starts[wide_at + 1u]; k += 1u) {
        if !touches(unpack(disc_of(splats[wide[k]]).bounds), column, row) { continue; }
        let met = meet(disc_of(splats[wide[k]]), column, row);
        let lower = met.covers & (met.depth > limit_of(met.tolerance, first, nearest)) & (met.threshold < second);
        second = select(second, met.threshold, lower);
    }
    return second;
}

// Stores the inverse depth of pixel `k` of quad `i` of the tile that begins at pixel `first`, and its apron.
fn invert(first: vec2<u32>, i: u32, k: u32, threshold: f32) {
    let column = 4u * (i % row_quads()) + k;
    let line = i / row_quads();
    let x = i32(first.x + column) - i32(4u * apron_quads());
    let y = i32(first.y + line) - i32(apron());
    let outside = x < view.pixels.x || x > view.pixels.y || y < view.pixels.z || y > view.pixels.w;
    let inverse = select(1.0 / threshold, 0.0, threshold >= NONE);
    inverse_depths[line * EDGE + column] = select(inverse, OUTSIDE, outside);
}

// A pixel is solid if discs cover it and all pixels within the apron, and inverse depths around it change as those of a
// plane do, up to four times the depths that show: opposite neighbours agree with their middle. Pixels outside the
// image do not count.

// True if there is a pixel within the apron that no disc covers.
fn is_rim(at: vec2<u32>) -> bool {
    let reach = apron();
    for (var y = at.y - reach; y <= at.y + reach; y += 1u) {
        for (var x = at.x - reach; x <= at.x + reach; x += 1u) {
            if inverse_depths[y * EDGE + x] == 0.0 { return true; }
        }
    }
    return false;
}

// True if inverse depths around a pixel change otherwise than those of a plane.
fn is_bent(at: vec2<u32>, reach: f32) -> bool {
    let middle_at = at.y * EDGE + at.x;
    let middle = inverse_depths[middle_at];
    let most = 4.0 * reach * (middle * middle);
    for (var distance = 1u; distance <= apron(); distance += 1u) {
        let down = distance * EDGE;
        if bends(middle_at, distance, most) || bends(middle_at, down, most) { return true; }
        if bends(middle_at, down + distance, most) || bends(middle_at, down - distance, most) { return true; }
    }
    return false;
}

// True if the inverse depths at both places `step` from the middle do not agree with it.
fn bends(middle_at: u32, step: u32, most: f32) -> bool {
    let before = inverse_depths[middle_at - step];
    let behind = inverse_depths[middle_at + step];
    let bend = abs(before + behind - 2.0 * inverse_depths[middle_at]);
    return before != OUTSIDE && behind != OUTSIDE && bend > most;
}

// Pass `visibility`: T(x, t) = min over discs covering x of (depth + epsilon), per pixel; with a filter for each tile
// and the apron around it. Where objects have several tolerances, the least depth of the tile's pixels, too.
// Pass `second`, of filtered kernels: the same minimum over the discs behind the limits of their objects; and which
// pixels are solid, or near a rim.
// Twin: src/backend/cpu/paint/visibility.rs.  Math: docs/math.md, eq. 5, and section 3.
//   in   splats, list, starts, wide   output of `project` and `bin`
//        segments                     epsilon of a splat's object
//        rest                         output of paint/rest.wgsl
//   in and out  thresholds   depths of each tile, as common/depths.wgsl has them; T is NONE where no disc covers the
//                            pixel, and all is UNWANTED in tiles that are not wanted, or whose film at rest is at hand
// Of a layer that is peeled off, discs behind the floor alone count, and there is no second threshold.
// One workgroup per tile, one invocation per quad of pixels. A tile knows its apron from its own list, so it reads no
// other tile. The order of splats does not change a minimum, so batches may come one after the other. A device waits
// long for each entry of a list; so the invocations of a tile read one entry each, and then walk over what all have
// read.

@group(1) @binding(2) var<storage, read> segments: array<Segment>;
@group(1) @binding(4) var<storage, read> splats: array<Kernel>;
@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(17) var<storage, read_write> thresholds: array<vec4<f32>>;
@group(1) @binding(38) var<storage, read> rest: array<u32>;

// Invocations of a tile: enough for the tile, and with a filter for an apron of two pixels at once.
override INVOCATIONS: u32 = select(64u, 128u, FILTERED);
// Discs that are read at once, and the epsilons of their objects.
const AT_ONCE: u32 = 64u;
var<workgroup> discs_read: array<Splat, AT_ONCE>;
var<workgroup> epsilons_read: array<f32, AT_ONCE>;

// T of a quad, the tolerances of the discs that it is of, and the depths of the nearest discs. Only discs behind the
// floor count.
struct Depths {
    threshold: vec4<f32>,
    epsilon: vec4<f32>,
    nearest: vec4<f32>,
    floor: vec4<f32>,
}

// Is there more to peel off the tile?
var<workgroup> live: u32;

@compute @workgroup_size(INVOCATIONS)
fn visibility(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = tile.y * view.tiles.x + tile.x;
    let place = vec2<u32>(tile.x, view.first_tile_row + tile.y);
    let depths_at = depths_of(index);
    let quads = guarded_quads();
    if PEEL {
        if lane == 0u { live = u32(thresholds[depths_at + state_place()].x); }
        if workgroupUniformLoad(&live) == 0u { return; }
    }
    if !is_wanted(place) || is_at_hand(index) {
        for (var i = lane; i < depth_quads(); i += INVOCATIONS) {
            thresholds[depths_at + i] = vec4<f32>(UNWANTED);
        }
        return;
    }
    let first = starts[index];
    let end = starts[index + 1u];
    let wide_splats = starts[view.tiles.x * view.tiles.y + 1u];
    if view.resumes != 0u && first == end && wide_splats == 0u { return; }
    for (var before = 0u; before < quads; before += INVOCATIONS) {
        let i = before + lane;
        let in_row = i % row_quads();
        // Left of the tile and above it these are below 0, and wrap.
        let quad = vec2<u32>(in_row - apron_quads(), i / row_quads() - apron());
        let column = place.x * TILE + 4u * quad.x;
        let row = place.y * TILE + quad.y;
        let is_own = i < quads && quad.x < 4u && quad.y < TILE;
        let epsilon_at = depths_at + epsilon_place() + quad.y * 4u + quad.x;
        let nearest_at = nearest_of(index) + quad.y * 4u + quad.x;
        var depths = Depths(vec4<f32>(NONE), vec4<f32>(0.0), vec4<f32>(NONE), vec4<f32>(0.0));
        if PEEL && i < quads {
            // The layer before it reached to its T.
            let floor_at = depths_at + floor_place() + i;
            if view.resumes == 0u { thresholds[floor_at] = thresholds[depths_at + i]; }
            depths.floor = thresholds[floor_at];
        }
        if view.resumes != 0u && i < quads {
            depths.threshold = thresholds[depths_at + i];
            if FILTERED && is_own { depths.epsilon = thresholds[epsilon_at]; }
            if NEAREST && is_own { depths.nearest = thresholds[nearest_at]; }
        }
        for (var next = first; next < end; next += AT_ONCE) {
            let count = min(AT_ONCE, end - next);
            if lane < count {
                let disc = disc_of(splats[list[next + lane]]);
                discs_read[lane] = disc;
                epsilons_read[lane] = segments[disc.flags >> 1u].epsilon;
            }
            workgroupBarrier();
            for (var k = 0u; k < count; k += 1u) {
                if touches(unpack(discs_read[k].bounds), column, row) {
                    depths = lowered(depths, discs_read[k], epsilons_read[k], column, row);
                }
            }
            workgroupBarrier();
        }
        for (var k = 0u; k < wide_splats; k += 1u) {
            if touches(unpack(disc_of(splats[wide[k]]).bounds), column, row) {
                let disc = disc_of(splats[wide[k]]);
                depths = lowered(depths, disc, segments[disc.flags >> 1u].epsilon, column, row);
            }
        }
        if i < quads { thresholds[depths_at + i] = depths.threshold; }
        if FILTERED && is_own { thresholds[epsilon_at] = depths.epsilon; }
        if NEAREST && is_own { thresholds[nearest_at] = depths.nearest; }
    }
}

// Is the film of a tile at rest all that the group adds? Where a group has several batches, what moves may come later.
fn is_at_hand(index: u32) -> bool {
    let shares = (view.flags & (SHARES_REST | ONE_BATCH)) == (SHARES_REST | ONE_BATCH);
    return shares && rest[index] == (KNOWN | RESTS);
}

// A disc on the rays through a quad.
struct Met {
    covers: vec4<bool>,
    depth: vec4<f32>,
    tolerance: vec4<f32>,
}

fn meet(disc: Splat, epsilon: f32, column: u32, row: u32) -> Met {
    let at = hit(disc, column, row);
    let depth = 1.0 / at.inverse_depth;
    return Met(covers(disc, at, column), depth, tolerance_at(depth, epsilon));
}

// The depths, lowered by a disc of an object with tolerance `epsilon`.
fn lowered(depths: Depths, disc: Splat, epsilon: f32, column: u32, row: u32) -> Depths {
    var met = meet(disc, epsilon, column, row);
    if PEEL { met.covers = met.covers & (met.depth > depths.floor); }
    let candidate = select(vec4<f32>(NONE), met.depth + met.tolerance, met.covers);
    let lower = candidate < depths.threshold;
    var nearest = depths.nearest;
    if NEAREST { nearest = min(nearest, select(vec4<f32>(NONE), met.depth, met.covers)); }
    return Depths(
        select(depths.threshold, candidate, lower),
        select(depths.epsilon, met.tolerance, lower),
        nearest,
        depths.floor,
    );
}

// Inverse depths of the tile and its apron: 0 where nothing covers, OUTSIDE beyond the image.
const EDGE: u32 = 32u;
const OUTSIDE: f32 = -1.0;
var<workgroup> inverse_depths: array<f32, EDGE * EDGE>;

@compute @workgroup_size(4, 16)
fn second(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(local_invocation_id) quad: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = tile.y * view.tiles.x + tile.x;
    let place = vec2<u32>(tile.x, view.first_tile_row + tile.y);
    if !is_wanted(place) || is_at_hand(index) { return; }
    let state_at = depths_of(index) + state_place();
    if PEEL {
        if lane == 0u { live = u32(thresholds[state_at].x); }
        if workgroupUniformLoad(&live) == 0u { return; }
    }
    let column = place.x * TILE + 4u * quad.x;
    let row = place.y * TILE + quad.y;
    let depths_at = depths_of(index);
    let second_at = depths_at + second_place() + lane;
    var second = vec4<f32>(NONE);
    if view.resumes == 0u {
        for (var i = lane; i < guarded_quads(); i += TILE_QUADS) {
            invert(place * TILE, i, thresholds[depths_at + i]);
        }
        workgroupBarrier();
        let epsilon = thresholds[depths_at + epsilon_place() + lane];
        var rim = vec4<f32>(0.0);
        for (var i = 0u; i < 4u; i += 1u) {
            let at = vec2<u32>(4u * (quad.x + apron_quads()) + i, quad.y + apron());
            let uncovered = is_rim(at);
            rim[i] = select(0.0, 1.0, uncovered);
            second[i] = select(UNWANTED, NONE, uncovered || is_bent(at, epsilon[i]));
        }
        thresholds[depths_at + rim_place() + lane] = rim;
    } else {
        second = thresholds[second_at];
    }
    if !PEEL && any(second > vec4<f32>(UNWANTED)) {
        let first = thresholds[depths_at + threshold_place(quad.xy)];
        var nearest = first;
        if NEAREST { nearest = thresholds[nearest_of(index) + lane]; }
        second = behind(index, second, first, nearest, column, row);
    }
    thresholds[second_at] = second;
}

// Stores the inverse depths of quad `i` of the tile that begins at pixel `first`, and its apron.
fn invert(first: vec2<u32>, i: u32, threshold: vec4<f32>) {
    let in_row = 4u * (i % row_quads());
    let line = i / row_quads();
    let y = i32(first.y + line) - i32(apron());
    for (var k = 0u; k < 4u; k += 1u) {
        let x = i32(first.x + in_row + k) - i32(4u * apron_quads());
        let outside = x < view.pixels.x || x > view.pixels.y || y < view.pixels.z || y > view.pixels.w;
        let inverse = select(1.0 / threshold[k], 0.0, threshold[k] >= NONE);
        inverse_depths[line * EDGE + in_row + k] = select(inverse, OUTSIDE, outside);
    }
}

// A pixel is solid if discs cover it and all pixels within the apron, and inverse depths around it change as those of a
// plane do, up to four tolerances: opposite neighbours agree with their middle. Pixels outside the image do not count.

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
fn is_bent(at: vec2<u32>, epsilon: f32) -> bool {
    let middle_at = at.y * EDGE + at.x;
    let middle = inverse_depths[middle_at];
    let most = 4.0 * epsilon * (middle * middle);
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

// The second thresholds, lowered by the discs behind the limits of their objects.
fn behind(
    index: u32, lowest: vec4<f32>, first: vec4<f32>, nearest: vec4<f32>, column: u32, row: u32,
) -> vec4<f32> {
    var second = lowest;
    var walk = walk_of(index);
    while has_next(walk) {
        let slot = next_slot(&walk);
        if !touches(unpack(disc_of(splats[slot]).bounds), column, row) { continue; }
        let disc = disc_of(splats[slot]);
        let met = meet(disc, segments[disc.flags >> 1u].epsilon, column, row);
        let candidate = met.depth + met.tolerance;
        let limit = limit_of(met.tolerance, first, nearest);
        second = select(second, candidate, met.covers & (met.depth > limit) & (candidate < second));
    }
    return second;
}

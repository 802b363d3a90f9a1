// Includes: common/types common/views common/fast common/wanted common/hit common/list paint/walk paint/both_walks
// Includes: common/depths paint/kernel
// Pass `visibility`: T(x, t) = min over discs covering x of (depth + epsilon), per pixel; with a filter for each tile
// and the apron around it. Where objects have several tolerances, the least depth of the tile's pixels, too.
// Pass `second` (paint/second.wgsl), of filtered kernels: the same minimum over the discs behind the limits of their
// objects; and which pixels are solid, or near a rim.
// Twin: src/backend/cpu/paint/visibility.rs.  Math: docs/math.md, eq. 5, and section 3.
//   in   splats, list, starts, wide   output of `project` and `bin`
//        segments                     epsilon of a splat's object
//   in and out  thresholds   depths of each tile, as common/depths.wgsl has them; T is NONE where no disc covers the
//                            pixel, and all is UNWANTED in tiles that are not wanted; tiles at rest are left alone
// Of a layer that is peeled off, discs behind the floor alone count, and there is no second threshold.
// One workgroup per tile. A tile knows its apron from its own list, so it reads no other tile. The order of splats does
// not change a minimum, so batches may come one after the other. How invocations share a tile and its list:
// visibility_quads.wgsl, visibility_pixels.wgsl.

@group(1) @binding(2) var<storage, read> segments: array<Segment>;
@group(1) @binding(4) var<storage, read> splats: array<Kernel>;
@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(17) var<storage, read_write> thresholds: array<Floats>;

// T of pixels, the tolerances of the discs that it is of, and the depths of the nearest discs. Only discs behind the
// floor count.
struct Depths {
    threshold: Floats,
    epsilon: Floats,
    nearest: Floats,
    floor: Floats,
}

// Is there more to peel off the tile?
var<workgroup> live: u32;

// What an invocation works on: pixels of a tile or of its apron.
struct Site {
    column: u32,
    row: u32,
    // Are they the tile's, or at least its apron's?
    is_own: bool,
    is_in: bool,
    // Places of their depths.
    threshold: u32,
    epsilon: u32,
    nearest: u32,
    floor: u32,
}

// The pixels of tile `place` from `at` on. Column and row count from the apron's first quad.
fn site_of(index: u32, place: vec2<u32>, at: vec2<u32>) -> Site {
    let quad = at.y * row_quads() + at.x / 4u;
    // Left of the tile and above it these are below 0, and wrap.
    let in_tile = at - vec2<u32>(4u * apron_quads(), apron());
    let own_quad = in_tile.y * 4u + in_tile.x / 4u;
    let depths_at = depths_of(index);
    var site: Site;
    site.column = place.x * TILE + in_tile.x;
    site.row = place.y * TILE + in_tile.y;
    site.is_in = quad < guarded_quads() && at.x < 4u * row_quads();
    site.is_own = site.is_in && all(in_tile < vec2<u32>(TILE));
    site.threshold = place_in(depths_at + quad, at.x);
    site.epsilon = place_in(depths_at + epsilon_place() + own_quad, at.x);
    site.nearest = place_in(nearest_of(index) + own_quad, at.x);
    site.floor = place_in(depths_at + floor_place() + quad, at.x);
    return site;
}

// The depths at a site before the batch.
fn depths_before(site: Site) -> Depths {
    var depths = Depths(Floats(NONE), Floats(0.0), Floats(NONE), Floats(0.0));
    if PEEL && site.is_in {
        // The layer before it reached to its T.
        if view.resumes == 0u { thresholds[site.floor] = thresholds[site.threshold]; }
        depths.floor = thresholds[site.floor];
    }
    if view.resumes != 0u && site.is_in {
        depths.threshold = thresholds[site.threshold];
        if FILTERED && site.is_own { depths.epsilon = thresholds[site.epsilon]; }
        if NEAREST && site.is_own { depths.nearest = thresholds[site.nearest]; }
    }
    return depths;
}

fn store_depths(site: Site, depths: Depths) {
    if site.is_in { thresholds[site.threshold] = depths.threshold; }
    if FILTERED && site.is_own { thresholds[site.epsilon] = depths.epsilon; }
    if NEAREST && site.is_own { thresholds[site.nearest] = depths.nearest; }
}

// Is there more to peel off tile `index`?
fn is_peeled_on(index: u32) -> bool {
    return first_of(thresholds[place_in(depths_of(index) + state_place(), 0u)]) != 0.0;
}

// A disc on the rays through the pixels.
struct Met {
    covers: Bools,
    depth: Floats,
    tolerance: Floats,
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
    let candidate = select(Floats(NONE), met.depth + met.tolerance, met.covers);
    let lower = candidate < depths.threshold;
    var nearest = depths.nearest;
    if NEAREST { nearest = min(nearest, select(Floats(NONE), met.depth, met.covers)); }
    return Depths(
        select(depths.threshold, candidate, lower),
        select(depths.epsilon, met.tolerance, lower),
        nearest,
        depths.floor,
    );
}

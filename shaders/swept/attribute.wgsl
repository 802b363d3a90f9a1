// Includes: common/types common/views common/fast common/swept common/swept_filter common/sweep common/ray common/list
// Includes: common/channels swept/sums
// Pass `attribute` of kernels in motion: the filtered kernel weighs; the disc alone says where the surface is, and how
// deep. Where the filter is zero, each filtered kernel is its disc.
// Twins: src/backend/cpu/swept/attribute.rs and hull.rs, ray.rs, slices.rs.  Math: docs/math.md, section 7.
//   in   splats, list, starts, wide, values   as in sums.wgsl
//        map       the thresholds of slices; behind those of all tiles, where objects have several tolerances, their
//                  least depths
//   out  sums             as in sums.wgsl
//        coverage_mask    for each tile, its pixels: times at which discs cover, and at which filtered kernels do (a
//                         bit for each 32nd of the interval); the sum of the weights of what covers, visible or hidden,
//                         or of what is visible where the sum of weights is the coverage; then the same sum of weight
//                         times peak, and of weights that are negative for kernels that show their backs
// One workgroup per tile, one invocation per pixel. Sums are in registers, in list order.

// If true, kernels sweep the ellipsoid instead of the tube.
override BY_ELLIPSOID: bool = false;

// The planes of the coverage mask.
const MASKS: u32 = 5u;

// The coverage mask of a pixel.
struct Mask {
    // When discs cover, and when filtered kernels do.
    surface: u32,
    filtered: u32,
    // Sums of weights: of all, then times peak and with the sign of the side.
    loose: f32,
    peak_and_side: vec2<f32>,
}

@compute @workgroup_size(16, 16)
fn swept_attribute(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) in_tile: vec3<u32>) {
    view = views[tile.z];
    if !has_tile(tile.xy) { return; }
    let index = tile_of(tile.xy);
    let pixel = vec2<u32>(tile.x, view.first_tile_row + tile.y) * TILE + in_tile.xy;
    let at = in_tile.y * TILE + in_tile.x;
    let sum_at = index * CHANNELS * TILE_PIXELS + at;
    let mask_at = MASKS * index * TILE_PIXELS + at;
    var walk = stretch_of(walk_of(index));
    if view.resumes != 0u && !has_next(walk) { return; }
    var sum: Sums;
    var mask: Mask;
    if view.resumes != 0u {
        sum = load_sums(sum_at);
        mask.surface = coverage_mask[mask_at];
        mask.filtered = coverage_mask[mask_at + TILE_PIXELS];
        mask.loose = bitcast<f32>(coverage_mask[mask_at + 2u * TILE_PIXELS]);
        mask.peak_and_side.x = bitcast<f32>(coverage_mask[mask_at + 3u * TILE_PIXELS]);
        mask.peak_and_side.y = bitcast<f32>(coverage_mask[mask_at + 4u * TILE_PIXELS]);
    }

    let place = SlicePlaces(slices_of(index, at), nearest_of(index, at));
    while has_next(walk) {
        add_filtered(&sum, &mask, next_slot(&walk), pixel, place);
    }

    store_sums(sum_at, sum);
    coverage_mask[mask_at] = mask.surface;
    coverage_mask[mask_at + TILE_PIXELS] = mask.filtered;
    coverage_mask[mask_at + 2u * TILE_PIXELS] = bitcast<u32>(mask.loose);
    coverage_mask[mask_at + 3u * TILE_PIXELS] = bitcast<u32>(mask.peak_and_side.x);
    coverage_mask[mask_at + 4u * TILE_PIXELS] = bitcast<u32>(mask.peak_and_side.y);
}

// Places in `map` of the first slice of a pixel: of its thresholds and of its least depths.
struct SlicePlaces {
    thresholds: u32,
    nearest: u32,
}

// Adds a kernel to the sums.
fn add_filtered(
    sum: ptr<function, Sums>,
    mask: ptr<function, Mask>,
    slot: u32,
    pixel: vec2<u32>,
    slices: SlicePlaces,
) {
    let bounds = unpack(splats[slot].bounds);
    if pixel.x < bounds.x || pixel.x > bounds.y || pixel.y < bounds.z || pixel.y > bounds.w { return; }
    let place = vec2<f32>(pixel);
    if !in_hull(slot, place) { return; }
    let splat = splats[slot];
    let x = place.x + 0.5 - splat.reference.x;
    let y = place.y + 0.5 - splat.reference.y;
    let m = splat.motion;
    let i = splat.inverse_depth;
    let k = i[0] * m[0] + i[1] * m[1] + i[2] * m[2];

    // The disc: when it covers.
    let w = form(i, x, y);
    let path = Path(
        vec2<f32>(form(splat.u, x, y), form(splat.v, x, y)),
        vec2<f32>(form(splat.u_rate, x, y), form(splat.v_rate, x, y)),
        w,
    );
    let disc_span = beyond_near(view.near * w - 1.0, k, reciprocal(k), covered(sweep_of(path, 0.0)));
    let disc_met = w > 0.0 && disc_span.x < disc_span.y;

    // The filtered kernel: what it weighs. At the camera plane it is the disc.
    let f = splat.filtered;
    var own_w = w;
    var own_k = k;
    var own = path;
    var coverage = f.weight;
    if f.coverage != 0.0 {
        coverage = f.coverage;
        own_w = form(array<f32, 3>(f.inverse_depth[0], f.inverse_depth[1], i[2]), x, y);
        own_k = f.k;
        let at_u = form(array<f32, 3>(f.u[0], f.u[1], 0.0), x, y);
        let at_v = form(array<f32, 3>(f.v[0], f.v[1], 0.0), x, y);
        own = Path(vec2<f32>(at_u, at_v), vec2<f32>(form(f.u_rate, x, y), form(f.v_rate, x, y)), own_w);
    }
    let lacks = view.near * own_w - 1.0;
    let tube = sweep_of(own, 0.0);
    let tube_span = beyond_near(lacks, own_k, reciprocal(own_k), covered(tube));
    let kernel_met = own_w > 0.0 && tube_span.x < tube_span.y;
    if !kernel_met { return; }

    let tau = 0.5 * (tube_span.x + tube_span.y);
    let time = 1.0 + view.slope * tau;
    let in_tube = tube_weight(mean_over(tube, tube_span), tube_span) * time;
    var weight = f.weight * in_tube;
    var most = tube_weight(1.0, tube_span) * time;
    var met: Met;
    met.span = tube_span;
    if BY_ELLIPSOID {
        let body = sweep_of(own, 1.0);
        met.span = beyond_near(lacks, own_k, reciprocal(own_k), covered(body));
        let body_time = 1.0 + view.slope * (0.5 * (met.span.x + met.span.y));
        weight = f.weight * ellipsoid_weight(mean_over(body, met.span), met.span) * body_time;
        most = ellipsoid_weight(1.0, met.span) * body_time;
    }

    // The depth is that of the disc's plane, also outside the disc; the centre's where the ray misses the plane.
    let centre_depth = 1.0 / i[2];
    let over = 1.0 / w;
    let on_plane = w > 0.0 && view.near * w <= 1.0;
    met.plane = select(vec2<f32>(centre_depth, centre_depth * (m[2] * i[2])), vec2<f32>(over, k * over), on_plane);
    met.depth = met.plane.x + tau * met.plane.y;
    var loose = coverage * in_tube;
    if SUM { loose = 0.0; }
    if met.span.x < met.span.y {
        let part = shown_in(met, slot, slices);
        let share = min(weight, most) * select(HIDDEN, part, part > 0.0);
        if SUM && part > 0.0 { loose = weight * part; }
        add_values(sum, slot, share, met.depth);
    } else {
        // A tube that is met beside the ellipsoid covers, and gives a colour where there is no other.
        add_values(sum, slot, coverage * in_tube * HIDDEN, met.depth);
    }
    if !SUM {
        if disc_met { (*mask).surface |= moments_in(disc_span); }
        (*mask).filtered |= moments_in(tube_span);
    }
    (*mask).loose += loose;
    let side = select(1.0, -1.0, (splat.flags & FLAG_BACK) != 0u);
    (*mask).peak_and_side += loose * vec2<f32>(f.peak, side);
}

// When a filtered kernel covers, and the depth of its disc's plane.
struct Met {
    // First and last time.
    span: vec2<f32>,
    // Mean depth on the ray.
    depth: f32,
    // Depth at tau = 0, and its change to tau = 1.
    plane: vec2<f32>,
}

// The share of that time for which the kernel is visible: it is tested in each slice that it touches.
fn shown_in(met: Met, slot: u32, slices: SlicePlaces) -> f32 {
    var time = 0.0;
    let ends = slices_in(met.span);
    for (var slice = ends.x; slice <= ends.y; slice += 1u) {
        let times = slice_times(slice);
        let first = max(met.span.x, times.x);
        let last = min(met.span.y, times.z);
        let depth = met.plane.x + times.y * met.plane.y;
        var limit = map[slices.thresholds + slice * TILE_PIXELS];
        if NEAREST {
            let tolerance = tolerance_at(depth, values[slot * VALUES + TOLERANCE]);
            limit = min(limit, map[slices.nearest + slice * TILE_PIXELS] + tolerance);
        }
        if first < last && depth <= limit { time += last - first; }
    }
    return time / (met.span.y - met.span.x);
}

// Includes: common/types common/views common/fast common/swept common/swept_splat common/sweep common/ray common/list
// Includes: common/channels swept/sums
// Pass `attribute` of published kernels in motion: sums the attributes of the kernels that pass the depth test.
// Twins: src/backend/cpu/published/attribute.rs and ray.rs, swept/hull.rs.  Math: docs/math.md, eq. 11 to 19.
//   in   splats, list, starts, wide, values   as in swept/sums.wgsl
//        map       the map of mid-interval
//   out  sums      as in swept/sums.wgsl
//        coverage_mask   for each tile, its pixels: times at which kernels cover, and at which low-pass discs do (a bit
//                  for each 32nd of the interval), and the weights of low-pass discs beyond those of their kernels, or
//                  all weights where the sum of weights is the coverage
// One workgroup per tile, one invocation per pixel. Sums are in registers, in list order.

// If true, the line integral through the ellipsoid weighs; else its chord.
override LINE: bool = false;
// Number of places of a kernel on one ray whose sources are looked up.
override SOURCE_SAMPLES: u32 = 1u;

// A pixel number that is as good as infinite.
const FAR: f32 = 1e6;

// The coverage mask of a pixel.
struct Mask {
    // When kernels cover, and when low-pass discs do.
    surface: u32,
    low_pass: u32,
    // A sum of weights.
    loose: f32,
}

@compute @workgroup_size(16, 16)
fn published_attribute(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) in_tile: vec3<u32>) {
    view = views[tile.z];
    if !has_tile(tile.xy) { return; }
    let index = tile_of(tile.xy);
    let pixel = vec2<u32>(tile.x, view.first_tile_row + tile.y) * TILE + in_tile.xy;
    let at = in_tile.y * TILE + in_tile.x;
    let sum_at = index * CHANNELS * TILE_PIXELS + at;
    let mask_at = 3u * index * TILE_PIXELS + at;
    var walk = stretch_of(walk_of(index));
    if view.resumes != 0u && !has_next(walk) { return; }
    var sum: Sums;
    var mask: Mask;
    if view.resumes != 0u {
        sum = load_sums(sum_at);
        mask.surface = coverage_mask[mask_at];
        mask.low_pass = coverage_mask[mask_at + TILE_PIXELS];
        mask.loose = bitcast<f32>(coverage_mask[mask_at + 2u * TILE_PIXELS]);
    }

    while has_next(walk) {
        add_splat(&sum, &mask, next_slot(&walk), pixel);
    }

    store_sums(sum_at, sum);
    coverage_mask[mask_at] = mask.surface;
    coverage_mask[mask_at + TILE_PIXELS] = mask.low_pass;
    coverage_mask[mask_at + 2u * TILE_PIXELS] = bitcast<u32>(mask.loose);
}

// Adds a kernel to the sums.
fn add_splat(sum: ptr<function, Sums>, mask: ptr<function, Mask>, slot: u32, pixel: vec2<u32>) {
    let bounds = unpack(splats[slot].bounds);
    if pixel.x < bounds.x || pixel.x > bounds.y || pixel.y < bounds.z || pixel.y > bounds.w { return; }
    let at = vec2<f32>(pixel);
    if !in_hull(slot, at) { return; }
    let splat = splats[slot];
    let ray = ray_of(splat);
    for (var part = 0u; part < SOURCE_SAMPLES; part += 1u) {
        let met = meet(splat, ray, part, at);
        if !met.covers { continue; }
        // A hidden kernel loses its weight but covers all the same, as something before it does.
        let shown = met.source_depth <= limit_at(met.source);
        if !SUM { (*mask).surface |= met.surface; }
        if shown {
            (*mask).loose += met.loose;
            if !SUM { (*mask).low_pass |= met.low_pass; }
        }
        add_values(sum, slot, met.weight * select(HIDDEN, 1.0, shown), met.depth);
    }
}

// Threshold at a pixel. Outside the map everything is visible.
fn limit_at(pixel: vec2<i32>) -> f32 {
    let place = pixel - view.map_corner;
    let tile = place >> vec2<u32>(4u);
    let outside = (tile < vec2<i32>(0)) | (tile >= vec2<i32>(view.map_tiles));
    if any(outside) { return NONE; }
    let in_tile = vec2<u32>(place) % TILE;
    return map[(u32(tile.y) * view.map_tiles.x + u32(tile.x)) * TILE_PIXELS + in_tile.y * TILE + in_tile.x];
}

// The quantities that are the same for all rays of a splat.
struct Ray {
    // The depth at tau is (1 + k tau) / w.
    k: f32,
    inverse_k: f32,
    // The low-pass disc: its radius, its centre's motion divided by the centre's depth, and the times at which it is
    // beyond `near`.
    disc: f32,
    drift: vec3<f32>,
    disc_span: vec2<f32>,
}

fn ray_of(splat: SweptSplat) -> Ray {
    let i = splat.inverse_depth;
    let m = splat.motion;
    var ray: Ray;
    ray.k = i[0] * m[0] + i[1] * m[1] + i[2] * m[2];
    ray.inverse_k = reciprocal(ray.k);
    ray.drift = vec3<f32>(m[0], m[1], m[2]) * i[2];
    ray.disc = select(0.0, view.low_pass, (splat.flags & FLAG_LOW_PASS) != 0u);
    ray.disc_span = beyond_near(view.near * i[2] - 1.0, ray.drift.z, reciprocal(ray.drift.z), vec2<f32>(-1.0, 1.0));
    return ray;
}

// A kernel on one ray.
struct Met {
    covers: bool,
    // For the colour.
    weight: f32,
    // For the coverage: the weight that the low-pass disc adds, or the whole weight if the coverage is the sum of
    // weights.
    loose: f32,
    // Mean depth on the ray.
    depth: f32,
    // The pixel nearest the source point, and the depth there that is compared with the map.
    source: vec2<i32>,
    source_depth: f32,
    // Times at which the kernel covers, and at which its low-pass disc does.
    surface: u32,
    low_pass: u32,
}

fn meet(splat: SweptSplat, ray: Ray, part: u32, pixel: vec2<f32>) -> Met {
    var met: Met;
    let x = pixel.x + 0.5 - splat.reference.x;
    let y = pixel.y + 0.5 - splat.reference.y;
    let w = form(splat.inverse_depth, x, y);
    let path = Path(
        vec2<f32>(form(splat.u, x, y), form(splat.v, x, y)),
        vec2<f32>(form(splat.u_rate, x, y), form(splat.v_rate, x, y)),
        w,
    );
    let lacks = view.near * w - 1.0;
    let tube = sweep_of(path, 0.0);
    var span = beyond_near(lacks, ray.k, ray.inverse_k, covered(tube));
    let body = sweep_of(path, 1.0);
    var weighed = beyond_near(lacks, ray.k, ray.inverse_k, covered(body));
    let body_met = w > 0.0 && weighed.x < weighed.y;

    // The low-pass disc has a fixed size in space and faces the viewer, so it is a swept kernel too.
    let d = ray.drift;
    let disc = Path(vec2<f32>(x, y), vec2<f32>(x * d.z - d.x, y * d.z - d.y), ray.disc);
    let disc_sweep = sweep_of(disc, 1.0);
    var disc_span = covered(disc_sweep);
    disc_span = vec2<f32>(max(disc_span.x, ray.disc_span.x), min(disc_span.y, ray.disc_span.y));
    let disc_met = ray.disc > 0.0 && disc_span.x < disc_span.y;
    met.covers = body_met || disc_met;
    if !met.covers { return met; }

    weighed = cut(weighed, part);
    span = cut(span, part);
    disc_span = cut(disc_span, part);
    let tau = 0.5 * (weighed.x + weighed.y);
    let disc_tau = 0.5 * (disc_span.x + disc_span.y);
    let time = 1.0 + view.slope * tau;
    let disc_time = 1.0 + view.slope * disc_tau;
    var slant = 1.0;
    if LINE { slant = slant_of(splat, x, y, w); }
    let own = weigh(body, weighed, slant);
    let discs = weigh(disc_sweep, disc_span, 1.0);
    let weight = select(0.0, own.x * time, body_met);
    let disc_weight = select(0.0, discs.x * disc_time, disc_met);
    let larger = disc_weight > weight;
    met.weight = select(weight, disc_weight, larger);
    if SUM {
        met.loose = select(weight * own.y, disc_weight * discs.y, larger);
    } else {
        met.loose = select(0.0, disc_weight - weight, larger);
    }

    // The source point lies on the splat at mid-interval. Where the ray does not meet the kernel itself, it is that of
    // the low-pass disc.
    let depth = (1.0 + ray.k * tau) / w;
    let m = splat.motion;
    let source_depth = depth - m[2] * tau;
    let over = 1.0 / source_depth;
    let near_x = select(x + disc_tau * disc.rate.x, (depth * x - m[0] * tau) * over, body_met);
    let near_y = select(y + disc_tau * disc.rate.y, (depth * y - m[1] * tau) * over, body_met);
    let column = nearest_pixel(near_x + splat.reference.x - 0.5);
    let row = nearest_pixel(near_y + splat.reference.y - 0.5);
    let there = form(splat.inverse_depth, column + 0.5 - splat.reference.x, row + 0.5 - splat.reference.y);
    let plane_depth = select(source_depth, 1.0 / there, there > 0.0);
    let centre_depth = 1.0 / splat.inverse_depth[2];
    met.source = vec2<i32>(i32(column), i32(row));
    met.source_depth = select(centre_depth, plane_depth, body_met);
    met.depth = select(centre_depth * (1.0 + d.z * disc_tau), depth, body_met);
    met.surface = select(0u, moments_in(span), body_met);
    met.low_pass = select(0u, moments_in(disc_span), disc_met);
    return met;
}

// Weight over the interval, and the factor that makes it an intensity.
fn weigh(s: Sweep, span: vec2<f32>, slant: f32) -> vec2<f32> {
    if LINE { return vec2<f32>(line_weight(mean_over(s, span), span, slant), 1.0); }
    return vec2<f32>(chord(s), chord_intensity(s));
}

// 1 / |cos| of the angle between the kernel's normal and the ray at offset `x`, `y` from the splat's reference, where
// the inverse depth is `w`.
fn slant_of(splat: SweptSplat, x: f32, y: f32, w: f32) -> f32 {
    let i = splat.inverse_depth;
    let offset = splat.reference - (view.axis - view.offset);
    let normal_x = i[0] * view.focal;
    let normal_y = i[1] * view.focal;
    let normal_z = i[2] - i[0] * offset.x - i[1] * offset.y;
    let over = 1.0 / view.focal;
    let ray_x = (x + offset.x) * over;
    let ray_y = (y + offset.y) * over;
    let normal = sqrt(normal_x * normal_x + normal_y * normal_y + normal_z * normal_z);
    return normal * sqrt(ray_x * ray_x + ray_y * ray_y + 1.0) / w;
}

// Part `part` of `span`, which is cut into SOURCE_SAMPLES equal parts.
fn cut(span: vec2<f32>, part: u32) -> vec2<f32> {
    if SOURCE_SAMPLES == 1u { return span; }
    let step = (span.y - span.x) / f32(SOURCE_SAMPLES);
    return vec2<f32>(span.x + f32(part) * step, span.x + f32(part + 1u) * step);
}

fn nearest_pixel(index: f32) -> f32 {
    return round(clamp(index, -FAR, FAR));
}

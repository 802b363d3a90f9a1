// Includes: common/types common/views common/fast common/swept common/swept_filter common/sweep common/ray
// Which slices of the interval a kernel in motion covers at a pixel, and at which depths.
// Twin: src/backend/cpu/swept/slices.rs.  Math: docs/math.md, section 7.

@group(1) @binding(2) var<storage, read> segments: array<Segment>;
@group(1) @binding(4) var<storage, read> splats: array<SweptSplat>;

// When a kernel covers a pixel: never, where `span` is empty. Its depth, and how that changes. Its slices, of which
// only those count whose middle is covered.
struct Covered {
    span: vec2<f32>,
    plane: vec2<f32>,
    first: u32,
    last: u32,
    epsilon: f32,
}

fn covered_at(slot: u32, pixel: vec2<u32>) -> Covered {
    var out = Covered(vec2<f32>(1.0, 0.0), vec2<f32>(0.0), 1u, 0u, 0.0);
    let bounds = unpack(splats[slot].bounds);
    if pixel.x < bounds.x || pixel.x > bounds.y || pixel.y < bounds.z || pixel.y > bounds.w { return out; }
    let place = vec2<f32>(pixel);
    if !in_hull(slot, place) { return out; }
    let splat = splats[slot];
    let x = place.x + 0.5 - splat.reference.x;
    let y = place.y + 0.5 - splat.reference.y;
    let i = splat.inverse_depth;
    let w = form(i, x, y);
    let path = Path(
        vec2<f32>(form(splat.u, x, y), form(splat.v, x, y)),
        vec2<f32>(form(splat.u_rate, x, y), form(splat.v_rate, x, y)),
        w,
    );
    let k = i[0] * splat.motion[0] + i[1] * splat.motion[1] + i[2] * splat.motion[2];
    let span = beyond_near(view.near * w - 1.0, k, reciprocal(k), covered(sweep_of(path, 0.0)));
    if !(w > 0.0 && span.x < span.y) { return out; }
    let slices = slices_in(span);
    return Covered(
        span,
        vec2<f32>(1.0 / w, k / w),
        slices.x,
        slices.y,
        segments[splat.flags >> SEGMENT_SHIFT].epsilon,
    );
}

// Its depth in the middle of a slice; NONE where it does not cover that.
fn depth_in(kernel: Covered, slice: u32) -> f32 {
    let middle = slice_times(slice).y;
    if !(kernel.span.x < middle && middle < kernel.span.y) { return NONE; }
    return kernel.plane.x + middle * kernel.plane.y;
}

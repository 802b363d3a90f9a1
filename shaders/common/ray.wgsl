// What the passes of kernels in motion share: where a kernel may be on the screen, its linear forms on a ray, and the
// slices of the interval.
// Twins: src/backend/cpu/swept/hull.rs, ray.rs and slices.rs.  Math: docs/math.md, section 7.

// Number of slices of the interval; 1 where kernels have none.
override SLICES: u32 = 1u;
// Do objects have several tolerances? Then the depth of the nearest kernel is kept for each slice, too.
override NEAREST: bool = false;

// Smallest depth tolerance as a share of the depth: 4 units in the last place.
const LEAST_EPSILON: f32 = 4.0 * EPSILON;

// The tolerance, at `depth`, of a kernel of an object with tolerance `epsilon`.
fn tolerance_at(depth: f32, epsilon: f32) -> f32 {
    return max(epsilon, LEAST_EPSILON * depth);
}

// Margin of hulls against rounding, pixels.
const HULL_SLACK: f32 = 1e-2;

// Tells whether the pixel is in a box that meets its row. The boxes around a kernel at times t between its ends are
// box(t) = (1 - t) box(0) + t box(1).
fn in_hull(slot: u32, pixel: vec2<f32>) -> bool {
    if (splats[slot].flags & FLAG_CROSSING) != 0u { return true; }
    let begin = splats[slot].ends[0];
    let end = splats[slot].ends[1];
    // Times at which the box's first row is at most the pixel's row, and its last row at least the pixel's row.
    let above = cut_times(vec2<f32>(0.0, 1.0), pixel.y + HULL_SLACK - begin[2], end[2] - begin[2]);
    let times = cut_times(above, begin[3] - (pixel.y - HULL_SLACK), begin[3] - end[3]);
    if !(times.x <= times.y) { return false; }
    let low = begin[0] + times * (end[0] - begin[0]);
    let high = begin[1] + times * (end[1] - begin[1]);
    return pixel.x >= min(low.x, low.y) - HULL_SLACK && pixel.x <= max(high.x, high.y) + HULL_SLACK;
}

// The part of `times` at which room - t change >= 0. It is empty if the first time is larger than the last.
fn cut_times(times: vec2<f32>, room: f32, change: f32) -> vec2<f32> {
    if change == 0.0 { return select(vec2<f32>(1.0, 0.0), times, room >= 0.0); }
    let at = room / change;
    if change > 0.0 { return vec2<f32>(times.x, min(times.y, at)); }
    return vec2<f32>(max(times.x, at), times.y);
}

fn form(c: array<f32, 3>, x: f32, y: f32) -> f32 {
    return c[0] * x + (c[1] * y + c[2]);
}

// `span` without the times at which the depth (1 + k tau) / w is below `near`; `lacks` is near w - 1.
fn beyond_near(lacks: f32, k: f32, inverse_k: f32, span: vec2<f32>) -> vec2<f32> {
    let at = lacks * inverse_k;
    let limits = select(vec2<f32>(at, 1.0), vec2<f32>(-1.0, at), k < 0.0);
    return vec2<f32>(max(span.x, limits.x), min(span.y, limits.y));
}

// 1 / v, or a large finite number where v is too small.
fn reciprocal(v: f32) -> f32 {
    return select(1e30, 1.0 / v, abs(v) > 1e-30);
}

// First and last slice that `span` touches.
fn slices_in(span: vec2<f32>) -> vec2<u32> {
    let at = (span + 1.0) * (0.5 * f32(SLICES));
    return vec2<u32>(u32(max(at.x, 0.0)), min(u32(max(at.y, 0.0)), SLICES - 1u));
}

// Begin, middle and end of a slice.
fn slice_times(slice: u32) -> vec3<f32> {
    let step = 2.0 / f32(SLICES);
    let begin = f32(slice) * step - 1.0;
    return vec3<f32>(begin, begin + 0.5 * step, begin + step);
}

// Place in `map` of the first slice of pixel `at` of tile `index`. Slices are TILE_PIXELS apart.
fn slices_of(index: u32, at: u32) -> u32 {
    return index * SLICES * TILE_PIXELS + at;
}

// The same of the nearest depths, which lie behind the thresholds of all tiles.
fn nearest_of(index: u32, at: u32) -> u32 {
    return slices_of(view.round_tiles + index, at);
}

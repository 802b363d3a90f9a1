// Pass `second`, of filtered kernels: the least depth and tolerance over the discs behind the limits of their objects;
// and which pixels are solid, or near a rim. It comes after paint/visibility.wgsl. One workgroup per tile. How
// invocations share a tile and its list: second_quads.wgsl, second_pixels.wgsl.

// Inverse depths of the tile and its apron: 0 where nothing covers, OUTSIDE beyond the image.
const EDGE: u32 = 32u;
const OUTSIDE: f32 = -1.0;
var<workgroup> inverse_depths: array<f32, EDGE * EDGE>;

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

// Rim and second threshold, before any disc, of the pixel at `in_tile`, whose T is of a disc with this tolerance.
fn begun(in_tile: vec2<u32>, epsilon: f32) -> vec2<f32> {
    let at = in_tile + vec2<u32>(4u * apron_quads(), apron());
    let uncovered = is_rim(at);
    return vec2<f32>(select(0.0, 1.0, uncovered), select(UNWANTED, NONE, uncovered || is_bent(at, epsilon)));
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

// The second thresholds, lowered by a disc if it lies behind the limit of its object.
fn lowered_behind(
    second: Floats, disc: Splat, epsilon: f32, first: Floats, nearest: Floats, column: u32, row: u32,
) -> Floats {
    let met = meet(disc, epsilon, column, row);
    let candidate = met.depth + met.tolerance;
    let limit = limit_of(met.tolerance, first, nearest);
    return select(second, candidate, met.covers & (met.depth > limit) & (candidate < second));
}

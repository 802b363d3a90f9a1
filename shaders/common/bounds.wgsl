// Screen bounds. Twin: src/backend/cpu/bounds.rs.

// Margin of screen bounds: pixels plus a share of the size. Rounding must not make the bounds too small.
const SLACK: f32 = 1e-3;
const SLACK_SHARE: f32 = 1e-5;

// Ends of the ellipse along one axis relative to the projected centre, widened to the low-pass disc (docs/math.md, eq.
// 3).
fn extent(d00: f32, d02: f32, d22: f32, inverse22: f32, low_pass: f32) -> vec2<f32> {
    let half = sqrt(max(d02 * d02 - d00 * d22, 0.0)) * -inverse22;
    let middle = d02 * inverse22;
    return vec2<f32>(min(middle - half, -low_pass), max(middle + half, low_pass));
}

// The range about `reference` in pixel indices, with a margin.
fn index_range(reference: f32, range: vec2<f32>) -> vec2<f32> {
    let slack = SLACK + SLACK_SHARE * (range.y - range.x) + abs(reference) * EPSILON;
    return vec2<f32>(reference + range.x - slack - 0.5, reference + range.y + slack - 0.5);
}

// First and last pixel in an index range, clipped to `wanted`.
fn pixels_in(range: vec2<f32>, wanted: vec2<i32>) -> vec2<f32> {
    return vec2<f32>(max(ceil(range.x), f32(wanted.x)), min(floor(range.y), f32(wanted.y)));
}

// Bounds of pixels, counted from the view's corner.
fn bounds_of(across: vec2<f32>, down: vec2<f32>) -> vec4<u32> {
    let from_corner = vec4<f32>(across - f32(view.corner.x), down - f32(view.corner.y));
    return vec4<u32>(vec4<i32>(clamp(from_corner, vec4<f32>(0.0), vec4<f32>(65535.0))));
}

fn pack(bounds: vec4<u32>) -> vec2<u32> {
    return vec2<u32>(bounds.x | (bounds.y << 16u), bounds.z | (bounds.w << 16u));
}

// Number of wanted tiles that the bounds touch. It is WIDE if there are any, and the bounds touch more than WIDEST
// tiles.
fn tiles_in(bounds: vec4<u32>) -> u32 {
    let tiles = bounds / TILE;
    let count = (tiles.y + 1u - tiles.x) * (tiles.w + 1u - tiles.z);
    let is_wide = count > WIDEST;
    if view.blocks.x == 0u {
        return select(count, WIDE, is_wide);
    }
    var found = 0u;
    let ends = select(tiles, (bounds + view.first.xxyy) / BLOCK, is_wide);
    for (var y = ends.z; y <= ends.w; y += 1u) {
        for (var x = ends.x; x <= ends.y; x += 1u) {
            if is_wide && is_wanted_block(vec2<u32>(x, y)) { return WIDE; }
            found += select(0u, 1u, !is_wide && is_wanted(vec2<u32>(x, y)));
        }
    }
    return found;
}

// The bits decide: comparisons with a NaN mean nothing in WGSL.
fn finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

fn all_finite(v: vec3<f32>) -> bool {
    return finite(v.x) && finite(v.y) && finite(v.z);
}

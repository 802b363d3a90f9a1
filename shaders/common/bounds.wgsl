// Includes: common/numbers
// Screen bounds. Twin: src/backend/cpu/bounds.rs.

// Margin of screen bounds: pixels plus a share of the size. Rounding must not make the bounds too small.
const SLACK: f32 = 1e-3;
const SLACK_SHARE: f32 = 1e-5;

// Ends of the ellipse along one axis relative to the projected centre, widened to a disc of radius `disc` around it
// (docs/math.md, eq. 3). 1 / d22 comes first, as products of lengths may be too large for a number.
fn extent(d00: f32, d02: f32, inverse22: f32, disc: f32) -> vec2<f32> {
    let middle = d02 * inverse22;
    let half = sqrt(max(middle * middle - d00 * inverse22, 0.0));
    return vec2<f32>(min(middle - half, -disc), max(middle + half, disc));
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

// Half the side of the regular octagon about a circle of radius 1, and its corners in order.
const HALF_SIDE: f32 = 0.41421357;
const OCTAGON: array<vec2<f32>, 8> = array<vec2<f32>, 8>(
    vec2<f32>(1.0, -HALF_SIDE), vec2<f32>(1.0, HALF_SIDE), vec2<f32>(HALF_SIDE, 1.0), vec2<f32>(-HALF_SIDE, 1.0),
    vec2<f32>(-1.0, HALF_SIDE), vec2<f32>(-1.0, -HALF_SIDE), vec2<f32>(-HALF_SIDE, -1.0), vec2<f32>(HALF_SIDE, -1.0),
);

// A disc in homogeneous pixel coordinates (x, y, depth), counted from the camera's axis.
struct Disc {
    centre: vec3<f32>,
    u: vec3<f32>,
    v: vec3<f32>,
}

// Does the disc lie on the outer side of the plane through the eye and through all places `slope` along an image axis?
// `sides` has 1 on that axis where higher places are outside, -1 where lower ones are, 0 on the other axis.
fn is_beyond(disc: Disc, slope: f32, sides: vec2<f32>) -> bool {
    let axis = abs(sides);
    let side = sides.x + sides.y;
    let u = side * (slope * disc.u.z - dot(axis, disc.u.xy));
    let v = side * (slope * disc.v.z - dot(axis, disc.v.xy));
    let centre = side * (slope * disc.centre.z - dot(axis, disc.centre.xy));
    let size = size_of(disc);
    let slack = ROUNDING * (dot(axis, size.xy) + abs(slope) * size.z);
    return centre + sqrt(u * u + v * v) < -slack;
}

// Least and greatest place along image axes x and y of the part at depths of at least `near`: (least x, greatest x,
// least y, greatest y). A least place is above the greatest where nothing is left.
fn beyond_near(disc: Disc, near: f32) -> vec4<f32> {
    var corners = OCTAGON;
    var out = vec4<f32>(NONE, -NONE, NONE, -NONE);
    for (var k = 0u; k < 8u; k += 1u) {
        let a = corners[k];
        let b = corners[(k + 1u) % 8u];
        let p = disc.centre + disc.u * a.x + disc.v * a.y;
        let q = disc.centre + disc.u * b.x + disc.v * b.y;
        if p.z >= near { out = widened(out, p.xy / p.z); }
        if (p.z >= near) != (q.z >= near) {
            let t = (near - p.z) / (q.z - p.z);
            out = widened(out, (p.xy + (q.xy - p.xy) * t) / near);
        }
    }
    if out.x > out.y { return out; }
    let size = size_of(disc);
    return out + vec4<f32>(-1.0, 1.0, -1.0, 1.0) * (size.xxyy + abs(out) * size.z) * (ROUNDING / near);
}

// Sums of the sizes of the coordinates.
fn size_of(disc: Disc) -> vec3<f32> {
    return abs(disc.centre) + abs(disc.u) + abs(disc.v);
}

fn widened(box: vec4<f32>, at: vec2<f32>) -> vec4<f32> {
    return vec4<f32>(min(box.x, at.x), max(box.y, at.x), min(box.z, at.y), max(box.w, at.y));
}

// Does the disc lie outside the plane through the eye along the first or the last of the wanted pixels of an image
// axis, of which `axis` has 1? Pixels are counted from `origin`.
fn is_outside(disc: Disc, origin: f32, wanted: vec2<i32>, margin: f32, axis: vec2<f32>) -> bool {
    let slopes = slopes_of(origin, wanted, margin);
    return is_beyond(disc, slopes.x, -axis) || is_beyond(disc, slopes.y, axis);
}

// Do both discs, and so the tube between them, lie outside one of these planes?
fn both_outside(begin: Disc, end: Disc, origin: f32, wanted: vec2<i32>, axis: vec2<f32>) -> bool {
    let slopes = slopes_of(origin, wanted, 0.0);
    return (is_beyond(begin, slopes.x, -axis) && is_beyond(end, slopes.x, -axis))
        || (is_beyond(begin, slopes.y, axis) && is_beyond(end, slopes.y, axis));
}

fn slopes_of(origin: f32, wanted: vec2<i32>, margin: f32) -> vec2<f32> {
    let wider = margin + SLACK + abs(origin) * EPSILON;
    return vec2<f32>(wanted) + 0.5 - origin + vec2<f32>(-wider, wider);
}

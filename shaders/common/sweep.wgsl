// A kernel in linear motion on one ray: when it covers the ray, and with what weight.
// Twin: src/math/sweep.rs.  Math: docs/math.md, eq. 11 to 16.
//
// Along a ray, the tangent-plane coordinates of the kernel are linear in the time tau in [-1, 1]:
// (u, v)(tau) = (at + tau rate) / w. Everything is regular without motion.

// Squared motion in radii below which a kernel counts as unmoved.
const UNMOVED: f32 = 1e-12;
// 1 / integral over [-1, 1] of exp(-2 tau^2).
const ELLIPSOID_PEAK: f32 = 0.83591896;
// Integral of exp(-2 r^2) over the unit disc over its integral over the unit ball.
const LINE_PEAK: f32 = 0.9341491;
const HALF_SQRT_PI: f32 = 0.8862269;
const SQRT_2: f32 = 1.4142135;
const SQRT_HALF_PI: f32 = 1.2533141;
// Adding this leaves the nearest integer in the low mantissa bits: 1.5 * 2^23.
const ROUND: f32 = 12582912.0;

struct Path {
    at: vec2<f32>,
    rate: vec2<f32>,
    w: f32,
}

// The quadratic |at + tau rate|^2 + e (tau w)^2 = w^2 in tau. e is 0 for the tube and 1 for the ellipsoid.
struct Sweep {
    w2: f32,
    a: f32,
    b: f32,
    r2: f32,
    across: f32,
    unmoved: bool,
}

// The path times the power of two that brings w into [1, 2): the fourth power of w is a number at any depth.
fn in_range(path: Path) -> Path {
    // The bits of the exponent, and those of 2^127.
    let scale = bitcast<f32>(0x7f000000u - (bitcast<u32>(path.w) & 0x7f800000u));
    return Path(path.at * scale, path.rate * scale, path.w * scale);
}

fn sweep_of(any: Path, e: f32) -> Sweep {
    let path = in_range(any);
    var out: Sweep;
    out.w2 = path.w * path.w;
    out.r2 = path.at.x * path.at.x + path.at.y * path.at.y;
    let cross = path.at.x * path.rate.y - path.at.y * path.rate.x;
    out.a = path.rate.x * path.rate.x + path.rate.y * path.rate.y + e * out.w2;
    out.b = path.at.x * path.rate.x + path.at.y * path.rate.y;
    out.across = cross * cross + e * (out.w2 * out.r2);
    out.unmoved = out.a <= UNMOVED * out.w2;
    return out;
}

// First and last tau in [-1, 1] at which the kernel covers the ray. It never does if the first is not less than the
// last.
fn covered(s: Sweep) -> vec2<f32> {
    let none = vec2<f32>(1.0, -1.0);
    if s.unmoved {
        return select(none, vec2<f32>(-1.0, 1.0), s.r2 <= s.w2);
    }
    let squared = s.w2 * s.a - s.across;
    if !(squared > 0.0) { return none; }
    // The root of greater magnitude comes from a sum without cancellation, the other one from Vieta's formula.
    let root = sqrt(squared);
    let sum = s.b + select(root, -root, s.b < 0.0);
    let one = -sum / s.a;
    let other = (s.w2 - s.r2) / sum;
    return vec2<f32>(max(min(one, other), -1.0), min(max(one, other), 1.0));
}

// Squared distance of the path from the kernel's centre, in kernel radii.
fn nearest(s: Sweep) -> f32 {
    return select(s.across, s.r2, s.unmoved) / select(s.w2 * s.a, s.w2, s.unmoved);
}

// Weight of the ellipsoid by its chord (docs/math.md, eq. 16; Wolf 2008, eq. 4.12).
fn chord(s: Sweep) -> f32 {
    return kernel(vec4<f32>(nearest(s))).x;
}

// Mean of exp(-2 (u^2 + v^2 + e tau^2)) over `span`.
fn mean_over(s: Sweep, span: vec2<f32>) -> f32 {
    var scale = 0.0;
    if !s.unmoved {
        scale = SQRT_2 / sqrt(s.w2 * s.a);
    }
    let x = scale * (s.b + s.a * span);
    return chord(s) * (HALF_SQRT_PI * erf_slope(x.x, x.y));
}

fn tube_weight(mean: f32, span: vec2<f32>) -> f32 {
    return mean * (0.5 * (span.y - span.x));
}

fn ellipsoid_weight(mean: f32, span: vec2<f32>) -> f32 {
    return mean * (ELLIPSOID_PEAK * (span.y - span.x));
}

// Line integral through the ellipsoid (docs/math.md, eq. 16b; Wolf 2008, eq. C.38). `slant`: 1 / |cos| of the angle
// between the ray and the kernel's normal.
fn line_weight(mean: f32, span: vec2<f32>, slant: f32) -> f32 {
    return mean * (LINE_PEAK * (span.y - span.x)) * slant;
}

// Factor on a chord's weight that keeps a kernel's integral over the screen the same whatever its motion.
fn chord_intensity(s: Sweep) -> f32 {
    return SQRT_HALF_PI * ELLIPSOID_PEAK / sqrt(s.a / s.w2);
}

// The middles of the 32nds of [-1, 1] that lie in `span`, as bits; the earliest is the lowest bit.
fn moments_in(span: vec2<f32>) -> u32 {
    return below(span.y) & ~below(span.x);
}

// Number of middles before `tau` in [-1, 1].
fn below(tau: f32) -> u32 {
    let count = bitcast<u32>(16.0 * tau + (16.0 + ROUND)) & 63u;
    let ones = (1u << (count & 31u)) - 1u;
    return select(0xffffffffu, ones, count < 32u);
}

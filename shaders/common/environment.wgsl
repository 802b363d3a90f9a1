// What surrounds the scene, as surfaces mirror it. Twin: src/environment/cube.rs, src/environment/mod.rs.
// Math: docs/math.md, section 14.

// For each level, for each face, its rows with a border of one pixel: red, green and blue.
@group(1) @binding(37) var<storage, read> environment: array<f32>;

// Pixels along an edge of level 0, a power of two; 0 where nothing mirrors.
override FACE: u32 = 0u;
// Pixels along an edge of the last level.
const LAST_FACE: u32 = 4u;
// Total standard deviation of level 1 and of all after it, in edges of a pixel.
const DEVIATION: f32 = 0.8;

// The direction that a mirror with unit normal `n` shows to the unit direction `eye`. Twin: shading::mirrored.
fn mirrored(n: vec3<f32>, eye: vec3<f32>) -> vec3<f32> {
    let twice = 2.0 * (n.x * eye.x + n.y * eye.y + n.z * eye.z);
    return twice * n - eye;
}

// The mean radiance around a direction under a kernel with `variance` radians^2.
fn surroundings(towards: vec3<f32>, variance: f32) -> vec3<f32> {
    let turn = view.environment;
    let x = towards.x * turn.x - towards.z * turn.y;
    let z = towards.x * turn.y + towards.z * turn.x;
    let turned = vec3<f32>(x, towards.y, z);
    // Without an environment nothing calls this, and the constant must be a number all the same.
    let edge = 2.0 * DEVIATION * 2.0 / f32(max(FACE, LAST_FACE));
    let ratio = variance * (1.0 / (edge * edge));
    let last = firstTrailingBit(FACE / LAST_FACE);
    var level = 0u;
    var share = ratio;
    if ratio >= 1.0 {
        let doublings = u32(min(0.5 * log_of_two(ratio), f32(last)));
        level = 1u + doublings;
        share = (ratio * (1.0 / f32(1u << (2u * doublings))) - 1.0) * (1.0 / 3.0);
    }
    if level >= last {
        level = last;
        share = 0.0;
    }
    var seen = of_level(level, turned);
    if share != 0.0 { seen += (of_level(level + 1u, turned) - seen) * share; }
    return seen * turn.z;
}

fn of_level(level: u32, towards: vec3<f32>) -> vec3<f32> {
    let edge = FACE >> level;
    let side = edge + 2u;
    let size = abs(towards);
    var axis = 2u;
    if size.x >= size.y && size.x >= size.z { axis = 0u; } else if size.y >= size.z { axis = 1u; }
    let over = 1.0 / size[axis];
    let half = 0.5 * f32(edge);
    let x = (towards[(axis + 1u) % 3u] * over + 1.0) * half + 0.5;
    let y = (towards[(axis + 2u) % 3u] * over + 1.0) * half + 0.5;
    let column = place(x, edge);
    let row = place(y, edge);
    let right = x - f32(column);
    let lower = y - f32(row);
    let face = 2u * axis + select(0u, 1u, towards[axis] < 0.0);
    var before = 0u;
    for (var finer = 0u; finer < level; finer += 1u) {
        let its_side = (FACE >> finer) + 2u;
        before += 6u * its_side * its_side;
    }
    let at = 3u * (before + (face * side + row) * side + column);
    let upper = texel(at) + (texel(at + 3u) - texel(at)) * right;
    let below = at + 3u * side;
    let under = texel(below) + (texel(below + 3u) - texel(below)) * right;
    return upper + (under - upper) * lower;
}

// A direction without length has no place: it gets the first pixel.
fn place(v: f32, edge: u32) -> u32 {
    if v >= 0.0 { return min(u32(min(v, 65535.0)), edge); }
    return 0u;
}

fn texel(at: u32) -> vec3<f32> {
    return vec3<f32>(environment[at], environment[at + 1u], environment[at + 2u]);
}

// The sums of kernels in motion: what passes `attribute` of steps `Sweep` and `Published` share.
//   in   splats, list, starts, wide   output of `project` and `bin`
//        map, values
//   out  sums      for each tile, for each channel, its pixels: weight, colour, then normal, depth and velocity
//                  where they are wanted
//        coverage_mask

@group(1) @binding(4) var<storage, read> splats: array<SweptSplat>;
@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(19) var<storage, read> values: array<f32>;
@group(1) @binding(20) var<storage, read_write> sums: array<f32>;
@group(1) @binding(24) var<storage, read> map: array<f32>;
@group(1) @binding(25) var<storage, read_write> coverage_mask: array<u32>;

// If true, the sum of weights is recorded instead of the times at which kernels cover.
override SUM: bool = false;

// The sums of one pixel.
struct Sums {
    weight: f32,
    colour: vec3<f32>,
    normal: vec3<f32>,
    depth: f32,
    velocity: vec2<f32>,
}

// The sums of the pixel whose first is at `sum_at`.
fn load_sums(sum_at: u32) -> Sums {
    var sum: Sums;
    sum.weight = sums[sum_at];
    sum.colour = load(sum_at, 1u);
    if NORMAL != 0u { sum.normal = load(sum_at, NORMAL); }
    if DEPTH != 0u { sum.depth = sums[sum_at + DEPTH * TILE_PIXELS]; }
    if VELOCITY != 0u {
        sum.velocity.x = sums[sum_at + VELOCITY * TILE_PIXELS];
        sum.velocity.y = sums[sum_at + (VELOCITY + 1u) * TILE_PIXELS];
    }
    return sum;
}

fn store_sums(sum_at: u32, sum: Sums) {
    sums[sum_at] = sum.weight;
    store(sum_at, 1u, sum.colour);
    if NORMAL != 0u { store(sum_at, NORMAL, sum.normal); }
    if DEPTH != 0u { sums[sum_at + DEPTH * TILE_PIXELS] = sum.depth; }
    if VELOCITY != 0u {
        sums[sum_at + VELOCITY * TILE_PIXELS] = sum.velocity.x;
        sums[sum_at + (VELOCITY + 1u) * TILE_PIXELS] = sum.velocity.y;
    }
}

fn load(sum_at: u32, channel: u32) -> vec3<f32> {
    let x = sum_at + channel * TILE_PIXELS;
    return vec3<f32>(sums[x], sums[x + TILE_PIXELS], sums[x + 2u * TILE_PIXELS]);
}

fn store(sum_at: u32, channel: u32, value: vec3<f32>) {
    let x = sum_at + channel * TILE_PIXELS;
    sums[x] = value.x;
    sums[x + TILE_PIXELS] = value.y;
    sums[x + 2u * TILE_PIXELS] = value.z;
}

// Factor on the weight of a hidden kernel. It is nothing beside any visible kernel, but gives a colour where the map
// hides all kernels that cover.
const HIDDEN: f32 = 5.9604645e-8;

// Adds the values of a kernel, whose mean depth on the ray is `depth`.
fn add_values(sum: ptr<function, Sums>, slot: u32, weight: f32, depth: f32) {
    var next = slot * VALUES;
    (*sum).weight += weight;
    (*sum).colour += weight * vec3<f32>(values[next], values[next + 1u], values[next + 2u]);
    next += 3u;
    if NORMAL != 0u {
        (*sum).normal += weight * vec3<f32>(values[next], values[next + 1u], values[next + 2u]);
        next += 3u;
    }
    if DEPTH != 0u {
        (*sum).depth += depth * weight;
    }
    if VELOCITY != 0u {
        (*sum).velocity += weight * vec2<f32>(values[next], values[next + 1u]);
    }
}

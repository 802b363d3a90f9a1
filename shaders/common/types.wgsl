// Structs and constants that programs share.
// Twins: src/layout.rs (Splat), src/backend/gpu/layout.rs (View, Segment, Travel, Light); a test compares the layouts.

// Edge of a tile, pixels; four neighbouring pixels of a row are worked on by one invocation, a quad.
const TILE: u32 = 16u;
const TILE_PIXELS: u32 = 256u;
const TILE_QUADS: u32 = 64u;
// Stands for +infinity, which WGSL does not promise.
const NONE: f32 = 3.4028234e38;
// Threshold where nothing shall be added: no splat passes, and sums stay as they are.
const UNWANTED: f32 = -NONE;
// Mark in `touched` of a splat that touches more tiles than `WIDEST`: listed once, apart.
const WIDE: u32 = 0x80000000u;
const WIDEST: u32 = 64u;
const FLAG_BACK: u32 = 1u;
const EPSILON: f32 = 1.1920929e-7;

// A surfel's kernel, posed and projected; see src/layout.rs. Above bit 0, `flags` holds the index of the splat's segment.
struct Splat {
    reference: vec2<f32>,
    inverse_depth: array<f32, 3>,
    u: array<f32, 3>,
    v: array<f32, 3>,
    centre_depth: f32,
    bounds: vec2<u32>,
    surfel: u32,
    flags: u32,
}

// What a dispatch works on: one group, one band of the image, one wave of surfels.
struct View {
    axis: vec2<f32>,
    offset: vec2<f32>,
    // First and last pixel column, then first and last row, of the band.
    pixels: vec4<i32>,
    // Tiles in a row and rows of tiles of the band.
    tiles: vec2<u32>,
    first_tile_row: u32,
    slots: u32,
    near: f32,
    most_inverse_depth: f32,
    // Radius of the low-pass disc, 0 without it, and 1 / radius^2.
    low_pass: f32,
    low_pass_scale: f32,
    focal: f32,
    stride: f32,
    weight: f32,
    entry_capacity: u32,
    // Columns: right, up, back.
    camera: array<vec4<f32>, 3>,
    material: vec4<f32>,
    first_light: u32,
    lights: u32,
    // 1: thresholds and sums go on from what is there.
    resumes: u32,
    // Whose turn it is before and after the wave: 0 is that of what lies still, then the samples' come; see attribute.wgsl.
    first_turn: u32,
    last_turn: u32,
    // Change of the time weight from the middle of the interval to its end, over its mean.
    slope: f32,
    // Blocks in a row and rows of them, where only some are wanted; 0 where all are.
    blocks: vec2<u32>,
    // Pixel from which tiles, bounds and pixels of tiles are counted: 0, but for the map.
    corner: vec2<i32>,
    // First pixel of the map; tiles in a row and rows of tiles.
    map_corner: vec2<i32>,
    map_tiles: vec2<u32>,
    unused: vec2<u32>,
}

// Some surfels of one block of a model, posed at one time sample. Before the first, each sample has one that holds its weight. Row i of a transform is (m_i0, m_i1, m_i2, origin_i).
struct Segment {
    screen: array<vec4<f32>, 3>,
    rate: array<vec4<f32>, 3>,
    normal: array<vec4<f32>, 3>,
    world: array<vec4<f32>, 3>,
    material: vec4<f32>,
    epsilon: f32,
    handedness: f32,
    weight: f32,
    share: f32,
    first_slot: u32,
    // First surfel in the block, number of them, surfels of the block, and model index of its first.
    first_surfel: u32,
    surfels: u32,
    block: u32,
    block_start: u32,
    // Place in the array of segments.
    index: u32,
    first_light: u32,
    // Bit 0: two-sided; bit 1: one material a surfel; above: its turn, 0 for what lies still, else 1 + the sample in its group.
    flags: u32,
}

// Pose of a segment's centres, to screen space: over an interval the mean of the poses at its ends, and half their difference.
struct Travel {
    centre: array<vec4<f32>, 3>,
    motion: array<vec4<f32>, 3>,
}

// `vector`: towards a directional light, or a point light's position relative to the eye; w tells the kind.
struct Light {
    vector: vec4<f32>,
    colour: vec4<f32>,
}
const AMBIENT: f32 = 0.0;
const DIRECTIONAL: f32 = 1.0;

@group(0) @binding(0) var<uniform> view: View;

fn apply(m: array<vec4<f32>, 3>, p: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(
        m[0].x * p.x + m[0].y * p.y + m[0].z * p.z + m[0].w,
        m[1].x * p.x + m[1].y * p.y + m[1].z * p.z + m[1].w,
        m[2].x * p.x + m[2].y * p.y + m[2].z * p.z + m[2].w,
    );
}

fn apply_linear(m: array<vec4<f32>, 3>, p: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(
        m[0].x * p.x + m[0].y * p.y + m[0].z * p.z,
        m[1].x * p.x + m[1].y * p.y + m[1].z * p.z,
        m[2].x * p.x + m[2].y * p.y + m[2].z * p.z,
    );
}

// First and last column, first and last row.
fn unpack(bounds: vec2<u32>) -> vec4<u32> {
    return vec4<u32>(bounds.x & 0xffffu, bounds.x >> 16u, bounds.y & 0xffffu, bounds.y >> 16u);
}

// The vector with length 1; a zero vector stays zero.
fn unit(v: vec3<f32>) -> vec3<f32> {
    let d2 = v.x * v.x + v.y * v.y + v.z * v.z;
    return v * (1.0 / sqrt(max(d2, 1e-30)));
}

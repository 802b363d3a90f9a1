// Structs and constants that programs share.
// Twins: src/layout.rs (Splat), src/backend/gpu/layout.rs (View, Segment, Light); a test compares the layouts.

// Edge of a tile, pixels. One invocation works on a quad: four neighbouring pixels of a row.
const TILE: u32 = 16u;
const TILE_PIXELS: u32 = 256u;
const TILE_QUADS: u32 = 64u;
// This stands for +infinity, which WGSL does not promise.
const NONE: f32 = 3.4028234e38;
// Threshold where nothing is to be added: no splat passes, and the sums stay as they are.
const UNWANTED: f32 = -NONE;
// Mark in `touched` of a splat that touches more than `WIDEST` tiles and is listed separately, once.
const WIDE: u32 = 0x80000000u;
const WIDEST: u32 = 64u;
// Entries of lists of a workgroup that has one invocation for each, and such workgroups in a row of a dispatch.
const PIECE: u32 = 256u;
const PIECES_OF_ROW: u32 = 32768u;
const FLAG_BACK: u32 = 1u;
const EPSILON: f32 = 1.1920929e-7;

// A surfel's kernel after posing and projection; see src/layout.rs. Above bit 0, `flags` holds the index of the splat's
// segment.
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

// The work of a dispatch: one group, one band of the image, one batch of surfels. A round is of several groups, each of
// which has a view.
struct View {
    axis: vec2<f32>,
    offset: vec2<f32>,
    // First and last pixel column of the band, then its first and last row.
    pixels: vec4<i32>,
    // Number of tiles in a row of the band, and of rows of tiles.
    tiles: vec2<u32>,
    first_tile_row: u32,
    // Slots of the batch; those of all views of a round.
    slots: u32,
    near: f32,
    most_inverse_depth: f32,
    // Radius of the low-pass disc (0 without it), and 1 / radius^2.
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
    // If 1, thresholds and sums continue from what the buffers hold.
    resumes: u32,
    // The turn before and after the batch: 0 for static objects, then one for each sample. See paint/sums.wgsl.
    first_turn: u32,
    last_turn: u32,
    // Change of the time weight from the middle of the interval to its end, divided by its mean.
    slope: f32,
    // Number of blocks in a row, and of rows of blocks, where only some are wanted; 0 where all are.
    blocks: vec2<u32>,
    // Pixel from which tiles, bounds and pixels of tiles are counted. It is 0 except for the map.
    corner: vec2<i32>,
    // First pixel of the map. Number of tiles in a row of the map, and of rows of tiles.
    map_corner: vec2<i32>,
    map_tiles: vec2<u32>,
    // Standard deviation of the low-pass filter of full EWA, 0 without it.
    sigma: f32,
    // Tiles of all views of the round.
    round_tiles: u32,
    // For step `Composite`: place of the first slot in the order of depth; the factor that turns sums over the group
    // into means.
    first_place: u32,
    opaque_scale: f32,
    // Bits as below.
    flags: u32,
    // Number of the view of what is at rest, whose splats are in its lists, too; its own number where it has none.
    rest: u32,
    // Cosine and sine of the environment's rotation, factor on its radiance, and the reflection coefficient of all
    // objects where they have the same.
    environment: vec4<f32>,
    // Standard deviation of what the sample position sees of the scene, raster pixels.
    pixel: f32,
    // Half the rows of a strip that is read out row by row, raster pixels; minus half its columns where columns are
    // read out; 0 where all pixels are exposed at once. First pixel of the strip in the raster.
    strip: f32,
    first: vec2<u32>,
    // Number of views of the round, and of this one among them. Its first tile and first slot among those of the round.
    views: u32,
    number: u32,
    first_tile: u32,
    first_slot: u32,
    // Views of the round that add to the same part of the film, from this one on; 0 where one before it does. First
    // tile of that part.
    same_film: u32,
    film_tile: u32,
    // The first segment of the group, and its first moment.
    first_segment: u32,
    first_moment: u32,
    // Passes that walk over the lists of the round.
    walks: u32,
    // Which stretch of its lists the view is for, where each has STRETCH entries; `resumes` is 1 after the first.
    stretch: u32,
    // The least depth tolerance of the objects whose surfels it shows.
    epsilon: f32,
    // Surfels that may cast shadows; 0 where no light has any.
    casters: u32,
}

// Bits of `View.flags`. Thresholds hold opaque surfels; there are layers of see-through surfels; the slab of depth is
// the last one.
const OPAQUE_SURFELS: u32 = 1u;
const SEE_THROUGH_SURFELS: u32 = 2u;
const LAST_SLAB: u32 = 4u;
// The view is of what is at rest for several groups, and adds nothing to the film by itself. Tiles into which nothing
// of the view's own moves are those of the view at rest.
const IS_REST: u32 = 8u;
const SHARES_TILES: u32 = 16u;
// Nobody asks for more of the view than its lists and depths.
const LISTS_ALONE: u32 = 32u;
// Its lists are walked over in stretches (common/list.wgsl).
const IN_STRETCHES: u32 = 64u;

// Some surfels of one surfel buffer, posed at one time sample. The segments of a group begin with one entry for each
// sample, which holds only the sample's weight. Row i of a transform is (m_i0, m_i1, m_i2, origin_i). The normal's rows
// have no origin: they end with the object's factor on opacities, its reflection coefficient, and 1 where it receives
// shadows plus 2 where it is a shadow catcher plus 4 where it is held.
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
    // First surfel in the surfel buffer, number of surfels, size of the buffer in surfels, and index in the model of
    // the buffer's first surfel.
    first_surfel: u32,
    surfels: u32,
    buffer_surfels: u32,
    buffer_start: u32,
    // Index in the array of segments.
    index: u32,
    first_light: u32,
    // Bit 0: two-sided. Bit 1: each surfel has a material. Bit 2: each has an opacity. Above: its turn, 0 for static
    // objects, else 1 + the sample in its group.
    flags: u32,
    // Transform of the centres to screen space, and their motion. Over an interval these are the mean place by
    // Simpson's rule, and half the difference of the ends (docs/math.md, section 7).
    centre: array<vec4<f32>, 3>,
    motion: array<vec4<f32>, 3>,
    // Factors on the columns of the surfels' paths: what the centres travelled by themselves, and what they move.
    elapsed: vec4<f32>,
    advance: vec4<f32>,
    // Change of the normal's transform from the middle to the last row of a strip that is read out.
    turn: array<vec4<f32>, 3>,
    // Units of time of the paths in a shutter.
    pace: f32,
    // Columns of floats in `geometry` before the normalisation: 9, and 3 for each column of the paths.
    columns: u32,
    // Number of its view.
    view: u32,
    // Index of the segment of the same surfel buffer in the middle of the group, of which the shadows are; its own
    // index where it is there, or the object is not seen then.
    middle: u32,
    // The axes of its camera in the world, row by row: right, down, forward. The first row ends with the world units to
    // a unit of a radius where surfels are spheres; 0 where they are discs.
    axes: array<vec4<f32>, 3>,
}

// `vector` points towards a directional light, or is a point light's position relative to the eye. Its w tells the
// kind. The w of its colour is 0 where it has no shadows, else 1 + its number among those that have.
struct Light {
    vector: vec4<f32>,
    colour: vec4<f32>,
}
const AMBIENT: f32 = 0.0;
const DIRECTIONAL: f32 = 1.0;
const HARMONICS: f32 = 3.0;
// Records of nine terms: two in each, that with the even number first, in `colour`.
const HARMONIC_RECORDS: u32 = 5u;

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

// First and last column, then first and last row.
fn unpack(bounds: vec2<u32>) -> vec4<u32> {
    return vec4<u32>(bounds.x & 0xffffu, bounds.x >> 16u, bounds.y & 0xffffu, bounds.y >> 16u);
}

// The vector with length 1; a zero vector stays zero.
fn unit(v: vec3<f32>) -> vec3<f32> {
    let d2 = v.x * v.x + v.y * v.y + v.z * v.z;
    return v * (1.0 / sqrt(max(d2, 1e-30)));
}

// The depths that passes know of a tile.
// Twin: src/backend/cpu/paint/buffers.rs.

// Does a filter widen kernels? Without it tiles have no apron, and nothing is known of their depths but T.
override FILTERED: bool = false;
// Do opaque objects have several tolerances? Then the depth of the nearest disc is kept, too. Twin: `nearest` of the
// same file.
override NEAREST: bool = false;
// Are layers of see-through surfels peeled off? Twin: `floor` and `ceiling` of the same files.
override PEEL: bool = false;

// The depths of a tile are quads: T of the tile and its apron, row by row. With a filter there follow, for the tile
// alone, the second threshold, UNWANTED where the pixel is solid; and the rim: 1 where there is a pixel within the
// apron that no disc covers, else 0.
// Where layers are peeled off, there follow the floor, up to which all was peeled off, of the tile and its apron; for
// the tile alone the ceiling, T of opaque surfels, and the three planes of its cover; and the state: 1 while there is
// more to peel off, else 0; and the number of the layer.
// Behind the depths of all tiles lie, tile by tile, those of the nearest discs, NONE where no disc covers.

// Pixels around a tile within which the low-pass filter reaches.
fn apron() -> u32 {
    if !FILTERED { return 0u; }
    return u32(ceil(2.0 * view.sigma));
}

// Quads beside the tile that hold the apron of a row.
fn apron_quads() -> u32 {
    return (apron() + 3u) / 4u;
}

// Quads of a row of the tile with its apron.
fn row_quads() -> u32 {
    return 4u + 2u * apron_quads();
}

// Quads of the tile with its apron.
fn guarded_quads() -> u32 {
    return row_quads() * (TILE + 2u * apron());
}

// Quads of the depths of a tile of opaque surfels.
fn opaque_depth_quads() -> u32 {
    return guarded_quads() + select(0u, 2u * TILE_QUADS, FILTERED);
}

// Quads of the depths of a tile.
fn depth_quads() -> u32 {
    if PEEL { return state_place() + 1u; }
    return opaque_depth_quads();
}

// First quad of tile `index`.
fn depths_of(index: u32) -> u32 {
    return index * depth_quads();
}

// First quad of the nearest depths of tile `index`.
fn nearest_of(index: u32) -> u32 {
    return view.round_tiles * depth_quads() + index * TILE_QUADS;
}

// Places of the first quads of the planes of the tile alone, counted from the tile's first quad.
fn second_place() -> u32 {
    return guarded_quads();
}

fn rim_place() -> u32 {
    return guarded_quads() + TILE_QUADS;
}

fn floor_place() -> u32 {
    return opaque_depth_quads();
}

fn ceiling_place() -> u32 {
    return floor_place() + guarded_quads();
}

fn cover_place() -> u32 {
    return ceiling_place() + TILE_QUADS;
}

fn state_place() -> u32 {
    return cover_place() + 3u * TILE_QUADS;
}

// Place of T of a quad of the tile, counted from the tile's first quad.
fn threshold_place(quad: vec2<u32>) -> u32 {
    return (quad.y + apron()) * row_quads() + quad.x + apron_quads();
}

// Smallest depth tolerance as a share of the depth: 4 units in the last place.
const LEAST_EPSILON: f32 = 4.0 * EPSILON;

fn tolerance_at(depth: Floats, epsilon: f32) -> Floats {
    return max(Floats(epsilon), LEAST_EPSILON * depth);
}

// The depth up to which splats with this tolerance show, where T is `first` and the nearest disc at `nearest`.
fn limit_of(tolerance: Floats, first: Floats, nearest: Floats) -> Floats {
    if !NEAREST { return first; }
    return min(first, nearest + tolerance);
}

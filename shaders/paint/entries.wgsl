// Includes: paint/walk paint/meet
// Programs that take entries of lists and not tiles: one invocation for each entry. It works on those pixels alone
// that the entry's splat may touch. Depths are positive, so they are in order as integers are, and a device can take
// the least of what several invocations have.

@group(1) @binding(2) var<storage, read> segments: array<Segment>;
@group(1) @binding(4) var<storage, read> splats: array<Kernel>;
@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(15) var<storage, read> sorted_keys: array<u32>;
@group(1) @binding(17) var<storage, read_write> thresholds: array<atomic<u32>>;

// The entry of an invocation. There may be none.
fn entry_at(group: vec3<u32>, lane: u32) -> u32 {
    return (group.y * PIECES_OF_ROW + group.x) * PIECE + lane;
}

fn has_entry(entry: u32) -> bool {
    return entry < starts[views[0].round_tiles];
}

// Loads the view of an entry. Returns its tile.
fn load_tile_of(entry: u32) -> vec2<u32> {
    load_view_of(list[entry]);
    let at = sorted_keys[entry] - view.first_tile;
    return vec2<u32>(at % view.tiles.x, at / view.tiles.x);
}

// The pixels within `bounds` in a tile of the view and `reach` pixels around it: first and last column, then first and
// last row, counted from the tile's first pixel.
fn bounds_in(bounds: vec4<u32>, first: vec2<u32>, reach: u32) -> vec4<i32> {
    let from_first = vec4<i32>(bounds) - vec4<i32>(first.xxyy);
    let low = max(from_first.xz, vec2<i32>(-i32(reach)));
    let high = min(from_first.yw, vec2<i32>(i32(TILE + reach) - 1));
    return vec4<i32>(low.x, high.x, low.y, high.y);
}

// The first pixel of a tile of the view.
fn first_pixel(tile: vec2<u32>) -> vec2<u32> {
    return TILE * vec2<u32>(tile.x, view.first_tile_row + tile.y);
}

// The place of a pixel of a plane of the tile with its apron, counted from the plane's first pixel.
fn place_around(column: i32, row: i32) -> u32 {
    return 4u * row_quads() * u32(row + i32(apron())) + u32(column + i32(4u * apron_quads()));
}

fn depth_at(place: u32) -> f32 {
    return bitcast<f32>(atomicLoad(&thresholds[place]));
}

// Lowers a depth. It must be positive.
fn lower(place: u32, depth: f32) {
    if depth < depth_at(place) { atomicMin(&thresholds[place], bitcast<u32>(depth)); }
}

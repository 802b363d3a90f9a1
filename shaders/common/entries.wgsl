// Programs that take entries of lists and not tiles: one invocation for each entry. It works on those pixels alone
// that the entry's splat may touch. Depths are positive, so they are in order as integers are, and a device can take
// the least of what several invocations have.
// A program that uses this file has common/views.wgsl.

@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(15) var<storage, read> sorted_keys: array<u32>;

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

// What a view shares with other groups of the sample position: the tiles of the view at rest.
// Twin: what `made` keeps in src/backend/cpu/tile_runner.rs.
// A program that uses this file declares `starts`.

// The number of a tile of the view at rest.
fn rest_tile_of(tile: vec2<u32>) -> u32 {
    return views[view.rest].first_tile + tile.y * view.tiles.x + tile.x;
}

// Is there nothing to be found out of the tile: all is known of the tile at rest, or nobody asks for more of it than
// its lists and depths?
fn rests(tile: vec2<u32>) -> bool {
    return (view.flags & LISTS_ALONE) != 0u || shares(tile);
}

// Is the tile the one at rest, since nothing of the view's own is in it?
fn shares(tile: vec2<u32>) -> bool {
    let index = tile_of(tile);
    let wide_at = view.round_tiles + 1u + view.number;
    return (view.flags & SHARES_TILES) != 0u && starts[index] == starts[index + 1u]
        && starts[wide_at] == starts[wide_at + 1u];
}

// The views of a round, one for each group. Each invocation works on one of them, which its entry point loads.
// Twin: VIEWS of src/backend/gpu/layout.rs.

const VIEWS: u32 = 128u;
@group(0) @binding(0) var<uniform> views: array<View, VIEWS>;
var<private> view: View;

// Is there such a tile in the view? The views of a round may have other sizes.
fn has_tile(tile: vec2<u32>) -> bool {
    return all(tile < view.tiles);
}

// The number of a tile of the view among those of the round.
fn tile_of(tile: vec2<u32>) -> u32 {
    return view.first_tile + tile.y * view.tiles.x + tile.x;
}

// The number of a tile of the view among those of the film.
fn film_tile_of(tile: vec2<u32>) -> u32 {
    return view.film_tile + tile.y * view.tiles.x + tile.x;
}

// Loads the view of a slot.
fn load_view_of(slot: u32) {
    var low = 0u;
    var high = views[0].views;
    while low + 1u < high {
        let middle = (low + high) / 2u;
        if views[middle].first_slot <= slot { low = middle; } else { high = middle; }
    }
    view = views[low];
}

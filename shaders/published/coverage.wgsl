// When published kernels in motion and their low-pass discs cover a pixel.
// Twin: src/backend/cpu/published/coverage.rs.  Math: docs/math.md, eq. 18 and 19.

// The share of the exposure in which a pixel is covered.
fn coverage(index: u32, in_tile: u32) -> f32 {
    let at = 3u * index * TILE_PIXELS + in_tile;
    let loose = view.weight * bitcast<f32>(coverage_mask[at + 2u * TILE_PIXELS]);
    if SUM { return loose; }
    let surface = coverage_mask[at];
    if surface == 0xffffffffu { return view.weight; }
    let others = coverage_mask[at + TILE_PIXELS] & ~surface;
    var covers = 0.0;
    var reached = 0.0;
    for (var i = 0u; i < 32u; i += 1u) {
        covers += select(0.0, moments[view.first_moment + i], ((surface >> i) & 1u) != 0u);
        reached += select(0.0, moments[view.first_moment + i], ((others >> i) & 1u) != 0u);
    }
    // At times when only low-pass discs cover the pixel, the sum of their weights is the coverage, up to the length of
    // those times.
    return covers + min(loose, reached);
}

// When kernels in motion cover a pixel.
// Twin: coverage of src/backend/cpu/swept/resolve.rs.  Math: docs/math.md, eq. 18 and 20b.

// The planes of the coverage mask.
const MASKS: u32 = 5u;
// By how much sums of weights on a surface may be off from 1, over the square of the mean peak of the kernels.
const NOISE: f32 = 2.0;

// The share of the exposure in which a pixel is covered.
fn coverage(index: u32, in_tile: u32) -> f32 {
    let at = MASKS * index * TILE_PIXELS + in_tile;
    let sum = bitcast<f32>(coverage_mask[at + 2u * TILE_PIXELS]);
    if SUM { return view.weight * sum; }
    let surface = coverage_mask[at];
    let either = surface | coverage_mask[at + TILE_PIXELS];
    let peak = bitcast<f32>(coverage_mask[at + 3u * TILE_PIXELS]);
    let side = bitcast<f32>(coverage_mask[at + 4u * TILE_PIXELS]);
    var by_discs = 0.0;
    var most = 0.0;
    for (var i = 0u; i < 32u; i += 1u) {
        by_discs += select(0.0, moments[view.first_moment + i], ((surface >> i) & 1u) != 0u);
        most += select(0.0, moments[view.first_moment + i], ((either >> i) & 1u) != 0u);
    }
    if surface == 0xffffffffu { by_discs = view.weight; }
    if either == 0xffffffffu { most = view.weight; }
    let large = select(1.0, peak / sum, sum > 0.0);
    let hard = 1.0 - (1.0 - large) * (1.0 - large);
    // The side with the larger sum counts, where a thin sheet shows both.
    let weight = view.weight * (0.5 * (sum + abs(side)));
    // The time for which discs cover, as far as the weights may be off by noise.
    let noise = 1.0 + NOISE * (large * large);
    let soft = min(max(min(by_discs, weight * noise), weight / noise), most);
    return hard * by_discs + (1.0 - hard) * soft;
}

// Includes: paint/unfiltered
// The kernel in perspective, without a filter: its disc.
// Twin: src/backend/cpu/paint/kernel.rs.  Math: docs/math.md, section 2.

// Radius of the disc around the centre that bounds hold, too: none.
fn centre_disc(depth: f32) -> f32 {
    return 0.0;
}

fn see(splat: Kernel, column: u32, row: u32) -> Seen {
    let at = hit(splat, column, row);
    let depth = 1.0 / at.inverse_depth;
    let covered = covers(splat, at, column);
    let weight = kernel(min(at.scaled_r2 * (depth * depth), Floats(1.0)));
    let zero = Floats(0.0);
    return Seen(select(zero, weight, covered), select(zero, depth, covered), covered);
}

// Includes: paint/unfiltered
// The kernel with the approximate EWA filter: a pixel counts as near it as the nearer of its disc and a disc on the
// screen, which makes no layers.
// Twin: src/backend/cpu/published/low_pass.rs.  Math: docs/math.md, eq. 10.

// Radius of the disc around the centre that bounds hold, too: a centre nearer than `near` has none.
fn centre_disc(depth: f32) -> f32 {
    return select(0.0, view.low_pass, depth >= view.near);
}

fn see(splat: Kernel, column: u32, row: u32) -> Seen {
    let at = hit(splat, column, row);
    let plane_depth = 1.0 / at.inverse_depth;
    let inside = at.inside & (at.inverse_depth <= Floats(view.most_inverse_depth));
    let none = Floats(NONE);
    let r3d = select(none, at.scaled_r2 * (plane_depth * plane_depth), inside);
    let r2d = select(none, (at.x * at.x + at.y * at.y) * view.low_pass_scale, splat.centre_depth > 0.0);
    let r2 = min(r2d, r3d);
    let within = in_columns(unpack(splat.bounds), column);
    let hits = (inside | (r2 <= Floats(1.0))) & within;
    let weight = kernel(min(r2, Floats(1.0)));
    return Seen(
        select(Floats(0.0), weight, hits),
        select(Floats(splat.centre_depth), plane_depth, inside),
        inside & within,
    );
}

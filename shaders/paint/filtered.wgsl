// The kernel under full EWA.
// Twin: src/backend/cpu/paint/kernel.rs.  Math: docs/math.md, section 3.

alias Kernel = EwaSplat;

fn kernel_of(all: EwaSplat) -> Kernel {
    return all;
}

fn disc_of(splat: Kernel) -> Splat {
    return splat.disc;
}

// The pixels in which it may have weight.
fn weight_bounds(splat: Kernel) -> vec4<u32> {
    return unpack(splat.filtered_bounds);
}

fn peak_of(splat: Kernel) -> f32 {
    return splat.peak;
}

// Radius of the disc around the centre that bounds hold, too: none.
fn centre_disc(depth: f32) -> f32 {
    return 0.0;
}

fn form(c: vec2<f32>, at: Hit) -> Floats {
    return c.x * at.x + c.y * at.y;
}

fn see(splat: Kernel, column: u32, row: u32) -> Seen {
    let at = hit(splat.disc, column, row);
    let one = Floats(1.0);
    let in_view = (at.inverse_depth > Floats(0.0)) & (at.inverse_depth <= Floats(view.most_inverse_depth));
    let plane_depth = 1.0 / at.inverse_depth;
    let u = form(splat.u, at);
    let v = form(splat.v, at);
    let px = form(vec2<f32>(splat.p[0], splat.p[1]), at);
    let py = form(vec2<f32>(splat.p[1], splat.p[2]), at);
    let nearer = 1.0 - form(splat.shrink, at);
    let over = 1.0 / nearer;
    let quarter_variance = 0.25 * view.sigma * view.sigma;
    var r2 = (u * u + v * v) * (over * over) + quarter_variance * (px * px + py * py);
    var shown = nearer > Floats(0.0);
    // One that reaches the camera plane is not filtered.
    if splat.crossing != 0u {
        r2 = at.scaled_r2 * (plane_depth * plane_depth);
        shown = at.inside & in_view;
    }
    let within = in_columns(weight_bounds(splat), column);
    let hits = shown & (r2 <= one) & within;
    let weight = splat.weight * kernel(select(one, r2, r2 < one));
    return Seen(
        select(Floats(0.0), weight, hits),
        select(Floats(splat.disc.centre_depth), plane_depth, in_view),
        at.inside & in_view & within,
    );
}

// What the passes of step `Paint` know of kernels. The rest says the file of each kind: discs (disc.wgsl), discs with
// low-pass discs (published/low_pass.wgsl), and filtered kernels (filtered.wgsl). It has the type `Kernel` of what is
// stored of one, and functions of it.
// Twins: src/layout.rs (EwaSplat), which says what the forms mean; a test compares the layouts.
// src/backend/cpu/paint/kernel.rs.

struct EwaSplat {
    disc: Splat,
    u: vec2<f32>,
    v: vec2<f32>,
    shrink: vec2<f32>,
    p: array<f32, 3>,
    peak: f32,
    weight: f32,
    crossing: u32,
    listed_bounds: vec2<u32>,
    filtered_bounds: vec2<u32>,
}

// A kernel on the rays through the pixels of an invocation.
struct Seen {
    weight: Floats,
    // Depth of its plane; of its centre where the ray misses the plane.
    depth: Floats,
    // True where the disc covers the pixel.
    disc: Bools,
}

// The pixels in which a disc is met before the camera.
fn covers(disc: Splat, at: Hit, column: u32) -> Bools {
    let in_view = at.inverse_depth <= Floats(view.most_inverse_depth);
    return at.inside & in_view & in_columns(unpack(disc.bounds), column);
}

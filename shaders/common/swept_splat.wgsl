// Kernels in motion. Twin: src/layout.rs (SweptSplat), which says what the forms mean; a test compares the layouts.

struct SweptSplat {
    reference: vec2<f32>,
    inverse_depth: array<f32, 3>,
    u: array<f32, 3>,
    v: array<f32, 3>,
    u_rate: array<f32, 3>,
    v_rate: array<f32, 3>,
    motion: array<f32, 3>,
    // First and last column, first and last row: at the beginning and at the end of the interval.
    ends: array<array<f32, 4>, 2>,
    bounds: vec2<u32>,
    surfel: u32,
    flags: u32,
}

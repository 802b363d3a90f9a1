// Kernels in motion that full EWA filters. Twins: src/layout.rs (FilteredSplat, and SweptSplat, which says what the
// forms mean); a test compares the layouts.

struct SweptFilter {
    inverse_depth: array<f32, 2>,
    u: array<f32, 2>,
    v: array<f32, 2>,
    u_rate: array<f32, 3>,
    v_rate: array<f32, 3>,
    k: f32,
    peak: f32,
    weight: f32,
    // 0 for a kernel that reaches the camera plane, which is not filtered.
    coverage: f32,
}

// The fields of the kernel itself, then its filtered kernel.
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
    filtered: SweptFilter,
}

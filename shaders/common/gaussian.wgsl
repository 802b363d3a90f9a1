// A Gaussian of a capture or volume, projected. Twins: src/layout.rs (GaussianSplat), which says what the fields mean;
// src/backend/gpu/layout.rs (DeviceGaussian), a test compares the layouts. Its size and the place of its bounds are
// those of a `Splat`: pass `bin` takes it for one.
struct DeviceGaussian {
    reference: vec2<f32>,
    along: f32,
    slope: f32,
    across: f32,
    peak: f32,
    colour: array<f32, 3>,
    depth: f32,
    // Screen velocity of the centre, pixels of the image per shutter; 0 where it is not wanted.
    velocity: vec2<f32>,
    // Its first column is behind its last where it touches nothing.
    bounds: vec2<u32>,
    index: u32,
    layer: u32,
}

// log2(255). Alphas below 1/255 are 0 (Kerbl et al. 2023, their program).
const LOG2_FAINTEST: f32 = 7.9943534;

// log2 of the optical depth, in powers of 1/2, below which a volume's kernel is cut, and the powers of 1/2 below its
// centre that it keeps at least.
const FAINTEST_DEPTH: f32 = -13.0;
const LEAST_REACH: f32 = 2.88539;

// Where the kernel of a volume with the centre 2^`peak` is cut.
fn least_power(peak: f32) -> f32 {
    return min(peak - LEAST_REACH, FAINTEST_DEPTH);
}

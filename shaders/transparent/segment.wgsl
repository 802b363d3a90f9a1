// The Gaussians of an invocation (common/work.wgsl).

@group(1) @binding(38) var<storage, read> segments: array<CaptureSegment>;

// The Gaussians of one buffer of a capture or volume, posed at one time sample.
struct CaptureSegment {
    screen: array<vec4<f32>, 3>,
    rate: array<vec4<f32>, 3>,
    // Transform of centres, and its change from the middle to the last row of a strip that is read out.
    centre: array<vec4<f32>, 3>,
    motion: array<vec4<f32>, 3>,
    // The eye in model space. Least depth that is drawn.
    eye: vec3<f32>,
    near: f32,
    // How far from the axis the derivative of the projection is taken at most, pixels.
    field: vec2<f32>,
    // Variance by which the filter widens a Gaussian, pixels^2.
    dilation: f32,
    // Factor on opacities.
    opacity: f32,
    // Corners of the crop box.
    low: vec4<f32>,
    high: vec4<f32>,
    // The colour of all, where w is 1.
    tint: vec4<f32>,
    first_slot: u32,
    count: u32,
    // Index of the first one among all Gaussians of the frame.
    first_index: u32,
    // Bit 0: one that is widened loses opacity. Bit 1: colours are linear, and the image is composited in coded values.
    // Bit 2: kernels of a volume. Bit 3: they have normals that lights shade. Bit 4: they keep their layers.
    // Bit 5: shadows fall on them.
    flags: u32,
    // Harmonics that each has, and those that are used: 0, 3, 8 or 15.
    harmonics_each: u32,
    harmonics_used: u32,
    // For volumes: area on the raster over that in the model, at depth 1 on the axis, over 2 pi, in powers of 1/2; and
    // the depth of a layer, scene units.
    area: f32,
    layer: f32,
    // For lit kernels: as in `Segment`. Where shadows fall on Gaussians, `world` is that of the group's middle.
    normal: array<vec4<f32>, 3>,
    world: array<vec4<f32>, 3>,
    material: vec4<f32>,
    first_light: u32,
    lights: u32,
    // Number of the view.
    view: u32,
    unused: u32,
}
// The segment of the invocation.
var<private> segment: CaptureSegment;

const FLAG_ANTIALIAS: u32 = 1u;
const FLAG_ENCODE: u32 = 2u;
const FLAG_VOLUME: u32 = 4u;
const FLAG_LIT: u32 = 8u;
const FLAG_KEEP_LAYER: u32 = 16u;
const FLAG_RECEIVES: u32 = 32u;

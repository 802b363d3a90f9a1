// The channels of sums, and of the values of a splat: those of `Channels` in src/layout.rs, then those of
// `DeviceChannels` in src/backend/gpu/memory.rs. A channel is 0 where it is not wanted.

// First channel of each quantity.
override NORMAL: u32 = 0u;
override DEPTH: u32 = 0u;
override VELOCITY: u32 = 0u;
override MATERIAL: u32 = 0u;
// Channel of the reflection coefficient; of the share that receives shadows, of which a part does not; of that which is
// a shadow catcher; of held objects, which is 1 for them and 0 for others; first of three of the way to the middle of
// a strip; and of the opacity, which see-through surfels alone have.
override REFLECTION: u32 = 0u;
override RECEIVES: u32 = 0u;
override CATCHER: u32 = 0u;
override HELD: u32 = 0u;
override MOVED: u32 = 0u;
override OPACITY: u32 = 0u;
// First of three channels for the coverage in groups of several samples. They are the sample coverage of the current
// sample, the coverage by the samples before it, and the sample coverage of static objects.
override SAMPLE_COVERAGE: u32 = 0u;
// First of three channels of pixels with several layers: weight times peak, weights that are negative for backs, and
// discs that cover.
override PEAK: u32 = 0u;
// Place of the tolerance among the values of a splat: kernels in motion alone have it, where objects have several.
override TOLERANCE: u32 = 0u;
// Number of channels of a layer, number of layers, and number of floats of a splat in `values`.
override CHANNELS: u32 = 4u;
override LAYERS: u32 = 1u;
override VALUES: u32 = 3u;

// Places of the layers: before the nearest disc that covers the pixel by more than the tolerance, at it, at the next
// one, and behind that. Where there is one layer alone it is the band, at place 0.
const FRONT: u32 = 0u;
const BAND: u32 = 1u;
const SECOND: u32 = 2u;
const REST: u32 = 3u;

// Flags of kernels in motion. Twin: src/layout.rs (SweptSplat).

const FLAG_LOW_PASS: u32 = 2u;
const FLAG_CROSSING: u32 = 4u;
// Above these, `flags` holds the index of the kernel's segment.
const SEGMENT_SHIFT: u32 = 3u;

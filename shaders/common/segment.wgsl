// The surfels of an invocation (common/work.wgsl).

@group(1) @binding(2) var<storage, read> segments: array<Segment>;
// The segment of the invocation.
var<private> segment: Segment;

// Loads the segment of workgroup `group`. Returns the invocation's surfel, counted from the segment's first one; it may
// be behind the last.
fn surfel_of(group: u32, lane: u32) -> u32 {
    let item = work_of(group);
    segment = segments[item.x];
    return 256u * item.y + lane;
}

// The surfels of an invocation. A dispatch works on all segments of one surfel buffer: a table tells its workgroups
// apart. Twin: WORKGROUPS of src/backend/gpu/layout.rs.

// Workgroups of a dispatch, each of 256 surfels: for each its segment, and which 256 of the segment's surfels.
const WORKGROUPS: u32 = 2048u;
@group(0) @binding(1) var<uniform> work: array<vec4<u32>, WORKGROUPS / 2u>;
@group(1) @binding(2) var<storage, read> segments: array<Segment>;
// The segment of the invocation.
var<private> segment: Segment;

// Loads the segment of workgroup `group`. Returns the invocation's surfel, counted from the segment's first one; it may
// be behind the last.
fn surfel_of(group: u32, lane: u32) -> u32 {
    let two = work[group / 2u];
    let item = select(two.xy, two.zw, group % 2u == 1u);
    segment = segments[item.x];
    return 256u * item.y + lane;
}

// What the workgroups of a dispatch over segments work on. A dispatch works on all segments of one buffer of a model: a
// table tells its workgroups apart. Twin: WORKGROUPS of src/backend/gpu/layout.rs.

// Workgroups of a dispatch, each of 256 surfels or Gaussians: for each its segment, and which 256 of the segment's.
const WORKGROUPS: u32 = 2048u;
@group(0) @binding(1) var<uniform> work: array<vec4<u32>, WORKGROUPS / 2u>;

// The segment of workgroup `group`, and the place of its 256 among those of the segment.
fn work_of(group: u32) -> vec2<u32> {
    let two = work[group / 2u];
    return select(two.xy, two.zw, group % 2u == 1u);
}

// Includes: common/types common/views common/work common/segment common/wanted common/bounds common/swept
// Includes: common/swept_splat common/paths common/moving
// Pass `project` of published kernels in motion (program `published_sweep`): makes kernels of surfels over an
// interval; projects, bounds and culls them. What it reads and writes: common/moving.wgsl.
// Twin: src/backend/cpu/published/project.rs.  Math: docs/math.md, section 7.
// One invocation per surfel.

@compute @workgroup_size(256)
fn published_sweep(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = surfel_of(group.x, lane);
    if index >= segment.surfels { return; }
    view = views[segment.view];
    let slot = segment.first_slot + index;
    touched[slot] = 0u;
    var kernel = moving(index);
    if kernel.kind == CROSSING {
        write_crossing(slot, kernel.splat, kernel.centre, kernel.motion, kernel.u, kernel.v);
    }
    if kernel.kind != ORDINARY { return; }
    let low_pass = select(0.0, view.low_pass, kernel.centre.z >= view.near);
    kernel.splat.flags |= select(0u, FLAG_LOW_PASS, low_pass > 0.0);
    write_bounded(slot, kernel.splat, boxes_of(kernel, kernel.u, kernel.v, low_pass));
}

// Pass `project`: turns surfels into splats; poses, projects, bounds and culls them.
// Twin: src/backend/cpu/project.rs.  Math: docs/math.md, section 2.
//   in   segment   the surfels and their pose
//        travels   the pose of the surfels' centres
//        geometry  columns of the surfel buffer: positions, axes u, axes v
//   out  splats    one for each slot; unwritten where culled
//        touched   number of wanted tiles that the splat touches; 0 if culled; WIDE if more than WIDEST
// One invocation per surfel. The slot is the surfel's place in the batch, so nothing is compacted and the order stays.

@group(1) @binding(4) var<storage, read_write> splats: array<Splat>;
@group(1) @binding(5) var<storage, read_write> touched: array<u32>;

@compute @workgroup_size(256)
fn project(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= segment.surfels { return; }
    let slot = segment.first_slot + id.x;
    touched[slot] = 0u;
    let surfel = posed(id.x, 0.0);
    if surfel.kind == CULLED { return; }
    var splat = surfel.splat;
    splat.bounds = pack(surfel.bounds);
    splats[slot] = splat;
    touched[slot] = tiles_in(surfel.bounds);
}

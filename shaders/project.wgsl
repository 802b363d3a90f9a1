// Pass `project`: turns surfels into splats; poses, projects, bounds and culls them.
// Twin: src/backend/cpu/project.rs.  Math: docs/math.md, section 2.
//   in   segment   the surfels and their pose
//        travels   the pose of the surfels' centres
//        geometry  columns of the surfel buffer: positions, axes u, axes v
//   out  splats    one for each slot; unwritten where culled
//        touched   number of wanted tiles that the splat touches; 0 if culled; WIDE if more than WIDEST
// One invocation per surfel. The slot is the surfel's place in the batch, so nothing is compacted and the order stays.

@group(0) @binding(1) var<uniform> segment: Segment;
@group(1) @binding(0) var<storage, read> geometry: array<f32>;
@group(1) @binding(4) var<storage, read_write> splats: array<Splat>;
@group(1) @binding(5) var<storage, read_write> touched: array<u32>;
@group(1) @binding(23) var<storage, read> travels: array<Travel>;

@compute @workgroup_size(256)
fn project(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= segment.surfels { return; }
    let slot = segment.first_slot + id.x;
    touched[slot] = 0u;
    let at = 3u * (segment.first_surfel + id.x);
    let column = 3u * segment.buffer_surfels;
    let c = apply(travels[segment.index].centre, vec3<f32>(geometry[at], geometry[at + 1u], geometry[at + 2u]));
    let at_u = at + column;
    let u = apply_linear(segment.screen, vec3<f32>(geometry[at_u], geometry[at_u + 1u], geometry[at_u + 2u]));
    let at_v = at_u + column;
    let v = apply_linear(segment.screen, vec3<f32>(geometry[at_v], geometry[at_v + 1u], geometry[at_v + 2u]));
    if !(all_finite(c) && all_finite(u) && all_finite(v)) { return; }

    let depth = c.z;
    let inverse = 1.0 / depth;
    let x = c.x * inverse;
    let y = c.y * inverse;
    let ux = u.x - x * u.z;
    let uy = u.y - y * u.z;
    let vx = v.x - x * v.z;
    let vy = v.y - y * v.z;
    // Signed area of the projected axes. The splat faces the viewer if det [u v centre] < 0. One that is seen edge-on
    // covers nothing.
    let area = ux * vy - uy * vx;
    let det = area * depth * segment.handedness;
    let two_sided = (segment.flags & 1u) != 0u;
    let reach2 = u.z * u.z + v.z * v.z;
    let d22 = reach2 - depth * depth;
    let facing = det < 0.0 || (two_sided && det > 0.0);
    if !facing || depth + sqrt(reach2) < view.near { return; }
    var splat: Splat;
    splat.surfel = segment.buffer_start + segment.first_surfel + id.x;
    splat.flags = segment.index << 1u;
    if depth <= 0.0 || d22 > -1e-3 * depth * depth {
        write_crossing(slot, splat, c, u, v);
        return;
    }
    let over_area = 1.0 / area;
    if !finite(over_area) { return; }
    let low_pass = select(0.0, view.low_pass, depth >= view.near);
    let inverse22 = 1.0 / d22;
    let reference = view.axis + vec2<f32>(x, y) - view.offset;
    let columns = extent(ux * ux + vx * vx, ux * u.z + vx * v.z, d22, inverse22, low_pass);
    let rows = extent(uy * uy + vy * vy, uy * u.z + vy * v.z, d22, inverse22, low_pass);
    let across = pixels_in(index_range(reference.x, columns), view.pixels.xy);
    let down = pixels_in(index_range(reference.y, rows), view.pixels.zw);
    if !(across.x <= across.y && down.x <= down.y) { return; }

    let over_both = over_area * inverse;
    splat.reference = reference;
    splat.inverse_depth[0] = (uy * v.z - u.z * vy) * over_both;
    splat.inverse_depth[1] = (u.z * vx - ux * v.z) * over_both;
    splat.inverse_depth[2] = inverse;
    splat.u[0] = vy * over_area;
    splat.u[1] = -vx * over_area;
    splat.v[0] = -uy * over_area;
    splat.v[1] = ux * over_area;
    splat.centre_depth = select(0.0, depth, depth >= view.near);
    splat.flags |= select(FLAG_BACK, 0u, area * segment.handedness < 0.0);
    write(slot, splat, bounds_of(across, down));
}

// Writes a splat that reaches the camera plane. Its bounds are the whole image, and pixels are counted from the
// camera's axis.
fn write_crossing(slot: u32, posed: Splat, c: vec3<f32>, u: vec3<f32>, v: vec3<f32>) {
    let normal = cross(u, v);
    let det = normal.x * c.x + normal.y * c.y + normal.z * c.z;
    let over = 1.0 / det;
    if !(finite(det) && finite(over)) { return; }
    let i = normal * over;
    let form_u = cross(v, c) * over;
    let form_v = cross(c, u) * over;
    var splat = posed;
    splat.reference = view.axis - view.offset;
    splat.inverse_depth = array<f32, 3>(i.x, i.y, i.z);
    splat.u = array<f32, 3>(form_u.x, form_u.y, form_u.z);
    splat.v = array<f32, 3>(form_v.x, form_v.y, form_v.z);
    splat.centre_depth = 0.0;
    splat.flags |= select(FLAG_BACK, 0u, det * segment.handedness < 0.0);
    write(slot, splat, vec4<u32>(view.pixels - view.corner.xxyy));
}

fn write(slot: u32, posed: Splat, bounds: vec4<u32>) {
    var splat = posed;
    splat.bounds = pack(bounds);
    splats[slot] = splat;
    touched[slot] = tiles_in(bounds);
}

// Includes: common/ball common/sphere
// The normals of spheres, beside those of their discs.
// Twin: Ball of src/backend/cpu/paint/attribute.rs.  Math: docs/math.md, section 19.

// Adds to the sum of normals what those of a sphere are more than that of its disc, which is at `values_at`.
fn add_bend(sum: ptr<function, Sums>, splat: Splat, values_at: u32, weight: Floats, column: u32, row: u32) {
    let n = -vec3<f32>(values[values_at], values[values_at + 1u], values[values_at + 2u]);
    let axes = segments[splat.flags >> 1u].axes;
    let seen = axes[0].xyz * n.x + axes[1].xyz * n.y + axes[2].xyz * n.z;
    let beside = across(seen);
    let across_u = apply_linear(axes, beside.u);
    let across_v = apply_linear(axes, beside.v);
    let at = hit_plane(splat, column, row);
    let depth = 1.0 / at.inverse_depth;
    let u = at.u * depth;
    let v = at.v * depth;
    let sine = -splat.centre_depth;
    let high = height(u * u + v * v);
    let over = 1.0 / (1.0 + sine * high);
    let cosine = sqrt(1.0 - sine * sine);
    let zero = Floats(0.0);
    let is_in = weight > zero;
    let along_u = select(zero, weight * (cosine * u * over), is_in);
    let along_v = select(zero, weight * (cosine * v * over), is_in);
    let along = select(zero, weight * ((1.0 - sine) * (1.0 - high) * over), is_in);
    (*sum).normal_x += along_u * across_u.x + along_v * across_v.x + along * n.x;
    (*sum).normal_y += along_u * across_u.y + along_v * across_v.y + along * n.y;
    (*sum).normal_z += along_u * across_u.z + along_v * across_v.z + along * n.z;
}

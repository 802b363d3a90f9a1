// Includes: common/ball
// A splat's plane on the rays through the pixels of an invocation.
// Twin: Patch and Hit of src/backend/cpu/patch.rs.  Math: docs/math.md, eq. 2.

struct Hit {
    // Distance from the splat's reference point, pixels.
    x: Floats,
    y: f32,
    inverse_depth: Floats,
    // Coordinates on its plane times the inverse depth of the plane.
    u: Floats,
    v: Floats,
    // (u^2 + v^2) times the squared inverse depth.
    scaled_r2: Floats,
    // True in front of the camera and within the cut-off radius.
    inside: Bools,
}

// The hit of the pixels that begin at column `column`, counted from the view's corner.
fn hit(splat: Splat, column: u32, row: u32) -> Hit {
    var out = hit_plane(splat, column, row);
    if is_sphere(splat) {
        let depth = 1.0 / out.inverse_depth;
        let nearer = bulge(splat, out.scaled_r2 * (depth * depth));
        out.inverse_depth *= nearer;
        // The place on the plane stays: it is r2 times the squared depth.
        out.scaled_r2 *= nearer * nearer;
    }
    return out;
}

// The same of the plane of its disc, whatever it is.
fn hit_plane(splat: Splat, column: u32, row: u32) -> Hit {
    let pixel = vec2<f32>(vec2<i32>(vec2<u32>(column, row)) + view.corner);
    var out: Hit;
    out.y = pixel.y + 0.5 - splat.reference.y;
    out.x = pixel.x + steps() + 0.5 - splat.reference.x;
    out.inverse_depth =
        splat.inverse_depth[0] * out.x + (splat.inverse_depth[1] * out.y + splat.inverse_depth[2]);
    out.u = splat.u[0] * out.x + (splat.u[1] * out.y + splat.u[2]);
    out.v = splat.v[0] * out.x + (splat.v[1] * out.y + splat.v[2]);
    out.scaled_r2 = out.u * out.u + out.v * out.v;
    out.inside = (out.inverse_depth > Floats(0.0)) & (out.scaled_r2 <= out.inverse_depth * out.inverse_depth);
    return out;
}

// True if the splat may touch the pixels.
fn touches(bounds: vec4<u32>, column: u32, row: u32) -> bool {
    return column <= bounds.y && column + (width() - 1u) >= bounds.x && row >= bounds.z && row <= bounds.w;
}

// Includes: common/sphere
// A surfel on the screen: posed, projected, bounded and culled.
// Twin: project_lane and push_crossing of src/backend/cpu/project.rs.  Math: docs/math.md, section 2.

@group(1) @binding(0) var<storage, read> geometry: array<f32>;

const CULLED: u32 = 0u;
const ORDINARY: u32 = 1u;
// It reaches the camera plane.
const CROSSING: u32 = 2u;

struct Posed {
    kind: u32,
    // Without bounds.
    splat: Splat,
    // The pixels that it may touch, counted from the view's corner.
    bounds: vec4<u32>,
    // Centre, axis u and axis v in homogeneous pixel coordinates (x, y, depth).
    c: vec3<f32>,
    u: vec3<f32>,
    v: vec3<f32>,
    // The axes as the pixels around the centre see them: x and y times depth.
    seen_u: vec2<f32>,
    seen_v: vec2<f32>,
}

// Surfel `index` of the segment. `margin`: pixels by which bounds are wider than what it touches.
fn posed(index: u32, margin: f32) -> Posed {
    var out: Posed;
    let at = 3u * (segment.first_surfel + index);
    let column = 3u * segment.buffer_surfels;
    let position = placed(at);
    var c = apply(segment.centre, position);
    let at_u = at + column;
    let axis_u = vec3<f32>(geometry[at_u], geometry[at_u + 1u], geometry[at_u + 2u]);
    var u = apply_linear(segment.screen, axis_u);
    let at_v = at_u + column;
    let axis_v = vec3<f32>(geometry[at_v], geometry[at_v + 1u], geometry[at_v + 2u]);
    var v = apply_linear(segment.screen, axis_v);
    var lands = NO_LANDING;
    if reads_out() {
        let advance = rates(at, segment.advance);
        let motion =
            apply(segment.motion, position) + apply_linear(segment.centre, advance);
        lands = landing(c, motion);
        c += lands.time * motion;
        u += lands.time * apply_linear(segment.motion, axis_u);
        v += lands.time * apply_linear(segment.motion, axis_v);
    }
    var sine = 0.0;
    if segment.axes[0].w != 0.0 {
        // A sphere turns its disc to the eye.
        let radius = sqrt(axis_u.x * axis_u.x + axis_u.y * axis_u.y + axis_u.z * axis_u.z) * segment.axes[0].w;
        let disc = outline(vec3<f32>(c.xy / view.focal, c.z), radius);
        if !(disc.sine < 1.0) { return out; }
        c *= disc.nearer;
        u = disc.u * vec3<f32>(view.focal, view.focal, 1.0);
        v = disc.v * vec3<f32>(view.focal, view.focal, 1.0);
        sine = disc.sine;
    }
    if !(all_finite(c) && all_finite(u) && all_finite(v)) { return out; }

    let depth = c.z;
    let inverse = 1.0 / depth;
    let x = c.x * inverse;
    let y = c.y * inverse;
    var ux = u.x - x * u.z;
    var uy = u.y - y * u.z;
    var vx = v.x - x * v.z;
    var vy = v.y - y * v.z;
    // Signed area of the projected axes. The splat faces the viewer if det [u v centre] < 0. One that is seen edge-on
    // covers nothing.
    var area = ux * vy - uy * vx;
    let det = area * depth * segment.handedness;
    let two_sided = (segment.flags & 1u) != 0u;
    let reach2 = u.z * u.z + v.z * v.z;
    let d22 = reach2 - depth * depth;
    let facing = det < 0.0 || (two_sided && det > 0.0);
    if !facing || depth + sqrt(reach2) < view.near { return out; }
    out.c = c;
    out.u = u;
    out.v = v;
    let shows_back = !(area * segment.handedness < 0.0);
    var recede = vec2<f32>(0.0);
    if reads_out() {
        // What rows beside the centre's see, they see earlier or later.
        let seen_u = displaced(lands, vec2<f32>(ux, uy));
        let seen_v = displaced(lands, vec2<f32>(vx, vy));
        ux = seen_u.x;
        uy = seen_u.y;
        vx = seen_v.x;
        vy = seen_v.y;
        area *= lands.along;
        recede = turned(vec2<f32>(lands.recede * inverse * inverse, 0.0));
    }
    out.seen_u = vec2<f32>(ux, uy);
    out.seen_v = vec2<f32>(vx, vy);
    out.splat.surfel = segment.buffer_start + segment.first_surfel + index;
    out.splat.flags = segment.index << 1u;
    out.splat.centre_depth = -sine;
    if depth <= 0.0 || d22 > -1e-3 * depth * depth {
        cross_camera_plane(&out, margin);
        return out;
    }
    let over_area = 1.0 / area;
    if !finite(over_area) { return out; }
    let disc = centre_disc(depth);
    let inverse22 = 1.0 / d22;
    var reference = view.axis + vec2<f32>(x, y) - view.offset;
    if reads_out() { reference += lands.shift; }
    let wider = vec2<f32>(-margin, margin);
    let columns = extent(ux * ux + vx * vx, ux * u.z + vx * v.z, inverse22, disc) + wider;
    let rows = extent(uy * uy + vy * vy, uy * u.z + vy * v.z, inverse22, disc) + wider;
    let across = pixels_in(index_range(reference.x, columns), view.pixels.xy);
    let down = pixels_in(index_range(reference.y, rows), view.pixels.zw);
    if !(across.x <= across.y && down.x <= down.y) { return out; }

    let over_both = over_area * inverse;
    out.kind = ORDINARY;
    out.bounds = bounds_of(across, down);
    out.splat.reference = reference;
    out.splat.inverse_depth[0] = (uy * v.z - u.z * vy) * over_both - recede.x;
    out.splat.inverse_depth[1] = (u.z * vx - ux * v.z) * over_both - recede.y;
    out.splat.inverse_depth[2] = inverse;
    out.splat.u[0] = vy * over_area;
    out.splat.u[1] = -vx * over_area;
    out.splat.v[0] = -uy * over_area;
    out.splat.v[1] = ux * over_area;
    if sine == 0.0 { out.splat.centre_depth = select(0.0, depth, depth >= view.near); }
    out.splat.flags |= select(0u, FLAG_BACK, shows_back);
    return out;
}

// A splat that reaches the camera plane. It is bounded by the part of its disc beyond `near`, and pixels are counted
// from the camera's axis.
fn cross_camera_plane(out: ptr<function, Posed>, margin: f32) {
    let c = (*out).c;
    let u = (*out).u;
    let v = (*out).v;
    let normal = cross(u, v);
    let det = normal.x * c.x + normal.y * c.y + normal.z * c.z;
    let over = 1.0 / det;
    if !(finite(det) && finite(over)) { return; }
    let origin = view.axis - view.offset;
    let disc = Disc(c, u, v);
    if is_outside(disc, origin.x, view.pixels.xy, margin, vec2<f32>(1.0, 0.0)) { return; }
    if is_outside(disc, origin.y, view.pixels.zw, margin, vec2<f32>(0.0, 1.0)) { return; }
    let ends = beyond_near(disc, view.near);
    if ends.x > ends.y { return; }
    var bounds = vec4<u32>(view.pixels - view.corner.xxyy);
    // Numbers beyond the range of floats bound nothing.
    if all_finite(ends.xyz) && finite(ends.w) {
        let wider = vec2<f32>(-margin, margin);
        let across = pixels_in(index_range(origin.x, ends.xy + wider), view.pixels.xy);
        let down = pixels_in(index_range(origin.y, ends.zw + wider), view.pixels.zw);
        if !(across.x <= across.y && down.x <= down.y) { return; }
        bounds = bounds_of(across, down);
    }
    let i = normal * over;
    let form_u = cross(v, c) * over;
    let form_v = cross(c, u) * over;
    (*out).kind = CROSSING;
    (*out).bounds = bounds;
    (*out).splat.reference = origin;
    (*out).splat.inverse_depth = array<f32, 3>(i.x, i.y, i.z);
    (*out).splat.u = array<f32, 3>(form_u.x, form_u.y, form_u.z);
    (*out).splat.v = array<f32, 3>(form_v.x, form_v.y, form_v.z);
    (*out).splat.flags |= select(FLAG_BACK, 0u, det * segment.handedness < 0.0);
}

// What the passes `project` of kernels in motion share: an invocation's kernel, posed, projected and bounded.
// Twin: src/backend/cpu/swept/project.rs.  Math: docs/math.md, section 7.
//   in   segments  the surfels and their pose at mid-interval; the pose of their centres over the interval, and their
//                  motion
//        geometry  columns of the surfel buffer: positions, axes u, axes v
//   out  splats    one for each slot; unwritten where culled
//        touched   number of tiles that the kernel touches; 0 if culled; WIDE if more than WIDEST

@group(1) @binding(0) var<storage, read> geometry: array<f32>;
@group(1) @binding(4) var<storage, read_write> splats: array<SweptSplat>;
@group(1) @binding(5) var<storage, read_write> touched: array<u32>;

// If true, the kernel is the ellipsoid instead of the tube.
override ELLIPSOID: bool = false;

// Kinds of kernels: not to be seen; before the camera plane; reaching it.
const CULLED: u32 = 0u;
const ORDINARY: u32 = 1u;
const CROSSING: u32 = 2u;

// A kernel in screen space, and its splat without bounds.
struct Moving {
    kind: u32,
    splat: SweptSplat,
    centre: vec3<f32>,
    motion: vec3<f32>,
    u: vec3<f32>,
    v: vec3<f32>,
}

// The kernel of invocation `id`. The splat of one that reaches the camera plane lacks its forms.
fn moving(id: u32) -> Moving {
    var out: Moving;
    out.kind = CULLED;
    let at = 3u * (segment.first_surfel + id);
    let column = 3u * segment.buffer_surfels;
    let position = placed(at);
    let centre = apply(segment.centre, position);
    let advance = rates(at, segment.advance);
    let motion = apply(segment.motion, position) + apply_linear(segment.centre, advance);
    let at_u = at + column;
    let u = apply_linear(segment.screen, vec3<f32>(geometry[at_u], geometry[at_u + 1u], geometry[at_u + 2u]));
    let at_v = at_u + column;
    let v = apply_linear(segment.screen, vec3<f32>(geometry[at_v], geometry[at_v + 1u], geometry[at_v + 2u]));
    if !(all_finite(centre) && all_finite(motion) && all_finite(u) && all_finite(v)) { return out; }
    out.centre = centre;
    out.motion = motion;
    out.u = u;
    out.v = v;

    let reach2 = u.z * u.z + v.z * v.z;
    let depths = vec2<f32>(centre.z - motion.z, centre.z + motion.z);
    if max(depths.x, depths.y) + sqrt(reach2) < view.near { return out; }
    out.splat.surfel = segment.buffer_start + segment.first_surfel + id;
    if crosses(depths.x, reach2) || crosses(depths.y, reach2) {
        out.kind = CROSSING;
        return out;
    }
    let inverse = 1.0 / centre.z;
    let x = centre.x * inverse;
    let y = centre.y * inverse;
    let ux = u.x - x * u.z;
    let uy = u.y - y * u.z;
    let vx = v.x - x * v.z;
    let vy = v.y - y * v.z;
    let mx = motion.x - x * motion.z;
    let my = motion.y - y * motion.z;
    let area = ux * vy - uy * vx;
    if !faces(area * centre.z * segment.handedness) { return out; }
    let forms = forms_of(vec3<f32>(ux, uy, u.z), vec3<f32>(vx, vy, v.z), vec3<f32>(mx, my, motion.z), inverse);
    out.splat.reference = view.axis + vec2<f32>(x, y) - view.offset;
    out.splat.inverse_depth = forms.inverse_depth;
    out.splat.u = forms.u;
    out.splat.v = forms.v;
    out.splat.u_rate = forms.u_rate;
    out.splat.v_rate = forms.v_rate;
    out.splat.motion = array<f32, 3>(mx, my, motion.z);
    out.splat.flags = (segment.index << SEGMENT_SHIFT) | select(FLAG_BACK, 0u, area * segment.handedness < 0.0);
    out.kind = ORDINARY;
    return out;
}

struct Forms {
    inverse_depth: array<f32, 3>,
    u: array<f32, 3>,
    v: array<f32, 3>,
    u_rate: array<f32, 3>,
    v_rate: array<f32, 3>,
}

// The linear forms of a kernel with axes `u` and `v`, sheared as the motion `m` is: x and y times depth, depth.
// `inverse`: 1 over the centre's depth.
fn forms_of(u: vec3<f32>, v: vec3<f32>, m: vec3<f32>, inverse: f32) -> Forms {
    let over_area = 1.0 / (u.x * v.y - u.y * v.x);
    let over_both = over_area * inverse;
    var out: Forms;
    out.inverse_depth[0] = (u.y * v.z - u.z * v.y) * over_both;
    out.inverse_depth[1] = (u.z * v.x - u.x * v.z) * over_both;
    out.inverse_depth[2] = inverse;
    out.u[0] = v.y * over_area;
    out.u[1] = -v.x * over_area;
    out.v[0] = -u.y * over_area;
    out.v[1] = u.x * over_area;
    out.u_rate[0] = (v.y * m.z - v.z * m.y) * over_both;
    out.u_rate[1] = (v.z * m.x - v.x * m.z) * over_both;
    out.u_rate[2] = (v.x * m.y - v.y * m.x) * over_both;
    out.v_rate[0] = (m.y * u.z - m.z * u.y) * over_both;
    out.v_rate[1] = (m.z * u.x - m.x * u.z) * over_both;
    out.v_rate[2] = (m.x * u.y - m.y * u.x) * over_both;
    return out;
}

// Boxes at the ends of the interval, and the columns and rows of the box about the whole kernel.
struct Boxes {
    begin: vec4<f32>,
    end: vec4<f32>,
    across: vec2<f32>,
    down: vec2<f32>,
}

// The boxes of an ordinary kernel with these axes, and of a low-pass disc of the radius `low_pass`.
fn boxes_of(kernel: Moving, u: vec3<f32>, v: vec3<f32>, low_pass: f32) -> Boxes {
    let centre = kernel.centre;
    let motion = kernel.motion;
    let reach2 = u.z * u.z + v.z * v.z;
    let depths = vec2<f32>(centre.z - motion.z, centre.z + motion.z);
    // The disc keeps its size in space, so on the screen it grows as it comes nearer.
    var begin = box(centre - motion, u, v, low_pass * (centre.z / (centre.z - motion.z)));
    var end = box(centre + motion, u, v, low_pass * (centre.z / (centre.z + motion.z)));
    if min(depths.x, depths.y) - sqrt(reach2) < view.near {
        let shown = clipped(centre, motion, u, v, low_pass * centre.z);
        if shown.bounded {
            begin = shown.begin;
            end = shown.end;
        }
    }
    var across = vec2<f32>(min(begin.x, end.x), max(begin.y, end.y));
    var down = vec2<f32>(min(begin.z, end.z), max(begin.w, end.w));
    if ELLIPSOID {
        // The dual conic T diag(1, 1, 1, -1) T^t with T = [u v motion centre], and that of the low-pass disc
        // (docs/math.md, section 7, bounds).
        let inverse = 1.0 / centre.z;
        let at = centre.xy * inverse;
        let on_u = u.xy - at * u.z;
        let on_v = v.xy - at * v.z;
        let on_m = motion.xy - at * motion.z;
        let reference = view.axis + at - view.offset;
        let disc = low_pass * centre.z;
        let z = vec3<f32>(u.z, v.z, motion.z);
        let columns = volume(vec3<f32>(on_u.x, on_v.x, on_m.x), z, disc, centre.z, reference.x);
        let rows = volume(vec3<f32>(on_u.y, on_v.y, on_m.y), z, disc, centre.z, reference.y);
        across = vec2<f32>(max(across.x, columns.x), min(across.y, columns.y));
        down = vec2<f32>(max(down.x, rows.x), min(down.y, rows.y));
    }
    return Boxes(begin, end, across, down);
}

// Writes an ordinary kernel that the boxes bound.
fn write_bounded(slot: u32, posed: SweptSplat, boxes: Boxes) {
    let across = pixels_in(boxes.across, view.pixels.xy);
    let down = pixels_in(boxes.down, view.pixels.zw);
    if !(across.x <= across.y && down.x <= down.y) { return; }
    var splat = posed;
    let begin = boxes.begin;
    let end = boxes.end;
    splat.ends = array<array<f32, 4>, 2>(
        array<f32, 4>(begin.x, begin.y, begin.z, begin.w),
        array<f32, 4>(end.x, end.y, end.z, end.w),
    );
    write(slot, splat, bounds_of(across, down));
}

fn crosses(depth: f32, reach2: f32) -> bool {
    return depth <= 0.0 || reach2 - depth * depth > -1e-3 * depth * depth;
}

fn faces(det: f32) -> bool {
    return det < 0.0 || ((segment.flags & 1u) != 0u && det > 0.0);
}

// Boxes around the part of a kernel beyond `near`. They are bounded where the kernel has such a part and all numbers
// are finite.
struct Clipped {
    begin: vec4<f32>,
    end: vec4<f32>,
    bounded: bool,
}

// The boxes of both ends. Where an end comes nearer than `near`, its box holds the places at which the kernel passes
// `near`. `disc` is the radius of the low-pass disc in space. A tube lies within the hull of the parallelograms around
// its ends.
fn clipped(centre: vec3<f32>, motion: vec3<f32>, u: vec3<f32>, v: vec3<f32>, disc: f32) -> Clipped {
    var corners: array<vec3<f32>, 16>;
    for (var i = 0u; i < 2u; i += 1u) {
        let at = select(centre - motion, centre + motion, i == 1u);
        corners[8u * i] = at + u + v;
        corners[8u * i + 1u] = at + u - v;
        corners[8u * i + 2u] = at - u + v;
        corners[8u * i + 3u] = at - u - v;
        corners[8u * i + 4u] = vec3<f32>(at.x + disc, at.y + disc, at.z);
        corners[8u * i + 5u] = vec3<f32>(at.x + disc, at.y - disc, at.z);
        corners[8u * i + 6u] = vec3<f32>(at.x - disc, at.y + disc, at.z);
        corners[8u * i + 7u] = vec3<f32>(at.x - disc, at.y - disc, at.z);
    }
    var boxes = array<vec4<f32>, 2>(vec4<f32>(NONE, -NONE, NONE, -NONE), vec4<f32>(NONE, -NONE, NONE, -NONE));
    for (var i = 0u; i < 16u; i += 1u) {
        let p = corners[i];
        let side = i / 8u;
        if p.z >= view.near {
            boxes[side] = widened(boxes[side], p.xy / p.z);
            continue;
        }
        for (var j = 0u; j < 16u; j += 1u) {
            let q = corners[j];
            if q.z >= view.near {
                let t = (view.near - p.z) / (q.z - p.z);
                boxes[side] = widened(boxes[side], (p.xy + (q.xy - p.xy) * t) / view.near);
            }
        }
    }
    let origin = view.axis - view.offset;
    var out: Clipped;
    out.begin = with_margin(origin, boxes[0]);
    out.end = with_margin(origin, boxes[1]);
    out.bounded = boxes[0].x <= boxes[0].y && boxes[1].x <= boxes[1].y && within_reach(out.begin)
        && within_reach(out.end);
    return out;
}

fn with_margin(origin: vec2<f32>, box: vec4<f32>) -> vec4<f32> {
    let low = box.xz - SLACK_SHARE * abs(box.xz);
    let high = box.yw + SLACK_SHARE * abs(box.yw);
    return vec4<f32>(
        index_range(origin.x, vec2<f32>(low.x, high.x)),
        index_range(origin.y, vec2<f32>(low.y, high.y)),
    );
}

// Boxes wider than that would be too coarse to number pixels.
const REACH: f32 = 1e9;

fn within_reach(box: vec4<f32>) -> bool {
    return all(abs(box) <= vec4<f32>(REACH));
}

// Writes a kernel that reaches the camera plane. Pixels are counted from the camera's axis. Where its boxes are not
// bounded, it has the whole image.
fn write_crossing(slot: u32, posed: SweptSplat, centre: vec3<f32>, motion: vec3<f32>, u: vec3<f32>, v: vec3<f32>) {
    let normal = cross(u, v);
    let det = normal.x * centre.x + normal.y * centre.y + normal.z * centre.z;
    let turned = det * segment.handedness;
    let over = 1.0 / det;
    if !(faces(turned) && finite(over)) { return; }
    let origin = view.axis - view.offset;
    let begin = Disc(centre - motion, u, v);
    let end = Disc(centre + motion, u, v);
    if both_outside(begin, end, origin.x, view.pixels.xy, vec2<f32>(1.0, 0.0)) { return; }
    if both_outside(begin, end, origin.y, view.pixels.zw, vec2<f32>(0.0, 1.0)) { return; }
    var splat = posed;
    splat.reference = origin;
    splat.inverse_depth = form(normal * over);
    splat.u = form(cross(v, centre) * over);
    splat.v = form(cross(centre, u) * over);
    splat.u_rate = form(cross(v, motion) * over);
    splat.v_rate = form(cross(motion, u) * over);
    splat.motion = form(motion);
    splat.flags = (segment.index << SEGMENT_SHIFT) | select(FLAG_BACK, 0u, turned < 0.0);
    let shown = clipped(centre, motion, u, v, 0.0);
    if !shown.bounded {
        splat.flags |= FLAG_CROSSING;
        write(slot, splat, vec4<u32>(view.pixels - view.corner.xxyy));
        return;
    }
    splat.ends = array<array<f32, 4>, 2>(
        array<f32, 4>(shown.begin.x, shown.begin.y, shown.begin.z, shown.begin.w),
        array<f32, 4>(shown.end.x, shown.end.y, shown.end.z, shown.end.w),
    );
    let across = vec2<f32>(min(shown.begin.x, shown.end.x), max(shown.begin.y, shown.end.y));
    let down = vec2<f32>(min(shown.begin.z, shown.end.z), max(shown.begin.w, shown.end.w));
    let columns = pixels_in(across, view.pixels.xy);
    let rows = pixels_in(down, view.pixels.zw);
    if columns.x <= columns.y && rows.x <= rows.y { write(slot, splat, bounds_of(columns, rows)); }
}

fn form(v: vec3<f32>) -> array<f32, 3> {
    return array<f32, 3>(v.x, v.y, v.z);
}

fn write(slot: u32, posed: SweptSplat, bounds: vec4<u32>) {
    var splat = posed;
    splat.bounds = pack(bounds);
    splats[slot] = splat;
    touched[slot] = tiles_in(bounds);
}

// Pixel columns and rows between which the kernel and its low-pass disc lie when the kernel's centre is `centre`.
fn box(centre: vec3<f32>, u: vec3<f32>, v: vec3<f32>, low_pass: f32) -> vec4<f32> {
    let inverse = 1.0 / centre.z;
    let d22 = u.z * u.z + v.z * v.z - centre.z * centre.z;
    let inverse22 = 1.0 / d22;
    let at = centre.xy * inverse;
    let a = u.xy - at * u.z;
    let b = v.xy - at * v.z;
    let d00 = a * a + b * b;
    let d02 = a * u.z + b * v.z;
    let origin = view.axis + at - view.offset;
    let columns = index_range(origin.x, extent(d00.x, d02.x, inverse22, low_pass));
    let rows = index_range(origin.y, extent(d00.y, d02.y, inverse22, low_pass));
    return vec4<f32>(columns, rows);
}

// Pixels along one axis between which the ellipsoid and the disc's own ellipsoid lie. `along` has that axis of u, v and
// motion; `z` has their depth.
fn volume(along: vec3<f32>, z: vec3<f32>, disc: f32, depth: f32, reference: f32) -> vec2<f32> {
    let d22 = z.x * z.x + z.y * z.y + z.z * z.z - depth * depth;
    let disc22 = z.z * z.z - depth * depth;
    let d00 = along.x * along.x + along.y * along.y + along.z * along.z;
    let d02 = along.x * z.x + along.y * z.y + along.z * z.z;
    let body = extent(d00, d02, 1.0 / d22, 0.0);
    let wide = extent(disc * disc + along.z * along.z, along.z * z.z, 1.0 / disc22, 0.0);
    return index_range(reference, vec2<f32>(min(body.x, wide.x), max(body.y, wide.y)));
}

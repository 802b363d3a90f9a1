// Includes: common/types common/views common/work common/fast common/unshadowed common/wanted common/bounds
// Includes: common/gaussian common/land transparent/colour
// Pass `project` of Gaussians (program `gaussian_project`): posed, projected, widened by the filter, bounded and
// culled; and the depths by which they are sorted.
// Twins: src/backend/cpu/transparent/project.rs; key_of of sorted.rs.
// Math: docs/math.md, sections 11 and 12.
//   in   segments, lights
//        geometry    columns: positions, standard deviations, rotations (x, y, z, w), opacities
//        looks       columns: colours from all sides; the harmonics of each Gaussian; then normals where it has them
//   out  gaussians   one for each slot; those that touch nothing have bounds that say so
//        keys, list  depths as integers of the same order, and the slots themselves
// One invocation per Gaussian of a segment.

@group(1) @binding(0) var<storage, read> geometry: array<f32>;
@group(1) @binding(9) var<storage, read_write> keys: array<u32>;
@group(1) @binding(10) var<storage, read_write> list: array<u32>;
@group(1) @binding(32) var<storage, read_write> gaussians: array<DeviceGaussian>;

// Are velocities wanted?
override VELOCITY: bool = false;

// log2 of the largest optical depth of a kernel, in powers of 1/2.
const MOST_DEPTH: f32 = 40.0;
// The largest number of a layer, less 1: the last float below 2^32.
const MOST_LAYER: f32 = 4294967040.0;

// 0.5 / ln(2).
const HALF_LOG2_E: f32 = 0.72134752;

@compute @workgroup_size(256)
fn gaussian_project(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = work_of(group.x);
    segment = segments[item.x];
    let index = 256u * item.y + lane;
    if index >= segment.count { return; }
    view = views[segment.view];
    let slot = segment.first_slot + index;
    let at = 3u * index;
    let position = vec3<f32>(geometry[at], geometry[at + 1u], geometry[at + 2u]);
    var centre = apply(segment.screen, position);
    var lands = NO_LANDING;
    if reads_out() {
        centre = apply(segment.centre, position);
        let motion = apply(segment.motion, position);
        lands = landing(centre, motion);
        centre += lands.time * motion;
    }
    var splat = projected(index, position, centre, lands);
    if unpack(splat.bounds).x <= unpack(splat.bounds).y {
        if !is_shaded_volume() {
            let colour = colour_of(index, position);
            splat.colour = array<f32, 3>(colour.x, colour.y, colour.z);
        }
        if VELOCITY { splat.velocity = velocity_of(position); }
    }
    if (segment.flags & FLAG_VOLUME) != 0u {
        splat.layer = 1u + u32(clamp(centre.z / segment.layer, 0.0, MOST_LAYER));
        if (segment.flags & FLAG_KEEP_LAYER) != 0u { splat.layer = gaussians[slot].layer; }
    }
    gaussians[slot] = splat;
    keys[slot] = key_of(centre.z);
    list[slot] = slot;
}

// A depth as an integer of the same order.
fn key_of(depth: f32) -> u32 {
    let bits = bitcast<u32>(depth);
    return select(~bits, bits | 0x80000000u, bits >> 31u == 0u);
}

// All but colour and velocity.
fn projected(i: u32, position: vec3<f32>, centre: vec3<f32>, lands: Landing) -> DeviceGaussian {
    let n = segment.count;
    let sigma_at = 3u * (n + i);
    let turn_at = 6u * n + 4u * i;
    let depth = centre.z;
    let over = 1.0 / depth;
    let x = centre.x * over;
    let y = centre.y * over;
    let jx = clamp(x, -segment.field.x, segment.field.x);
    let jy = clamp(y, -segment.field.y, segment.field.y);
    // The axes of the Gaussian in the model, one standard deviation long.
    let qx = geometry[turn_at];
    let qy = geometry[turn_at + 1u];
    let qz = geometry[turn_at + 2u];
    let qw = geometry[turn_at + 3u];
    let axis_x =
        vec3<f32>(1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qw * qz), 2.0 * (qx * qz - qw * qy));
    let axis_y =
        vec3<f32>(2.0 * (qx * qy - qw * qz), 1.0 - 2.0 * (qx * qx + qz * qz), 2.0 * (qy * qz + qw * qx));
    let axis_z =
        vec3<f32>(2.0 * (qx * qz + qw * qy), 2.0 * (qy * qz - qw * qx), 1.0 - 2.0 * (qx * qx + qy * qy));
    // The same on the screen, pixels.
    let first = on_screen(axis_x, lands.time, jx, jy, geometry[sigma_at] * over);
    let second = on_screen(axis_y, lands.time, jx, jy, geometry[sigma_at + 1u] * over);
    let third = on_screen(axis_z, lands.time, jx, jy, geometry[sigma_at + 2u] * over);
    let u = vec3<f32>(first.x, second.x, third.x);
    let v = vec3<f32>(first.y, second.y, third.y);
    let e = vec3<f32>(first.z, second.z, third.z);
    let xx = u.x * u.x + u.y * u.y + u.z * u.z;
    let yy = v.x * v.x + v.y * v.y + v.z * v.z;
    var xy = u.x * v.x + u.y * v.y + u.z * v.z;
    // |V| as the square of a vector product: the difference of products would cancel for long thin splats.
    let c = vec3<f32>(u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x);
    let unfiltered = c.x * c.x + c.y * c.y + c.z * c.z;
    let dilation = segment.dilation;
    let determinant = unfiltered + dilation * (xx + yy) + dilation * dilation;
    var wide_xx = xx + dilation;
    var wide_yy = yy + dilation;
    var lost = 1.0;
    if (segment.flags & FLAG_ANTIALIAS) != 0u { lost = sqrt(unfiltered / determinant); }
    let is_volume = (segment.flags & FLAG_VOLUME) != 0u;
    // Zwicker et al. 2002, eq. 33: the integral of the kernel over the ray at its centre. A ray that leaves the axis is
    // longer than its depth.
    let inverse_focal2 = 1.0 / (view.focal * view.focal);
    let longer2 = 1.0 + (x * x + y * y) * inverse_focal2;
    let bend = bend_of(u, v, e, vec2<f32>(x, y), longer2, inverse_focal2);
    let integral = segment.area * sqrt(longer2) * (over * over) / sqrt(determinant) * bend.mass;
    let opacity = geometry[10u * n + i] * segment.opacity * select(lost, integral, is_volume);
    let solid = select(opacity * 255.0 > 1.0, opacity >= LEAST_NORMAL, is_volume);
    var peak = log_of_two(select(1.0, opacity, solid));
    var faintest = LOG2_FAINTEST;
    var shift = vec2<f32>(0.0);
    if is_volume {
        let kept = 1.0 - power_of_two(least_power(peak) - peak);
        // Nothing gets through more.
        peak = min(peak - log_of_two(kept), MOST_DEPTH);
        faintest = -least_power(peak);
        shift = bend.shift;
    }
    var area = determinant;
    if reads_out() {
        // Rows beside the centre's see it displaced, as the filter has widened it.
        let seen = spread(lands, vec3<f32>(wide_xx, xy, wide_yy));
        wide_xx = seen.x;
        xy = seen.y;
        wide_yy = seen.z;
        area *= lands.along * lands.along;
    }
    if reads_out() { shift += lands.shift; }
    let over_xx = 1.0 / wide_xx;
    let reach = (peak + faintest) * (1.0 / HALF_LOG2_E);
    let reach_x = sqrt(reach * wide_xx);
    let reach_y = sqrt(reach * wide_yy);

    var out: DeviceGaussian;
    out.reference = view.axis + vec2<f32>(x, y) + shift;
    out.along = HALF_LOG2_E * over_xx;
    out.slope = xy * over_xx;
    out.across = HALF_LOG2_E * wide_xx / area;
    out.peak = peak;
    out.depth = depth;
    out.index = segment.first_index + i;
    out.bounds = pack(vec4<u32>(1u, 0u, 1u, 0u));
    let inside = all(position >= segment.low.xyz) && all(position <= segment.high.xyz);
    let sane = all_finite(vec3<f32>(out.reference, determinant)) && finite(depth) && determinant > 0.0;
    if !(sane && solid && inside && depth >= segment.near) { return out; }
    let across = vec2<f32>(-reach_x, reach_x) - view.offset.x;
    let down = vec2<f32>(-reach_y, reach_y) - view.offset.y;
    let columns = pixels_in(index_range(out.reference.x, across), view.pixels.xy);
    let rows = pixels_in(index_range(out.reference.y, down), view.pixels.zw);
    if columns.x <= columns.y && rows.x <= rows.y { out.bounds = pack(bounds_of(columns, rows)); }
    return out;
}

// An axis of a Gaussian on the screen, by the derivative of the projection at (jx, jy), and its depth over that of the
// centre; `scale`: its length over the depth. `time`: when it lands on a strip.
fn on_screen(axis: vec3<f32>, time: f32, jx: f32, jy: f32, scale: f32) -> vec3<f32> {
    var posed = apply_linear(segment.screen, axis);
    if reads_out() { posed += time * apply_linear(segment.motion, axis); }
    return vec3<f32>((posed.x - jx * posed.z) * scale, (posed.y - jy * posed.z) * scale, posed.z * scale);
}

// The least positive float that every device holds.
const LEAST_NORMAL: f32 = 1.17549435e-38;

// What the affine image of a kernel misses of perspective, to second order in the angle at which the eye sees it
// (docs/math.md, section 12).
struct Bend {
    // Factor on the integral over the screen.
    mass: f32,
    // Shift of the mean place on the screen, pixels.
    shift: vec2<f32>,
}

// Most that the factor differs from 1: beyond, the series says nothing.
const MOST_BEND: f32 = 0.5;

// `u`, `v`: the image of the axes, pixels; `e`: their depths over that of the centre, which is at `place`. `longer2`:
// square of the length of the ray over its depth.
fn bend_of(
    u: vec3<f32>, v: vec3<f32>, e: vec3<f32>, place: vec2<f32>, longer2: f32, inverse_focal2: f32,
) -> Bend {
    let over = inverse_focal2 / longer2;
    var mass = 0.0;
    var shift = vec2<f32>(0.0);
    for (var k = 0u; k < 3u; k += 1u) {
        // Along the ray, over its length.
        let across = (u[k] * place.x + v[k] * place.y) * over;
        let along = across + e[k];
        let px = u[k] + place.x * e[k];
        let py = v[k] + place.y * e[k];
        let length2 = (px * px + py * py) * over + e[k] * e[k] / longer2;
        mass += 0.5 * (length2 - along * along - 6.0 * along * e[k] + 12.0 * e[k] * e[k]);
        shift.x += u[k] * (across - 3.0 * e[k]);
        shift.y += v[k] * (across - 3.0 * e[k]);
    }
    let size = abs(mass);
    let trust = select(1.0, MOST_BEND / size, size > MOST_BEND);
    return Bend(1.0 + mass * trust, shift * trust);
}

// Screen velocity of a centre: the derivative of (x, y) = (X, Y) / depth.
// A strip that is read out has that of its middle, as surfels have.
fn velocity_of(position: vec3<f32>) -> vec2<f32> {
    let centre = apply(segment.screen, position);
    let rate = apply(segment.rate, position);
    let over = 1.0 / centre.z;
    let x = (rate.x - centre.x * over * rate.z) * over;
    let y = (rate.y - centre.y * over * rate.z) * over;
    return vec2<f32>(x, y) * view.stride;
}

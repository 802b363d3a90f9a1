// Includes: common/types common/views common/work common/segment common/wanted common/bounds common/swept
// Includes: common/swept_filter common/paths common/moving
// Pass `project` of kernels in motion (program `sweep`): makes kernels of surfels over an interval, and the same
// convolved with the low-pass filter of the sample grid; projects, bounds and culls them. What it reads and writes:
// common/moving.wgsl.
// Twins: src/backend/cpu/swept/filter.rs and project.rs.  Math: docs/math.md, section 7.
// One invocation per surfel. Behind the axes v, `geometry` has a column of the normalisation of kernels, and then its
// mean.

// A filtered kernel: its axes, and the same sheared so that the centre's ray is the axis.
struct Wide {
    u: vec3<f32>,
    v: vec3<f32>,
    sheared_u: vec3<f32>,
    sheared_v: vec3<f32>,
    peak: f32,
}

@compute @workgroup_size(256)
fn sweep(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = surfel_of(group.x, lane);
    if index >= segment.surfels { return; }
    view = views[segment.view];
    let slot = segment.first_slot + index;
    touched[slot] = 0u;
    var kernel = moving(index);
    let columns = segment.columns;
    let factor = geometry[columns * segment.buffer_surfels + segment.first_surfel + index];
    let mean = geometry[(columns + 1u) * segment.buffer_surfels];
    // The kernel without a filter: its disc.
    kernel.splat.filtered.peak = 1.0;
    kernel.splat.filtered.weight = mean;
    kernel.splat.filtered.coverage = 0.0;
    if kernel.kind == CROSSING {
        write_crossing(slot, kernel.splat, kernel.centre, kernel.motion, kernel.u, kernel.v);
    }
    if kernel.kind != ORDINARY { return; }
    let own = boxes_of(kernel, kernel.u, kernel.v, 0.0);
    if view.sigma == 0.0 {
        write_bounded(slot, kernel.splat, own);
        return;
    }
    let wide = widened_by_filter(kernel);
    let motion = vec3<f32>(kernel.splat.motion[0], kernel.splat.motion[1], kernel.splat.motion[2]);
    let forms = forms_of(wide.sheared_u, wide.sheared_v, motion, 1.0 / kernel.centre.z);
    var out: SweptFilter;
    out.inverse_depth = array<f32, 2>(forms.inverse_depth[0], forms.inverse_depth[1]);
    out.u = array<f32, 2>(forms.u[0], forms.u[1]);
    out.v = array<f32, 2>(forms.v[0], forms.v[1]);
    out.u_rate = forms.u_rate;
    out.v_rate = forms.v_rate;
    out.k = forms.inverse_depth[0] * motion.x + forms.inverse_depth[1] * motion.y + forms.inverse_depth[2] * motion.z;
    out.peak = wide.peak;
    // The narrower the filter is beside the kernel, the more all kernels of a model count alike.
    out.weight = wide.peak * (factor + wide.peak * (mean - factor));
    out.coverage = wide.peak * factor;
    kernel.splat.filtered = out;
    let filtered = boxes_of(kernel, wide.u, wide.v, 0.0);
    let boxes = Boxes(
        about(own.begin, filtered.begin),
        about(own.end, filtered.end),
        vec2<f32>(min(own.across.x, filtered.across.x), max(own.across.y, filtered.across.y)),
        vec2<f32>(min(own.down.x, filtered.down.x), max(own.down.y, filtered.down.y)),
    );
    write_bounded(slot, kernel.splat, boxes);
}

// The box about two boxes.
fn about(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(min(a.x, b.x), max(a.y, b.y), min(a.z, b.z), max(a.w, b.w));
}

// Filters an ordinary kernel.
fn widened_by_filter(kernel: Moving) -> Wide {
    let u = kernel.u;
    let v = kernel.v;
    let depth = kernel.centre.z;
    let inverse = 1.0 / depth;
    let x = kernel.centre.x * inverse;
    let y = kernel.centre.y * inverse;
    // J, pixels a unit of u and of v.
    let jux = (u.x - x * u.z) * inverse;
    let juy = (u.y - y * u.z) * inverse;
    let jvx = (v.x - x * v.z) * inverse;
    let jvy = (v.y - y * v.z) * inverse;
    let variance = view.sigma * view.sigma;
    let xx = 0.25 * (jux * jux + jvx * jvx) + variance;
    let xy = 0.25 * (jux * juy + jvx * jvy);
    let yy = 0.25 * (juy * juy + jvy * jvy) + variance;
    // |V'| from sums of squares alone, so that nothing cancels: |V| + sigma^2 tr V + sigma^4.
    let area = 0.25 * (jux * jvy - juy * jvx);
    let det = area * area + variance * (xx + yy - variance);
    // J' = ((l0, 0), (l1, l2)).
    let l0 = 2.0 * sqrt(xx);
    let over0 = 1.0 / l0;
    let l1 = 4.0 * xy * over0;
    let l2 = 4.0 * sqrt(det) * over0;
    // The depths of its axes, J'^-1 J a, where a holds those of the disc's.
    let sx = jux * u.z + jvx * v.z;
    let sy = juy * u.z + jvy * v.z;
    let uz = sx * over0;
    let vz = (sy - l1 * uz) / l2;
    var out: Wide;
    out.sheared_u = vec3<f32>(l0 * depth, l1 * depth, uz);
    out.sheared_v = vec3<f32>(0.0, l2 * depth, vz);
    out.u = vec3<f32>(out.sheared_u.x + x * uz, out.sheared_u.y + y * uz, uz);
    out.v = vec3<f32>(out.sheared_v.x + x * vz, out.sheared_v.y + y * vz, vz);
    out.peak = sqrt(area * area / det);
    return out;
}

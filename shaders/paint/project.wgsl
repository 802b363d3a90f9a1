// Includes: common/types common/views common/work common/segment common/fast common/wanted common/bounds common/paths
// Includes: common/land common/posed common/hit common/depths paint/kernel
// Pass `project`: turns surfels into splats; poses, projects, bounds and culls them, and convolves each with the
// low-pass filter of the sample grid where there is one.
// Twins: src/backend/cpu/project.rs, paint/project.rs.  Math: docs/math.md, sections 2 and 3.
//   in   segments  the surfels and their pose
//        geometry  columns of the surfel buffer: positions, axes u, axes v; with a filter normalisation, then the mean
//                  of the last
//   out  splats    one for each slot; unwritten where culled
//        touched   number of wanted tiles that the splat touches; 0 if culled; WIDE if more than WIDEST
// One invocation per surfel. The slot is the surfel's place in the batch, so nothing is compacted and the order stays.
// `view.pixels` are those of the band and of the apron around it, as far as the image goes.

@group(1) @binding(4) var<storage, read_write> splats: array<Kernel>;
@group(1) @binding(5) var<storage, read_write> touched: array<u32>;

@compute @workgroup_size(256)
fn project(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = surfel_of(group.x, lane);
    if index >= segment.surfels { return; }
    view = views[segment.view];
    let slot = segment.first_slot + index;
    touched[slot] = 0u;
    let surfel = posed(index, f32(apron()));
    if surfel.kind == CULLED { return; }
    var listed = surfel.bounds;
    var splat: EwaSplat;
    splat.disc = surfel.splat;
    splat.disc.bounds = pack(surfel.bounds);
    if FILTERED {
        // The twin lists splats beyond the band, too, and nobody reads those lists.
        let band = band_rows();
        let rows = vec2<i32>(surfel.bounds.zw);
        if rows.x > band.y || rows.y < band.x { return; }
        listed = vec4<u32>(surfel.bounds.xy, vec2<u32>(clamp(rows, band.xx, band.yy)));
        let columns = segment.columns;
        let factor = geometry[columns * segment.buffer_surfels + segment.first_surfel + index];
        let mean = geometry[(columns + 1u) * segment.buffer_surfels];
        splat.peak = 1.0;
        splat.weight = mean;
        splat.listed_bounds = pack(listed);
        splat.filtered_bounds = pack(surfel.bounds);
        splat.crossing = 1u;
        if surfel.splat.centre_depth > 0.0 && !filter_kernel(&splat, surfel, factor, mean, band) { return; }
    }
    splats[slot] = kernel_of(splat);
    touched[slot] = tiles_in(listed);
}

// First and last pixel row of the band.
fn band_rows() -> vec2<i32> {
    let first = i32(view.first_tile_row * TILE);
    return vec2<i32>(first, min(first + i32(view.tiles.y * TILE) - 1, view.pixels.w));
}

// Filters an ordinary splat. False where nothing is left of it.
fn filter_kernel(
    splat: ptr<function, EwaSplat>, surfel: Posed, factor: f32, mean: f32, band: vec2<i32>,
) -> bool {
    let u = surfel.u;
    let v = surfel.v;
    let depth = surfel.c.z;
    let inverse = 1.0 / depth;
    let ux = surfel.seen_u.x;
    let uy = surfel.seen_u.y;
    let vx = surfel.seen_v.x;
    let vy = surfel.seen_v.y;
    // J, pixels a unit of u and of v.
    let jux = ux * inverse;
    let juy = uy * inverse;
    let jvx = vx * inverse;
    let jvy = vy * inverse;
    let variance = view.sigma * view.sigma;
    let xx = 0.25 * (jux * jux + jvx * jvx) + variance;
    let xy = 0.25 * (jux * juy + jvx * jvy);
    let yy = 0.25 * (juy * juy + jvy * jvy) + variance;
    // |V'| from sums of squares alone, so that nothing cancels: |V| + sigma^2 tr V + sigma^4.
    let area = 0.25 * (jux * jvy - juy * jvx);
    let det = area * area + variance * (xx + yy - variance);
    let over = 1.0 / det;
    let p = vec3<f32>(yy * over, -xy * over, xx * over);
    let form_u = vec2<f32>(0.25 * (jux * p.x + juy * p.y), 0.25 * (jux * p.y + juy * p.z));
    let form_v = vec2<f32>(0.25 * (jvx * p.x + jvy * p.y), 0.25 * (jvx * p.y + jvy * p.z));
    let shrink = (u.z * form_u + v.z * form_v) * inverse;
    let peak = sqrt(area * area * over);
    if !(finite(peak) && peak > 0.0) { return false; }
    let d22 = u.z * u.z + v.z * v.z - depth * depth;
    let columns = extent(ux * ux + vx * vx, ux * u.z + vx * v.z, 1.0 / d22, 0.0);
    let rows = extent(uy * uy + vy * vy, uy * u.z + vy * v.z, 1.0 / d22, 0.0);
    let reference = surfel.splat.reference;
    (*splat).disc.bounds = pixels_of(reference, columns, rows, view.pixels);
    (*splat).u = form_u;
    (*splat).v = form_v;
    (*splat).shrink = shrink;
    (*splat).p = array<f32, 3>(p.x, p.y, p.z);
    (*splat).peak = peak;
    // The narrower the filter is beside the kernel, the more all kernels of a model count alike.
    (*splat).weight = peak * (factor + peak * (mean - factor));
    let filtered_columns = filtered_extent(columns, 4.0 * xx);
    let filtered_rows = filtered_extent(rows, 4.0 * yy);
    (*splat).filtered_bounds = pixels_of(reference, filtered_columns, filtered_rows, vec4<i32>(view.pixels.xy, band));
    (*splat).crossing = 0u;
    return true;
}

// The ends of the filtered kernel along one axis, from the ends of its disc. `affine`: the square of its extent without
// perspective (docs/math.md, section 3).
fn filtered_extent(ends: vec2<f32>, affine: f32) -> vec2<f32> {
    let reach = 2.0 * view.sigma;
    let disc = vec2<f32>(-ends.x, ends.y);
    let extent = min(sqrt(max(disc * disc + reach * reach, vec2<f32>(affine))), disc + reach);
    return vec2<f32>(-extent.x, extent.y);
}

// The pixels of `wanted` that the ends may touch; none where the first is after the last.
fn pixels_of(reference: vec2<f32>, columns: vec2<f32>, rows: vec2<f32>, wanted: vec4<i32>) -> vec2<u32> {
    let across = pixels_in(index_range(reference.x, columns), wanted.xy);
    let down = pixels_in(index_range(reference.y, rows), wanted.zw);
    if across.x <= across.y && down.x <= down.y { return pack(bounds_of(across, down)); }
    return pack(vec4<u32>(1u, 0u, 1u, 0u));
}

// Includes: shadows/posed common/chance common/fast
// Gaussians of captures and volumes as casters: discs, drawn by chance.
// Twin: Cast::disc of src/backend/cpu/shadows/splats.rs.  Math: docs/math.md, section 17.
//   in   segments  of Gaussians; `first_surfel` is the number of their object
//        geometry  columns: positions, standard deviations, rotations (x, y, z, w), opacities

// Least and greatest alpha of a Gaussian of a capture that counts.
const LEAST_ALPHA: f32 = 0.003921569;
const MOST_ALPHA: f32 = 0.99;
const TAU: f32 = 6.2831853;
const LOG2_E: f32 = 1.442695;

// The disc of Gaussian `index` of the segment before light `light`; without any axes where none is drawn.
fn splat_of(index: u32, light: u32, of_light: LightView) -> Disc {
    let nothing = Disc(vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0));
    let at = 3u * index;
    let position = column_of(at, 0u);
    // The corners of the crop box.
    if any(position < segment.rate[0].xyz) || any(position > segment.rate[1].xyz) { return nothing; }
    let sigma = column_of(at, 3u);
    let turn_at = 6u * segment.buffer_surfels + 4u * index;
    let q = vec4<f32>(geometry[turn_at], geometry[turn_at + 1u], geometry[turn_at + 2u], geometry[turn_at + 3u]);
    let own = geometry[10u * segment.buffer_surfels + index];
    let centre = apply(segment.world, position);
    let first = vec3<f32>(
        1.0 - 2.0 * (q.y * q.y + q.z * q.z), 2.0 * (q.x * q.y + q.w * q.z), 2.0 * (q.x * q.z - q.w * q.y),
    );
    let second = vec3<f32>(
        2.0 * (q.x * q.y - q.w * q.z), 1.0 - 2.0 * (q.x * q.x + q.z * q.z), 2.0 * (q.y * q.z + q.w * q.x),
    );
    let third = vec3<f32>(
        2.0 * (q.x * q.z + q.w * q.y), 2.0 * (q.y * q.z - q.w * q.x), 1.0 - 2.0 * (q.x * q.x + q.y * q.y),
    );
    let axes = array<vec3<f32>, 3>(
        apply_linear(segment.world, first) * sigma.x,
        apply_linear(segment.world, second) * sigma.y,
        apply_linear(segment.world, third) * sigma.z,
    );
    var along = of_light.along;
    if of_light.is_point {
        let c = centre - of_light.origin;
        along = c / sqrt(dot3(c, c));
    }
    // Two axes across the rays (Duff et al. 2017).
    let turned_z = select(1.0, -1.0, (bitcast<u32>(along.z) >> 31u) == 1u);
    let a = -1.0 / (turned_z + along.z);
    let b = along.x * along.y * a;
    let right = vec3<f32>(1.0 + turned_z * along.x * along.x * a, turned_z * b, -turned_z * along.x);
    let up = vec3<f32>(b, turned_z + along.y * along.y * a, -along.y);
    let x = vec3<f32>(dot3(axes[0], right), dot3(axes[1], right), dot3(axes[2], right));
    let y = vec3<f32>(dot3(axes[0], up), dot3(axes[1], up), dot3(axes[2], up));
    let xx = dot3(x, x);
    let xy = dot3(x, y);
    // The square of a vector product: the difference of products would cancel for long thin ones.
    let across = cross(x, y);
    let area = sqrt(dot3(across, across));
    let object = segment.first_surfel;
    let seed = mixed(u32(lights[slice_at(light, 0u, 0u)].colour.w) ^ mixed(object));
    let drawn = chance(segment.first_light, mixed(segment.buffer_start + index) ^ seed);
    let opacity = own * segment.normal[0].w;
    var radius = 0.0;
    if (segment.flags & IS_VOLUME) == 0u {
        let least = max(drawn, LEAST_ALPHA);
        if drawn < MOST_ALPHA && opacity > least { radius = radius_of(opacity / least); }
    } else {
        // Its volume over that in the model.
        let depth = opacity * segment.normal[1].w / (TAU * area);
        let least = log_of_two(1.0 - drawn) / -LOG2_E;
        if depth > least && least > 0.0 { radius = radius_of(depth / least); }
    }
    if !(radius > 0.0) { return nothing; }
    let root = sqrt(xx);
    let u = (right * root + up * (xy / root)) * radius;
    let v = up * (area / root * radius);
    if !(all_finite(centre) && all_finite(u) && all_finite(v)) { return nothing; }
    return Disc(centre, u, v);
}

// The distance from its peak at which a Gaussian is lower by a factor, in standard deviations.
fn radius_of(factor: f32) -> f32 {
    return sqrt(log_of_two(factor) * (2.0 / LOG2_E));
}

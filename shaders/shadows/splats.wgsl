// Includes: shadows/posed common/chance common/fast
// Gaussians of captures and volumes as casters: discs, drawn by chance.
// Twin: Cast::disc of src/backend/cpu/shadows/splats.rs.  Math: docs/math.md, section 17.
//   in   segments  of Gaussians; `first_surfel` is the number of their object
//        geometry  columns: positions, standard deviations, rotations (x, y, z, w), opacities

// Least and greatest alpha of a Gaussian of a capture that counts.
const LEAST_ALPHA: f32 = 0.003921569;
const MOST_ALPHA: f32 = 0.99;
// Least share of a kernel before or behind the place where it stops light.
const LEAST_TAIL: f32 = 1e-6;
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
    var along = of_light.along;
    if of_light.is_point {
        let c = centre - of_light.origin;
        along = c / sqrt(dot3(c, c));
    }
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
    let normal = cross(x, y);
    let area = sqrt(dot3(normal, normal));
    let root = sqrt(xx);
    var u = right * root + up * (xy / root);
    var v = up * (area / root);
    var stopped_at = centre;
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
        // On rays beside the centre the kernel has its middle nearer or farther.
        let seen = vec3<f32>(dot3(axes[0], along), dot3(axes[1], along), dot3(axes[2], along));
        u += along * (dot3(seen, x) / root);
        v += along * (dot3(seen, cross(normal, x)) / (area * root));
        let place = deviations(depth, chance(segment.first_light, mixed(~(segment.buffer_start + index)) ^ seed));
        stopped_at += along * (place * abs(dot3(cross(axes[0], axes[1]), axes[2])) / area);
        let least = log_of_two(1.0 - drawn) / -LOG2_E;
        if depth > least && least > 0.0 { radius = radius_of(depth / least); }
    }
    if !(radius > 0.0) { return nothing; }
    u *= radius;
    v *= radius;
    if !(all_finite(stopped_at) && all_finite(u) && all_finite(v)) { return nothing; }
    return Disc(stopped_at, u, v);
}

// The distance from its peak at which a Gaussian is lower by a factor, in standard deviations.
fn radius_of(factor: f32) -> f32 {
    return sqrt(log_of_two(factor) * (2.0 / LOG2_E));
}

// Where a kernel of this optical depth stops light that it does stop, in standard deviations from its middle on the
// ray. `drawn`: the share of that light that it stops before. Twin: deviations of src/backend/cpu/shadows/splats.rs.
fn deviations(depth: f32, drawn: f32) -> f32 {
    let stopped = 1.0 - power_of_two(-LOG2_E * depth);
    let passed = log_of_two(1.0 - drawn * stopped) / (-LOG2_E * depth);
    let tail = max(min(passed, 1.0 - passed), LEAST_TAIL);
    // Abramowitz and Stegun, 26.2.23.
    let t = sqrt(log_of_two(tail) * (-2.0 / LOG2_E));
    let below = (2.515517 + t * (0.802853 + t * 0.010328)) / (1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
    return select(t - below, below - t, passed < 0.5);
}

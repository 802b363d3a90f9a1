// Where a segment's surfels are that move by themselves.
// Twin: src/model/paths.rs.  Math: docs/math.md, section 1.
//   in   segments  factors on the columns of the paths
//        geometry  columns of the surfel buffer: positions, axes u, axes v, velocities, accelerations, their changes
// `at` is where the surfel's position is in `geometry`.

fn column_of(at: u32, column: u32) -> vec3<f32> {
    let first = column * segment.buffer_surfels + at;
    return vec3<f32>(geometry[first], geometry[first + 1u], geometry[first + 2u]);
}

// The surfel's position, moved along its path.
fn placed(at: u32) -> vec3<f32> {
    var out = column_of(at, 0u);
    let columns = segment.columns;
    if columns > 9u { out += column_of(at, 9u) * segment.elapsed.x; }
    if columns > 12u { out += column_of(at, 12u) * segment.elapsed.y; }
    if columns > 15u { out += column_of(at, 15u) * segment.elapsed.z; }
    return out;
}

// The sum of the columns with these factors.
fn rates(at: u32, factors: vec4<f32>) -> vec3<f32> {
    var out = vec3<f32>(0.0);
    let columns = segment.columns;
    if columns > 9u { out += column_of(at, 9u) * factors.x; }
    if columns > 12u { out += column_of(at, 12u) * factors.y; }
    if columns > 15u { out += column_of(at, 15u) * factors.z; }
    return out;
}

// The velocity of its own, per unit of time of the paths.
fn own_velocity(at: u32) -> vec3<f32> {
    var out = vec3<f32>(0.0);
    let columns = segment.columns;
    if columns > 9u { out += column_of(at, 9u); }
    if columns > 12u { out += column_of(at, 12u) * segment.elapsed.x; }
    if columns > 15u { out += column_of(at, 15u) * segment.elapsed.y; }
    return out;
}

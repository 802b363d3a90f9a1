// Where a centre lands on a strip that a rolling shutter reads out row by row.
// Twin: src/backend/cpu/land.rs.  Math: docs/math.md, section 15.

// Least speed of rows over a centre, as a share of the read-out's. What keeps pace with the read-out would be seen by
// all rows.
const LEAST_SPEED: f32 = 1.0 / 256.0;

// What rows beside the one on which a centre lands see of it.
struct Landing {
    // When it lands: -1 at the first row of the strip, 1 at its last one; what lands beside the strip is posed at the
    // nearer of both.
    time: f32,
    // From its place at that time to where it lands, pixels, x and y.
    shift: vec2<f32>,
    // Factor on distances along the read-out.
    along: f32,
    // Displacement across the read-out, over that along it.
    across: f32,
    // Motion away from the eye from one row to the next, scene units.
    recede: f32,
}

const NO_LANDING: Landing = Landing(0.0, vec2<f32>(0.0), 1.0, 0.0, 0.0);

// Is the view a strip that is read out row by row, or column by column?
fn reads_out() -> bool {
    return view.strip != 0.0;
}

// A vector as its parts along the read-out and across it.
fn turned(v: vec2<f32>) -> vec2<f32> {
    return select(v.xy, v.yx, view.strip > 0.0);
}

// The landing of a centre (x, y, depth, in homogeneous pixel coordinates) with this motion from the middle to the last
// row.
fn landing(centre: vec3<f32>, motion: vec3<f32>) -> Landing {
    let half = abs(view.strip);
    let middle = half - turned(view.axis).x + turned(view.offset).x;
    let c = turned(centre.xy);
    let m = turned(motion.xy);
    // The row of time t is read out where the centre is then: a quadratic equation in t.
    let quadratic = -half * motion.z;
    let slowest = LEAST_SPEED * half * centre.z;
    var linear = m.x - middle * motion.z - half * centre.z;
    let sign = select(-1.0, 1.0, linear > 0.0);
    if !(abs(linear) > slowest) { linear = sign * slowest; }
    let constant = c.x - middle * centre.z;
    let square = linear * linear - 4.0 * quadratic * constant;
    let root = sqrt(max(square, 0.0));
    // Before the camera plane nothing lands.
    if !(centre.z - abs(motion.z) > 0.0) { return NO_LANDING; }
    let time = clamp(-2.0 * constant / (linear + sign * root), -1.0, 1.0);
    let inverse = 1.0 / (centre.z + time * motion.z);
    let place = (c + time * m) * inverse;
    let velocity = (m - place * motion.z) * inverse / half;
    var speed = 1.0 - velocity.x;
    if !(abs(speed) > LEAST_SPEED) { speed = select(LEAST_SPEED, -LEAST_SPEED, speed < 0.0); }
    let along = 1.0 / speed;
    let beside = place.x - (middle + time * half);
    let to_row = beside * along;
    let shift = turned(vec2<f32>(to_row - beside, velocity.y * to_row));
    return Landing(time, shift, along, velocity.y, motion.z / half);
}

// Displaces a vector on the screen as the rows beside see it.
fn displaced(landing: Landing, v: vec2<f32>) -> vec2<f32> {
    let own = turned(v);
    let along = landing.along * own.x;
    return turned(vec2<f32>(along, own.y + landing.across * along));
}

// The covariance (xx, xy, yy) of what is displaced so.
fn spread(landing: Landing, v: vec3<f32>) -> vec3<f32> {
    let rows = view.strip > 0.0;
    let own = select(v, v.zyx, rows);
    let xy = landing.along * own.y;
    let xx = landing.along * landing.along * own.x;
    let yy = own.z + landing.across * (2.0 * xy + landing.across * xx);
    let out = vec3<f32>(xx, xy + landing.across * xx, yy);
    return select(out, out.zyx, rows);
}

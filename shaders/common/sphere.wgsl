// Spheres as discs that face an eye.
// Twin: src/math/sphere.rs.  Math: docs/math.md, section 19.

// The disc of a sphere.
struct Outline {
    // Factor on the way from the eye to the sphere's centre that leads to that of the disc.
    nearer: f32,
    // Axes of the disc.
    u: vec3<f32>,
    v: vec3<f32>,
    // Radius of the sphere over the distance of its centre; from 1 on the eye is within it, and the rest means nothing.
    sine: f32,
}

// Vectors across a direction of length 1.
struct Across {
    u: vec3<f32>,
    v: vec3<f32>,
}

// Unit vectors with v x u = n (Duff et al. 2017).
fn across(n: vec3<f32>) -> Across {
    let turn = select(1.0, -1.0, n.z < 0.0);
    let a = -1.0 / (turn + n.z);
    let b = n.x * n.y * a;
    return Across(
        vec3<f32>(b, turn + n.y * n.y * a, -n.y), vec3<f32>(1.0 + turn * (n.x * n.x * a), turn * b, -(turn * n.x)),
    );
}

// The disc of a sphere about `c` as an eye at 0 sees it.
fn outline(c: vec3<f32>, radius: f32) -> Outline {
    let over = 1.0 / sqrt(c.x * c.x + c.y * c.y + c.z * c.z);
    let sine = radius * over;
    let cosine = sqrt(max(1.0 - sine * sine, 0.0));
    let axes = across(c * over);
    return Outline(cosine * cosine, axes.u * (radius * cosine), axes.v * (radius * cosine), sine);
}

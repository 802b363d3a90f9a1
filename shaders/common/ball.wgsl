// What pixels see of a sphere, whose splat is the disc that faces the eye.
// Twin: src/math/sphere.rs.  Math: docs/math.md, section 19.

// The height of a ball of radius 1 over places of its disc; 0 outside.
fn height(r2: Floats) -> Floats {
    return sqrt(select(Floats(0.0), 1.0 - r2, r2 < Floats(1.0)));
}

// Is a splat the disc of a sphere?
fn is_sphere(splat: Splat) -> bool {
    return splat.centre_depth < 0.0;
}

// Factor on the inverse depth of its plane.
fn bulge(splat: Splat, r2: Floats) -> Floats {
    return 1.0 - splat.centre_depth * height(r2);
}

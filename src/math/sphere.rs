//! Spheres as discs that face an eye (docs/math.md, section 19).
//!
//! The rays from an eye that touch a sphere do so in a circle. What is within it is what the eye sees of the sphere, so
//! a sphere has the outline of that disc, exactly and in perspective.

use glam::Vec3;

/// The disc of a sphere.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outline {
    /// Factor on the way from the eye to the sphere's centre that leads to that of the disc.
    pub nearer: f32,
    /// Radius of the disc.
    pub radius: f32,
    /// Radius of the sphere over the distance of its centre.
    pub sine: f32,
    /// Unit vectors across the direction.
    pub across: [[f32; 3]; 2],
}

/// The disc of a sphere about a place relative to the eye. It is not finite where the eye is within the sphere.
#[inline(always)]
pub(crate) fn outline([x, y, z]: [f32; 3], radius: f32) -> Outline {
    let over = 1.0 / (x * x + y * y + z * z).sqrt();
    let sine = radius * over;
    // Not a number within the sphere.
    let cosine = (1.0 - sine * sine).sqrt();
    Outline { nearer: cosine * cosine, radius: radius * cosine, sine, across: across([x * over, y * over, z * over]) }
}

/// Unit vectors u and v across a direction n of length 1: v x u = n (Duff et al. 2017, "Building an Orthonormal Basis,
/// Revisited", continuous except at z = 0).
#[inline(always)]
pub(crate) fn across([x, y, z]: [f32; 3]) -> [[f32; 3]; 2] {
    let sign = 1.0_f32.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [[b, sign + y * y * a, -y], [1.0 + sign * (x * x * a), sign * b, -(sign * x)]]
}

/// What a ray through the place (u, v) of the disc, with `r2` = u^2 + v^2, sees nearer than its plane: factor on the
/// inverse depth. It is 1 where `sine` is 0, as for a disc.
#[inline(always)]
pub(crate) fn bulge(sine: f32, r2: f32) -> f32 {
    1.0 + sine * height(r2)
}

/// The height of a ball of radius 1 over a place of its disc; 0 outside.
#[inline(always)]
pub(crate) fn height(r2: f32) -> f32 {
    (if r2 < 1.0 { 1.0 - r2 } else { 0.0 }).sqrt()
}

/// The normal of a sphere where a ray through (u, v) of its disc meets it, less the direction to the eye `-n`: the
/// parts along u and v, and along n.
#[inline(always)]
pub(crate) fn bend(sine: f32, u: f32, v: f32) -> [f32; 3] {
    let height = height(u * u + v * v);
    let over = 1.0 / (1.0 + sine * height);
    let cosine = (1.0 - sine * sine).sqrt();
    [cosine * u * over, cosine * v * over, (1.0 - sine) * (1.0 - height) * over]
}

/// A vector with these parts along two vectors across `n` and along `n`.
#[inline(always)]
pub(crate) fn along(parts: [f32; 3], [u, v]: [Vec3; 2], n: Vec3) -> Vec3 {
    u * parts[0] + v * parts[1] + n * parts[2]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Rays meet the sphere where the disc says: depth along the ray, and normal, beside the quadratic equation.
        #[test]
        fn discs_show_what_rays_meet(
            centre in prop::array::uniform3(-5.0_f32..5.0), share in 0.01_f32..0.95,
            angle in 0.0..std::f32::consts::TAU, r in 0.0_f32..0.999,
        ) {
            let c = Vec3::from(centre);
            prop_assume!(c.length() > 0.1);
            let radius = share * c.length();
            let disc = outline(centre, radius);
            let [du, dv] = disc.across.map(Vec3::from);
            let n = c.normalize();
            prop_assert!((dv.cross(du) - n).length() < 1e-5);
            let (sin, cos) = (libm::sinf(angle), libm::cosf(angle));
            let (u, v) = (r * cos, r * sin);
            let on_disc = c * disc.nearer + (du * u + dv * v) * disc.radius;
            let met = on_disc / bulge(disc.sine, u * u + v * v);
            let (o, d) = (c.as_dvec3(), on_disc.as_dvec3().normalize());
            let b = d.dot(o);
            let root = (b * b - o.length_squared() + f64::from(radius).powi(2)).max(0.0).sqrt();
            let truth = d * (b - root);
            // The worst of 2 million: 1.8e-5, where the eye nearly touches the sphere.
            prop_assert!((met.as_dvec3() - truth).length() < 2e-5 * truth.length().max(1.0));
            let normal = along(bend(disc.sine, u, v), [du, dv], n) - n;
            let wanted = (truth - o).normalize();
            // Near the outline a small step of the place is a large one of the height. The worst of 2 million: 5e-5.
            prop_assert!((normal.as_dvec3() - wanted).length() < 1e-3, "{normal} {wanted}");
        }
    }

    #[test]
    fn an_eye_within_sees_nothing() {
        assert!(!outline([0.0, 0.0, 1.0], 1.5).radius.is_finite());
    }
}

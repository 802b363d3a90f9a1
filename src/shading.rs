//! The shading equation, thesis 4.1.1 (Phong 1975), per light:
//!
//! I = ka c La + sum over lights of L (kd c max(n.l, 0) + ks max(r.v, 0)^shininess),  r = 2 (n.l) n - l
//!
//! Everything is relative to the eye, with world-space directions. Nothing is clamped.

use glam::Vec3;

use crate::math::fast;
use crate::model::Material;

/// A light as a shader sees it: relative to the eye, `f32`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShadingLight {
    /// From everywhere.
    Ambient {
        /// Radiance.
        colour: Vec3,
    },
    /// From infinitely far.
    Directional {
        /// Unit direction towards the light, world space.
        towards: Vec3,
        /// Radiance.
        colour: Vec3,
        /// Are there shadows in it?
        shadows: bool,
    },
    /// Falls off with 1/distance^2.
    Point {
        /// Position relative to the eye, world space.
        position: Vec3,
        /// Radiance at distance 1.
        colour: Vec3,
        /// Are there shadows in it?
        shadows: bool,
    },
    /// From all around, smooth and without shadows: it has no highlights.
    Harmonics {
        /// Factors on the nine polynomials of [`smooth_light`].
        terms: [Vec3; 9],
    },
}

impl ShadingLight {
    /// Are there shadows in it?
    pub const fn has_shadows(&self) -> bool {
        matches!(self, Self::Directional { shadows: true, .. } | Self::Point { shadows: true, .. })
    }
}

/// Luminance of a linear Rec.709 colour.
#[inline(always)]
pub fn luminance(colour: [f32; 3]) -> f32 {
    0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2]
}

/// Factors of the diffuse and of the specular term for a light from the unit direction `towards`, on a surface with
/// unit normal `n` seen along the unit direction `view` (from the surface to the eye): (max(n.l, 0), max(r.v,
/// 0)^shininess).
#[inline(always)]
pub fn lobes(n: [f32; 3], towards: [f32; 3], view: [f32; 3], shininess: f32) -> (f32, f32) {
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let nl = dot(n, towards);
    let rv = 2.0 * nl * dot(n, view) - dot(towards, view);
    (if nl > 0.0 { nl } else { 0.0 }, fast::pow(if rv > 0.0 { rv } else { 0.0 }, shininess))
}

/// What a white surface with unit normal `n` shows of light from all around (Ramamoorthi and Hanrahan 2001): factors
/// `terms` on 1, x, y, z, x y, y z, 2 x z, x^2 - z^2 and 2 y^2 - x^2 - z^2. Nine harmonics go below 0 opposite a small
/// light; that is taken for 0.
///
/// A shorter normal is the mean of several, and what it shows is nearly the mean of theirs.
#[inline(always)]
pub fn smooth_light(terms: &[Vec3; 9], n: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = n;
    let (xx, zz) = (x * x, z * z);
    let of_normal = [x, y, z, x * y, y * z, 2.0 * x * z, xx - zz, 2.0 * y * y - (xx + zz)];
    let mut sum = terms[0].to_array();
    for c in 0..3 {
        for k in 0..8 {
            sum[c] += terms[k + 1][c] * of_normal[k];
        }
        sum[c] = if sum[c] > 0.0 { sum[c] } else { 0.0 };
    }
    sum
}

/// The direction that a mirror with unit normal `n` shows to the unit direction `view` (from the surface to the eye):
/// 2 (n.v) n - v.
#[inline(always)]
pub fn mirrored(n: [f32; 3], view: [f32; 3]) -> [f32; 3] {
    let twice = 2.0 * (n[0] * view[0] + n[1] * view[1] + n[2] * view[2]);
    [twice * n[0] - view[0], twice * n[1] - view[1], twice * n[2] - view[2]]
}

/// Length of the normal that shades where the mean of unit normals has the squared length `length2`: 1 from .86 on,
/// where one surface curves or its normals are noisy, and that of the mean up to .72, where surfaces meet at a right
/// angle or sharper; linear between them. A higher range makes smooth models darker than the reference.
///
/// The diffuse term of the mean of two lit normals is the mean of their diffuse terms. A unit vector in the same
/// direction has a larger one.
#[inline(always)]
pub fn agreement(length2: f32) -> f32 {
    let length = length2.sqrt();
    let faded = 0.72 + 2.0 * (length - 0.72);
    let length = if length > 0.72 { faded } else { length };
    if length < 1.0 { length } else { 1.0 }
}

/// Unit direction and 1/distance^2 from a surface point to a point light, both relative to the eye.
///
/// At the light itself the direction is 0 and the factor large but finite.
#[inline(always)]
pub fn towards_point(light: [f32; 3], surface: [f32; 3]) -> ([f32; 3], f32) {
    let d = [light[0] - surface[0], light[1] - surface[1], light[2] - surface[2]];
    let d2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    let inverse = 1.0 / (if d2 > 1e-30 { d2 } else { 1e-30 });
    let s = inverse.sqrt();
    ([d[0] * s, d[1] * s, d[2] * s], inverse)
}

/// Shades one surface point: `colour` linear, `normal` unit, `position` relative to the eye (view = -position).
pub fn shade(lights: &[ShadingLight], material: &Material, colour: Vec3, normal: Vec3, position: Vec3) -> Vec3 {
    shade_by(lights, material, colour, normal, position, |_, _| 1.0)
}

/// The same where not all light may reach the point. `reaching`: the share of a light, in [0, 1], by its index and the
/// unit direction towards it.
pub fn shade_by(
    lights: &[ShadingLight],
    material: &Material,
    colour: Vec3,
    normal: Vec3,
    position: Vec3,
    reaching: impl Fn(usize, Vec3) -> f32,
) -> Vec3 {
    let view = (-position).normalize_or_zero().to_array();
    let mut out = Vec3::ZERO;
    for (number, light) in lights.iter().enumerate() {
        let (towards, radiance) = match *light {
            ShadingLight::Ambient { colour: la } => {
                out += material.ambient * colour * la;
                continue;
            }
            ShadingLight::Harmonics { terms } => {
                out += material.diffuse * colour * Vec3::from(smooth_light(&terms, normal.to_array()));
                continue;
            }
            ShadingLight::Directional { towards, colour, .. } => (towards.to_array(), colour),
            ShadingLight::Point { position: at, colour, .. } => {
                let (towards, falloff) = towards_point(at.to_array(), position.to_array());
                (towards, colour * falloff)
            }
        };
        let (diffuse, specular) = lobes(normal.to_array(), towards, view, material.shininess);
        let radiance = radiance * reaching(number, towards.into());
        out += radiance * (material.diffuse * diffuse * colour + material.specular * specular);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: Vec3 = Vec3::ONE;

    #[test]
    fn a_short_normal_shades_as_the_mean_of_two() {
        assert_eq!([1.0, 0.75, 0.5, 0.25, 0.0].map(agreement), [1.0, 1.0, 0.5_f32.sqrt(), 0.5, 0.0]);
        for i in 0..1000 {
            let (a, b) = (i as f32 / 1000.0, (i + 1) as f32 / 1000.0);
            assert!(agreement(a * a) <= agreement(b * b) && agreement(a * a) >= 0.999_999 * a);
        }
        // Two walls and a light between them: a unit normal would be brighter by sqrt 2.
        let (x, y) = (Vec3::X, Vec3::Y);
        let mean = 0.5 * (x + y);
        let light = (x + y).normalize().to_array();
        let diffuse = |n: Vec3| lobes(n.to_array(), light, [0.0, 0.0, 1.0], 1.0).0;
        let shaded = diffuse(mean.normalize() * agreement(mean.length_squared()));
        assert!((shaded - 0.5 * (diffuse(x) + diffuse(y))).abs() < 1e-6, "{shaded}");
    }

    fn directional(travel: Vec3) -> ShadingLight {
        ShadingLight::Directional { towards: -travel.normalize(), colour: WHITE, shadows: false }
    }

    #[test]
    fn ambient_one_shows_the_colour() {
        let m = Material { ambient: 1.0, diffuse: 0.0, specular: 0.0, shininess: 30.0 };
        let c = Vec3::new(0.2, 0.5, 0.7);
        assert_eq!(shade(&[ShadingLight::Ambient { colour: WHITE }], &m, c, Vec3::Y, -Vec3::Z), c);
    }

    #[test]
    fn diffuse_is_lamberts_cosine() {
        let m = Material { ambient: 0.0, diffuse: 0.5, specular: 0.0, shininess: 1.0 };
        for degrees in [0.0_f32, 30.0, 60.0, 89.0, 100.0] {
            let a = degrees.to_radians();
            let travel = Vec3::new(a.sin(), -a.cos(), 0.0);
            let got = shade(&[directional(travel)], &m, WHITE, Vec3::Y, -Vec3::Z);
            assert!((got - Vec3::splat(0.5 * a.cos().max(0.0))).length() < 1e-6, "{degrees}: {got}");
        }
    }

    #[test]
    fn mirror_direction_is_brightest() {
        let m = Material { ambient: 0.0, diffuse: 0.0, specular: 1.0, shininess: 20.0 };
        // Light comes down at 45 degrees along +x; the mirror direction leaves at 45 degrees along +x.
        let light = directional(Vec3::new(1.0, -1.0, 0.0));
        let seen_from = |view: Vec3| shade(&[light], &m, WHITE, Vec3::Y, -view.normalize()).x;
        assert!((seen_from(Vec3::new(1.0, 1.0, 0.0)) - 1.0).abs() < 1e-5);
        // 20 degrees off: cos(20 degrees)^20
        let a = 25.0_f32.to_radians();
        let off = seen_from(Vec3::new(a.sin(), a.cos(), 0.0));
        assert!((f64::from(off) - 20_f64.to_radians().cos().powi(20)).abs() < 1e-4, "{off}");
        assert!(seen_from(Vec3::new(-1.0, 1.0, 0.0)) < 1e-6);
    }

    #[test]
    fn point_lights_fall_off_with_the_square() {
        let m = Material { ambient: 0.0, diffuse: 1.0, specular: 0.0, shininess: 1.0 };
        let at = |height: f32| {
            let position = Vec3::new(0.0, 0.0, -3.0);
            let light = ShadingLight::Point { position: position + height * Vec3::Y, colour: WHITE, shadows: false };
            shade(&[light], &m, WHITE, Vec3::Y, position).x
        };
        assert!((at(1.0) - 1.0).abs() < 1e-6);
        assert!((at(2.0) - 0.25).abs() < 1e-6);
        assert!(at(0.0).is_finite());
    }
}

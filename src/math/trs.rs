//! Translate, rotate, scale: the transform of scene files and animations.

use glam::{DMat3, DMat4, DQuat, DVec3};

/// Order in which the three Euler rotations are applied (Maya's `rotateOrder`). The rotation of the first letter comes
/// first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RotateOrder {
    /// x, then y, then z: R = Rz Ry Rx (Maya's default).
    #[default]
    Xyz,
    /// y, then z, then x.
    Yzx,
    /// z, then x, then y.
    Zxy,
    /// x, then z, then y.
    Xzy,
    /// y, then x, then z.
    Yxz,
    /// z, then y, then x.
    Zyx,
}

impl RotateOrder {
    /// The order of Maya's number 0..=5; `None` for other numbers.
    pub fn from_index(index: u32) -> Option<Self> {
        Some(match index {
            0 => Self::Xyz,
            1 => Self::Yzx,
            2 => Self::Zxy,
            3 => Self::Xzy,
            4 => Self::Yxz,
            5 => Self::Zyx,
            _ => return None,
        })
    }
}

/// M = T R S: a point is first scaled, then rotated, then translated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trs {
    /// Translation, scene units.
    pub translate: DVec3,
    /// Euler angles about x, y and z, radians.
    pub rotate: DVec3,
    /// Factors along x, y and z.
    pub scale: DVec3,
    /// Order of the rotations.
    pub order: RotateOrder,
}

impl Default for Trs {
    fn default() -> Self {
        Self { translate: DVec3::ZERO, rotate: DVec3::ZERO, scale: DVec3::ONE, order: RotateOrder::Xyz }
    }
}

impl Trs {
    /// The 4x4 matrix T R S for column vectors.
    pub fn matrix(&self) -> DMat4 {
        let (x, y, z) =
            (rotation(DVec3::X, self.rotate.x), rotation(DVec3::Y, self.rotate.y), rotation(DVec3::Z, self.rotate.z));
        let r = match self.order {
            RotateOrder::Xyz => z * y * x,
            RotateOrder::Yzx => x * z * y,
            RotateOrder::Zxy => y * x * z,
            RotateOrder::Xzy => y * z * x,
            RotateOrder::Yxz => z * x * y,
            RotateOrder::Zyx => x * y * z,
        };
        let m = r * DMat3::from_diagonal(self.scale);
        DMat4::from_mat3_translation(m, self.translate)
    }
}

/// Rotation about a unit axis. Sine and cosine come from `libm`, so the bits are the same on every computer.
pub(crate) fn rotation(axis: DVec3, radians: f64) -> DMat3 {
    let (s, c) = libm::sincos(radians);
    let t = 1.0 - c;
    let DVec3 { x, y, z } = axis;
    DMat3::from_cols(
        DVec3::new(t * x * x + c, t * x * y + s * z, t * x * z - s * y),
        DVec3::new(t * x * y - s * z, t * y * y + c, t * y * z + s * x),
        DVec3::new(t * x * z + s * y, t * y * z - s * x, t * z * z + c),
    )
}

/// Upper bound of the factor by which a linear map makes vectors longer. |M|^2 is at most the greatest sum of absolute
/// values in a row of M^T M. The bound is exact for rotations with scales along the axes.
pub(crate) fn norm(m: &DMat3) -> f64 {
    let square = m.transpose() * *m;
    let rows = [square.x_axis, square.y_axis, square.z_axis].map(|row| row.abs().element_sum());
    rows.into_iter().fold(0.0, f64::max).sqrt()
}

/// The angle of the rotation that leads from one to the other, radians, at most pi; NaN where one is no number. Both
/// signs are the same rotation. Where both are the same it is exactly 0, as the arc cosine of a rounded product is not.
pub(crate) fn angle_between(a: DQuat, b: DQuat) -> f64 {
    let apart = (a - b).length().min((a + b).length());
    4.0 * libm::asin((0.5 * apart).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_rotations() {
        let turned = |angle: f64| DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), angle);
        for angle in [1e-9, 0.3, 2.0, 3.1] {
            for sign in [1.0, -1.0] {
                let found = angle_between(turned(0.7), turned(0.7 + angle) * sign);
                assert!((found - angle).abs() < 1e-12, "{found}, not {angle}");
            }
        }
        assert_eq!(angle_between(turned(0.7), turned(0.7)), 0.0);
        assert!(angle_between(DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0), turned(0.7)).is_nan());
    }

    #[test]
    fn quarter_turns_follow_the_right_hand_rule() {
        let q = std::f64::consts::FRAC_PI_2;
        let near = |a: DVec3, b: DVec3| assert!((a - b).length() < 1e-15, "{a} {b}");
        near(rotation(DVec3::X, q) * DVec3::Y, DVec3::Z);
        near(rotation(DVec3::Y, q) * DVec3::Z, DVec3::X);
        near(rotation(DVec3::Z, q) * DVec3::X, DVec3::Y);
    }

    #[test]
    fn the_first_letter_turns_first() {
        let q = std::f64::consts::FRAC_PI_2;
        let trs = |order| Trs { rotate: DVec3::new(q, q, 0.0), order, ..Trs::default() };
        // xyz: y -> z (about x) -> x (about y). zyx: y stays under y, then goes to z.
        let xyz = trs(RotateOrder::Xyz).matrix().transform_vector3(DVec3::Y);
        let zyx = trs(RotateOrder::Zyx).matrix().transform_vector3(DVec3::Y);
        assert!((xyz - DVec3::X).length() < 1e-15, "{xyz}");
        assert!((zyx - DVec3::Z).length() < 1e-15, "{zyx}");
    }

    #[test]
    fn scale_first_translate_last() {
        let trs = Trs { translate: DVec3::X, scale: DVec3::splat(2.0), ..Trs::default() };
        assert_eq!(trs.matrix().transform_point3(DVec3::ONE), DVec3::new(3.0, 2.0, 2.0));
    }
}

//! Colour by direction: real spherical harmonics of degrees 1 to 3, with the Condon-Shortley sign.

use glam::Vec3;

use crate::model::Gaussians;

/// What the harmonics of degrees 1 to `most` add to the colour of Gaussian `index`, seen along the unit vector that
/// `direction` gives, from the eye to the centre.
pub(super) fn sum(gaussians: &Gaussians, index: usize, most: u8, direction: impl FnOnce() -> Vec3) -> Vec3 {
    let each = gaussians.harmonics_each();
    let degree = most.min(gaussians.degree);
    if degree == 0 {
        return Vec3::ZERO;
    }
    let own = &gaussians.harmonics[index * each..][..each];
    let basis = basis(direction());
    let used = usize::from(degree + 1).pow(2) - 1;
    own[..used].iter().zip(basis).map(|(coefficient, basis)| *coefficient * basis).sum()
}

/// From degree 1 on, each from -degree to degree.
fn basis(Vec3 { x, y, z }: Vec3) -> [f32; 15] {
    const C1: f32 = 0.488_602_51;
    const C2: [f32; 3] = [1.092_548_4, 0.315_391_57, 0.546_274_2];
    const C3: [f32; 5] = [0.590_043_6, 2.890_611_4, 0.457_045_8, 0.373_176_34, 1.445_305_7];
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        -C1 * y,
        C1 * z,
        -C1 * x,
        C2[0] * x * y,
        -C2[0] * y * z,
        C2[1] * (2.0 * zz - xx - yy),
        -C2[0] * x * z,
        C2[2] * (xx - yy),
        -C3[0] * y * (3.0 * xx - yy),
        C3[1] * x * y * z,
        -C3[2] * y * (4.0 * zz - xx - yy),
        C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -C3[2] * x * (4.0 * zz - xx - yy),
        C3[4] * z * (xx - yy),
        -C3[0] * x * (xx - 3.0 * yy),
    ]
}

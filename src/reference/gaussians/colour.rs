//! Colours of Gaussians: a constant and spherical harmonics of the direction of view.

use glam::DVec3;

use crate::model::Gaussians;
use crate::scene::Drawing;

/// Colour of Gaussian `index` seen from `eye` (model space), in the space of the capture: max(0, 0.5 + sum of harmonics
/// of the direction from the eye to the centre), or the one colour that the object has for all.
pub(in crate::reference) fn colour(gaussians: &Gaussians, drawing: &Drawing, index: usize, eye: DVec3) -> DVec3 {
    if let Some(flat) = drawing.flat {
        return flat.as_dvec3();
    }
    let mut sum = DVec3::splat(0.5) + C0 * gaussians.base[index].as_dvec3();
    let degree = usize::from(drawing.harmonics.min(gaussians.degree));
    if degree > 0 {
        let each = gaussians.harmonics_each();
        let own = &gaussians.harmonics[index * each..][..(degree + 1) * (degree + 1) - 1];
        let direction = (gaussians.position[index].as_dvec3() - eye).normalize_or_zero();
        for (coefficient, basis) in own.iter().zip(basis(direction)) {
            sum += basis * coefficient.as_dvec3();
        }
    }
    sum.max(DVec3::ZERO)
}

/// 1 / (2 sqrt(pi)).
const C0: f64 = 0.282_094_791_773_878_14;

/// Real spherical harmonics of degrees 1 to 3 of a unit vector, with the Condon-Shortley sign, from -degree to degree.
fn basis(d: DVec3) -> [f64; 15] {
    // sqrt(3 / 4 pi); sqrt(15 / 4 pi), sqrt(5 / 16 pi); sqrt(35 / 32 pi), sqrt(105 / 4 pi), sqrt(21 / 32 pi),
    // sqrt(7 / 16 pi).
    const A: f64 = 0.488_602_511_902_919_9;
    const B: [f64; 2] = [1.092_548_430_592_079_2, 0.315_391_565_252_520_05];
    const C: [f64; 4] =
        [0.590_043_589_926_643_5, 2.890_611_442_640_554, 0.457_045_799_464_465_8, 0.373_176_332_590_115_4];
    let DVec3 { x, y, z } = d;
    let (across, five) = (x * x - y * y, 5.0 * z * z - 1.0);
    [
        -A * y,
        A * z,
        -A * x,
        B[0] * x * y,
        -B[0] * y * z,
        B[1] * (3.0 * z * z - 1.0),
        -B[0] * x * z,
        0.5 * B[0] * across,
        -C[0] * y * (3.0 * x * x - y * y),
        C[1] * x * y * z,
        -C[2] * y * five,
        C[3] * z * (five - 2.0),
        -C[2] * x * five,
        0.5 * C[1] * z * across,
        -C[0] * x * (x * x - 3.0 * y * y),
    ]
}

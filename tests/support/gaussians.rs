//! Pictures of Gaussian captures by the definition, in f64: no tiles, no early stop. Shares no mathematics with the
//! renderer, and of the library only what a capture holds.

use glam::{DMat3, DVec2, DVec3};
use splatblur::model::Gaussians;

/// A camera of captures: y is down in the model.
pub struct CaptureCamera {
    pub eye: DVec3,
    pub at: DVec3,
    /// Width and height, pixels.
    pub size: [usize; 2],
}

/// Vertical angle of view, degrees.
const FOVY: f64 = 50.0;
/// Nearest depth that is drawn.
const NEAR: f64 = 0.2;
/// Variance that is added on the screen, pixels^2 (Kerbl et al. 2023, their program).
const DILATION: f64 = 0.3;

/// The capture before black: coded red, green and blue, premultiplied, and alpha, row by row.
pub fn picture(gaussians: &Gaussians, view: &CaptureCamera) -> Vec<[f64; 4]> {
    let [width, height] = view.size;
    let forward = (view.at - view.eye).normalize();
    let right = forward.cross(DVec3::NEG_Y).normalize();
    // Rows: right, down, forward.
    let turn = DMat3::from_cols(right, forward.cross(right), forward).transpose();
    let half = (FOVY.to_radians() / 2.0).tan();
    let focal = height as f64 / 2.0 / half;
    let limit = DVec2::new(half * width as f64 / height as f64, half) * 1.3;

    let place = |index: usize| turn * (gaussians.position[index].as_dvec3() - view.eye);
    let mut order: Vec<(f64, usize)> =
        (0..gaussians.len()).map(|i| (place(i).z, i)).filter(|(z, _)| *z > NEAR).collect();
    order.sort_by(|a, b| a.partial_cmp(b).expect("depths are finite"));

    let mut out = vec![[0.0; 4]; width * height];
    for (depth, index) in order {
        let centre = place(index);
        let spread = DMat3::from_quat(gaussians.rotation[index].as_dquat().normalize())
            * DMat3::from_diagonal(gaussians.sigma[index].as_dvec3());
        let spread = turn * spread;
        // The projection's derivative where the centre is seen, kept near the field of view.
        let ray = (DVec2::new(centre.x, centre.y) / depth).clamp(-limit, limit);
        let (row_x, row_y) = (DVec3::new(1.0, 0.0, -ray.x), DVec3::new(0.0, 1.0, -ray.y));
        let on_screen = |row: DVec3| spread.transpose() * row * (focal / depth);
        let (u, v) = (on_screen(row_x), on_screen(row_y));
        let (xx, xy, yy) = (u.dot(u) + DILATION, u.dot(v), v.dot(v) + DILATION);
        let determinant = xx * yy - xy * xy;
        let middle = DVec2::new(centre.x, centre.y) * (focal / depth) + DVec2::new(width as f64, height as f64) / 2.0;
        let opacity = f64::from(gaussians.opacity[index]);
        // Where alpha falls to 1/255.
        let reach = 2.0 * (255.0 * opacity).ln();
        if reach <= 0.0 {
            continue;
        }
        let colour = colour(gaussians, index, (gaussians.position[index].as_dvec3() - view.eye).normalize());
        let span = |middle: f64, variance: f64, end: usize| {
            let half = (reach * variance).sqrt() + 1.0;
            (middle - half).max(0.0) as usize..((middle + half).max(0.0) as usize + 1).min(end)
        };
        for y in span(middle.y, yy, height) {
            for x in span(middle.x, xx, width) {
                let d = DVec2::new(x as f64 + 0.5, y as f64 + 0.5) - middle;
                let q = (yy * d.x * d.x - 2.0 * xy * d.x * d.y + xx * d.y * d.y) / determinant;
                let alpha = (opacity * (-0.5 * q).exp()).min(0.99);
                if alpha < 1.0 / 255.0 {
                    continue;
                }
                let pixel = &mut out[y * width + x];
                let share = alpha * (1.0 - pixel[3]);
                for (channel, value) in pixel.iter_mut().zip([colour.x, colour.y, colour.z, 1.0]) {
                    *channel += share * value;
                }
            }
        }
    }
    out
}

/// The colour of a Gaussian that is seen in the direction `d`.
pub fn colour(gaussians: &Gaussians, index: usize, d: DVec3) -> DVec3 {
    let each = gaussians.harmonics_each();
    let own = &gaussians.harmonics[index * each..][..each];
    let sum: DVec3 = own.iter().zip(basis(d)).map(|(coefficient, basis)| coefficient.as_dvec3() * basis).sum();
    (0.5 + 0.5 / std::f64::consts::PI.sqrt() * gaussians.base[index].as_dvec3() + sum).max(DVec3::ZERO)
}

/// Real spherical harmonics of degrees 1 to 3 with the Condon-Shortley sign, from -degree to degree.
fn basis(d: DVec3) -> [f64; 15] {
    let DVec3 { x, y, z } = d;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let root = |n: f64, over: f64| (n / std::f64::consts::PI).sqrt() / over;
    [
        -root(3.0, 2.0) * y,
        root(3.0, 2.0) * z,
        -root(3.0, 2.0) * x,
        root(15.0, 2.0) * x * y,
        -root(15.0, 2.0) * y * z,
        root(5.0, 4.0) * (2.0 * zz - xx - yy),
        -root(15.0, 2.0) * x * z,
        root(15.0, 4.0) * (xx - yy),
        -root(35.0 / 2.0, 4.0) * y * (3.0 * xx - yy),
        root(105.0, 2.0) * x * y * z,
        -root(21.0 / 2.0, 4.0) * y * (4.0 * zz - xx - yy),
        root(7.0, 4.0) * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -root(21.0 / 2.0, 4.0) * x * (4.0 * zz - xx - yy),
        root(105.0, 4.0) * z * (xx - yy),
        -root(35.0 / 2.0, 4.0) * x * (xx - 3.0 * yy),
    ]
}

/// 10 log10(1 / mean square difference) of the four channels, dB.
pub fn psnr(a: &[[f64; 4]], b: &[[f64; 4]]) -> f64 {
    let squares: f64 = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).powi(2)).sum();
    -10.0 * (squares / (4 * a.len()) as f64).log10()
}

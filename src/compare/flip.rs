//! LDR-FLIP (Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild 2020): the difference that a person
//! sees when two pictures alternate in the same place, per pixel, 0 to 1.
//!
//! Colour: contrast sensitivity filters in the opponent space `YCxCz`, then a Hunt-adjusted `HyAB` distance in CIELAB.
//! Features: edges and points found by derivatives of a Gaussian. Both are joined as colour^(1 - feature). The numbers
//! are the paper's.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::filter::{Size, gaussian, gaussian_samples, offsets, separable};
use super::{CompareError, check, display, mean as mean_of};
use crate::film::Picture;

/// Pixels per degree of visual angle, of a monitor 0.7 m wide with 3840 pixels, seen from 0.7 m:
/// 0.7 * 3840 / 0.7 * pi / 180.
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;

/// Gaussians of the contrast sensitivity functions: amplitude and width b, per channel of `YCxCz`.
const CONTRAST: [&[(f64, f64)]; 3] = [&[(1.0, 0.0047)], &[(1.0, 0.0053)], &[(34.1, 0.04), (13.5, 0.025)]];
/// The widest of them, which sets the radius.
const WIDEST: f64 = 0.04;
/// Exponent of the colour distance.
const QC: f64 = 0.7;
/// Where the colour distance is bent, and to what value: shares of the greatest distance, and of 1.
const PC: f64 = 0.4;
const PT: f64 = 0.95;
/// Width of a feature, degrees.
const FEATURE_WIDTH: f64 = 0.082;
/// Exponent of the feature difference.
const QF: f64 = 0.5;

/// The mean of [`map`].
///
/// # Errors
/// The sizes differ, or there are no pixels.
pub fn mean(a: &Picture, b: &Picture) -> Result<f64, CompareError> {
    Ok(mean_of(&map(a, b)?, a.width as usize))
}

/// FLIP per pixel, 0 to 1, at [`PIXELS_PER_DEGREE`]. NaN where a value nearby is not finite.
///
/// # Errors
/// The sizes differ, or there are no pixels.
pub fn map(a: &Picture, b: &Picture) -> Result<Vec<f32>, CompareError> {
    map_at(a, b, PIXELS_PER_DEGREE)
}

/// [`map`] for another distance: `pixels_per_degree` in 1..=1000, clamped.
///
/// # Errors
/// The sizes differ, or there are no pixels.
pub fn map_at(a: &Picture, b: &Picture, pixels_per_degree: f64) -> Result<Vec<f32>, CompareError> {
    check(a, b)?;
    let size = Size { width: a.width as usize, height: a.height as usize };
    let scale = pixels_per_degree.clamp(1.0, 1000.0);
    let [seen_a, seen_b] = [a, b].map(|picture| Seen::new(picture, size, scale));
    let largest = greatest_distance();
    Ok((0..a.rgba.len())
        .into_par_iter()
        .map(|i| {
            let colour = redistribute(libm::pow(hyab(seen_a.lab[i], seen_b.lab[i]), QC), largest);
            let edge = f64::from((seen_a.edges[i] - seen_b.edges[i]).abs());
            let point = f64::from((seen_a.points[i] - seen_b.points[i]).abs());
            let feature = libm::pow(edge.max(point) / 2.0_f64.sqrt(), QF);
            // `max` drops a NaN of one side: then the colour has one too.
            libm::pow(colour, 1.0 - feature) as f32
        })
        .collect())
}

/// What the eye makes of one picture.
struct Seen {
    /// Hunt-adjusted CIELAB after the contrast sensitivity filters.
    lab: Vec<[f32; 3]>,
    /// Length of the first derivatives of the achromatic channel.
    edges: Vec<f32>,
    /// Length of the second ones.
    points: Vec<f32>,
}

impl Seen {
    fn new(picture: &Picture, size: Size, scale: f64) -> Self {
        let opponent: Vec<[f32; 3]> = picture
            .rgba
            .par_iter()
            .map(|p| opponent_from_xyz(xyz_from_linear([p[0], p[1], p[2]].map(|v| f64::from(display::shown(v))))))
            .map(|v| v.map(|v| v as f32))
            .collect();
        let planes = [0, 1, 2].map(|c| opponent.par_iter().map(|v| v[c]).collect::<Vec<f32>>());
        let grey: Vec<f32> = planes[0].par_iter().map(|y| (y + 16.0) / 116.0).collect();
        let [y, cx, cz] = [0, 1, 2].map(|c| contrast_filtered(&planes[c], CONTRAST[c], size, scale));
        let lab = (0..y.len())
            .into_par_iter()
            .map(|i| {
                let rgb = linear_from_xyz(xyz_from_opponent([y[i], cx[i], cz[i]].map(f64::from)));
                // Values that are not clamped would leave the gamut; `clamp` keeps NaN.
                hunt(lab_from_xyz(xyz_from_linear(rgb.map(|v| v.clamp(0.0, 1.0))))).map(|v| v as f32)
            })
            .collect();
        let [edges, points] = features(&grey, size, scale);
        Self { lab, edges, points }
    }
}

/// One channel through its contrast sensitivity function: a sum of Gaussians, normalised to weight 1 as a whole.
fn contrast_filtered(plane: &[f32], gaussians: &[(f64, f64)], size: Size, scale: f64) -> Vec<f32> {
    let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * scale).ceil() as usize;
    // exp(-pi^2 (x/scale)^2 / b) as a standard deviation in pixels.
    let sigma = |b: f64| scale * (b / 2.0).sqrt() / PI;
    // Weight of a Gaussian over the square: its height a sqrt(pi/b) times the square of its samples' sum in one axis.
    let weight =
        |&(a, b): &(f64, f64)| a * (PI / b).sqrt() * gaussian_samples(sigma(b), radius).iter().sum::<f64>().powi(2);
    let total: f64 = gaussians.iter().map(weight).sum();
    let mut sum = vec![0.0; plane.len()];
    for gauss in gaussians {
        let kernel = gaussian(sigma(gauss.1), radius);
        let share = (weight(gauss) / total) as f32;
        sum.iter_mut().zip(separable(plane, size, &kernel, &kernel)).for_each(|(sum, v)| *sum += share * v);
    }
    sum
}

/// Lengths of the gradient and of the second derivatives, by kernels whose positive and negative weights each sum to 1.
fn features(grey: &[f32], size: Size, scale: f64) -> [Vec<f32>; 2] {
    let sigma = 0.5 * FEATURE_WIDTH * scale;
    let radius = (3.0 * sigma).ceil() as usize;
    let smooth = gaussian(sigma, radius);
    let bell = gaussian_samples(sigma, radius);
    let first: Vec<f64> = offsets(radius).zip(&bell).map(|(x, g)| -x * g).collect();
    let second: Vec<f64> = offsets(radius).zip(&bell).map(|(x, g)| (x * x / (sigma * sigma) - 1.0) * g).collect();
    [first, second].map(|kernel| {
        let kernel = balanced(&kernel);
        let along = separable(grey, size, &kernel, &smooth);
        let down = separable(grey, size, &smooth, &kernel);
        along.par_iter().zip(&down).map(|(x, y)| (x * x + y * y).sqrt()).collect()
    })
}

/// Positive weights scaled to sum 1, negative ones to -1.
fn balanced(kernel: &[f64]) -> Vec<f32> {
    let positive: f64 = kernel.iter().filter(|&&w| w > 0.0).sum();
    let negative: f64 = -kernel.iter().filter(|&&w| w < 0.0).sum::<f64>();
    kernel.iter().map(|&w| (w / if w > 0.0 { positive } else { negative }) as f32).collect()
}

/// Rec.709 with white D65, as exact fractions.
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

fn times(m: [[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// XYZ of white: the sums of the rows.
fn white() -> [f64; 3] {
    times(XYZ_FROM_RGB, [1.0; 3])
}

fn xyz_from_linear(rgb: [f64; 3]) -> [f64; 3] {
    times(XYZ_FROM_RGB, rgb)
}

fn linear_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    // The inverse by cofactors; the compiler folds it.
    let [a, b, c] = XYZ_FROM_RGB;
    let cross =
        |u: [f64; 3], v: [f64; 3]| [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
    let determinant = a[0] * bc[0] + a[1] * bc[1] + a[2] * bc[2];
    [0, 1, 2].map(|i| (bc[i] * xyz[0] + ca[i] * xyz[1] + ab[i] * xyz[2]) / determinant)
}

/// `YCxCz`: CIELAB without its cube roots.
fn opponent_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    let w = white();
    let [x, y, z] = [xyz[0] / w[0], xyz[1] / w[1], xyz[2] / w[2]];
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn xyz_from_opponent([l, cx, cz]: [f64; 3]) -> [f64; 3] {
    let w = white();
    let y = (l + 16.0) / 116.0;
    [(y + cx / 500.0) * w[0], y * w[1], (y - cz / 200.0) * w[2]]
}

fn lab_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let w = white();
    let [x, y, z] = [0, 1, 2].map(|c| {
        let t = xyz[c] / w[c];
        if t > DELTA.powi(3) { libm::cbrt(t) } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Less chroma in the dark (Hunt).
fn hunt([l, a, b]: [f64; 3]) -> [f64; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// City-block in lightness, Euclidean in chroma.
fn hyab(p: [f32; 3], q: [f32; 3]) -> f64 {
    let [l, a, b] = [0, 1, 2].map(|c| f64::from(p[c]) - f64::from(q[c]));
    l.abs() + (a * a + b * b).sqrt()
}

/// The greatest colour distance that sRGB has, green to blue, with the exponent.
fn greatest_distance() -> f64 {
    let lab = |rgb| hunt(lab_from_xyz(xyz_from_linear(rgb))).map(|v| v as f32);
    libm::pow(hyab(lab([0.0, 1.0, 0.0]), lab([0.0, 0.0, 1.0])), QC)
}

/// Two lines from 0 over (`PC` of the greatest, `PT`) to (the greatest, 1).
fn redistribute(distance: f64, largest: f64) -> f64 {
    let bend = PC * largest;
    if distance < bend { PT / bend * distance } else { PT + (distance - bend) / (largest - bend) * (1.0 - PT) }
}

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use glam::{DMat2, DVec2, DVec3, Mat3, Vec3};

use super::project::{Filtered, project};
use super::share::Shares;
use crate::backend::cpu::project::SurfelView;
use crate::frame::{PixelRect, PosedObject, Raster};
use crate::layout::EwaSplat;
use crate::math::random::Random;
use crate::model::Surfels;
use crate::model::paths::Paths;

const SIZE: u32 = 64;
/// Focal lengths, pixels: without perspective, and with an angle of view of 56 degrees.
const FAR: f64 = 1e6;
const WIDE: f64 = 60.0;

/// A surfel with axes `u` and `v` at `centre`, in camera coordinates with x right, y down and depth, as the pass
/// projects it with a filter of standard deviation `sigma`.
fn splat(focal: f64, centre: DVec3, [u, v]: [DVec3; 2], sigma: f64) -> Option<EwaSplat> {
    let surfels = Surfels {
        position: vec![Vec3::ZERO],
        axis_u: vec![u.as_vec3()],
        axis_v: vec![v.as_vec3()],
        normal: vec![Vec3::Z],
        colour: vec![Vec3::ONE],
        ..Surfels::default()
    };
    let screen = Mat3::from_diagonal(Vec3::new(focal as f32, focal as f32, 1.0));
    let origin = screen * centre.as_vec3();
    let object = PosedObject {
        visible: true,
        near: 0.01,
        elapsed: [0.0; 3],
        advance: [0.0; 3],
        pace: 0.0,
        moves: false,
        eye: Vec3::ZERO,
        centre_from_model: screen,
        centre_origin: origin,
        motion_from_model: Mat3::ZERO,
        motion_origin: Vec3::ZERO,
        screen_from_model: screen,
        screen_origin: origin,
        screen_rate: Mat3::ZERO,
        screen_origin_rate: Vec3::ZERO,
        normal_matrix: Mat3::IDENTITY,
        normal_motion: Mat3::ZERO,
        world_from_model: Mat3::IDENTITY,
        world_origin: Vec3::ZERO,
        handedness: 1.0,
        epsilon: 0.0,
        spheres: 0.0,
        world_from_view: Mat3::IDENTITY,
    };
    let raster = Raster {
        size: [SIZE; 2],
        origin: [0; 2],
        first: [0; 2],
        readout: None,
        axis: [SIZE as f32 / 2.0; 2],
        focal: focal as f32,
        low_pass: 0.0,
        sigma: sigma as f32,
        pixel: 0.0,
        offset: [0.0; 2],
    };
    let pixels = PixelRect::of_image([SIZE; 2]);
    let view = SurfelView {
        object: &object,
        eyes: object.eyes(),
        raster,
        pixels,
        corner: [0; 2],
        wanted: None,
        near: 1e-3,
        centre_disc: 0.0,
        margin: raster.apron() as f32,
        two_sided: true,
        paths: Paths::default(),
        clusters: None,
    };
    let mut out = Vec::new();
    let mut filtered = Filtered { sigma: sigma as f32, pixels, guarded: pixels, shares: Shares::ONE, out: &mut out };
    project(&view, &surfels, 0..1, &mut filtered);
    out.pop()
}

/// q of the filtered splat `d` pixels from its centre, as the attribute pass computes it; in f64.
fn q(splat: &EwaSplat, d: DVec2, sigma: f64) -> f64 {
    let form = |c: [f32; 2]| f64::from(c[0]) * d.x + f64::from(c[1]) * d.y;
    let (u, v) = (form(splat.u), form(splat.v));
    let p = DVec2::new(form([splat.p[0], splat.p[1]]), form([splat.p[1], splat.p[2]]));
    let nearer = 1.0 - form(splat.shrink);
    4.0 * (u * u + v * v) / (nearer * nearer) + sigma * sigma * p.length_squared()
}

/// The kernel exp(-2 (u^2 + v^2)) on the ray through the pixel `d` from the centre, without a cut.
fn kernel(focal: f64, centre: DVec3, [u, v]: [DVec3; 2], d: DVec2) -> f64 {
    let ray = DVec3::new(centre.x / centre.z + d.x / focal, centre.y / centre.z + d.y / focal, 1.0);
    let normal = u.cross(v);
    let depth = normal.dot(centre) / normal.dot(ray);
    if depth <= 0.0 {
        return 0.0;
    }
    let point = ray * depth - centre;
    let (a, b) = (point.dot(u) / u.length_squared(), point.dot(v) / v.length_squared());
    (-2.0 * (a * a + b * b)).exp()
}

/// The kernel convolved with a Gaussian, by brute force: a grid of steps of `step` pixels, finer than both.
fn convolved(focal: f64, centre: DVec3, axes: [DVec3; 2], d: DVec2, sigma: f64, step: f64) -> f64 {
    let n = (6.0 * sigma / step).ceil() as i32;
    let (mut sum, mut mass) = (0.0, 0.0);
    for i in -n..=n {
        for j in -n..=n {
            let at = DVec2::new(f64::from(i), f64::from(j)) * step;
            let weight = (-at.length_squared() / (2.0 * sigma * sigma)).exp();
            sum += weight * kernel(focal, centre, axes, d + at);
            mass += weight;
        }
    }
    sum / mass
}

/// Axes of lengths `a` and `b`, turned by `tilt` about x and then by `turn` about the view.
fn axes(a: f64, b: f64, tilt: f64, turn: f64) -> [DVec3; 2] {
    let turned = |p: DVec3| {
        let tilted = DVec3::new(p.x, p.y * tilt.cos(), p.y * tilt.sin());
        let flat = DMat2::from_angle(turn) * DVec2::new(tilted.x, tilted.y);
        DVec3::new(flat.x, flat.y, tilted.z)
    };
    [turned(DVec3::X * a), turned(DVec3::Y * b)]
}

/// Largest difference from the convolution in shares of its peak, over a grid of places.
fn worst(focal: f64, centre: DVec3, axes: [DVec3; 2], sigma: f64) -> f64 {
    let splat = splat(focal, centre, axes, sigma).unwrap();
    let [u, v] = axes;
    let pixels = focal / centre.z;
    let narrow = (v.truncate().length().min(u.truncate().length()) * pixels).max(1e-3);
    let step = (sigma / 8.0).min(narrow / 6.0).max(sigma / 60.0);
    let peak = convolved(focal, centre, axes, DVec2::ZERO, sigma, step);
    let reach = (u.length() * pixels).max(sigma);
    let mut worst = 0.0_f64;
    for i in -3..=3 {
        for j in -3..=3 {
            let d = DVec2::new(f64::from(i), f64::from(j)) * (reach / 3.0);
            let want = convolved(focal, centre, axes, d, sigma, step);
            let got = f64::from(splat.peak) * (-0.5 * q(&splat, d, sigma)).exp();
            worst = worst.max((got - want).abs() / peak);
        }
    }
    worst
}

/// So far away that perspective does nothing: magnified, minified, tilted, nearly edge-on.
#[test]
fn affine_splats_are_the_convolution() {
    let far = DVec3::new(0.0, 0.0, 1e5);
    let pixel = far.z / FAR;
    for (what, a, b, tilt) in [
        ("magnified", 8.0, 6.0, 0.4),
        ("minified", 0.2, 0.1, 0.4),
        ("tilted", 2.0, 1.5, 1.2),
        ("edge-on", 3.0, 3.0, 1.55),
    ] {
        for sigma in [0.25, 1.0] {
            let worst = worst(FAR, far, axes(a * pixel, b * pixel, tilt, 0.7), sigma);
            println!("{what}, sigma {sigma}: {worst:.1e} of the peak");
            assert!(worst < 1e-4, "{what}, sigma {sigma}: {worst:.1e}");
        }
    }
}

/// Near the camera, in perspective: large and tilted splats.
#[test]
fn splats_in_perspective_are_near_the_convolution() {
    for (sigma, most) in [(0.25, 0.02), (1.0, 0.05)] {
        let mut all = 0.0_f64;
        for (pixels, tilt) in [(0.3, 1.3), (1.0, 1.0), (2.0, 1.4), (4.0, 1.3), (8.0, 1.0), (8.0, 1.4), (20.0, 0.8)] {
            let radius = pixels * 10.0 / WIDE;
            let found = worst(WIDE, DVec3::new(1.2, 0.7, 10.0), axes(radius, 0.8 * radius, tilt, 0.5), sigma);
            println!("sigma {sigma}, radius {pixels} px, tilt {tilt}: {found:.1e} of the peak");
            all = all.max(found);
        }
        assert!(all < most, "sigma {sigma}: {all:.1e} of the peak");
    }
}

/// Zwicker et al. (2002), eq. 35 with V' on the screen, and their eq. 36 in the tangent plane, agree at the centre:
/// both peaks are sqrt(|V| / |V'|).
#[test]
fn screen_and_tangent_plane_agree_at_the_centre() {
    let centre = DVec3::new(0.1, -0.05, 20.0);
    let [u, v] = axes(0.9, 0.6, 1.1, 0.3);
    for sigma in [0.1, 0.35, 1.0] {
        let splat = splat(WIDE, centre, [u, v], sigma).unwrap();
        let project = |p: DVec3| DVec2::new(p.x / p.z, p.y / p.z) * WIDE;
        let h = 1e-6;
        let derivative = |a: DVec3| (project(centre + a * h) - project(centre - a * h)) / (2.0 * h);
        let j = DMat2::from_cols(derivative(u), derivative(v));
        // On the screen.
        let variance = (j * j.transpose()) * 0.25 + DMat2::from_diagonal(DVec2::splat(sigma * sigma));
        let screen = (0.0625 * j.determinant().powi(2) / variance.determinant()).sqrt();
        // In the tangent plane the filter's covariance is J^-1 J^-T sigma^2.
        let inverse = j.inverse();
        let tangent = DMat2::from_diagonal(DVec2::splat(0.25)) + (inverse * inverse.transpose()) * (sigma * sigma);
        let plane = (0.0625 / tangent.determinant()).sqrt();
        assert!((screen - plane).abs() < 1e-6, "{screen} {plane}");
        assert!((f64::from(splat.peak) - plane).abs() < 1e-6, "{} {plane}", splat.peak);
    }
}

/// A splat has no weight outside its bounds: random splats, large and small, seen from any side.
#[test]
fn bounds_hold_all_that_is_not_cut() {
    let mut random = Random(15);
    let mut between = |low: f64, high: f64| low + (high - low) * f64::from(random.next());
    let (mut inside, mut bounded) = (0, 0);
    for number in 0..4000 {
        let focal = [FAR, WIDE][number % 2];
        let depth = if focal == FAR { 1e5 } else { 10.0 };
        let pixel = depth / focal;
        let centre = DVec3::new(between(-16.0, 16.0) * pixel, between(-16.0, 16.0) * pixel, depth);
        let radius = between(0.05, 1.0).powi(3) * 40.0 * pixel;
        let axes = axes(radius, radius * between(0.2, 1.0), between(0.0, 1.57), between(0.0, 3.1));
        let sigma = between(0.05, 1.5);
        let Some(splat) = splat(focal, centre, axes, sigma).filter(|splat| splat.crossing == 0) else { continue };
        let [x0, x1, y0, y1] = splat.filtered_bounds.map(i32::from);
        bounded += (x1 + 1 - x0).max(0) * (y1 + 1 - y0).max(0);
        for y in 0..SIZE as i32 {
            for x in 0..SIZE as i32 {
                let [rx, ry] = splat.disc.reference.map(f64::from);
                let d = DVec2::new(f64::from(x) + 0.5 - rx, f64::from(y) + 0.5 - ry);
                let nearer = 1.0 - f64::from(splat.shrink[0]) * d.x - f64::from(splat.shrink[1]) * d.y;
                if nearer > 0.0 && q(&splat, d, sigma) <= 4.0 {
                    inside += 1;
                    let holds = (x0..=x1).contains(&x) && (y0..=y1).contains(&y);
                    assert!(
                        holds,
                        "splat {number}, sigma {sigma}: pixel {x}, {y} is not in {:?}",
                        splat.filtered_bounds
                    );
                }
            }
        }
    }
    println!("{inside} pixels have weight, {bounded} lie in bounds");
    assert!(inside > 100_000);
}

//! The reference against closed forms, judged by its own standard errors: each pixel's z = (mean - truth) / standard
//! error must behave like a Student t with 15 degrees of freedom, whose root mean square is 1.07 and of which 0.1 %
//! lies beyond 4.
//!
//! Where the standard error is exactly 0 (the pixel and its neighbours saw one value only) there is no z, but mean and
//! truth must agree to 1e-6 all the same.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use crate::support;
use crate::support::closed_forms::{DEPTH, FOCAL, SIZE, disc, edge, spin_of, truth};
use crate::support::{UNLIT, object, round_surfels, scene};
use glam::{DVec3, Vec3};
use splatblur::film::Aov;
use splatblur::model::Surfels;
use splatblur::options::{Look, PixelFilter};
use splatblur::reference::{Reference, ReferenceOptions, render};
use splatblur::scene::{Light, Motion, Object, Scene, Sphere};
use splatblur::time::Weight;

const SAMPLES: u64 = 4096;

/// The value that a pixel must have: premultiplied r, g, b, and alpha; `None`: not compared.
pub(crate) type Expected<'a> = &'a dyn Fn(usize, usize) -> Option<[f64; 4]>;

pub(crate) fn reference(scene: &Scene, filter: PixelFilter) -> Reference {
    let options =
        ReferenceOptions { samples: SAMPLES, look: Look { filter, ..Look::default() }, ..ReferenceOptions::default() };
    render(scene, 0, &options, None, &|_| ()).expect("valid options")
}

pub(crate) struct Statistics {
    /// Values with a z.
    count: usize,
    /// Root mean square of z.
    pub(crate) rms: f64,
    /// Share of all compared values within 4 standard errors + 1e-6.
    pub(crate) within: f64,
    /// Root mean square of the differences.
    pub(crate) difference: f64,
    /// Mean standard error of all compared values.
    pub(crate) error: f64,
}

pub(crate) fn statistics(reference: &Reference, expected: Expected<'_>) -> Statistics {
    let picture = &reference.picture;
    let errors = picture.layers.last().expect("the error layer");
    assert_eq!(errors.aov, Aov::Error);
    let (mut compared, mut within, mut error_sum) = (0, 0, 0.0);
    let (mut count, mut squares, mut differences) = (0, 0.0, 0.0);
    for (i, pixel) in picture.rgba.iter().enumerate() {
        let Some(want) = expected(i % picture.width as usize, i / picture.width as usize) else { continue };
        for c in 0..4 {
            let difference = f64::from(pixel[c]) - want[c];
            let error = f64::from(errors.planes[c][i]);
            compared += 1;
            error_sum += error;
            differences += difference * difference;
            within += usize::from(difference.abs() <= 4.0 * error + 1e-6);
            if error > 0.0 {
                count += 1;
                squares += (difference / error).powi(2);
            }
        }
    }
    Statistics {
        count,
        rms: (squares / count.max(1) as f64).sqrt(),
        within: within as f64 / f64::from(compared),
        difference: (differences / f64::from(compared)).sqrt(),
        error: error_sum / f64::from(compared),
    }
}

/// The demands on a reference.
fn check(name: &str, reference: &Reference, expected: Expected<'_>) {
    let s = statistics(reference, expected);
    println!("{name}: {} z, rms {:.3}, {:.3} % within 4 SE, mean SE {:.2e}", s.count, s.rms, 100.0 * s.within, s.error);
    assert!(s.within >= 0.997, "{name}: {:.3} % within 4 standard errors", 100.0 * s.within);
    assert!((0.8..=1.25).contains(&s.rms), "{name}: rms of z {:.3}", s.rms);
    assert!(s.error < 5e-4, "{name}: mean standard error {:.2e}", s.error);
    assert!(s.count > 500, "{name}: {} values compared", s.count);
}

/// A truth image; alpha is a colour channel over the object's colour where one object is alone. `all`: with each weight
/// and filter; else with each once, where a picture takes long.
fn check_file(name: &str, mut scene: Scene, alpha: Option<f64>, all: bool, counts: impl Fn(f64, f64) -> bool) {
    scene.image.transparent = true;
    for (word, weight) in [("box", Weight::Box), ("ramp", Weight::Ramp { centre: 1.0 })] {
        scene.shutter.weight = weight;
        for (filter_word, filter) in [("box", PixelFilter::Box), ("point", PixelFilter::Point)] {
            if !all && (word == "box") != (filter_word == "box") {
                continue;
            }
            let name = format!("{name}_{word}_{filter_word}");
            let image = truth(&name);
            check(&name, &reference(&scene, filter), &|x, y| {
                counts(x as f64 + 0.5, y as f64 + 0.5).then(|| {
                    let [r, g, b] = image[y * SIZE + x].map(f64::from);
                    [r, g, b, alpha.map_or(1.0, |colour| r / colour)]
                })
            });
        }
    }
}

// Not deep: closed forms of what moves on a line.
#[test]
fn disc_images() {
    check_file("disc", disc(), Some(f64::from(0.9_f32)), true, |_, _| true);
}

// Not deep: closed forms of what moves on a line.
#[test]
fn edge_images() {
    check_file("edge", edge(), Some(f64::from(0.3_f32)), false, |_, _| true);
}

#[test]
#[ignore = "deep: many samples"]
fn spin_images() {
    check_file("spin", spin_of(0.08), None, false, |x, y| (4.0..=20.0).contains(&(x - 31.4).hypot(y - 33.2)));
}

/// An unlit object with motions.
fn moving(model: Surfels, motions: Vec<Motion>) -> Object {
    let mut object = object(model);
    object.motions = motions;
    object.shape.surface_mut().unwrap().material = Some(UNLIT);
    object
}

/// Rows of the images below, about the same axis and with the same focal length as the truth images.
const ROWS: usize = 16;

fn transparent(objects: Vec<Object>) -> Scene {
    let fovy = 2.0 * (0.5 * ROWS as f64 / FOCAL).atan().to_degrees();
    let mut scene = scene(objects, [SIZE as u32, ROWS as u32], DVec3::ZERO, fovy);
    scene.image.transparent = true;
    scene
}

/// Name, weight, and the integral of a(t) from 0.
type Weighted = (&'static str, Weight, fn(f64) -> f64);

fn weights() -> [Weighted; 5] {
    [
        ("box", Weight::Box, |t| t),
        ("tent", Weight::Tent, |t| if t < 0.5 { 2.0 * t * t } else { 1.0 - 2.0 * (1.0 - t) * (1.0 - t) }),
        ("ramp", Weight::Ramp { centre: 1.0 }, |t| t * t),
        ("exponential", Weight::Exponential { rate: 3.0, centre: 1.0 }, |t| {
            ((3.0 * (t - 1.0)).exp() - (-3.0_f64).exp()) / (1.0 - (-3.0_f64).exp())
        }),
        ("one-minus-exponential", Weight::OneMinusExponential { centre: 1.0 }, |t| {
            (t - (t - 1.0).exp()) * 1_f64.exp() + 1.0
        }),
    ]
}

/// An upright edge that crosses 40 pixels at constant speed: at a pixel's centre, coverage is A(t of crossing); a
/// linear ramp for the box. Over a pixel's square it is the mean of that.
#[test]
#[ignore = "deep: many samples"]
fn edges_at_constant_speed() {
    const RADIUS: f64 = 2500.0;
    const FROM: f64 = 12.3;
    const TRAVEL: f64 = 40.0;
    /// Standard deviation of the Gaussian pixel filter, pixels.
    const SIGMA: f64 = 0.7;
    let px = DEPTH / FOCAL;
    let model = round_surfels([(DVec3::ZERO, DVec3::Z, RADIUS, Vec3::new(0.25, 0.5, 1.0))]);
    let mut object = moving(model, vec![Motion::Linear { velocity: DVec3::new(TRAVEL * px, 0.0, 0.0) }]);
    object.transform.translate = DVec3::new((FROM - 32.0) * px - RADIUS, 0.0, -DEPTH);
    let mut scene = transparent(vec![object]);
    // The rim of a disc of 55,000 pixels is off its tangent by less than 8^2 / (2 * 55,000) = 0.0006 pixels.
    let rim = |y: f64| ((RADIUS / px).powi(2) - (y - 8.0).powi(2)).sqrt() - RADIUS / px;
    for (name, weight, integral) in weights() {
        scene.shutter.weight = weight;
        // The edge is beyond x from time (x - FROM - rim) / TRAVEL on.
        let at = |x: f64, y: f64| 1.0 - integral(((x - FROM - rim(y)) / TRAVEL).clamp(0.0, 1.0));
        let coverage = |coverage: f64| Some([0.25 * coverage, 0.5 * coverage, coverage, coverage]);
        check(&format!("edge {name} point"), &reference(&scene, PixelFilter::Point), &|x, y| {
            coverage(at(x as f64 + 0.5, y as f64 + 0.5))
        });
        // A picture takes seconds: the box filter has one even weight and one that is not.
        if !matches!(scene.shutter.weight, Weight::Box | Weight::Ramp { .. }) {
            continue;
        }
        check(&format!("edge {name} box"), &reference(&scene, PixelFilter::Box), &|x, y| {
            let n = 400;
            let points = (0..n).map(|i| at(x as f64 + (f64::from(i) + 0.5) / f64::from(n), y as f64 + 0.5));
            coverage(points.sum::<f64>() / f64::from(n))
        });
        // Few samples see the tail of the Gaussian and the tail of a weight at once; their error is not normal.
        if !matches!(scene.shutter.weight, Weight::Box) {
            continue;
        }
        // Along one axis the density of a Gaussian that is cut at a distance of 2.
        let density = |g: f64| {
            let chord = libm::erf((0.5 * (4.0 - g * g)).sqrt());
            (-0.5 * g * g).exp() / std::f64::consts::TAU.sqrt() * chord / (1.0 - (-2.0_f64).exp())
        };
        check(&format!("edge {name} gaussian"), &reference(&scene, PixelFilter::Gaussian { sigma: SIGMA }), &|x, y| {
            let n = 400;
            let offsets = (0..n).map(|i| 4.0 * (f64::from(i) + 0.5) / f64::from(n) - 2.0);
            let total: f64 = offsets.clone().map(density).sum();
            let points = offsets.map(|g| density(g) * at(x as f64 + 0.5 + SIGMA * g, y as f64 + 0.5));
            coverage(points.sum::<f64>() / total)
        });
    }
}

/// A dot is seen by all pixels within 2 sigma of it, whatever tiles they are in.
#[test]
fn a_dot_is_a_picture_of_the_gaussian() {
    const RADIUS: f64 = 1.0;
    let px = DEPTH / FOCAL;
    let mut dot = moving(Surfels::default(), Vec::new());
    dot.shape = Sphere { radius: RADIUS * px, colour: Vec3::ONE }.into();
    // In the middle of a tile of 4 x 4 pixels: others see it all the same.
    dot.transform.translate = DVec3::new(2.0 * px, 2.0 * px, -DEPTH);
    let scene = transparent(vec![dot]);
    let picture = reference(&scene, PixelFilter::Gaussian { sigma: 2.0 }).picture;
    let (mut area, mut square) = (0.0, 0.0);
    for (i, pixel) in picture.rgba.iter().enumerate() {
        let [x, y] = [i % SIZE, i / SIZE].map(|v| v as f64 + 0.5);
        area += f64::from(pixel[3]);
        square += f64::from(pixel[3]) * ((x - 34.0).powi(2) + (y - 6.0).powi(2));
    }
    // That of the Gaussian, cut at 2 sigma, and of the dot.
    let want = 8.0 * (1.0 - 3.0 * (-2.0_f64).exp()) / (1.0 - (-2.0_f64).exp()) + 0.5 * RADIUS * RADIUS;
    println!("dot: area {area:.5}, mean square {:.4} of {want:.4}", square / area);
    assert!((area / (std::f64::consts::PI * RADIUS * RADIUS) - 1.0).abs() < 0.03, "{area}");
    assert!((square / area / want - 1.0).abs() < 0.02, "{}", square / area);
}

/// A disc in two halves that turns once: every point of it sees each colour for half of the time, and every pixel is
/// covered for the share of its square that the disc covers.
#[test]
#[ignore = "deep: many samples"]
fn full_turn() {
    let mut scene = spin_of(0.08);
    scene.image.transparent = true;
    let Some(Motion::Rotation { per_frame, .. }) = scene.objects[0].motions.first_mut() else {
        panic!("the disc turns");
    };
    *per_frame = std::f64::consts::TAU;
    let reference = reference(&scene, PixelFilter::Box);
    check("full turn", &reference, &|x, y| {
        let r = (x as f64 + 0.5 - 31.4).hypot(y as f64 + 0.5 - 33.2);
        (2.0..=20.0).contains(&r).then_some([0.525, 0.275, 0.5, 1.0])
    });
}

/// Two discs over the whole image swap their depths, one tilted, so that it happens from t = 0.2 on the right to 0.57
/// on the left: the nearer one is seen. (Both are for less than 1e-6 of the shutter.)
// Not deep: the closed form of depths that change.
#[test]
fn discs_that_swap_their_depths() {
    const TILT: f64 = 0.5;
    let disc = |colour: Vec3, normal: DVec3| round_surfels([(DVec3::ZERO, normal.normalize(), 100.0, colour)]);
    let (a, b) = (Vec3::new(1.0, 0.25, 0.0), Vec3::new(0.0, 0.5, 1.0));
    let along = |speed: f64| vec![Motion::Linear { velocity: DVec3::new(0.0, 0.0, speed) }];
    let mut first = moving(disc(a, DVec3::Z), along(-2.0));
    first.transform.translate.z = -3.26;
    let mut second = moving(disc(b, DVec3::new(-TILT, 0.0, 1.0)), along(2.0));
    second.transform.translate.z = -4.74;
    first.epsilon = Some(1e-7);
    second.epsilon = Some(1e-7);
    let mut scene = transparent(vec![first, second]);
    // Depths 3.26 + 2 t and (4.74 - 2 t) / (1 + q), with q = TILT (x - 32) / FOCAL, are equal at:
    let swap = |x: f64| {
        let q = TILT * (x - 32.0) / FOCAL;
        (4.74 - 3.26 * (1.0 + q)) / (2.0 * (1.0 + q) + 2.0)
    };
    // `edges_at_constant_speed` has the others.
    for (name, weight, integral) in weights().into_iter().step_by(2) {
        scene.shutter.weight = weight;
        check(&format!("swap {name}"), &reference(&scene, PixelFilter::Box), &|x, _| {
            let points = (0..400).map(|i| integral(swap(x as f64 + (f64::from(i) + 0.5) / 400.0)));
            let share = points.sum::<f64>() / 400.0;
            let want = a.as_dvec3() * share + b.as_dvec3() * (1.0 - share);
            Some([want.x, want.y, want.z, 1.0])
        });
    }
}

/// A white furnace: a unit sphere with albedo 1 under ambient light of 1, turning and moving before a background of 1:
/// nothing can be seen, whatever is hit; errors are those of rounding.
#[test]
fn white_furnace() {
    let mut model = support::sphere(20_000);
    model.colour.fill(Vec3::ONE);
    let motions = vec![
        Motion::Rotation { axis: DVec3::Y, per_frame: 2.0, centre: DVec3::ZERO },
        Motion::Linear { velocity: DVec3::new(0.7, 0.3, -0.2) },
    ];
    let mut scene = scene(vec![moving(model, motions)], [SIZE as u32; 2], DVec3::new(0.0, 0.0, 4.0), 40.0);
    scene.image.background = DVec3::ONE;
    scene.lights = vec![Light::Ambient { colour: DVec3::ONE }];
    // One that is the same at all times, and one that is not.
    for (_, weight, _) in weights().into_iter().step_by(3) {
        scene.shutter.weight = weight;
        let options = ReferenceOptions { samples: 256, ..ReferenceOptions::default() };
        let picture = render(&scene, 0, &options, None, &|_| ()).expect("valid options").picture;
        for pixel in &picture.rgba {
            assert!(pixel.iter().all(|v| (v - 1.0).abs() < 1e-6), "{pixel:?}");
        }
        let errors = &picture.layers.last().expect("the error layer").planes;
        assert!(errors[..3].iter().flatten().all(|e| *e < 1e-6));
        assert!(errors[3].iter().any(|e| *e > 0.01), "coverage varies all the same");
    }
}

//! The reference against closed forms, judged by its own standard errors: each pixel's z = (mean - truth) / standard error must
//! behave like a Student t with 15 degrees of freedom, whose root mean square is 1.07 and of which 0.1 % lies beyond 4.
//!
//! Where the standard error is exactly 0 (the pixel and its neighbours saw one value only) there is no z, but mean and truth
//! must agree to 1e-6 all the same.

mod support;

use glam::{DVec3, Vec3};
use splatblur::film::Aov;
use splatblur::model::Surfels;
use splatblur::plan::PixelFilter;
use splatblur::reference::{Reference, ReferenceOptions, render};
use splatblur::scene::{Light, Motion, Object, Scene};
use splatblur::time::Weight;
use support::closed_forms::{DEPTH, FOCAL, SIZE, disc, edge, spin_of, truth};
use support::{UNLIT, object, round_surfels, scene};

const SAMPLES: u64 = 4096;

/// Linear [A]: what is expected of a pixel: r, g, b, alpha; `None`: not compared.
type Expected<'a> = &'a dyn Fn(usize, usize) -> Option<[f64; 4]>;

fn reference(scene: &Scene, filter: PixelFilter) -> Reference {
    let options = ReferenceOptions { samples: SAMPLES, filter, ..ReferenceOptions::default() };
    render(scene, 0, &options, None, &|_| ()).expect("valid options")
}

struct Statistics {
    /// Values with a z.
    count: usize,
    rms: f64,
    /// Share of all compared values within 4 standard errors + 1e-6.
    within: f64,
    /// Mean standard error of all compared values.
    error: f64,
}

fn statistics(reference: &Reference, expected: Expected<'_>) -> Statistics {
    let picture = &reference.picture;
    let errors = picture.layers.last().expect("the error layer");
    assert_eq!(errors.aov, Aov::Error);
    let (mut compared, mut within, mut error_sum) = (0, 0, 0.0);
    let (mut count, mut squares) = (0, 0.0);
    for (i, pixel) in picture.rgba.iter().enumerate() {
        let Some(want) = expected(i % picture.width as usize, i / picture.width as usize) else { continue };
        for c in 0..4 {
            let difference = f64::from(pixel[c]) - want[c];
            let error = f64::from(errors.planes[c][i]);
            compared += 1;
            error_sum += error;
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
        error: error_sum / f64::from(compared),
    }
}

/// The demands of issue 3.
fn check(name: &str, reference: &Reference, expected: Expected<'_>) {
    let s = statistics(reference, expected);
    println!("{name}: {} z, rms {:.3}, {:.3} % within 4 SE, mean SE {:.2e}", s.count, s.rms, 100.0 * s.within, s.error);
    assert!(s.within >= 0.997, "{name}: {:.3} % within 4 standard errors", 100.0 * s.within);
    assert!((0.8..=1.25).contains(&s.rms), "{name}: rms of z {:.3}", s.rms);
    assert!(s.error < 5e-4, "{name}: mean standard error {:.2e}", s.error);
    assert!(s.count > 500, "{name}: {} values compared", s.count);
}

/// A truth image; alpha is a colour channel over the object's colour where one object is alone.
fn check_file(name: &str, mut scene: Scene, alpha: Option<f64>, counts: impl Fn(f64, f64) -> bool) {
    scene.image.transparent = true;
    for (word, weight) in [("box", Weight::Box), ("ramp", Weight::Ramp { centre: 1.0 })] {
        scene.shutter.weight = weight;
        for (filter_word, filter) in [("box", PixelFilter::Box), ("point", PixelFilter::Point)] {
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

#[test]
fn disc_images() {
    check_file("disc", disc(), Some(f64::from(0.9_f32)), |_, _| true);
}

#[test]
fn edge_images() {
    check_file("edge", edge(), Some(f64::from(0.3_f32)), |_, _| true);
}

#[test]
fn spin_images() {
    check_file("spin", spin_of(0.08), None, |x, y| (4.0..=20.0).contains(&(x - 31.4).hypot(y - 33.2)));
}

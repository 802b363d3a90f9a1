//! How fast the reference converges, and how near to it supersampling comes.
//!
//! `cargo run --release --example table_reference [-- TABLE...]`. Tables:
//!
//! - `slopes`: RMS difference of each sampler by samples a pixel; also writes `docs/images/reference_convergence.svg`,
//!   and stops where the samplers do not rank as they should;
//! - `supersampling`: supersampling on shipped scenes, in standard errors of the reference;
//! - `sphere`: denser and denser surfels against the ideal sphere, up to a million.
//!
//! Takes minutes, `sphere` one of them. The results stand in docs/measurements/.

#![allow(clippy::expect_used, clippy::print_stdout, reason = "a generator may stop, and prints its tables")]

mod support;

use std::path::Path;

use splatblur::backend::cpu::Cpu;
use splatblur::film::Picture;
use splatblur::options::{BlurMode, Look, Prefilter, RenderOptions};
use splatblur::reference::{ReferenceOptions, Sampler, render};
use splatblur::renderer::render_frame;
use splatblur::scene::Scene;
use splatblur::scene_file::{SceneLoadOptions, load};
use support::ideal_sphere::approaches_the_ideal_sphere;
use support::plot::{Panel, Series, log_log};
use support::{Arguments, rms};

const COUNTS: [u64; 7] = [16, 32, 64, 128, 256, 512, 1024];
const TRUTH: u64 = 8192;

fn main() {
    let asked = Arguments::read(&["slopes", "supersampling", "sphere"], &[]);
    if asked.table("slopes") {
        slopes();
    }
    if asked.table("supersampling") {
        supersampling_on_shipped_scenes();
    }
    if asked.table("sphere") {
        for size in [64, 256] {
            println!("{size} x {size}");
            approaches_the_ideal_sphere([10_000, 100_000, 1_000_000], size);
        }
    }
}

fn picture(scene: &Scene, frame: i64, sampler: Sampler, samples: u64, seed: u64) -> Picture {
    let options =
        ReferenceOptions { sampler, samples, look: Look { seed, ..Look::default() }, ..ReferenceOptions::default() };
    render(scene, frame, &options, None, &|_| ()).expect("valid options").picture
}

/// Least-squares slope of log error over log samples.
fn slope(errors: &[f64]) -> f64 {
    let points: Vec<(f64, f64)> = COUNTS.iter().zip(errors).map(|(&n, e)| ((n as f64).ln(), e.ln())).collect();
    let n = points.len() as f64;
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let (mut xy, mut xx) = (0.0, 0.0);
    for (x, y) in points {
        xy += (x - mx) * (y - my);
        xx += (x - mx) * (x - mx);
    }
    xy / xx
}

fn slopes() {
    let mut panels = Vec::new();
    println!("| scene | sampler | {} | slope |", COUNTS.map(|n| n.to_string()).join(" | "));
    for (name, frame) in [("diagonal", 12), ("crossing", 12), ("checkerboard", 5)] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("xml");
        let mut scene = load(&path, &SceneLoadOptions::default()).expect("a shipped scene").scene;
        (scene.image.width, scene.image.height, scene.image.transparent) = (96, 72, true);
        let truth = picture(&scene, frame, Sampler::Sobol, TRUTH, 99);
        let samplers = [Sampler::Sobol, Sampler::Jittered { density: 4 }, Sampler::Random];
        let mut series = Vec::new();
        let results = samplers.map(|sampler| {
            let errors = COUNTS.map(|n| rms(&picture(&scene, frame, sampler, n, 1), &truth));
            let word = format!("{sampler:?}").split(' ').next().unwrap_or_default().to_lowercase();
            let numbers = errors.map(|e| format!("{e:.2e}")).join(" | ");
            println!("| {name} | {word} | {numbers} | {:.2} |", slope(&errors));
            series.push(Series { name: word, note: format!("{:.2}", slope(&errors)), values: errors.to_vec() });
            (slope(&errors), errors[COUNTS.len() - 1])
        });
        panels.push(Panel { name: name.to_owned(), series });
        let [(sobol, least), (jittered, middle), (random, most)] = results;
        assert!(sobol <= -0.7, "{name}: {sobol}");
        assert!((random + 0.5).abs() <= 0.03, "{name}: {random}");
        // Between the two; slopes are known to about 0.03.
        assert!(sobol < jittered && jittered < random + 0.03, "{name}: {jittered}");
        assert!(least < middle && middle < most, "{name}: {least:.2e} {middle:.2e} {most:.2e}");
    }
    let title = "RMS difference from 8192 samples of another seed, and slope in log-log";
    let svg = log_log(title, ["samples a pixel", "RMS difference"], &COUNTS, [4e-4, 5e-2], &panels);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/images/reference_convergence.svg");
    std::fs::write(path, svg).expect("the docs are there");
}

/// z = (supersampling - reference) / standard error of the reference, coverage and mean of r, g, b: lag-1
/// autocorrelation along rows, mean in a band of 2 pixels along silhouettes (in units of its own error, 1/sqrt(n)), and
/// overall rms.
fn supersampling_on_shipped_scenes() {
    println!(
        "| scene | prefilter | rms difference | mean SE | autocorrelation | its error | band: mean z | limit | pixels |"
    );
    let scenes = [
        ("diagonal", 12),
        ("crossing", 12),
        ("checkerboard", 5),
        ("blinker", 5),
        ("blinker_fence", 5),
        ("spin", 5),
        ("static", 0),
        ("three_objects", 5),
        ("toward_camera_and_sideways", 5),
    ];
    for (name, frame) in scenes {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("xml");
        let mut scene = load(&path, &SceneLoadOptions::default()).expect("a shipped scene").scene;
        (scene.image.width, scene.image.height, scene.image.transparent) = (160, 120, true);
        let options = ReferenceOptions { samples: 1024, ..ReferenceOptions::default() };
        let made = render(&scene, frame, &options, None, &|_| ()).expect("valid options");
        let errors = made.picture.layers.last().expect("the error layer");
        for prefilter in [Prefilter::None, Prefilter::Approx] {
            let options =
                RenderOptions { quality: BlurMode::supersample(1024).into(), prefilter, ..RenderOptions::default() };
            let splatted = render_frame(&mut Cpu::default(), &scene, frame, &options).expect("it fits").picture;
            let z: Vec<Option<f64>> = (0..splatted.rgba.len())
                .map(|i| {
                    let error = f64::from(errors.planes[1][i]);
                    // Where nothing varies, f32 rounding of the splatter's sums is all there is.
                    (error > 1e-6).then(|| f64::from(splatted.rgba[i][1] - made.picture.rgba[i][1]) / error)
                })
                .collect();
            let row = |i: usize| i / 160;
            let pairs: Vec<(f64, f64)> =
                (1..z.len()).filter(|&i| row(i) == row(i - 1)).filter_map(|i| Some((z[i - 1]?, z[i]?))).collect();
            let square = z.iter().flatten().map(|z| z * z).sum::<f64>() / z.iter().flatten().count() as f64;
            let lag = pairs.iter().map(|(a, b)| a * b).sum::<f64>() / pairs.len() as f64 / square;
            let covered = |x: i32, y: i32| {
                let inside = (0..160).contains(&x) && (0..120).contains(&y);
                inside.then(|| f64::from(made.picture.rgba[(y * 160 + x) as usize][3]))
            };
            let band: Vec<f64> = (0..z.len())
                .filter(|&i| {
                    let (x, y) = ((i % 160) as i32, (i / 160) as i32);
                    let around = (-2..=2).flat_map(|dy| (-2..=2).map(move |dx| (dx, dy)));
                    let near: Vec<f64> = around.filter_map(|(dx, dy)| covered(x + dx, y + dy)).collect();
                    near.iter().any(|&a| a > 0.5) && near.iter().any(|&a| a < 0.5)
                })
                .filter_map(|i| z[i])
                .collect();
            let mean = band.iter().sum::<f64>() / band.len().max(1) as f64;
            println!(
                "| {name} | {prefilter:?} | {:.2e} | {:.2e} | {lag:.3} | {:.3} | {mean:.3} | {:.3} | {} |",
                rms(&splatted, &made.picture),
                made.stats.mean_error,
                1.0 / (pairs.len() as f64).sqrt(),
                3.0 / (band.len().max(1) as f64).sqrt(),
                band.len()
            );
        }
    }
}

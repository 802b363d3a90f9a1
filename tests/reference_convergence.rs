//! How fast the samplers converge on shipped scenes: the table of docs/reference.md.

use std::path::Path;

use splatblur::film::Picture;
use splatblur::reference::{ReferenceOptions, Sampler, render};
use splatblur::scene::{LoadOptions, Scene, load};

const COUNTS: [u64; 7] = [16, 32, 64, 128, 256, 512, 1024];
const TRUTH: u64 = 8192;

fn picture(scene: &Scene, frame: i64, sampler: Sampler, samples: u64, seed: u64) -> Picture {
    let options = ReferenceOptions { sampler, samples, seed, ..ReferenceOptions::default() };
    render(scene, frame, &options, None, &|_| ()).expect("valid options").picture
}

fn rms(a: &Picture, b: &Picture) -> f64 {
    let squares = a.rgba.iter().flatten().zip(b.rgba.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2));
    (squares.sum::<f64>() / (4.0 * a.rgba.len() as f64)).sqrt()
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

#[test]
#[ignore = "takes minutes; run with --ignored to make the table of docs/reference.md"]
fn slopes() {
    println!("| scene | sampler | {} | slope |", COUNTS.map(|n| n.to_string()).join(" | "));
    for (name, frame) in [("diagonal", 12), ("crossing", 12), ("checkerboard", 5)] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("xml");
        let mut scene = load(&path, &LoadOptions::default()).expect("a shipped scene").scene;
        (scene.image.width, scene.image.height, scene.image.transparent) = (96, 72, true);
        let truth = picture(&scene, frame, Sampler::Sobol, TRUTH, 99);
        let samplers = [Sampler::Sobol, Sampler::Jittered { density: 4 }, Sampler::Random];
        let results = samplers.map(|sampler| {
            let errors = COUNTS.map(|n| rms(&picture(&scene, frame, sampler, n, 1), &truth));
            let word = format!("{sampler:?}").split(' ').next().unwrap_or_default().to_lowercase();
            let numbers = errors.map(|e| format!("{e:.2e}")).join(" | ");
            println!("| {name} | {word} | {numbers} | {:.2} |", slope(&errors));
            (slope(&errors), errors[COUNTS.len() - 1])
        });
        let [(sobol, least), (jittered, middle), (random, most)] = results;
        assert!(sobol <= -0.7, "{name}: {sobol}");
        assert!((random + 0.5).abs() <= 0.03, "{name}: {random}");
        // Between the two; slopes are known to about 0.03.
        assert!(sobol < jittered && jittered < random + 0.03, "{name}: {jittered}");
        assert!(least < middle && middle < most, "{name}: {least:.2e} {middle:.2e} {most:.2e}");
    }
}

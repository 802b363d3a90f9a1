//! Closed forms of small motion-blur cases (tests/data/truth/README.md), which no renderer made: they fix the camera, the
//! shutter, its weights and the kernel's cut-off.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

mod support;

use splatblur::plan::{BlurMode, PixelFilter, Prefilter, RenderOptions};
use splatblur::scene::Scene;
use splatblur::time::Weight;
use support::closed_forms::{SIZE, disc, edge, spin, truth};
use support::render;

const SAMPLES: u32 = 1024;

struct Error {
    rmse: f64,
    max: f64,
}

/// Error of `scene` over all channels of the pixels for which `counts(x, y)`.
fn error(mut scene: Scene, name: &str, weight: &str, filter: &str, counts: impl Fn(f64, f64) -> bool) -> Error {
    scene.shutter.weight = match weight {
        "box" => Weight::Box,
        _ => Weight::Ramp { centre: 1.0 },
    };
    let options = RenderOptions {
        mode: BlurMode::supersample(SAMPLES),
        filter: if filter == "box" { PixelFilter::Box } else { PixelFilter::Point },
        prefilter: Prefilter::None,
        ..RenderOptions::default()
    };
    let picture = render(&scene, &options);
    let truth = truth(&format!("{name}_{weight}_{filter}"));
    let (mut sum, mut count, mut max) = (0.0, 0, 0.0_f64);
    for (i, (got, want)) in picture.rgba.iter().zip(&truth).enumerate() {
        if !counts((i % SIZE) as f64 + 0.5, (i / SIZE) as f64 + 0.5) {
            continue;
        }
        for channel in 0..3 {
            let difference = f64::from(got[channel]) - f64::from(want[channel]);
            assert!(difference.is_finite());
            sum += difference * difference;
            max = max.max(difference.abs());
            count += 1;
        }
    }
    let error = Error { rmse: (sum / f64::from(count)).sqrt(), max };
    println!("{name} {weight} {filter}: rmse {:.2e}, max {:.2e}", error.rmse, error.max);
    error
}

#[test]
fn disc_and_edge_at_pixel_centres() {
    for weight in ["box", "ramp"] {
        for (name, scene) in [("disc", disc()), ("edge", edge())] {
            let error = error(scene, name, weight, "point", |_, _| true);
            assert!(error.max <= 2.0 / 1024.0, "{name} {weight}: {:.2e}", error.max);
        }
    }
}

#[test]
fn disc_and_edge_over_pixel_squares() {
    for weight in ["box", "ramp"] {
        for (name, scene) in [("disc", disc()), ("edge", edge())] {
            let error = error(scene, name, weight, "box", |_, _| true);
            assert!(error.rmse <= 1e-3, "{name} {weight}: {:.2e}", error.rmse);
            assert!(error.max <= 0.01, "{name} {weight}: {:.2e}", error.max);
        }
    }
}

#[test]
fn spin_away_from_centre_and_rim() {
    let ring = |x: f64, y: f64| (4.0..=20.0).contains(&(x - 31.4).hypot(y - 33.2));
    for weight in ["box", "ramp"] {
        for filter in ["point", "box"] {
            let error = error(spin(), "spin", weight, filter, ring);
            assert!(error.rmse <= 0.003, "{weight} {filter}: {:.2e}", error.rmse);
            assert!(error.max <= 0.02, "{weight} {filter}: {:.2e}", error.max);
        }
    }
}

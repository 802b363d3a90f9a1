//! Closed forms of small motion-blur cases (tests/data/truth/README.md), which no renderer made: they fix the camera,
//! the shutter, its weights and the kernel's cut-off.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use crate::support::closed_forms::{SIZE, disc, edge, spin, truth};
use splatblur::backend::Backend;
use splatblur::backend::cpu::Cpu;
use splatblur::options::{BlurMode, Look, PixelFilter, Prefilter, RenderOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::Scene;
use splatblur::time::Weight;

/// Each backend at hand, with a number of time samples that it renders in seconds.
fn candidates(test: &str) -> Vec<Candidate> {
    let cpu = Candidate { backend: Box::new(Cpu::default()), samples: 1024 };
    std::iter::once(cpu).chain(gpu(test)).collect()
}

#[cfg(feature = "gpu")]
fn gpu(test: &str) -> Option<Candidate> {
    crate::support::gpu::gpu_or_skip(test).map(|gpu| Candidate { backend: Box::new(gpu), samples: 64 })
}

#[cfg(not(feature = "gpu"))]
fn gpu(_test: &str) -> Option<Candidate> {
    None
}

struct Candidate {
    backend: Box<dyn Backend>,
    samples: u32,
}

impl Candidate {
    /// What the error of 1024 samples is multiplied by, which falls at least like 1 / samples.
    fn coarseness(&self) -> f64 {
        1024.0 / f64::from(self.samples)
    }
}

struct Error {
    rmse: f64,
    max: f64,
}

/// Error of `scene` over all channels of the pixels for which `counts(x, y)`.
fn error(
    candidate: &mut Candidate,
    mut scene: Scene,
    name: &str,
    weight: &str,
    filter: &str,
    counts: impl Fn(f64, f64) -> bool,
) -> Error {
    scene.shutter.weight = match weight {
        "box" => Weight::Box,
        _ => Weight::Ramp { centre: 1.0 },
    };
    let options = RenderOptions {
        quality: BlurMode::supersample(candidate.samples).into(),
        prefilter: Prefilter::None,
        look: Look { filter: if filter == "box" { PixelFilter::Box } else { PixelFilter::Point }, ..Look::default() },
        ..RenderOptions::default()
    };
    let picture = render_frame(&mut *candidate.backend, &scene, 0, &options).expect("the frame fits").picture;
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
    println!(
        "{}: {name} {weight} {filter}: rmse {:.2e}, max {:.2e}",
        candidate.backend.describe(),
        error.rmse,
        error.max
    );
    error
}

// Not deep: closed forms on all backends.
#[test]
fn disc_and_edge_at_pixel_centres() {
    for mut candidate in candidates("disc_and_edge_at_pixel_centres") {
        for weight in ["box", "ramp"] {
            for (name, scene) in [("disc", disc()), ("edge", edge())] {
                let error = error(&mut candidate, scene, name, weight, "point", |_, _| true);
                let most = 2.0 / 1024.0 * candidate.coarseness();
                assert!(error.max <= most, "{name} {weight}: {:.2e}", error.max);
            }
        }
    }
}

// Not deep: closed forms on all backends.
#[test]
fn disc_and_edge_over_pixel_squares() {
    for mut candidate in candidates("disc_and_edge_over_pixel_squares") {
        for weight in ["box", "ramp"] {
            for (name, scene) in [("disc", disc()), ("edge", edge())] {
                let error = error(&mut candidate, scene, name, weight, "box", |_, _| true);
                let k = candidate.coarseness();
                assert!(error.rmse <= 1e-3 * k, "{name} {weight}: {:.2e}", error.rmse);
                assert!(error.max <= 0.01 * k, "{name} {weight}: {:.2e}", error.max);
            }
        }
    }
}

// Not deep: the closed form of what turns, on all backends.
#[test]
fn spin_away_from_centre_and_rim() {
    let ring = |x: f64, y: f64| (4.0..=20.0).contains(&(x - 31.4).hypot(y - 33.2));
    for mut candidate in candidates("spin_away_from_centre_and_rim") {
        for (weight, filter) in [("ramp", "point"), ("box", "box")] {
            // One case is enough where each takes long.
            if candidate.samples < 1024 && weight == "box" {
                continue;
            }
            let error = error(&mut candidate, spin(), "spin", weight, filter, ring);
            let k = candidate.coarseness();
            assert!(error.rmse <= 0.003 * k, "{weight} {filter}: {:.2e}", error.rmse);
            assert!(error.max <= 0.02 * k, "{weight} {filter}: {:.2e}", error.max);
        }
    }
}

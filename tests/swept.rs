//! Kernels in motion (design section 4): invariants, closed forms of temporal alpha, and how little the density of a model matters.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

mod support;

use splatblur::film::{Aov, Picture};
use splatblur::plan::{BlurMode, PixelFilter, Prefilter, RenderOptions, Shading, SweptKernel};
use splatblur::scene::Scene;
use splatblur::time::Weight;
use support::closed_forms::{SIZE, disc, edge, truth};
use support::{render, sphere_scene};

fn volumetric(intervals: u32) -> BlurMode {
    BlurMode::Volumetric { intervals, pixel_samples: 1, swept: SweptKernel::default() }
}

fn options(mode: BlurMode) -> RenderOptions {
    RenderOptions { mode, aovs: Aov::ALL[..4].to_vec(), ..RenderOptions::default() }
}

fn values(picture: &Picture) -> Vec<f32> {
    let layers = picture.layers.iter().flat_map(|layer| layer.planes.iter().flatten());
    picture.rgba.iter().flatten().chain(layers).copied().collect()
}

/// Greatest difference; infinities must stand in the same places.
fn difference(a: &Picture, b: &Picture) -> f32 {
    values(a).iter().zip(values(b)).map(|(a, b)| if *a == b { 0.0 } else { (a - b).abs() }).fold(0.0, f32::max)
}

#[test]
fn without_motion_a_tube_is_the_splat() {
    for prefilter in [Prefilter::None, Prefilter::Approx] {
        for (surfels, size) in [(3_000, 200), (100_000, 100)] {
            let scene = sphere_scene(surfels, size, false);
            let with = |mode| {
                let point = RenderOptions { filter: PixelFilter::Point, prefilter, ..options(mode) };
                render(&scene, &RenderOptions { shading: Shading::Gouraud, ..point })
            };
            let worst = difference(&with(BlurMode::Still { pixel_samples: 1 }), &with(volumetric(3)));
            println!("{surfels} surfels, {prefilter:?}: {worst:.1e}");
            assert!(worst < 1e-5, "{surfels} surfels, {prefilter:?}: {worst}");
        }
    }
}

struct Error {
    rmse: f64,
    max: f64,
}

/// Error of temporal alpha on the pixels for which `counts(x, y)`. The truth images are colour times alpha over black.
fn alpha_error(mut scene: Scene, name: &str, weight: &str, colour: [f32; 3], mode: BlurMode) -> Error {
    scene.shutter.weight = match weight {
        "box" => Weight::Box,
        _ => Weight::Ramp { centre: 1.0 },
    };
    let options = RenderOptions {
        mode,
        filter: PixelFilter::Point,
        prefilter: Prefilter::None,
        aovs: vec![Aov::Alpha],
        ..options(mode)
    };
    let picture = render(&scene, &options);
    let truth = truth(&format!("{name}_{weight}_point"));
    let (mut sum, mut max) = (0.0, 0.0_f64);
    for (alpha, want) in picture.layers[0].planes[0].iter().zip(&truth) {
        let difference = f64::from(*alpha) - f64::from(want[0] / colour[0]);
        sum += difference * difference;
        max = max.max(difference.abs());
    }
    let error = Error { rmse: (sum / (SIZE * SIZE) as f64).sqrt(), max };
    println!("{name} {weight} {mode}: rmse {:.2e}, max {:.2e} = {:.2}/255", error.rmse, error.max, error.max * 255.0);
    error
}

#[test]
fn temporal_alpha_of_disc_and_edge() {
    for weight in ["box", "ramp"] {
        for (name, scene, colour) in [("disc", disc(), [0.9, 0.5, 0.2]), ("edge", edge(), [0.3, 0.7, 0.95])] {
            for n in [1, 4, 16] {
                let error = alpha_error(scene.clone(), name, weight, colour, volumetric(n));
                // Moments of an interval are 1/(32 n) apart; the ramp is twice the box at its end.
                let step = if weight == "box" { 1.0 } else { 2.0 } / f64::from(32 * n);
                assert!(error.max <= step + 1e-3, "{name} {weight} {n}: {}", error.max);
            }
        }
    }
}

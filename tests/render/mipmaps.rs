//! Levels of texture: a chequered plane to the horizon, whose levels are known in closed form.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use glam::{DVec3, Vec3};
use splatblur::backend::cpu::Cpu;
use splatblur::compare::flip;
use splatblur::film::Picture;
use splatblur::model::{MIPMAP_SIGMA, Surfels};
use splatblur::options::{BlurMode, PixelFilter, Prefilter, RenderOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Object, Scene};

use crate::support::{UNLIT, object, round_surfels, scene};

const SIZE: [u32; 2] = [200, 100];
/// Distance of surfels, scene units.
const SPACING: f64 = 0.02;

/// A wave of period `2 cell` that is 1 and -1 in turn, under a Gaussian of standard deviation `sigma`: its Fourier
/// series.
fn wave(x: f64, cell: f64, sigma: f64) -> f64 {
    use std::f64::consts::PI;
    let term = |k: f64| (-0.5 * (k * PI * sigma / cell).powi(2)).exp() * (k * PI * x / cell).sin() / k;
    4.0 / PI * (0..200).map(|i| term(f64::from(2 * i + 1))).sum::<f64>()
}

/// The colour of the board under a Gaussian.
fn board(x: f64, z: f64, cell: f64, sigma: f64) -> Vec3 {
    let share = 0.5 + 0.5 * wave(x, cell, sigma) * wave(z, cell, sigma);
    Vec3::new(0.9, 0.8, 0.7).lerp(Vec3::new(0.05, 0.1, 0.2), share as f32)
}

/// A board of cells whose edges are `cell` long, in the plane y = 0, with levels or without.
fn plane(cell: f64, levels: bool) -> Object {
    let places = || (0..700).flat_map(|j| (0..500).map(move |i| (f64::from(i), f64::from(j))));
    let at = |(i, j): (f64, f64)| ((i - 249.5) * SPACING, -(j + 0.5) * SPACING);
    let radius = 3_f64.sqrt() * SPACING;
    let finest = f64::from(MIPMAP_SIGMA) * radius;
    let mut surfels: Surfels = round_surfels(places().map(at).map(|(x, z)| {
        let colour = board(x, z, cell, finest);
        (DVec3::new(x, 0.0, z), DVec3::Y, radius, colour)
    }));
    if levels {
        let of_level = |x: f64, z: f64| [2.0, 4.0, 8.0].map(|wider| board(x, z, cell, wider * finest));
        surfels.mipmap = places().map(at).map(|(x, z)| of_level(x, z)).collect();
    }
    let mut plane = object(surfels);
    plane.material = Some(UNLIT);
    plane
}

fn view(object: Object) -> Scene {
    let mut scene = scene(vec![object], SIZE, DVec3::new(0.0, 0.5, 1.0), 40.0);
    scene.camera.at = DVec3::new(0.0, 0.0, -3.0);
    scene
}

fn picture(object: Object, samples: u32, prefilter: Prefilter) -> Picture {
    let mode = if samples == 1 { BlurMode::Still { pixel_samples: 1 } } else { BlurMode::supersample(samples) };
    let options =
        RenderOptions { quality: mode.into(), filter: PixelFilter::Box, prefilter, ..RenderOptions::default() };
    render_frame(&mut Cpu::default(), &view(object), 0, &options).unwrap().picture
}

/// Without a prefilter one sample of what is smaller than a pixel is as good as noise. Levels filter it. With many
/// samples they do nothing.
#[test]
fn levels_filter_what_is_smaller_than_a_pixel() {
    for cell in [0.05, 0.1] {
        let truth = picture(plane(cell, false), 256, Prefilter::None);
        for (samples, most) in [(1, 0.75), (4, 0.85), (16, 0.95)] {
            let error = |levels| flip::mean(&picture(plane(cell, levels), samples, Prefilter::None), &truth).unwrap();
            let (without, with) = (error(false), error(true));
            println!("cell {cell}, {samples} samples: FLIP {without:.4} without levels, {with:.4} with them");
            assert!(with < most * without, "cell {cell}, {samples} samples: {with} of {without}");
        }
    }
}

/// Full EWA filters textures together with kernels.
#[test]
fn full_ewa_takes_the_finest_level() {
    let of = |levels| picture(plane(0.1, levels), 1, Prefilter::Ewa);
    assert!(of(true) == of(false));
}

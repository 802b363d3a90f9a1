//! Wheels whose spokes come to stand where others stood: what repeats within the exposure may seem to stand.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};
use splatblur::backend::cpu::Cpu;
use splatblur::compare::flip;
use splatblur::film::Picture;
use splatblur::options::{BlurMode, ErrorTarget, Quality, RenderOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Motion, Object, Scene};

use crate::support::{UNLIT, object, round_surfels, scene};

const SIZE: [u32; 2] = [120, 120];
const SPOKES: f64 = 12.0;

/// A disc of radius 1 before the camera, dark, with light spokes.
fn wheel() -> Object {
    const EDGE: i32 = 130;
    let step = 2.0 / f64::from(EDGE);
    let places = (0..EDGE * EDGE).map(|i| [i % EDGE, i / EDGE].map(|k| (f64::from(k) + 0.5) * step - 1.0));
    let inside = places.filter(|[x, y]| x * x + y * y < 1.0);
    let surfels = round_surfels(inside.map(|[x, y]| {
        let phase = (y.atan2(x) / TAU * SPOKES).rem_euclid(1.0);
        let colour = if phase < 0.3 { Vec3::new(0.9, 0.85, 0.7) } else { Vec3::new(0.05, 0.06, 0.1) };
        (DVec3::new(x, y, 0.0), DVec3::Z, 1.6 * step, colour)
    }));
    let mut wheel = object(surfels.spatially_ordered());
    wheel.shape.surface_mut().unwrap().material = Some(UNLIT);
    wheel
}

/// The wheel turns by so many spoke spacings while the shutter is open.
fn turning(spacings: f64) -> Scene {
    let mut wheel = wheel();
    wheel.motions = vec![Motion::Rotation { axis: DVec3::Z, per_frame: TAU / SPOKES * spacings, centre: DVec3::ZERO }];
    scene(vec![wheel], SIZE, DVec3::new(0.0, 0.0, 3.0), 40.0)
}

fn picture(scene: &Scene, options: &RenderOptions) -> Picture {
    render_frame(&mut Cpu::default(), scene, 0, options).unwrap().picture
}

/// Root mean square variation of green along a circle at two thirds of the radius: what stands of the spokes.
fn standing(picture: &Picture) -> f64 {
    let focal = 60.0 / (20_f64.to_radians()).tan();
    let radius = focal / 3.0 * 2.0 / 3.0;
    let values: Vec<f64> = (0..720)
        .map(|i| {
            let angle = TAU * f64::from(i) / 720.0;
            let [x, y] = [60.0 + radius * angle.cos(), 60.0 - radius * angle.sin()].map(|v| v as usize);
            f64::from(picture.rgba[y * SIZE[0] as usize + x][1])
        })
        .collect();
    let mean = values.iter().sum::<f64>() / 720.0;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 720.0).sqrt()
}

/// One spoke spacing within the exposure: a smooth disc.
// Not deep: a trap for mode auto that no other test has.
#[test]
fn spokes_that_move_to_the_next_are_smooth() {
    let scene = turning(1.0);
    let options = |quality| RenderOptions { quality, ..RenderOptions::default() };
    let truth = picture(&scene, &options(BlurMode::supersample(1024).into()));
    let still = standing(&picture(&scene, &options(BlurMode::Still { pixel_samples: 4 }.into())));
    for quality in [BlurMode::supersample(32).into(), Quality::Error(ErrorTarget::default())] {
        let got = picture(&scene, &options(quality));
        let (error, stands) = (flip::mean(&got, &truth).unwrap(), standing(&got));
        println!("{quality}: FLIP {error:.4}, stands {stands:.4} of {still:.4}, truth {:.4}", standing(&truth));
        assert!(error < 0.04 && stands < 0.05 * still, "{quality}: FLIP {error}, stands {stands} of {still}");
    }
}

/// As many spacings as samples: every sample shows the same, and mode auto says that it would not see it.
// Not deep: the only test of what mode auto says of turns.
#[test]
fn mode_auto_says_that_spokes_may_stand() {
    /// Most samples of a first round that leaves room for one of three times as many within 256.
    const MOST: u32 = 80;
    let scene = turning(f64::from(MOST));
    let options = RenderOptions { quality: Quality::Error(ErrorTarget::default()), ..RenderOptions::default() };
    let achieved = render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap().stats.achieved.unwrap();
    assert_eq!(achieved.samples, MOST);
    let turn = 360.0 / SPOKES;
    assert!((achieved.turn - turn).abs() < 1e-6 * turn, "{}, not {turn}", achieved.turn);
    assert!(achieved.to_string().contains("30 degrees from sample to sample"), "{achieved}");
    let slow = render_frame(&mut Cpu::default(), &turning(1.0), 0, &options).unwrap().stats.achieved.unwrap();
    assert!(slow.turn < 6.0 && !slow.to_string().contains("degrees"), "{slow}");
}

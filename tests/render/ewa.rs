//! Full EWA against areas that are known: outlines, small things, mattes, and surfaces without holes.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may report")]

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use splatblur::backend::cpu::Cpu;
use splatblur::film::Picture;
use splatblur::model::Surfels;
use splatblur::options::{BlurMode, Look, PixelFilter, Prefilter, RenderOptions};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Object, Scene};

use crate::support::{UNLIT, object, rms, round_surfels, scene, sphere};

pub(crate) const SIZE: u32 = 48;
const FOVY: f64 = 2.0;

/// Distance at which a unit length at the origin is one pixel.
pub(crate) fn distance() -> f64 {
    f64::from(SIZE) / 2.0 / (FOVY.to_radians() / 2.0).tan()
}

/// An unlit object whose origin is seen at `at`, pixels from the middle, with `pixels` pixels a unit.
pub(crate) fn seen(model: Surfels, at: [f64; 2], pixels: f64) -> Object {
    let mut object = object(model);
    object.shape.surface_mut().unwrap().material = Some(UNLIT);
    object.transform.translate = DVec3::new(at[0], -at[1], 0.0);
    object.transform.scale = DVec3::splat(pixels);
    object
}

pub(crate) fn before_nothing(objects: Vec<Object>) -> Scene {
    let mut scene = scene(objects, [SIZE; 2], DVec3::Z * distance(), FOVY);
    scene.image.transparent = true;
    scene
}

/// A picture at as many sub-pixel positions, whatever is at rest.
fn filtered(scene: &Scene, samples: u32, filter: PixelFilter) -> Picture {
    let mode = format!("supersample:{samples}+pixel-samples={samples}").parse::<BlurMode>().unwrap();
    let options = RenderOptions {
        quality: mode.into(),
        prefilter: Prefilter::Ewa,
        look: Look { filter, ..Look::default() },
        ..RenderOptions::default()
    };
    render_frame(&mut Cpu::default(), scene, 0, &options).unwrap().picture
}

/// Sum of alpha, pixels.
pub(crate) fn area(picture: &Picture) -> f64 {
    picture.rgba.iter().map(|pixel| f64::from(pixel[3])).sum()
}

/// A ball of random points, white.
pub(crate) fn random_ball(n: usize) -> Surfels {
    let mut state = 7_u64;
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    round_surfels((0..n).map(|_| {
        let (z, phi) = (2.0 * uniform() - 1.0, 2.0 * PI * uniform());
        let q = (1.0 - z * z).sqrt();
        let p = DVec3::new(q * phi.cos(), q * phi.sin(), z);
        (p, p, 6.0 / (n as f64).sqrt(), Vec3::ONE)
    }))
}

/// Where a ball stands, pixels from the middle: `n` places in a pixel.
pub(crate) fn places(n: usize) -> impl Iterator<Item = [f64; 2]> {
    (0..n).map(move |i| [(i as f64 + 0.5) / n as f64 - 0.5, (i as f64 * 0.618_034).fract() - 0.5])
}

#[test]
fn a_ball_is_as_large_as_it_is() {
    // Seen from near, a ball looks larger than its equator.
    let radius = 10.05 / (1.0 + (10.05 / distance()).powi(2)).sqrt();
    for (name, ball) in [("lattice", sphere(20_000)), ("random", random_ball(20_000))] {
        for samples in [1, 16] {
            let mut worst = 0.0_f64;
            for at in places(4) {
                let scene = before_nothing(vec![seen(ball.clone(), at, radius)]);
                let got = (area(&filtered(&scene, samples, PixelFilter::Box)) / PI).sqrt();
                worst = if (got - 10.05).abs() > worst.abs() { got - 10.05 } else { worst };
            }
            println!("{name}, {samples} positions: radius off by {worst:.3} px at worst");
            let most = if samples == 1 { 0.1 } else { 0.02 };
            assert!(worst.abs() <= most, "{name}, {samples} positions");
        }
    }
}

#[test]
fn a_tiny_ball_has_its_area() {
    let truth = PI * 0.01;
    for (n, filter, samples) in [(500, PixelFilter::Box, 16), (500, PixelFilter::Box, 1), (500, PixelFilter::Point, 1)]
    {
        let sums = places(16).map(|at| {
            let scene = before_nothing(vec![seen(sphere(n), at, 0.1)]);
            area(&filtered(&scene, samples, filter)) / truth
        });
        let sums: Vec<f64> = sums.collect();
        let mean = sums.iter().sum::<f64>() / sums.len() as f64;
        let (least, most) = (sums.iter().copied().fold(9.0, f64::min), sums.iter().copied().fold(0.0, f64::max));
        // One position per pixel meets a tenth of a pixel or not.
        match (filter, samples) {
            (PixelFilter::Point, _) => assert!(least >= 0.95 && most <= 1.05, "{least:.3} to {most:.3}"),
            _ => assert!((mean - 1.0).abs() <= 0.1, "{mean:.3}"),
        }
        println!("{filter} at {samples}: {mean:.3} of the area in the mean, {least:.3} to {most:.3}");
    }
}

/// A tiny ball is seen as the pixel filter itself: area and width are those of a Gaussian that is cut at 2 sigma,
/// whatever part of it splats have and what part the positions.
#[test]
fn a_tiny_ball_is_a_picture_of_the_gaussian() {
    for (sigma, samples) in [(1.0, 1), (1.0, 4), (1.0, 16), (0.5, 16), (2.0, 1), (2.0, 16)] {
        let (mut sum, mut square) = (0.0, 0.0);
        let mut worst = 1.0_f64;
        let places: Vec<[f64; 2]> = places(16).collect();
        for &place in &places {
            let scene = before_nothing(vec![seen(sphere(400), place, 0.1)]);
            let picture = filtered(&scene, samples, PixelFilter::Gaussian { sigma });
            let alpha = |x: u32, y: u32| f64::from(picture.rgba[(y * SIZE + x) as usize][3]);
            let pixels = (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y)));
            let middle = [place[0] + f64::from(SIZE) / 2.0, place[1] + f64::from(SIZE) / 2.0];
            let distance2 =
                |x: u32, y: u32| (f64::from(x) + 0.5 - middle[0]).powi(2) + (f64::from(y) + 0.5 - middle[1]).powi(2);
            square += pixels.map(|(x, y)| alpha(x, y) * distance2(x, y)).sum::<f64>();
            let one = area(&picture) / (PI * 0.01);
            worst = if (one - 1.0).abs() > (worst - 1.0).abs() { one } else { worst };
            sum += area(&picture);
        }
        let (share, variance) = (sum / (PI * 0.01 * places.len() as f64), 0.5 * square / sum / (sigma * sigma));
        let want = (1.0 - 3.0 * (-2.0_f64).exp()) / (1.0 - (-2.0_f64).exp());
        println!(
            "sigma {sigma}, {samples} positions: area {share:.3}, worst {worst:.3}, variance {variance:.3} of {want:.3}"
        );
        assert!((share - 1.0).abs() < 0.05, "sigma {sigma}, {samples}: area {share}");
        assert!((variance / want - 1.0).abs() < 0.05, "sigma {sigma}, {samples}: variance {variance}");
    }
}

/// A surface of points that lie anyhow, near and far. Seen from near, colours go over into each other as they do
/// without a filter, which is what the reference has; seen from far, each counts for the area that is its own.
// Not deep: the only test of points that lie anyhow.
#[test]
fn colours_of_points_that_lie_anyhow_are_those_of_the_reference() {
    let mut state = 3_u64;
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    for (spacing, most) in [(8.0, 1.5), (2.0, 1.5), (0.5, 1.5)] {
        let side = (f64::from(SIZE) / spacing) as i32 / 2 + 6;
        let places = (-side..=side).flat_map(|i| (-side..=side).map(move |j| [f64::from(i), f64::from(j)]));
        let plane = round_surfels(places.map(|[x, y]| {
            let at = DVec3::new(x + uniform() - 0.5, y + uniform() - 0.5, 0.0);
            (at, DVec3::Z, 1.5, Vec3::new(uniform() as f32, uniform() as f32, uniform() as f32))
        }));
        let scene = before_nothing(vec![seen(plane, [0.0; 2], spacing)]);
        let options = ReferenceOptions { samples: 1024, ..ReferenceOptions::default() };
        let truth = reference::render(&scene, 0, &options, None, &|_| ()).unwrap().picture;
        let plain = RenderOptions {
            quality: BlurMode::supersample(64).into(),
            prefilter: Prefilter::None,
            ..RenderOptions::default()
        };
        let plain = render_frame(&mut Cpu::default(), &scene, 0, &plain).unwrap().picture;
        let (with, without) = (rms(&filtered(&scene, 64, PixelFilter::Box), &truth), rms(&plain, &truth));
        println!("{spacing} px apart: rms {with:.5}, without filter {without:.5}");
        assert!(with < most * without, "{spacing} px apart: {with:.5} for {without:.5}");
    }
}

#[test]
fn a_matte_over_a_plate_is_what_is_rendered_at_once() {
    let wall = || {
        let spacing = 0.7;
        let cells = (0..80 * 80).map(|i| [f64::from(i % 80), f64::from(i / 80)].map(|k| (k - 39.5) * spacing));
        let surfels = cells.map(|[x, y]| (DVec3::new(x, y, 0.0), DVec3::Z, spacing, Vec3::new(0.2, 0.3, 0.8)));
        let mut wall = seen(round_surfels(surfels), [0.0, 0.0], 1.0);
        wall.transform.translate.z = -60.0;
        wall
    };
    for samples in [1, 16] {
        let ball = || seen(sphere(20_000), [0.3, 0.1], 10.05);
        let matte = filtered(&before_nothing(vec![ball()]), samples, PixelFilter::Box);
        let plate = filtered(&before_nothing(vec![wall()]), samples, PixelFilter::Box);
        let whole = filtered(&before_nothing(vec![wall(), ball()]), samples, PixelFilter::Box);
        let mut worst = 0.0_f32;
        for ((matte, plate), whole) in matte.rgba.iter().zip(&plate.rgba).zip(&whole.rgba) {
            for c in 0..4 {
                worst = worst.max((matte[c] + (1.0 - matte[3]) * plate[c] - whole[c]).abs());
            }
        }
        assert!(worst <= if samples == 1 { 6.0 } else { 4.0 } / 255.0, "{samples} positions");
        println!("{samples} positions: matte over plate differs by {:.2}/255 at worst", 255.0 * worst);
    }
}

#[test]
fn alpha_does_not_depend_on_density() {
    for (what, velocity) in [("at rest", 0.0), ("a streak", 12.0)] {
        // With fewer, discs stand out beyond the ball by more.
        let pictures: Vec<Picture> = [10_000, 20_000, 40_000]
            .into_iter()
            .map(|n| {
                let mut ball = seen(sphere(n), [-6.0 * velocity / 12.0, 0.0], 10.05);
                ball.motions = vec![splatblur::scene::Motion::Linear { velocity: DVec3::X * velocity }];
                filtered(&before_nothing(vec![ball]), 16, PixelFilter::Box)
            })
            .collect();
        for (a, b, name) in [(0, 1, "1x 2x"), (0, 2, "1x 4x")] {
            let differences: Vec<f32> = pictures[a]
                .rgba
                .iter()
                .zip(&pictures[b].rgba)
                .filter(|(a, b)| a[3].max(b[3]) > 0.0 && a[3].min(b[3]) < 1.0)
                .map(|(a, b)| (a[3] - b[3]).abs() * 255.0)
                .collect();
            let mean = differences.iter().sum::<f32>() / differences.len() as f32;
            let worst = differences.iter().copied().fold(0.0, f32::max);
            assert!(mean <= 1.5 && worst <= 8.0, "{what}, {name}: {mean:.2}, {worst:.2}");
            println!("{what}, {name}: {mean:.2}/255 in the mean, {worst:.2}/255 at worst");
        }
    }
}

#[test]
fn surfaces_have_no_holes() {
    for (name, ball) in [("lattice", sphere(2_000)), ("random", random_ball(2_000))] {
        for zoom in [0.5, 1.0, 2.0, 4.0, 8.0] {
            for samples in [1, 16] {
                let radius = 5.0 * zoom;
                let scene = before_nothing(vec![seen(ball.clone(), [0.2, 0.1], radius)]);
                let picture = filtered(&scene, samples, PixelFilter::Box);
                let mut least = 1.0_f32;
                let mut holes = 0;
                for (i, pixel) in picture.rgba.iter().enumerate() {
                    let (x, y) = ((i % SIZE as usize) as f64 - 23.7, (i / SIZE as usize) as f64 - 23.6);
                    if x.hypot(y) < radius * 0.98 - 2.0 {
                        least = least.min(pixel[3]);
                        holes += u32::from(pixel[3] < 254.0 / 255.0);
                    }
                }
                assert!(holes == 0, "{name}, radius {radius} px, {samples} positions: {holes} pixels below");
                println!("{name}, radius {radius} px, {samples} positions: alpha {least:.4} at least, {holes} below");
            }
        }
    }
}

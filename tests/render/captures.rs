//! Captures as transparent Gaussians, against exact pictures, the definition in f64, and closed forms. None shares
//! mathematics with the renderer.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Quat, Vec3};
use splatblur::film::{Aov, Picture};
use splatblur::image;
use splatblur::math::srgb;
use splatblur::model::{Gaussians, Surfels};
use splatblur::options::{BlurMode, ErrorTarget, Interleave, Look, PixelFilter, Quality, RenderOptions, Times};
use splatblur::scene::{Camera, Motion, Object, Scene, Shape};

use crate::support::gaussians::{CaptureCamera, picture, psnr};
use crate::support::{Random, UNLIT, object, render, round_surfels, scene};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn with(mode: BlurMode) -> RenderOptions {
    RenderOptions {
        quality: mode.into(),
        look: Look { filter: PixelFilter::Point, ..Look::default() },
        ..RenderOptions::default()
    }
}

fn still() -> RenderOptions {
    with(BlurMode::Still { pixel_samples: 1 })
}

/// The view of the exact pictures: y is down, 50 degrees, the nearest depth 0.2.
fn seen(objects: Vec<Object>, size: [u32; 2], eye: DVec3, at: DVec3) -> Scene {
    let mut scene = scene(objects, size, eye, 50.0);
    scene.camera = Camera { up: DVec3::NEG_Y, near: 0.2, fovy: 50_f64.to_radians(), ..Camera::new(eye, at) };
    scene.image.transparent = true;
    scene
}

/// Premultiplied coded values of a picture without background.
fn coded(picture: &Picture) -> Vec<[f64; 4]> {
    let coded = |&[r, g, b, a]: &[f32; 4]| {
        let of = |c: f32| if a > 0.0 { f64::from(a * srgb::from_linear(c / a)) } else { 0.0 };
        [of(r), of(g), of(b), f64::from(a)]
    };
    picture.rgba.iter().map(coded).collect()
}

fn guitar() -> Object {
    Object::load(root().join("tests/data/models/guitar_3dgs.ply")).unwrap()
}

fn truth(name: &str) -> Picture {
    image::read(&root().join("tests/data/truth/captures").join(name)).unwrap()
}

/// Measured: 100.6, 100.6 and 98.0 dB.
#[test]
fn the_guitar_is_the_exact_picture() {
    let guitar = guitar();
    for (number, eye) in [(0, [0.0, -2.0, 6.0]), (1, [-4.0, -3.0, 4.0]), (2, [-0.8, -2.2, 2.4])] {
        let scene = seen(vec![guitar.clone()], [480, 360], DVec3::from(eye), DVec3::new(0.0, -2.0, 0.0));
        let want = truth(&format!("guitar_{number}.exr"));
        let want: Vec<[f64; 4]> = want.rgba.iter().map(|pixel| pixel.map(f64::from)).collect();
        let found = psnr(&coded(&render(&scene, &still())), &want);
        println!("view {number}: {found:.1} dB");
        assert!(found >= 90.0, "view {number}: {found:.1} dB");
    }
}

/// The truth is the mean of 64 instants that were blended coded, over black, and decoded. Measured: 111.7 dB. The mean
/// of coded values would have 24.
#[test]
fn a_blurred_guitar_is_the_mean_of_decoded_instants() {
    let mut guitar = guitar();
    guitar.motions = vec![Motion::Linear { velocity: DVec3::new(1.2, 0.0, 0.0) }];
    let (eye, at) = (DVec3::new(0.6, -2.0, 6.0), DVec3::new(0.6, -2.0, 0.0));
    let mut scene = seen(vec![guitar], [240, 180], eye, at);
    scene.image.transparent = false;
    let colours = |picture: &Picture| -> Vec<[f64; 4]> {
        picture.rgba.iter().map(|&[r, g, b, _]| [f64::from(r), f64::from(g), f64::from(b), 0.0]).collect()
    };
    let found =
        psnr(&colours(&render(&scene, &with(BlurMode::supersample(64)))), &colours(&truth("guitar_blur_linear.exr")));
    println!("{found:.1} dB");
    assert!(found >= 95.0, "{found:.1} dB");
}

/// Gaussians of all shapes in a box about the origin.
fn random_capture(seed: u64, count: usize, degree: u8) -> Gaussians {
    let mut n = Random(seed);
    let mut capture = Gaussians { degree, ..Gaussians::default() };
    for _ in 0..count {
        let mut three = |low: f64, high: f64| Vec3::from_array([0, 1, 2].map(|_| n.within(low, high) as f32));
        capture.position.push(three(-1.0, 1.0));
        capture.sigma.push(three(-6.0, -1.5).exp());
        let axis = three(-1.0, 1.0).normalize_or(Vec3::X);
        capture.base.push(three(-2.0, 2.0));
        for _ in 0..capture.harmonics_each() {
            capture.harmonics.push(three(-0.3, 0.3));
        }
        capture.rotation.push(Quat::from_axis_angle(axis, n.within(0.0, 6.0) as f32));
        capture.opacity.push(n.next() as f32);
    }
    capture
}

/// Long thin splats, splats larger than the image, harmonics of each degree, the eye within the capture.
#[test]
fn random_captures_are_the_definition() {
    for (seed, count, degree, eye) in [
        (1, 400, 0, [0.0, 0.0, -4.0]),
        (2, 200, 1, [0.5, -1.0, -3.0]),
        (3, 200, 2, [1.5, 0.5, 2.0]),
        (4, 300, 3, [-2.0, -1.0, 2.5]),
        (5, 100, 3, [0.1, 0.2, -0.3]),
    ] {
        let capture = random_capture(seed, count, degree);
        let (eye, at) = (DVec3::from(eye), DVec3::new(0.1, 0.0, 0.2));
        let want = picture(&capture, &CaptureCamera { eye, at, size: [97, 71] });
        let scene = seen(vec![Object::new(capture)], [97, 71], eye, at);
        let found = psnr(&coded(&render(&scene, &still())), &want);
        println!("degree {degree}: {found:.1} dB");
        assert!(found >= 85.0, "degree {degree}: {found:.1} dB");
    }
}

/// One Gaussian of standard deviation `sigma` about `position`; its colour is coded.
fn one(position: Vec3, sigma: f32, opacity: f32, colour: Vec3) -> Gaussians {
    Gaussians {
        position: vec![position],
        sigma: vec![Vec3::splat(sigma)],
        rotation: vec![Quat::IDENTITY],
        opacity: vec![opacity],
        base: vec![(colour - 0.5) / 0.282_094_8],
        ..Gaussians::default()
    }
}

fn both(a: &Gaussians, b: &Gaussians) -> Gaussians {
    Gaussians {
        position: [&a.position[..], &b.position].concat(),
        sigma: [&a.sigma[..], &b.sigma].concat(),
        rotation: [&a.rotation[..], &b.rotation].concat(),
        opacity: [&a.opacity[..], &b.opacity].concat(),
        base: [&a.base[..], &b.base].concat(),
        ..Gaussians::default()
    }
}

/// Linear light of a coded value, by the curve's definition.
fn decoded(e: f64) -> f64 {
    if e <= 0.040_45 { e / 12.92 } else { ((e + 0.055) / 1.055).powf(2.4) }
}

/// The code of linear light, likewise.
pub(crate) fn encoded(l: f64) -> f64 {
    if l <= 0.003_130_8 { l * 12.92 } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 }
}

/// A Gaussian moves along the middle row at constant depth. Its alpha at a pixel is a function of time that a sum of
/// 4096 instants integrates.
#[test]
fn a_gaussian_in_motion_has_the_light_of_its_instants() {
    let (sigma, opacity, colour, velocity) = (0.05, 0.8, 0.7, 0.9);
    let mut object = Object::new(one(Vec3::ZERO, sigma as f32, opacity as f32, Vec3::splat(colour as f32)));
    object.motions = vec![Motion::Linear { velocity: DVec3::new(velocity, 0.0, 0.0) }];
    let size = [65, 33];
    let mut scene = seen(vec![object], size, DVec3::new(0.45, 0.0, -4.0), DVec3::new(0.45, 0.0, 0.0));
    scene.image.transparent = false;
    let found = render(&scene, &with(BlurMode::supersample(256)));
    let focal = 16.5 / 25_f64.to_radians().tan();
    let mut worst = 0.0_f64;
    for x in 0..size[0] {
        let light: f64 = (0..4096)
            .map(|i| {
                let place = (velocity * (f64::from(i) + 0.5) / 4096.0 - 0.45) / 4.0;
                let slope = place.clamp(-1.3 * 32.5 / focal, 1.3 * 32.5 / focal);
                // Seen off the axis it is longer along the row.
                let variance = (sigma * focal / 4.0).powi(2) * (1.0 + slope * slope) + 0.3;
                let d = f64::from(x) + 0.5 - 32.5 - focal * place;
                let alpha = (opacity * (-0.5 * d * d / variance).exp()).min(0.99);
                decoded(if alpha < 1.0 / 255.0 { 0.0 } else { alpha * colour })
            })
            .sum();
        let [r, ..] = found.rgba[(16 * size[0] + x) as usize];
        worst = worst.max((f64::from(r) - light / 4096.0).abs());
    }
    println!("worst difference {worst:.1e}");
    assert!(worst < 2e-4, "{worst}");
}

/// Two Gaussians pass one another in depth: the nearer one is composited first, whichever it is in the file.
#[test]
fn the_nearer_gaussian_is_before_the_other() {
    let (red, blue) = (Vec3::new(0.9, 0.1, 0.1), Vec3::new(0.1, 0.2, 0.8));
    for swap in [1.0, -1.0] {
        let near = one(Vec3::new(0.0, 0.0, -0.2 * swap), 1.0, 0.5, red);
        let far = one(Vec3::new(0.0, 0.0, 0.2 * swap), 1.0, 0.6, blue);
        for capture in [both(&near, &far), both(&far, &near)] {
            let scene = seen(vec![Object::new(capture)], [9, 9], DVec3::new(0.0, 0.0, -4.0), DVec3::ZERO);
            let [r, ..] = coded(&render(&scene, &still()))[40];
            let want = if swap > 0.0 { 0.5 * 0.9 + 0.5 * 0.6 * 0.1 } else { 0.6 * 0.1 + 0.4 * 0.5 * 0.9 };
            assert!((r - want).abs() < 1e-5, "{r} for {want}");
        }
    }
}

/// A large Gaussian covers all pixels with alpha 0.5, up to 1e-4.
fn veil(z: f32, linear: bool) -> Object {
    let capture = one(Vec3::new(0.0, 0.0, z), 1e3, 0.5, Vec3::new(0.2, 0.5, 0.9));
    Object::new(Gaussians { linear, ..capture })
}

/// A square about the origin that faces the eye at -z, unlit.
fn card(colour: Vec3) -> Object {
    let points = (-8..=8).flat_map(|j| (-8..=8).map(move |i| (i, j)));
    let surfels: Surfels = round_surfels(
        points.map(|(i, j)| (DVec3::new(f64::from(i) * 0.1, f64::from(j) * 0.1, 0.0), DVec3::NEG_Z, 0.1, colour)),
    );
    let mut card = object(surfels);
    card.shape.surface_mut().unwrap().material = Some(UNLIT);
    card.epsilon = Some(0.01);
    card
}

fn at_middle(picture: &Picture) -> [f32; 4] {
    picture.rgba[(picture.height / 2 * picture.width + picture.width / 2) as usize]
}

fn assert_near(found: [f32; 4], want: [f64; 4], tolerance: f64) {
    let worst = found.iter().zip(want).map(|(&found, want)| (f64::from(found) - want).abs()).fold(0.0, f64::max);
    assert!(worst < tolerance, "{found:?} for {want:?}");
}

/// Coded captures make the image coded: what is behind them is encoded, composited and decoded. Linear ones do not.
#[test]
fn the_image_is_composited_in_one_space() {
    let background = [0.04, 0.3, 0.6];
    let own = [0.2, 0.5, 0.9];
    for (linear, transparent) in [(false, false), (false, true), (true, false), (true, true)] {
        let mut scene = seen(vec![veil(0.0, linear)], [9, 9], DVec3::new(0.0, 0.0, -4.0), DVec3::ZERO);
        scene.image.background = DVec3::from(background);
        scene.image.transparent = transparent;
        let through = |c: usize| match (linear, transparent) {
            (false, false) => decoded(0.5 * own[c] + 0.5 * encoded(background[c])),
            (false, true) => 0.5 * decoded(own[c]),
            (true, false) => 0.5 * own[c] + 0.5 * background[c],
            (true, true) => 0.5 * own[c],
        };
        let alpha = if transparent { 0.5 } else { 1.0 };
        assert_near(at_middle(&render(&scene, &still())), [through(0), through(1), through(2), alpha], 2e-5);
        // Mode auto lays its halves over the background by itself.
        let auto = RenderOptions { quality: Quality::Error(ErrorTarget::default()), ..still() };
        assert_near(at_middle(&render(&scene, &auto)), [through(0), through(1), through(2), alpha], 2e-5);
        // As soon as one is coded, all is.
        scene.objects.push(Object::new(one(Vec3::new(9.0, 0.0, 0.0), 0.01, 0.5, Vec3::ONE)));
        if linear && !transparent {
            let mixed = |c: usize| decoded(0.5 * encoded(own[c]) + 0.5 * encoded(background[c]));
            assert_near(at_middle(&render(&scene, &still())), [mixed(0), mixed(1), mixed(2), alpha], 2e-5);
        }
    }
}

/// In motion each instant is decoded by itself.
#[test]
fn an_opaque_card_hides_what_is_behind_it() {
    let card_colour = [0.3, 0.1, 0.6];
    let own = [0.2, 0.5, 0.9];
    for mode in [
        BlurMode::Still { pixel_samples: 4 },
        BlurMode::supersample(3),
        BlurMode::interleaved(2, Interleave::Two),
        BlurMode::Bucket {
            buckets: 2,
            samples: 3,
            pixel_samples: None,
            interleave: Interleave::None,
            times: Times::default(),
        },
    ] {
        for (z, hidden) in [(-0.5, false), (0.5, true)] {
            for moves in [false, true] {
                let mut objects = vec![veil(z, false), card(Vec3::from(card_colour.map(|c| c as f32)))];
                if moves {
                    let there = Motion::Linear { velocity: DVec3::new(0.02, 0.0, 0.0) };
                    for object in &mut objects {
                        object.motions = vec![there];
                    }
                }
                let scene = seen(objects, [17, 17], DVec3::new(0.0, 0.0, -2.0), DVec3::ZERO);
                let through = |c: usize| decoded(0.5 * own[c] + 0.5 * encoded(card_colour[c]));
                let want = if hidden { card_colour } else { [through(0), through(1), through(2)] };
                let found = at_middle(&render(&scene, &with(mode)));
                assert_near(found, [want[0], want[1], want[2], 1.0], 5e-5);
            }
        }
    }
}

fn bits(picture: &Picture) -> Vec<u32> {
    let planes = picture.layers.iter().flat_map(|layer| layer.planes.iter().flatten());
    picture.rgba.iter().flatten().chain(planes).map(|value| value.to_bits()).collect()
}

/// Two captures, one of which moves, and opaque surfels between them.
fn mixed_scene(count: usize, size: [u32; 2]) -> Scene {
    let fixed = Object::new(random_capture(11, count, 1));
    let mut moving = Object::new(random_capture(12, count, 0));
    moving.motions = vec![
        Motion::Linear { velocity: DVec3::new(0.4, 0.1, -0.3) },
        Motion::Rotation { axis: DVec3::Y, per_frame: 0.3, centre: DVec3::ZERO },
    ];
    let mut scene =
        seen(vec![fixed, card(Vec3::new(0.5, 0.4, 0.2)), moving], size, DVec3::new(0.5, -1.0, -3.5), DVec3::ZERO);
    scene.image.background = DVec3::new(0.1, 0.2, 0.3);
    scene.image.transparent = false;
    scene
}

const AOVS: [Aov; 4] = [Aov::Alpha, Aov::Depth, Aov::Normal, Aov::Velocity];

/// Supersampling with the filter `point` is the mean of stills at the same times. There all objects are static.
#[test]
fn what_is_static_is_merged_in_order_with_what_moves() {
    let scene = mixed_scene(150, [60, 45]);
    let samples = 6;
    let found = render(&scene, &with(BlurMode::supersample(samples)));
    let mut mean = vec![[0.0; 4]; found.rgba.len()];
    for i in 0..samples {
        let time = (f64::from(i) + 0.5) / f64::from(samples);
        let one =
            splatblur::renderer::render_frame(&mut splatblur::backend::cpu::Cpu::default(), &scene, time, &still());
        for (mean, pixel) in mean.iter_mut().zip(one.unwrap().picture.rgba) {
            (0..4).for_each(|c| mean[c] += f64::from(pixel[c]) / f64::from(samples));
        }
    }
    let worst = found.rgba.iter().flatten().zip(mean.iter().flatten());
    let worst = worst.map(|(found, want)| (f64::from(*found) - want).abs()).fold(0.0, f64::max);
    println!("worst difference {worst:.1e}");
    assert!(worst < 2e-6, "{worst}");
}

/// With little memory splats come in slabs of depth, and the image in bands.
#[test]
fn memory_and_threads_change_no_byte() {
    let scene = mixed_scene(60_000, [80, 60]);
    for mode in [
        BlurMode::supersample(3),
        BlurMode::interleaved(2, Interleave::Two),
        BlurMode::Bucket {
            buckets: 2,
            samples: 2,
            pixel_samples: None,
            interleave: Interleave::None,
            times: Times::default(),
        },
    ] {
        let options = RenderOptions {
            look: Look { aovs: AOVS.to_vec(), filter: PixelFilter::Box, ..with(mode).look },
            ..with(mode)
        };
        let whole =
            splatblur::renderer::render_frame(&mut splatblur::backend::cpu::Cpu::default(), &scene, 0, &options);
        let (want, splats) = whole.map(|whole| (whole.picture, whole.stats.splats)).unwrap();
        assert!(want.rgba.iter().any(|pixel| pixel[0] > 0.2));
        for (threads, memory) in [(1, 1 << 30), (3, 32 << 20)] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let few = RenderOptions { memory, ..options.clone() };
            let found = pool.install(|| {
                splatblur::renderer::render_frame(&mut splatblur::backend::cpu::Cpu::default(), &scene, 0, &few)
            });
            match found {
                Ok(found) => {
                    println!("{mode}, {threads} threads, {memory}: {} splats", found.stats.splats);
                    assert!(bits(&found.picture) == bits(&want), "{mode}, {threads} threads, {memory}");
                    // What is static is projected again for each slab of each sample.
                    let in_slabs = found.stats.splats > splats;
                    assert_eq!(in_slabs, memory < 1 << 30, "{mode}, {threads} threads, {memory}");
                }
                Err(error) => panic!("{mode}, {threads} threads: {error}"),
            }
        }
    }
}

/// The filter is as wide in pixels of the image, however many positions a lattice has.
#[test]
fn a_lattice_shows_the_same_still_scene() {
    let capture = random_capture(21, 200, 3);
    let scene = seen(vec![Object::new(capture)], [61, 47], DVec3::new(0.5, -1.0, -3.0), DVec3::ZERO);
    let want = coded(&render(&scene, &still()));
    for interleave in [Interleave::Two, Interleave::Four] {
        let found = psnr(&coded(&render(&scene, &with(BlurMode::interleaved(2, interleave)))), &want);
        assert!(found >= 100.0, "{interleave:?}: {found:.1} dB");
    }
}

#[test]
fn an_object_may_fade_lose_harmonics_and_be_cropped() {
    let capture = Arc::new(random_capture(31, 300, 3));
    let (eye, at, size) = (DVec3::new(0.5, -1.0, -3.0), DVec3::ZERO, [61, 47]);
    let shown = |how: &dyn Fn(&mut Object)| {
        let mut object = Object::new(Arc::clone(&capture));
        how(&mut object);
        coded(&render(&seen(vec![object], size, eye, at), &still()))
    };
    let defined = |change: &dyn Fn(&mut Gaussians)| {
        let mut changed = (*capture).clone();
        change(&mut changed);
        picture(&changed, &CaptureCamera { eye, at, size: size.map(|pixels| pixels as usize) })
    };
    let faded = shown(&|object| object.opacity = 0.4);
    let want = defined(&|capture| capture.opacity.iter_mut().for_each(|opacity| *opacity *= 0.4));
    assert!(psnr(&faded, &want) > 85.0, "{}", psnr(&faded, &want));
    let plain = shown(&|object| {
        let Shape::Gaussians { capture, .. } = &mut object.shape else { panic!("no capture") };
        capture.harmonics = 1;
    });
    let want = defined(&|capture| {
        let each = capture.harmonics_each();
        capture.harmonics.iter_mut().enumerate().filter(|(i, _)| i % each >= 3).for_each(|(_, h)| *h = Vec3::ZERO);
    });
    assert!(psnr(&plain, &want) > 85.0, "{}", psnr(&plain, &want));
    let (low, high) = (DVec3::new(-0.5, -2.0, -0.75), DVec3::new(0.8, 0.3, 2.0));
    let cropped = shown(&|object| object.shape.gaussians_mut().unwrap().crop = Some([low, high]));
    let want = defined(&|capture| {
        for (position, opacity) in capture.position.iter().zip(&mut capture.opacity) {
            let p = position.as_dvec3();
            if p.cmplt(low).any() || p.cmpgt(high).any() {
                *opacity = 0.0;
            }
        }
    });
    assert!(psnr(&cropped, &want) > 85.0, "{}", psnr(&cropped, &want));
}

/// What the filter of an antialiased capture spreads, it takes from the opacity: sqrt(|V| / |V'|).
#[test]
fn an_antialiased_gaussian_keeps_its_weight() {
    let sigma = 0.004;
    let mut object = Object::new(one(Vec3::ZERO, sigma as f32, 0.9, Vec3::ONE));
    let Shape::Gaussians { capture, .. } = &mut object.shape else { panic!("no capture") };
    capture.antialias = Some(true);
    let scene = seen(vec![object], [9, 9], DVec3::new(0.0, 0.0, -1.0), DVec3::ZERO);
    let variance = (sigma * 4.5 / 25_f64.to_radians().tan()).powi(2);
    let want = 0.9 * variance / (variance + 0.3);
    let found = f64::from(at_middle(&render(&scene, &still()))[3]);
    assert!(want > 0.004 && (found - want).abs() < 1e-6, "{found} for {want}");
}

/// Depth is the mean of the centres' depths, velocity that of the centres on the screen; both by what each adds.
#[test]
fn layers_are_means_by_what_is_seen() {
    let near = one(Vec3::new(0.0, 0.0, -1.0), 1e3, 0.5, Vec3::ONE);
    let far = one(Vec3::new(0.0, 0.0, 1.0), 1e3, 0.25, Vec3::ONE);
    let mut object = Object::new(both(&near, &far));
    object.motions = vec![Motion::Linear { velocity: DVec3::new(0.08, 0.0, 0.0) }];
    let scene = seen(vec![object], [9, 9], DVec3::new(0.0, 0.0, -4.0), DVec3::ZERO);
    let options = RenderOptions {
        look: Look { aovs: AOVS.to_vec(), ..with(BlurMode::supersample(2)).look },
        ..with(BlurMode::supersample(2))
    };
    let picture = render(&scene, &options);
    let value = |aov: Aov, channel: usize| {
        let layer = picture.layers.iter().find(|layer| layer.aov == aov).unwrap();
        f64::from(layer.planes[channel][40])
    };
    let [of_near, of_far] = [0.5, 0.5 * 0.25];
    let alpha = of_near + of_far;
    let focal = 4.5 / 25_f64.to_radians().tan();
    let speed = 0.08 * focal * (of_near / 3.0 + of_far / 5.0) / alpha;
    assert!((value(Aov::Alpha, 0) - alpha).abs() < 1e-4);
    assert!((value(Aov::Depth, 0) - (3.0 * of_near + 5.0 * of_far) / alpha).abs() < 1e-3);
    assert!((value(Aov::Velocity, 0) - speed).abs() < 1e-3 && value(Aov::Velocity, 1).abs() < 1e-5);
    assert_eq!(value(Aov::Normal, 2), 0.0);
}

/// Nearer than 0.2 of the object's scale, or than the camera's nearest depth, nothing is drawn.
#[test]
fn gaussians_at_the_eye_are_left_out() {
    let shown = |depth: f64, scale: f64, near: f64| {
        let mut object = Object::new(one(Vec3::new(0.0, 0.0, (depth / scale) as f32), 0.1, 0.5, Vec3::ONE));
        object.transform.scale = DVec3::splat(scale);
        let mut scene = seen(vec![object], [9, 9], DVec3::ZERO, DVec3::Z);
        scene.camera.near = near;
        at_middle(&render(&scene, &still()))[3] > 0.1
    };
    assert!(shown(0.21, 1.0, 0.01) && !shown(0.19, 1.0, 0.01));
    assert!(shown(0.61, 3.0, 0.01) && !shown(0.59, 3.0, 0.01));
    assert!(shown(0.9, 3.0, 0.8) && !shown(0.7, 3.0, 0.8));
    assert!(!shown(-1.0, 1.0, 0.01));
}

#[test]
fn kernels_in_motion_refuse_captures() {
    let scene = seen(vec![veil(0.0, false)], [9, 9], DVec3::new(0.0, 0.0, -4.0), DVec3::ZERO);
    let options = with("volumetric:4".parse().unwrap());
    let refused = splatblur::renderer::render_frame(&mut splatblur::backend::cpu::Cpu::default(), &scene, 0, &options);
    let words = refused.map(|_| ()).unwrap_err().to_string();
    assert!(words.contains("capture") && words.contains("volumetric") && !words.contains('\n'), "{words}");
}

/// The object layer knows which capture adds most to a pixel.
#[test]
fn each_pixel_knows_its_object() {
    let left = Object::new(one(Vec3::new(-0.5, 0.0, 0.0), 0.2, 0.9, Vec3::ZERO));
    let right = Object::new(one(Vec3::new(0.5, 0.0, 0.5), 0.2, 0.9, Vec3::ONE));
    let scene = seen(vec![left, right], [33, 9], DVec3::new(0.0, 0.0, -2.0), DVec3::ZERO);
    let options = RenderOptions { look: Look { aovs: vec![Aov::Object], ..still().look }, ..still() };
    let picture = render(&scene, &options);
    let indices = &picture.layers[0].planes[0][4 * 33..5 * 33];

    assert!(indices.contains(&1.0) && indices.contains(&2.0), "{indices:?}");
    let place = |index: f32| indices.iter().position(|i| *i == index).unwrap();
    assert!(place(1.0) < place(2.0), "{indices:?}");
}

/// Whatever a reader lets through is drawn or left out: no NaN, no infinity, no end of the program.
#[test]
fn extreme_gaussians_are_drawn_or_left_out() {
    let mut capture = random_capture(41, 40, 3);
    let extreme = [0.0, 1e-30, 1e-6, 1.0, 1e6, 1e15];
    for (i, size) in extreme.into_iter().enumerate() {
        for (j, other) in extreme.into_iter().enumerate() {
            let at = (i * extreme.len() + j) % capture.len();
            capture.sigma[at] = Vec3::new(size, other, extreme[(i + j) % 6]);
            capture.opacity[at] = [0.0, 1.0, 0.5][(i + j) % 3];
        }
    }
    // At the eye, behind it, on the plane of the camera, and as far away as a file may say.
    capture.position[0] = Vec3::new(0.5, -1.0, -3.0);
    capture.position[1] = Vec3::new(0.5, -1.0, -30.0);
    capture.position[2] = Vec3::new(5.0, -1.0, -3.0);
    capture.position[3] = Vec3::splat(1e15);
    capture.base[4] = Vec3::splat(1e15);
    capture.harmonics[75] = Vec3::splat(-1e15);
    for scale in [1e-9, 1.0, 1e9] {
        let mut object = Object::new(capture.clone());
        object.transform.scale = DVec3::splat(scale);
        object.motions = vec![Motion::Rotation { axis: DVec3::Y, per_frame: 3.0, centre: DVec3::ZERO }];
        let scene = seen(vec![object], [40, 30], DVec3::new(0.5, -1.0, -3.0), DVec3::ZERO);
        for mode in [BlurMode::supersample(3), "bucket:2x2".parse().unwrap()] {
            let options = RenderOptions { look: Look { aovs: AOVS.to_vec(), ..with(mode).look }, ..with(mode) };
            let picture = render(&scene, &options);
            assert!(picture.rgba.iter().flatten().all(|value| value.is_finite()), "scale {scale}, {mode}");
            for layer in picture.layers.iter().filter(|layer| layer.aov != Aov::Depth) {
                assert!(layer.planes.iter().flatten().all(|value| value.is_finite()), "scale {scale}, {:?}", layer.aov);
            }
        }
    }
}

/// Each position of the pixel filter samples the Gaussian where it lies, whether the object rests or moves.
#[test]
fn positions_lie_where_the_filter_has_them() {
    let (sigma, opacity) = (0.12, 0.8);
    let focal = 8.5 / 25_f64.to_radians().tan();
    let variance = (sigma * focal / 2.0).powi(2) + 0.3;
    for count in [2, 8] {
        for (mode, along) in [(BlurMode::Still { pixel_samples: count }, 0.0), (BlurMode::supersample(count), 0.02)] {
            let offsets = splatblur::sampling::pixel_offsets(count, 1);
            let mut object = Object::new(one(Vec3::ZERO, sigma as f32, opacity as f32, Vec3::ONE));
            // Towards the eye: the centre stays in the middle.
            object.motions = vec![Motion::Linear { velocity: DVec3::new(0.0, 0.0, -along) }];
            let scene = seen(vec![object], [17, 17], DVec3::new(0.0, 0.0, -2.0), DVec3::ZERO);
            let options =
                RenderOptions { look: Look { filter: PixelFilter::Box, seed: 1, ..with(mode).look }, ..with(mode) };
            let picture = render(&scene, &options);
            for (x, y) in (0..17_u32).flat_map(|y| (0..17_u32).map(move |x| (x, y))) {
                let alpha = |&[dx, dy]: &[f32; 2]| {
                    let d = DVec3::new(f64::from(x) + f64::from(dx) - 8.0, f64::from(y) + f64::from(dy) - 8.0, 0.0);
                    let alpha = opacity * (-0.5 * d.length_squared() / variance).exp();
                    if alpha < 1.0 / 255.0 { 0.0 } else { alpha }
                };
                let want = offsets.iter().map(alpha).sum::<f64>() / f64::from(count);
                let found = f64::from(picture.rgba[(y * 17 + x) as usize][3]);
                assert!(
                    (found - want).abs() < if along > 0.0 { 0.01 } else { 1e-5 },
                    "{mode} {x} {y}: {found} for {want}"
                );
            }
        }
    }
}

/// The order of a bucket is that of its middle. In its first sample what comes first in that order lies behind a card;
/// what comes later lies before it, and shows.
#[test]
fn a_bucket_shows_what_is_before_a_card_though_it_comes_late() {
    let (own, card_colour, faint) = ([0.2, 0.5, 0.9], [0.3, 0.1, 0.6], 0.004_f64);
    let crowd = one(Vec3::new(0.0, 0.0, 1.15), 1e3, faint as f32, Vec3::ZERO);
    let crowd = (0..6).fold(crowd, |crowd, _| both(&crowd, &crowd));
    assert_eq!(crowd.len(), 64);
    // Behind the card, which fills the image, at first; then nearer than the veil.
    let mut crowd = Object::new(crowd);
    crowd.motions = vec![Motion::Linear { velocity: DVec3::new(0.0, 0.0, -2.6) }];
    let objects = vec![crowd, veil(-0.4, false), card(Vec3::from(card_colour.map(|c| c as f32)))];
    let scene = seen(objects, [17, 17], DVec3::new(0.0, 0.0, -1.5), DVec3::ZERO);
    let found = at_middle(&render(&scene, &with("bucket:1x2".parse().unwrap())));
    let through = |c: usize, before: f64| decoded(before * (0.5 * own[c] + 0.5 * encoded(card_colour[c])));
    let want = |c: usize| 0.5 * through(c, 1.0) + 0.5 * through(c, (1.0 - faint).powi(64));
    assert_near(found, [want(0), want(1), want(2), 1.0], 1e-4);
}

/// Depth and velocity of surfels show through what is before them.
#[test]
fn layers_hold_surfels_behind_captures() {
    let objects = vec![veil(-1.0, false), card(Vec3::ONE)];
    let scene = seen(objects, [17, 17], DVec3::new(0.0, 0.0, -4.0), DVec3::ZERO);
    let picture = render(&scene, &RenderOptions { look: Look { aovs: AOVS.to_vec(), ..still().look }, ..still() });
    let value = |aov: Aov, channel: usize| {
        let layer = picture.layers.iter().find(|layer| layer.aov == aov).unwrap();
        f64::from(layer.planes[channel][17 * 8 + 8])
    };
    assert!((value(Aov::Depth, 0) - (0.5 * 3.0 + 0.5 * 4.0)).abs() < 1e-3, "{}", value(Aov::Depth, 0));
    assert!((value(Aov::Normal, 2) + 0.5).abs() < 1e-3, "{}", value(Aov::Normal, 2));
}

//! See-through surfels against closed forms: layers one behind the other, side by side, and beside captures.

#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, reason = "tests may stop and report")]

use glam::{DVec3, Quat, Vec3};
use splatblur::backend::cpu::Cpu;
use splatblur::compare::flip;
use splatblur::film::{Aov, Picture};
use splatblur::model::{Gaussians, Surfels};
use splatblur::options::{
    BlurMode, ErrorTarget, Interleave, Look, PixelFilter, Prefilter, Quality, RenderOptions, SweptKernel, Times,
};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Motion, Object, Scene};

use crate::support::{UNLIT, object, render, round_surfels, scene};

const SIZE: [u32; 2] = [33, 25];

/// A plane of surfels across the view at depth 4 - `z`, unlit.
fn plane(z: f64, opacity: f64, colour: Vec3) -> Object {
    let places = (-30..=30).flat_map(|j| (-40..=40).map(move |i| (f64::from(i), f64::from(j))));
    let surfels: Surfels =
        round_surfels(places.map(|(i, j)| (DVec3::new(0.05 * i, 0.05 * j, z), DVec3::Z, 0.05, colour)));
    let mut plane = object(surfels);
    plane.shape.surface_mut().unwrap().material = Some(UNLIT);
    plane.epsilon = Some(0.01);
    plane.opacity = opacity;
    plane
}

fn view(objects: Vec<Object>) -> Scene {
    let mut scene = scene(objects, SIZE, DVec3::new(0.0, 0.0, 4.0), 30.0);
    scene.image.transparent = true;
    scene
}

fn bucket(buckets: u32, samples: u32) -> BlurMode {
    BlurMode::Bucket { buckets, samples, pixel_samples: None, interleave: Interleave::None, times: Times::default() }
}

fn with(quality: impl Into<Quality>, prefilter: Prefilter) -> RenderOptions {
    RenderOptions {
        quality: quality.into(),
        prefilter,
        look: Look { filter: PixelFilter::Point, ..Look::default() },
        ..RenderOptions::default()
    }
}

const STILL: BlurMode = BlurMode::Still { pixel_samples: 1 };

/// Premultiplied colour and alpha of layers, the nearest first.
fn over(layers: &[(f64, Vec3)]) -> [f64; 4] {
    let (mut sum, mut through) = ([0.0; 4], 1.0);
    for (opacity, colour) in layers {
        let light = through * opacity;
        for (sum, c) in sum.iter_mut().zip([colour.x, colour.y, colour.z, 1.0]) {
            *sum += light * f64::from(c);
        }
        through *= 1.0 - opacity;
    }
    sum
}

/// Worst difference over the pixels that are at least 4 from the edge of the image.
fn worst(found: &Picture, want: [f64; 4]) -> f64 {
    let inside = |x: u32, y: u32| (4..SIZE[0] - 4).contains(&x) && (4..SIZE[1] - 4).contains(&y);
    let pixels = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))).filter(|&(x, y)| inside(x, y));
    let pixels = pixels.flat_map(|(x, y)| found.rgba[(y * SIZE[0] + x) as usize].into_iter().zip(want));
    pixels.map(|(found, want)| (f64::from(found) - want).abs()).fold(0.0, f64::max)
}

fn assert_shows(scene: &Scene, options: &RenderOptions, layers: &[(f64, Vec3)], what: &str) {
    let found = worst(&render(scene, options), over(layers));
    assert!(found < 1e-5, "{what}: {found:.1e}");
}

const RED: Vec3 = Vec3::new(0.9, 0.1, 0.2);
const BLUE: Vec3 = Vec3::new(0.1, 0.3, 0.8);

#[test]
fn two_planes_in_motion_are_composited() {
    let modes: [Quality; 5] = [
        STILL.into(),
        BlurMode::supersample(4).into(),
        BlurMode::interleaved(2, Interleave::Two).into(),
        bucket(2, 3).into(),
        Quality::Error(ErrorTarget::default()),
    ];
    for quality in modes {
        for prefilter in [Prefilter::None, Prefilter::Approx, Prefilter::Ewa] {
            for moves in [false, true] {
                let (mut near, mut far) = (plane(0.5, 0.3, RED), plane(-0.5, 0.6, BLUE));
                if moves {
                    near.motions = vec![Motion::Linear { velocity: DVec3::new(0.2, 0.05, 0.1) }];
                    far.motions = vec![Motion::Linear { velocity: DVec3::new(-0.1, 0.1, 0.0) }];
                }
                for objects in [vec![near.clone(), far.clone()], vec![far, near]] {
                    let what = format!("{quality:?}, {prefilter:?}, moves: {moves}");
                    assert_shows(&view(objects), &with(quality, prefilter), &[(0.3, RED), (0.6, BLUE)], &what);
                }
            }
        }
    }
}

fn colour_of(i: usize) -> Vec3 {
    Vec3::new(0.1 * i as f32, 1.0 - 0.1 * i as f32, if i.is_multiple_of(2) { 0.2 } else { 0.7 })
}

#[test]
fn eight_layers_show_and_the_rest_is_counted() {
    for n in 1..=10_usize {
        let layers: Vec<(f64, Vec3)> = (0..n).map(|i| (0.15 + 0.02 * i as f64, colour_of(i))).collect();
        // The order of objects is not that of depth: even ones come before odd ones.
        let order: Vec<usize> = (0..n).step_by(2).chain((1..n).step_by(2)).collect();
        let objects = order.iter().map(|&i| plane(1.0 - 0.2 * i as f64, layers[i].0, layers[i].1)).collect();
        let scene = view(objects);
        let options = with(STILL, Prefilter::Ewa);
        assert_shows(&scene, &options, &layers[..n.min(8)], &format!("{n} layers"));
        let left_out = render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap().stats.left_out;
        assert_eq!(left_out > 0, n > 8, "{n} layers: {left_out} pixels");
    }
}

/// With little memory splats pass in batches. The picture is the same, and a pixel with more layers is counted once.
#[test]
fn memory_changes_neither_picture_nor_count() {
    let objects = (0..12).map(|i| plane(1.0 - 0.1 * f64::from(i), 0.2, colour_of(i as usize))).collect();
    let scene = view(objects);
    let with_memory = |memory: u64| {
        let options = RenderOptions { memory, ..with(STILL, Prefilter::Ewa) };
        render_frame(&mut Cpu::default(), &scene, 0, &options)
    };
    let whole = with_memory(1 << 30).unwrap();
    let few = (1..1 << 12).find_map(|step| with_memory(step << 16).ok()).unwrap();
    assert!(few.stats.splats > 2 * whole.stats.splats, "{} splats of {}", few.stats.splats, whole.stats.splats);
    assert!(few.picture == whole.picture);
    assert!(whole.stats.left_out > 100);
    assert_eq!(few.stats.left_out, whole.stats.left_out);
}

/// Kernels whose depths differ by less than the tolerance are one layer, and are normalised together.
#[test]
fn splats_that_straddle_the_tolerance_are_one_layer_or_two() {
    for (apart, together) in [(0.009, true), (0.011, false)] {
        let objects = vec![plane(apart, 0.5, RED), plane(0.0, 0.5, BLUE)];
        let found = render(&view(objects), &with(STILL, Prefilter::None));
        let [.., alpha] = found.rgba[(12 * SIZE[0] + 16) as usize];
        let want = if together { 0.5 } else { 0.75 };
        // A ray off the axis meets both at the same ratio of depths.
        assert!((alpha - want).abs() < 1e-5, "{apart} apart: {alpha}");
    }
}

#[test]
fn opaque_surfels_hide_layers_and_show_through_them() {
    for prefilter in [Prefilter::None, Prefilter::Approx, Prefilter::Ewa] {
        for mode in [STILL, BlurMode::supersample(3), bucket(2, 2)] {
            let solid = plane(0.0, 1.0, Vec3::new(0.4, 0.5, 0.1));
            let objects = vec![plane(-0.5, 0.6, BLUE), solid, plane(0.5, 0.3, RED)];
            let layers = [(0.3, RED), (1.0, Vec3::new(0.4, 0.5, 0.1))];
            assert_shows(&view(objects), &with(mode, prefilter), &layers, &format!("{mode:?}, {prefilter:?}"));
        }
    }
}

#[test]
fn surfels_that_are_nearly_opaque_need_no_order() {
    let almost = plane(0.5, 254.0 / 255.0, RED);
    assert!(!almost.is_see_through());
    assert!(plane(0.5, 253.9 / 255.0, RED).is_see_through());
    assert_shows(&view(vec![almost, plane(0.0, 0.5, BLUE)]), &with(STILL, Prefilter::Ewa), &[(1.0, RED)], "almost");
    let mut column = plane(0.5, 0.5, RED);
    let mut surfels = (**column.shape.surfels().unwrap().surfels()).clone();
    surfels.opacity = vec![0.5; surfels.len()];
    column.shape = surfels.into();
    assert_shows(&view(vec![column]), &with(STILL, Prefilter::Ewa), &[(0.25, RED)], "a column and a factor");
}

/// A Gaussian that covers the view with alpha .5, linear.
fn veil(z: f32, colour: Vec3) -> Object {
    Object::new(Gaussians {
        position: vec![Vec3::new(0.0, 0.0, z)],
        sigma: vec![Vec3::splat(1e3)],
        rotation: vec![Quat::IDENTITY],
        opacity: vec![0.5],
        base: vec![(colour - 0.5) / 0.282_094_8],
        linear: true,
        ..Gaussians::default()
    })
}

#[test]
fn a_capture_lies_between_layers() {
    let green = Vec3::new(0.2, 0.8, 0.3);
    for mode in [STILL, BlurMode::supersample(2), bucket(1, 2)] {
        let objects = vec![plane(-0.5, 0.6, BLUE), veil(0.0, green), plane(0.5, 0.3, RED)];
        let layers = [(0.3, RED), (0.5, green), (0.6, BLUE)];
        let found = worst(&render(&view(objects), &with(mode, Prefilter::Ewa)), over(&layers));
        // The Gaussian's alpha falls by 1e-6 towards the edge of the view.
        assert!(found < 1e-4, "{mode:?}: {found:.1e}");
    }
}

/// A plane seen at 89.99 degrees covers nothing but the pixels of its edge.
#[test]
fn a_layer_seen_edge_on_does_no_harm() {
    for tilt in [1.570_6, std::f64::consts::FRAC_PI_2] {
        let mut edge = plane(0.0, 0.5, RED);
        edge.transform.rotate.x = tilt;
        edge.shape.surface_mut().unwrap().two_sided = true;
        let picture =
            render(&view(vec![edge, plane(-1.9, 0.5, BLUE)]), &with(BlurMode::supersample(4), Prefilter::Ewa));
        assert!(picture.rgba.iter().flatten().all(|v| v.is_finite() && (0.0..=1.0).contains(v)));
        let away = over(&[(0.5, BLUE)]);
        let [r, _, b, a] = picture.rgba[(4 * SIZE[0] + 16) as usize].map(f64::from);
        assert!((r - away[0]).abs() < 1e-5 && (b - away[2]).abs() < 1e-5 && (a - away[3]).abs() < 1e-5);
    }
}

const AOVS: [Aov; 4] = [Aov::Alpha, Aov::Depth, Aov::Normal, Aov::Velocity];

#[test]
fn layers_of_the_picture_are_means_by_what_is_seen() {
    let mut near = plane(0.5, 0.3, RED);
    near.motions = vec![Motion::Linear { velocity: DVec3::new(0.2, 0.0, 0.0) }];
    let scene = view(vec![near, plane(-0.5, 0.6, BLUE)]);
    let options = RenderOptions {
        look: Look { aovs: AOVS.to_vec(), ..with(BlurMode::supersample(2), Prefilter::Ewa).look },
        ..with(BlurMode::supersample(2), Prefilter::Ewa)
    };
    let picture = render(&scene, &options);
    let value = |aov: Aov, channel: usize| {
        let layer = picture.layers.iter().find(|layer| layer.aov == aov).unwrap();
        f64::from(layer.planes[channel][(12 * SIZE[0] + 16) as usize])
    };
    let (a, b) = (0.3, 0.7 * 0.6);
    let alpha = a + b;
    let focal = 12.5 / 15_f64.to_radians().tan();
    assert!((value(Aov::Alpha, 0) - alpha).abs() < 1e-5);
    let depth = value(Aov::Depth, 0);
    assert!((depth - (3.5 * a + 4.5 * b) / alpha).abs() < 1e-4, "{depth}");
    assert!((value(Aov::Normal, 2) - 1.0).abs() < 1e-4, "{}", value(Aov::Normal, 2));
    // Pixels a shutter, which is a frame long.
    let want = 0.2 / 3.5 * focal * a / alpha;
    assert!((value(Aov::Velocity, 0) - want).abs() < 1e-3, "{} for {want}", value(Aov::Velocity, 0));
}

fn bits(picture: &Picture) -> Vec<u32> {
    let planes = picture.layers.iter().flat_map(|layer| layer.planes.iter().flatten());
    picture.rgba.iter().flatten().chain(planes).map(|value| value.to_bits()).collect()
}

// Not deep: no other test makes bands and batches of layers.
#[test]
fn memory_and_threads_change_no_byte() {
    let mut ball = crate::support::object(crate::support::sphere(60_000));
    ball.shape.surface_mut().unwrap().two_sided = true;
    ball.opacity = 0.4;
    ball.motions = vec![Motion::Linear { velocity: DVec3::new(0.5, 0.2, 0.3) }];
    let mut scene = view(vec![ball, veil(0.2, RED), plane(-1.5, 0.7, BLUE), plane(-0.3, 1.0, RED)]);
    (scene.image.width, scene.image.height) = (90, 70);
    for mode in [BlurMode::supersample(3), BlurMode::interleaved(2, Interleave::Two), bucket(2, 2)] {
        let options = RenderOptions {
            look: Look { aovs: AOVS.to_vec(), filter: PixelFilter::Box, ..with(mode, Prefilter::Ewa).look },
            ..with(mode, Prefilter::Ewa)
        };
        let whole = render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap();
        for (threads, memory) in [(1, 1 << 30), (3, 48 << 20)] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let few = RenderOptions { memory, ..options.clone() };
            let found = pool.install(|| render_frame(&mut Cpu::default(), &scene, 0, &few)).unwrap();
            assert!(bits(&found.picture) == bits(&whole.picture), "{mode}, {threads} threads, {memory}");
            println!("{mode}, {threads} threads, {memory}: {} splats", found.stats.splats);
        }
    }
}

#[test]
fn kernels_in_motion_are_refused() {
    let options =
        with(BlurMode::Volumetric { intervals: 2, pixel_samples: None, swept: SweptKernel::default() }, Prefilter::Ewa);
    let error = render_frame(&mut Cpu::default(), &view(vec![plane(0.0, 0.5, RED)]), 0, &options).unwrap_err();
    assert!(error.to_string().contains("light passes through"), "{error}");
}

/// Balls of glass in motion, through one another and through what is opaque: the picture of rays, which has layers by
/// code of its own.
#[test]
fn balls_of_glass_are_those_of_the_reference() {
    let ball = |radius: f64, z: f64, opacity: f64, velocity: DVec3| {
        let mut ball = object(crate::support::sphere(4000));
        ball.transform.scale = DVec3::splat(radius);
        ball.transform.translate.z = z;
        ball.shape.surface_mut().unwrap().two_sided = true;
        ball.opacity = opacity;
        ball.motions = vec![Motion::Linear { velocity }];
        ball
    };
    let mut scene = view(vec![
        ball(0.5, 0.3, 0.4, DVec3::new(0.4, 0.1, 0.0)),
        ball(0.6, 0.0, 0.6, DVec3::new(-0.3, 0.0, 0.1)),
        ball(0.3, 0.2, 1.0, DVec3::new(0.0, 0.4, 0.0)),
        plane(-1.2, 0.5, BLUE),
    ]);
    (scene.image.width, scene.image.height) = (96, 72);
    scene.image.transparent = false;
    let options = ReferenceOptions { samples: 256, ..ReferenceOptions::default() };
    let want = reference::render(&scene, 0, &options, None, &|_| ()).unwrap().picture;
    for prefilter in [Prefilter::None, Prefilter::Ewa] {
        let options = RenderOptions {
            look: Look { filter: PixelFilter::Box, ..with(BlurMode::supersample(32), prefilter).look },
            ..with(BlurMode::supersample(32), prefilter)
        };
        let flip = flip::mean(&render(&scene, &options), &want).unwrap();
        println!("{prefilter:?}: FLIP {flip:.4}");
        assert!(flip < 0.01, "{prefilter:?}: FLIP {flip:.4}");
    }
}

/// The closed forms above on a GPU: filters, groups of samples, a capture between layers, and what is left out.
// Not deep: the pictures of layers on a GPU.
#[cfg(feature = "gpu")]
#[test]
fn a_gpu_shows_the_same_layers() {
    let Some(mut gpu) = crate::support::gpu::gpu_or_skip("a_gpu_shows_the_same_layers") else { return };
    let green = Vec3::new(0.2, 0.8, 0.3);
    let objects = || vec![plane(-0.5, 0.6, BLUE), veil(0.0, green), plane(0.5, 0.3, RED)];
    let want = over(&[(0.3, RED), (0.5, green), (0.6, BLUE)]);
    let modes = [
        (STILL, Prefilter::Ewa),
        (STILL, Prefilter::None),
        (BlurMode::supersample(2), Prefilter::Approx),
        (bucket(1, 2), Prefilter::Ewa),
    ];
    for (mode, prefilter) in modes {
        let rendered = render_frame(&mut gpu, &view(objects()), 0, &with(mode, prefilter)).unwrap();
        let found = worst(&rendered.picture, want);
        // As `a_capture_lies_between_layers` has it.
        assert!(found < 1e-4, "{mode:?}, {prefilter:?}: {found:.1e}");
        assert_eq!(rendered.stats.left_out, 0);
    }
    for n in [8, 9_usize] {
        let layers: Vec<(f64, Vec3)> = (0..n).map(|i| (0.15 + 0.02 * i as f64, colour_of(i))).collect();
        let objects = (0..n).rev().map(|i| plane(1.0 - 0.2 * i as f64, layers[i].0, layers[i].1)).collect();
        let rendered = render_frame(&mut gpu, &view(objects), 0, &with(STILL, Prefilter::Ewa)).unwrap();
        let found = worst(&rendered.picture, over(&layers[..8]));
        assert!(found < 1e-5, "{n} layers: {found:.1e}");
        assert_eq!(rendered.stats.left_out > 0, n > 8, "{n} layers");
    }
}

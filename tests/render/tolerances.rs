//! Surfaces that are nearer to each other than their depth tolerances, whose objects have different ones: closed forms
//! of what shows (docs/math.md, eq. 5), on all backends and in the reference.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use glam::{DQuat, DVec3, Vec3};
use splatblur::backend::Backend;
use splatblur::backend::cpu::Cpu;
use splatblur::film::Picture;
use splatblur::options::{Look, PixelFilter, Prefilter, RenderOptions};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Camera, Motion, Object, Scene};

use crate::support::{UNLIT, object, round_surfels, scene};

const SIZE: u32 = 48;
const RED: Vec3 = Vec3::X;
const GREEN: Vec3 = Vec3::Y;
const BLUE: Vec3 = Vec3::Z;

/// Discs before the camera, at these depths, of an object with this tolerance. All have one size on the screen, beyond
/// the image, so that on each ray all have one weight.
fn discs(epsilon: f64, discs: &[(f64, Vec3)]) -> Object {
    let disc = |&(depth, colour): &(f64, Vec3)| (DVec3::new(0.0, 0.0, -depth), DVec3::Z, depth, colour);
    with_tolerance(epsilon, discs.iter().map(disc).collect())
}

fn with_tolerance(epsilon: f64, points: Vec<(DVec3, DVec3, f64, Vec3)>) -> Object {
    let mut object = object(round_surfels(points));
    (object.shape.surface_mut().unwrap().material, object.epsilon) = (Some(UNLIT), Some(epsilon));
    object
}

fn before_nothing(objects: Vec<Object>) -> Scene {
    let mut scene = scene(objects, [SIZE; 2], DVec3::ZERO, 40.0);
    scene.image.transparent = true;
    scene
}

/// Names, objects before the camera, and the colour that all pixels have.
fn closed_forms() -> Vec<(&'static str, Vec<Object>, [f32; 3])> {
    const COARSE: f64 = 0.5;
    const FINE: f64 = 0.01;
    vec![
        ("fine behind coarse", vec![discs(COARSE, &[(4.0, RED)]), discs(FINE, &[(4.2, GREEN)])], [1.0, 0.0, 0.0]),
        ("coarse behind fine", vec![discs(FINE, &[(4.0, RED)]), discs(COARSE, &[(4.2, GREEN)])], [1.0, 0.0, 0.0]),
        // What is hidden hides what is behind it all the same.
        (
            "fine between two of coarse",
            vec![discs(FINE, &[(4.1, GREEN)]), discs(COARSE, &[(4.0, RED), (4.105, 0.5 * RED), (4.2, BLUE)])],
            [0.75, 0.0, 0.0],
        ),
        (
            "coarse behind two of fine",
            vec![discs(COARSE, &[(4.3, GREEN)]), discs(FINE, &[(4.0, RED), (4.005, BLUE)])],
            [0.5, 0.0, 0.5],
        ),
        (
            "one of three tolerances within its own",
            vec![discs(COARSE, &[(4.2, BLUE)]), discs(0.1, &[(4.05, GREEN)]), discs(COARSE, &[(4.0, RED)])],
            [0.5, 0.5, 0.0],
        ),
        // What has one tolerance shows up to it, whatever its object.
        (
            "one tolerance",
            vec![discs(COARSE, &[(4.0, RED)]), discs(COARSE, &[(4.2, GREEN)]), discs(COARSE, &[(4.6, BLUE)])],
            [0.5, 0.5, 0.0],
        ),
    ]
}

/// A renderer of scenes.
type Renderer = Box<dyn FnMut(&Scene) -> Picture>;

/// How a picture of a scene may be made: by the backends in all modes, and by the reference.
fn renderers(test: &str) -> Vec<(String, Renderer)> {
    let modes = ["still:1", "supersample:2", "bucket:1x2", "volumetric:1"];
    let mut all: Vec<(String, Renderer)> = Vec::new();
    for mode in modes {
        for prefilter in [Prefilter::None, Prefilter::Ewa] {
            for mut backend in backends(test, mode) {
                let options = RenderOptions { quality: mode.parse().unwrap(), prefilter, ..RenderOptions::default() };
                let name = format!("{}, {mode}, {prefilter}", backend.describe());
                let render = move |scene: &Scene| render_frame(&mut *backend, scene, 0, &options).unwrap().picture;
                all.push((name, Box::new(render)));
            }
        }
    }
    let reference = |scene: &Scene| {
        let options = ReferenceOptions { samples: 32, ..ReferenceOptions::default() };
        reference::render(scene, 0, &options, None, &|_| ()).unwrap().picture
    };
    all.push(("reference".into(), Box::new(reference)));
    all
}

/// A GPU has the two modes whose passes differ: pictures take seconds where it is software.
fn backends(test: &str, mode: &str) -> Vec<Box<dyn Backend>> {
    let gpu = if ["supersample:2", "volumetric:1"].contains(&mode) { gpu(test) } else { None };
    std::iter::once(Box::new(Cpu::default()) as Box<dyn Backend>).chain(gpu).collect()
}

#[cfg(feature = "gpu")]
fn gpu(test: &str) -> Option<Box<dyn Backend>> {
    crate::support::gpu::gpu_or_skip(test).map(|gpu| Box::new(gpu) as Box<dyn Backend>)
}

#[cfg(not(feature = "gpu"))]
fn gpu(_test: &str) -> Option<Box<dyn Backend>> {
    None
}

/// Largest difference of any pixel that `counts` from a colour.
fn worst(picture: &Picture, want: [f32; 3], counts: impl Fn(f64, f64) -> bool) -> f32 {
    let differences = picture.rgba.iter().enumerate().map(|(i, pixel)| {
        let [x, y] = [i as u32 % SIZE, i as u32 / SIZE].map(|at| f64::from(at) + 0.5 - f64::from(SIZE) / 2.0);
        let of = |(got, want): (&f32, &f32)| if got == want { 0.0 } else { (got - want).abs() };
        if counts(x, y) { pixel[..3].iter().zip(&want).map(of).fold(0.0, f32::max) } else { 0.0 }
    });
    differences.fold(0.0, |most, now| if now <= most { most } else { now })
}

// Not deep: the closed forms of tolerances, on all backends.
#[test]
fn each_object_shows_up_to_its_own_tolerance() {
    let mut wrong = Vec::new();
    for (name, mut render) in renderers("each_object_shows_up_to_its_own_tolerance") {
        for (what, objects, want) in closed_forms() {
            let worst = worst(&render(&before_nothing(objects)), want, |_, _| true);
            println!("{name}: {what}: {worst:.1e}");
            if worst.is_nan() || worst > 1e-4 {
                wrong.push(format!("{name}: {what}: off by {worst}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// A coarse disc before a fine plane: red within, green around, and nothing else at its rim.
#[test]
fn fine_things_show_beside_a_coarse_disc_alone() {
    // A pixel at depth 4 is this large.
    let pixel = 4.0 * 20_f64.to_radians().tan() / (f64::from(SIZE) / 2.0);
    let disc = with_tolerance(0.5, vec![(DVec3::new(0.0, 0.0, -4.0), DVec3::Z, 15.0 * pixel, RED)]);
    let scene = before_nothing(vec![disc, discs(0.01, &[(4.2, GREEN)])]);
    let mut wrong = Vec::new();
    for (name, mut render) in renderers("fine_things_show_beside_a_coarse_disc_alone") {
        let picture = render(&scene);
        let within = worst(&picture, [1.0, 0.0, 0.0], |x, y| x.hypot(y) < 12.0);
        let around = worst(&picture, [0.0, 1.0, 0.0], |x, y| x.hypot(y) > 18.0);
        let other = picture.rgba.iter().map(|pixel| (pixel[0] + pixel[1] - 1.0).abs()).fold(0.0, f32::max);
        println!("{name}: {within:.1e} within, {around:.1e} around, {other:.1e} other");
        if [within, around, other].iter().any(|worst| worst.is_nan() || *worst > 1e-4) {
            wrong.push(format!("{name}: off by {within} within, {around} around, {other} other"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The same bytes however the splats come: batch by batch, the nearest depth stays.
#[test]
fn batches_keep_the_nearest_depth() {
    let grid = |depth: f64, n: u32, colour: Vec3, epsilon: f64| {
        let step = 3.6 / f64::from(n);
        let at = move |i: u32| (f64::from(i) + 0.5) * step - 1.8;
        let points = (0..n * n).map(|i| (DVec3::new(at(i % n), at(i / n), -depth), DVec3::Z, step, colour)).collect();
        let mut grid = with_tolerance(epsilon, points);
        grid.motions = vec![Motion::Linear { velocity: DVec3::new(0.05, 0.0, 0.0) }];
        grid
    };
    // The fine one comes first in the order of splats, so that its nearest depth is not that of all.
    let scene = before_nothing(vec![grid(4.2, 150, GREEN, 0.01), grid(4.0, 150, RED, 0.5)]);
    for (mode, prefilter) in
        [("supersample:2", Prefilter::None), ("supersample:2", Prefilter::Ewa), ("volumetric:1", Prefilter::None)]
    {
        let with = |memory: u64| {
            let look = Look { filter: PixelFilter::Point, ..Look::default() };
            let quality = mode.parse().unwrap();
            let options = RenderOptions { quality, prefilter, look, memory, ..RenderOptions::default() };
            render_frame(&mut Cpu::default(), &scene, 0, &options).map(|rendered| rendered.picture)
        };
        let plenty = with(1 << 30).unwrap();
        assert!(worst(&plenty, [1.0, 0.0, 0.0], |_, _| true) < 1e-4, "{mode}, {prefilter}");
        // The least that is taken, to 1 %.
        let (mut refused, mut least) = (1 << 20, 1 << 30);
        while least - refused > least / 100 {
            let middle = u64::midpoint(least, refused);
            if with(middle).is_ok() { least = middle } else { refused = middle }
        }
        println!("{mode}, {prefilter}: {least} bytes");
        assert!(with(least).unwrap().rgba == plenty.rgba, "{mode}, {prefilter}: {least} bytes");
    }
}

/// Largest mean over 6 x 6 pixels of how much brighter one picture is than another.
fn brightest(shown: &Picture, truth: &Picture) -> f32 {
    let size = SIZE as usize;
    let more: Vec<f32> = shown.rgba.iter().zip(&truth.rgba).map(|(a, b)| a[1] - b[1]).collect();
    let corners = (0..size - 6).flat_map(|y| (0..size - 6).map(move |x| (x, y)));
    let mean = |(x, y): (usize, usize)| (y..y + 6).map(|y| more[size * y + x..][..6].iter().sum::<f32>()).sum::<f32>();
    corners.map(mean).fold(f32::NEG_INFINITY, f32::max) / 36.0
}

/// Discs in all directions along two lines: a dark strand a disc's radius before a bright one. By default they hide
/// each other, as with no tolerance at all; with that of a surface the bright one shines through.
#[test]
fn strands_hide_what_is_just_behind_them() {
    const RADIUS: f64 = 0.03;
    let strand = |n: u32, across: bool, depth: f64, colour: Vec3| {
        (0..n).map(move |i| {
            let [a, b, c] = [12.9898, 78.233, 37.719].map(|rate: f64| (rate * f64::from(i + 1)).sin());
            let along = 0.4 * (f64::from(i) / f64::from(n) - 0.5);
            let place = if across {
                DVec3::new(along, 0.3 * RADIUS * a, -depth)
            } else {
                DVec3::new(0.2 * RADIUS * b, along, -depth)
            };
            (place, DVec3::new(a, b, c).normalize(), RADIUS, colour)
        })
    };
    let discs = strand(60, true, 0.5, 0.05 * GREEN).chain(strand(60, false, 0.525, GREEN));
    let mut strands = object(round_surfels(discs).spatially_ordered());
    (strands.shape.surface_mut().unwrap().material, strands.shape.surface_mut().unwrap().two_sided) =
        (Some(UNLIT), true);
    let scene = before_nothing(vec![strands]);
    let traced = |epsilon: Option<f64>| {
        let look = Look { epsilon, ..Look::default() };
        let options = ReferenceOptions { samples: 1024, look, ..ReferenceOptions::default() };
        reference::render(&scene, 0, &options, None, &|_| ()).unwrap().picture
    };
    let truth = traced(Some(1e-6));
    let rendered = |epsilon: Option<f64>| {
        let look = Look { epsilon, ..Look::default() };
        let options = RenderOptions { quality: "still:64".parse().unwrap(), look, ..RenderOptions::default() };
        render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap().picture
    };
    let shown = [rendered(None), traced(None), rendered(Some(RADIUS))].map(|picture| brightest(&picture, &truth));
    println!("by default {:.4}, traced {:.4}; with the tolerance of a surface {:.4}", shown[0], shown[1], shown[2]);
    assert!(shown[0] < 0.02 && shown[1] < 0.02, "{shown:?}");
    assert!(shown[2] > 0.05, "the scene shows no leak: {shown:?}");
}

/// A ball of coarse discs turns in a bowl of coarse discs that it touches, seen from above and from below. Each has one
/// colour, so that nothing but the discs changes from frame to frame.
#[test]
fn a_coarse_ball_in_a_coarse_bowl_does_not_flicker() {
    const BALL: usize = 400;
    const BOWL: usize = 1200;
    const FRAMES: u32 = 12;
    // About four discs lie over each point.
    let ball = |frame: u32, tolerance: Option<f64>| {
        let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.02 * f64::from(frame));
        let disc = |n: DVec3| (turn * n, turn * n, 4.0 / (BALL as f64).sqrt(), RED);
        coarse(fibonacci(BALL).map(disc).collect(), tolerance)
    };
    // It touches the ball at the bottom.
    let bowl = |tolerance: Option<f64>| {
        let disc = |n: DVec3| (1.5 * n + 0.5 * DVec3::Y, -n, 6.0 / (BOWL as f64).sqrt(), GREEN);
        let mut bowl = coarse(fibonacci(BOWL).filter(|n| n.y < -0.2).map(disc).collect(), tolerance);
        bowl.shape.surface_mut().unwrap().two_sided = true;
        bowl
    };
    let flicker = |eye: DVec3, tolerance: Option<f64>| {
        let picture = |frame: u32| {
            let mut scene = before_nothing(vec![ball(frame, tolerance), bowl(tolerance)]);
            scene.camera = Camera { fovy: scene.camera.fovy, ..Camera::new(eye, DVec3::ZERO) };
            let options = RenderOptions { quality: "still:16".parse().unwrap(), ..RenderOptions::default() };
            render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap().picture
        };
        let frames: Vec<Picture> = (0..FRAMES).map(picture).collect();
        let step = |pair: &[Picture]| brightest(&pair[0], &pair[1]).max(brightest(&pair[1], &pair[0]));
        frames.windows(2).map(step).fold(0.0, f32::max)
    };
    let [above, below] = [3.0, -3.0].map(|y| DVec3::new(0.0, y, 4.0));
    let (shown, without) = ([above, below].map(|eye| flicker(eye, None)), flicker(below, Some(1e-4)));
    println!("{shown:.4?}; with next to no tolerance {without:.4}");
    assert!(shown.iter().all(|step| *step < 1.5 / 255.0), "{shown:?}");
    assert!(without > 4.0 / 255.0, "the scene would not flicker anyhow: {without}");
}

/// Points of a unit sphere, evenly.
fn fibonacci(n: usize) -> impl Iterator<Item = DVec3> {
    (0..n).map(move |i| {
        let y = 1.0 - (2.0 * i as f64 + 1.0) / n as f64;
        let (sin, cos) = (i as f64 * 2.399_963_229_728_653).sin_cos();
        let across = (1.0 - y * y).sqrt();
        DVec3::new(across * cos, y, across * sin)
    })
}

fn coarse(discs: Vec<(DVec3, DVec3, f64, Vec3)>, tolerance: Option<f64>) -> Object {
    let mut object = object(round_surfels(discs).spatially_ordered());
    (object.shape.surface_mut().unwrap().material, object.epsilon) = (Some(UNLIT), tolerance);
    object
}

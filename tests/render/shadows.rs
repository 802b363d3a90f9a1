//! Shadows of both backends, against closed forms: integrals in `f64` that share no code with them.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use crate::support::{object, round_surfels, scene, sphere};
use glam::{DVec3, Vec3};
use splatblur::backend::cpu::Cpu;
use splatblur::backend::{Backend, BackendError};
use splatblur::film::Picture;
use splatblur::model::{Material, Surfels};
use splatblur::options::{BlurMode, Look, RenderOptions, Shading};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Camera, Light, Motion, Object, Scene};

/// Tests of each backend.
macro_rules! on_both {
    ($($test:ident),+ $(,)?) => {
        mod cpu {
            $(#[test]
            fn $test() {
                super::$test(&mut splatblur::backend::cpu::Cpu::default());
            })+
        }

        #[cfg(feature = "gpu")]
        mod gpu {
            $(#[test]
            fn $test() {
                let Some(mut gpu) = crate::support::gpu::gpu_or_skip(stringify!($test)) else { return };
                super::$test(&mut gpu);
            })+
        }
    };
}

pub(crate) use on_both;

on_both!(
    a_half_plane_under_a_wide_light,
    a_moving_ball,
    intervals_have_the_shadows_of_their_middles,
    what_moves_throws_no_shadow_on_itself,
    what_is_read_row_by_row_throws_no_shadow_on_itself,
    what_faces_the_light_is_lit,
    contacts_stay_dark,
    strange_lights_give_finite_pictures,
    hard_scenes_have_the_shadows_of_the_reference,
    surfels_that_come_into_view_have_shadows,
    what_is_held_has_the_shadows_of_the_reference,
);

fn render(on: &mut dyn Backend, scene: &Scene, options: &RenderOptions) -> Picture {
    render_frame(on, scene, 0, options).unwrap().picture
}

/// White, without lobes but the diffuse one.
pub(crate) const WHITE: Material = Material { ambient: 0.0, diffuse: 1.0, specular: 0.0, shininess: 1.0 };

pub(crate) fn white(model: Surfels) -> Object {
    let mut object = object(model.spatially_ordered());
    let surface = object.shape.surface_mut().unwrap();
    (surface.material, surface.two_sided) = (Some(WHITE), false);
    object
}

/// A square of white surfels that faces +y, from `low` to `high` in x and z, at `height`.
pub(crate) fn square(low: [f64; 2], high: [f64; 2], height: f64, step: f64) -> Object {
    let count = [0, 1].map(|c: usize| ((high[c] - low[c]) / step).round() as usize);
    let at = |i: usize, c: usize| low[c] + (i as f64 + 0.5) * step;
    let places = (0..count[0] * count[1]).map(|i| DVec3::new(at(i % count[0], 0), height, at(i / count[0], 1)));
    white(round_surfels(places.map(|place| (place, DVec3::Y, step, Vec3::ONE))))
}

/// The floor from just above it, with +x to the right and +z down.
pub(crate) fn from_above(objects: Vec<Object>, size: [u32; 2]) -> Scene {
    let mut scene = scene(objects, size, DVec3::new(0.0, 0.8, 0.0), 40.0);
    scene.camera = Camera { up: -DVec3::Z, fovy: 40_f64.to_radians(), ..Camera::new(DVec3::Y * 0.8, DVec3::ZERO) };
    scene
}

/// Half the height of the floor that [`from_above`] shows.
pub(crate) fn half_height() -> f64 {
    0.8 * 20_f64.to_radians().tan()
}

/// Samples of a picture that is to converge. A device may be software, which takes long for as many as the CPU takes.
pub(crate) fn many(on: &dyn Backend) -> u32 {
    if on.describe().starts_with("cpu") { 256 } else { 64 }
}

pub(crate) fn samples(samples: u32) -> RenderOptions {
    RenderOptions { quality: BlurMode::supersample(samples).into(), ..RenderOptions::default() }
}

/// Worst mean of the difference of red over squares of 6 x 6 pixels.
pub(crate) fn worst_square(a: &Picture, b: &Picture) -> f64 {
    let [width, height] = [a.width, a.height].map(|pixels| pixels as usize);
    let difference = |i: usize| f64::from(a.rgba[i][0] - b.rgba[i][0]);
    let square = |x: usize, y: usize| {
        let pixels = (y..y + 6).flat_map(|y| (x..x + 6).map(move |x| y * width + x));
        (pixels.map(difference).sum::<f64>() / 36.0).abs()
    };
    (0..=height - 6).flat_map(|y| (0..=width - 6).map(move |x| (x, y))).map(|(x, y)| square(x, y)).fold(0.0, f64::max)
}

/// A half-plane at height 1 whose edge is x = 0, under a light 20 degrees wide: the floor's light is the integral of
/// the cosine over the part of the cone that is seen.
fn a_half_plane_under_a_wide_light(on: &mut dyn Backend) {
    let (height, half) = (1.0, 10_f64.to_radians());
    let floor = square([-1.0, -0.4], [1.0, 0.4], 0.0, 0.02);
    // Discs of the last row reach .9566 of their radius beyond their centres, in the mean.
    let edge = -0.02 * (0.9566 - 0.5);
    let above = square([edge - 1.6, -1.2], [edge, 1.2], height, 0.02);
    let mut scene = from_above(vec![floor, above], [96, 32]);
    let light = |shadows| Light::Directional { direction: -DVec3::Y, colour: DVec3::ONE, angle: 2.0 * half, shadows };
    scene.lights = vec![light(true)];
    let picture = render(on, &scene, &samples(256));
    let share = |x: f64| {
        let (rings, parts) = (200, 400);
        let mut sum = 0.0;
        for ring in 0..rings {
            let cosine = 1.0 - (f64::from(ring) + 0.5) / f64::from(rings) * (1.0 - half.cos());
            let slope = (1.0 - cosine * cosine).sqrt() / cosine;
            let seen = (0..parts).filter(|part| {
                let turn = (f64::from(*part) + 0.5) / f64::from(parts) * std::f64::consts::TAU;
                x + height * slope * turn.cos() >= 0.0
            });
            sum += cosine * seen.count() as f64;
        }
        sum / f64::from(rings * parts)
    };
    let pixel = 2.0 * half_height() / 32.0;
    let (mut worst, mut sum) = (0.0_f64, 0.0);
    for column in 0..96_usize {
        let x = (column as f64 + 0.5 - 48.0) * pixel;
        let rows = (8..24).map(|row| f64::from(picture.rgba[row * 96 + column][0]));
        let mean = rows.sum::<f64>() / 16.0;
        let difference = mean - share(x);
        (worst, sum) = (worst.max(difference.abs()), sum + difference);
    }
    let bias = sum / 96.0;
    println!("worst column {worst:.4}, bias {bias:.4}");
    // The worst of 256 points on the light is .014 in the mean over seeds.
    assert!(worst < 0.02 && bias.abs() < 0.002, "worst {worst}, bias {bias}");
    // Without shadows the light is a direction.
    let look = Look { shadows: false, ..Look::default() };
    let without = render(on, &scene, &RenderOptions { look, ..samples(8) });
    scene.lights = vec![light(false)];
    assert_eq!(without.rgba, render(on, &scene, &samples(8)).rgba);
}

/// A ball flies through the light of a point: each place of the floor is dark for the time in which its ray to the
/// light meets the ball.
fn a_moving_ball(on: &mut dyn Backend) {
    moving_ball(on, &["supersample:256", "bucket:128x2"]);
}

fn moving_ball(on: &mut dyn Backend, modes: &[&str]) {
    let (lamp, radius) = (DVec3::new(0.1, 2.0, 0.0), 0.1);
    let (start, velocity) = (DVec3::new(-0.25, 0.9, 0.0), DVec3::new(0.5, 0.0, 0.0));
    let floor = square([-1.0, -0.5], [1.0, 0.5], 0.0, 0.02);
    let mut model = sphere(4000);
    let small = |v: &mut Vec3| *v *= radius as f32;
    model.position.iter_mut().for_each(small);
    model.axis_u.iter_mut().chain(&mut model.axis_v).for_each(small);
    let mut ball = white(model);
    ball.transform.translate = start;
    ball.motions = vec![Motion::Linear { velocity }];
    let mut scene = from_above(vec![floor, ball], [96, 32]);
    (scene.shutter.open, scene.shutter.close) = (0.0, 1.0);
    scene.lights = vec![Light::point(lamp, DVec3::splat(4.0))];
    let pixel = 2.0 * half_height() / 32.0;
    let truth = |x: f64, z: f64| {
        let place = DVec3::new(x, 0.0, z);
        let to_lamp = lamp - place;
        let along = to_lamp.normalize();
        let is_lit = |step: &i32| {
            let centre = start + velocity * ((f64::from(*step) + 0.5) / 1000.0);
            let from = centre - place;
            (from - along * from.dot(along)).length() > radius
        };
        let share = (0..1000).filter(is_lit).count() as f64 / 1000.0;
        share * 4.0 * along.y / to_lamp.length_squared()
    };
    let pixels: Vec<_> = (2..30).flat_map(|row| (2..94).map(move |column| (row, column))).collect();
    let mean = |&(row, column): &(usize, usize)| {
        let [x, z] = [column as f64 + 0.5 - 48.0, row as f64 + 0.5 - 16.0].map(|pixels| pixels * pixel);
        // The mean over a pixel, by 16 places.
        let places = (0..16).map(|i| [i % 4, i / 4].map(|k| (f64::from(k) + 0.5) / 4.0 - 0.5));
        places.map(|[dx, dz]| truth(x + dx * pixel, z + dz * pixel)).sum::<f64>() / 16.0
    };
    let truth: Vec<f64> = pixels.iter().map(mean).collect();
    for mode in modes {
        let picture = render(on, &scene, &RenderOptions { quality: mode.parse().unwrap(), ..RenderOptions::default() });
        let difference = |((row, column), truth): (&(usize, usize), &f64)| {
            (f64::from(picture.rgba[row * 96 + column][0]) - truth).abs()
        };
        let differences: Vec<f64> = pixels.iter().zip(&truth).map(difference).collect();
        let worst = differences.iter().copied().fold(0.0, f64::max);
        let root = (differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64).sqrt();
        println!("{mode}: rms {root:.4}, worst {worst:.4}");
        assert!(root < 0.01 && worst < 0.05, "{mode}: rms {root}, worst {worst}");
    }
}

/// The samples of a bucket share a map, and so does an interval. What moves throws no shadow on itself by that: modes
/// are about as far from many samples with shadows as without.
fn what_moves_throws_no_shadow_on_itself(on: &mut dyn Backend) {
    own_shadow(on, "bucket:4x16", Shading::Phong);
    own_shadow(on, "bucket:4x16", Shading::Gouraud);
}

/// A strip of a rolling shutter has the map of its middle. A roof throws no shadow on itself, whenever its rows are
/// read out: neither where it flies nor where the camera does. One side alone would be the ground, which is not drawn.
fn what_is_read_row_by_row_throws_no_shadow_on_itself(on: &mut dyn Backend) {
    let flies = Motion::Linear { velocity: DVec3::new(0.4, 0.2, 0.0) };
    let sinks = Motion::Linear { velocity: DVec3::new(0.2, -0.3, 0.0) };
    for (of_roof, of_camera) in [(Some(flies), None), (None, Some(sinks)), (Some(flies), Some(sinks))] {
        let mut scene = from_above(Vec::new(), [96, 64]);
        for ([low, high], angle) in [([-0.4, 0.0], 20.0), ([0.0, 0.4], -30.0)] {
            let mut roof = square([low, -0.25], [high, 0.25], 0.0, 0.02);
            roof.transform.rotate = DVec3::Z * f64::to_radians(angle);
            roof.motions.extend(of_roof);
            scene.objects.push(roof);
        }
        scene.camera.motions.extend(of_camera);
        (scene.shutter.open, scene.shutter.close) = (-0.05, 0.05);
        scene.shutter.readout = "0.8".parse().unwrap();
        let colour = DVec3::ONE;
        let direction = DVec3::new(-0.1, -1.0, 0.1).normalize();
        let sun = Light::Directional { direction, colour, angle: 0.0, shadows: true };
        let lamp = Light::Point { position: DVec3::new(0.1, 1.5, 0.3), colour, radius: 0.0, shadows: true };
        scene.lights = vec![sun, lamp];
        let mut picture = |shadows| {
            let look = Look { shadows, ..Look::default() };
            let quality = BlurMode::supersample(4).into();
            render(on, &scene, &RenderOptions { quality, look, ..RenderOptions::default() })
        };
        let (with, without) = (picture(true), picture(false));
        let darker = with.rgba.iter().zip(&without.rgba).map(|(a, b)| b[0] - a[0]).fold(0.0, f32::max);
        println!("{of_roof:?}, {of_camera:?}: {darker:.5} darker");
        assert!(darker < 1e-3, "{of_roof:?}, {of_camera:?}: {darker}");
    }
}

/// The ball spins, too. Beside it is a resting floor, on which no shadow falls.
fn own_shadow(on: &mut dyn Backend, mode: &str, shading: Shading) {
    let mut scene = from_above(vec![square([0.2, -0.3], [0.4, 0.3], 0.0, 0.02)], [96, 64]);
    let mut model = sphere(4000);
    let small = |v: &mut Vec3| *v *= 0.15;
    model.position.iter_mut().for_each(small);
    model.axis_u.iter_mut().chain(&mut model.axis_v).for_each(small);
    let mut ball = white(model);
    ball.transform.translate = DVec3::new(-0.1, 0.2, 0.0);
    ball.motions = vec![
        Motion::Rotation { axis: DVec3::Z, per_frame: 1.5, centre: DVec3::ZERO },
        Motion::Linear { velocity: DVec3::X * 0.2 },
    ];
    scene.objects.push(ball);
    (scene.shutter.open, scene.shutter.close) = (0.0, 1.0);
    scene.lights = vec![Light::Directional {
        direction: DVec3::new(-0.8, -1.0, 0.3).normalize(),
        colour: DVec3::ONE,
        angle: 0.0,
        shadows: true,
    }];
    let mut picture = |mode: &str, shadows| {
        let look = Look { shadows, shading, ..Look::default() };
        render(on, &scene, &RenderOptions { quality: mode.parse().unwrap(), look, ..RenderOptions::default() })
    };
    let many = [true, false].map(|shadows| picture("supersample:128", shadows));
    let few = [true, false].map(|shadows| picture(mode, shadows));
    let [with, without] = [0, 1].map(|at: usize| {
        let pairs = few[at].rgba.iter().zip(&many[at].rgba);
        let sum: f64 = pairs.map(|(a, b)| f64::from(a[0] - b[0]).powi(2)).sum();
        (sum / many[at].rgba.len() as f64).sqrt()
    });
    println!("{mode}, {shading}: rms {with:.4}, without shadows {without:.4}");
    assert!(with < 1.25 * without, "{mode}, {shading}: {with}, without shadows {without}");
    // The ball ends at .25.
    let pixel = 2.0 * half_height() / 64.0;
    let floor = (0..64 * 96).filter(|i| (0.3..0.38).contains(&(((i % 96) as f64 + 0.5 - 48.0) * pixel)));
    let floor: Vec<f32> = floor.map(|i| (few[0].rgba[i][0] - few[1].rgba[i][0]).abs()).collect();
    assert!(!floor.is_empty() && floor.iter().all(|&dark| dark < 1e-6), "{mode}, {shading}: the floor is dark");
}

/// Mode `volumetric`: an interval has the shadows of its middle.
fn intervals_have_the_shadows_of_their_middles(on: &mut dyn Backend) {
    moving_ball(on, &["volumetric:64"]);
    own_shadow(on, "volumetric:4", Shading::Gouraud);
}

/// A ball throws no shadow on itself where it faces the light, nor does a plane that light grazes.
fn what_faces_the_light_is_lit(on: &mut dyn Backend) {
    let options = RenderOptions { quality: BlurMode::Still { pixel_samples: 8 }.into(), ..RenderOptions::default() };
    let shadowless = RenderOptions { look: Look { shadows: false, ..Look::default() }, ..options.clone() };
    for surfels in [500, 5000, 50_000] {
        let mut scene = scene(vec![white(sphere(surfels))], [160, 120], DVec3::new(0.0, 0.0, 4.0), 40.0);
        for direction in [DVec3::new(-1.0, -1.0, -0.6), DVec3::new(1.0, -0.1, -0.3), DVec3::new(0.2, -0.3, -1.0)] {
            scene.lights = vec![Light::Directional {
                direction: direction.normalize(),
                colour: DVec3::ONE,
                angle: 0.0,
                shadows: true,
            }];
            for shading in [Shading::Phong, Shading::Gouraud] {
                let mut with = |options: &RenderOptions| {
                    let look = Look { shading, ..options.look.clone() };
                    render(on, &scene, &RenderOptions { look, ..options.clone() })
                };
                let worst = worst_square(&with(&options), &with(&shadowless));
                println!("{surfels} surfels, {shading}: {worst:.4}");
                assert!(worst < 0.02, "{surfels} surfels, {shading}, {direction}: {worst}");
            }
        }
    }
    let mut scene = from_above(vec![square([-1.0, -0.5], [1.0, 0.5], 0.0, 0.03)], [96, 64]);
    let (sine, cosine) = 85_f64.to_radians().sin_cos();
    scene.lights = vec![Light::directional(DVec3::new(sine, -cosine, 0.0), DVec3::splat(10.0))];
    let worst = worst_square(&render(on, &scene, &options), &render(on, &scene, &shadowless));
    println!("grazed plane: {worst:.4}");
    assert!(worst < 0.02, "{worst}");
}

/// A small ball on the floor, and a thin sheet just above it, keep their shadows to the foot.
fn contacts_stay_dark(on: &mut dyn Backend) {
    let floor = square([-1.0, -0.4], [1.0, 0.4], 0.0, 0.02);
    let sheet = square([-0.1, -0.1], [0.1, 0.1], 0.02, 0.01);
    let mut scene = from_above(vec![floor, sheet], [96, 64]);
    scene.lights = vec![Light::directional(DVec3::new(1.0, -0.6, 0.0).normalize(), DVec3::ONE)];
    let picture = render(on, &scene, &samples(16));
    let pixel = 2.0 * half_height() / 64.0;
    // The shadow reaches 1 / .6 of the sheet's height beyond its edge.
    let column = |x: f64| (x / pixel + 48.0) as usize;
    let dark: Vec<f32> = (column(0.112)..column(0.122)).map(|x| picture.rgba[32 * 96 + x][0]).collect();
    println!("{dark:?}");
    assert!(!dark.is_empty() && dark.iter().all(|&light| light < 0.1), "{dark:?}");
}

#[test]
fn shadows_do_not_depend_on_threads_and_memory() {
    let mut scene = scene(
        vec![white(sphere(20_000)), square([-3.0, -3.0], [3.0, 3.0], -1.0, 0.1)],
        [160, 120],
        DVec3::new(0.0, 1.0, 5.0),
        40.0,
    );
    scene.objects[0].motions = vec![Motion::Linear { velocity: DVec3::X }];
    scene.lights = vec![
        Light::directional(DVec3::new(-0.4, -1.0, -0.5).normalize(), DVec3::ONE),
        Light::point(DVec3::new(1.0, 3.0, 2.0), DVec3::splat(3.0)),
    ];
    let options = RenderOptions {
        quality: BlurMode::Bucket {
            buckets: 3,
            samples: 1,
            pixel_samples: None,
            interleave: splatblur::options::Interleave::None,
            times: splatblur::options::Times::Even,
        }
        .into(),
        ..RenderOptions::default()
    };
    let in_pool = |threads: usize, options: &RenderOptions| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&mut Cpu::default(), &scene, options)).rgba
    };
    let whole = in_pool(2, &options);
    assert!(whole == in_pool(1, &options));
    let mut needed = options.clone();
    needed.memory = 1;
    let Err(BackendError::Memory { needed: least, .. }) = render_frame(&mut Cpu::default(), &scene, 0, &needed) else {
        panic!("one byte is enough")
    };
    needed.memory = least;
    assert!(whole == in_pool(1, &needed));
}

/// All of a floor is in the shadow of a roof. The camera turns by half of what it shows, so samples of the bucket show
/// much that the middle one does not.
fn surfels_that_come_into_view_have_shadows(on: &mut dyn Backend) {
    let floor = square([-2.0, -2.0], [2.0, 2.0], 0.0, 0.05);
    let roof = square([-2.5, -2.5], [2.5, 2.5], 1.0, 0.05);
    let mut scene = from_above(vec![floor, roof], [96, 64]);
    let (eye, angle) = (scene.camera.eye, -0.5 * scene.camera.fovy);
    scene.camera.motions = vec![Motion::Rotation { axis: DVec3::Z, per_frame: angle, centre: eye }];
    (scene.shutter.open, scene.shutter.close) = (-0.5, 0.5);
    scene.lights = vec![Light::directional(-DVec3::Y, DVec3::ONE)];
    let look = Look { shading: Shading::Gouraud, ..Look::default() };
    let options = RenderOptions { quality: "bucket:1x4".parse().unwrap(), look, ..RenderOptions::default() };
    let picture = render(on, &scene, &options);
    let brightest = picture.rgba.iter().map(|pixel| pixel[0]).fold(0.0, f32::max);
    assert!(brightest < 1e-6 && picture.rgba.iter().all(|pixel| pixel[3] > 0.99), "{brightest}");
}

/// What does not blur before a camera that moves is in the world where it is at the frame's number: there it casts and
/// receives, as in the reference. A post that blurs or not throws its shadow on a floor that does the other, and on a
/// ball that does as the post.
fn what_is_held_has_the_shadows_of_the_reference(on: &mut dyn Backend) {
    let post = square([-0.1, -0.1], [0.1, 0.1], 0.4, 0.01);
    let mut ball = white(sphere(2000));
    (ball.transform.scale, ball.transform.translate) = (DVec3::splat(0.15), DVec3::new(0.25, 0.15, 0.1));
    let floor = square([-1.2, -1.0], [1.2, 1.0], 0.0, 0.02);
    let mut scene = scene(vec![floor, post, ball], [96, 64], DVec3::new(0.1, 1.2, 1.0), 40.0);
    scene.camera.at = DVec3::ZERO;
    scene.camera.motions = vec![Motion::Linear { velocity: DVec3::new(0.3, 0.1, 0.0) }];
    (scene.shutter.open, scene.shutter.close) = (0.0, 1.0);
    scene.lights = vec![Light::Directional {
        direction: DVec3::new(0.5, -1.0, 0.2).normalize(),
        colour: DVec3::ONE,
        angle: 0.0,
        shadows: true,
    }];
    for (shading, mode, blurs) in [
        (Shading::Phong, "supersample:64", [true, false, false]),
        (Shading::Phong, "supersample:64", [false, true, true]),
        (Shading::Phong, "supersample:64", [false, false, false]),
        (Shading::Gouraud, "supersample:64", [true, false, false]),
        (Shading::Gouraud, "bucket:16x4", [false, true, true]),
        (Shading::Gouraud, "volumetric:32", [false, true, false]),
        (Shading::Phong, "auto", [true, false, false]),
    ] {
        scene.objects.iter_mut().zip(blurs).for_each(|(object, blurs)| object.blur = blurs);
        let look = Look { shading, ..Look::default() };
        let traced = ReferenceOptions { samples: 64, look: look.clone(), ..ReferenceOptions::default() };
        let truth = reference::render(&scene, 0, &traced, None, &|_| ()).unwrap().picture;
        let options = RenderOptions { quality: mode.parse().unwrap(), look, ..RenderOptions::default() };
        let worst = worst_square(&render(on, &scene, &options), &truth);
        let look = Look { shadows: false, ..options.look.clone() };
        let lit = worst_square(&render(on, &scene, &RenderOptions { look, ..options }), &truth);
        println!("{mode}, {shading}, {blurs:?}: worst {worst:.4}, without shadows {lit:.3}");
        assert!(worst < 0.05 && lit > 0.2, "{mode}, {shading}, {blurs:?}: {worst}, without shadows {lit}");
    }
}

/// Modes in which each backend decides what it renders next show the same on both: auto, and what it refines.
#[cfg(feature = "gpu")]
#[test]
fn the_backends_agree_in_mode_auto() {
    let Some(mut gpu) = crate::support::gpu::gpu_or_skip("the_backends_agree_in_mode_auto") else { return };
    let mut ball = white(sphere(1000));
    ball.transform.scale = DVec3::splat(0.4);
    ball.motions = vec![Motion::Linear { velocity: DVec3::X * 0.5 }];
    let floor = square([-3.0, -3.0], [3.0, 3.0], -0.4, 0.1);
    let mut scene = scene(vec![floor, ball], [96, 64], DVec3::new(-1.0, 1.2, 2.4), 40.0);
    scene.camera.at = DVec3::ZERO;
    scene.lights = vec![Light::directional(DVec3::new(0.5, -1.0, -0.2).normalize(), DVec3::ONE)];
    let options = RenderOptions { quality: "auto".parse().unwrap(), ..RenderOptions::default() };
    let [cpu, gpu] = [&mut Cpu::default() as &mut dyn Backend, &mut gpu].map(|on| render(on, &scene, &options));
    let differ = cpu.rgba.iter().zip(&gpu.rgba).filter(|(a, b)| (a[0] - b[0]).abs() > 1e-4).count();
    println!("{differ} pixels differ");
    // A place may be a rounding from the edge of a texel: one in a thousand, as where passes are compared.
    assert!(1000 * differ <= cpu.rgba.len(), "{differ} of {}", cpu.rgba.len());
}

/// Lights that are inside a model, infinitely far or wide, or huge: a finite picture.
fn strange_lights_give_finite_pictures(on: &mut dyn Backend) {
    let mut scene = scene(vec![white(sphere(500))], [32, 24], DVec3::new(0.0, 0.0, 4.0), 40.0);
    let directional = |angle: f64| Light::Directional {
        direction: -DVec3::Y,
        colour: DVec3::ONE,
        angle: angle.to_radians(),
        shadows: true,
    };
    let point = |position, radius| Light::Point { position, colour: DVec3::ONE, radius, shadows: true };
    let lights = [
        directional(0.0),
        directional(180.0),
        point(DVec3::ZERO, 0.0),
        point(DVec3::new(0.0, 0.0, 1.0), 0.0),
        point(DVec3::splat(1e30), 1.0),
        point(DVec3::ZERO, 1e30),
        point(DVec3::new(0.0, 0.0, 4.0), 0.0),
    ];
    for light in lights {
        scene.lights = vec![light];
        let picture = render(on, &scene, &samples(4));
        assert!(picture.rgba.iter().flatten().all(|value| value.is_finite()), "{light:?}");
    }
    scene.lights = vec![directional(1.0); 20];
    render(on, &scene, &samples(1));
    scene.lights = vec![directional(1.0); 1_000_000];
    let refused = render_frame(on, &scene, 0, &samples(1));
    assert!(matches!(refused, Err(BackendError::Memory { .. } | BackendError::Shadows { .. })), "{refused:?}");
}

/// Each must show the shadow that the reference shows: a disc that reaches beyond the camera as the floor, a light
/// along the camera's right, a far point light, a tolerance of 0.
fn hard_scenes_have_the_shadows_of_the_reference(on: &mut dyn Backend) {
    let ball = || {
        let mut ball = white(sphere(4000));
        ball.transform.scale = DVec3::splat(0.3);
        ball
    };
    let disc = || white(round_surfels([(DVec3::new(0.0, -0.3, 0.0), DVec3::Y, 30.0, Vec3::ONE)]));
    let fine = || square([-3.0, -3.0], [3.0, 3.0], -0.3, 0.05);
    let sun = |direction: DVec3| Light::Directional {
        direction: direction.normalize(),
        colour: DVec3::ONE,
        angle: 0.0,
        shadows: true,
    };
    let slanted = DVec3::new(0.5, -1.0, -0.2);
    let far = |distance: f64| Light::point(-slanted.normalize() * distance, DVec3::splat(distance * distance));
    let mut exact = fine();
    exact.epsilon = Some(0.0);
    let cases = [
        ("large disc", disc(), sun(slanted)),
        ("along the camera's right", fine(), sun(DVec3::new(1.0, -0.2, 1.0))),
        ("far point", fine(), far(1e4)),
        ("farther point", fine(), far(5e5)),
        ("tolerance 0", exact, sun(slanted)),
        ("near point", fine(), Light::point(DVec3::new(-0.4, 0.5, 0.1), DVec3::ONE)),
    ];
    for (name, floor, light) in cases {
        let mut scene = scene(vec![floor, ball()], [96, 64], DVec3::new(-2.0, 1.0, 2.0), 40.0);
        scene.camera.at = DVec3::new(0.0, -0.1, 0.0);
        scene.lights = vec![light];
        let traced = ReferenceOptions { samples: 64, ..ReferenceOptions::default() };
        let truth = reference::render(&scene, 0, &traced, None, &|_| ()).unwrap().picture;
        let worst = worst_square(&render(on, &scene, &samples(64)), &truth);
        let lit = {
            scene.lights = vec![light];
            let look = Look { shadows: false, ..Look::default() };
            worst_square(&render(on, &scene, &RenderOptions { look, ..samples(16) }), &truth)
        };
        println!("{name}: worst {worst:.4}, without shadows {lit:.3}");
        assert!(worst < 0.02 && lit > 0.1, "{name}: {worst}, without shadows {lit}");
    }
}

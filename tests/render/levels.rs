//! Closed forms of pictures with levels of detail: fewer surfels keep colours, outlines, and what a pixel or a blur
//! leaves of a pattern. `tests/render/detail.rs` has both backends show the same cut.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::f64::consts::PI;

use glam::{DQuat, DVec2, DVec3, Vec3};
use splatblur::backend::cpu::Cpu;
use splatblur::film::Picture;
use splatblur::options::{BlurMode, Detail, RenderOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Camera, Motion, Object, Scene};
use splatblur::{Gaussians, Surfels};

use crate::captures::encoded;
use crate::support::volumes::cloud;
use crate::support::{Random, UNLIT, object, round_surfels, scene, sphere};

const DETAILS: [Detail; 4] = [Detail::Full, Detail::Final, Detail::Good, Detail::Draft];
/// Pixels a side.
const SIZE: u32 = 96;
/// Distance of planes.
const DEPTH: f64 = 100.0;
const GREY: Vec3 = Vec3::new(0.2, 0.5, 0.7);

/// Pixels of a length of 1 at a distance of 1.
fn focal() -> f64 {
    0.5 * f64::from(SIZE) / 20_f64.to_radians().tan()
}

/// What a level of detail makes of a scene.
struct Made {
    picture: Picture,
    surfels: u64,
    /// The stated error of detail.
    stated: f64,
}

/// Frame 0 with 32 samples of time and of pixels, in each detail.
fn made(scene: &Scene) -> [Made; 4] {
    DETAILS.map(|detail| {
        let quality = BlurMode::supersample(32).into();
        let options = RenderOptions { quality, detail, ..RenderOptions::default() };
        let rendered = render_frame(&mut Cpu::default(), scene, 0, &options).unwrap();
        let stats = rendered.stats;
        Made { picture: rendered.picture, surfels: stats.surfels, stated: stats.detail }
    })
}

/// A ball of one colour with a radius of 1, `pixels` of them.
fn ball(pixels: f64) -> Scene {
    let mut model = sphere(60_000);
    model.colour.fill(GREY);
    unlit(model, pixels)
}

/// An unlit model within a ball of radius 1, which has `pixels`.
fn unlit(model: Surfels, pixels: f64) -> Scene {
    let mut object = object(model.spatially_ordered());
    object.shape.surface_mut().unwrap().material = Some(UNLIT);
    // The outline of the ball is a circle of this radius at a distance of 1 over the tangent.
    let eye = DVec3::Z * (1.0 + (focal() / pixels).powi(2)).sqrt();
    scene(vec![object], [SIZE; 2], eye, 40.0)
}

/// On all levels a ball of one colour keeps its radius and its colour, and nothing shines through it.
#[test]
fn a_ball_stays_a_ball() {
    for pixels in [40.0, 20.0, 10.0, 5.0, 2.5] {
        let made = made(&ball(pixels));
        for (made, detail) in made.iter().zip(DETAILS) {
            let (mut area, mut off) = (0.0, 0.0_f32);
            for (i, pixel) in made.picture.rgba.iter().enumerate() {
                area += f64::from(pixel[1]) / f64::from(GREY.y);
                if corner(i).distance(DVec2::splat(-0.5)) < pixels - 1.0 {
                    let colour = (Vec3::from_slice(&pixel[..3]) - GREY).abs().max_element();
                    // Where the black background shines through, the colour is less. The alpha of a picture is 1 there.
                    off = off.max(colour);
                }
            }
            let radius = (area / PI).sqrt();
            println!("{pixels} pixels, {detail:?}: {} surfels, radius {radius:.4}, colour {off:.1e}", made.surfels);
            assert!((radius - pixels).abs() <= 0.02, "{pixels} {detail:?}: {radius}");
            assert!(off <= 1e-6, "{pixels} {detail:?}: {off}");
        }
        assert!(made[2].surfels * 2 < made[0].surfels, "{pixels}: {} {}", made[2].surfels, made[0].surfels);
    }
}

/// A closed surface of one colour, turned at random: an ellipsoid or a ring, `pixels` from its middle to its farthest
/// point.
fn closed(random: &mut Random, pixels: f64) -> Scene {
    const COUNT: usize = 60_000;
    let golden = PI * (3.0 - 5_f64.sqrt());
    let turn = DQuat::from_rotation_arc(DVec3::Z, random.direction());
    let (is_ring, phase) = (random.next() < 0.4, random.next());
    let axes = DVec3::new(1.0, random.within(0.3, 1.0), random.within(0.3, 1.0));
    let tube = random.within(0.15, 0.4);
    let model = round_surfels((0..COUNT).map(|i| {
        let z = 1.0 - 2.0 * (i as f64 + phase) / COUNT as f64;
        let (sin, cos) = (i as f64 * golden).sin_cos();
        let (at, normal) = if is_ring {
            // Points are as dense inside as outside: Kepler's equation.
            let around = (0..20).fold(PI * z, |around, _| PI * z - tube / (1.0 - tube) * around.sin());
            let normal = DVec3::new(around.cos() * cos, around.cos() * sin, around.sin());
            (DVec3::new(cos, sin, 0.0) * (1.0 - tube) + normal * tube, normal)
        } else {
            let ball = DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
            (ball * axes, (ball / axes).normalize())
        };
        // On a ball they are 3.5 / sqrt(COUNT) apart, on the others less.
        (turn * at, turn * normal, 2.8 / (COUNT as f64).sqrt(), GREY)
    }));
    unlit(model, pixels)
}

/// No cut through a closed surface shows the background where all surfels hide it, in a pixel and in those around it.
#[test]
fn nothing_shines_through_closed_surfaces() {
    let mut random = Random(411);
    let mut looked_at = 0;
    let hidden = |picture: &Picture, i: usize| (picture.rgba[i][1] - GREY.y).abs() < 1e-6;
    for _ in 0..60 {
        let pixels = 3.0 * 12_f64.powf(random.next());
        let made = made(&closed(&mut random, pixels));
        let side = SIZE as usize;
        let around = |i: usize| [0, side, 2 * side].into_iter().flat_map(move |row| row + i..row + i + 3);
        let inside = (0..side * (side - 2) - 2).filter(|&i| around(i).all(|i| hidden(&made[0].picture, i)));
        for i in inside.map(|i| i + side + 1) {
            looked_at += 1;
            for (made, detail) in made[1..].iter().zip(&DETAILS[1..]) {
                assert!(hidden(&made.picture, i), "radius {pixels:.1}, {detail:?}: pixel {i}");
            }
        }
    }
    assert!(looked_at > 10_000, "{looked_at}");
}

/// A square of `pixels` with a pattern of `colour` at a place in pixels, surfels so many pixels apart.
fn plane(pixels: f64, spacing: f64, colour: impl Fn(DVec2) -> f64) -> Scene {
    let unit = DEPTH / focal();
    let side = (pixels / spacing) as i32;
    let model = round_surfels((0..side * side).map(|i| {
        let at = (DVec2::new(f64::from(i % side), f64::from(i / side)) - 0.5 * f64::from(side - 1)) * spacing;
        ((at * unit).extend(0.0), DVec3::Z, 1.7 * spacing * unit, Vec3::splat(colour(at) as f32))
    }));
    let mut plane = object(model.spatially_ordered());
    plane.shape.surface_mut().unwrap().material = Some(UNLIT);
    scene(vec![plane], [SIZE; 2], DVec3::Z * DEPTH, 40.0)
}

/// Upper left corner of a pixel, from the middle of the image; y points down.
fn corner(pixel: usize) -> DVec2 {
    DVec2::new((pixel % SIZE as usize) as f64, (pixel / SIZE as usize) as f64) - 0.5 * f64::from(SIZE)
}

/// Root mean square difference of a picture from the mean of `pattern` over each pixel, as displayed.
fn error(picture: &Picture, pattern: impl Fn(DVec2) -> f64) -> f64 {
    const PARTS: usize = 8;
    let place = |part: usize| DVec2::new((part % PARTS) as f64 + 0.5, (part / PARTS) as f64 + 0.5) / PARTS as f64;
    let difference = |(i, pixel): (usize, &[f32; 4])| {
        let at = (0..PARTS * PARTS).map(|part| corner(i) + place(part));
        let mean = at.map(|at| pattern(DVec2::new(at.x, -at.y))).sum::<f64>() / (PARTS * PARTS) as f64;
        encoded(mean) - encoded(pixel[0].into())
    };
    let sum: f64 = picture.rgba.iter().enumerate().map(difference).map(|off| off * off).sum();
    (sum / picture.rgba.len() as f64).sqrt()
}

/// What each detail adds to the error of all surfels is at most three times what it may leave out of colours. Waves of
/// a few pixels take up to two and a half times (docs/measurements/levels.md).
fn keeps(name: &str, scene: &Scene, truth: impl Fn(DVec2) -> f64) {
    let made = made(scene);
    let of_full = error(&made[0].picture, &truth);
    for (made, (detail, tolerance)) in made[1..].iter().zip(DETAILS[1..].iter().zip([0.0025, 0.005, 0.01])) {
        let error = error(&made.picture, &truth);
        let adds = (error * error - of_full * of_full).max(0.0).sqrt();
        let surfels = made.surfels;
        println!("{name}, {detail:?}: {surfels} surfels, error {error:.4}, adds {adds:.4}, states {:.4}", made.stated);
        assert!(adds <= 3.0 * tolerance, "{name}, {detail:?}: {adds:.4}");
    }
    assert!(made[3].surfels < made[0].surfels, "{name}");
}

/// A plate of rings that get narrower outwards, against the mean over pixels.
#[test]
fn a_zone_plate_stays_one() {
    for (spacing, rate) in [(0.4, 1.0), (0.2, 1.0), (0.2, 3.0), (0.1, 1.0)] {
        // At the sides of the image a wave is `2 / rate` pixels long.
        let k = 0.5 * PI * rate / (0.5 * f64::from(SIZE));
        let rings = |at: DVec2| 0.5 + 0.4 * (k * at.length_squared()).cos();
        keeps(&format!("spacing {spacing}, rate {rate}"), &plane(110.0, spacing, rings), rings);
    }
}

/// A wave that moves across itself keeps its height times sinc(path / length) under a box.
#[test]
fn a_moving_wave_is_a_sinc() {
    for (wave, path) in [(3.0, 4.0), (6.0, 4.0), (6.0, 10.0), (12.0, 10.0), (24.0, 10.0), (24.0, 30.0)] {
        let waves = |height: f64| move |at: DVec2| 0.5 + height * (2.0 * PI * at.x / wave).cos();
        let mut scene = plane(150.0, 0.25, waves(0.4));
        let way = DVec3::X * path * DEPTH / focal();
        scene.objects[0].motions = vec![Motion::Linear { velocity: way }];
        scene.objects[0].transform.translate = -0.5 * way;
        let x = PI * path / wave;
        keeps(&format!("waves of {wave}, path of {path}"), &scene, waves(0.4 * x.sin() / x));
    }
}

/// A volume in the cube from -1 to 1, so far away that a length of 2 has `pixels`, before `background`.
fn volume(model: Gaussians, pixels: f64, background: f64) -> Scene {
    let mut scene = Scene::new([Object::from_gaussians(model).unwrap()]);
    (scene.image.width, scene.image.height) = (SIZE, SIZE);
    scene.image.background = DVec3::splat(background);
    scene.camera = Camera {
        fovy: 40_f64.to_radians(),
        ..Camera::new(DVec3::new(0.3, 0.4, 1.0) * 2.0 * focal() / pixels, DVec3::ZERO)
    };
    scene
}

/// A thin cloud of one colour gives the same light on all levels: the sum over the picture is that of the masses of its
/// kernels. A thick one keeps its colour.
#[test]
fn a_cloud_keeps_its_light_and_its_colour() {
    let mut model = cloud(&mut Random(5), 48);
    (model.base, model.normal) = (vec![Gaussians::base_of(GREY); model.len()], Vec::new());
    let thin = Gaussians { opacity: model.opacity.iter().map(|opacity| opacity * 0.001).collect(), ..model.clone() };
    for pixels in [12.0, 24.0] {
        let scene = volume(thin.clone(), pixels, 0.0);
        let eye = scene.camera.eye;
        let area = |place: &Vec3| (focal() / (eye - place.as_dvec3()).dot(eye.normalize())).powi(2);
        let lights = thin.position.iter().zip(&thin.opacity).map(|(place, mass)| f64::from(*mass) * area(place));
        let light: f64 = lights.sum();
        let all = made(&scene);
        for (made, detail) in all.iter().zip(DETAILS) {
            let sum = made.picture.rgba.iter().map(|pixel| f64::from(pixel[1] / GREY.y)).sum::<f64>();
            println!("{pixels} {detail}: {} kernels, light {:.5}", made.surfels, sum / light);
            assert!((sum / light - 1.0).abs() < 0.02, "{pixels} {detail}: {sum} for {light}");
        }
        assert!(4 * all[3].surfels < all[0].surfels, "{} of {}", all[3].surfels, all[0].surfels);
        for made in made(&volume(model.clone(), pixels, 0.0)) {
            let off =
                |pixel: &[f32; 4]| (Vec3::from_slice(&pixel[..3]) - GREY * (pixel[1] / GREY.y)).abs().max_element();
            let worst = made.picture.rgba.iter().map(off).fold(0.0, f32::max);
            assert!(worst < 1e-5, "{pixels}: {worst}");
        }
    }
}

/// Clouds that were made for this have nearly the picture of all their kernels, and say how nearly.
#[test]
fn clouds_are_as_near_as_is_stated() {
    let (mut stated_well, mut count, mut most_saved) = (0, 0, 0.0_f64);
    for seed in 0..12 {
        let mut random = Random(900 + seed);
        let (model, pixels) = (cloud(&mut random, 40), random.within(6.0, 18.0));
        let all = made(&volume(model, pixels, random.next()));
        for (made, detail) in all.iter().zip(DETAILS).skip(1).filter(|(made, _)| made.surfels < all[0].surfels) {
            let pairs = made.picture.rgba.iter().zip(&all[0].picture.rgba);
            let square = |(a, b): (&[f32; 4], &[f32; 4])| {
                let off = |i: usize| encoded(a[i].into()) - encoded(b[i].into());
                (0..3).map(|i| off(i) * off(i)).sum::<f64>() / 3.0
            };
            let rms = (pairs.map(square).sum::<f64>() / f64::from(SIZE * SIZE)).sqrt();
            println!(
                "{seed} {pixels:.0} {detail}: {} of {}, {rms:.5}, {:.5}",
                made.surfels, all[0].surfels, made.stated
            );
            assert!(rms < 3.0 * made.stated, "{seed} {detail}: {rms} for {}", made.stated);
            (count, stated_well) = (count + 1, stated_well + u32::from(rms < 1.25 * made.stated));
            most_saved = most_saved.max(all[0].surfels as f64 / made.surfels as f64);
        }
    }
    assert!(4 * stated_well >= 3 * count && count >= 8, "{stated_well} of {count}");
    assert!(most_saved > 8.0, "{most_saved}");
}

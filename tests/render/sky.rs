//! Light of environments on the CPU backend, against closed forms and against the reference.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use splatblur::backend::cpu::Cpu;
use splatblur::compare::flip;
use splatblur::environment::{Environment, LatLong};
use splatblur::film::{Aov, Picture};
use splatblur::options::{BlurMode, ErrorTarget, Look, RenderOptions, Shading, SweptKernel};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Camera, Motion, Object, Scene};

use crate::shadows::{from_above, half_height, samples, square, white, worst_square};
use crate::support::{render, scene, sphere};

/// A picture of `of`, the mean of 4 x 4 places in each pixel.
fn sky(width: usize, of: impl Fn(DVec3) -> DVec3) -> Environment {
    let pixel = |i: usize| {
        let mut sum = DVec3::ZERO;
        for j in 0..16_usize {
            let [x, y] = [(i % width, j % 4), (i / width, j / 4)].map(|(k, j)| k as f64 + (j as f64 + 0.5) / 4.0);
            let (ring, height) = (y / (width / 2) as f64 * PI).sin_cos();
            let (sin, cos) = ((x / width as f64 - 0.5) * TAU).sin_cos();
            sum += of(DVec3::new(ring * sin, height, -ring * cos));
        }
        (sum / 16.0).as_vec3().to_array()
    };
    Environment::new(LatLong::new(width, (0..width * width / 2).map(pixel).collect()).unwrap()).lighting()
}

fn even_sky() -> Environment {
    sky(64, |d| DVec3::splat(if d.y > 0.0 { 1.0 } else { 0.0 }))
}

/// White light of a cap of `degrees` with radiance 10 over `ground`, on a surface whose normal is `angle` away from the
/// cap's middle: an integral over rings.
fn under_cap(degrees: f64, ground: f64, angle: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let (rings, parts) = (100, 360);
    let mut sum = 0.0;
    for ring in 0..rings {
        let polar = degrees.to_radians() * (f64::from(ring) + 0.5) / f64::from(rings);
        let at = |part: i32| {
            let turn = (f64::from(part) + 0.5) / f64::from(parts) * TAU;
            (polar.cos() * cos + polar.sin() * sin * turn.cos()).max(0.0)
        };
        sum += (0..parts).map(at).sum::<f64>() * polar.sin();
    }
    let step = degrees.to_radians() / f64::from(rings) * TAU / f64::from(parts);
    ground + (10.0 - ground) * sum * step / PI
}

/// A white ball of `n` surfels with this radius.
fn ball(n: usize, radius: f64, centre: DVec3) -> Object {
    let mut model = sphere(n);
    let small = |v: &mut Vec3| *v *= radius as f32;
    model.position.iter_mut().for_each(small);
    model.axis_u.iter_mut().chain(&mut model.axis_v).for_each(small);
    model.colour.fill(Vec3::ONE);
    let mut ball = white(model);
    ball.transform.translate = centre;
    ball
}

fn lit(mut scene: Scene, environment: Environment) -> Scene {
    scene.lights.clear();
    scene.environment = Some(environment);
    scene
}

/// The worst difference between red on a ball and what its normal there should show. Pixels of the outline are left
/// out.
fn worst_of_ball(picture: &Picture, want: impl Fn(DVec3) -> f64) -> f64 {
    let normals = &picture.layers.iter().find(|layer| layer.aov == Aov::Normal).unwrap().planes;
    let mut worst = 0.0_f64;
    for (i, pixel) in picture.rgba.iter().enumerate() {
        let normal = DVec3::from([0, 1, 2].map(|c: usize| f64::from(normals[c][i])));
        if pixel[3] > 0.999 && normal.z > 0.1 {
            worst = worst.max((f64::from(pixel[0]) - want(normal.normalize())).abs());
        }
    }
    worst
}

/// Caps of light from all sides on a white ball: with shadows within 1e-2 of the largest value, at all normals; without
/// them nine harmonics, as wrong as these are, and never below 0.
#[test]
#[ignore = "deep: many samples"]
fn a_white_ball_under_caps() {
    let front = DVec3::new(0.2, 0.3, 1.0);
    let side = DVec3::new(1.0, 0.4, 0.1);
    let back = DVec3::new(-0.3, 0.8, -0.9);
    for (degrees, ground, axis) in [(5.0, 0.0, side), (5.0, 1.0, front), (30.0, 0.0, back), (30.0, 1.0, side)] {
        let axis = axis.normalize();
        let largest = under_cap(degrees, ground, 0.0);
        let least = f64::to_radians(degrees).cos();
        let environment = sky(512, |d| DVec3::splat(if d.dot(axis) >= least { 10.0 } else { ground }));
        let scene = scene(vec![ball(5_000, 1.0, DVec3::ZERO)], [40, 40], DVec3::new(0.0, 0.0, 4.0), 30.0);
        let mut scene = lit(scene, environment);
        // Alpha is coverage.
        scene.image.transparent = true;
        let want = |normal: DVec3| under_cap(degrees, ground, normal.dot(axis).clamp(-1.0, 1.0).acos());
        let look = Look { aovs: vec![Aov::Normal], ..Look::default() };
        // With 256 the noise of an even sky is .017 at the worst normal.
        let picture = render(&scene, &RenderOptions { look: look.clone(), ..samples(1024) });
        let worst = worst_of_ball(&picture, want) / largest;
        let look = Look { shadows: false, ..look };
        let picture = render(&scene, &RenderOptions { look, ..samples(1) });
        let smooth = worst_of_ball(&picture, want) / largest;
        assert!(picture.rgba.iter().all(|pixel| pixel[0] >= 0.0));
        println!("cap of {degrees} over {ground}: {worst:.4} of the largest, by harmonics {smooth:.4}");
        assert!(worst < 1e-2, "cap of {degrees} over {ground}: {worst}");
        assert!(smooth < 0.1, "cap of {degrees} over {ground}: {smooth}");
    }
}

/// Under an even sky a white ball is white, and shows half of it where its normal is level. A ball of radius R that
/// lies on a plane takes (R / d)^3 of the plane's light, d being the distance of its middle.
#[test]
fn a_ball_on_a_plane_under_an_even_sky() {
    let radius = 0.15;
    let floor = square([-1.0, -0.4], [1.0, 0.4], 0.0, 0.01);
    let ball = ball(20_000, radius, DVec3::new(0.0, radius, 0.0));
    let scene = lit(from_above(vec![floor, ball], [144, 48]), even_sky());
    let picture = render(&scene, &samples(256));
    let pixel = 2.0 * half_height() / 48.0;
    let mut truth = picture.clone();
    let mut nearest = f32::INFINITY;
    for (i, out) in truth.rgba.iter_mut().enumerate() {
        let x = ((i % 144) as f64 + 0.5 - 72.0) * pixel;
        let z = ((i / 144) as f64 + 0.5 - 24.0) * pixel;
        let distance = x.hypot(z);
        // The camera sees the ball before the floor up to here.
        if distance > 0.2 {
            out[0] = (1.0 - (radius / distance.hypot(radius)).powi(3)) as f32;
            nearest = nearest.min(out[0]);
        }
    }
    let worst = worst_square(&picture, &truth);
    let bias = (0..truth.rgba.len()).map(|i| f64::from(picture.rgba[i][0] - truth.rgba[i][0])).sum::<f64>();
    let bias = bias / truth.rgba.len() as f64;
    println!("worst square {worst:.4}, bias {bias:.5}; darkest {nearest:.3}");
    assert!(worst < 0.015 && bias.abs() < 2e-3 && nearest < 0.8, "worst {worst}, bias {bias}, darkest {nearest}");
}

/// A ball flies over a floor, before the reference, which draws directions by code of its own.
#[test]
fn a_flying_ball_before_the_reference() {
    let environment = sky(128, |d| {
        let sun = d.dot(DVec3::new(0.5, 0.8, 0.3).normalize()) > 12_f64.to_radians().cos();
        DVec3::new(0.5, 0.6, 0.8) * (1.0 + d.y).max(0.0) * 0.5 + if sun { DVec3::splat(10.0) } else { DVec3::ZERO }
    });
    let mut ball = ball(10_000, 0.12, DVec3::new(-0.25, 0.15, 0.0));
    ball.motions = vec![Motion::Linear { velocity: DVec3::new(0.5, 0.1, 0.0) }];
    let floor = square([-1.0, -0.5], [1.0, 0.5], 0.0, 0.02);
    let mut scene = lit(from_above(vec![floor, ball], [96, 32]), environment);
    scene.environment.as_mut().unwrap().rotation = 0.5;
    let truth = reference::picture(&scene, 0, &ReferenceOptions { samples: 256, ..ReferenceOptions::default() });
    let truth = truth.unwrap();
    let picture = render(&scene, &samples(256));
    let seen = flip::mean(&picture, &truth).unwrap();
    println!("worst square {:.4}, FLIP {seen:.4}", worst_square(&picture, &truth));
    assert!(worst_square(&picture, &truth) < 0.05);
    // Gouraud shading asks at centres of surfels.
    let look = Look { shading: Shading::Gouraud, ..Look::default() };
    let gouraud = render(&scene, &RenderOptions { look, ..samples(256) });
    assert!(worst_square(&gouraud, &picture) < 0.1);
}

/// What leaves shadows out.
#[test]
fn without_shadows() {
    let camera = DVec3::new(0.0, 0.0, 4.0);
    let mut scene = lit(scene(vec![ball(2_000, 1.0, DVec3::ZERO)], [24, 24], camera, 40.0), even_sky());
    let left_out = Look { shadows: false, ..Look::default() };
    let without = |options: &RenderOptions| RenderOptions { look: left_out.clone(), ..options.clone() };
    let plain = render(&scene, &without(&samples(4)));
    let sampled = render(&scene, &samples(4));
    assert_ne!(plain.rgba, sampled.rgba);
    // A level normal sees half of the sky.
    let middle = plain.rgba[12 * 24 + 12];
    assert!((middle[0] - 0.5).abs() < 0.05 && middle[3] == 1.0, "{middle:?}");
    let swept = RenderOptions {
        quality: BlurMode::Volumetric { intervals: 2, pixel_samples: None, swept: SweptKernel::default() }.into(),
        ..RenderOptions::default()
    };
    assert_ne!(render(&scene, &swept).rgba, render(&scene, &without(&swept)).rgba);
    scene.environment.as_mut().unwrap().shadows = false;
    assert_eq!(render(&scene, &samples(4)).rgba, plain.rgba);
    assert!(render_frame(&mut Cpu::default(), &scene, 0, &swept).is_ok());
    // Without the light nothing is lit, and a black one is no light.
    scene.environment.as_mut().unwrap().light = false;
    let dark = render(&scene, &samples(4));
    assert!(dark.rgba.iter().all(|pixel| pixel[..3] == [0.0; 3]));
    scene.environment = Some(sky(4, |_| DVec3::ZERO));
    for options in [samples(4), without(&samples(4)), swept] {
        assert_eq!(render(&scene, &options).rgba.len(), dark.rgba.len());
    }
    assert_eq!(render(&scene, &samples(4)).rgba, dark.rgba);
}

/// Mode auto states an error that holds the noise of the directions.
#[test]
fn mode_auto_takes_samples_for_the_sky() {
    let floor = square([-1.0, -0.4], [1.0, 0.4], 0.0, 0.02);
    let ball = ball(5_000, 0.15, DVec3::new(0.0, 0.15, 0.0));
    let mut scene = lit(from_above(vec![floor, ball], [96, 32]), even_sky());
    scene.camera = Camera { near: 0.01, ..scene.camera };
    let target = ErrorTarget::default();
    let options = RenderOptions { quality: target.into(), ..RenderOptions::default() };
    let rendered = render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap();
    let truth = render(&scene, &samples(1024));
    let squares = rendered.picture.rgba.iter().zip(&truth.rgba).map(|(a, b)| f64::from(a[0] - b[0]).powi(2));
    let error = (squares.sum::<f64>() / truth.rgba.len() as f64).sqrt();
    println!("{:?}, true error of red {error:.4}", rendered.stats.achieved);
    assert!(error < 0.03, "{error}");
}

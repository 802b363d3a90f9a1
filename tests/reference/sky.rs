//! Light of environments in the reference, with shadows and motion, against integrals that know neither rays nor
//! tables: all directions of a small picture, at all times.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3, Vec3};
use splatblur::environment::{Environment, LatLong};
use splatblur::scene::{Light, Motion, Object, Scene};

use crate::closed_forms::statistics;
use crate::shadows::{ball, floor, floor_place, lit, options, ray, traced};
use crate::support::Random;

/// Columns of the environments. As light their pixels are even.
const WIDTH: usize = 64;

/// The middle of a pixel, or another place of it.
fn towards(x: f64, y: f64) -> DVec3 {
    let (longitude, polar) = ((x / WIDTH as f64 - 0.5) * TAU, y / (WIDTH / 2) as f64 * PI);
    DVec3::new(polar.sin() * longitude.sin(), polar.cos(), -polar.sin() * longitude.cos())
}

fn sky(of: impl Fn(DVec3) -> DVec3) -> Environment {
    let pixel = |i: usize| of(towards((i % WIDTH) as f64 + 0.5, (i / WIDTH) as f64 + 0.5)).as_vec3().to_array();
    Environment::new(LatLong::new(WIDTH, (0..WIDTH * WIDTH / 2).map(pixel).collect()).unwrap()).lighting()
}

fn moving(mut object: Object, velocity: DVec3) -> Object {
    object.motions = vec![Motion::Linear { velocity }];
    object
}

fn under(objects: Vec<Object>, environment: Environment) -> Scene {
    let mut scene = lit(objects, Light::Ambient { colour: DVec3::ZERO }, DVec3::new(0.3, 2.0, 3.0), DVec3::ZERO);
    scene.lights.clear();
    scene.environment = Some(environment);
    scene
}

/// A ball of the scene: radius, and centre at a time.
type Ball = (f64, DVec3, DVec3);

fn objects(balls: &[Ball]) -> Vec<Object> {
    let of = |&(radius, centre, velocity): &Ball| moving(ball(radius, centre), velocity);
    std::iter::once(floor()).chain(balls.iter().map(of)).collect()
}

/// Is a place of the floor free of balls in a direction at a time?
fn is_free(place: DVec3, along: DVec3, balls: &[Ball], time: f64) -> bool {
    balls.iter().all(|&(radius, centre, velocity)| {
        let to = centre + velocity * time - place;
        to.dot(along) <= 0.0 || to.cross(along).length() >= radius
    })
}

/// Light on a place of the floor between balls: 16 directions of each pixel of the environment, or 1,600 where it is
/// bright, each at a time of its own.
fn integral(environment: &Environment, balls: &[Ball], place: DVec3) -> DVec3 {
    let mut random = Random(place.x.to_bits() ^ place.z.to_bits());
    let (map, mut sum) = (environment.map(), DVec3::ZERO);
    let turn = DQuat::from_rotation_y(environment.rotation);
    for (i, pixel) in map.pixels().iter().enumerate() {
        let (x, y) = ((i % WIDTH) as f64, (i / WIDTH) as f64);
        let [top, bottom] = [y, y + 1.0].map(|y| (PI * y / (WIDTH / 2) as f64).cos());
        let side = if pixel[0] > 5.0 { 40 } else { 4 };
        let count = f64::from(side * side);
        let weight = Vec3::from(*pixel).as_dvec3() * ((top - bottom) / count);
        if weight == DVec3::ZERO || top <= 0.0 {
            continue;
        }
        // The times of a pixel are even, in an order of its own.
        let (shift, stride) = (random.next(), [3, 7, 9, 11, 13, 17][(random.next() * 6.0) as usize]);
        for k in 0..side * side {
            let [a, b] = [k % side, k / side].map(|k| (f64::from(k) + random.next()) / f64::from(side));
            let height = top + (bottom - top) * b;
            let flat = towards(x + a, 0.5 * (WIDTH / 2) as f64);
            let ring = (1.0 - height * height).sqrt();
            let along = turn * DVec3::new(flat.x * ring, height, flat.z * ring);
            let time = ((f64::from(k * stride % (side * side)) + random.next()) / count + shift).fract();
            if along.y > 0.0 && is_free(place, along, balls, time) {
                sum += weight * along.y;
            }
        }
    }
    sum * environment.intensity * TAU / WIDTH as f64 / PI
}

/// Is a place of the floor seen at all times? No ball stands before it.
fn shows_floor(scene: &Scene, balls: &[Ball], place: DVec3) -> bool {
    let along = (place - scene.camera.eye).normalize();
    (0..=64).all(|step| {
        balls.iter().all(|&(radius, centre, velocity)| {
            let to = centre + velocity * f64::from(step) / 64.0 - scene.camera.eye;
            to.cross(along).length() > radius + 0.02
        })
    })
}

/// Holds the floor of a scene between balls against the light that each place should show.
fn check(name: &str, scene: &Scene, balls: &[Ball], light: impl Fn(DVec3) -> DVec3) {
    let reference = traced(scene, &options(1024));
    let expected = |x: usize, y: usize| {
        let place = floor_place(scene, x, y).filter(|&place| shows_floor(scene, balls, place))?;
        Some(light(place).extend(1.0).to_array())
    };
    let s = statistics(&reference, &expected);
    let values = (0..reference.picture.rgba.len()).filter_map(|i| Some(expected(i % 24, i / 24)?[0]));
    let (mut least, mut most, mut count) = (f64::INFINITY, 0.0_f64, 0);
    for value in values {
        (least, most, count) = (least.min(value), most.max(value), count + 1);
    }
    let [z, within] = [s.rms, 100.0 * s.within];
    let error = s.error;
    println!("{name}: {count} pixels of {least:.3} to {most:.3}, z {z:.2}, {within:.2} % within 4, SE {error:.1e}");
    assert!(count > 200 && least < 0.75 * most, "{name}: {count}, {least} to {most}");
    assert!(z < 1.25 && within > 99.0, "{name}: rms of z {z:.3}, {within:.3} % within 4 standard errors");
    assert!(error < 5e-3 * most.max(1.0), "{name}: mean SE {error:.1e}");
}

fn compare(name: &str, environment: &Environment, balls: &[Ball]) {
    let scene = under(objects(balls), environment.clone());
    check(name, &scene, balls, |place| integral(environment, balls, place));
}

/// A ball on a floor under an even sky: the ball takes (R / d)^3 of the light, d being the distance of its middle.
#[test]
fn a_ball_on_a_floor_under_an_even_sky() {
    let environment = sky(|d| DVec3::splat(if d.y > 0.0 { 1.0 } else { 0.0 }));
    let closed = |place: DVec3, centre: DVec3| 1.0 - (0.4 / place.distance(centre)).powi(3);
    let (start, velocity) = (DVec3::new(-0.3, 0.4, 0.0), DVec3::new(0.6, 0.0, 0.2));
    let balls = [(0.4, start, velocity)];
    let scene = under(objects(&balls), environment.clone());
    let mean = |place: DVec3| {
        let at = |step: i32| closed(place, start + velocity * (f64::from(step) + 0.5) / 500.0);
        (0..500).map(at).sum::<f64>() / 500.0
    };
    let place = DVec3::new(0.1, 0.0, 0.6);
    let other = integral(&environment, &balls, place);
    assert!((other.x - mean(place)).abs() < 2e-3, "{other}, not {}", mean(place));
    check("even sky", &scene, &balls, |place| DVec3::splat(mean(place)));
}

#[test]
#[ignore = "deep: many samples"]
fn a_ball_flies_under_caps() {
    let cap = |d: DVec3, axis: DVec3, degrees: f64| d.dot(axis.normalize()) >= degrees.to_radians().cos();
    let environment = sky(|d| {
        let bright = if cap(d, DVec3::new(0.3, 1.0, 0.2), 20.0) { 9.0 } else { 0.0 };
        DVec3::splat(bright + if cap(d, DVec3::new(-1.0, 0.7, 0.5), 12.0) { 12.0 } else { 0.0 })
    });
    compare("caps", &environment, &[(0.3, DVec3::new(-0.6, 0.9, -0.2), DVec3::new(1.0, 0.1, 0.3))]);
}

#[test]
fn two_balls_under_a_turned_sky_of_many_values() {
    let mut environment = sky(|d| {
        let value = 1.5 + (3.0 * d.x).sin() * d.z + 2.0 * (4.0 * d.y + d.z).cos();
        DVec3::new(1.5 * value.max(0.0), 1.0 + d.x, 0.6)
    });
    (environment.rotation, environment.intensity) = (1.1, 0.4);
    let balls = [
        (0.4, DVec3::new(-0.5, 0.45, -0.3), DVec3::new(0.3, 0.2, 0.0)),
        (0.3, DVec3::new(0.7, 0.6, -0.2), DVec3::new(-0.3, -0.2, 0.3)),
    ];
    compare("turned", &environment, &balls);
}

#[test]
fn one_bright_pixel_over_a_dim_sky() {
    let sun = 7 * WIDTH + 40;
    let mut pixels = vec![[0.2_f32; 3]; WIDTH * WIDTH / 2];
    pixels[sun] = [300.0; 3];
    let environment = Environment::new(LatLong::new(WIDTH, pixels).unwrap()).lighting();
    compare("sun", &environment, &[(0.35, DVec3::new(-0.2, 0.6, -0.3), DVec3::new(0.5, 0.0, 0.0))]);
}

/// An environment beside a light with shadows, before a ball that falls.
#[test]
fn a_sky_beside_a_lamp() {
    let environment = sky(|d| DVec3::splat((0.5 + d.y).max(0.0)));
    let lamp = DVec3::new(0.5, 2.5, -0.4);
    let balls = [(0.3, DVec3::new(0.0, 1.2, -0.2), DVec3::new(0.2, -0.8, 0.1))];
    let mut scene = under(objects(&balls), environment.clone());
    scene.lights = vec![Light::point(lamp, DVec3::splat(2.0))];
    check("sky and lamp", &scene, &balls, |place| {
        let to = lamp - place;
        let free = |step: &i32| is_free(place, to.normalize(), &balls, (f64::from(*step) + 0.5) / 2000.0);
        let share = (0..2000).filter(free).count() as f64 / 2000.0;
        let of_lamp = 2.0 * share * to.normalize().y / to.length_squared();
        integral(&environment, &balls, place) + of_lamp
    });
}

/// Without shadows the floor's light is the same everywhere: that of nine harmonics. A ball shows them in all
/// directions. Degrees 0, 1 and 2 keep 1, 2/3 and 1/4.
#[test]
fn without_shadows_it_is_smooth() {
    let mut environment = sky(|d| DVec3::new(1.0 + 0.5 * d.x, 1.0 + d.x * d.z, 1.0 + d.y * d.y - 1.0 / 3.0));
    environment.rotation = 0.4;
    let mut scene = under(vec![ball(0.9, DVec3::ZERO)], environment);
    let mut pictures = Vec::new();
    for (shadows, look) in [(false, true), (true, false), (false, false)] {
        scene.environment.as_mut().unwrap().shadows = shadows;
        let mut options = options(16);
        options.look.shadows = look;
        pictures.push(traced(&scene, &options).picture);
    }
    assert_eq!(pictures[0].rgba, pictures[1].rgba);
    assert_eq!(pictures[0].rgba, pictures[2].rgba);
    let mut count = 0;
    for (i, pixel) in pictures[0].rgba.iter().enumerate() {
        let (eye, along) = (scene.camera.eye, ray(&scene, i % 24, i / 24));
        let middle = -eye.dot(along);
        let half2 = 0.81 - (eye + along * middle).length_squared();
        if half2 < 0.05 {
            continue;
        }
        let n = DQuat::from_rotation_y(-0.4) * ((eye + along * (middle - half2.sqrt())) / 0.9);
        let want = DVec3::new(1.0 + n.x / 3.0, 1.0 + 0.25 * n.x * n.z, 1.0 + 0.25 * (n.y * n.y - 1.0 / 3.0));
        let got = Vec3::new(pixel[0], pixel[1], pixel[2]).as_dvec3();
        assert!(got.abs_diff_eq(want, 2e-3), "pixel {i}: {got}, not {want}");
        count += 1;
    }
    assert!(count > 50, "{count}");
}

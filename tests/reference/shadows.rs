//! Shadows in the reference against closed forms and integrals in `f64`. Pictures have the point filter, so that a
//! pixel shows one place of a floor at y = 0.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::f64::consts::{PI, TAU};
use std::fs;

use glam::{DVec3, Quat, Vec3};
use splatblur::film::Picture;
use splatblur::model::{Gaussians, Material, Optics, Surfels};
use splatblur::options::{Look, PixelFilter, Shading};
use splatblur::reference::{Reference, ReferenceOptions, render};
use splatblur::scene::{Light, Motion, Object, Scene, Sphere};

use crate::closed_forms::statistics;
use crate::parts::{assert_parts_and_threads_change_nothing, bits};
use crate::support::{Random, object, round_surfels, scene, sphere};

const SIZE: [u32; 2] = [24, 16];
const SAMPLES: u64 = 1024;
const DOWN: DVec3 = DVec3::NEG_Y;
/// White: what is seen is the light that arrives.
const LAMBERT: Material = Material { ambient: 0.0, diffuse: 1.0, specular: 0.0, shininess: 1.0 };
/// Radius of discs that stand for planes: a power of 2 is exact in f32, and the rim is straight to 1e-5.
const WIDE: f64 = 262_144.0;

/// A disc about the origin.
fn disc(normal: DVec3, radius: f64) -> Object {
    let mut disc = object(round_surfels([(DVec3::ZERO, normal, radius, Vec3::ONE)]));
    disc.shape.surface_mut().unwrap().material = Some(LAMBERT);
    disc.epsilon = Some(1e-3);
    disc
}

fn at(mut object: Object, place: DVec3) -> Object {
    object.transform.translate = place;
    object
}

pub(crate) fn floor() -> Object {
    disc(DVec3::Y, WIDE)
}

/// All of a plane at `height` with x < 0.
fn half_plane(normal: DVec3, height: f64) -> Object {
    at(disc(normal, WIDE), DVec3::new(-WIDE, height, 0.0))
}

pub(crate) fn ball(radius: f64, centre: DVec3) -> Object {
    let mut ball = at(object(Surfels::default()), centre);
    ball.shape = Sphere { radius, colour: Vec3::ONE }.into();
    ball.shape.surface_mut().unwrap().material = Some(LAMBERT);
    ball
}

/// A scene lit by one white light.
pub(crate) fn lit(objects: Vec<Object>, light: Light, eye: DVec3, towards: DVec3) -> Scene {
    let mut scene = scene(objects, SIZE, eye, 30.0);
    scene.camera.at = towards;
    scene.lights = vec![light];
    scene
}

fn sun(direction: DVec3, degrees: f64) -> Light {
    let (direction, colour, angle) = (direction.normalize(), DVec3::ONE, degrees.to_radians());
    Light::Directional { direction, colour, angle, shadows: true }
}

fn lamp(position: DVec3, radius: f64) -> Light {
    let colour = DVec3::splat(position.y * position.y);
    Light::Point { position, colour, radius, shadows: true }
}

fn without_shadows(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    for light in &mut scene.lights {
        if let Light::Directional { shadows, .. } | Light::Point { shadows, .. } = light {
            *shadows = false;
        }
    }
    scene
}

pub(crate) fn options(samples: u64) -> ReferenceOptions {
    let look = Look { filter: PixelFilter::Point, ..Look::default() };
    ReferenceOptions { samples, look, ..ReferenceOptions::default() }
}

pub(crate) fn traced(scene: &Scene, options: &ReferenceOptions) -> Reference {
    render(scene, 0, options, None, &|_| ()).unwrap()
}

fn picture(scene: &Scene) -> Picture {
    traced(scene, &options(64)).picture
}

/// The ray through the middle of a pixel: a unit vector from the eye.
pub(crate) fn ray(scene: &Scene, x: usize, y: usize) -> DVec3 {
    let camera = &scene.camera;
    let [width, height] = [scene.image.width, scene.image.height].map(f64::from);
    let forward = (camera.at - camera.eye).normalize();
    let right = forward.cross(DVec3::Y).normalize();
    let up = right.cross(forward);
    let pixel = 2.0 * (0.5 * camera.fovy).tan() / height;
    let [a, b] = [x as f64 + 0.5 - 0.5 * width, 0.5 * height - y as f64 - 0.5];
    (forward + pixel * (a * right + b * up)).normalize()
}

/// The place of the floor that a pixel shows.
pub(crate) fn floor_place(scene: &Scene, x: usize, y: usize) -> Option<DVec3> {
    let along = ray(scene, x, y);
    (along.y < 0.0).then(|| scene.camera.eye + along * (scene.camera.eye.y / -along.y))
}

/// Does a line meet a ball? The line is unit vector `along` from `from`.
fn meets(from: DVec3, along: DVec3, centre: DVec3, radius: f64) -> bool {
    let to = centre - from;
    to.dot(along) > 0.0 && to.cross(along).length() < radius
}

/// The demands on a picture of light that falls on the floor: `light` at a place; `None`: not compared.
fn check(name: &str, scene: &Scene, light: impl Fn(DVec3) -> Option<f64>) {
    let reference = traced(scene, &options(SAMPLES));
    let expected = |x: usize, y: usize| {
        let light = light(floor_place(scene, x, y)?)?;
        Some([light, light, light, 1.0])
    };
    let s = statistics(&reference, &expected);
    let (mut worst, mut count, mut soft) = (0.0_f64, 0, 0);
    for (i, pixel) in reference.picture.rgba.iter().enumerate() {
        let Some([want, ..]) = expected(i % SIZE[0] as usize, i / SIZE[0] as usize) else { continue };
        worst = worst.max((f64::from(pixel[0]) - want).abs());
        count += 1;
        soft += usize::from(0.1 < want && want < 0.9);
    }
    let [z, within] = [s.rms, 100.0 * s.within];
    println!("{name}: {count} pixels, {soft} in penumbra, rms of z {z:.2}, worst {worst:.1e}, mean SE {:.1e}", s.error);
    assert!(count > 200 && soft > 20, "{name}: {count}, {soft}");
    assert!(z < 1.25 && within > 99.0, "{name}: rms of z {z:.3}, {within:.3} % within 4 standard errors");
    assert!(s.error < 2e-3 && worst < 0.03, "{name}: mean SE {:.1e}, worst {worst:.1e}", s.error);
}

/// Share of a disc of radius 1 beyond a chord at distance -x from its middle.
fn share_of_disc(x: f64) -> f64 {
    let x = x.clamp(-1.0, 1.0);
    0.5 + (x.asin() + x * (1.0 - x * x).sqrt()) / PI
}

/// Light from a cone around the zenith of full angle `angle` on a floor, beside the edge of a half-plane at height `h`
/// above x = 0: for each ring of the cone the share that passes the edge.
fn beside_an_edge(x: f64, h: f64, angle: f64) -> f64 {
    let n = 4000;
    let least = (0.5 * angle).cos();
    let ring = |i: i32| {
        let cos = least + (1.0 - least) * (f64::from(i) + 0.5) / f64::from(n);
        let reach = h * (1.0 - cos * cos).sqrt() / cos;
        cos * (-x / reach).clamp(-1.0, 1.0).acos() / PI
    };
    (0..n).map(ring).sum::<f64>() / f64::from(n)
}

const EYE: DVec3 = DVec3::new(0.3, 2.0, 3.0);

#[test]
fn a_wide_sun_beside_an_edge() {
    // Either side casts.
    for normal in [DVec3::Y, DOWN] {
        let mut scene = lit(vec![floor(), half_plane(normal, 4.0)], sun(DOWN, 20.0), EYE, DVec3::ZERO);
        scene.objects[0].shape.surface_mut().unwrap().two_sided = normal == DOWN;
        check(&format!("edge {normal}"), &scene, |p| Some(beside_an_edge(p.x, 4.0, 20_f64.to_radians())));
    }
    // The angle is so small that the cone is a flat disc.
    let scene = lit(vec![floor(), half_plane(DOWN, 40.0)], sun(DOWN, 1.0), EYE, DVec3::ZERO);
    let reach = 40.0 * 0.5_f64.to_radians().tan();
    let cosine = 0.5 * (1.0 + 0.5_f64.to_radians().cos());
    check("edge far away", &scene, |p| Some(cosine * share_of_disc(p.x / reach)));
}

#[test]
fn triangles_cast_and_receive() {
    let folder = tempfile::tempdir().unwrap();
    let quad = |name: &str, y: f64, right: f64| {
        let (low, high) = ([-64.0, -64.0], [right, 64.0]);
        let corners = [[low[0], low[1]], [low[0], high[1]], [high[0], high[1]], [high[0], low[1]]];
        let [a, b, c, d] = corners.map(|[x, z]| format!("v {x} {y} {z}"));
        let path = folder.path().join(name);
        fs::write(&path, [&a, &b, &c, &d, "f 1 2 3", "f 1 3 4", ""].join("\n")).unwrap();
        let scene_path = folder.path().join(format!("{name}.xml"));
        let text = format!(
            "<scene><image width=\"8\" height=\"8\"/><camera eye=\"0 9 9\" at=\"0 0 0\" fovy=\"40\"/>\
             <object><pointModel>{}</pointModel></object></scene>",
            path.display()
        );
        fs::write(&scene_path, text).unwrap();
        let mut object = Scene::load(scene_path).unwrap().objects.remove(0);
        object.shape.surface_mut().unwrap().material = Some(LAMBERT);
        object
    };
    let objects = vec![quad("floor.obj", 0.0, 64.0), quad("edge.obj", 4.0, 0.0)];
    let mut scene = lit(objects, sun(DOWN, 20.0), EYE, DVec3::ZERO);
    // The file names no colour.
    let grey = f64::from(picture(&without_shadows(&scene)).rgba[0][0]);
    if let Light::Directional { colour, .. } = &mut scene.lights[0] {
        *colour /= grey;
    }
    check("triangles", &scene, |p| Some(beside_an_edge(p.x, 4.0, 20_f64.to_radians())));
}

/// Points of a ball of light about the origin that is an even disc from everywhere: shells r = sin(a) of the density
/// 1 / sqrt(1 - r^2), each even in height and turn. Weights are not normalised.
fn ball_of_light(shells: u32, heights: u32, turns: u32) -> Vec<(DVec3, f64)> {
    let middle = |i: u32, n: u32| (f64::from(i) + 0.5) / f64::from(n);
    let mut points = Vec::new();
    for i in 0..shells {
        let r = (0.5 * PI * middle(i, shells)).sin();
        for j in 0..heights {
            let z = 2.0 * middle(j, heights) - 1.0;
            for k in 0..turns {
                let (q, turn) = ((1.0 - z * z).sqrt(), TAU * middle(k, turns));
                points.push((r * DVec3::new(q * turn.cos(), z, q * turn.sin()), r * r));
            }
        }
    }
    points
}

/// Light of a lamp on a place of the floor, of which `open` says what passes.
fn lamplight(at: DVec3, place: DVec3, open: bool) -> f64 {
    let to = at - place;
    if open { to.y / to.length().powi(3) } else { 0.0 }
}

/// Umbra and penumbra of a ball under a ball of light, with other lights that have no shadows.
#[test]
fn a_ball_under_a_ball_of_light() {
    let (lamp_at, centre, radius, reach) = (DVec3::new(0.0, 6.0, 0.0), DVec3::new(0.0, 1.6, 0.0), 1.0, 1.0);
    let objects = vec![floor(), ball(radius, centre)];
    let mut scene = lit(objects, lamp(lamp_at, reach), DVec3::new(0.0, 3.0, 8.0), DVec3::new(0.0, 0.0, 1.0));
    let mut material = LAMBERT;
    material.ambient = 1.0;
    scene.objects[0].shape.surface_mut().unwrap().material = Some(material);
    scene.lights.push(Light::directional(DVec3::new(0.0, -0.8, 0.6), DVec3::splat(0.25)).without_shadows());
    scene.lights.insert(0, Light::Ambient { colour: DVec3::splat(0.125) });
    // All that counts is the distance from the axis.
    let points = ball_of_light(32, 48, 48);
    let total: f64 = points.iter().map(|point| point.1).sum();
    let step = 0.02;
    let profile: Vec<f64> = (0..400)
        .map(|i| {
            let place = DVec3::new(0.0, 0.0, step * f64::from(i));
            let light = |&(offset, weight): &(DVec3, f64)| {
                let from = lamp_at + reach * offset;
                weight * lamplight(from, place, !meets(place, (from - place).normalize(), centre, radius))
            };
            points.iter().map(light).sum::<f64>() / total
        })
        .collect();
    assert!(profile[0] == 0.0 && profile[40] == 0.0, "an umbra");
    let eye = scene.camera.eye;
    check("ball", &scene, |p| {
        let along = p.x.hypot(p.z) / step;
        let i = along as usize;
        let seen = i + 1 < profile.len() && !meets(eye, (p - eye).normalize(), centre, radius);
        seen.then(|| 36.0 * (profile[i] + (along - i as f64) * (profile[i + 1] - profile[i])) + 0.125 + 0.25 * 0.8)
    });
}

/// Gaussians around that ball have their colour times the share of all light that reaches their centres: of a ball of
/// light each point counts by the square of its distance, without a cosine.
#[test]
fn captures_keep_the_share_of_light_that_reaches_them() {
    let (lamp_at, centre, radius) = (DVec3::new(0.0, 6.0, 0.0), DVec3::new(0.0, 1.6, 0.0), 1.0);
    let places = [-2.9, -1.4, 0.0, 1.2, 2.6];
    let capture = Gaussians {
        position: places.iter().map(|&x| Vec3::new(x, 0.0, 0.0)).collect(),
        sigma: vec![Vec3::splat(0.2); places.len()],
        rotation: vec![Quat::IDENTITY; places.len()],
        opacity: vec![0.9; places.len()],
        base: vec![Vec3::ZERO; places.len()],
        linear: true,
        ..Gaussians::default()
    };
    let objects = vec![Object::new(capture), ball(radius, centre)];
    let mut scene = lit(objects, lamp(lamp_at, 1.0), DVec3::new(0.0, 3.0, 8.0), DVec3::ZERO);
    scene.image.transparent = true;
    scene.lights.push(Light::Ambient { colour: DVec3::splat(0.25) });
    let points = ball_of_light(32, 48, 48);
    let total: f64 = points.iter().map(|point| point.1).sum();
    let share = |x: f32| {
        let place = DVec3::new(f64::from(x), 0.0, 0.0);
        let left = |&(offset, weight): &(DVec3, f64)| {
            let to = lamp_at + offset - place;
            let light = 36.0 / to.length_squared();
            let seen = if meets(place, to.normalize(), centre, radius) { 0.0 } else { light };
            weight * (0.25 + seen) / (0.25 + light)
        };
        points.iter().map(left).sum::<f64>() / total
    };
    let seen = |scene: &Scene| {
        let picture = traced(scene, &options(SAMPLES)).picture;
        let [width, height] = SIZE.map(|pixels| pixels as usize);
        let pixels = (0..width * height).map(|i| ([i % width, i / width], picture.rgba[i].map(f64::from)));
        let found = places.map(|x| {
            let near = pixels.clone().filter(|([column, row], _)| {
                let ray = ray(scene, *column, *row);
                let to = DVec3::new(f64::from(x), 0.0, 0.0) - scene.camera.eye;
                (to - ray * to.dot(ray)).length() < 0.3
            });
            let sum = near.fold([0.0; 2], |sum, (_, [red, _, _, alpha])| [sum[0] + red, sum[1] + alpha]);
            assert!(sum[1] > 0.2, "{x}: {sum:?}");
            sum[0] / sum[1]
        });
        println!("{found:?}");
        found
    };
    let found = seen(&scene);
    for (x, found) in places.into_iter().zip(found) {
        let want = 0.5 * share(x);
        println!("{x}: {found:.4}, {want:.4}");
        // A thousand points on the light are .01 off at a border.
        assert!((found - want).abs() < 0.01, "{x}: {found} for {want}");
    }
    assert!(share(0.0) < 0.21 && (0.3..0.8).contains(&share(1.2)) && share(2.6) == 1.0, "umbra, penumbra, light");
    scene.objects[0].receive_shadows = false;
    assert!(seen(&scene).into_iter().all(|found| (found - 0.5).abs() < 1e-6), "it receives none");
}

/// A catcher is black, and its alpha 1 - lit / unlit as two pictures of the same floor have it; nothing else changes.
#[test]
fn a_catcher_shows_the_light_that_is_gone() {
    let objects = vec![floor(), ball(0.5, DVec3::new(0.0, 0.8, 0.0))];
    let direction = DVec3::new(0.3, -1.0, 0.2);
    // Without shadows a light is its middle.
    let mut scene = lit(objects, sun(direction, 0.0), DVec3::new(0.0, 3.0, 5.0), DVec3::ZERO);
    scene.image.transparent = true;
    scene.lights.push(Light::Ambient { colour: DVec3::splat(0.25) });
    let mut material = LAMBERT;
    (material.ambient, material.specular) = (1.0, 0.0);
    scene.objects[0].shape.surface_mut().unwrap().material = Some(material);
    let [lit, unlit] = [&scene, &without_shadows(&scene)].map(|scene| traced(scene, &options(256)).picture);
    let mut catcher = scene.clone();
    catcher.objects[0].shadow_catcher = true;
    let caught = traced(&catcher, &options(256)).picture;
    let bare = traced(&without_shadows(&catcher), &options(256)).picture;
    let (mut worst, mut floors, mut balls, mut darkest) = (0.0_f32, 0, 0, 0.0_f32);
    for (i, pixel) in caught.rgba.iter().enumerate() {
        if bare.rgba[i] == [0.0; 4] {
            assert_eq!(pixel[..3], [0.0; 3], "black");
            let want = 1.0 - lit.rgba[i][0] / unlit.rgba[i][0];
            (worst, darkest, floors) = (worst.max((pixel[3] - want).abs()), darkest.max(want), floors + 1);
        } else if bare.rgba[i][3] == 1.0 {
            assert_eq!(*pixel, lit.rgba[i], "the ball is as before");
            balls += 1;
        }
    }
    println!("worst {worst}, darkest {darkest}, {floors} pixels of floor, {balls} of the ball");
    assert!(worst < 1e-5 && darkest > 0.7 && floors > 200 && balls > 10, "{worst}, {darkest}, {floors}, {balls}");
}

/// The share of a ball of light that shows beside an edge is that of a disc, from every place.
#[test]
fn a_ball_of_light_beside_an_edge() {
    let (height, above, radius) = (10.0, 20.0, 0.5);
    let scene =
        lit(vec![floor(), half_plane(DVec3::Y, height)], lamp(DVec3::new(0.0, above, 0.0), radius), EYE, DVec3::ZERO);
    check("lamp beside an edge", &scene, |p| {
        // Distance of the lamp's middle from the plane through the place and the edge.
        let distance = p.x * (above - height) / p.x.hypot(height);
        Some(share_of_disc(distance / radius) * above * above * lamplight(DVec3::Y * above, p, true))
    });
}

/// A place is dark while the ball is between it and the lamp: the time between the roots of a quadratic.
#[test]
fn a_moving_ball_darkens_for_its_time() {
    let (lamp_at, start, velocity, radius) = (DVec3::Y * 4.0, DVec3::new(-1.0, 1.0, 0.2), DVec3::X * 2.0, 0.5);
    for blur in [true, false] {
        let mut moving = ball(radius, start);
        moving.motions = vec![Motion::Linear { velocity }];
        moving.blur = blur;
        let eye = DVec3::new(0.0, 5.0, 8.0);
        // What is beyond the lamp darkens nothing.
        let ceiling = at(disc(DOWN, WIDE), DVec3::Y * 6.0);
        let scene = lit(vec![floor(), moving, ceiling], lamp(lamp_at, 0.0), eye, DVec3::new(0.0, 0.0, 1.0));
        let dark = |p: DVec3| {
            let along = (lamp_at - p).normalize();
            let across = |v: DVec3| v - along * v.dot(along);
            let (from, speed) = (across(start - p), if blur { across(velocity) } else { DVec3::ZERO });
            if speed == DVec3::ZERO {
                return f64::from(u8::from(from.length() < radius));
            }
            let (a, b, c) = (speed.length_squared(), from.dot(speed), from.length_squared() - radius * radius);
            let half = (b * b - a * c).max(0.0).sqrt();
            let [first, last] = [-b - half, -b + half].map(|root| (root / a).clamp(0.0, 1.0));
            last - first
        };
        check(&format!("moving ball, blur {blur}"), &scene, |p| {
            let along = (p - eye).normalize();
            let hidden = (0..=64).any(|i| meets(eye, along, start + velocity * f64::from(i) / 64.0, 1.01 * radius));
            (!hidden).then(|| 16.0 * (1.0 - dark(p)) * lamplight(lamp_at, p, true))
        });
    }
}

/// Floor, edge, balls of surfels and of nothing but a form, a sheet that light passes through, every light.
fn busy() -> Scene {
    let mut surfels = at(object(sphere(800)), DVec3::new(0.8, 1.0, 0.0));
    surfels.motions = vec![Motion::Linear { velocity: DVec3::new(0.2, 0.3, 0.0) }];
    let mut sheet = at(disc(DVec3::Y, 0.7), DVec3::new(-0.5, 0.6, 1.0));
    sheet.opacity = 0.5;
    let objects = vec![floor(), half_plane(DVec3::Y, 4.0), surfels, ball(0.4, DVec3::new(-0.8, 0.4, 0.2)), sheet];
    let mut scene = lit(objects, sun(DVec3::new(-0.5, -1.0, -0.3), 10.0), EYE * 2.0, DVec3::ZERO);
    scene.lights.push(lamp(DVec3::new(1.0, 3.0, 2.0), 0.5));
    scene.lights.push(Light::Ambient { colour: DVec3::splat(0.2) });
    scene
}

#[test]
fn shadows_that_are_not_asked_for_change_nothing() {
    let scene = busy();
    for shading in [Shading::Phong, Shading::Gouraud] {
        let with = |shadows: bool| {
            let plain = options(64);
            ReferenceOptions { look: Look { shadows, shading, ..plain.look.clone() }, ..plain }
        };
        let traced = |scene: &Scene, shadows: bool| traced(scene, &with(shadows)).picture;
        let none = bits(&traced(&without_shadows(&scene), true));
        assert!(bits(&traced(&scene, false)) == none, "{shading}");
        assert!(bits(&traced(&scene, true)) != none, "{shading}");
    }
}

#[test]
fn shadows_depend_on_no_parts_and_threads() {
    assert_parts_and_threads_change_nothing(&busy());
}

/// See-through surfels receive shadows and cast some, and what is told to cast none casts none.
#[test]
fn light_passes_through_what_is_see_through() {
    for (see_through, casts, is_darker) in [(0, true, true), (0, false, false), (1, false, false), (1, true, true)] {
        let mut objects = vec![floor(), at(disc(DVec3::Y, 1.0), DVec3::Y)];
        objects[see_through].opacity = 0.5;
        objects[1].cast_shadows = casts;
        let scene = lit(objects, sun(DVec3::new(0.4, -1.0, 0.0), 0.0), EYE * 2.0, DVec3::ZERO);
        let is_lit = bits(&picture(&scene)) == bits(&picture(&without_shadows(&scene)));
        assert!(is_lit != is_darker, "object {see_through} is see-through, casts: {casts}");
    }
}

/// Mean and worst mean of 6 x 6 pixels of how much darker the second picture is, where `counts` says so.
fn darker(name: &str, lit: &Picture, shadowed: &Picture, counts: impl Fn(usize, usize) -> bool) -> [f64; 2] {
    let [width, height] = [lit.width, lit.height].map(|v| v as usize);
    let difference = |i: usize| f64::from(lit.rgba[i][1] - shadowed.rgba[i][1]);
    let mean_of = |pixels: &mut dyn Iterator<Item = (usize, usize)>| {
        let (sum, count) = pixels
            .filter(|&(x, y)| counts(x, y))
            .fold((0.0, 0), |(sum, count), (x, y)| (sum + difference(y * width + x), count + 1));
        (sum / f64::from(count.max(1)), count)
    };
    let (mean, count) = mean_of(&mut (0..height).flat_map(|y| (0..width).map(move |x| (x, y))));
    let mut worst = 0.0_f64;
    for top in 0..height - 5 {
        for left in 0..width - 5 {
            let block = mean_of(&mut (0..36).map(|i| (left + i % 6, top + i / 6)));
            worst = if block.1 == 36 { worst.max(block.0.abs()) } else { worst };
        }
    }
    println!("{name}: {count} pixels, mean {mean:.2e}, worst 6 x 6 {worst:.2e}");
    assert!(count > 500, "{name}: {count}");
    [mean, worst]
}

/// Where on a ball about the origin a ray through a pixel arrives.
fn on_ball(scene: &Scene, radius: f64, x: usize, y: usize) -> Option<DVec3> {
    let (eye, along) = (scene.camera.eye, ray(scene, x, y));
    let middle = -eye.dot(along);
    let half2 = radius * radius - (eye + along * middle).length_squared();
    (half2 > 0.0).then(|| eye + along * (middle - half2.sqrt()))
}

/// Surfels that overlap cast no shadows on each other, nor do those of a rough scan, which rays leave through their
/// backs farther away than the tolerance.
#[test]
fn balls_of_surfels_have_no_spots() {
    let towards = DVec3::new(0.5, 1.0, 0.8).normalize();
    for (n, rough, two_sided, shading) in [
        (500, 0.0, false, Shading::Phong),
        (5000, 0.0, false, Shading::Phong),
        (500, 0.0, true, Shading::Phong),
        (5000, 0.0, true, Shading::Phong),
        (5000, 0.0, false, Shading::Gouraud),
        (5000, 0.02, false, Shading::Phong),
        (5000, 0.02, false, Shading::Gouraud),
    ] {
        let mut model = sphere(n);
        model.colour.fill(Vec3::ONE);
        let mut random = Random(7);
        model.position.iter_mut().for_each(|p| *p *= 1.0 + random.within(-rough, rough) as f32);
        let mut ball = object(model);
        let surface = ball.shape.surface_mut().unwrap();
        (surface.material, surface.two_sided) = (Some(LAMBERT), two_sided);
        let mut scene = lit(vec![ball], sun(-towards, 0.0), DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO);
        (scene.image.width, scene.image.height) = (64, 64);
        let plain = options(32);
        let options = ReferenceOptions { look: Look { shading, ..plain.look.clone() }, ..plain };
        let pictures = [without_shadows(&scene), scene.clone()].map(|scene| traced(&scene, &options).picture);
        let name = format!("{n} surfels, rough by {rough}, two-sided {two_sided}, {shading}");
        let bright = |x, y| on_ball(&scene, 0.98, x, y).is_some_and(|p| p.normalize().dot(towards) > 0.15);
        let [mean, worst] = darker(&name, &pictures[0], &pictures[1], bright);
        assert!(mean.abs() < 1e-3 && worst < 0.02, "{name}: {mean:.2e}, {worst:.2e}");
    }
}

/// Parts of one model darken each other.
#[test]
fn a_model_casts_on_itself() {
    let (towards, small) = (DVec3::new(0.6, 0.5, 0.6).normalize(), 0.4);
    let centre = towards * 2.5;
    let [big, mut little] = [4000, 1000].map(sphere);
    let place = |p: Vec3| (centre + small * p.as_dvec3()).as_vec3();
    little.position.iter_mut().for_each(|p| *p = place(*p));
    little.axis_u.iter_mut().chain(&mut little.axis_v).for_each(|axis| *axis *= small as f32);
    let mut model = big;
    model.position.extend(little.position);
    model.axis_u.extend(little.axis_u);
    model.axis_v.extend(little.axis_v);
    model.normal.extend(little.normal);
    model.colour.extend(little.colour);
    model.colour.fill(Vec3::ONE);
    let mut both = object(model);
    both.shape.surface_mut().unwrap().material = Some(LAMBERT);
    let mut scene = lit(vec![both], sun(-towards, 0.0), DVec3::new(-0.5, 1.0, 5.0), DVec3::ZERO);
    (scene.image.width, scene.image.height) = (48, 48);
    let [light, shadowed] = [without_shadows(&scene), scene.clone()].map(|scene| picture(&scene));
    let mut counts = [0; 2];
    for (i, (light, shadowed)) in light.rgba.iter().zip(&shadowed.rgba).enumerate() {
        let Some(p) = on_ball(&scene, 0.97, i % 48, i / 48) else { continue };
        let eye = scene.camera.eye;
        if p.dot(towards) < 0.2 || meets(eye, (p - eye).normalize(), centre, small * 1.2) {
            continue;
        }
        // The rim of the shadow is off by the surfels of both.
        if meets(p, towards, centre, small - 0.1) {
            counts[0] += 1;
            assert!(shadowed[0] < 1e-6, "{i}: {}", shadowed[0]);
        } else if !meets(p, towards, centre, small + 0.1) {
            counts[1] += 1;
            assert!((light[0] - shadowed[0]).abs() < 1e-6, "{i}: {} {}", light[0], shadowed[0]);
        }
    }
    println!("a model casts on itself: {counts:?}");
    assert!(counts[0] > 20 && counts[1] > 200, "{counts:?}");
}

/// A wall's shadow begins at its foot, also where the floor's tolerance is wide.
#[test]
fn shadows_begin_at_contacts() {
    // Where the wall's own tolerance is wide it is not seen, or it would be blended with the floor.
    for (normal, epsilon) in [(DVec3::X, 1e-6), (DVec3::NEG_X, 0.2)] {
        let mut wall = disc(normal, 1.0);
        wall.epsilon = Some(epsilon);
        let mut ground = floor();
        ground.epsilon = Some(0.2);
        let scene =
            lit(vec![ground, wall], sun(DVec3::new(1.0, -1.0, 0.0), 0.0), DVec3::new(0.2, 2.0, 0.0), DVec3::X * 0.19);
        let picture = picture(&scene);
        let mut dark = 0;
        for (i, pixel) in picture.rgba.iter().enumerate() {
            let p = floor_place(&scene, i % SIZE[0] as usize, i / SIZE[0] as usize).unwrap();
            if 0.01 < p.x && p.x < 0.4 && p.z.abs() < 0.5 {
                dark += 1;
                assert!(pixel[0] == 0.0, "{p}: {}", pixel[0]);
            }
        }
        assert!(dark > 50, "{dark}");
    }
}

/// Two sheets within their tolerances are blended, and neither darkens the other.
#[test]
fn sheets_on_a_floor_stay_lit() {
    let mut sheet = at(disc(DVec3::Y, 64.0), DVec3::Y * 0.01);
    let mut ground = floor();
    (sheet.epsilon, ground.epsilon) = (Some(0.1), Some(0.1));
    for objects in [[ground.clone(), sheet.clone()], [sheet, ground]] {
        let scene = lit(objects.to_vec(), sun(DVec3::new(1.0, -1.0, 0.0), 0.0), EYE, DVec3::ZERO);
        assert!(bits(&picture(&scene)) == bits(&picture(&without_shadows(&scene))));
    }
}

/// A half-plane that lets a share of the light through, and two that overlap.
#[test]
fn see_through_planes_let_a_share_through() {
    let veil = |height: f64, opacity: f64| {
        let mut veil = half_plane(DOWN, height);
        veil.opacity = opacity;
        veil
    };
    let angle = 20_f64.to_radians();
    let all = beside_an_edge(1e9, 4.0, angle);
    let scene = lit(vec![floor(), veil(4.0, 0.7)], sun(DOWN, 20.0), EYE, DVec3::ZERO);
    check("veil", &scene, |p| Some(0.3 * all + 0.7 * beside_an_edge(p.x, 4.0, angle)));
    // Seen from the light, their edges are one: the farther one is shifted by nothing where the light is at the zenith.
    let scene = lit(vec![floor(), veil(4.0, 0.7), veil(4.001, 0.5)], sun(DOWN, 20.0), EYE, DVec3::ZERO);
    check("two veils", &scene, |p| Some(0.15 * all + 0.85 * beside_an_edge(p.x, 4.0, angle)));
}

/// A Gaussian of a capture, and a kernel of a volume, fly through the light: integrals over the time.
#[test]
fn gaussians_and_kernels_let_a_share_through() {
    let (sigma, start, velocity) = (0.4, DVec3::new(-0.5, 8.0, -0.2), DVec3::X);
    let cloud = |optics, opacity: f64| {
        Object::new(Gaussians {
            position: vec![Vec3::ZERO],
            sigma: vec![Vec3::splat(sigma as f32)],
            rotation: vec![Quat::IDENTITY],
            opacity: vec![opacity as f32],
            base: vec![Vec3::ZERO],
            linear: true,
            optics,
            ..Gaussians::default()
        })
    };
    let depth = 2.0;
    let capture = cloud(Optics::Alpha, 0.9);
    let volume = cloud(Optics::Extinction { layer: 0.1 }, depth * TAU * sigma * sigma);
    // What is fainter than 1/255 counts as nothing.
    let through_capture = |peak: f64| if 0.9 * peak < 1.0 / 255.0 { 1.0 } else { 1.0 - 0.9 * peak };
    let through_volume = |peak: f64| (-depth * peak).exp();
    let ways: [&dyn Fn(f64) -> f64; 2] = [&through_capture, &through_volume];
    for ((name, object), through) in [("capture", capture), ("volume", volume)].into_iter().zip(ways) {
        let mut object = at(object, start);
        object.motions = vec![Motion::Linear { velocity }];
        let mut scene = lit(vec![floor(), object], sun(DOWN, 0.0), EYE, DVec3::ZERO);
        (scene.shutter.open, scene.shutter.close) = (0.0, 1.0);
        check(name, &scene, |p| {
            let light = |i: i32| {
                let from = p - start - velocity * ((f64::from(i) + 0.5) / 400.0);
                through((-0.5 * (from.x * from.x + from.z * from.z) / (sigma * sigma)).exp())
            };
            Some((0..400).map(light).sum::<f64>() / 400.0)
        });
        scene.objects[1].cast_shadows = false;
        check_lit(&scene);
    }
}

/// A capture throws no shadow on captures, itself included; see-through surfels let their share through to it.
#[test]
fn captures_receive_no_shadows_of_captures() {
    let cloud = |place: DVec3, sigma: f64| {
        at(
            Object::new(Gaussians {
                position: vec![Vec3::ZERO, Vec3::Y],
                sigma: vec![Vec3::splat(sigma as f32); 2],
                rotation: vec![Quat::IDENTITY; 2],
                opacity: vec![0.9; 2],
                base: vec![Vec3::ONE; 2],
                linear: true,
                ..Gaussians::default()
            }),
            place,
        )
    };
    let (seen, above) = (cloud(DVec3::ZERO, 1.0), cloud(DVec3::Y * 20.0, 1.0));
    let mut scene = lit(vec![seen, above], sun(DOWN, 0.0), EYE, DVec3::ZERO);
    check_lit(&scene);
    let bright = picture(&scene);
    let mut veil = at(disc(DOWN, WIDE), DVec3::Y * 30.0);
    veil.opacity = 0.7;
    scene.objects.push(veil);
    let dim = picture(&scene);
    let middle = bright.rgba.len() / 2 + bright.width as usize / 2;
    let [bright, dim] = [bright.rgba[middle][0], dim.rgba[middle][0]];
    assert!(bright > 0.1 && (dim / bright - 0.3).abs() < 0.01, "{dim} of {bright}");
    // A lamp may stand where a Gaussian has its centre.
    scene.lights = vec![Light::point(DVec3::ZERO, DVec3::ONE), sun(DOWN, 0.0)];
    assert!(picture(&scene).rgba.iter().flatten().all(|value| value.is_finite()));
}

/// Nothing is darker than without shadows.
fn check_lit(scene: &Scene) {
    assert_eq!(bits(&picture(scene)), bits(&picture(&without_shadows(scene))));
}

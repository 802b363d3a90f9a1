//! Captures in the reference: against an exact picture, closed forms, brute force, and what it promises beside that.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::fs;
use std::path::Path;

use glam::{DMat3, DVec2, DVec3, Quat, Vec3};
use splatblur::film::Aov;
use splatblur::model::{Gaussians, ModelFormat, parse_capture};
use splatblur::options::PixelFilter;
use splatblur::reference::{ReferenceOptions, Sample, probe, render};
use splatblur::sampling::hash;
use splatblur::scene::pose::{camera_from_world, object_pose};
use splatblur::scene::{Motion, Object, Scene, Shape};
use splatblur::{Look, image};

use crate::closed_forms::{reference, statistics};
use crate::parts::assert_parts_and_threads_change_nothing;
use crate::support::closed_forms::{FOCAL, SIZE};
use crate::support::gaussians::{colour, psnr};
use crate::support::{UNLIT, object, round_surfels, scene, sphere};

/// sRGB by its definition, odd about 0.
fn encoded(l: f64) -> f64 {
    let c = if l.abs() <= 0.003_130_8 { l.abs() * 12.92 } else { 1.055 * l.abs().powf(1.0 / 2.4) - 0.055 };
    c.copysign(l)
}

fn decoded(c: f64) -> f64 {
    let l = if c.abs() <= 0.040_45 { c.abs() / 12.92 } else { ((c.abs() + 0.055) / 1.055).powf(2.4) };
    l.copysign(c)
}

/// The picture of another program, pixel by pixel: no motion, and rays through the pixels' centres.
// Not deep: the one picture of another program.
#[test]
fn the_guitar_is_the_exact_picture() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let bytes = fs::read(root.join("tests/data/models/guitar_3dgs.ply")).unwrap();
    let guitar = parse_capture(&bytes, ModelFormat::Ply).unwrap().unwrap();
    let truth = image::read(&root.join("tests/data/truth/captures/guitar_0.exr")).unwrap();
    let want: Vec<[f64; 4]> = truth.rgba.iter().map(|pixel| pixel.map(f64::from)).collect();
    let mut scene = scene(vec![Object::new(guitar)], [truth.width, truth.height], DVec3::new(0.0, -2.0, 6.0), 50.0);
    scene.camera.up = DVec3::NEG_Y;
    scene.camera.near = 0.2;
    scene.image.transparent = true;
    let options = ReferenceOptions {
        samples: 16,
        look: Look { filter: PixelFilter::Point, ..Look::default() },
        ..ReferenceOptions::default()
    };
    let made = render(&scene, 0, &options, None, &|_| ()).unwrap();
    let found: Vec<[f64; 4]> = made.picture.rgba.iter().map(|pixel| coded(pixel.map(f64::from))).collect();
    let found = psnr(&found, &want);
    // Measured: 141.8 dB.
    println!("{found:.1} dB");
    assert!(found >= 80.0, "{found:.1} dB");
}

/// Premultiplied linear light as premultiplied codes.
fn coded([r, g, b, a]: [f64; 4]) -> [f64; 4] {
    let code = |c: f64| if a > 0.0 { a * encoded(c / a) } else { 0.0 };
    [code(r), code(g), code(b), a]
}

/// A round Gaussian on a straight path.
#[derive(Clone, Copy)]
struct Ball {
    from: DVec3,
    velocity: DVec3,
    sigma: f32,
    opacity: f32,
    colour: Vec3,
    linear: bool,
}

impl Ball {
    fn object(&self) -> Object {
        let mut object = Object::new(cloud(&[(DVec3::ZERO, Vec3::splat(self.sigma), self.opacity)], self.linear));
        object.shape.gaussians_mut().unwrap().flat = Some(self.colour);
        object.transform.translate = self.from;
        object.motions = vec![Motion::Linear { velocity: self.velocity }];
        object
    }
}

fn cloud(places: &[(DVec3, Vec3, f32)], linear: bool) -> Gaussians {
    Gaussians {
        position: places.iter().map(|place| place.0.as_vec3()).collect(),
        sigma: places.iter().map(|place| place.1).collect(),
        rotation: vec![Quat::IDENTITY; places.len()],
        opacity: places.iter().map(|place| place.2).collect(),
        base: vec![Vec3::ZERO; places.len()],
        linear,
        ..Gaussians::default()
    }
}

/// Rows of the images.
const ROWS: usize = 16;

/// Balls before a wall over the whole image, if there is one (depth and linear colour).
struct Scenery {
    balls: Vec<Ball>,
    wall: Option<(f64, Vec3)>,
    background: DVec3,
    transparent: bool,
}

impl Scenery {
    fn scene(&self) -> Scene {
        let mut objects: Vec<Object> = self.balls.iter().map(Ball::object).collect();
        if let Some((depth, colour)) = self.wall {
            let at = DVec3::new(0.0, 0.0, -depth);
            let mut wall = object(round_surfels([(at, DVec3::Z, 100.0, colour)]));
            wall.shape.surface_mut().unwrap().material = Some(UNLIT);
            wall.epsilon = Some(1e-7);
            objects.insert(0, wall);
        }
        let fovy = 2.0 * (0.5 * ROWS as f64 / FOCAL).atan().to_degrees();
        let mut scene = scene(objects, [SIZE as u32, ROWS as u32], DVec3::ZERO, fovy);
        scene.image.background = self.background;
        scene.image.transparent = self.transparent;
        scene
    }

    /// Balls of a pixel at a time, nearest first: depth, alpha, colour in the image's blending. For a round Gaussian
    /// S = s^2 I, so V' = (s f / z)^2 (I + t t^T) + 0.3 I.
    fn met(&self, [x, y]: [f64; 2], t: f64) -> Vec<(f64, f64, DVec3)> {
        let mut met: Vec<_> = self
            .balls
            .iter()
            .map(|ball| {
                let p = ball.from + t * ball.velocity;
                let (depth, tangent) = (-p.z, DVec2::new(p.x, -p.y) / -p.z);
                let d = DVec2::new(x - 32.0, y - 8.0) - FOCAL * tangent;
                let field = 1.3 * DVec2::new(32.0, 8.0) / FOCAL;
                let t = tangent.clamp(-field, field);
                let s2 = (f64::from(ball.sigma) * FOCAL / depth).powi(2);
                let (xx, xy, yy) = (s2 * (1.0 + t.x * t.x) + 0.3, s2 * t.x * t.y, s2 * (1.0 + t.y * t.y) + 0.3);
                let q = (yy * d.x * d.x - 2.0 * xy * d.x * d.y + xx * d.y * d.y) / (xx * yy - xy * xy);
                let alpha = (f64::from(ball.opacity) * (-0.5 * q).exp()).min(0.99);
                let alpha = if alpha < 1.0 / 255.0 { 0.0 } else { alpha };
                let colour = ball.colour.as_dvec3();
                (depth, alpha, if ball.linear { self.blended(colour) } else { colour })
            })
            .collect();
        met.sort_by(|a, b| a.0.total_cmp(&b.0));
        met.retain(|ball| ball.0 >= 0.2 && self.wall.is_none_or(|(depth, _)| ball.0 <= depth));
        met
    }

    fn is_coded(&self) -> bool {
        self.balls.iter().any(|ball| !ball.linear)
    }

    fn blended(&self, linear: DVec3) -> DVec3 {
        if self.is_coded() { linear.map(encoded) } else { linear }
    }

    fn light(&self, blended: DVec3) -> DVec3 {
        if self.is_coded() { blended.map(decoded) } else { blended }
    }

    /// What the picture has at one instant.
    fn instant(&self, place: [f64; 2], t: f64) -> [f64; 4] {
        let (mut sum, mut through) = (DVec3::ZERO, 1.0);
        for (_, alpha, colour) in self.met(place, t) {
            sum += through * alpha * colour;
            through *= 1.0 - alpha;
        }
        if let Some((_, colour)) = self.wall {
            sum += through * self.blended(colour.as_dvec3());
            through = 0.0;
        }
        let alpha = 1.0 - through;
        let colour = match (self.transparent, alpha > 0.0) {
            (true, true) => alpha * self.light(sum / alpha),
            (true, false) => DVec3::ZERO,
            (false, _) => self.light(sum + through * self.blended(self.background)),
        };
        [colour.x, colour.y, colour.z, if self.transparent { alpha } else { 1.0 }]
    }

    fn mean<const N: usize>(&self, [x, y]: [usize; 2], of: impl Fn(&Self, [f64; 2], f64) -> [f64; N]) -> [f64; N] {
        let steps = 1000;
        let mut sum = [0.0; N];
        for i in 0..steps {
            let values = of(self, [x as f64 + 0.5, y as f64 + 0.5], (f64::from(i) + 0.5) / f64::from(steps));
            sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value / f64::from(steps));
        }
        sum
    }

    fn check(&self, name: &str) {
        let made = reference(&self.scene(), PixelFilter::Point);
        let s = statistics(&made, &|x, y| Some(self.mean([x, y], Self::instant)));
        println!("{name}: {:.3} % within 4 SE, mean SE {:.2e}, rms {:.2e}", 100.0 * s.within, s.error, s.difference);
        assert!(s.within >= 0.997, "{name}: {:.3} % within 4 standard errors", 100.0 * s.within);
        assert!(s.error < 1e-4, "{name}: mean standard error {:.2e}", s.error);
        // The floor of the standard error is for steps in time; things that vary smoothly are far better than it says.
        assert!(s.difference < 5e-5, "{name}: rms of the difference {:.2e}", s.difference);
    }
}

fn ball(from: [f64; 3], velocity: [f64; 3], colour: [f32; 3]) -> Ball {
    let [from, velocity] = [from, velocity].map(DVec3::from_array);
    Ball { from, velocity, sigma: 0.12, opacity: 0.8, colour: Vec3::from_array(colour), linear: false }
}

/// One Gaussian at constant speed, in both spaces, and over both backgrounds.
#[test]
fn a_ball_at_constant_speed() {
    for (linear, transparent) in [(false, true), (true, false)] {
        let one = Ball { linear, ..ball([-0.9, -0.1, -4.0], [1.7, 0.2, -0.5], [0.9, 0.5, 0.2]) };
        let background = DVec3::new(0.05, 0.3, 0.9);
        let scenery = Scenery { balls: vec![one], wall: None, background, transparent };
        scenery.check(&format!("ball, linear {linear}, transparent {transparent}"));
    }
}

/// Two that pass one another: the order of depths changes at a third of the exposure, and one capture is linear.
// Not deep: the closed form of an order that changes.
#[test]
fn balls_that_pass_one_another() {
    let first = ball([-0.3, 0.0, -3.2], [0.3, 0.1, -2.4], [1.2, 0.1, 0.0]);
    let second = Ball { sigma: 0.2, linear: true, ..ball([0.2, 0.05, -4.8], [-0.4, 0.0, 2.4], [0.0, 0.5, 1.5]) };
    for transparent in [false, true] {
        let background = DVec3::new(0.2, 0.1, 0.05);
        let scenery = Scenery { balls: vec![first, second], wall: None, background, transparent };
        scenery.check(&format!("passing, transparent {transparent}"));
    }
}

/// A wall that one Gaussian comes through from behind, before one that stays behind it.
// Not deep: the closed form of captures and surfels together.
#[test]
fn balls_and_a_wall() {
    let through = ball([-0.4, 0.0, -4.9], [0.8, 0.0, 1.8], [0.9, 0.5, 0.2]);
    let behind = ball([0.5, 0.0, -4.2], [0.1, 0.0, 0.1], [0.0, 1.0, 0.0]);
    let before = ball([0.3, 0.05, -3.0], [-0.5, 0.0, 0.2], [0.1, 0.2, 0.9]);
    let wall = Some((4.0, Vec3::new(0.4, 0.05, 0.2)));
    let background = DVec3::splat(0.5);
    Scenery { balls: vec![through, behind, before], wall, background, transparent: false }.check("wall");
    let hidden = Scenery { balls: vec![behind], wall, background, transparent: true };
    for pixel in &reference(&hidden.scene(), PixelFilter::Point).picture.rgba {
        assert_eq!(*pixel, [0.4, 0.05, 0.2, 1.0]);
    }
}

/// Depth and velocity are means by share; a capture has no normal.
// Not deep: the only test of these layers.
#[test]
fn aovs_are_weighted_by_shares() {
    let one = ball([-0.5, 0.0, -3.0], [0.9, -0.1, -0.6], [0.9, 0.5, 0.2]);
    for wall in [None, Some((5.0, Vec3::ONE))] {
        let scenery = Scenery { balls: vec![one], wall, background: DVec3::ZERO, transparent: true };
        let options = ReferenceOptions {
            samples: 4096,
            look: Look {
                filter: PixelFilter::Point,
                aovs: vec![Aov::Depth, Aov::Normal, Aov::Velocity],
                ..Look::default()
            },
            ..ReferenceOptions::default()
        };
        let picture = render(&scenery.scene(), 0, &options, None, &|_| ()).unwrap().picture;
        let mut compared = 0;
        for (i, _) in picture.rgba.iter().enumerate().filter(|(_, pixel)| pixel[3] > 0.05) {
            let [alpha, depth, x, y, normal] = scenery.mean([i % SIZE, i / SIZE], |scenery, place, t| {
                let met = scenery.met(place, t);
                let a = met.first().map_or(0.0, |ball| ball.1);
                let p = one.from + t * one.velocity;
                let v = FOCAL * (one.velocity.truncate() - p.truncate() / p.z * one.velocity.z) / -p.z;
                let behind = if wall.is_some() { 1.0 - a } else { 0.0 };
                [a + behind, a * -p.z + behind * 5.0, a * v.x, -a * v.y, behind]
            });
            let plane = |layer: usize, channel: usize| f64::from(picture.layers[layer].planes[channel][i]);
            let got = [plane(0, 0), plane(2, 0), plane(2, 1), plane(1, 2)];
            // Measured: at most 0.0021 of depth, 0.017 pixels of velocity.
            for (got, want, most) in [
                (got[0], depth / alpha, 0.01),
                (got[1], x / alpha, 0.05),
                (got[2], y / alpha, 0.05),
                (got[3], normal / alpha, 0.01),
            ] {
                assert!((got - want).abs() < most, "pixel {i}: {got}, not {want}, wall {}", wall.is_some());
            }
            compared += 1;
        }
        assert!(compared > 100, "{compared}");
    }
}

/// Gaussians before, around and behind the camera, of all shapes, with harmonics; turning, scaled, half of them
/// cropped; opaque surfels among them; a camera that moves.
fn busy_scene(size: [u32; 2], count: u32) -> Scene {
    let h = |i: u32, k: u64| f64::from(hash(u64::from(i), k)) / 2_f64.powi(31) - 1.0;
    let v = |i: u32, k: u64| DVec3::new(h(i, k), h(i, k + 1), h(i, k + 2));
    let random = |shift: u32, linear: bool| {
        let numbers = shift..shift + count;
        Gaussians {
            position: numbers.clone().map(|i| (v(i, 0) * DVec3::new(1.6, 1.2, 2.0)).as_vec3()).collect(),
            sigma: numbers.clone().map(|i| (v(i, 3) * 2.0 - 4.5).exp().as_vec3()).collect(),
            rotation: numbers
                .clone()
                .map(|i| Quat::from_axis_angle(v(i, 6).normalize().as_vec3(), 3.0 * h(i, 9) as f32).normalize())
                .collect(),
            opacity: numbers.clone().map(|i| (0.5 + 0.5 * h(i, 10)) as f32).collect(),
            base: numbers.clone().map(|i| v(i, 11).as_vec3()).collect(),
            harmonics: numbers.flat_map(|i| (0..15).map(move |k| (0.3 * v(i, 20 + 3 * k)).as_vec3())).collect(),
            degree: 3,
            linear,
            antialiased: linear,
            ..Gaussians::default()
        }
    };
    let mut first = Object::new(random(0, false));
    first.name = "first".into();
    first.transform.scale = DVec3::new(1.0, -1.3, 0.6);
    first.transform.rotate = DVec3::new(0.4, 0.2, -1.0);
    first.opacity = 0.7;
    first.motions = vec![
        Motion::Rotation { axis: DVec3::new(0.6, 0.0, 0.8), per_frame: 1.3, centre: DVec3::new(0.2, 0.1, 0.0) },
        Motion::Linear { velocity: DVec3::new(0.2, -0.3, 0.5) },
    ];
    let mut second = Object::new(random(count, true));
    second.name = "second".into();
    second.shape.gaussians_mut().unwrap().crop = Some([DVec3::new(-0.5, -2.0, -3.0), DVec3::new(2.0, 0.6, 1.5)]);
    let Shape::Gaussians { capture, .. } = &mut second.shape else { panic!("no capture") };
    capture.harmonics = 2;
    let mut third = Object::new(second.shape.gaussians().unwrap().gaussians().clone());
    third.name = "third".into();
    third.blur = false;
    third.transform.translate = DVec3::new(0.3, -0.4, -1.0);
    third.motions = vec![Motion::Linear { velocity: DVec3::new(5.0, 0.0, 0.0) }];
    let mut ball = object(sphere(2000));
    ball.transform.scale = DVec3::splat(0.4);
    ball.transform.translate = DVec3::new(0.2, 0.0, -0.6);
    ball.motions = vec![Motion::Linear { velocity: DVec3::new(0.5, 0.1, 0.0) }];
    let mut scene = scene(vec![first, ball, second, third], size, DVec3::new(0.1, 0.2, 1.4), 60.0);
    scene.image.background = DVec3::new(0.2, 0.1, 0.3);
    scene.camera.near = 0.1;
    scene.camera.motions = vec![
        Motion::Rotation { axis: DVec3::Y, per_frame: 0.2, centre: DVec3::new(0.0, 0.0, 1.0) },
        Motion::Linear { velocity: DVec3::new(-0.1, 0.0, 0.3) },
    ];
    scene
}

/// All Gaussians of a sample one by one, with the transform of each Gaussian to the camera: colour in linear light over
/// the background, and the Gaussians that were met, nearest first.
fn brute(scene: &Scene, sample: &Sample, opaque: Option<DVec3>) -> (DVec3, Vec<usize>) {
    let [width, height] = [scene.image.width, scene.image.height].map(f64::from);
    let focal = 0.5 * height / (0.5 * scene.camera.fovy).tan();
    let mut met = Vec::new();
    for (number, object) in scene.objects.iter().enumerate() {
        let Shape::Gaussians { model: drawn, capture } = &object.shape else { continue };
        let gaussians = drawn.gaussians();
        let time = if object.blur { sample.time } else { 0.0 };
        let view = camera_from_world(scene, time);
        let world = object_pose(scene, object, time).world_from_model;
        let near = scene.camera.near.max(0.2 * world.determinant().abs().cbrt());
        let (place, eye) = (view * world, (view * world).inverse().transform_point3(DVec3::ZERO));
        for i in 0..gaussians.len() {
            let model = gaussians.position[i].as_dvec3();
            let centre = place.transform_point3(model);
            let depth = -centre.z;
            let inside = drawn.crop.is_none_or(|[low, high]| model.cmpge(low).all() && model.cmple(high).all());
            if depth < near || depth > sample.limit || !inside {
                continue;
            }
            let axes = DMat3::from_mat4(place)
                * DMat3::from_quat(gaussians.rotation[i].as_dquat())
                * DMat3::from_diagonal(gaussians.sigma[i].as_dvec3());
            let field = 1.3 * 0.5 * DVec2::new(width, height) / focal;
            let t = (DVec2::new(centre.x, centre.y) / depth).clamp(-field, field);
            let on_film = |axis: DVec3| (axis.truncate() + t * axis.z) * (focal / depth);
            let [a, b, c] = [axes.x_axis, axes.y_axis, axes.z_axis].map(on_film);
            let sum = |f: &dyn Fn(DVec2) -> f64| f(a) + f(b) + f(c);
            let (xx, xy, yy) = (sum(&|v| v.x * v.x), sum(&|v| v.x * v.y), sum(&|v| v.y * v.y));
            let determinant = (xx + 0.3) * (yy + 0.3) - xy * xy;
            let film = DVec2::new(sample.film[0] - 0.5 * width, 0.5 * height - sample.film[1]);
            let d = film - focal * DVec2::new(centre.x, centre.y) / depth;
            let q = ((yy + 0.3) * d.x * d.x - 2.0 * xy * d.x * d.y + (xx + 0.3) * d.y * d.y) / determinant;
            let mut opacity = f64::from(gaussians.opacity[i]) * object.opacity;
            if gaussians.antialiased {
                opacity *= ((xx * yy - xy * xy).max(0.0) / determinant).sqrt();
            }
            let alpha = (opacity * (-0.5 * q).exp()).min(0.99);
            if alpha >= 1.0 / 255.0 {
                let mut shown = Gaussians::clone(gaussians);
                if capture.harmonics < shown.degree {
                    let each = shown.harmonics_each();
                    let used = (usize::from(capture.harmonics) + 1).pow(2) - 1;
                    shown.harmonics[i * each + used..(i + 1) * each].fill(Vec3::ZERO);
                }
                let c = colour(&shown, i, (model - eye).normalize());
                met.push((depth, number, i, alpha, if gaussians.linear { c.map(encoded) } else { c }));
            }
        }
    }
    met.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut light, mut through) = (DVec3::ZERO, 1.0);
    let numbers = met.iter().map(|hit| hit.2).collect();
    for (.., alpha, c) in met {
        light += through * alpha * c;
        through *= 1.0 - alpha;
    }
    let light = (light + through * opaque.unwrap_or(scene.image.background).map(encoded)).map(decoded);
    (light, numbers)
}

/// Every sample of those pixels of a small image whose number is `wanted`, against all Gaussians one by one: nothing is
/// missed, whatever moves. At least so many Gaussians are met, and so many samples see a wall.
fn match_brute_force(wanted: fn(usize) -> bool, [least_met, least_walls]: [usize; 2]) {
    let scene = busy_scene([10, 8], 300);
    let mut bare = scene.clone();
    bare.objects.retain(|object| object.shape.gaussians().is_none());
    let options = ReferenceOptions { samples: 16, ..ReferenceOptions::default() };
    let picture = render(&scene, 0, &options, None, &|_| ()).unwrap().picture;
    let (mut met, mut walls) = (0, 0);
    for (at, pixel) in picture.rgba.iter().enumerate().filter(|(at, _)| wanted(*at)) {
        let place = [at as u32 % 10, at as u32 / 10];
        let mut sum = DVec3::ZERO;
        for i in 0..16 {
            let sample = probe(&bare, 0, &options, place, Some(i)).unwrap().sample.unwrap();
            walls += usize::from(sample.colour.is_some());
            let (light, numbers) = brute(&scene, &sample, sample.colour);
            sum += light / 16.0;
            met += numbers.len();
            // One ray by itself has the narrowest beam.
            let probed = probe(&scene, 0, &options, place, Some(i)).unwrap().sample.unwrap();
            let probed: Vec<usize> = probed.gaussians.iter().map(|gaussian| gaussian.index).collect();
            let end = probed.len();
            assert!(probed == numbers[..end.min(numbers.len())], "pixel {place:?} sample {i}");
        }
        let got = DVec3::new(f64::from(pixel[0]), f64::from(pixel[1]), f64::from(pixel[2]));
        // Measured: 1.2e-7, what f32 leaves. A ray ends at a transmittance of 1e-6.
        assert!((got - sum).abs().max_element() < 2e-5, "pixel {place:?}: {got}, brute force {sum}");
    }
    println!("{met} Gaussians met, {walls} samples with a wall");
    assert!(met > least_met && walls > least_walls, "{met}, {walls}");
}

// Not deep: it alone sees a Gaussian that is missed.
#[test]
fn a_third_of_the_pixels_matches_brute_force() {
    match_brute_force(|at| at % 3 == 0, [2000, 5]);
}

#[test]
#[ignore = "deep: many samples"]
fn the_other_pixels_match_brute_force() {
    match_brute_force(|at| at % 3 != 0, [6500, 30]);
}

#[test]
fn bytes_do_not_depend_on_parts_or_threads() {
    // So fast that most pixels see nothing for many samples.
    let fast = Ball { sigma: 0.01, ..ball([-9.0, -0.1, -4.0], [19.0, 0.2, -0.5], [0.9, 0.5, 0.2]) };
    let fast = Scenery { balls: vec![fast], wall: None, background: DVec3::new(0.1, 0.2, 0.9), transparent: false };
    for (mut scene, transparent) in
        [(busy_scene([37, 26], 60), false), (busy_scene([37, 26], 60), true), (fast.scene(), false)]
    {
        scene.image.transparent = transparent;
        let [last, _] = assert_parts_and_threads_change_nothing(&scene);
        assert_eq!(last.stats.traced, 0);
    }
}

/// A probed sample lists what it meets, and its colour is the composite of that.
#[test]
fn a_probed_sample_adds_up() {
    let mut scene = busy_scene([14, 10], 100);
    scene.objects.truncate(1);
    scene.image.transparent = true;
    let options = ReferenceOptions { samples: 16, ..ReferenceOptions::default() };
    let mut most = 0;
    for i in 0..16 {
        let sample = probe(&scene, 0, &options, [6, 4], Some(i)).unwrap().sample.unwrap();
        let (mut sum, mut through) = (DVec3::ZERO, 1.0);
        for gaussian in &sample.gaussians {
            assert!((gaussian.transmittance - through).abs() < 1e-12);
            sum += through * gaussian.alpha * gaussian.colour;
            through *= 1.0 - gaussian.alpha;
        }
        assert!(sample.gaussians.is_sorted_by_key(|gaussian| gaussian.depth));
        assert!((sample.coverage - (1.0 - through)).abs() < 1e-12);
        if let Some(colour) = sample.colour {
            let want = sample.coverage * (sum / sample.coverage).map(decoded);
            assert!((colour - want).length() < 1e-12, "{colour}, not {want}");
        }
        most = most.max(sample.gaussians.len());
    }
    assert!(most > 3, "{most}");
}

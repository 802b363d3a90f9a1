//! What must not change a picture: time played backwards, a mirror, objects in another order, an exposure in halves,
//! the unit of length.
//!
//! Each is a truth about cameras, and none of them needs another renderer to hold the picture against. Scenes are
//! random: turning spheres that cross, one that stands, one that does not blur, a camera that moves. Both backends
//! render them in all modes, and the reference in its own test.
//!
//! Positions lie at pixel centres, except in one test: sub-pixel offsets go with the numbers of the samples, so that
//! neither time nor the image can be turned round without moving them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use crate::support::{animation, default_lights, object, scene, sphere};
use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use splatblur::film::{Aov, Picture};
use splatblur::model::Surfels;
use splatblur::scene::{AnimationBinding, Light, Motion, Scene};

mod reference;
mod splatter;

const SIZE: [u32; 2] = [64, 48];
const PIXELS: usize = 64 * 48;
const SEEDS: [u64; 2] = [3, 4];
const X: DVec3 = DVec3::new(-1.0, 1.0, 1.0);
const Y: DVec3 = DVec3::new(1.0, -1.0, 1.0);

/// A camera that pans, rises and comes nearer. `time` -1 turns its film round, `x` -1 its left and right, `y` -1 its
/// top and bottom.
fn camera(time: f64, x: f64, y: f64) -> AnimationBinding {
    let curves = [
        ("translate.translateX", [0.1 * x, -0.3 * x]),
        ("translate.translateY", [-0.2 * y, 0.1 * y]),
        ("translate.translateZ", [4.2, 3.9]),
        ("rotate.rotateX", [3.0 * y, -y]),
        ("rotate.rotateY", [2.0 * x, -4.0 * x]),
    ];
    let keys = curves.map(|(name, [from, to])| (name, [(-time, from), (time, to)]));
    let keys = keys.map(|(name, mut keys)| {
        keys.sort_by(|a, b| a.0.total_cmp(&b.0));
        (name, keys)
    });
    animation(&keys.each_ref().map(|(name, keys)| (*name, &keys[..], "linear")))
}

/// Three spheres that turn, pass and cross, one that stands and one that does not blur, lit by all kinds of lights. The
/// shutter is open from half a frame before the frame to half a frame after it.
fn random_scene(seed: u64) -> Scene {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut within = |low: f64, high: f64| rng.random_range(low..high);
    let objects = (0..5).map(|i| {
        let mut model = sphere(500).spatially_ordered();
        let tint = Vec3::new(within(0.2, 1.0) as f32, within(0.2, 1.0) as f32, within(0.2, 1.0) as f32);
        model.colour.iter_mut().for_each(|colour| *colour *= tint);
        let mut ball = object(model);
        ball.name = format!("ball {i}");
        let mut vector = |x: f64, y: f64, z: f64| DVec3::new(within(-x, x), within(-y, y), within(-z, z));
        ball.transform.translate = vector(1.1, 0.7, 0.8);
        ball.transform.rotate = vector(3.0, 3.0, 3.0);
        ball.transform.scale = DVec3::splat(0.5) + vector(0.2, 0.2, 0.2);
        let (axis, velocity) = (vector(1.0, 1.0, 1.0).normalize(), vector(0.9, 0.7, 0.7));
        if i != 3 {
            let centre = ball.transform.translate;
            ball.motions =
                vec![Motion::Rotation { axis, per_frame: 40_f64.to_radians(), centre }, Motion::Linear { velocity }];
        }
        ball.blur = i != 4;
        ball
    });
    let mut scene = scene(objects.collect(), SIZE, DVec3::new(0.0, 0.0, 4.0), 40.0);
    scene.lights = default_lights();
    scene.lights.push(Light::point(DVec3::new(1.5, 1.0, 2.5), DVec3::new(0.8, 0.9, 1.0)).without_shadows());
    scene.image.transparent = true;
    (scene.shutter.open, scene.shutter.close) = (-0.5, 0.5);
    scene
}

/// The scene before a camera that moves.
fn filmed(mut scene: Scene) -> Scene {
    scene.camera.animation = Some(camera(1.0, 1.0, 1.0));
    scene
}

/// The film played backwards, about frame 0.
fn backwards(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    for motion in scene.objects.iter_mut().flat_map(|object| &mut object.motions) {
        match motion {
            Motion::Linear { velocity } => *velocity = -*velocity,
            Motion::Rotation { per_frame, .. } => *per_frame = -*per_frame,
        }
    }
    if scene.camera.animation.is_some() {
        scene.camera.animation = Some(camera(-1.0, 1.0, 1.0));
    }
    scene
}

/// The scene in a mirror: `signs` is -1 along the axis that is turned round.
fn mirrored(scene: &Scene, signs: DVec3) -> Scene {
    let mut scene = scene.clone();
    scene.objects.iter_mut().for_each(|object| object.place.scale *= signs);
    for light in &mut scene.lights {
        match light {
            Light::Directional { direction, .. } => *direction *= signs,
            Light::Point { position, .. } => *position *= signs,
            Light::Ambient { .. } => {}
        }
    }
    if scene.camera.animation.is_some() {
        scene.camera.animation = Some(camera(1.0, signs.x, signs.y));
    }
    scene
}

/// The same, where models and motions are mirrored by hand instead of by the transform `place`.
fn mirrored_models(scene: &Scene, signs: DVec3) -> Scene {
    let mut by_hand = mirrored(scene, signs);
    for (object, before) in by_hand.objects.iter_mut().zip(&scene.objects) {
        object.place = before.place;
        object.transform.translate *= signs;
        // The axis of a rotation is a pseudo-vector.
        let turned = signs * signs.element_product();
        object.transform.rotate *= turned;
        let mut model = Surfels::clone(before.shape.surfels().unwrap().surfels());
        let signs32 = signs.as_vec3();
        model.origin *= signs;
        for column in [&mut model.position, &mut model.axis_u, &mut model.axis_v, &mut model.normal] {
            for v in column.iter_mut() {
                *v *= signs32;
            }
        }
        // Axes keep their sense: u x v lies on the normal's side.
        std::mem::swap(&mut model.axis_u, &mut model.axis_v);
        object.shape = model.into();
        for motion in &mut object.motions {
            match motion {
                Motion::Linear { velocity } => *velocity *= signs,
                Motion::Rotation { axis, centre, .. } => {
                    *axis *= turned;
                    *centre *= signs;
                }
            }
        }
    }
    by_hand
}

/// The scene with every length times `unit`, but for lights.
fn in_unit(scene: &Scene, unit: f64) -> Scene {
    let mut scene = scene.clone();
    for object in &mut scene.objects {
        let mut model = Surfels::clone(object.shape.surfels().unwrap().surfels());
        model.origin *= unit;
        for column in [&mut model.position, &mut model.axis_u, &mut model.axis_v] {
            for length in column.iter_mut() {
                *length *= unit as f32;
            }
        }
        object.shape = model.into();
        object.transform.translate *= unit;
        for motion in &mut object.motions {
            match motion {
                Motion::Linear { velocity } => *velocity *= unit,
                Motion::Rotation { centre, .. } => *centre *= unit,
            }
        }
    }
    scene.camera.eye *= unit;
    scene.camera.at *= unit;
    scene.camera.near *= unit;
    scene
}

/// What a pixel shows: premultiplied colour, alpha, depth, normal and velocity (pixels per frame, so that halves of an
/// exposure may be added).
type Values = [f32; 10];

fn values(picture: &Picture, span: f64) -> Vec<Values> {
    let plane = |aov: Aov, c: usize| {
        let layer = picture.layers.iter().find(|layer| layer.aov == aov).expect("the AOV was asked for");
        &layer.planes[c]
    };
    let pixel = |i: usize| {
        let [r, g, b, alpha] = picture.rgba[i];
        // Depths lie between 2 and 6, velocities within 30 pixels: all values are about 1 at most.
        let depth = if alpha > 0.0 { plane(Aov::Depth, 0)[i] / 8.0 } else { 0.0 };
        let normal = [0, 1, 2].map(|c| plane(Aov::Normal, c)[i]);
        let velocity = [0, 1].map(|c| plane(Aov::Velocity, c)[i] / (30.0 * span as f32));
        let [x, y, z] = normal.map(|n| n * alpha);
        [r, g, b, alpha, depth * alpha, x, y, z, velocity[0] * alpha, velocity[1] * alpha]
    };
    (0..PIXELS).map(pixel).collect()
}

/// Pixel (x, y) of a picture that was turned round, with its values turned back.
fn turned(values: &[Values], signs: DVec3, time: f32) -> Vec<Values> {
    let [width, height] = SIZE.map(|n| n as usize);
    let [sx, sy, sz] = signs.as_vec3().to_array();
    let pixel = |i: usize| {
        let (x, y) = (i % width, i / width);
        let x = if sx < 0.0 { width - 1 - x } else { x };
        let y = if sy < 0.0 { height - 1 - y } else { y };
        let [r, g, b, a, depth, nx, ny, nz, vx, vy] = values[y * width + x];
        [r, g, b, a, depth, nx * sx, ny * sy, nz * sz, vx * sx * time, vy * sy * time]
    };
    (0..PIXELS).map(pixel).collect()
}

/// How two pictures differ.
#[derive(Clone, Copy, Debug)]
struct Gap {
    /// Pixels of which a value differs by more than 1e-4.
    pixels: usize,
    /// Greatest difference of a value of any other pixel.
    rounding: f32,
    /// Greatest difference of all.
    worst: f32,
    /// Root mean square over all values.
    rms: f64,
}

fn gap(a: &[Values], b: &[Values]) -> Gap {
    let mut gap = Gap { pixels: 0, rounding: 0.0, worst: 0.0, rms: 0.0 };
    for (a, b) in a.iter().zip(b) {
        let difference = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(difference.is_finite());
        gap.worst = gap.worst.max(difference);
        if difference > 1e-4 {
            gap.pixels += 1;
        } else {
            gap.rounding = gap.rounding.max(difference);
        }
        gap.rms += a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
    }
    gap.rms = (gap.rms / (10 * PIXELS) as f64).sqrt();
    gap
}

/// A picture that should be another: some rounding, and pixels at whose centre rounding moves a rim.
fn assert_same(what: &str, a: &[Values], b: &[Values], rounding: f32) {
    let gap = gap(a, b);
    println!("{what}: {gap:?}");
    assert!(gap.pixels <= 3 && gap.rounding <= rounding, "{what}: {gap:?}");
    // A rim counts for one moment of the exposure at the most.
    assert!(gap.worst <= 0.3, "{what}: {gap:?}");
}

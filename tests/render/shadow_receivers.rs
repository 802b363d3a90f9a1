//! What receives shadows beside surfels, and what does not: captures, shadow catchers, objects that are left out.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use crate::shadows::{from_above, half_height, many, on_both, samples, square, white, worst_square};
use crate::support::{Random, round_surfels, sphere};
use glam::{DVec3, Quat, Vec3};
use splatblur::backend::{Backend, BackendError};
use splatblur::film::Picture;
use splatblur::model::{Gaussians, Optics};
use splatblur::options::{Detail, Look, RenderOptions, Shading};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Light, Motion, Object, Scene};

on_both!(
    a_ball_over_a_capture,
    captures_have_the_shadows_of_the_reference,
    captures_keep_no_light_from_captures,
    captures_have_the_light_that_is_left,
    what_nothing_hides_keeps_its_bytes,
    a_catcher_shows_the_light_that_is_gone,
    catchers_that_are_none_are_refused,
);

fn render(on: &mut dyn Backend, scene: &Scene, options: &RenderOptions) -> Picture {
    render_frame(on, scene, 0, options).unwrap().picture
}

/// A white floor of flat Gaussians, about `step` apart, at y = 0.
fn capture(step: f64, opacity: f32, linear: bool) -> Object {
    let mut random = Random(7);
    let [columns, rows] = [2.0, 0.8].map(|length: f64| (length / step) as usize);
    let mut own = Gaussians { linear, ..Gaussians::default() };
    for i in 0..columns * rows {
        let [x, z] = [i % columns, i / columns].map(|k| (k as f64 + random.within(0.2, 0.8)) * step);
        own.position.push(Vec3::new(x as f32 - 1.0, 0.0, z as f32 - 0.4));
        own.sigma.push(Vec3::new(0.7 * step as f32, 1e-4, 0.7 * step as f32));
        own.rotation.push(Quat::IDENTITY);
        own.opacity.push(opacity);
        own.base.push(Vec3::splat(0.5 / 0.282_094_8));
    }
    Object::new(own)
}

fn small_ball(centre: DVec3) -> Object {
    let mut ball = white(sphere(4000));
    ball.transform.scale = DVec3::splat(0.1);
    ball.transform.translate = centre;
    ball
}

const CENTRE: DVec3 = DVec3::new(-0.25, 0.45, 0.0);
const TRAVEL: DVec3 = DVec3::new(0.5, -1.0, 0.0);

fn sun(degrees: f64) -> Light {
    let (direction, angle) = (TRAVEL.normalize(), degrees.to_radians());
    Light::Directional { direction, colour: DVec3::ONE, angle, shadows: true }
}

fn over_a_floor(floor: Object, light: Light) -> Scene {
    let mut scene = from_above(vec![floor, small_ball(CENTRE)], [96, 32]);
    scene.lights = vec![Light::Ambient { colour: DVec3::splat(0.25) }, light];
    scene
}

/// The share of a sun 20 degrees wide that a place of the floor sees beside the ball.
fn share_of_sun(place: DVec3) -> f64 {
    let axis = -TRAVEL.normalize();
    let (u, v) = axis.any_orthonormal_pair();
    let (rings, parts) = (40, 80);
    let missed = (0..rings * parts).filter(|i| {
        let [ring, part] = [i / parts, i % parts].map(|k| f64::from(k) + 0.5);
        let cosine = 1.0 - ring / f64::from(rings) * (1.0 - 10_f64.to_radians().cos());
        let turn = part / f64::from(parts) * std::f64::consts::TAU;
        let along = axis * cosine + (u * turn.cos() + v * turn.sin()) * (1.0 - cosine * cosine).sqrt();
        let to = CENTRE - place;
        (to - along * to.dot(along)).length() > 0.1
    });
    missed.count() as f64 / f64::from(rings * parts)
}

/// Umbra and penumbra: the colour of a capture times the share of all light that reaches it.
fn a_ball_over_a_capture(on: &mut dyn Backend) {
    // Faint ones show the mean of many. Of solid ones the first in the order of depth would count most.
    let mut scene = over_a_floor(capture(0.02, 0.05, true), sun(20.0));
    scene.image.transparent = true;
    let picture = render(on, &scene, &samples(256));
    let pixel = 2.0 * half_height() / 32.0;
    let (mut worst, mut sum, mut count, mut darkest) = (0.0_f64, 0.0, 0.0, 1.0_f64);
    for (row, column) in (2..30_usize).flat_map(|row| (36..90_usize).map(move |column| (row, column))) {
        let [x, z] = [column as f64 + 0.5 - 48.0, row as f64 + 0.5 - 16.0].map(|pixels| pixels * pixel);
        // A splat shows the light of its centre over its own width, and that which the screen adds.
        let width = (0.014_f64.powi(2) + 0.3 * pixel * pixel).sqrt();
        let nodes = [(-1.732_05, 1.0 / 6.0), (0.0, 2.0 / 3.0), (1.732_05, 1.0 / 6.0)];
        let around = nodes.iter().flat_map(|a| nodes.iter().map(move |b| (a, b)));
        let share = around.map(|(a, b)| a.1 * b.1 * share_of_sun(DVec3::new(x + width * a.0, 0.0, z + width * b.0)));
        let want = (0.25 + share.sum::<f64>()) / 1.25;
        let [red, _, _, alpha] = picture.rgba[row * 96 + column].map(f64::from);
        let difference = red / alpha - want;
        darkest = darkest.min(want);
        (worst, sum, count) = (worst.max(difference.abs()), sum + difference * difference, count + 1.0);
    }
    let root = (sum / count).sqrt();
    println!("rms {root:.4}, worst {worst:.4}, darkest {darkest:.3}");
    assert!(darkest < 0.25 && root < 0.01 && worst < 0.05, "rms {root}, worst {worst}, darkest {darkest}");
}

/// Lights of all kinds, colours of displays, and motion: as the reference has it.
fn captures_have_the_shadows_of_the_reference(on: &mut dyn Backend) {
    let count = many(on);
    let lamp = Light::Point {
        position: DVec3::new(-0.5, 1.1, 0.1),
        colour: DVec3::new(1.0, 0.7, 0.4),
        radius: 0.1,
        shadows: true,
    };
    for (name, linear, light, moves) in
        [("sun", true, sun(5.0), false), ("codes", false, sun(5.0), false), ("lamp", false, lamp, true)]
    {
        let mut scene = over_a_floor(capture(0.04, 0.95, linear), light);
        if moves {
            (scene.shutter.open, scene.shutter.close) = (0.0, 1.0);
            scene.objects[1].motions = vec![Motion::Linear { velocity: DVec3::new(0.2, 0.0, 0.05) }];
        }
        let traced = ReferenceOptions { samples: 256, ..ReferenceOptions::default() };
        let truth = reference::render(&scene, 0, &traced, None, &|_| ()).unwrap().picture;
        let worst = worst_square(&render(on, &scene, &samples(count)), &truth);
        let look = Look { shadows: false, ..Look::default() };
        let without = worst_square(&render(on, &scene, &RenderOptions { look, ..samples(16) }), &truth);
        println!("{name}: worst {worst:.4}, without shadows {without:.3}");
        assert!(worst < 0.02 && without > 0.1, "{name}: {worst}, without shadows {without}");
    }
}

/// A floor, and above the camera that looks at it, in light from straight above: an opaque disc, a see-through one, a
/// volume, and a capture that is under a part of each.
fn below_all(floor: Object) -> Scene {
    let disc = |x: f64, opacity: f64| {
        let mut disc = white(round_surfels([(DVec3::new(x, 1.4, 0.0), DVec3::Y, 0.12, Vec3::ONE)]));
        disc.opacity = opacity;
        disc
    };
    let splats = |places: &[(f32, f32)], sigma: f32, opacity: f32, optics| {
        let mut own = Gaussians { linear: true, optics, ..Gaussians::default() };
        for &(x, y) in places {
            own.position.push(Vec3::new(x, y, 0.0));
            own.sigma.push(Vec3::splat(sigma));
            own.rotation.push(Quat::IDENTITY);
            own.opacity.push(opacity);
            own.base.push(Vec3::ZERO);
        }
        Object::new(own)
    };
    let volume = splats(&[(0.5, 1.3), (0.55, 1.4)], 0.1, 0.06, Optics::Extinction { layer: 0.1 });
    let capture = splats(&[(-0.5, 1.0), (-0.1, 1.1), (0.2, 1.0), (0.6, 1.1)], 0.1, 0.9, Optics::Alpha);
    let mut scene = from_above(vec![floor, disc(-0.5, 1.0), disc(0.0, 0.6), volume, capture], [96, 32]);
    let sun = Light::Directional { direction: -DVec3::Y, colour: DVec3::ONE, angle: 0.0, shadows: true };
    scene.lights = vec![Light::Ambient { colour: DVec3::splat(0.25) }, sun];
    scene
}

/// The colours of a capture are those in its own shadows: captures throw none on captures, whatever lies behind them.
/// Surfels, see-through ones too, and volumes do, and a capture throws its shadow on surfels.
fn captures_keep_no_light_from_captures(on: &mut dyn Backend) {
    let lamp = Light::Point { position: DVec3::Y * 6.0, colour: DVec3::splat(36.0), radius: 0.0, shadows: true };
    for light in [None, Some(lamp)] {
        let scene = |floor: Object, quiet: &[usize]| {
            let mut scene = below_all(floor);
            scene.lights[1] = light.unwrap_or(scene.lights[1]);
            for &object in quiet {
                scene.objects[object].cast_shadows = false;
            }
            scene
        };
        let of_capture = || capture(0.05, 0.95, false);
        let of_surfels = || square([-1.0, -0.4], [1.0, 0.4], 0.0, 0.05);
        let picture = |on: &mut dyn Backend, scene: &Scene| render(on, scene, &samples(8)).rgba;
        let all = picture(on, &scene(of_capture(), &[]));
        assert!(all == picture(on, &scene(of_capture(), &[0, 4])), "captures cast on captures");
        for caster in 1..4 {
            assert!(all != picture(on, &scene(of_capture(), &[caster])), "object {caster} casts on captures");
        }
        // Without any surfels.
        let of_volume = |quiet: &[usize]| {
            let mut scene = scene(of_capture(), quiet);
            scene.objects.drain(1..3);
            scene
        };
        let by_volume = picture(on, &of_volume(&[]));
        assert!(by_volume == picture(on, &of_volume(&[0, 4])), "captures cast on captures, without surfels");
        assert!(by_volume != picture(on, &of_volume(&[3])), "the volume casts without surfels");
        let on_surfels = picture(on, &scene(of_surfels(), &[]));
        assert!(on_surfels != picture(on, &scene(of_surfels(), &[4])), "captures cast on surfels");
    }
}

/// What reaches a capture through see-through surfels and volumes is what the reference has.
fn captures_have_the_light_that_is_left(on: &mut dyn Backend) {
    let count = many(on);
    for (name, floor) in
        [("capture", capture(0.04, 0.95, true)), ("surfels", square([-1.0, -0.4], [1.0, 0.4], 0.0, 0.02))]
    {
        let scene = below_all(floor);
        let traced = ReferenceOptions { samples: 64, ..ReferenceOptions::default() };
        let truth = reference::render(&scene, 0, &traced, None, &|_| ()).unwrap().picture;
        let picture = render(on, &scene, &samples(count));
        let worst = worst_square(&picture, &truth);
        let look = Look { shadows: false, ..Look::default() };
        let without = worst_square(&render(on, &scene, &RenderOptions { look, ..samples(4) }), &truth);
        println!("{name}: worst {worst:.4}, without shadows {without:.3}");
        // Two standard errors where half of the light gets through.
        assert!(worst < 1.0 / f64::from(count).sqrt() && without > 0.3, "{name}: {worst}, without shadows {without}");
    }
}

/// A capture alone under a light with shadows, a ball whose shadow falls beside it, and objects that receive none: the
/// pictures without shadows, byte for byte.
fn what_nothing_hides_keeps_its_bytes(on: &mut dyn Backend) {
    let same = |on: &mut dyn Backend, scene: &Scene, what: &str| {
        // Levels of detail would be off with shadows alone.
        let [with, without] = [true, false].map(|shadows| RenderOptions {
            look: Look { shadows, ..Look::default() },
            detail: Detail::Full,
            ..samples(4)
        });
        assert!(render(on, scene, &with).rgba == render(on, scene, &without).rgba, "{what}");
    };
    let whole = over_a_floor(capture(0.05, 0.95, false), sun(0.0));
    let mut alone = whole.clone();
    alone.objects.pop();
    same(on, &alone, "alone");
    let mut beside = whole.clone();
    // It has shadows of its own.
    beside.objects[1].receive_shadows = false;
    beside.objects[1].transform.translate.y = -0.3;
    same(on, &beside, "the ball below");
    let mut deaf = whole.clone();
    (deaf.objects[0].receive_shadows, deaf.objects[1].receive_shadows) = (false, false);
    same(on, &deaf, "receives none");
    let mut floor = square([-1.0, -0.4], [1.0, 0.4], 0.0, 0.02);
    floor.receive_shadows = false;
    let mut surfels = over_a_floor(floor, sun(0.0));
    surfels.objects[1].receive_shadows = false;
    same(on, &surfels, "surfels that receive none");
    // The floor alone receives none: the ball keeps its own.
    surfels.objects[1].receive_shadows = true;
    let shadowless = |picture: &Picture| (0..32).map(|row| picture.rgba[row * 96 + 48][0]).fold(1.0, f32::min);
    let found = shadowless(&render(on, &surfels, &samples(4)));
    surfels.objects[0].receive_shadows = true;
    let dark = shadowless(&render(on, &surfels, &samples(4)));
    assert!(found > 0.85 && dark < 0.1, "{found} and {dark}");
}

/// Black whose alpha is 1 - lit / unlit, as two pictures of the same floor have it that was no catcher. The ball is as
/// before.
fn a_catcher_shows_the_light_that_is_gone(on: &mut dyn Backend) {
    let mut floor = square([-1.0, -0.4], [1.0, 0.4], 0.0, 0.02);
    floor.shape.surface_mut().unwrap().material.as_mut().unwrap().ambient = 1.0;
    // Without shadows a wide sun is one direction.
    let mut scene = over_a_floor(floor, sun(0.0));
    scene.image.transparent = true;
    let mut catcher = scene.clone();
    catcher.objects[0].shadow_catcher = true;
    for mode in ["still", "supersample:16", "bucket:4x4", "auto"] {
        let with = |shadows| RenderOptions {
            quality: mode.parse().unwrap(),
            look: Look { shadows, ..Look::default() },
            ..RenderOptions::default()
        };
        let [lit, unlit] = [true, false].map(|shadows| render(on, &scene, &with(shadows)));
        let caught = render(on, &catcher, &with(true));
        let nothing = render(on, &catcher, &with(false));
        let limit = if mode == "auto" { 0.02 } else { 1e-4 };
        let ([mut worst, mut of_ball, mut darkest], [mut floors, mut balls]) = ([0.0_f32; 3], [0; 2]);
        for i in 0..caught.rgba.len() {
            let [red, green, blue, alpha] = caught.rgba[i];
            if nothing.rgba[i] == [0.0; 4] {
                let want = 1.0 - lit.rgba[i][0] / unlit.rgba[i][0];
                assert_eq!([red, green, blue], [0.0; 3], "{mode}: a catcher is black");
                (worst, darkest, floors) = (worst.max((alpha - want).abs()), darkest.max(alpha), floors + 1);
            } else if nothing.rgba[i][3] == 1.0 {
                of_ball = of_ball.max((red - lit.rgba[i][0]).abs());
                balls += 1;
            }
        }
        println!("{mode}: floor {worst:.6} of {floors}, ball {of_ball:.6} of {balls}, darkest {darkest:.3}");
        assert!(worst.max(of_ball) < limit && darkest > 0.7, "{mode}: {worst}, {of_ball}, {darkest}");
        assert!(floors > 1500 && balls > 200, "{mode}: {floors}, {balls}");
    }
}

/// What cannot catch shadows says so in one line.
fn catchers_that_are_none_are_refused(on: &mut dyn Backend) {
    let refused = |on: &mut dyn Backend, scene: &Scene, options: &RenderOptions| {
        let frame = render_frame(on, scene, 0, options);
        assert!(matches!(frame, Err(BackendError::Catcher { .. })), "{frame:?}");
        let text = frame.unwrap_err().to_string();
        assert!(text.contains("object0") && text.contains("take") && !text.contains('\n'), "{text}");
    };
    let mut of_capture = over_a_floor(capture(0.1, 0.95, true), sun(0.0));
    "object0".clone_into(&mut of_capture.objects[0].name);
    of_capture.objects[0].shadow_catcher = true;
    refused(on, &of_capture, &samples(1));
    let mut scene = over_a_floor(square([-1.0, -0.4], [1.0, 0.4], 0.0, 0.05), sun(0.0));
    "object0".clone_into(&mut scene.objects[0].name);
    scene.objects[0].shadow_catcher = true;
    render(on, &scene, &samples(1));
    let look = Look { shading: Shading::Gouraud, ..Look::default() };
    refused(on, &scene, &RenderOptions { look, ..samples(1) });
    refused(on, &scene, &RenderOptions { quality: "volumetric:2".parse().unwrap(), ..RenderOptions::default() });
    scene.objects[0].opacity = 0.5;
    refused(on, &scene, &samples(1));
}

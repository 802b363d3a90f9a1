//! Shadows on what light passes through, on both backends: see-through surfels, and volumes that are lit.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use glam::{DVec3, Quat, Vec3};
use splatblur::backend::Backend;
use splatblur::film::Picture;
use splatblur::model::{Gaussians, Optics};
use splatblur::options::{Look, RenderOptions};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Light, Motion, Object, Scene, Shape};

use crate::see_through_shadows::{binomial, light_at};
use crate::shadows::{WHITE, from_above, many, on_both, samples, square, white, worst_square};
use crate::support::{Random, round_surfels, sphere};

on_both!(
    a_disc_darkens_a_pane,
    the_lower_pane_has_what_the_upper_lets_through,
    smoke_shadows_itself,
    what_receives_no_shadow_keeps_its_bytes,
    glass_has_the_shadows_of_the_reference,
    smoke_has_the_shadows_of_the_reference,
);

fn render(on: &mut dyn Backend, scene: &Scene, options: &RenderOptions) -> Picture {
    render_frame(on, scene, 0, options).unwrap().picture
}

fn without_shadows(count: u32) -> RenderOptions {
    RenderOptions { look: Look { shadows: false, ..Look::default() }, ..samples(count) }
}

/// A see-through square at a height, which fills the picture.
fn pane(height: f64, opacity: f64) -> Object {
    Object { opacity, ..square([-1.0, -0.4], [1.0, 0.4], height, 0.02) }
}

/// A disc across the light from above the camera, which does not see it.
fn disc(opacity: f64) -> Object {
    Object { opacity, ..white(round_surfels([(DVec3::Y, DVec3::Y, 0.2, Vec3::ONE)])) }
}

/// Light from infinitely far, 3 degrees wide.
fn far(direction: DVec3, radiance: f64) -> Light {
    Light::Directional { direction: direction.normalize(), colour: DVec3::splat(radiance), angle: 0.05, shadows: true }
}

/// From straight above.
fn sun() -> Light {
    Light::Directional { direction: -DVec3::Y, colour: DVec3::ONE, angle: 0.0, shadows: true }
}

fn under(light: Light, objects: Vec<Object>) -> Scene {
    let mut scene = from_above(objects, [96, 48]);
    scene.lights = vec![light];
    scene
}

/// A pane shows its opacity times the light that the disc lets through, and its alpha stays.
fn a_disc_darkens_a_pane(on: &mut dyn Backend) {
    // Chances of a layer are even: its share is right to a sample.
    let count = 16;
    let lamp = Light::Point { position: DVec3::Y * 2.0, colour: DVec3::splat(4.0), radius: 0.0, shadows: true };
    for (light, opacity) in [(sun(), 1.0), (sun(), 0.3), (lamp, 0.3)] {
        let scene = under(light, vec![pane(0.0, 0.6), disc(opacity)]);
        let [picture, lit] = [samples(count), without_shadows(4)].map(|options| render(on, &scene, &options));
        let [below, beside] = [0.0, 0.5].map(|x| light_at(&picture, x) / light_at(&lit, x));
        println!("disc of opacity {opacity}: {below:.4} below it, {beside:.4} beside it");
        assert!((light_at(&lit, 0.0) - 0.6).abs() < 0.02, "lit {}", light_at(&lit, 0.0));
        assert!((below - (1.0 - opacity)).abs() < 1.0 / f64::from(count) + 1e-3, "below it {below}");
        assert!((beside - 1.0).abs() < 1e-3, "beside it {beside}");
        let middle = 24 * 96 + 48;
        assert!((picture.rgba[middle][3] - lit.rgba[middle][3]).abs() < 1e-6);
    }
}

/// Light meets panes one after the other, and so does the eye. No pane is in its own shadow.
fn the_lower_pane_has_what_the_upper_lets_through(on: &mut dyn Backend) {
    let count = 16;
    for [upper, lower] in [[0.6, 0.5], [0.2, 0.9]] {
        let picture = render(on, &under(sun(), vec![pane(0.0, lower), pane(0.3, upper)]), &samples(count));
        let (shown, truth) = (light_at(&picture, 0.0), upper + (1.0 - upper) * lower * (1.0 - upper));
        println!("opacities {upper} and {lower}: {shown:.4} for {truth:.4}");
        assert!((shown - truth).abs() < 1.0 / f64::from(count) + 2e-3, "{upper} and {lower}: {shown} for {truth}");
    }
}

/// Kernels of a volume with these centres, standard deviations, optical depths along y, and normals that face up.
fn smoke(each: &[([f64; 3], [f64; 3], f64)]) -> Object {
    let mut out = Gaussians { linear: true, optics: Optics::Extinction { layer: 0.02 }, ..Gaussians::default() };
    for &(centre, sigma, depth) in each {
        out.position.push(DVec3::from(centre).as_vec3());
        out.sigma.push(DVec3::from(sigma).as_vec3());
        out.rotation.push(Quat::IDENTITY);
        out.opacity.push((depth * std::f64::consts::TAU * sigma[0] * sigma[2]) as f32);
        out.base.push(Vec3::splat(0.5 / 0.282_094_8));
        out.normal.push(Vec3::Y);
    }
    let mut object = Object::new(out);
    let Shape::Volume { material, .. } = &mut object.shape else { panic!() };
    *material = Some(WHITE);
    object
}

/// A thick layer of smoke in the light from above. Where light has passed the optical depth t, the eye sees exp(-t) of
/// it, lit by exp(-t): in all (1 - exp(-2 T)) / 2.
fn smoke_shadows_itself(on: &mut dyn Backend) {
    let count = many(on);
    let (columns, rows, layers, step) = (30, 16, 8, 0.05);
    let depth = 2.0_f64;
    let mut random = Random(5);
    let each: Vec<_> = (0..columns * rows * layers)
        .map(|i| {
            let [x, z] = [i % columns - columns / 2, i / columns % rows - rows / 2].map(f64::from);
            let height = (f64::from(i / columns / rows) + random.within(0.0, 1.0)) * 0.03;
            // Each layer has its lattice elsewhere.
            let shift = f64::from(i / columns / rows) * 0.37;
            let centre = [(x + shift.fract()) * step, height, (z + (2.3 * shift).fract()) * step];
            // So many kernels in the square of a step have the depth of all.
            let share = step * step / (std::f64::consts::TAU * 0.05 * 0.05);
            (centre, [0.05, 0.01, 0.05], depth * share / f64::from(layers))
        })
        .collect();
    let scene = under(sun(), vec![smoke(&each)]);
    let lit = light_at(&render(on, &scene, &without_shadows(4)), 0.0);
    let shown = light_at(&render(on, &scene, &samples(count)), 0.0);
    let truth = 0.5 * (1.0 - (-2.0 * depth).exp());
    println!("depth {depth}: {shown:.4} for {truth:.4}; lit {lit:.4}");
    assert!((lit - (1.0 - (-depth).exp())).abs() < 0.01, "lit {lit}");
    // Neighbouring places draw numbers of their own, so the mean of a square is nearer than one place would be.
    let error = binomial(truth, count) / 3.0;
    assert!((shown - truth).abs() < error, "{shown} for {truth}, within {error}");
}

/// `receiveShadows="false"` of a pane and of smoke below a disc; and smoke without normals, which is not lit.
fn what_receives_no_shadow_keeps_its_bytes(on: &mut dyn Backend) {
    let sheet = || smoke(&[([0.0, 0.1, 0.0], [0.5, 0.01, 0.5], 0.8)]);
    let mut own = sheet();
    let Shape::Volume { model, .. } = &own.shape else { panic!() };
    own = Object::new(Gaussians { normal: Vec::new(), ..Gaussians::clone(model.gaussians()) });
    for (object, receives, changes) in [
        (pane(0.0, 0.6), false, false),
        (pane(0.0, 0.6), true, true),
        (sheet(), false, false),
        (sheet(), true, true),
        (own, true, false),
    ] {
        let mut scene = under(sun(), vec![Object { receive_shadows: receives, ..object }, disc(1.0)]);
        scene.objects[0].cast_shadows = false;
        let [shadowed, lit] = [samples(4), without_shadows(4)].map(|options| render(on, &scene, &options));
        assert_eq!(shadowed.rgba != lit.rgba, changes);
    }
}

/// A picture beside one of the reference: the worst difference of a square, the mean difference, and the worst of a
/// picture without shadows.
fn beside_the_reference(on: &mut dyn Backend, scene: &Scene, traced: u64) -> [f64; 3] {
    let traced = ReferenceOptions { samples: traced, ..ReferenceOptions::default() };
    let truth = reference::render(scene, 0, &traced, None, &|_| ()).unwrap().picture;
    let options = samples(many(on));
    let picture = render(on, scene, &options);
    let pairs = picture.rgba.iter().zip(&truth.rgba);
    let mean = pairs.map(|(a, b)| f64::from(a[0] - b[0])).sum::<f64>() / truth.rgba.len() as f64;
    let lit = worst_square(&render(on, scene, &without_shadows(16)), &truth);
    [worst_square(&picture, &truth), mean, lit]
}

/// Moving glass before a lamp and a sun, above a pane, on which an opaque ball throws its shadow, too.
fn glass_has_the_shadows_of_the_reference(on: &mut dyn Backend) {
    let ball = |x: f64, opacity: f64| {
        let mut ball = Object { opacity, ..white(sphere(2000)) };
        ball.transform.scale = DVec3::splat(0.12);
        ball.transform.translate = DVec3::new(x, 0.25, 0.0);
        ball.motions = vec![Motion::Linear { velocity: DVec3::new(0.2, 0.0, 0.05) }];
        ball
    };
    let mut scene = under(sun(), vec![pane(0.0, 0.7), ball(-0.35, 0.5), ball(0.15, 1.0)]);
    (scene.shutter.open, scene.shutter.close) = (0.0, 1.0);
    scene.lights =
        vec![far(DVec3::new(0.3, -1.0, 0.2), 0.6), Light::point(DVec3::new(-0.3, 1.5, 0.2), DVec3::splat(0.8))];
    let [worst, mean, lit] = beside_the_reference(on, &scene, 256);
    println!("worst {worst:.4}, mean {mean:.4}; without shadows {lit:.3}");
    assert!(worst < 2.0 * binomial(0.5, many(on)) && mean.abs() < 4e-3 && lit > 0.3, "{worst}, {mean}, {lit}");
}

/// A cloud of smoke, below a disc and above a floor, which all throw shadows.
fn smoke_has_the_shadows_of_the_reference(on: &mut dyn Backend) {
    let mut random = Random(3);
    let mut kernel = || {
        let mut within = |low, high| random.within(low, high);
        let centre = [within(-0.4, 0.4), within(0.1, 0.3), within(-0.15, 0.15)];
        (centre, [within(0.03, 0.08), within(0.02, 0.05), within(0.03, 0.08)], within(0.1, 0.5))
    };
    let each: Vec<_> = (0..60).map(|_| kernel()).collect();
    let mut cloud = smoke(&each);
    cloud.transform.scale = DVec3::new(1.0, 0.8, 1.1);
    cloud.motions = vec![Motion::Linear { velocity: DVec3::new(0.1, 0.0, 0.0) }];
    for light in [far(DVec3::new(0.4, -1.0, 0.2), 1.0), Light::point(DVec3::new(0.1, 1.3, 0.2), DVec3::splat(1.2))] {
        let floor = square([-1.0, -0.4], [1.0, 0.4], 0.0, 0.02);
        let mut scene = under(light, vec![cloud.clone(), floor, disc(1.0)]);
        (scene.shutter.open, scene.shutter.close) = (0.0, 1.0);
        let [worst, mean, lit] = beside_the_reference(on, &scene, 256);
        println!("worst {worst:.4}, mean {mean:.4}; without shadows {lit:.3}");
        assert!(worst < 2.0 * binomial(0.5, many(on)) && mean.abs() < 5e-3 && lit > 0.3, "{worst}, {mean}, {lit}");
    }
}

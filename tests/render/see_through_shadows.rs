//! Shadows of what light passes through, on both backends: against closed forms, and against the reference.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use glam::{DVec3, Quat, Vec3};
use splatblur::backend::Backend;
use splatblur::film::Picture;
use splatblur::model::{Gaussians, Optics};
use splatblur::options::{BlurMode, Look, RenderOptions};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Light, Motion, Object, Scene};

use crate::shadows::{from_above, many, on_both, samples, square, white, worst_square};
use crate::support::{round_surfels, sphere};

on_both!(
    a_disc_lets_a_share_of_the_light_through,
    two_discs_multiply,
    a_moving_ball_has_the_shadow_of_the_reference,
    what_casts_no_shadow_leaves_the_picture,
    gaussians_let_their_share_through,
    turned_gaussians_have_the_shadow_of_the_reference,
);

fn render(on: &mut dyn Backend, scene: &Scene, options: &RenderOptions) -> Picture {
    render_frame(on, scene, 0, options).unwrap().picture
}

/// A disc across the light from above the camera, which does not see it.
fn disc(x: f64, height: f64, opacity: f64) -> Object {
    let mut disc = white(round_surfels([(DVec3::new(x, height, 0.0), DVec3::Y, 0.2, Vec3::ONE)]));
    disc.opacity = opacity;
    disc
}

/// The floor below discs, in a light from straight above.
fn below(discs: Vec<Object>) -> Scene {
    let mut scene = from_above([vec![square([-1.0, -0.4], [1.0, 0.4], 0.0, 0.02)], discs].concat(), [96, 48]);
    scene.lights = vec![Light::Directional { direction: -DVec3::Y, colour: DVec3::ONE, angle: 0.0, shadows: true }];
    scene
}

/// Mean light on the floor in a square of 5 x 5 pixels about (x, 0).
pub(crate) fn light_at(picture: &Picture, x: f64) -> f64 {
    let pixel = 2.0 * crate::shadows::half_height() / f64::from(picture.height);
    let column = (x / pixel + 0.5 * f64::from(picture.width)).round() as usize;
    let (width, middle) = (picture.width as usize, picture.height as usize / 2);
    let pixels = (middle - 2..=middle + 2).flat_map(|row| (column - 2..=column + 2).map(move |x| row * width + x));
    pixels.map(|i| f64::from(picture.rgba[i][0])).sum::<f64>() / 25.0
}

/// Two standard errors where half of the light gets through.
fn worst_error(samples: u32) -> f64 {
    2.0 * binomial(0.5, samples)
}

/// The standard error of a mean over so many samples, each of which light reaches with this probability.
pub(crate) fn binomial(share: f64, samples: u32) -> f64 {
    (share * (1.0 - share) / f64::from(samples)).sqrt()
}

/// The light below a disc is 1 - opacity. Chances of a layer are even, so the mean is nearer than that of random ones
/// would be: within a sample of it.
fn a_disc_lets_a_share_of_the_light_through(on: &mut dyn Backend) {
    let count = many(on);
    for (opacity, of_surfel) in [(0.3, None), (0.7, None), (0.5, Some(0.4))] {
        let mut disc = disc(0.0, 1.0, opacity);
        let mut share = 1.0 - opacity;
        if let Some(own) = of_surfel {
            let mut model = round_surfels([(DVec3::Y, DVec3::Y, 0.2, Vec3::ONE)]);
            model.opacity = vec![own];
            (disc, share) = (Object { opacity, ..white(model) }, 1.0 - opacity * f64::from(own));
        }
        let mut scene = below(vec![disc]);
        let lamp = Light::Point { position: DVec3::Y * 2.0, colour: DVec3::splat(4.0), radius: 0.0, shadows: true };
        for light in [scene.lights[0], lamp] {
            scene.lights = vec![light];
            let picture = render(on, &scene, &samples(count));
            let [shadow, beside] = [light_at(&picture, 0.0), light_at(&picture, 0.5)];
            let without = RenderOptions { look: Look { shadows: false, ..Look::default() }, ..samples(4) };
            let lit = render(on, &scene, &without);
            let [shadow, beside] = [shadow / light_at(&lit, 0.0), beside / light_at(&lit, 0.5)];
            println!("opacity {opacity}: {shadow:.4} for {share:.4}, beside it {beside:.4}");
            assert!(
                (shadow - share).abs() < 1.0 / f64::from(count) + 1e-3 && (beside - 1.0).abs() < 1e-3,
                "{opacity}: {shadow}"
            );
        }
    }
    // A picture of one sample has the layers whose opacity is above 1/2.
    for (opacity, light) in [(0.45, 1.0), (0.55, 0.0)] {
        let still = BlurMode::Still { pixel_samples: 1 };
        let still = RenderOptions { quality: still.into(), ..RenderOptions::default() };
        let shadow = light_at(&render(on, &below(vec![disc(0.0, 1.0, opacity)]), &still), 0.0);
        assert!((shadow - light).abs() < 1e-3, "{opacity}: {shadow}");
    }
}

/// Where two discs overlap, their transmittances multiply, within the standard error of as many random samples; with
/// one of them opaque, nothing gets through.
fn two_discs_multiply(on: &mut dyn Backend) {
    let count = many(on);
    for [first, second] in [[0.3, 0.7], [0.5, 0.5], [0.2, 1.0]] {
        let picture = render(on, &below(vec![disc(-0.1, 1.0, first), disc(0.1, 1.2, second)]), &samples(count));
        for (x, share) in [(-0.2, 1.0 - first), (0.0, (1.0 - first) * (1.0 - second)), (0.2, 1.0 - second)] {
            let shadow = light_at(&picture, x);
            println!("{first} and {second}, at {x}: {shadow:.4} for {share:.4}");
            let limit = if x == 0.0 { binomial(share, count) } else { 1.0 / f64::from(count) };
            assert!((shadow - share).abs() < limit + 1e-3, "{first} and {second}, at {x}: {shadow} for {share}");
        }
    }
}

/// A picture of so many samples beside one of the reference: the worst difference of a square, the mean difference, and
/// the worst of a picture without shadows.
fn beside_the_reference(on: &mut dyn Backend, scene: &Scene, (count, traced): (u32, u64)) -> [f64; 3] {
    let traced = ReferenceOptions { samples: traced, ..ReferenceOptions::default() };
    let truth = reference::render(scene, 0, &traced, None, &|_| ()).unwrap().picture;
    let picture = render(on, scene, &samples(count));
    let pairs = picture.rgba.iter().zip(&truth.rgba);
    let mean = pairs.map(|(a, b)| f64::from(a[0] - b[0])).sum::<f64>() / truth.rgba.len() as f64;
    let without = RenderOptions { look: Look { shadows: false, ..Look::default() }, ..samples(4) };
    let lit = worst_square(&render(on, scene, &without), &truth);
    [worst_square(&picture, &truth), mean, lit]
}

/// A ball of many surfels, which overlap: its two walls are two layers.
fn a_moving_ball_has_the_shadow_of_the_reference(on: &mut dyn Backend) {
    let count = many(on);
    let mut ball = white(sphere(2000));
    (ball.opacity, ball.transform.scale) = (0.5, DVec3::splat(0.2));
    ball.transform.translate = DVec3::new(-0.1, 1.2, 0.0);
    ball.motions = vec![Motion::Linear { velocity: DVec3::X * 0.3 }];
    let mut scene = below(vec![ball]);
    (scene.shutter.open, scene.shutter.close) = (0.0, 1.0);
    scene.lights.push(Light::point(DVec3::new(0.3, 2.5, 0.2), DVec3::splat(3.0)));
    let [worst, mean, lit] = beside_the_reference(on, &scene, (count, 256));
    println!("worst {worst:.4}, mean {mean:.4}; without shadows {lit:.3}");
    // Walls near the rim, which are nearer to each other than the tolerance over the cosine, are one layer on a map
    // (docs/shadows.md), and let more through.
    assert!(
        worst < worst_error(count) && mean.abs() < 4e-3 && lit > 0.5,
        "worst {worst}, mean {mean}, without shadows {lit}"
    );
}

/// Gaussians of a capture with these centres, standard deviations, rotations and opacities; or kernels of a volume.
fn gaussians(each: &[([f32; 3], [f32; 3], Quat, f32)], optics: Optics) -> Object {
    let mut out = Gaussians { linear: true, optics, ..Gaussians::default() };
    for &(position, sigma, rotation, opacity) in each {
        out.position.push(position.into());
        out.sigma.push(sigma.into());
        out.rotation.push(rotation);
        out.opacity.push(opacity);
        out.base.push(Vec3::ZERO);
    }
    Object::new(out)
}

/// The light on the floor below two Gaussians is the product of what each lets through, in closed form: within two
/// standard errors of as many random samples.
fn gaussians_let_their_share_through(on: &mut dyn Backend) {
    let count = many(on);
    let (sigma, centres, alphas, depths) = (0.1_f64, [-0.05, 0.1], [0.9, 0.6], [1.5, 0.7]);
    let at = |k: usize, opacity: f64| {
        ([centres[k] as f32, 1.0 + 0.2 * k as f32, 0.0], [sigma as f32; 3], Quat::IDENTITY, opacity as f32)
    };
    // A kernel of this mass has the optical depth at its centre.
    let mass = |k: usize| depths[k] * std::f64::consts::TAU * sigma * sigma;
    let capture = gaussians(&[0, 1].map(|k| at(k, alphas[k])), Optics::Alpha);
    let volume = gaussians(&[0, 1].map(|k| at(k, mass(k))), Optics::Extinction { layer: 0.1 });
    let through_capture = |k: usize, peak: f64| 1.0 - alphas[k] * peak;
    let through_volume = |k: usize, peak: f64| (-depths[k] * peak).exp();
    let ways: [&dyn Fn(usize, f64) -> f64; 2] = [&through_capture, &through_volume];
    for ((name, object), through) in [("capture", capture), ("volume", volume)].into_iter().zip(ways) {
        let picture = render(on, &below(vec![object]), &samples(count));
        let pixel = 2.0 * crate::shadows::half_height() / 48.0;
        let (mut sum, mut worst) = (0.0, 0.0_f64);
        for step in -12..=12 {
            let x = 0.025 * f64::from(step);
            // The mean over the square of 5 x 5 pixels that is looked at.
            let first = [(x / pixel).round() - 2.0, -2.0];
            let place = |i: i32, c: usize| (first[c] + 5.0 * (f64::from(i) + 0.5) / 20.0) * pixel;
            let light = |i: i32, j: i32| {
                let squared = |k: usize| (place(i, 0) - centres[k]).powi(2) + place(j, 1).powi(2);
                (0..2).map(|k| through(k, (-0.5 * squared(k) / (sigma * sigma)).exp())).product::<f64>()
            };
            let truth = (0..400).map(|i| light(i % 20, i / 20)).sum::<f64>() / 400.0;
            let difference = light_at(&picture, x) - truth;
            (sum, worst) = (sum + difference / 25.0, worst.max(difference.abs() / binomial(truth, count)));
        }
        println!("{name}: mean {sum:.4}, worst {worst:.2} standard errors");
        // Places beside each other have the errors of the same numbers: their mean is about one standard error, too.
        assert!(worst < 2.0 && sum.abs() < binomial(0.5, count), "{name}: mean {sum}, worst {worst} standard errors");
    }
}

/// Long thin Gaussians and a volume before a slanted light and the light of a point.
fn turned_gaussians_have_the_shadow_of_the_reference(on: &mut dyn Backend) {
    let count = many(on);
    let turn = |x: f32, y: f32, angle: f32| Quat::from_axis_angle(Vec3::new(x, y, 0.3).normalize(), angle);
    let each = [
        ([-0.2, 1.0, 0.0], [0.2, 0.02, 0.05], turn(1.0, 0.2, 0.7), 0.9),
        ([0.1, 1.1, 0.1], [0.03, 0.15, 0.06], turn(0.1, 1.0, 1.9), 1.0),
        ([0.2, 1.2, -0.1], [0.05, 0.05, 0.12], turn(0.5, 0.5, 1.2), 0.5),
    ];
    let capture = gaussians(&each, Optics::Alpha);
    let mut volume = gaussians(&each.map(|(p, s, q, o)| (p, s, q, 0.02 * o)), Optics::Extinction { layer: 0.1 });
    volume.transform.scale = DVec3::new(1.0, 1.0, 0.8);
    volume.motions = vec![Motion::Linear { velocity: DVec3::X * 0.2 }];
    for (name, object) in [("capture", capture), ("volume", volume)] {
        for light in [
            Light::directional(DVec3::new(0.2, -1.0, 0.1).normalize(), DVec3::ONE),
            Light::point(DVec3::new(0.1, 3.0, 0.1), DVec3::splat(9.0)),
        ] {
            let mut scene = below(vec![object.clone()]);
            (scene.shutter.open, scene.shutter.close) = (0.0, 1.0);
            scene.lights = vec![light];
            let [worst, mean, lit] = beside_the_reference(on, &scene, (count, 64));
            println!("{name}: worst {worst:.4}, mean {mean:.4}; without shadows {lit:.3}");
            assert!(
                worst < worst_error(count) && mean.abs() < 4e-3 && lit > 0.3,
                "{name}: {worst}, mean {mean}, without {lit}"
            );
        }
    }
}

/// `castShadows="false"`, see-through or not.
fn what_casts_no_shadow_leaves_the_picture(on: &mut dyn Backend) {
    let bare = render(on, &below(Vec::new()), &samples(4));
    for opacity in [0.5, 1.0] {
        let mut scene = below(vec![disc(0.0, 1.0, opacity)]);
        scene.objects[1].cast_shadows = false;
        assert_eq!(render(on, &scene, &samples(4)).rgba, bare.rgba, "{opacity}");
        scene.objects[1].cast_shadows = true;
        assert_ne!(render(on, &scene, &samples(4)).rgba, bare.rgba, "{opacity}");
        // It still receives.
        let mut above = below(vec![disc(0.0, 1.0, 1.0)]);
        above.objects[0].cast_shadows = false;
        assert!(light_at(&render(on, &above, &samples(4)), 0.0) < 1e-3);
    }
}

//! Volumes in the reference: against closed forms of line integrals, an integration with none of its code, and what it
//! promises beside that.
//!
//! A kernel is cut off where it has exp(-18) = 1.5e-8 of its peak: tolerances of 1e-7 are for that.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::f64::consts::TAU;

use glam::{DMat3, DVec2, DVec3, Quat, Vec3};
use splatblur::film::Aov;
use splatblur::model::{Gaussians, Material, Optics};
use splatblur::options::Look;
use splatblur::reference::{ReferenceOptions, Sample, probe, render};
use splatblur::sampling::hash;
use splatblur::scene::pose::{camera_from_world, object_pose};
use splatblur::scene::{Light, Motion, Object, Scene, Shape};

use crate::parts::assert_parts_and_threads_change_nothing;
use crate::support::{UNLIT, object, round_surfels, scene, sphere};

const CUT: f64 = 1e-7;
const RED: Vec3 = Vec3::new(0.75, 0.125, 0.25);
const GREEN: Vec3 = Vec3::new(0.0, 1.5, 0.5);
const BLUE: Vec3 = Vec3::new(0.0625, 0.25, 1.0);
const SIZE: [u32; 2] = [12, 8];

/// A kernel: centre, standard deviations, rotation, mass, colour.
type Blob = (DVec3, Vec3, Quat, f32, Vec3);

fn round(centre: DVec3, sigma: f32, mass: f32, colour: Vec3) -> Blob {
    (centre, Vec3::splat(sigma), Quat::IDENTITY, mass, colour)
}

fn kernels(blobs: &[Blob]) -> Gaussians {
    let harmonic = 0.5 / std::f32::consts::PI.sqrt();
    Gaussians {
        position: blobs.iter().map(|blob| blob.0.as_vec3()).collect(),
        sigma: blobs.iter().map(|blob| blob.1).collect(),
        rotation: blobs.iter().map(|blob| blob.2).collect(),
        opacity: blobs.iter().map(|blob| blob.3).collect(),
        base: blobs.iter().map(|blob| (blob.4 - 0.5) / harmonic).collect(),
        linear: true,
        optics: Optics::Extinction { layer: 0.1 },
        ..Gaussians::default()
    }
}

fn volume(blobs: &[Blob]) -> Object {
    Object::new(kernels(blobs))
}

fn plane(depth: f64, colour: Vec3, opacity: f64) -> Object {
    let mut plane = object(round_surfels([(-depth * DVec3::Z, DVec3::Z, 100.0, colour)]));
    (plane.shape.surface_mut().unwrap().material, plane.epsilon, plane.opacity) = (Some(UNLIT), Some(1e-4), opacity);
    plane
}

fn before_camera(objects: Vec<Object>) -> Scene {
    let mut scene = scene(objects, SIZE, DVec3::ZERO, 40.0);
    scene.image.transparent = true;
    scene
}

/// Samples of pixels all over the image.
fn samples(scene: &Scene) -> Vec<Sample> {
    let options = ReferenceOptions { samples: 16, ..ReferenceOptions::default() };
    let [width, height] = [scene.image.width, scene.image.height];
    let places = [[0, 0], [width / 2, height / 2], [width / 2 - 1, height / 3], [width - 1, height - 2]];
    let all = places.into_iter().flat_map(|place| [0, 5, 10, 15].map(|i| (place, i)));
    all.map(|(place, i)| probe(scene, 0, &options, place, Some(i)).unwrap().sample.unwrap()).collect()
}

fn seen(sample: &Sample) -> DVec3 {
    sample.colour.unwrap_or_default()
}

fn near(got: DVec3, want: DVec3, most: f64) {
    assert!((got - want).abs().max_element() <= most, "{got}, not {want}");
}

/// Optical depth of a round kernel on a line.
fn optical_depth(sample: &Sample, centre: DVec3, sigma: f64, mass: f64) -> f64 {
    let [eye, d] = sample.ray;
    let d2 = (centre - eye).cross(d).length_squared() / d.length_squared();
    mass / (TAU * sigma * sigma) * (-0.5 * d2 / (sigma * sigma)).exp()
}

#[test]
fn one_kernel_has_its_closed_form() {
    let centre = DVec3::new(0.1, -0.05, -4.0);
    let mut most: f64 = 0.0;
    for (sigma, mass) in [(0.5, 1.0), (0.5, 20.0), (0.2, 0.3), (2.0, 30.0)] {
        // The last begins before `near` in no place that matters: 0.01 is 2 standard deviations off, so it is moved.
        let centre = if sigma > 1.0 { 4.0 * centre } else { centre };
        for sample in samples(&before_camera(vec![volume(&[round(centre, sigma, mass, RED)])])) {
            let tau = optical_depth(&sample, centre, f64::from(sigma), f64::from(mass));
            let cover = -(-tau).exp_m1();
            assert!((sample.coverage - cover).abs() < CUT, "{}, not {cover}", sample.coverage);
            near(seen(&sample), cover * RED.as_dvec3(), CUT);
            most = most.max(cover);
        }
    }
    assert!(most > 0.9, "{most}");
}

/// The path through an object of twice the size is twice as long.
#[test]
fn twice_the_size_is_twice_as_dense() {
    let blobs = [round(DVec3::new(0.1, 0.0, -4.0), 0.5, 1.0, RED), round(DVec3::new(-0.3, 0.2, -5.0), 0.4, 0.6, BLUE)];
    let one = volume(&blobs);
    let mut two = one.clone();
    two.transform.scale = DVec3::splat(2.0);
    let (one, two) = (samples(&before_camera(vec![one])), samples(&before_camera(vec![two])));
    for (one, two) in one.iter().zip(&two) {
        let through = 1.0 - one.coverage;
        assert!((1.0 - two.coverage - through * through).abs() < CUT);
    }
    assert!(one.iter().any(|sample| (0.3..0.7).contains(&sample.coverage)));
}

#[test]
fn kernels_far_apart_are_composited() {
    let places = [DVec3::new(0.0, 0.1, -4.0), DVec3::new(0.1, 0.0, -9.0)];
    // In one object and in two, in both orders.
    let blobs = [round(places[0], 0.3, 0.5, RED), round(places[1], 0.6, 3.0, GREEN)];
    let scenes =
        [vec![volume(&blobs)], vec![volume(&[blobs[1], blobs[0]])], vec![volume(&blobs[1..]), volume(&blobs[..1])]];
    for scene in scenes.map(before_camera) {
        for sample in samples(&scene) {
            let [a, b] = [(0, 0.3_f32, 0.5), (1, 0.6_f32, 3.0)]
                .map(|(i, sigma, mass)| -(-optical_depth(&sample, places[i], f64::from(sigma), mass)).exp_m1());
            near(seen(&sample), a * RED.as_dvec3() + (1.0 - a) * b * GREEN.as_dvec3(), CUT);
            assert!((1.0 - sample.coverage - (1.0 - a) * (1.0 - b)).abs() < CUT);
        }
    }
}

/// Where kernels have one centre and one size their colour is the mean by mass.
#[test]
fn kernels_at_one_place_are_mixed_by_mass() {
    let centre = DVec3::new(0.1, 0.0, -4.0);
    let blobs = [round(centre, 0.5, 1.0, RED), round(centre, 0.5, 3.0, GREEN)];
    for objects in [vec![volume(&blobs)], blobs.map(|blob| volume(&[blob])).to_vec()] {
        for sample in samples(&before_camera(objects)) {
            let cover = -(-optical_depth(&sample, centre, 0.5, 4.0)).exp_m1();
            near(seen(&sample), cover * (0.25 * RED.as_dvec3() + 0.75 * GREEN.as_dvec3()), 2.0 * CUT);
        }
    }
}

/// The light of a ray, from kernels one by one and steps of the ray one by one: emission (docs/math.md, section 12) by
/// the midpoint rule, from `near` to the depth `end`, with surfaces (depth, colour, opacity) on the way. Returns the
/// colour, the coverage and the depth times the coverage.
///
/// A step is at most 1/100 of a standard deviation: the rule's error is 1e-5 of a kernel's optical depth at most.
fn integrate(scene: &Scene, sample: &Sample, end: f64, surfaces: &[(f64, DVec3, f64)]) -> (DVec3, f64, f64) {
    let mut lines: Vec<(f64, f64, f64, DVec3)> = Vec::new();
    for object in &scene.objects {
        let Some(shown) = object.shape.gaussians() else { continue };
        let gaussians = shown.gaussians();
        let time = if object.blur { sample.time } else { 0.0 };
        let model = (camera_from_world(scene, time) * object_pose(scene, object, time).world_from_model).inverse();
        let height = f64::from(scene.image.height);
        let focal = 0.5 * height / (0.5 * scene.camera.fovy).tan();
        let film = DVec2::new(sample.film[0] - 0.5 * f64::from(scene.image.width), 0.5 * height - sample.film[1]);
        let camera = (film / focal).extend(-1.0);
        let (eye, d) = (model.transform_point3(DVec3::ZERO), model.transform_vector3(camera));
        for i in 0..gaussians.len() {
            let centre = gaussians.position[i].as_dvec3();
            if shown.crop.is_some_and(|[low, high]| !centre.cmpge(low).all() || !centre.cmple(high).all()) {
                continue;
            }
            let axes = DMat3::from_quat(gaussians.rotation[i].as_dquat().normalize());
            let sigma = gaussians.sigma[i].as_dvec3();
            // In the axes of the kernel, in standard deviations.
            let [e, d] = [eye - centre, d].map(|v| axes.transpose() * v / sigma);
            let (a, b) = (d.length_squared(), e.dot(d));
            let q = (e - d * (b / a)).length_squared();
            let density = f64::from(gaussians.opacity[i]) * object.opacity * camera.length()
                / (TAU.powf(1.5) * sigma.element_product());
            let c = 0.5 + 0.5 / std::f64::consts::PI.sqrt() * gaussians.base[i].as_dvec3();
            lines.push((-b / a, 1.0 / a.sqrt(), density * (-0.5 * q).exp(), c));
        }
    }
    let first = lines.iter().map(|line| line.0 - 8.0 * line.1).fold(f64::INFINITY, f64::min).max(scene.camera.near);
    let last = lines.iter().map(|line| line.0 + 8.0 * line.1).fold(0.0, f64::max).min(end).max(first);
    let finest = lines.iter().map(|line| line.1).fold(f64::INFINITY, f64::min);
    let (mut colour, mut through, mut depth) = (DVec3::ZERO, 1.0, 0.0);
    let mut cuts: Vec<f64> = surfaces.iter().map(|surface| surface.0).collect();
    cuts.push(f64::INFINITY);
    let mut from = first;
    for (i, cut) in cuts.into_iter().enumerate() {
        let to = cut.min(last);
        let steps = ((to - from) / finest * 100.0).ceil().max(0.0);
        let step = (to - from) / steps;
        for k in 0..steps as usize {
            let z = from + (k as f64 + 0.5) * step;
            let (mut f, mut emitted) = (0.0, DVec3::ZERO);
            for (centre, sigma, peak, c) in &lines {
                let g = peak * (-0.5 * ((z - centre) / sigma).powi(2)).exp();
                f += g;
                emitted += g * *c;
            }
            if f > 0.0 {
                let a = -(-f * step).exp_m1();
                colour += through * a * emitted / f;
                depth += through * a * z;
                through *= 1.0 - a;
            }
        }
        from = from.max(to);
        if let Some((z, c, a)) = surfaces.get(i).filter(|surface| surface.0 <= end) {
            colour += through * a * *c;
            depth += through * a * z;
            through *= 1.0 - a;
        }
    }
    (colour, 1.0 - through, depth)
}

fn turned(i: u32) -> Quat {
    let h = |k: u64| f64::from(hash(u64::from(i), k)) / 2_f64.powi(31) - 1.0;
    Quat::from_axis_angle(DVec3::new(h(1), h(2), h(3)).normalize().as_vec3(), 3.0 * h(4) as f32).normalize()
}

/// Kernels of all shapes, turned, in objects that are scaled, sheared by scale and rotation, and move.
fn busy(count: u32) -> Scene {
    let h = |i: u32, k: u64| f64::from(hash(u64::from(i), k)) / 2_f64.powi(31) - 1.0;
    let v = |i: u32, k: u64| DVec3::new(h(i, k), h(i, k + 1), h(i, k + 2));
    let blob = |i: u32| {
        let sigma = (v(i, 3) * 0.8 - 1.8).exp();
        let mass = sigma.max_element().powi(2) * (2.0 + 2.0 * h(i, 9));
        (v(i, 0) * DVec3::new(1.6, 1.2, 2.0), sigma.as_vec3(), turned(i), mass as f32, (0.5 + 0.5 * v(i, 6)).as_vec3())
    };
    let [mut first, mut second] =
        [0..count, count..2 * count].map(|numbers| volume(&numbers.map(blob).collect::<Vec<_>>()));
    first.name = "first".into();
    first.transform.scale = DVec3::new(1.0, -1.3, 0.6);
    first.transform.rotate = DVec3::new(0.4, 0.2, -1.0);
    first.opacity = 0.7;
    first.motions = vec![
        Motion::Rotation { axis: DVec3::new(0.6, 0.0, 0.8), per_frame: 1.3, centre: DVec3::new(0.2, 0.1, 0.0) },
        Motion::Linear { velocity: DVec3::new(0.2, -0.3, 0.5) },
    ];
    second.name = "second".into();
    second.shape.gaussians_mut().unwrap().crop = Some([DVec3::new(-0.5, -2.0, -3.0), DVec3::new(2.0, 0.6, 1.5)]);
    second.blur = false;
    second.transform.translate = DVec3::new(0.3, -0.4, -1.0);
    second.motions = vec![Motion::Linear { velocity: DVec3::new(5.0, 0.0, 0.0) }];
    let mut scene = scene(vec![first, second], [14, 10], DVec3::new(0.1, 0.2, 1.4), 60.0);
    scene.image.transparent = true;
    scene.camera.near = 0.1;
    scene.camera.motions = vec![
        Motion::Rotation { axis: DVec3::Y, per_frame: 0.2, centre: DVec3::new(0.0, 0.0, 1.0) },
        Motion::Linear { velocity: DVec3::new(-0.1, 0.0, 0.3) },
    ];
    scene
}

/// The eye is within some of the kernels.
#[test]
fn all_kernels_are_integrated() {
    let (mut difference, mut covered) = (0.0_f64, 0);
    for count in [1, 5, 60] {
        let scene = busy(count);
        for sample in samples(&scene) {
            let (colour, coverage, depth) = integrate(&scene, &sample, f64::INFINITY, &[]);
            let got = sample.surface.map_or(0.0, |surface| surface.0 * sample.coverage);
            let off = (seen(&sample) - colour).abs().max_element();
            let off = off.max((sample.coverage - coverage).abs()).max((got - depth).abs() / depth.max(1.0));
            difference = difference.max(off);
            covered += usize::from((0.05..0.95).contains(&coverage));
        }
    }
    println!("greatest difference {difference:.1e}, {covered} rays");
    assert!(difference < 1e-5, "{difference:.1e}");
    assert!(covered > 10, "{covered}");
}

/// Half of a kernel is before a surface through its centre, opaque or not.
#[test]
fn surfaces_stand_within_kernels() {
    let blobs = [
        (DVec3::new(0.0, 0.1, -4.0), Vec3::new(0.5, 0.3, 0.4), turned(7), 1.0, RED),
        (DVec3::new(-0.3, 0.0, -4.6), Vec3::new(0.2, 0.5, 0.6), turned(8), 0.9, BLUE),
    ];
    let white = Vec3::ONE;
    for (number, opacities) in [[1.0, 1.0], [0.25, 1.0], [0.5, 0.75]].into_iter().enumerate() {
        let walls = [plane(4.0, GREEN, opacities[0]), plane(4.5, white, opacities[1])];
        let mut objects = vec![volume(&blobs)];
        objects.extend(walls);
        let scene = before_camera(objects);
        for sample in samples(&scene) {
            let surfaces = [(4.0, GREEN.as_dvec3(), opacities[0]), (4.5, white.as_dvec3(), opacities[1])];
            let end = [4.0, 4.5, f64::INFINITY][number];
            let (colour, coverage, depth) = integrate(&scene, &sample, end, &surfaces);
            // The midpoint rule's own error.
            near(seen(&sample), colour, 1e-5);
            assert!((sample.coverage - coverage).abs() < 1e-5);
            assert!((sample.surface.unwrap().0 * sample.coverage - depth).abs() < 1e-4);
        }
    }
    // By itself, through the centre of the image: half of the optical depth.
    let centre = DVec3::new(0.0, 0.0, -4.0);
    let scene = before_camera(vec![volume(&[round(centre, 0.4, 1.0, RED)]), plane(4.0, GREEN, 1.0)]);
    for sample in samples(&scene) {
        let tangent2 = sample.ray[1].truncate().length_squared();
        let tau = optical_depth(&sample, centre, f64::from(0.4_f32), 1.0);
        if tangent2 < 0.002 {
            // The plane is behind the nearest point of the ray by 4 tangent^2.
            let half = -(-0.5 * tau).exp_m1();
            near(seen(&sample), half * RED.as_dvec3() + (1.0 - half) * GREEN.as_dvec3(), 0.02 * tau);
        }
    }
}

/// A Gaussian of a capture divides a volume at its centre. If the capture is coded all is blended coded.
#[test]
fn captures_stand_within_kernels() {
    let code = |l: f64| if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 };
    let decode = |c: f64| if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    for linear in [true, false] {
        let mut cloud = kernels(&[round(DVec3::ZERO, 1.0, 0.5, GREEN), round(-0.3 * DVec3::Z, 1.0, 0.7, GREEN)]);
        (cloud.optics, cloud.linear) = (Optics::Alpha, linear);
        let mut cloud = Object::new(cloud);
        cloud.transform.translate.z = -4.0;
        let blobs = [
            (DVec3::new(0.0, 0.1, -4.0), Vec3::new(0.5, 0.3, 0.4), turned(7), 1.0, RED),
            (DVec3::new(-0.3, 0.0, -4.6), Vec3::new(0.2, 0.5, 0.6), turned(8), 0.9, BLUE),
        ];
        let scene = before_camera(vec![volume(&blobs), cloud]);
        let mut alone = scene.clone();
        alone.objects.truncate(1);
        if !linear {
            // The integration has no coding: it gets coded colours.
            let coded = blobs.map(|(a, b, c, d, colour)| (a, b, c, d, colour.as_dvec3().map(code).as_vec3()));
            alone.objects = vec![volume(&coded)];
        }
        for sample in samples(&scene) {
            assert_eq!(sample.gaussians.len(), 2);
            let surfaces: Vec<_> = sample.gaussians.iter().map(|g| (g.depth, GREEN.as_dvec3(), g.alpha)).collect();
            let (sum, coverage, _) = integrate(&alone, &sample, f64::INFINITY, &surfaces);
            let want = if linear { sum } else { coverage * (sum / coverage).map(decode) };
            near(seen(&sample), want, 1e-5);
            assert!((sample.coverage - coverage).abs() < 1e-5);
        }
    }
}

/// A flat kernel is a sheet: its line integral is its density in the plane over the cosine.
#[test]
fn flat_kernels_are_sheets() {
    let turn = Quat::from_rotation_y(0.5) * Quat::from_rotation_x(-0.3);
    let sheet = |z: f64, thickness: f32, mass: f32, colour: Vec3| -> Blob {
        (z * DVec3::Z, Vec3::new(0.5, 0.3, thickness), turn, mass, colour)
    };
    let closed = |sample: &Sample, z: f64, mass: f64| {
        let [eye, d] = sample.ray;
        let axes = DMat3::from_quat(turn.as_dquat().normalize());
        let [u, v, n] = [axes.x_axis, axes.y_axis, axes.z_axis];
        let depth = n.dot(z * DVec3::Z - eye) / n.dot(d);
        let p = eye + depth * d - z * DVec3::Z;
        let q = (u.dot(p) / 0.5).powi(2) + (v.dot(p) / f64::from(0.3_f32)).powi(2);
        let tau = mass / (TAU * 0.5 * f64::from(0.3_f32)) * (-0.5 * q).exp() * d.length() / n.dot(d).abs();
        (depth, tau)
    };
    for thickness in [0.0, 1e-5] {
        let blobs = [
            sheet(-5.0, thickness, 0.4, BLUE),
            sheet(-4.0, thickness, 0.2, RED),
            // In the plane of the last one.
            sheet(-4.0, thickness, 0.6, GREEN),
        ];
        let scene = before_camera(vec![volume(&blobs)]);
        for sample in samples(&scene) {
            let (front, tau) = closed(&sample, -4.0, f64::from(0.2_f32) + f64::from(0.6_f32));
            let (back, behind) = closed(&sample, -5.0, f64::from(0.4_f32));
            let [a, b] = [tau, behind].map(|tau| -(-tau).exp_m1());
            let mixed = 0.25 * RED.as_dvec3() + 0.75 * GREEN.as_dvec3();
            near(seen(&sample), a * mixed + (1.0 - a) * b * BLUE.as_dvec3(), 3.0 * CUT);
            let depth = sample.surface.map_or(0.0, |surface| surface.0 * sample.coverage);
            assert!((depth - a * front - (1.0 - a) * b * back).abs() < 1e-6);
        }
        // A surface between them, and one before both.
        for (at, opacity) in [(4.5, 1.0), (4.5, 0.5), (2.0, 0.5), (2.0, 1.0)] {
            let scene = before_camera(vec![plane(at, Vec3::ONE, opacity), volume(&blobs)]);
            for sample in samples(&scene) {
                let (z, tau) = closed(&sample, -4.0, f64::from(0.2_f32) + f64::from(0.6_f32));
                let (back, behind) = closed(&sample, -5.0, f64::from(0.4_f32));
                let mixed = 0.25 * RED.as_dvec3() + 0.75 * GREEN.as_dvec3();
                let mut all = vec![
                    (z, mixed, -(-tau).exp_m1()),
                    (back, BLUE.as_dvec3(), -(-behind).exp_m1()),
                    (at, DVec3::ONE, opacity),
                ];
                all.sort_by(|a, b| a.0.total_cmp(&b.0));
                let (mut colour, mut through) = (DVec3::ZERO, 1.0);
                for (_, c, a) in all {
                    colour += through * a * c;
                    through *= 1.0 - a;
                }
                near(seen(&sample), colour, 3.0 * CUT);
            }
        }
    }
    // Thin, and not yet a sheet; among thick ones.
    let blobs = [
        sheet(-4.0, 0.01, 0.2, RED),
        sheet(-4.02, 0.02, 0.3, BLUE),
        round(DVec3::new(0.1, 0.0, -4.1), 0.4, 0.7, GREEN),
    ];
    let scene = before_camera(vec![volume(&blobs)]);
    for sample in samples(&scene) {
        near(seen(&sample), integrate(&scene, &sample, f64::INFINITY, &[]).0, 1e-5);
    }
    // A sheet within a thick one divides it.
    let thick = round(DVec3::new(0.1, 0.0, -4.1), 0.4, 0.7, GREEN);
    let scene = before_camera(vec![volume(&[sheet(-4.0, 0.0, 0.2, RED), thick])]);
    let alone = before_camera(vec![volume(&[thick])]);
    for sample in samples(&scene) {
        let (depth, tau) = closed(&sample, -4.0, f64::from(0.2_f32));
        let surface = [(depth, RED.as_dvec3(), -(-tau).exp_m1())];
        near(seen(&sample), integrate(&alone, &sample, f64::INFINITY, &surface).0, 1e-5);
    }
    // Edge-on, lines and points: nothing, and no number that is not finite.
    let flat = |sigma: Vec3| (-4.0 * DVec3::Z, sigma, Quat::IDENTITY, 1.0, RED);
    let zeros = [Vec3::new(0.0, 0.5, 0.5), Vec3::new(0.5, 0.0, 0.0), Vec3::ZERO].map(flat);
    let made = render(&before_camera(vec![volume(&zeros)]), 0, &few(), None, &|_| ()).unwrap();
    assert!(made.picture.rgba.iter().flatten().all(|value| value.is_finite()));
    assert_eq!(made.stats.gaussians, 1);
}

fn few() -> ReferenceOptions {
    ReferenceOptions { samples: 16, ..ReferenceOptions::default() }
}

/// Kernels on a grid with the extinction 1 make a box and a ball of that extinction.
#[test]
fn many_kernels_are_homogeneous() {
    let (spacing, sigma) = (0.1, 0.06);
    let fill = |inside: &dyn Fn(DVec3) -> bool| {
        let line = || (-10..10).map(|i| (f64::from(i) + 0.5) * spacing);
        let points = line().flat_map(|x| line().flat_map(move |y| line().map(move |z| DVec3::new(x, y, z))));
        let blobs: Vec<Blob> =
            points.filter(|p| inside(*p)).map(|p| round(p, sigma, spacing.powi(3) as f32, RED)).collect();
        let mut object = volume(&blobs);
        object.transform.translate.z = -8.0;
        object
    };
    let scene = before_camera(vec![fill(&|_| true)]);
    for sample in samples(&scene).iter().filter(|sample| sample.ray[1].truncate().abs().max_element() < 0.08) {
        // The sum of Gaussians ripples by 2 exp(-2 (pi sigma / spacing)^2) = 0.16 % along each axis.
        let tau = 2.0 * sample.ray[1].length();
        assert!((-(1.0 - sample.coverage).ln() / tau - 1.0).abs() < 0.004, "{}", sample.coverage);
        near(seen(sample), sample.coverage * RED.as_dvec3(), 1e-6);
    }
    let mut ball = fill(&|p| p.length() < 0.95);
    ball.transform.translate.z = -4.0;
    let scene = before_camera(vec![ball]);
    let (mut count, mut sum) = (0, 0.0);
    for sample in samples(&scene) {
        let [eye, d] = sample.ray;
        let b2 = (-4.0 * DVec3::Z - eye).cross(d).length_squared() / d.length_squared();
        if b2 < 0.3 {
            // The lattice makes the chord uncertain by about a spacing, of which the mean of many rays has less.
            let chord = 2.0 * (0.95 * 0.95 - b2).sqrt();
            let ratio = -(1.0 - sample.coverage).ln() / chord;
            assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
            (count, sum) = (count + 1, sum + ratio);
        }
    }
    let mean = sum / f64::from(count);
    assert!(count >= 5 && (mean - 1.0).abs() < 0.04, "{mean} of {count}");
}

/// However dense: the light is that of what is in front.
#[test]
fn dense_kernels_hide_all() {
    for mass in [1e3, 1e6, 1e30, 1e38] {
        let blobs = [
            round(DVec3::new(0.0, 0.0, -4.0), 2.0, mass, RED),
            round(DVec3::new(0.0, 0.0, -40.0), 8.0, mass, GREEN),
            // A sheet behind it.
            (-50.0 * DVec3::Z, Vec3::new(9.0, 9.0, 0.0), Quat::IDENTITY, mass, BLUE),
        ];
        for sample in samples(&before_camera(vec![volume(&blobs)])) {
            near(seen(&sample), RED.as_dvec3(), 2e-6);
            assert!((sample.coverage - 1.0).abs() < 2e-6);
        }
    }
}

/// Dense and of two colours: the mean free path is much shorter than a kernel.
#[test]
fn dense_kernels_are_resolved() {
    let blobs = [round(DVec3::new(0.0, 0.0, -4.0), 0.5, 100.0, RED), round(-4.3 * DVec3::Z, 0.4, 300.0, GREEN)];
    let scene = before_camera(vec![volume(&blobs)]);
    for sample in samples(&scene) {
        let (colour, ..) = integrate(&scene, &sample, f64::INFINITY, &[]);
        // The midpoint rule's steps have optical depths of up to 5, and mix colours that differ by 1 % there.
        near(seen(&sample), colour, 1e-3);
    }
}

/// Lights shade a kernel once, at its centre, with its normal turned to the eye; without a normal only ambient light
/// does. A material of the object counts.
#[test]
fn lights_shade_kernels() {
    let lit = |gaussians: Gaussians, material| Shape::Volume { model: gaussians.into(), material: Some(material) };
    let material = Material { ambient: 0.5, diffuse: 0.75, specular: 0.0, shininess: 1.0 };
    let towards = DVec3::new(0.6, 0.0, 0.8);
    for (normal, cosine) in [(Vec3::Z, 0.8), (Vec3::NEG_Z, 0.8), (Vec3::ZERO, 0.0), (Vec3::X, 0.6), (Vec3::Y, 0.0)] {
        let mut gaussians = kernels(&[round(DVec3::new(-0.05, 0.0, -4.0), 0.5, 1.0, RED)]);
        gaussians.normal = vec![normal];
        let mut scene = before_camera(vec![Object::new(lit(gaussians, material))]);
        scene.lights = vec![
            Light::Ambient { colour: DVec3::splat(0.5) },
            Light::directional(-towards, DVec3::splat(2.0)).without_shadows(),
        ];
        let share = 0.5 * 0.5 + 2.0 * 0.75 * cosine;
        for sample in samples(&scene) {
            // `shade` computes in f32.
            near(seen(&sample), sample.coverage * share * RED.as_dvec3(), 1e-6);
        }
        assert!(samples(&scene).iter().any(|sample| sample.coverage > 0.4));
    }
    // A mirror shows no light from behind where there is no normal.
    let mut gaussians = kernels(&[round(-4.0 * DVec3::Z, 0.5, 1.0, RED)]);
    gaussians.normal = vec![Vec3::ZERO];
    let mirror = Material { ambient: 0.5, diffuse: 0.5, specular: 1.0, shininess: 2.0 };
    let mut scene = before_camera(vec![Object::new(lit(gaussians, mirror))]);
    scene.lights = vec![Light::directional(DVec3::Z, DVec3::ONE).without_shadows()];
    assert!(samples(&scene).iter().all(|sample| seen(sample) == DVec3::ZERO));
}

/// Velocity is that of the kernels' centres; volumes have no normal.
#[test]
fn aovs_are_weighted_by_light() {
    let velocity = DVec3::new(0.9, -0.4, -0.6);
    let centre = DVec3::new(-0.3, 0.2, -3.0);
    let mut cloud = volume(&[round(DVec3::ZERO, 0.3, 0.8, RED)]);
    cloud.transform.translate = centre;
    cloud.motions = vec![Motion::Linear { velocity }];
    let mut scene = before_camera(vec![cloud]);
    (scene.shutter.open, scene.shutter.close) = (0.0, 0.001);
    let aovs = vec![Aov::Depth, Aov::Normal, Aov::Velocity];
    let picture =
        render(&scene, 0, &ReferenceOptions { look: Look { aovs, ..Look::default() }, ..few() }, None, &|_| ())
            .unwrap()
            .picture;
    let focal = 0.5 * f64::from(SIZE[1]) / (0.5 * scene.camera.fovy).tan();
    let (mut compared, d) = (0, -centre.z);
    for (i, _) in picture.rgba.iter().enumerate().filter(|(_, pixel)| pixel[3] > 0.01) {
        let plane = |layer: usize, channel: usize| f64::from(picture.layers[layer].planes[channel][i]);
        let want = 0.001 * focal * (velocity.truncate() - centre.truncate() / centre.z * velocity.z) / d;
        // Within a shutter of 1/1000 frame the velocity changes by 1/1000.
        assert!((plane(2, 0) / want.x - 1.0).abs() < 2e-3, "{} {want}", plane(2, 0));
        assert!((plane(2, 1) / -want.y - 1.0).abs() < 2e-3, "{} {want}", plane(2, 1));
        assert_eq!([plane(1, 0), plane(1, 1), plane(1, 2)], [0.0; 3]);
        // The mean depth is a little before the centre's, where more light comes through.
        assert!((2.5..3.1).contains(&plane(0, 0)), "{}", plane(0, 0));
        compared += 1;
    }
    assert!(compared > 20, "{compared}");
}

#[test]
fn bytes_do_not_depend_on_parts_or_threads() {
    for transparent in [false, true] {
        let mut scene = busy(60);
        scene.image.transparent = transparent;
        let mut ball = object(sphere(1000));
        ball.transform.scale = DVec3::splat(0.4);
        ball.motions = vec![Motion::Linear { velocity: DVec3::new(0.5, 0.1, 0.0) }];
        let mut glass = object(sphere(1000));
        (glass.opacity, glass.shape.surface_mut().unwrap().two_sided) = (0.3, true);
        scene.objects.extend([ball, glass]);
        assert_parts_and_threads_change_nothing(&scene);
    }
}

/// What a pixel has is the mean of its samples, each alone.
#[test]
fn a_pixel_is_the_mean_of_its_samples() {
    let mut scene = busy(60);
    scene.objects.push(plane(1.0, GREEN, 0.5));
    let picture = render(&scene, 0, &few(), None, &|_| ()).unwrap().picture;
    for (at, pixel) in picture.rgba.iter().enumerate().step_by(7) {
        let place = [at as u32 % 14, at as u32 / 14];
        let one = |i: u64| probe(&scene, 0, &few(), place, Some(i)).unwrap().sample.unwrap();
        let mean: DVec3 = (0..16).map(|i| seen(&one(i))).sum::<DVec3>() / 16.0;
        let got = Vec3::new(pixel[0], pixel[1], pixel[2]).as_dvec3();
        // What f32 leaves: a ray depends on nothing else than itself.
        near(got, mean, 2e-7);
    }
}

//! Single samples of the reference against a second implementation of the whole rule, in `f64`, over all surfels one by
//! one: an animated camera with surfels and ideal spheres all around it, mirrored, sheared, moved models, every kind of
//! light and material.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use crate::support::{UNLIT, object, scene, sphere_scene};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;
use splatblur::model::{Material, Surfels};
use splatblur::options::Shading;
use splatblur::reference::{ReferenceError, ReferenceOptions, SCRAMBLINGS, Sample, Sampler, Sums, probe, render};
use splatblur::scene::pose::{camera_from_world, object_pose};
use splatblur::scene::{AnimationBinding, Light, Motion, Object, Scene, Shape, Sphere};
use splatblur::{Look, anim};

const FRAME: i64 = 12;
const SIZE: [u32; 2] = [12, 8];

fn hashed(i: u32, k: u64) -> f64 {
    f64::from(splatblur::sampling::hash(u64::from(i) + 77, k)) / 2_f64.powi(31) - 1.0
}

/// Ellipses of random shape, place, colour and material within about 2 of the origin.
fn cloud(n: u32) -> Surfels {
    let mut surfels = Surfels::default();
    for i in 0..n {
        let v = |k: u64| DVec3::new(hashed(i, k), hashed(i, k + 1), hashed(i, k + 2));
        let radius = (hashed(i, 20) - 2.0).exp2();
        let u = v(0).normalize() * radius;
        let w = u.cross(v(3)).normalize() * radius * (0.6 + 0.3 * hashed(i, 21)) + u * (0.3 * hashed(i, 22));
        surfels.position.push((v(6) * 2.0).as_vec3());
        surfels.axis_u.push(u.as_vec3());
        surfels.axis_v.push(w.as_vec3());
        surfels.normal.push(u.cross(w).normalize().as_vec3());
        surfels.colour.push((v(10) * 0.5 + 0.5).as_vec3());
        let [a, b, c, d] = [30, 31, 32, 33].map(|k| 0.5 + 0.5 * hashed(i, k) as f32);
        surfels.material.push(Material { ambient: a, diffuse: b, specular: c, shininess: 1.0 + 20.0 * d });
    }
    surfels
}

fn ideal(radius: f64, colour: Vec3) -> Object {
    let mut object = object(Surfels::default());
    object.shape = Sphere { radius, colour }.into();
    object.epsilon = Some(0.2);
    object
}

fn crowd() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("animations/toward_camera_spin.anim");
    let node = Arc::clone(&anim::load(&path).expect("an animation that ships").nodes[0]).into();
    let binding = AnimationBinding { path, node, interpolation: anim::Interpolation::default() };
    let mut model = cloud(1500);
    model.origin = DVec3::new(0.4, -0.3, 0.2);
    let mut first = object(model);
    first.transform.scale = DVec3::new(1.0, -1.3, 0.7);
    first.transform.rotate = DVec3::new(0.4, 0.2, -1.0);
    first.motions = vec![
        Motion::Rotation { axis: DVec3::new(0.6, 0.0, 0.8), per_frame: 0.9, centre: DVec3::new(0.2, 0.1, 0.0) },
        Motion::Linear { velocity: DVec3::new(0.02, -0.03, 0.05) },
    ];
    let mut still = object(cloud(500));
    still.motions = vec![Motion::Rotation { axis: DVec3::Y, per_frame: 1.0, centre: DVec3::ZERO }];
    still.blur = false;
    still.shape.surface_mut().unwrap().two_sided = true;
    still.epsilon = Some(0.1);
    still.shape.surface_mut().unwrap().material =
        Some(Material { ambient: 0.2, diffuse: 0.7, specular: 0.9, shininess: 6.0 });
    let mut small = ideal(0.7, Vec3::new(0.2, 0.9, 0.4));
    small.transform.scale = DVec3::new(0.5, 1.0, 1.4);
    small.transform.rotate.y = 0.7;
    small.transform.translate = DVec3::new(0.4, 0.1, -0.6);
    small.motions = vec![Motion::Rotation { axis: DVec3::Y, per_frame: 2.0, centre: DVec3::ZERO }];
    let mut sky = ideal(2.6, Vec3::new(0.5, 0.6, 1.0));
    sky.shape.surface_mut().unwrap().two_sided = true;
    // Around the camera, from outside only: never seen.
    let hull = ideal(1.5, Vec3::ONE);
    let mut scene = scene(vec![first, still, small, sky, hull], SIZE, DVec3::ZERO, 70.0);
    scene.camera.animation = Some(binding);
    scene.camera.near = 0.3;
    scene.frames.rate = 24.0;
    scene.shutter.open = -0.5;
    // All of it about the eye.
    let eye = camera_from_world(&scene, FRAME as f64).inverse().w_axis.truncate();
    for object in &mut scene.objects {
        object.place.translate = eye;
    }
    scene.lights = vec![
        Light::Ambient { colour: DVec3::new(0.3, 0.2, 0.1) },
        Light::directional(DVec3::new(0.3, -1.0, 0.4).normalize(), DVec3::new(0.5, 0.6, 0.7)).without_shadows(),
        Light::point(eye + DVec3::new(0.5, 1.5, 0.3), DVec3::new(2.0, 1.0, 1.5)).without_shadows(),
    ];
    scene
}

#[derive(Clone, Copy)]
struct Hit {
    depth: f64,
    epsilon: f64,
    weight: f64,
    colour: DVec3,
    normal: DVec3,
    centre: DVec3,
    material: [f64; 4],
}

/// All hits of a sample, the limit T not yet looked at.
fn hits(scene: &Scene, options: &ReferenceOptions, sample: &Sample) -> (Vec<Hit>, DVec3, DVec3) {
    let focal = 0.5 * f64::from(SIZE[1]) / (0.5 * scene.camera.fovy).tan();
    let [fx, fy] = sample.film;
    let film = DVec3::new((fx - 0.5 * f64::from(SIZE[0])) / focal, (0.5 * f64::from(SIZE[1]) - fy) / focal, -1.0);
    let ray = |time: f64| {
        let camera = camera_from_world(scene, time).inverse();
        (camera.w_axis.truncate(), camera.transform_vector3(film))
    };
    let mut all = Vec::new();
    for object in &scene.objects {
        let time = if object.blur { sample.time } else { FRAME as f64 };
        let (eye, direction) = ray(time);
        let m = object_pose(scene, object, time).world_from_model;
        let linear = DMat3::from_cols_array(
            &[DVec3::X, DVec3::Y, DVec3::Z].map(|e| m.transform_vector3(e).to_array()).concat().try_into().unwrap(),
        );
        let of_normal = |n: DVec3| (linear.inverse().transpose() * n).normalize();
        let two_sided = object.shape.surface().unwrap().two_sided || options.look.two_sided;
        let scale = linear.determinant().abs().cbrt();
        let epsilon = options.look.epsilon.or(object.epsilon).unwrap_or(f64::from(object.shape.tolerance()) * scale);
        let numbers = |m: Material| [m.ambient, m.diffuse, m.specular, m.shininess].map(f64::from);
        if let Shape::Sphere { sphere: Sphere { radius, colour }, .. } = object.shape {
            // |M^-1 (eye + s d - c)| = radius
            let (o, d) = (linear.inverse() * (eye - m.transform_point3(DVec3::ZERO)), linear.inverse() * direction);
            let (a, b, c) = (d.dot(d), o.dot(d), o.dot(o) - radius * radius);
            let root = (b * b - a * c).sqrt();
            for (depth, back) in [((-b - root) / a, false), ((-b + root) / a, true)] {
                if depth >= scene.camera.near && (!back || two_sided) {
                    let normal = of_normal(o + d * depth) * if back { -1.0 } else { 1.0 };
                    let material = numbers(object.shape.material().unwrap_or_default());
                    let (colour, centre) = (colour.as_dvec3(), eye + direction * depth - eye);
                    all.push(Hit { depth, epsilon, weight: 1.0, colour, normal, centre, material });
                }
            }
            continue;
        }
        let model = object.shape.surfels().unwrap().surfels();
        for i in 0..model.len() {
            let centre = m.transform_point3(model.origin + model.position[i].as_dvec3()) - eye;
            let [u, v] = [&model.axis_u, &model.axis_v].map(|a| linear * a[i].as_dvec3());
            let system = DMat3::from_cols(direction, -u, -v);
            let [depth, a, b] = (system.inverse() * centre).to_array();
            // Mirrored by the scale: the front is where u x v points in model space.
            let front = system.determinant() * linear.determinant() < 0.0;
            if depth >= scene.camera.near && a * a + b * b <= 1.0 && (front || two_sided) {
                let normal = of_normal(model.normal[i].as_dvec3()) * if front { 1.0 } else { -1.0 };
                let material = object.shape.material().or_else(|| model.material.get(i).copied()).unwrap_or_default();
                all.push(Hit {
                    depth,
                    epsilon,
                    weight: (-2.0 * (a * a + b * b)).exp(),
                    colour: model.colour[i].as_dvec3(),
                    normal,
                    centre,
                    material: numbers(material),
                });
            }
        }
    }
    let (eye, direction) = ray(sample.time);
    (all, eye, direction)
}

/// I = ka c La + sum of L (kd c max(n.l, 0) + ks max(r.v, 0)^shininess).
fn lit(scene: &Scene, eye: DVec3, material: [f64; 4], colour: DVec3, normal: DVec3, position: DVec3) -> DVec3 {
    let [ambient, diffuse, specular, shininess] = material;
    scene.lights.iter().fold(DVec3::ZERO, |sum, light| {
        let (towards, radiance) = match *light {
            Light::Ambient { colour: la } => return sum + ambient * colour * la,
            Light::Directional { direction, colour, .. } => (-direction.normalize(), colour),
            Light::Point { position: at, colour, .. } => {
                let way = at - eye - position;
                (way.normalize(), colour / way.length_squared())
            }
        };
        let cosine = normal.dot(towards);
        let reflected = 2.0 * cosine * normal - towards;
        let gloss = reflected.dot(-position.normalize()).max(0.0).powf(shininess);
        sum + radiance * (diffuse * cosine.max(0.0) * colour + specular * gloss)
    })
}

#[test]
fn samples_follow_the_rule() {
    let scene = crowd();
    let base = ReferenceOptions { samples: 16, ..ReferenceOptions::default() };
    for options in [
        base.clone(),
        ReferenceOptions { look: Look { shading: Shading::Gouraud, ..base.look.clone() }, ..base.clone() },
        ReferenceOptions { look: Look { epsilon: Some(0.3), two_sided: true, ..base.look.clone() }, ..base.clone() },
    ] {
        let pixels: Vec<[u32; 2]> = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y])).collect();
        let blended: usize = pixels
            .par_iter()
            .flat_map_iter(|&pixel| [3_u64, 6, 9, 12].map(|number| (pixel, number)))
            .map(|(pixel, number)| {
                let sample =
                    probe(&scene, FRAME, &options, pixel, Some(number)).expect("a sample").sample.expect("asked for");
                let place = format!("{pixel:?} sample {number}");
                let (mut hits, eye, direction) = hits(&scene, &options, &sample);
                assert!(
                    (sample.ray[0] - eye).length() < 1e-12 && (sample.ray[1] - direction).length() < 1e-12,
                    "{place}"
                );
                let limit = hits.iter().map(|h| h.depth + h.epsilon).fold(f64::INFINITY, f64::min);
                let nearest = hits.iter().map(|h| h.depth).fold(f64::INFINITY, f64::min);
                hits.retain(|h| h.depth <= limit && h.depth <= nearest + h.epsilon);
                assert!((sample.limit - limit).abs() < 1e-9, "{place}: T {}, not {limit}", sample.limit);
                let admitted: Vec<_> = sample.hits.iter().filter(|hit| hit.admitted).collect();
                assert_eq!(admitted.len(), hits.len(), "{place}");
                assert!(sample.hits.is_sorted_by_key(|hit| hit.depth), "{place}");
                let weight: f64 = hits.iter().map(|h| h.weight).sum();
                let mean =
                    |value: &dyn Fn(&Hit) -> DVec3| hits.iter().map(|h| h.weight * value(h)).sum::<DVec3>() / weight;
                let depth = mean(&|h| DVec3::splat(h.depth)).x;
                let normal = mean(&|h| h.normal).normalize();
                let colour = match options.look.shading {
                    Shading::Phong => {
                        let (a, b) =
                            (mean(&|h| DVec3::from_slice(&h.material)), mean(&|h| DVec3::splat(h.material[3])).x);
                        lit(&scene, eye, [a.x, a.y, a.z, b], mean(&|h| h.colour), normal, direction * depth)
                    }
                    Shading::Gouraud => mean(&|h| lit(&scene, eye, h.material, h.colour, h.normal, h.centre)),
                };
                let (got_depth, got_normal) = sample.surface.expect("the sky is everywhere");
                assert!((got_depth - depth).abs() < 1e-9, "{place}: depth {got_depth}, not {depth}");
                assert!((got_normal - normal).length() < 1e-6, "{place}: normal {got_normal}, not {normal}");
                let got = sample.colour.expect("the sky is everywhere");
                assert!((got - colour).length() < 2e-5 * (1.0 + colour.length()), "{place}: {got}, not {colour}");
                usize::from(hits.len() > 1)
            })
            .sum();
        println!("{blended} samples of several hits");
        assert!(blended > 40, "{blended}");
    }
}

/// No two pixels, and no two scramblings of a pixel, sample the same places and times.
#[test]
fn samples_are_apart() {
    let scene = sphere_scene(10, 8, false);
    for sampler in [Sampler::Sobol, Sampler::Random, Sampler::Jittered { density: 4 }] {
        let options = ReferenceOptions { sampler, samples: 16, ..ReferenceOptions::default() };
        let mut seen = HashSet::new();
        for (x, y) in (0..8).flat_map(|y| (0..8).map(move |x| (x, y))) {
            for number in 0..SCRAMBLINGS as u64 {
                let sample = probe(&scene, 0, &options, [x, y], Some(number)).unwrap().sample.unwrap();
                let [fx, fy] = sample.film;
                assert!((0.0..1.0).contains(&(fx - f64::from(x))) && (0.0..1.0).contains(&(fy - f64::from(y))));
                let place = [fx - f64::from(x), fy - f64::from(y), sample.time].map(|v| (v * 1e6).round() as i64);
                assert!(seen.insert(place), "{sampler:?}: pixel {x},{y} sample {number}");
            }
        }
    }
}

/// The decision to stop is that of the even scramblings, taken after whole rounds, also where an earlier run ended
/// elsewhere.
#[test]
fn the_even_scramblings_decide_after_whole_rounds() {
    let mut scene = sphere_scene(500, 12, true);
    scene.objects[0].shape.surface_mut().unwrap().material = Some(UNLIT);
    let background =
        splatblur::film::Background { colour: scene.image.background, transparent: scene.image.transparent };
    let backdrop = splatblur::film::Backdrop::plain(background);
    let run = |samples: u64, error: Option<f64>, earlier: Option<Sums>| {
        let options = ReferenceOptions { samples, error, ..ReferenceOptions::default() };
        render(&scene, 0, &options, earlier, &|_| ()).expect("valid options")
    };
    let first = run(256, None, None);
    let (even, all) = (first.sums.mean_error_of_even(&backdrop), first.sums.mean_error(&backdrop));
    assert!((even / all - 1.0).abs() > 1e-3 && (even / all - 1.0).abs() < 0.3, "{even} and {all}");
    // Between the two: half of them say one thing, all of them the other.
    let stops = run(4096, Some(0.5 * (even + all)), None).stats.samples == 256;
    assert_eq!(stops, even < all);
    let short = run(48, None, None);
    assert_eq!(run(4096, Some(1.5 * even.max(all)), Some(short.sums)).stats.samples, 256);
    assert!(matches!(
        ReferenceOptions { samples: 24, ..ReferenceOptions::default() }.check(),
        Err(ReferenceError::Samples { samples: 24 })
    ));
}

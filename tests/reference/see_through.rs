//! See-through surfels in the reference, against closed forms. Each film point sees few surfels, so what a ray sees is
//! a short sum. Tolerances of 1e-12 are for the rounding of such sums in f64, where colours are exact in f32.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may stop and report")]

use glam::{DVec3, Quat, Vec3};
use splatblur::film::Aov;
use splatblur::model::Gaussians;
use splatblur::options::{Look, PixelFilter};
use splatblur::reference::{ReferenceOptions, Sample, probe, render};
use splatblur::scene::{Motion, Object, Scene};

use crate::parts::assert_parts_and_threads_change_nothing;
use crate::support::{UNLIT, object, round_surfels, scene, sphere};

const EXACT: f64 = 1e-12;
const RED: Vec3 = Vec3::new(0.75, 0.125, 0.25);
const GREEN: Vec3 = Vec3::new(0.0, 1.5, 0.5);
const BLUE: Vec3 = Vec3::new(0.0625, 0.25, 1.0);
const SIZE: [u32; 2] = [12, 8];

/// A disc that is wider than the image, facing the camera.
fn plane(depth: f64, colour: Vec3, opacity: f64) -> Object {
    let mut plane = object(round_surfels([(DVec3::ZERO, DVec3::Z, 100.0, colour)]));
    plane.transform.translate = DVec3::new(0.0, 0.0, -depth);
    plane.shape.surface_mut().unwrap().material = Some(UNLIT);
    plane.epsilon = Some(1e-3);
    plane.opacity = opacity;
    plane
}

fn moving(mut object: Object, velocity: DVec3) -> Object {
    object.motions = vec![Motion::Linear { velocity }];
    object
}

fn before_camera(objects: Vec<Object>) -> Scene {
    let mut scene = scene(objects, SIZE, DVec3::ZERO, 40.0);
    scene.image.transparent = true;
    scene
}

/// The sixteen samples of a pixel beside the centre.
fn samples(scene: &Scene) -> Vec<Sample> {
    let options = ReferenceOptions { samples: 16, ..ReferenceOptions::default() };
    (0..16).map(|i| probe(scene, 0, &options, [7, 2], Some(i)).unwrap().sample.unwrap()).collect()
}

/// What surfaces (depth, colour, opacity) in this order leave: colour, coverage, mean depth.
fn composite(layers: &[(f64, DVec3, f64)]) -> (DVec3, f64, f64) {
    let (mut colour, mut depth, mut through) = (DVec3::ZERO, 0.0, 1.0);
    for &(z, c, a) in layers {
        colour += through * a * c;
        depth += through * a * z;
        through *= 1.0 - a;
    }
    (colour, 1.0 - through, depth / (1.0 - through))
}

fn check(sample: &Sample, layers: &[(f64, DVec3, f64)]) {
    let (colour, coverage, depth) = composite(layers);
    let seen = sample.colour.unwrap();
    assert!((seen - colour).abs().max_element() < EXACT, "{seen}, not {colour}: {sample:?}");
    assert!((sample.coverage - coverage).abs() < EXACT, "{}, not {coverage}", sample.coverage);
    let (seen, normal) = sample.surface.unwrap();
    assert!((seen - depth).abs() < EXACT * depth.max(1.0), "depth {seen}, not {depth}");
    assert!((normal - DVec3::Z).length() < 1e-6, "{normal}");
}

#[test]
fn two_planes() {
    let (a, b) = (0.375, 0.6);
    for velocity in [DVec3::ZERO, DVec3::new(3.0, -1.0, 0.0), DVec3::new(0.0, 0.0, 0.7)] {
        let near = moving(plane(3.0, RED, a), velocity);
        let far = moving(plane(5.0, GREEN, b), 0.5 * velocity);
        for scene in [vec![near.clone(), far.clone()], vec![far, near]].map(before_camera) {
            for sample in samples(&scene) {
                let [near, far] = [3.0 - velocity.z * sample.time, 5.0 - 0.5 * velocity.z * sample.time];
                check(&sample, &[(near, RED.as_dvec3(), a), (far, GREEN.as_dvec3(), b)]);
            }
        }
    }
}

/// Planes that pass one another within the exposure: the order is that of the ray's own time.
#[test]
fn planes_that_pass_one_another() {
    let first = moving(plane(3.0, RED, 0.5), DVec3::new(0.0, 0.0, -2.0));
    let second = plane(4.0, BLUE, 0.25);
    let mut orders = [0, 0];
    for sample in samples(&before_camera(vec![first, second])) {
        let z = 3.0 + 2.0 * sample.time;
        let mut layers = [(z, RED.as_dvec3(), 0.5), (4.0, BLUE.as_dvec3(), 0.25)];
        layers.sort_by(|a, b| a.0.total_cmp(&b.0));
        check(&sample, &layers);
        orders[usize::from(z > 4.0)] += 1;
    }
    assert!(orders.iter().all(|&count| count >= 4), "{orders:?}");
}

/// One to eight layers; the ninth is left out and counted, whatever the order of objects.
#[test]
fn eight_layers_are_taken() {
    for count in 1..=10_usize {
        let mut objects: Vec<Object> = Vec::new();
        let mut layers = Vec::new();
        for i in 0..count {
            let (depth, opacity) = (2.0 + 0.3 * i as f64, 0.2 + 0.05 * i as f64);
            let colour = Vec3::new(0.125 * i as f32, 1.0, 2.0 - 0.25 * i as f32);
            objects.insert(i / 2, plane(depth, colour, opacity));
            layers.push((depth, colour.as_dvec3(), opacity));
        }
        layers.truncate(8);
        let scene = before_camera(objects);
        for sample in samples(&scene) {
            check(&sample, &layers);
            assert_eq!(sample.hits.len(), count);
            for (i, hit) in sample.hits.iter().enumerate() {
                assert_eq!((hit.layer, hit.admitted), ((i < 8).then_some(i + 1), i < 8));
            }
        }
        let options = ReferenceOptions { samples: 16, ..ReferenceOptions::default() };
        let made = render(&scene, 0, &options, None, &|_| ()).unwrap();
        assert_eq!(made.stats.cut, if count > 8 { 16 * u64::from(SIZE[0] * SIZE[1]) } else { 0 });
        // The picture has the same, in f32.
        let (colour, coverage, _) = composite(&layers);
        for pixel in &made.picture.rgba {
            let want = [colour.x, colour.y, colour.z, coverage];
            assert!(pixel.iter().zip(want).all(|(&got, want)| (f64::from(got) - want).abs() < 3e-7), "{pixel:?}");
        }
    }
}

/// Two surfels of one object are one layer up to epsilon, and two beyond it. In a layer colours and opacities are
/// means by the kernels' weights.
#[test]
fn a_layer_is_as_thick_as_epsilon() {
    // Depths are exact in f32.
    let (radius, epsilon) = (2.0, 0.0625);
    for apart in [0.875, 1.125] {
        let [z, behind] = [4.0, 4.0 + apart * epsilon];
        let mut model =
            round_surfels([(-z * DVec3::Z, DVec3::Z, radius, RED), (-behind * DVec3::Z, DVec3::Z, radius, BLUE)]);
        model.opacity = vec![0.25, 0.75];
        let mut both = object(model);
        (both.shape.surface_mut().unwrap().material, both.epsilon, both.opacity) = (Some(UNLIT), Some(epsilon), 0.5);
        // A second object whose tolerance is smaller sets the limit, although it begins farther away.
        for third in [false, true] {
            let mut objects = vec![both.clone()];
            let at = z + 0.125 * epsilon;
            if third {
                let mut plane = plane(at, GREEN, 0.5);
                (plane.epsilon, plane.shape) = (Some(0.2 * epsilon), plane.shape.clone());
                objects.push(plane);
            }
            for sample in samples(&before_camera(objects)) {
                let tangent2 = (sample.ray[1].truncate()).length_squared();
                let weight = |depth: f64, radius: f64| (-2.0 * tangent2 * (depth / radius).powi(2)).exp();
                let one = |depth: f64, colour: Vec3, opacity: f64, radius: f64| {
                    (weight(depth, radius), depth, colour.as_dvec3(), opacity)
                };
                let first = one(z, RED, 0.125, radius);
                let second = one(behind, BLUE, 0.375, radius);
                let plane = one(at, GREEN, 0.5, 100.0);
                let mean = |members: &[(f64, f64, DVec3, f64)]| {
                    let sum: f64 = members.iter().map(|member| member.0).sum();
                    (
                        members.iter().map(|member| member.0 * member.1).sum::<f64>() / sum,
                        members.iter().map(|member| member.0 * member.2).sum::<DVec3>() / sum,
                        members.iter().map(|member| member.0 * member.3).sum::<f64>() / sum,
                    )
                };
                let layers = match (third, apart < 1.0) {
                    (false, true) => vec![mean(&[first, second])],
                    (false, false) => vec![mean(&[first]), mean(&[second])],
                    (true, _) => vec![mean(&[first, plane]), mean(&[second])],
                };
                let (colour, coverage, _) = composite(&layers);
                let seen = sample.colour.unwrap();
                // A mean of colours is rounded to f32 where it is shaded.
                assert!((seen - colour).abs().max_element() < 1e-7, "{apart} {third}: {seen}, not {colour}");
                assert!((sample.coverage - coverage).abs() < EXACT, "{}, not {coverage}", sample.coverage);
                assert_eq!(sample.hits.iter().filter_map(|hit| hit.layer).max(), Some(layers.len()));
            }
        }
    }
}

/// A disc seen edge-on covers nothing, and one that nearly is has few hits; neither gives a number that is not finite.
#[test]
fn edge_on_layers_do_no_harm() {
    let wall = plane(5.0, GREEN, 1.0);
    for tilt in [0.0, 1e-9, 1e-3] {
        let normal = DVec3::new(1.0, 0.0, tilt).normalize();
        let mut disc = object(round_surfels([(DVec3::ZERO, normal, 1.0, RED)]));
        (disc.shape.surface_mut().unwrap().material, disc.opacity, disc.shape.surface_mut().unwrap().two_sided) =
            (Some(UNLIT), 0.5, true);
        disc.transform.translate.z = -3.0;
        let mut scene = before_camera(vec![disc, wall.clone()]);
        // The rays of the middle column lie in the plane of the first disc.
        scene.image.width = 13;
        for sample in samples(&scene) {
            let is_hit = sample.hits.iter().any(|hit| hit.layer.is_some());
            let mean = 0.5 * (RED.as_dvec3() + GREEN.as_dvec3());
            let want = if is_hit { mean } else { GREEN.as_dvec3() };
            let seen = sample.colour.unwrap();
            assert!((seen - want).length() < EXACT && sample.coverage == 1.0, "{tilt}: {seen}");
        }
        for filter in [PixelFilter::Point, PixelFilter::Box] {
            let options =
                ReferenceOptions { samples: 256, look: Look { filter, ..Look::default() }, ..Default::default() };
            let picture = render(&scene, 0, &options, None, &|_| ()).unwrap().picture;
            let mean = picture.rgba.iter().map(|pixel| pixel[0]).sum::<f32>() / picture.rgba.len() as f32;
            assert!(picture.rgba.iter().flatten().all(|value| value.is_finite()), "{tilt}");
            // Rays in the plane of a disc miss it; a disc that is tilted by 1/1000 covers 1/1000 of its size.
            let most = if tilt == 0.0 { 0.0 } else { 0.03 };
            assert!(mean <= most, "{tilt}: {mean}");
        }
    }
}

/// Backs are left out unless the object is two-sided, and so is what is nearer than `near`.
#[test]
fn backs_and_what_is_near_are_left_out() {
    for two_sided in [false, true] {
        let mut back = object(round_surfels([(-3.0 * DVec3::Z, DVec3::NEG_Z, 100.0, RED)]));
        (back.shape.surface_mut().unwrap().material, back.opacity, back.shape.surface_mut().unwrap().two_sided) =
            (Some(UNLIT), 0.5, two_sided);
        back.epsilon = Some(1e-3);
        let mut scene = before_camera(vec![plane(1.0, BLUE, 0.5), back, plane(4.0, GREEN, 0.25)]);
        scene.camera.near = 2.0;
        for sample in samples(&scene) {
            let layers = [(3.0, RED.as_dvec3(), 0.5), (4.0, GREEN.as_dvec3(), 0.25)];
            check(&sample, &layers[usize::from(!two_sided)..]);
        }
    }
}

/// Things behind an opaque surface are hidden, and things before it are not, also within its tolerance.
#[test]
fn opaque_surfaces_hide_what_is_behind() {
    let (near, far) = (plane(3.0, RED, 0.5), plane(5.0, BLUE, 0.5));
    let wall = plane(4.0, GREEN, 1.0);
    for scene in [vec![near.clone(), wall.clone(), far.clone()], vec![far, wall.clone(), near]].map(before_camera) {
        for sample in samples(&scene) {
            check(&sample, &[(3.0, RED.as_dvec3(), 0.5), (4.0, GREEN.as_dvec3(), 1.0)]);
        }
    }
    // T is 4.001. The limits of these layers are greater, also behind a Gaussian that begins the last batch.
    for depth in [3.9999, 4.0005] {
        for veiled in [false, true] {
            let mut objects = vec![plane(depth, RED, 0.5), wall.clone()];
            if veiled {
                objects.push(gaussian(4.0006, 0.5, BLUE, true));
            }
            for sample in samples(&before_camera(objects)) {
                assert_eq!(sample.gaussians.len(), usize::from(veiled));
                let alpha = sample.gaussians.first().map_or(0.0, |gaussian| gaussian.alpha);
                let layers =
                    [(4.0006, BLUE.as_dvec3(), alpha), (depth, RED.as_dvec3(), 0.5), (4.0, GREEN.as_dvec3(), 1.0)];
                assert!((sample.colour.unwrap() - composite(&layers).0).length() < EXACT);
            }
        }
    }
}

/// A capture of one Gaussian that is much larger than the image.
fn gaussian(depth: f64, opacity: f32, colour: Vec3, linear: bool) -> Object {
    let mut object = Object::new(Gaussians {
        position: vec![Vec3::ZERO],
        sigma: vec![Vec3::splat(0.3 * depth as f32)],
        rotation: vec![Quat::IDENTITY],
        opacity: vec![opacity],
        base: vec![Vec3::ZERO],
        linear,
        ..Gaussians::default()
    });
    object.transform.translate.z = -depth;
    object.shape.gaussians_mut().unwrap().flat = Some(colour);
    object
}

/// sRGB by its definition.
fn encoded(l: f64) -> f64 {
    if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 }
}

fn decoded(c: f64) -> f64 {
    if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// A Gaussian of a capture is before a layer if its centre is at most at the layer's limit. Coded colours make the
/// whole image blend coded.
#[test]
fn gaussians_stand_between_layers() {
    let layers = [(3.0, RED, 0.5), (5.0, GREEN, 0.25)];
    let planes = layers.map(|(depth, colour, opacity)| plane(depth, colour, opacity));
    for (depth, before) in [(2.5, 0), (3.0009, 0), (3.0011, 1), (4.0, 1), (5.0009, 1), (5.0011, 2), (9.0, 2)] {
        for linear in [false, true] {
            let mut objects = planes.to_vec();
            objects.insert(1, gaussian(depth, 0.75, BLUE, linear));
            // Another one at the same depth, and one that is far behind.
            objects.push(gaussian(10.0, 0.5, RED, linear));
            for sample in samples(&before_camera(objects)) {
                let [a, b] = [0, 1].map(|i| (sample.gaussians[i].alpha, sample.gaussians[i].depth));
                assert!((0.01..0.99).contains(&a.0) && (a.1 - depth).abs() < EXACT && b.1 == 10.0);
                let coded = |colour: Vec3| if linear { colour.as_dvec3() } else { colour.as_dvec3().map(encoded) };
                let mut all = layers.map(|(depth, colour, opacity)| (depth, coded(colour), opacity)).to_vec();
                all.insert(before, (depth, BLUE.as_dvec3(), a.0));
                all.push((10.0, RED.as_dvec3(), b.0));
                let (colour, coverage, mean) = composite(&all);
                let want = if linear { colour } else { coverage * (colour / coverage).map(decoded) };
                let seen = sample.colour.unwrap();
                // sRGB: two libraries' powers.
                assert!((seen - want).abs().max_element() < 1e-11, "{depth} {linear}: {seen}, not {want}");
                assert!((sample.coverage - coverage).abs() < EXACT);
                assert!((sample.surface.unwrap().0 - mean).abs() < 1e-11);
            }
        }
    }
}

/// Opacities of 254/255 and more are opaque: such surfaces need no layers.
#[test]
fn nearly_opaque_is_opaque() {
    let scene = before_camera(vec![plane(3.0, RED, 0.999), plane(4.0, GREEN, 0.5)]);
    for sample in samples(&scene) {
        check(&sample, &[(3.0, RED.as_dvec3(), 1.0)]);
    }
}

/// Turning glass before an opaque ball, with a capture among them.
fn busy_scene() -> Scene {
    let mut glass = object(sphere(3000));
    glass.shape = {
        let mut model = (**glass.shape.surfels().unwrap().surfels()).clone();
        model.opacity = (0..model.len()).map(|i| [0.2, 0.5, 0.9][i % 3]).collect();
        model.into()
    };
    glass.shape.surface_mut().unwrap().two_sided = true;
    glass.motions = vec![
        Motion::Rotation { axis: DVec3::Y, per_frame: 0.4, centre: DVec3::ZERO },
        // So fast that many pixels see nothing for most samples.
        Motion::Linear { velocity: DVec3::new(9.0, 0.1, 0.0) },
    ];
    let mut ball = object(sphere(1000));
    ball.transform.scale = DVec3::splat(0.4);
    let mut cloud = gaussian(0.3, 0.5, BLUE, false);
    cloud.motions = vec![Motion::Linear { velocity: DVec3::new(0.0, 0.4, 0.0) }];
    let mut scene = scene(vec![glass, ball, cloud], [37, 26], DVec3::new(0.0, 0.0, 4.0), 40.0);
    scene.image.background = DVec3::new(0.2, 0.1, 0.3);
    scene
}

#[test]
fn bytes_do_not_depend_on_parts_or_threads() {
    for (capture, transparent) in [(true, false), (true, true), (false, false), (false, true)] {
        let mut scene = busy_scene();
        scene.image.transparent = transparent;
        scene.objects.truncate(if capture { 3 } else { 2 });
        let [_, whole] = assert_parts_and_threads_change_nothing(&scene);
        let alpha = whole.picture.layers.iter().find(|layer| layer.aov == Aov::Alpha).unwrap();
        let partial = alpha.planes[0].iter().filter(|alpha| (0.1..0.9).contains(*alpha)).count();
        assert!(partial > 30, "{partial}");
    }
}

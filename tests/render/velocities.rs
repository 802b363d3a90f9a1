//! Points that move by themselves, against motion that the scene gives, and against closed forms.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use glam::{DVec3, Vec3};
use splatblur::backend::cpu::Cpu;
use splatblur::film::{Aov, Picture};
use splatblur::model::{Surfels, VelocityUnit};
use splatblur::options::{BlurMode, ErrorTarget, Look, PixelFilter, Prefilter, Quality, RenderOptions, Shading};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Light, Motion, Scene};

use crate::support::{Random, UNLIT, object, round_surfels, scene, sphere, sphere_scene};

const VELOCITY: DVec3 = DVec3::new(0.4, 0.1, -0.3);

/// A lit sphere whose points have `rates`, which turns and moves by itself as `motions` say.
fn ball(velocity: DVec3, acceleration: DVec3, motions: Vec<Motion>) -> Scene {
    let mut scene = sphere_scene(12_000, 90, false);
    let mut model = sphere(12_000).spatially_ordered();
    let column = |rate: DVec3| if rate == DVec3::ZERO { Vec::new() } else { vec![rate.as_vec3(); model.len()] };
    (model.velocity, model.acceleration) = (column(velocity), column(acceleration));
    model.velocity_unit = VelocityUnit::Frame;
    scene.objects[0] = object(model);
    scene.objects[0].motions = motions;
    scene.lights.push(Light::point(DVec3::new(1.0, 1.5, 2.0), DVec3::new(2.0, 1.5, 1.0)).without_shadows());
    scene
}

fn options(quality: Quality, prefilter: Prefilter, shading: Shading) -> RenderOptions {
    let aovs = vec![Aov::Alpha, Aov::Depth, Aov::Normal, Aov::Velocity];
    RenderOptions { quality, prefilter, look: Look { shading, aovs, ..Look::default() }, ..RenderOptions::default() }
}

fn mode(text: &str) -> Quality {
    text.parse::<BlurMode>().unwrap().into()
}

fn values(picture: &Picture) -> impl Iterator<Item = f32> {
    let layers = picture.layers.iter().flat_map(|layer| layer.planes.iter().flatten());
    picture.rgba.iter().flatten().chain(layers).copied()
}

/// Number of values that differ by more than `limit`, and the mean of the differences of all.
fn differing(a: &Picture, b: &Picture, limit: f32) -> (usize, f64) {
    let differences = || values(a).zip(values(b)).map(|(a, b)| if a == b { 0.0 } else { (a - b).abs() });
    let count = differences().count();
    (
        differences().filter(|d| d.is_nan() || *d > limit).count(),
        differences().map(f64::from).sum::<f64>() / count as f64,
    )
}

/// Velocities of all points are the motion of the object: `<motion>` says the same.
// Not deep: the only test of points that move in every mode.
#[test]
fn points_with_velocities_move_as_their_object_would() {
    let by_points = ball(VELOCITY, DVec3::ZERO, Vec::new());
    let by_motion = ball(DVec3::ZERO, DVec3::ZERO, vec![Motion::Linear { velocity: VELOCITY }]);
    let target: Quality = Quality::Error(ErrorTarget::default());
    for (quality, prefilter, shading) in [
        (mode("supersample:5"), Prefilter::None, Shading::Gouraud),
        (mode("supersample:5"), Prefilter::Approx, Shading::Phong),
        (mode("supersample:5"), Prefilter::Ewa, Shading::Phong),
        (mode("bucket:2x3"), Prefilter::Ewa, Shading::Phong),
        (mode("volumetric:4"), Prefilter::Approx, Shading::Gouraud),
        (mode("volumetric:3"), Prefilter::Ewa, Shading::Gouraud),
        (target, Prefilter::Ewa, Shading::Phong),
    ] {
        let with = |scene: &Scene| {
            let options = options(quality, prefilter, shading);
            let rendered = render_frame(&mut Cpu::default(), scene, 0, &options).unwrap();
            assert!(rendered.picture.rgba.iter().any(|p| p[3] > 0.9));
            rendered
        };
        let (a, b) = (with(&by_points), with(&by_motion));
        assert_eq!(a.stats.samples, b.stats.samples, "{quality}");
        let (worst, mean) = differing(&a.picture, &b.picture, 1e-4);
        // Rounding decides at the rims of a few discs.
        println!("{quality} {prefilter:?}: {worst} differ, mean {mean:.1e}");
        assert!(worst < 40 && mean < 1e-5, "{quality} {prefilter:?}: {worst} values differ, mean {mean:e}");
    }
}

fn reference_of(scene: &Scene, samples: u64) -> Picture {
    let options = ReferenceOptions {
        samples,
        look: Look {
            filter: PixelFilter::Box,
            aovs: vec![Aov::Alpha, Aov::Depth, Aov::Normal, Aov::Velocity],
            ..Look::default()
        },
        ..ReferenceOptions::default()
    };
    reference::render(scene, 0, &options, None, &|_| ()).unwrap().picture
}

#[test]
fn the_reference_moves_points_as_their_object() {
    let turn = Motion::Rotation { axis: DVec3::Y, per_frame: 0.4, centre: DVec3::new(0.2, 0.0, 0.1) };
    let mut by_points = ball(VELOCITY, DVec3::ZERO, vec![turn]);
    // In the world the velocity turns with the object, so only what comes before the turn is the same.
    let mut by_motion = ball(DVec3::ZERO, DVec3::ZERO, vec![Motion::Linear { velocity: VELOCITY }, turn]);
    let points = *by_points.objects[0].shape.points_mut().unwrap();
    *by_motion.objects[0].shape.points_mut().unwrap() = points;
    let (a, b) = (reference_of(&by_points, 32), reference_of(&by_motion, 32));
    let (worst, mean) = differing(&a, &b, 1e-4);
    println!("reference: {worst} differ, mean {mean:.1e}");
    assert!(worst < 40 && mean < 1e-5, "{worst} values differ, mean {mean:e}");
}

/// The share of the time in which a plate's edge has passed each column: x(t) = x0 + v t + a t^2/2, rising.
fn share_passed(column: f64, [x0, v, a]: [f64; 3]) -> f64 {
    let passed = |t: f64| x0 + v * t + 0.5 * a * t * t > column;
    let n = 4096;
    (0..n).filter(|i| passed((f64::from(*i) + 0.5) / f64::from(n))).count() as f64 / f64::from(n)
}

/// A plate before an orthographic-like camera; its edge stands at column 30 and accelerates to the right. Row 30
/// alone is looked at: of 60 rows those below it are left out, and of the plate what is away from it.
fn accelerating_plate() -> (Scene, [f64; 3], f64) {
    const ROWS: u32 = 31;
    let spacing = 0.05;
    let points = (-80..=0).flat_map(|i| (-12..=12).map(move |j| DVec3::new(f64::from(i), f64::from(j), 0.0) * spacing));
    let mut plate = round_surfels(points.map(|p| (p, DVec3::Z, 2.0 * spacing, Vec3::ONE)));
    plate.velocity = vec![Vec3::new(0.4, 0.0, 0.0); plate.len()];
    plate.acceleration = vec![Vec3::new(2.4, 0.0, 0.0); plate.len()];
    plate.velocity_unit = VelocityUnit::Frame;
    let mut plate = object(plate);
    plate.shape.surface_mut().unwrap().material = Some(UNLIT);
    // 20 pixels to a unit: focal length 100, distance 5.
    let fovy = (2.0 * (0.5 * f64::from(ROWS) / 100.0).atan()).to_degrees();
    let mut scene = scene(vec![plate], [100, ROWS], DVec3::new(0.0, 0.0, 5.0), fovy);
    scene.camera.shift.y = 30.0 / f64::from(ROWS) - 0.5;
    // Discs reach 2 spacings beyond the last centres.
    (scene, [50.0 + 2.0 * 20.0 * spacing, 8.0, 48.0], 20.0)
}

// Not deep: the closed form of accelerations.
#[test]
fn accelerations_are_those_of_the_closed_form() {
    let (scene, edge, _) = accelerating_plate();
    let error = |picture: &Picture| {
        let share = |x: u32| f64::from(picture.rgba[(30 * picture.width + x) as usize][0]);
        let column = |x: u32| (0..16).map(|i| share_passed(f64::from(x) + (f64::from(i) + 0.5) / 16.0, edge)).sum();
        let wrong = |x: u32| {
            let sum: f64 = column(x);
            (share(x) - sum / 16.0).abs()
        };
        (0..picture.width).map(wrong).fold(0.0, f64::max)
    };
    let supersampled = |prefilter| {
        let options = options(mode("supersample:64"), prefilter, Shading::Phong);
        render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap().picture
    };
    let exact = error(&reference_of(&scene, 1024));
    let none = error(&supersampled(Prefilter::None));
    let swept = options(mode("volumetric:16"), Prefilter::Approx, Shading::Gouraud);
    let swept = error(&render_frame(&mut Cpu::default(), &scene, 0, &swept).unwrap().picture);
    println!("reference {exact:.4}, supersample:64 {none:.4}, volumetric:16 {swept:.4}");
    assert!(exact < 0.01 && none < 0.03 && swept < 0.05, "{exact} {none} {swept}");
}

/// The layer `velocity` of a plate, by both integrators: v + a t at mid-exposure, in pixels per shutter.
// Not deep: the closed form of that layer.
#[test]
fn the_velocity_layer_has_velocities_of_points() {
    let (mut scene, _, pixels) = accelerating_plate();
    (scene.shutter.open, scene.shutter.close) = (0.0, 0.5);
    let want = pixels * (0.4 + 2.4 * 0.25) * 0.5;
    let at = |picture: &Picture| picture.layers[3].planes[0][(30 * picture.width + 20) as usize];
    let splatted =
        render_frame(&mut Cpu::default(), &scene, 0, &options(mode("supersample:64"), Prefilter::None, Shading::Phong));
    let (splatted, traced) = (at(&splatted.unwrap().picture), at(&reference_of(&scene, 1024)));
    println!("splatted {splatted}, traced {traced}");
    assert!((f64::from(splatted) - want).abs() < 1e-3, "{splatted} for {want}");
    assert!((f64::from(traced) - want).abs() < 0.03, "{traced} for {want}");
}

/// `at` and the unit say where points are in another frame.
// Not deep: the only test of `at` and of its unit in pictures.
#[test]
fn points_travel_from_the_frame_they_are_given_at() {
    let mut travelled = ball(VELOCITY, DVec3::new(0.0, -0.2, 0.0), Vec::new());
    travelled.objects[0].shape.points_mut().unwrap().at = Some(1.0);
    let mut moved = ball(DVec3::ZERO, DVec3::ZERO, Vec::new());
    let still = options(mode("still:4"), Prefilter::Ewa, Shading::Phong);
    let still = RenderOptions { look: Look { aovs: Vec::new(), ..still.look }, ..still };
    for (frame, unit, rate) in
        [(3, VelocityUnit::Frame, 24.0), (-1, VelocityUnit::Frame, 24.0), (5, VelocityUnit::Second, 4.0)]
    {
        travelled.objects[0].shape.points_mut().unwrap().unit = Some(unit);
        travelled.frames.rate = rate;
        let frames = f64::from(frame) - 1.0;
        let t = if unit == VelocityUnit::Second { frames / rate } else { frames };
        moved.objects[0].place.translate = VELOCITY * t + DVec3::new(0.0, -0.2, 0.0) * (0.5 * t * t);
        let of = |scene: &Scene| render_frame(&mut Cpu::default(), scene, frame, &still).unwrap().picture;
        let (worst, mean) = differing(&of(&travelled), &of(&moved), 1e-4);
        assert!(worst < 40 && mean < 1e-5, "frame {frame}: {worst} values differ, mean {mean:e}");
    }
}

/// Points that fly apart, each with velocities of its own.
fn burst(seed: u64) -> Scene {
    let mut random = Random(seed);
    let mut scene = ball(VELOCITY, DVec3::Y, Vec::new());
    let mut model: Surfels = scene.objects[0].shape.surfels().unwrap().surfels().as_ref().clone();
    for i in 0..model.len() {
        let out = model.position[i].as_dvec3();
        model.velocity[i] = (out * random.within(0.0, 0.3) + random.direction() * 0.02).as_vec3();
        model.acceleration[i] = (DVec3::NEG_Y * random.within(0.1, 0.4)).as_vec3();
    }
    scene.objects[0] = object(model);
    scene.objects[0].shape.surface_mut().unwrap().two_sided = true;
    scene
}

/// Splats and rays share no code that moves points.
#[test]
#[ignore = "deep: many samples"]
fn bursts_look_as_the_reference_has_them() {
    for (seed, text, prefilter, limit) in
        [(1, "supersample:64", Prefilter::None, 0.012), (3, "volumetric:8", Prefilter::Approx, 0.05)]
    {
        let scene = burst(seed);
        let truth = reference_of(&scene, 512);
        let shading = if text.starts_with("vol") { Shading::Gouraud } else { Shading::Phong };
        let options = options(mode(text), prefilter, shading);
        let splatted = render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap().picture;
        let rms = crate::support::rms(&splatted, &truth);
        println!("{text} seed {seed}: {rms:.4}");
        assert!(rms < limit, "{text} seed {seed}: {rms}");
    }
}

#[cfg(feature = "gpu")]
fn moves_points_as_on_the_cpu(
    gpu: &mut dyn splatblur::backend::Backend,
    cases: &[(&str, Prefilter, Shading)],
    opacity: f64,
) {
    for &(text, prefilter, shading) in cases {
        let mut scene = burst(7);
        scene.objects[0].opacity = opacity;
        let options = options(mode(text), prefilter, shading);
        let host = render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap().picture;
        let device = render_frame(gpu, &scene, 0, &options).unwrap().picture;
        let (worst, mean) = differing(&host, &device, 1e-3);
        println!("{text} {prefilter:?} {opacity}: {worst} differ, mean {mean:.1e}");
        assert!(worst < 200 && mean < 1e-4, "{text} {prefilter:?}: {worst} values differ, mean {mean:e}");
    }
}

// Not deep: the pictures of points with velocities on a GPU, at instants and in motion.
#[cfg(feature = "gpu")]
#[test]
fn the_gpu_moves_points_as_the_cpu_does() {
    let Some(mut gpu) = crate::support::gpu::gpu_or_skip("the_gpu_moves_points_as_the_cpu_does") else { return };
    let cases =
        [("supersample:4", Prefilter::Ewa, Shading::Phong), ("volumetric:3", Prefilter::Approx, Shading::Gouraud)];
    moves_points_as_on_the_cpu(&mut gpu, &cases, 1.0);
}

#[cfg(feature = "gpu")]
#[test]
#[ignore = "deep: whole pictures"]
fn the_gpu_moves_points_in_all_modes() {
    let Some(mut gpu) = crate::support::gpu::gpu_or_skip("the_gpu_moves_points_in_all_modes") else { return };
    let instants = [
        ("supersample:4", Prefilter::None, Shading::Gouraud),
        ("supersample:4", Prefilter::Ewa, Shading::Phong),
        ("bucket:2x2", Prefilter::Approx, Shading::Phong),
    ];
    moves_points_as_on_the_cpu(&mut gpu, &[instants[0], instants[2]], 1.0);
    moves_points_as_on_the_cpu(&mut gpu, &instants, 0.5);
    moves_points_as_on_the_cpu(&mut gpu, &[("volumetric:3", Prefilter::Ewa, Shading::Gouraud)], 1.0);
}

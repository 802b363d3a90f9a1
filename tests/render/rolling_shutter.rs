//! A rolling shutter: against closed forms, against the reference, and on both backends.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use glam::{DVec3, Vec3};
use splatblur::backend::BackendError;
use splatblur::backend::cpu::Cpu;
use splatblur::film::{Aov, Picture};
use splatblur::model::VelocityUnit;
use splatblur::options::{BlurMode, ErrorTarget, Look, PixelFilter, Prefilter, Quality, RenderOptions, Shading};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Light, Motion, Scene};
use splatblur::time::{Anchor, Direction, Readout};

use crate::support::{Random, UNLIT, object, rms, round_surfels, scene, sphere, sphere_scene};

fn readout(text: &str) -> Readout {
    text.parse().unwrap()
}

fn mode(text: &str) -> Quality {
    text.parse::<BlurMode>().unwrap().into()
}

fn options(quality: Quality, prefilter: Prefilter) -> RenderOptions {
    RenderOptions { quality, prefilter, ..RenderOptions::default() }
}

fn render(scene: &Scene, options: &RenderOptions) -> Picture {
    render_frame(&mut Cpu::default(), scene, 0, options).unwrap().picture
}

fn traced(scene: &Scene, samples: u64) -> Picture {
    let aovs = vec![Aov::Error];
    let options = ReferenceOptions {
        samples,
        look: Look { filter: PixelFilter::Box, aovs, ..Look::default() },
        ..ReferenceOptions::default()
    };
    reference::render(scene, 0, &options, None, &|_| ()).unwrap().picture
}

const PIXELS: [u32; 2] = [96, 80];
/// Pixels a frame.
const SPEED: f64 = 24.0;

/// A plate whose straight edge moves along the axis across the read-out, by `SPEED` pixels a frame. It is made of
/// squares of surfels, fine enough that the edge is straight.
fn moving_edge(readout: Readout) -> Scene {
    let across = 1 - readout.direction.axis();
    let spacing = 0.0125;
    let half = 110;
    let points = (-260..=0).flat_map(|i| (-half..=half).map(move |j| (f64::from(i), 2.0 * f64::from(j))));
    let turned = |(i, j): (f64, f64)| {
        let p = DVec3::new(i, j, 0.0) * spacing;
        // Towards +x, or towards -y: down in the image.
        if across == 0 { p } else { DVec3::new(p.y, -p.x, 0.0) }
    };
    let plate = round_surfels(points.map(|p| (turned(p), DVec3::Z, 3.0 * spacing, Vec3::ONE)));
    let mut plate = object(plate);
    plate.shape.surface_mut().unwrap().material = Some(UNLIT);
    let velocity = SPEED / 20.0;
    let velocity = if across == 0 { DVec3::X } else { DVec3::NEG_Y } * velocity;
    plate.motions = vec![Motion::Linear { velocity }];
    // 20 pixels to a unit: focal length 100, distance 5.
    let fovy = (2.0 * (f64::from(PIXELS[1]) / 200.0).atan()).to_degrees();
    let mut scene = scene(vec![plate], PIXELS, DVec3::new(0.0, 0.0, 5.0), fovy);
    (scene.shutter.open, scene.shutter.close) = (-0.05, 0.05);
    scene.shutter.readout = readout;
    scene
}

/// Where the edge stands in each row (or column), pixels: what is covered of it.
fn places(picture: &Picture, axis: usize) -> Vec<f64> {
    let [width, height] = [picture.width, picture.height];
    let at = |x: u32, y: u32| f64::from(picture.rgba[(y * width + x) as usize][0]);
    if axis == 1 {
        (0..height).map(|y| (0..width).map(|x| at(x, y)).sum()).collect()
    } else {
        (0..width).map(|x| (0..height).map(|y| at(x, y)).sum()).collect()
    }
}

/// An edge that moves by v pixels a frame leans by v times the read-out over the height, and stays straight.
// Not deep: the closed form of rolling shutters.
#[test]
fn a_moving_edge_leans() {
    for (text, direction, anchor) in [
        ("0.5", Direction::Down, Anchor::Middle),
        ("0.9,up", Direction::Up, Anchor::Middle),
        ("0.5,right,first", Direction::Right, Anchor::First),
        ("0.7,left", Direction::Left, Anchor::Middle),
    ] {
        let rolling = readout(text);
        assert_eq!((rolling.direction, rolling.anchor), (direction, anchor));
        let axis = direction.axis();
        // These two take long: each has one direction of each axis.
        let (finer, rays) = match direction {
            Direction::Down | Direction::Left => (true, false),
            Direction::Up | Direction::Right => (false, true),
        };
        let scene = moving_edge(rolling);
        // Discs reach 3 spacings beyond the last centres; between them the edge is .02 pixels short.
        let resting = 0.5 * f64::from(PIXELS[1 - axis]) + 0.75;
        // Measured: reference .03. 16 places in a pixel see an edge by eighths of a pixel, rolling or not (the test
        // below finds the same rows): .163; 64 see it to .063. The approximate filter widens outlines: by .52 pixels.
        let lean = |kind: &str, moved: &Picture, wider: f64, limit: f64| {
            let n = f64::from(PIXELS[axis]);
            let beside = places(moved, axis).into_iter().enumerate().map(|(i, place)| {
                let passed = (i as f64 + 0.5) / n;
                let passed =
                    if matches!(direction, Direction::Down | Direction::Right) { passed } else { 1.0 - passed };
                let origin = if anchor == Anchor::Middle { 0.5 } else { 0.0 };
                place - wider - resting - SPEED * rolling.duration * (passed - origin)
            });
            let worst = beside.map(f64::abs).fold(0.0, f64::max);
            println!("{text} {kind}: at most {worst:.4} pixels from its line");
            assert!(worst < limit, "{text} {kind}: {worst}");
        };
        for prefilter in [Prefilter::None, Prefilter::Approx, Prefilter::Ewa] {
            let options = options(mode("supersample:16"), prefilter);
            let wider = if prefilter == Prefilter::Approx { 0.52 } else { 0.0 };
            lean(&format!("{prefilter:?}"), &render(&scene, &options), wider, 0.17);
            if finer && prefilter == Prefilter::None {
                let options = RenderOptions { quality: mode("supersample:64"), ..options };
                lean("64 samples", &render(&scene, &options), wider, 0.1);
            }
        }
        if rays {
            lean("reference", &traced(&scene, 1024), 0.0, 0.1);
        }
    }
}

/// Each row is that of a picture which is exposed at once, when the row is.
// Not deep: it alone looks at single rows.
#[test]
fn a_row_is_exposed_at_its_own_time() {
    for (text, prefilter) in [("0.5", Prefilter::None), ("0.9,left", Prefilter::Ewa), ("0.7,up,first", Prefilter::Ewa)]
    {
        let rolling = readout(text);
        let axis = rolling.direction.axis();
        let options = options(mode("supersample:16"), prefilter);
        for make in [moving_edge as fn(Readout) -> Scene, |readout| lively(1, readout)] {
            let scene = make(rolling);
            let picture = render(&scene, &options);
            let size = [picture.width, picture.height];
            // One that is read early, and one late.
            for row in [3_u32, 75] {
                let mut at_once = make(rolling);
                at_once.shutter.readout.duration = 0.0;
                let delay = rolling.delay((f64::from(row) + 0.5) / f64::from(size[axis]));
                at_once.shutter.open += delay;
                at_once.shutter.close += delay;
                let at_once = render(&at_once, &options);
                let of_row = |picture: &Picture| -> Vec<[f32; 4]> {
                    let all = picture.rgba.iter().enumerate();
                    let place = |i: usize| [i % size[0] as usize, i / size[0] as usize][axis];
                    all.filter(|(i, _)| place(*i) == row as usize).map(|(_, pixel)| *pixel).collect()
                };
                let (a, b) = (of_row(&picture), of_row(&at_once));
                let squares = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2));
                let error = (squares.sum::<f64>() / (4.0 * a.len() as f64)).sqrt();
                println!("{text} {prefilter:?}, row {row}: {error:.5}");
                assert!(error < 0.012, "{text} {prefilter:?}, row {row}: {error}");
            }
        }
    }
}

/// Something that turns, something that moves by its own points, and a camera that pans, before a light that shines on
/// them.
fn lively(seed: u64, rolling: Readout) -> Scene {
    let mut random = Random(seed);
    let mut scene = sphere_scene(12_000, 96, true);
    scene.objects[0].motions = vec![
        Motion::Rotation { axis: random.direction(), per_frame: random.within(0.5, 2.0), centre: DVec3::ZERO },
        Motion::Linear { velocity: random.direction() * 0.6 },
    ];
    if seed == 2 {
        let mut model = sphere(12_000).spatially_ordered();
        model.velocity = model.position.iter().map(|&p| p * 0.4 + Vec3::new(0.5, -0.3, 0.2)).collect();
        model.acceleration = vec![Vec3::new(0.0, -0.8, 0.0); model.len()];
        model.velocity_unit = VelocityUnit::Frame;
        scene.objects[0] = object(model);
        scene.objects[0].shape.surface_mut().unwrap().two_sided = true;
    }
    if seed == 3 {
        scene.objects[0].motions.truncate(1);
        scene.camera.motions =
            vec![Motion::Rotation { axis: DVec3::Y, per_frame: 0.15, centre: DVec3::new(0.0, 0.0, 4.0) }];
    }
    scene.lights.push(Light::point(DVec3::new(1.0, 1.5, 2.0), DVec3::new(2.0, 1.5, 1.0)).without_shadows());
    (scene.shutter.open, scene.shutter.close) = (-0.2, 0.2);
    scene.shutter.readout = rolling;
    scene
}

/// Root mean square of the difference in units of the reference's standard error, over the pixels that have one.
fn z_score(splatted: &Picture, truth: &Picture) -> f64 {
    let errors = &truth.layers[0].planes;
    let (mut sum, mut count) = (0.0, 0.0);
    for (i, (a, b)) in splatted.rgba.iter().zip(&truth.rgba).enumerate() {
        for c in 0..3 {
            if errors[c][i] > 2e-4 {
                sum += (f64::from(a[c] - b[c]) / f64::from(errors[c][i])).powi(2);
                count += 1.0;
            }
        }
    }
    f64::sqrt(sum / count)
}

/// The splatter is as far from the reference as without a rolling shutter. The reference takes each row's own times.
#[test]
#[ignore = "deep: many samples"]
fn rolling_pictures_are_those_of_the_reference() {
    for (seed, text) in [(1, "0.8"), (2, "0.6,up"), (3, "0.9,left,first")] {
        let z = |text: &str| {
            let scene = lively(seed, readout(text));
            let splatted = render(&scene, &options(mode("supersample:128"), Prefilter::None));
            let truth = traced(&scene, 128);
            (z_score(&splatted, &truth), rms(&splatted, &truth))
        };
        let (at_once, rolling) = (z("0"), z(text));
        println!(
            "scene {seed}, {text}: z {:.3} for {:.3}, RMS {:.5} for {:.5}",
            rolling.0, at_once.0, rolling.1, at_once.1
        );
        assert!(rolling.0 < 1.15 * at_once.0, "scene {seed}: {rolling:?} for {at_once:?}");
    }
}

/// Modes that share times, and filters, agree with one another.
// Not deep: it holds rolling pictures against the reference where the test above is left out.
#[test]
fn all_modes_with_samples_roll() {
    let scene = lively(1, readout("0.8"));
    let truth = traced(&scene, 256);
    let at_once = traced(&lively(1, readout("0")), 256);
    // Differences: what the readout makes of the picture is .1.
    assert!(rms(&truth, &at_once) > 0.05);
    let target: Quality = Quality::Error(ErrorTarget::default());
    for (quality, prefilter) in [
        (mode("supersample:16"), Prefilter::Ewa),
        (mode("supersample:16+interleave=2"), Prefilter::None),
        (mode("bucket:8x4"), Prefilter::Approx),
        (mode("bucket:8x4"), Prefilter::Ewa),
        (target, Prefilter::Ewa),
    ] {
        let options = options(quality, prefilter);
        let error = rms(&render(&scene, &options), &truth);
        let without = rms(&render(&lively(1, readout("0")), &options), &at_once);
        println!("{quality} {prefilter:?}: {error:.4}, without a read-out {without:.4}");
        assert!(error < 1.15 * without, "{quality} {prefilter:?}: {error} for {without}");
    }
    let mut sharp = scene.clone();
    (sharp.shutter.open, sharp.shutter.close) = (0.0, 1e-6);
    let still = rms(&render(&scene, &options(mode("still:16"), Prefilter::None)), &traced(&sharp, 256));
    println!("still: {still:.4}");
    assert!(still < 0.02, "{still}");
}

/// What rests looks the same where strips meet.
#[test]
fn what_rests_has_no_seams() {
    let mut scene = lively(1, readout("0"));
    let mut wall = scene.objects[0].clone();
    (wall.motions, wall.transform.translate) = (Vec::new(), DVec3::new(0.3, 0.2, -0.5));
    scene.objects.push(wall);
    // It spins so fast that each row is a strip, out of sight.
    let away = DVec3::new(9.0, 0.0, 0.0);
    scene.objects[0].motions = vec![Motion::Rotation { axis: DVec3::Y, per_frame: 60.0, centre: away }];
    scene.objects[0].transform.translate = away;
    let mut small = scene.objects[0].clone();
    small.transform.scale = DVec3::splat(0.01);
    small.transform.translate = DVec3::new(-1.2, -1.2, 0.0);
    small.motions = vec![Motion::Rotation { axis: DVec3::Z, per_frame: 60.0, centre: DVec3::new(-1.2, -1.15, 0.0) }];
    scene.objects.push(small);
    let mut rolling = scene.clone();
    rolling.shutter.readout = readout("0.9");
    for prefilter in [Prefilter::None, Prefilter::Approx, Prefilter::Ewa] {
        for shading in [Shading::Phong, Shading::Gouraud] {
            let options = RenderOptions {
                look: Look { shading, ..options(mode("supersample:4"), prefilter).look },
                ..options(mode("supersample:4"), prefilter)
            };
            let (a, b) = (render(&scene, &options), render(&rolling, &options));
            // The small one turns in the lower left.
            let rests = |i: usize| i % 96 > 40 || i / 96 < 60;
            let differs = a.rgba.iter().zip(&b.rgba).enumerate().filter(|(i, _)| rests(*i));
            let worst = differs
                .map(|(_, (a, b))| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max))
                .fold(0.0, f32::max);
            println!("{prefilter:?} {shading:?}: at most {worst:.2e}");
            assert!(worst < 1e-5, "{prefilter:?} {shading:?}: {worst}");
        }
    }
}

#[test]
fn volumetric_refuses_a_rolling_shutter() {
    let scene = lively(1, readout("0.5"));
    let result = render_frame(&mut Cpu::default(), &scene, 0, &options(mode("volumetric:3"), Prefilter::Ewa));
    assert!(matches!(result, Err(BackendError::RollingShutter)));
    let at_once = lively(1, readout("0,left,first"));
    let picture = render(&at_once, &options(mode("volumetric:3"), Prefilter::Ewa));
    assert_eq!(picture, render(&lively(1, Readout::default()), &options(mode("volumetric:3"), Prefilter::Ewa)));
}

/// Number of a scene, its read-out, how it is rendered, and the opacity of its first object.
#[cfg(feature = "gpu")]
type GpuCase = (u64, &'static str, Quality, Prefilter, f64);

#[cfg(feature = "gpu")]
fn rolls_as_on_the_cpu(gpu: &mut dyn splatblur::backend::Backend, cases: &[GpuCase]) {
    for &(seed, text, quality, prefilter, opacity) in cases {
        let mut scene = lively(seed, readout(text));
        (scene.image.width, scene.image.height) = (40, 40);
        if seed == 4 {
            scene = Scene::load("scenes/guitar_flight.xml").unwrap();
            scene.shutter.readout = readout(text);
            // Each of its strips sorts all Gaussians.
            (scene.image.width, scene.image.height) = (24, 16);
        }
        scene.objects[0].opacity = opacity;
        let options = RenderOptions {
            look: Look { aovs: vec![Aov::Depth, Aov::Normal], ..options(quality, prefilter).look },
            ..options(quality, prefilter)
        };
        let host = render(&scene, &options);
        let device = render_frame(gpu, &scene, 0, &options).unwrap().picture;
        let values = |picture: &Picture| -> Vec<f32> {
            let layers = picture.layers.iter().flat_map(|layer| layer.planes.iter().flatten());
            picture.rgba.iter().flatten().chain(layers).copied().collect()
        };
        let pairs = values(&host).into_iter().zip(values(&device));
        let differing = pairs.filter(|(a, b)| a != b && ((a - b).is_nan() || (a - b).abs() >= 1e-3)).count();
        println!("scene {seed} {text} {quality} {prefilter:?}: {differing} values differ by more than 1e-3");
        assert!(differing < 20, "scene {seed} {text} {quality} {prefilter:?}: {differing}");
    }
}

// Not deep: the one picture of a rolling shutter on a GPU.
#[cfg(feature = "gpu")]
#[test]
fn the_gpu_rolls_as_the_cpu_does() {
    let Some(mut gpu) = crate::support::gpu::gpu_or_skip("the_gpu_rolls_as_the_cpu_does") else { return };
    rolls_as_on_the_cpu(&mut gpu, &[(2, "0.6,left", mode("supersample:2"), Prefilter::Ewa, 1.0)]);
}

#[cfg(feature = "gpu")]
#[test]
#[ignore = "deep: whole pictures"]
fn the_gpu_rolls_as_the_cpu_does_in_all_modes() {
    let Some(mut gpu) = crate::support::gpu::gpu_or_skip("the_gpu_rolls_as_the_cpu_does_in_all_modes") else { return };
    let target: Quality = Quality::Error(ErrorTarget { error: 0.01, ..ErrorTarget::default() });
    let cases = [
        (1, "0.8", mode("supersample:2"), Prefilter::None, 1.0),
        (1, "0.8,up", mode("supersample:2+interleave=2"), Prefilter::Approx, 1.0),
        (3, "0.9,right", mode("bucket:1x2"), Prefilter::Ewa, 0.5),
        (1, "0.5", target, Prefilter::Ewa, 1.0),
        (4, "1,up", mode("supersample:2"), Prefilter::Ewa, 1.0),
    ];
    rolls_as_on_the_cpu(&mut gpu, &cases);
}

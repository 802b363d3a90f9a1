//! Blur modes against each other: equalities that follow from how a plan cuts the exposure.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use crate::support::closed_forms::{disc, edge, truth};
use crate::support::{UNLIT, object, render, round_surfels, scene, sphere_scene};
use glam::{DVec3, Vec3};
use splatblur::film::{Aov, Picture};
use splatblur::model::Surfels;
use splatblur::options::{BlurMode, Detail, Interleave, Look, PixelFilter, Prefilter, RenderOptions, Shading, Times};
use splatblur::scene::{Light, Motion, Scene};
use splatblur::time::Weight;

/// With all layers that should agree between modes.
fn options(mode: BlurMode) -> RenderOptions {
    let aovs = vec![Aov::Alpha, Aov::Depth, Aov::Normal, Aov::Velocity];
    RenderOptions {
        quality: mode.into(),
        prefilter: Prefilter::Approx,
        detail: Detail::Full,
        look: Look { aovs, ..Look::default() },
        ..RenderOptions::default()
    }
}

const fn bucket(buckets: u32, samples: u32) -> BlurMode {
    BlurMode::Bucket { buckets, samples, pixel_samples: None, interleave: Interleave::None, times: Times::Even }
}

fn values(picture: &Picture) -> Vec<f32> {
    let layers = picture.layers.iter().flat_map(|layer| layer.planes.iter().flatten());
    picture.rgba.iter().flatten().chain(layers).copied().collect()
}

/// Greatest difference; infinities must stand in the same places.
fn difference(a: &Picture, b: &Picture) -> f32 {
    values(a).iter().zip(values(b)).map(|(a, b)| if *a == b { 0.0 } else { (a - b).abs() }).fold(0.0, f32::max)
}

fn patch(half: f64, spacing: f64, colour: Vec3) -> Surfels {
    let n = (half / spacing) as i32;
    let points = (-n..=n).flat_map(|j| (-n..=n).map(move |i| DVec3::new(f64::from(i), f64::from(j), 0.0) * spacing));
    round_surfels(points.map(|p| (p, DVec3::Z, 2.0 * spacing, colour)))
}

/// A lit, turning and moving sphere before a wall.
fn busy() -> Scene {
    let mut scene = sphere_scene(30_000, 97, true);
    let mut wall = object(patch(2.0, 0.03, Vec3::new(0.2, 0.5, 0.3)));
    wall.transform.translate = DVec3::new(0.3, 0.0, -1.5);
    scene.objects.push(wall);
    scene.lights.push(Light::point(DVec3::new(1.0, 1.5, 2.0), DVec3::new(2.0, 1.5, 1.0)).without_shadows());
    scene
}

#[test]
fn buckets_of_one_sample_equal_supersampling() {
    let scene = busy();
    for shading in [Shading::Phong, Shading::Gouraud] {
        let with = |mode| {
            values(&render(&scene, &RenderOptions { look: Look { shading, ..options(mode).look }, ..options(mode) }))
        };
        assert!(with(bucket(6, 1)) == with(BlurMode::supersample(6)), "{shading:?}");
    }
}

#[test]
fn without_motion_all_modes_show_the_same() {
    let mut scene = busy();
    scene.objects[0].motions.clear();
    let point =
        |mode| RenderOptions { look: Look { filter: PixelFilter::Point, ..options(mode).look }, ..options(mode) };
    let still = render(&scene, &point(BlurMode::Still { pixel_samples: 1 }));
    for mode in [
        bucket(3, 4),
        BlurMode::interleaved(2, Interleave::Two),
        BlurMode::interleaved(1, Interleave::Four),
        BlurMode::Bucket {
            buckets: 2,
            samples: 2,
            pixel_samples: Some(5),
            interleave: Interleave::Two,
            times: Times::Even,
        },
    ] {
        let picture = render(&scene, &point(mode));
        // Depth of an ordinary pixel is about 5; sums run over up to 8 samples.
        let worst = difference(&still, &picture);
        assert!(worst < 4e-5, "{mode}: {worst}");
    }
}

/// The pixels of one class are those of plain supersampling with the class's own times.
#[test]
fn an_interleaved_class_is_supersampling_at_its_own_times() {
    for (prefilter, interleave) in [(Prefilter::None, Interleave::Two), (Prefilter::Approx, Interleave::Four)] {
        let mut scene = busy();
        let with = |scene: &Scene, mode| {
            render(
                scene,
                &RenderOptions {
                    prefilter,
                    look: Look { filter: PixelFilter::Point, ..options(mode).look },
                    ..options(mode)
                },
            )
        };
        let samples = 3;
        let picture = with(&scene, BlurMode::interleaved(samples, interleave));
        let s = interleave.stride();
        // Bayer order of the classes, row by row.
        let order: &[u32] = match interleave {
            Interleave::Four => &[0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5],
            _ => &[0, 2, 3, 1],
        };
        for (class, &place) in (0..s * s).zip(order) {
            let shift = ((f64::from(place) + 0.5) / f64::from(s * s) - 0.5) / f64::from(samples);
            (scene.shutter.open, scene.shutter.close) = (shift, 1.0 + shift);
            let plain = with(&scene, BlurMode::supersample(samples));
            let mut differ = 0;
            let (mut pixels, mut moving) = (0, 0);
            for y in (class / s..picture.height).step_by(s as usize) {
                for x in (class % s..picture.width).step_by(s as usize) {
                    let at = (y * picture.width + x) as usize;
                    let alike = (0..4).all(|c| (picture.rgba[at][c] - plain.rgba[at][c]).abs() < 1e-4);
                    let velocity = |picture: &Picture| picture.layers[3].planes[0][at];
                    let fast = velocity(&plain).abs() > 1.0;
                    let velocities_alike = (velocity(&picture) - velocity(&plain)).abs() < 2e-2;
                    differ += u32::from(!alike || fast && !velocities_alike);
                    pixels += 1;
                    moving += u32::from(fast);
                }
            }
            // Rounding decides whether a kernel's rim reaches a pixel: one sample's coverage, on a few silhouettes.
            assert!(moving > pixels / 10 && differ * 200 < pixels, "class {class}: {differ} of {pixels} ({moving})");
        }
        scene.shutter.open = 0.0;
    }
}

/// Closed forms (tests/data/truth/README.md): temporal alpha of 64 buckets of 4 samples within 2/255; over the pixel's
/// square, where each bucket has one sub-pixel position only, with 1024 of them.
#[test]
fn alpha_of_buckets_meets_the_closed_forms() {
    let cases = [("disc", disc(), [0.9, 0.5, 0.2]), ("edge", edge(), [0.3, 0.7, 0.95])];
    for (name, mut scene, colour) in cases {
        for (weight, filter) in [("box", "point"), ("ramp", "point"), ("box", "box"), ("ramp", "box")] {
            scene.shutter.weight = if weight == "box" { Weight::Box } else { Weight::Ramp { centre: 1.0 } };
            let filtered = if filter == "box" { PixelFilter::Box } else { PixelFilter::Point };
            let pixel_samples = (filter == "box").then_some(1024);
            let mode = BlurMode::Bucket {
                buckets: 64,
                samples: 4,
                pixel_samples,
                interleave: Interleave::None,
                times: Times::Even,
            };
            let options = RenderOptions {
                prefilter: Prefilter::None,
                look: Look { filter: filtered, ..options(mode).look },
                ..options(mode)
            };
            let picture = render(&scene, &options);
            let truth = truth(&format!("{name}_{weight}_{filter}"));
            let errors = picture.layers[0].planes[0].iter().zip(&truth).map(|(a, t)| (a - t[1] / colour[1]).abs());
            let worst = errors.fold(0.0, f32::max);
            println!("{name} {weight} {filter}: {:.2}/255", worst * 255.0);
            assert!(worst <= 2.0 / 255.0, "{name} {weight} {filter}: {:.2}/255", worst * 255.0);
        }
    }
}

/// Wolf 2008, fig. 3.7: with one visibility test, what the moving object hides at any time is hidden at all times.
#[test]
fn one_bucket_hides_what_the_mover_passes() {
    let mut front = object(patch(0.5, 0.02, Vec3::new(1.0, 0.0, 0.0)));
    front.shape.surface_mut().unwrap().material = Some(UNLIT);
    front.motions = vec![Motion::Linear { velocity: DVec3::new(2.0, 0.0, 0.0) }];
    let mut back = object(patch(3.0, 0.05, Vec3::new(0.0, 1.0, 0.0)));
    back.shape.surface_mut().unwrap().material = Some(UNLIT);
    back.transform.translate = DVec3::new(0.0, 0.0, -1.0);
    let mut scene = scene(vec![front, back], [64, 64], DVec3::new(0.0, 0.0, 4.0), 40.0);
    (scene.shutter.open, scene.shutter.close, scene.shutter.weight) = (-0.5, 0.5, Weight::Box);
    let centre = |mode| {
        let picture = render(
            &scene,
            &RenderOptions { look: Look { filter: PixelFilter::Point, ..options(mode).look }, ..options(mode) },
        );
        picture.rgba[32 * 64 + 32]
    };
    // The patch is 1 wide and passes 2 units: it covers the centre half of the time.
    let many = centre(bucket(16, 2));
    assert!((many[0] - 0.5).abs() < 0.07 && (many[1] - 0.5).abs() < 0.07, "{many:?}");
    // Nothing of the hidden half of the time is seen, but something covers.
    let one = centre(bucket(1, 32));
    assert!(one[0] > 0.9999 && one[1] == 0.0 && one[3] > 0.9999, "{one:?}");
}

/// A patch, red on the left and green on the right, moves left by its half width: the centre sees red, then green.
#[test]
fn samples_of_a_bucket_count_by_their_weights() {
    let mut surfels = patch(1.0, 0.02, Vec3::ZERO);
    for (colour, position) in surfels.colour.iter_mut().zip(&surfels.position) {
        *colour = if position.x < 0.5 { Vec3::X } else { Vec3::Y };
    }
    let mut mover = object(surfels);
    mover.shape.surface_mut().unwrap().material = Some(UNLIT);
    mover.motions = vec![Motion::Linear { velocity: DVec3::new(-1.0, 0.0, 0.0) }];
    let mut scene = scene(vec![mover], [33, 33], DVec3::new(0.0, 0.0, 4.0), 40.0);
    scene.shutter.weight = Weight::Ramp { centre: 1.0 };
    let picture = render(
        &scene,
        &RenderOptions {
            look: Look { filter: PixelFilter::Point, ..options(bucket(1, 32)).look },
            ..options(bucket(1, 32))
        },
    );
    let [red, green, _, alpha] = picture.rgba[16 * 33 + 16];
    // The ramp gives 1/4 to the first half of the exposure; the blend at the border lasts about a sample.
    assert!((red - 0.25).abs() < 0.03 && (green - 0.75).abs() < 0.03 && (alpha - 1.0).abs() < 1e-5, "{red} {green}");
}

#[test]
fn interleaved_samples_lie_within_their_pixels() {
    let mut scene = sphere_scene(20_000, 64, false);
    scene.image.transparent = true;
    let plain = render(&scene, &options(BlurMode::supersample(64)));
    let classes = render(&scene, &options(BlurMode::interleaved(64, Interleave::Two)));
    // 64 stratified positions in a pixel that an edge divides: 1/64 to 2/64; twice as wide a filter differs by up to
    // 1/8.
    let worst = plain.rgba.iter().zip(&classes.rgba).map(|(a, b)| (a[3] - b[3]).abs()).fold(0.0, f32::max);
    println!("{worst}");
    assert!(worst < 0.05 && plain.rgba.iter().any(|pixel| (0.2..0.8).contains(&pixel[3])), "{worst}");
}

#[test]
fn bytes_of_buckets_and_interleaving_depend_on_neither_threads_nor_memory() {
    let scene = busy();
    let models = scene.objects.iter().map(|object| object.shape.surfels().unwrap().surfels().bytes()).sum::<u64>();
    let mode = BlurMode::Bucket {
        buckets: 2,
        samples: 3,
        pixel_samples: Some(3),
        interleave: Interleave::Two,
        times: Times::Even,
    };
    let with = |threads: usize, memory: u64| -> Vec<u32> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
        let options = RenderOptions { memory, ..options(mode) };
        pool.install(|| values(&render(&scene, &options)).iter().map(|v| v.to_bits()).collect())
    };
    let plenty = with(1, 1 << 30);
    assert!(plenty == with(2, 1 << 30), "2 threads");
    assert!(plenty == with(3, models + 8_500_000), "3 threads, waves");
    assert!(plenty == with(2, models + 6_100_000), "2 threads, waves and bands");
}

#[test]
fn images_smaller_than_the_lattice_render() {
    for size in [[1, 1], [3, 2]] {
        let mut scene = busy();
        (scene.image.width, scene.image.height) = (size[0], size[1]);
        let picture = render(&scene, &options(BlurMode::interleaved(2, Interleave::Four)));
        assert!(picture.rgba.iter().all(|pixel| pixel[3] > 0.9), "{size:?}");
    }
}

#[test]
fn the_samples_layer_counts_time_samples() {
    let scene = sphere_scene(1_000, 9, true);
    for (mode, want) in [
        (BlurMode::Still { pixel_samples: 3 }, 3.0),
        (BlurMode::interleaved(5, Interleave::Two), 5.0),
        (
            BlurMode::Bucket {
                buckets: 2,
                samples: 3,
                pixel_samples: Some(5),
                interleave: Interleave::Four,
                times: Times::Even,
            },
            18.0,
        ),
    ] {
        let picture = render(
            &scene,
            &RenderOptions { look: Look { aovs: vec![Aov::Samples], ..options(mode).look }, ..options(mode) },
        );
        let layer = picture.layers.last().unwrap();
        assert!(layer.aov == Aov::Samples && layer.planes[0].iter().all(|&n| n == want), "{mode}");
    }
}

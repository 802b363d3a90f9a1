//! Mode auto: the error that it states is about the one that it has, and it keeps to what it is told.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may stop")]

use crate::support::{UNLIT, default_lights, object, scene, sphere};
use std::path::Path;

use glam::DVec3;
use splatblur::anim::{self, Interpolation};
use splatblur::backend::Backend;
use splatblur::backend::cpu::Cpu;
use splatblur::compare::encode;
use splatblur::film::{Aov, Picture};
use splatblur::frame::Frame;
use splatblur::model::Surfels;
use splatblur::options::{
    BlurMode, Detail, ErrorTarget, Interleave, Lattice, Look, PixelFilter, Prefilter, Quality, RenderOptions, Shading,
};
use splatblur::plan::{Exposure, Group, PositionExposure, RasterExposure, TimeSample};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::{Rendered, render_frame};
use splatblur::scene::{AnimationBinding, Light, Motion, Scene};
use splatblur::time::Weight;

/// A ball at rest, one that flies past before it, and one that spins.
fn balls() -> Scene {
    let placed = |surfels: usize, at: DVec3, motions: Vec<Motion>| {
        let mut ball = object(sphere(surfels).spatially_ordered());
        ball.transform.translate = at;
        ball.transform.scale = DVec3::splat(0.5);
        ball.motions = motions;
        ball
    };
    let still = placed(8000, DVec3::new(-0.5, -0.4, 0.0), Vec::new());
    let flying = placed(8000, DVec3::new(-0.9, 0.1, 0.9), vec![Motion::Linear { velocity: DVec3::new(1.3, 0.5, 0.0) }]);
    let centre = DVec3::new(0.7, -0.3, 0.0);
    let spin = Motion::Rotation { axis: DVec3::new(0.3, 1.0, 0.2).normalize(), per_frame: 0.9, centre };
    let spinning = placed(8000, centre, vec![spin]);
    let mut scene = scene(vec![still, flying, spinning], [160, 128], DVec3::new(0.0, 0.0, 4.0), 40.0);
    scene.lights = default_lights();
    scene
}

fn options(target: ErrorTarget, filter: PixelFilter) -> RenderOptions {
    let (prefilter, shading) = (Prefilter::None, Shading::Gouraud);
    RenderOptions {
        quality: Quality::Error(target),
        prefilter,
        detail: Detail::Full,
        look: Look { filter, shading, epsilon: Some(0.03), ..Look::default() },
        ..RenderOptions::default()
    }
}

fn render(scene: &Scene, options: &RenderOptions) -> Rendered {
    render_frame(&mut Cpu::default(), scene, 0, options).unwrap()
}

/// Root mean squared error of the display values. The two references' own errors are independent: their product has no
/// mean.
fn true_error(picture: &Picture, truths: &[Picture; 2]) -> f64 {
    let [shown, a, b] = [picture, &truths[0], &truths[1]].map(encode);
    let channel = |c: usize| {
        let products = shown[c].iter().zip(a[c].iter().zip(&b[c])).map(|(x, (a, b))| f64::from((x - a) * (x - b)));
        products.sum::<f64>() / shown[c].len() as f64
    };
    ((0..3).map(channel).sum::<f64>() / 3.0).sqrt()
}

fn with_error(error: f64) -> ErrorTarget {
    ErrorTarget { error, ..ErrorTarget::default() }
}

// Not deep: what mode auto promises.
#[test]
fn the_stated_error_is_the_true_one() {
    let mut scene = balls();
    // The depth tolerance is the scene's, so that the reference has the same.
    scene.objects.iter_mut().for_each(|object| object.epsilon = Some(0.03));
    for filter in [PixelFilter::Point, PixelFilter::Box] {
        let truths = [1, 2].map(|seed| {
            let options = ReferenceOptions {
                samples: 128,
                look: Look { seed, filter, shading: Shading::Gouraud, ..Look::default() },
                ..ReferenceOptions::default()
            };
            reference::render(&scene, 0, &options, None, &|_| ()).unwrap().picture
        });
        let mut last = f64::INFINITY;
        for error in [0.08, 0.04, 0.015] {
            let made = render(&scene, &options(with_error(error), filter));
            let stated = made.stats.achieved.unwrap().error;
            let ratio = stated / true_error(&made.picture, &truths);
            // Nine of ten random scenes lie within 1.0 and 2.3 (docs/measurements/scenes.md). At pixel centres the true
            // error of refined blocks falls faster than what the halves show: measured up to 3.12.
            println!("{filter:?} {error}: {stated:.4} {ratio:.3}");
            let most = if filter == PixelFilter::Point { 3.5 } else { 2.3 };
            assert!((0.95..most).contains(&ratio), "{filter:?} {error}: {stated} is {ratio} of the true error");
            assert!(stated <= error && stated < last, "{filter:?} {error}: {stated} after {last}");
            last = stated;
        }
    }
}

/// Light above white counts where it is asked for: here all is above white, so that a screen shows no error. With
/// `white` it is that of the picture which is exposed so that this light is white.
#[test]
fn light_above_white_is_stated() {
    const WHITE: f32 = 8.0;
    let mut scene = balls();
    scene.image.background = DVec3::splat(2.0);
    scene.lights = vec![Light::Ambient { colour: DVec3::ONE }];
    for object in &mut scene.objects {
        (object.epsilon, object.shape.surface_mut().unwrap().material) = (Some(0.03), Some(UNLIT));
        let mut surfels = Surfels::clone(object.shape.surfels().unwrap().surfels());
        surfels.colour.iter_mut().for_each(|colour| *colour = 1.0 + WHITE * *colour);
        object.shape = surfels.into();
    }
    let filter = PixelFilter::Box;
    let exposed = |mut picture: Picture| {
        picture.rgba.iter_mut().for_each(|[r, g, b, _]| (*r, *g, *b) = (*r / WHITE, *g / WHITE, *b / WHITE));
        picture
    };
    let truths = [1, 2].map(|seed| {
        let look = Look { seed, filter, shading: Shading::Gouraud, ..Look::default() };
        let options = ReferenceOptions { samples: 128, look, ..ReferenceOptions::default() };
        exposed(reference::render(&scene, 0, &options, None, &|_| ()).unwrap().picture)
    });
    for error in [0.04, 0.015] {
        let [on_a_screen, darker] = [1.0, f64::from(WHITE)].map(|white| {
            let made = render(&scene, &options(ErrorTarget { white, ..with_error(error) }, filter));
            (made.stats.achieved.unwrap().error, true_error(&exposed(made.picture), &truths))
        });
        println!("{error}: stated and true {on_a_screen:.4?}, with light above white {darker:.4?}");
        assert_eq!(on_a_screen.0, 0.0, "{error}");
        assert!(0.95 * darker.1 < darker.0 && darker.0 <= error, "{error}: {darker:?}");
        assert!(darker.1 < on_a_screen.1, "{error}: {darker:?} is no better than {on_a_screen:?}");
    }
}

/// Whatever the lattice, the stated error is not below the true one.
// Not deep: what mode auto promises.
#[test]
fn the_stated_error_holds_with_every_lattice() {
    let mut scene = balls();
    scene.objects.iter_mut().for_each(|object| object.epsilon = Some(0.03));
    let filter = PixelFilter::Box;
    let truths = [1, 2].map(|seed| {
        let options = ReferenceOptions {
            samples: 128,
            look: Look { seed, filter, shading: Shading::Gouraud, ..Look::default() },
            ..ReferenceOptions::default()
        };
        reference::render(&scene, 0, &options, None, &|_| ()).unwrap().picture
    });
    for (interleave, stride) in [(Interleave::None, 1), (Interleave::Two, 2), (Interleave::Four, 4)] {
        for error in [0.08, 0.025] {
            let target = ErrorTarget { interleave: Lattice::Fixed(interleave), ..with_error(error) };
            let made = render(&scene, &options(target, filter));
            let achieved = made.stats.achieved.unwrap();
            let ratio = achieved.error / true_error(&made.picture, &truths);
            println!("{stride} {error}: {:.4} {ratio:.3}", achieved.error);
            assert_eq!(achieved.interleave, stride);
            assert!((0.95..2.3).contains(&ratio), "{stride} {error}: {} is {ratio} of the true error", achieved.error);
            assert!(achieved.error <= error, "{stride} {error}: {}", achieved.error);
        }
    }
}

/// Pixels that are not those of `coarse`; and the largest distance of any value, layers included, from the nearer of
/// both pictures.
fn near_either(made: &Picture, fine: &Picture, coarse: &Picture) -> (usize, f32) {
    let far = |a: f32, b: f32| if a == b { 0.0 } else { (a - b).abs() / b.abs().max(1.0) };
    let values = |picture: &Picture| -> Vec<Vec<f32>> {
        let layers =
            picture.layers.iter().filter(|layer| layer.aov != Aov::Samples).flat_map(|layer| layer.planes.iter());
        let planes: Vec<&Vec<f32>> = layers.collect();
        let of_pixel = |at: usize| picture.rgba[at].into_iter().chain(planes.iter().map(|plane| plane[at])).collect();
        (0..picture.rgba.len()).map(of_pixel).collect()
    };
    let (mut fine_pixels, mut worst) = (0, 0.0_f32);
    for ((a, b), c) in values(made).iter().zip(&values(fine)).zip(&values(coarse)) {
        let distance = |b: &[f32]| a.iter().zip(b).map(|(&a, &b)| far(a, b)).fold(0.0, f32::max);
        fine_pixels += usize::from(distance(c) > 1e-3);
        worst = worst.max(distance(b).min(distance(c)));
    }
    (fine_pixels, worst)
}

/// Where all blocks are refined three times, the image is that of three times the samples: none is lost, none counts
/// twice.
#[test]
fn refinement_keeps_earlier_samples() {
    let scene = balls();
    let options = |target, filter| RenderOptions {
        look: Look { aovs: Aov::ALL.to_vec(), ..options(target, filter).look },
        ..options(target, filter)
    };
    let target = ErrorTarget { error: 1e-4, samples_max: 12, pixel_samples: 1, ..ErrorTarget::default() };
    let made = render(&scene, &options(target, PixelFilter::Point));
    let achieved = made.stats.achieved.unwrap();
    assert_eq!((achieved.samples, achieved.most_samples, achieved.interleave), (4, 12, 1));
    let target = ErrorTarget { samples_max: 75, ..target };
    let made = render(&scene, &options(target, PixelFilter::Point));
    let achieved = made.stats.achieved.unwrap();
    assert_eq!((achieved.samples, achieved.most_samples, achieved.interleave), (24, 72, 1));
    assert!(achieved.capped > 3 && achieved.capped == achieved.refined);
    let direct = RenderOptions { quality: BlurMode::supersample(72).into(), ..options(target, PixelFilter::Point) };
    let direct = render(&scene, &direct).picture;
    let coarse = RenderOptions { quality: BlurMode::supersample(24).into(), ..options(target, PixelFilter::Point) };
    let coarse = render(&scene, &coarse).picture;
    let (fine_pixels, worst) = near_either(&made.picture, &direct, &coarse);
    // Sums of 72 terms in another order. Blocks in which nothing moves are not refined: they equal the coarse image.
    assert!(fine_pixels > 1000 && worst < 1e-5, "{fine_pixels} pixels are refined; {worst} from both images");
}

/// With another weight each sample has the same share of the exposure, so finer strata reuse samples as with `box`.
#[test]
fn refinement_holds_for_other_weights() {
    const RATE: f64 = 6.0;
    let mut scene = balls();
    scene.shutter.weight = Weight::Exponential { rate: RATE, centre: 1.0 };
    let target = ErrorTarget { error: 1e-4, samples_max: 75, pixel_samples: 1, ..ErrorTarget::default() };
    let options = options(target, PixelFilter::Point);
    let made = render(&scene, &options).picture;
    // The share before t is (exp(6 t) - 1)/(exp(6) - 1).
    let direct = |n: u32| {
        let samples = (0..n).map(|i| {
            let share = (f64::from(i) + 0.5) / f64::from(n);
            let time = libm::log1p(share * libm::expm1(RATE)) / RATE;
            Group { samples: vec![TimeSample { time, weight: 1.0 / f64::from(n) }], sweep: None, number: 0 }
        });
        let position = PositionExposure { offset: [0.0; 2], groups: samples.collect() };
        let raster = RasterExposure { phase: [0; 2], positions: vec![position], positions_of_picture: 1 };
        let frame = Frame::exposed(&scene, 0.into(), &Exposure { stride: 1, rasters: vec![raster] }, &options);
        Cpu::default().render(frame).unwrap().picture
    };
    let (fine_pixels, worst) = near_either(&made, &direct(72), &direct(24));
    assert!(fine_pixels > 1000 && worst < 1e-5, "{fine_pixels} pixels are refined; {worst} from both images");
}

/// What the program knows it samples: an object that shows for 3 % of the exposure, wherever that is.
#[test]
fn a_short_appearance_is_seen_and_stated() {
    for from in [0.111, 0.5, 0.7] {
        let mut scene = balls();
        let curve = format!(
            "animVersion 1.1;\nmayaVersion 2008;\ntimeUnit film;\nlinearUnit cm;\nangularUnit deg;\nstartTime 0;\n\
             endTime 1;\nanim visibility visibility a 0 1 0;\nanimData {{\n input time;\n output unitless;\n \
             weighted 0;\n preInfinity constant;\n postInfinity constant;\n keys {{\n -1 0 step step 1 1 0;\n \
             {from} 1 step step 1 1 0;\n {} 0 step step 1 1 0;\n }}\n}}\n",
            from + 0.03
        );
        let animation = anim::parse(curve.as_bytes(), Path::new("blink.anim")).unwrap();
        let node = animation.node(None).unwrap().clone().into();
        scene.objects.truncate(1);
        let interpolation = Interpolation::default();
        scene.objects[0].animation = Some(AnimationBinding { path: "blink.anim".into(), node, interpolation });
        let made = render(&scene, &options(with_error(0.025), PixelFilter::Point));
        let mut shown = scene.clone();
        shown.objects[0].animation = None;
        let shown = render(&shown, &options(with_error(0.025), PixelFilter::Point)).picture;
        // The ball at rest, with a share of 0.03. Its interval ends where the key is, to rounding.
        let sums = [&made.picture, &shown].map(|picture| picture.rgba.iter().map(|p| f64::from(p[0])).sum::<f64>());
        let share = sums[0] / sums[1];
        assert!((share - 0.03).abs() < 1e-5, "from {from}: {share}");
    }
}

/// A ball that bounces while the shutter is open passes each place twice. Both half buffers see it fall and rise, so
/// what must be refined is.
#[test]
fn motion_that_turns_is_stated() {
    for turn in [0.0, -0.2, 0.35] {
        let mut scene = balls();
        let curve = format!(
            "animVersion 1.1;\nmayaVersion 2008;\ntimeUnit film;\nlinearUnit cm;\nangularUnit deg;\nstartTime -1;\n\
             endTime 1;\nanim translate.translateY translateY ball 0 1 0;\nanimData {{\n input time;\n \
             output linear;\n weighted 0;\n preInfinity constant;\n postInfinity constant;\n keys {{\n \
             -1 2 linear linear 1 1 0;\n \
             {turn} -0.2 linear linear 1 1 0;\n 1 2 linear linear 1 1 0;\n }}\n}}\n"
        );
        let animation = anim::parse(curve.as_bytes(), Path::new("bounce.anim")).unwrap();
        let node = animation.node(None).unwrap().clone().into();
        scene.objects.truncate(1);
        scene.objects[0].epsilon = Some(0.03);
        let interpolation = Interpolation::default();
        scene.objects[0].animation = Some(AnimationBinding { path: "bounce.anim".into(), node, interpolation });
        // At pixel centres the halves differ by their times alone.
        let filter = PixelFilter::Point;
        let truths = [1, 2].map(|seed| {
            let look = Look { seed, filter, shading: Shading::Gouraud, ..Look::default() };
            let options = ReferenceOptions { samples: 128, look, ..ReferenceOptions::default() };
            reference::render(&scene, 0, &options, None, &|_| ()).unwrap().picture
        });
        for (error, interleave) in [(0.05, Interleave::None), (0.025, Interleave::None), (0.05, Interleave::Two)] {
            let target = ErrorTarget { interleave: Lattice::Fixed(interleave), ..with_error(error) };
            let made = render(&scene, &options(target, filter));
            let (stated, true_error) = (made.stats.achieved.unwrap().error, true_error(&made.picture, &truths));
            let name = format!("turn at {turn}, {error}, {interleave}");
            println!("{name}: {stated:.4} stated, {true_error:.4} true");
            assert!(stated >= 0.9 * true_error, "{name}: {stated} stated, {true_error} true");
            // Measured: .0019 to .0094; where even and odd strata are the halves, .0046 to .0118. A lattice has few
            // samples at a pixel: .0202.
            let most = if interleave == Interleave::None { error / 5.0 } else { error / 2.0 };
            assert!(true_error < most, "{name}: {true_error}");
        }
    }
}

#[test]
fn what_does_not_move_costs_its_sub_pixel_positions() {
    let mut scene = balls();
    scene.objects.iter_mut().for_each(|object| object.motions.clear());
    let once = RenderOptions {
        quality: BlurMode::Still { pixel_samples: 1 }.into(),
        ..options(with_error(0.5), PixelFilter::Box)
    };
    let once = render(&scene, &once).stats.splats;
    let target = ErrorTarget { pixel_samples: 8, ..with_error(0.5) };
    let made = render(&scene, &options(target, PixelFilter::Box)).stats;
    // Half of them at a loose target, and twice those, as nothing moves.
    assert_eq!(made.achieved.unwrap().samples, 8);
    // A few more or less: small splats come and go with the position.
    assert!(made.splats.abs_diff(8 * once) * 10 < 8 * once, "{} and {once}", made.splats);
    let made = render(&scene, &options(with_error(0.01), PixelFilter::Point)).stats;
    assert_eq!((made.splats, made.achieved.unwrap().error), (2 * once, 0.0));
}

/// Where nothing moves there are no more samples than are allowed, and as many positions.
#[test]
fn what_does_not_move_keeps_to_the_limit() {
    let mut scene = balls();
    scene.objects.iter_mut().for_each(|object| object.motions.clear());
    let target = ErrorTarget { samples_max: 5, pixel_samples: 8, ..with_error(0.5) };
    let made = render(&scene, &options(target, PixelFilter::Box));
    let achieved = made.stats.achieved.unwrap();
    assert_eq!((achieved.samples, achieved.most_samples), (4, 4));
    let still =
        RenderOptions { quality: BlurMode::Still { pixel_samples: 4 }.into(), ..options(target, PixelFilter::Box) };
    assert!(worst_difference(&made.picture, &render(&scene, &still).picture) < 1e-5);
}

/// A static object beside moving ones is seen at as many positions as there are samples, spread over the pixel.
#[test]
fn positions_are_spread_however_few() {
    let mut scene = balls();
    scene.objects.remove(1);
    let target = ErrorTarget { pixel_samples: 8, ..with_error(0.5) };
    let mut made = render(&scene, &options(target, PixelFilter::Box));
    assert_eq!(made.stats.achieved.unwrap().most_samples, 4);
    let still =
        RenderOptions { quality: BlurMode::Still { pixel_samples: 4 }.into(), ..options(target, PixelFilter::Box) };
    let mut still = render(&scene, &still).picture;
    // The ball that spins lies in the right half.
    for picture in [&mut made.picture, &mut still] {
        picture.rgba.iter_mut().enumerate().filter(|(at, _)| at % 160 >= 84).for_each(|(_, pixel)| *pixel = [0.0; 4]);
    }
    assert!(worst_difference(&made.picture, &still) < 1e-5);
}

fn worst_difference(a: &Picture, b: &Picture) -> f32 {
    let pairs = a.rgba.as_flattened().iter().zip(b.rgba.as_flattened());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// The least memory, in steps of 64 KiB, with which a mode renders.
fn least_memory(backend: &mut dyn Backend, options: &RenderOptions) -> u64 {
    let scene = balls();
    let renders =
        |memory: &u64| render_frame(backend, &scene, 0, &RenderOptions { memory: *memory, ..options.clone() }).is_ok();
    (1_u64..1 << 16).map(|step| step << 16).find(renders).unwrap()
}

/// Beside the picture that is made, mode auto keeps three: the halves, and the other new one. On a GPU a second frame
/// is under way, with four.
fn counts_its_pictures(backend: &mut dyn Backend) {
    let aovs = vec![Aov::Depth];
    let options = RenderOptions {
        look: Look { aovs, ..options(with_error(0.5), PixelFilter::Point).look },
        ..options(with_error(0.5), PixelFilter::Point)
    };
    let one = least_memory(backend, &RenderOptions { quality: BlurMode::supersample(2).into(), ..options.clone() });
    let held = least_memory(backend, &options) - one;
    // Each frame under way has two older half buffers and two that are rendered. One is counted in both modes.
    let pictures = (4 * backend.in_flight() as u64 - 1) * 160 * 128 * 5 * 4;
    assert!(held.abs_diff(pictures) <= 1 << 16, "{held} of {pictures}");
}

#[test]
fn memory_is_that_of_all_pictures() {
    counts_its_pictures(&mut Cpu::default());
}

/// Samples and error of the layers are those that were reached, and all layers are means of all samples.
#[test]
fn layers_say_what_was_done() {
    let scene = balls();
    let aovs = Aov::LAYERS.to_vec();
    let options = RenderOptions {
        look: Look { aovs, ..options(with_error(0.05), PixelFilter::Box).look },
        ..options(with_error(0.05), PixelFilter::Box)
    };
    let made = render(&scene, &options);
    let achieved = made.stats.achieved.unwrap();
    let names: Vec<Aov> = made.picture.layers.iter().map(|layer| layer.aov).collect();
    assert_eq!(names, Aov::LAYERS);
    let plane = |aov: Aov| &made.picture.layers.iter().find(|layer| layer.aov == aov).unwrap().planes[0];
    let most = plane(Aov::Samples).iter().fold(0.0_f32, |a, &b| a.max(b));
    let least = plane(Aov::Samples).iter().fold(f32::INFINITY, |a, &b| a.min(b));
    assert_eq!([least, most], [achieved.samples as f32, achieved.most_samples as f32]);
    let squares: f64 = plane(Aov::Error).iter().map(|&e| f64::from(e).powi(2)).sum();
    let mean = (squares / plane(Aov::Error).len() as f64).sqrt();
    assert!((mean / achieved.error - 1.0).abs() < 1e-5, "{mean} and {}", achieved.error);
    let fine = RenderOptions {
        quality: BlurMode::supersample(256).into(),
        look: Look { aovs: Aov::ALL.to_vec(), ..options.look },
        ..options
    };
    let fine = render(&scene, &fine).picture;
    for (aov, most) in [(Aov::Alpha, 0.05), (Aov::Depth, 0.05), (Aov::Normal, 0.1)] {
        let other = &fine.layers.iter().find(|layer| layer.aov == aov).unwrap().planes[0];
        let alphas = plane(Aov::Alpha).iter().zip(&fine.layers[0].planes[0]);
        let inside = plane(aov).iter().zip(other).zip(alphas).filter(|(_, (a, b))| a.min(**b) > 0.9);
        let (sum, n) = inside.fold((0.0, 0), |(sum, n), ((a, b), _)| (sum + (a - b).abs(), n + 1));
        assert!(n > 1000 && sum / (n as f32) < most, "{aov:?}: mean difference {} of {n}", sum / n as f32);
    }
}

#[test]
fn threads_do_not_show() {
    let scene = balls();
    let made = |threads: usize| -> Picture {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&scene, &options(with_error(0.03), PixelFilter::Box)).picture)
    };
    assert!(made(1) == made(3));
}

#[cfg(feature = "gpu")]
#[test]
#[ignore = "deep: small buffers"]
fn memory_on_the_gpu_is_that_of_all_pictures() {
    let Some(mut gpu) = crate::support::gpu::gpu_or_skip("memory_on_the_gpu_is_that_of_all_pictures") else { return };
    counts_its_pictures(&mut gpu);
}

#[cfg(feature = "gpu")]
#[test]
#[ignore = "deep: whole pictures"]
fn the_gpu_takes_the_same_decisions() {
    let Some(mut gpu) = crate::support::gpu::gpu_or_skip("the_gpu_takes_the_same_decisions") else { return };
    let mut scene = balls();
    (scene.image.width, scene.image.height) = (80, 64);
    for filter in [PixelFilter::Point, PixelFilter::Box] {
        let options = RenderOptions {
            look: Look { aovs: Aov::LAYERS.to_vec(), ..options(with_error(0.05), filter).look },
            ..options(with_error(0.05), filter)
        };
        let (cpu, gpu) = (render(&scene, &options), render_frame(&mut gpu, &scene, 0, &options).unwrap());
        let (a, b) = (cpu.stats.achieved.unwrap(), gpu.stats.achieved.unwrap());
        assert!(a.refined > 0 && (a.samples, a.most_samples, a.refined) == (b.samples, b.most_samples, b.refined));
        // Both backends' pictures differ by rounding (docs/modes.md), and so do their estimates.
        assert!((a.error - b.error).abs() < 1e-6, "{} and {}", a.error, b.error);
        let far = cpu.picture.rgba.iter().zip(&gpu.picture.rgba).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f32::max);
        assert!(far < 1e-5, "{filter:?}: {far}");
    }
}

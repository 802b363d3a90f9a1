//! Full EWA of kernels in motion, against areas that are known and against samples at instants.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may report")]

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use splatblur::backend::cpu::Cpu;
use splatblur::film::Picture;
use splatblur::options::{
    BlurMode, KernelShape, Look, Normalise, PixelFilter, Prefilter, RenderOptions, SweptKernel, TemporalAlpha,
};
use splatblur::renderer::render_frame;
use splatblur::scene::{Motion, Object, Scene};

use crate::ewa::{SIZE, area, before_nothing, distance, places, random_ball, seen};
use crate::support::{round_surfels, sphere};

/// `object`, moving by `path` pixels about its place.
fn moving(mut object: Object, path: DVec3) -> Object {
    let path = path * DVec3::new(1.0, -1.0, 1.0);
    object.transform.translate -= 0.5 * path;
    object.motions = vec![Motion::Linear { velocity: path }];
    object
}

fn swept(intervals: u32, positions: Option<u32>) -> BlurMode {
    BlurMode::Volumetric { intervals, pixel_samples: positions, swept: SweptKernel::default() }
}

fn rendered(scene: &Scene, mode: BlurMode, filter: PixelFilter) -> Picture {
    let options = RenderOptions {
        quality: mode.into(),
        prefilter: Prefilter::Ewa,
        look: Look { filter, ..Look::default() },
        ..RenderOptions::default()
    };
    render_frame(&mut Cpu::default(), scene, 0, &options).unwrap().picture
}

/// Root of the mean square, and the worst, of all differences.
fn difference(a: &Picture, b: &Picture) -> (f32, f32) {
    let all = a.rgba.as_flattened().iter().zip(b.rgba.as_flattened()).map(|(a, b)| (a - b).abs());
    let all: Vec<f32> = all.collect();
    let square: f32 = all.iter().map(|d| d * d).sum();
    ((square / all.len() as f32).sqrt(), all.into_iter().fold(0.0, f32::max))
}

#[test]
fn without_motion_it_is_the_picture_of_an_instant() {
    for (n, radius) in [(20_000, 10.05), (2_000, 10.05), (500, 3.3)] {
        for positions in [1, 16] {
            let scene = before_nothing(vec![seen(sphere(n), [0.3, 0.1], radius)]);
            let got = rendered(&scene, swept(1, Some(positions)), PixelFilter::Box);
            let want = rendered(&scene, BlurMode::supersample(positions), PixelFilter::Box);
            let (rms, worst) = difference(&got, &want);
            println!("{n} surfels, {radius} px, {positions} positions: rms {rms:.5}, worst {worst:.4}");
            // At most .0038 and .116 with one position, .0008 and .021 with 16.
            let [most_rms, most] = if positions == 1 { [0.005, 0.15] } else { [0.001, 0.03] };
            assert!(rms <= most_rms && worst <= most, "{n} surfels, {positions} positions: {rms} {worst}");
        }
    }
}

#[test]
fn a_streak_has_the_area_of_its_ball() {
    let radius = 10.05 / (1.0 + (10.05 / distance()).powi(2)).sqrt();
    for (name, ball) in [("lattice", sphere(20_000)), ("random", random_ball(20_000))] {
        for (path, intervals) in [(0.0, 1), (0.0, 10), (2.0, 1), (12.0, 1), (12.0, 3), (12.0, 10)] {
            let mut offs = Vec::new();
            for (i, at) in places(4).enumerate() {
                let turned = DVec3::new((i as f64).cos(), (i as f64).sin(), 0.0) * path;
                let scene = before_nothing(vec![moving(seen(ball.clone(), at, radius), turned)]);
                offs.push((area(&rendered(&scene, swept(intervals, None), PixelFilter::Box)) / PI).sqrt() - 10.05);
            }
            let worst = offs.iter().copied().fold(0.0_f64, |a, b| if b.abs() > a.abs() { b } else { a });
            println!("{name}, {path} px in {intervals} intervals: radius off by {worst:.4} px at worst");
            // .022 at most.
            assert!(worst.abs() <= 0.03, "{name}, {path} px in {intervals} intervals");
        }
    }
}

#[test]
fn variants_have_the_area_too() {
    let radius = 10.05 / (1.0 + (10.05 / distance()).powi(2)).sqrt();
    let tube = SweptKernel::default();
    let ellipsoid = SweptKernel { shape: KernelShape::Ellipsoid, ..tube };
    // Over space, (15) of an ellipsoid is less than the kernel over its plane: the ball is cut out of the cylinder.
    let of_ellipsoid = 1.0 / (0.934_149_1 * 1.196_288);
    for (name, kernel, two_sided, share) in [
        ("two-sided", tube, true, 1.0),
        ("once", SweptKernel { normalise: Normalise::Once, ..tube }, false, 1.0),
        ("ellipsoid", ellipsoid, false, 1.0),
        ("sum", SweptKernel { alpha: TemporalAlpha::Sum, ..tube }, false, 1.0),
        ("ellipsoid, sum", SweptKernel { alpha: TemporalAlpha::Sum, ..ellipsoid }, false, of_ellipsoid),
    ] {
        for path in [0.0, 12.0] {
            let mut ball = moving(seen(sphere(20_000), [0.3, 0.1], radius), DVec3::new(0.8, 0.6, 0.0) * path);
            ball.shape.surface_mut().unwrap().two_sided = two_sided;
            let mode = BlurMode::Volumetric { intervals: 3, pixel_samples: None, swept: kernel };
            let got = area(&rendered(&before_nothing(vec![ball]), mode, PixelFilter::Box));
            let off = (got / (share * PI)).sqrt() - 10.05;
            println!("{name}, {path} px: radius off by {off:.4} px");
            // .027 at most.
            assert!(off.abs() <= 0.05, "{name}, {path} px: {off}");
        }
    }
}

#[test]
fn a_streak_is_that_of_many_instants() {
    for (n, path) in [(20_000, DVec3::X * 12.0), (2_000, DVec3::new(8.0, 9.0, 0.0)), (2_000, DVec3::Z * 900.0)] {
        let scene = before_nothing(vec![moving(seen(sphere(n), [0.3, 0.1], 8.0), path)]);
        let want = rendered(&scene, BlurMode::supersample(256), PixelFilter::Box);
        for intervals in [1, 3, 10] {
            let (rms, worst) = difference(&rendered(&scene, swept(intervals, None), PixelFilter::Box), &want);
            println!("{n} surfels, path {path}, {intervals} intervals: rms {rms:.5}, worst {worst:.4}");
            // One interval has .0037 at most. More have few sample positions each at outlines along the path: .016.
            assert!(rms <= if intervals == 1 { 0.005 } else { 0.02 }, "path {path}, {intervals} intervals: {rms}");
        }
    }
}

#[test]
fn a_tiny_ball_on_its_way_has_its_area() {
    let truth = PI * 0.01;
    for (filter, intervals) in [(PixelFilter::Box, 1), (PixelFilter::Box, 4), (PixelFilter::Point, 1)] {
        let sums: Vec<f64> = places(16)
            .enumerate()
            .map(|(i, at)| {
                let path = DVec3::new((0.4 * i as f64).cos(), (0.4 * i as f64).sin(), 0.0) * 10.0;
                let scene = before_nothing(vec![moving(seen(sphere(500), at, 0.1), path)]);
                area(&rendered(&scene, swept(intervals, None), filter)) / truth
            })
            .collect();
        let mean = sums.iter().sum::<f64>() / sums.len() as f64;
        let (least, most) = (sums.iter().copied().fold(9.0, f64::min), sums.iter().copied().fold(0.0, f64::max));
        println!("{filter} in {intervals} intervals: {mean:.3} of the area in the mean, {least:.3} to {most:.3}");
        assert!((mean - 1.0).abs() <= 0.1, "{filter}, {intervals} intervals: {mean:.3}");
    }
}

#[test]
fn surfaces_in_motion_have_no_holes() {
    let mut failed = 0;
    for (name, ball) in [("lattice", sphere(2_000)), ("random", random_ball(2_000))] {
        for shape in [KernelShape::Tube, KernelShape::Ellipsoid] {
            for zoom in [0.5, 1.0, 2.0, 4.0] {
                for (path, intervals) in [(0.0, 1), (3.0, 1), (3.0, 4)] {
                    let radius = 5.0 * zoom;
                    let scene = before_nothing(vec![moving(seen(ball.clone(), [0.2, 0.1], radius), DVec3::X * path)]);
                    let kernel = SweptKernel { shape, ..SweptKernel::default() };
                    let mode = BlurMode::Volumetric { intervals, pixel_samples: None, swept: kernel };
                    let picture = rendered(&scene, mode, PixelFilter::Box);
                    let mut least = 1.0_f32;
                    for (i, pixel) in picture.rgba.iter().enumerate() {
                        let (x, y) = ((i % SIZE as usize) as f64 - 23.7, (i / SIZE as usize) as f64 - 23.6);
                        if (x.abs() + 0.5 * path).hypot(y) < radius * 0.98 - 2.0 {
                            least = least.min(pixel[3]);
                        }
                    }
                    failed += u32::from(least < 254.0 / 255.0);
                    println!("{name} {shape}, radius {radius} px, path {path} px in {intervals}: alpha {least:.4}");
                }
            }
        }
    }
    assert!(failed == 0, "{failed} below");
}

#[test]
fn a_plate_behind_has_no_seam() {
    let spacing = 0.7;
    let cells = (0..80 * 80).map(|i| [f64::from(i % 80), f64::from(i / 80)].map(|k| (k - 39.5) * spacing));
    let surfels = cells.map(|[x, y]| (DVec3::new(x, y, 0.0), DVec3::Z, spacing, Vec3::new(0.2, 0.3, 0.8)));
    let mut wall = seen(round_surfels(surfels), [0.0, 0.0], 1.0);
    wall.transform.translate.z = -60.0;
    let ball = moving(seen(sphere(20_000), [0.3, 0.1], 10.05), DVec3::X * 9.0);
    let scene = before_nothing(vec![wall, ball]);
    let want = rendered(&scene, BlurMode::supersample(256), PixelFilter::Box);
    for intervals in [1, 3, 10] {
        let got = rendered(&scene, swept(intervals, None), PixelFilter::Box);
        let least = got.rgba.iter().map(|pixel| pixel[3]).fold(9.0, f32::min);
        let (rms, worst) = difference(&got, &want);
        println!("ball before a wall, {intervals} intervals: alpha {least:.4}, rms {rms:.5}, worst {worst:.4}");
        // .0065 with one interval, .014 with three.
        assert!(least >= 254.0 / 255.0 && rms <= 0.018, "{intervals} intervals: {least} {rms}");
    }
}

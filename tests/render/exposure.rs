//! What holds of the exposure in every blur mode: time weights, jumps, who moves, what does not blur, sub-pixel
//! positions.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use crate::support::closed_forms::{DEPTH, FOCAL, SIZE, disc, edge, moving, truth, world};
use crate::support::{UNLIT, animation, object, render, round_surfels, scene, sphere_scene};
use glam::{DVec3, Vec3};
use splatblur::film::{Aov, Picture};
use splatblur::model::Material;
use splatblur::options::{
    BlurMode, Interleave, KernelShape, Look, Normalise, PixelFilter, Prefilter, RenderOptions, SweptKernel, Times,
};
use splatblur::scene::{AnimationBinding, Light, Motion, Scene};
use splatblur::time::Weight;

const fn volumetric(intervals: u32, swept: SweptKernel) -> BlurMode {
    BlurMode::Volumetric { intervals, pixel_samples: None, swept }
}

fn ellipsoid() -> SweptKernel {
    SweptKernel { shape: KernelShape::Ellipsoid, ..SweptKernel::default() }
}

/// Random times against the statistics of a surface that covers a pixel for the share q of the exposure: N independent
/// times give alpha the mean q and the variance q (1 - q)/N. With one time in each stratum only the two strata with an
/// end of the cover vary: f (1 - f)/N^2 each, f the part of the stratum that is covered.
#[test]
fn random_times_have_the_variance_of_their_kind() {
    // The disc covers the centre of pixel (32, 32) from .3 to .7: strata 3 and 4 of 8, and .6 of 2 and of 5.
    let from = world(32.5, 32.5) - DVec3::new(1.0, 0.0, 0.0);
    let disc = round_surfels([(DVec3::ZERO, DVec3::Z, 0.4, Vec3::ONE)]);
    let scene = moving(disc, from, Motion::Linear { velocity: DVec3::new(2.0, 0.0, 0.0) });
    let seeds = 400;
    for (times, variance) in [(Times::Stratified, 2.0 * 0.6 * 0.4 / 64.0), (Times::Random, 0.4 * 0.6 / 8.0)] {
        for mode in [
            BlurMode::Supersample { samples: 8, pixel_samples: None, interleave: Interleave::None, times },
            BlurMode::Bucket { buckets: 4, samples: 2, pixel_samples: Some(2), interleave: Interleave::None, times },
        ] {
            let alpha = |seed| {
                let options =
                    RenderOptions { look: Look { seed, aovs: vec![Aov::Alpha], ..exact(mode).look }, ..exact(mode) };
                f64::from(render(&scene, &options).layers[0].planes[0][32 * 64 + 32])
            };
            let alphas: Vec<f64> = (0..seeds).map(alpha).collect();
            let mean = alphas.iter().sum::<f64>() / seeds as f64;
            let spread = alphas.iter().map(|alpha| (alpha - mean).powi(2)).sum::<f64>() / (seeds - 1) as f64;
            println!("{mode}: mean {mean:.4}, variance {spread:.5}, not {variance:.5}");
            assert!((mean - 0.4).abs() < 4.0 * (variance / seeds as f64).sqrt(), "{mode}: {mean}");
            // The standard error of a variance of 400 numbers is 7 %.
            assert!((spread / variance - 1.0).abs() < 0.3, "{mode}: {spread}, not {variance}");
        }
    }
}

const fn bucket(buckets: u32, samples: u32, interleave: Interleave) -> BlurMode {
    BlurMode::Bucket { buckets, samples, pixel_samples: None, interleave, times: Times::Even }
}

/// Each kind of mode, with `n` moments of the exposure or more: for a volumetric mode the 32nds of its intervals. And
/// the greatest share of a moment by which each end of a time span errs: half of one where the moment's middle decides,
/// 7/8 on a 2 x 2 lattice, whose classes stand at 1/8, 3/8, 5/8 and 7/8 of it.
fn modes(n: u32) -> [(BlurMode, f64, f64); 5] {
    let moments = f64::from(n);
    let intervals = n.div_ceil(32);
    [
        (BlurMode::supersample(n), moments, 0.5),
        (BlurMode::interleaved(n, Interleave::Two), moments, 0.875),
        (bucket(n / 4, 4, Interleave::None), moments, 0.5),
        (bucket(n / 4, 4, Interleave::Two), moments, 0.875),
        (volumetric(intervals, SweptKernel::default()), f64::from(32 * intervals), 0.5),
    ]
}

/// Those, and the volumetric kernels of Wolf (2008).
fn all_modes() -> impl Iterator<Item = BlurMode> {
    let others = [volumetric(2, ellipsoid()), volumetric(2, SweptKernel::PUBLISHED)];
    modes(64).map(|(mode, ..)| mode).into_iter().chain(others)
}

/// Pixel centres, object-space kernels alone.
fn exact(mode: BlurMode) -> RenderOptions {
    RenderOptions {
        quality: mode.into(),
        prefilter: Prefilter::None,
        look: Look { filter: PixelFilter::Point, aovs: vec![Aov::Alpha, Aov::Depth, Aov::Velocity], ..Look::default() },
        ..RenderOptions::default()
    }
}

fn plane(picture: &Picture, aov: Aov, channel: usize) -> &[f32] {
    let layer = picture.layers.iter().find(|layer| layer.aov == aov).expect("the AOV was asked for");
    &layer.planes[channel]
}

/// The integral of a(t) from 0 to t, by the definition of a(t) and the trapezoid rule.
struct Exposure(Vec<f64>);

impl Exposure {
    const STEPS: usize = 20_000;

    fn of(a: fn(f64) -> f64) -> Self {
        let mut sums = vec![0.0];
        for i in 0..Self::STEPS {
            let at = |i: usize| a(i as f64 / Self::STEPS as f64);
            sums.push(sums[i] + 0.5 * (at(i) + at(i + 1)));
        }
        let whole = sums[Self::STEPS];
        Self(sums.into_iter().map(|sum| sum / whole).collect())
    }

    fn until(&self, t: f64) -> f64 {
        let at = t.clamp(0.0, 1.0) * Self::STEPS as f64;
        let i = (at as usize).min(Self::STEPS - 1);
        self.0[i] + (self.0[i + 1] - self.0[i]) * (at - i as f64)
    }

    /// The greatest integral over a span of 1/n, times n.
    fn peak(&self, n: f64) -> f64 {
        let spans = (0..Self::STEPS).map(|i| i as f64 / Self::STEPS as f64);
        spans.map(|t| (self.until(t + 1.0 / n) - self.until(t)) * n).fold(0.0, f64::max)
    }
}

/// All time weights, each with its definition (docs/math.md, section 6), not normalised.
/// A weight and its formula.
type Weighing = (Weight, fn(f64) -> f64);

fn weights() -> [Weighing; 8] {
    [
        (Weight::Box, |_| 1.0),
        (Weight::Tent, |t| t.min(1.0 - t)),
        (Weight::Ramp { centre: 1.0 }, |t| t),
        (Weight::Ramp { centre: 0.3 }, |t| 1.0 - (t - 0.3).abs()),
        (Weight::Exponential { rate: 3.0, centre: 1.0 }, |t| (3.0 * (t - 1.0)).exp()),
        (Weight::OneMinusExponential { centre: 1.0 }, |t| 1.0 - (t - 1.0).exp()),
        (Weight::Gaussian { centre: 0.5, width: 0.2 }, |t| (-((t - 0.5) / 0.2).powi(2) / 2.0).exp()),
        (Weight::Curve(vec![(0.0, 0.0), (0.25, 2.0), (1.0, 1.0)]), |t| {
            if t < 0.25 { 8.0 * t } else { 2.0 - (t - 0.25) / 0.75 }
        }),
    ]
}

/// A disc on a straight line: when it covers a pixel's centre is the span between the roots of a quadratic.
#[test]
fn alpha_of_a_disc_is_the_closed_form_for_all_weights_in_all_modes() {
    let px = FOCAL / DEPTH;
    let from = [32.0 - 0.623_299_026_180_871_4 * px, 32.0 + 0.395_817_629_764_495_1 * px];
    let by = [1.255_681_308_218_397_7 * px, -0.846_230_794_669_920_3 * px];
    let radius = 0.426_300_136_884_289_36 * px;
    let covered = |x: f64, y: f64| {
        let (x, y) = (from[0] - x, from[1] - y);
        let (a, b, c) = (by[0] * by[0] + by[1] * by[1], x * by[0] + y * by[1], x * x + y * y - radius * radius);
        let root = (b * b - a * c).max(0.0).sqrt();
        [(-b - root) / a, (-b + root) / a]
    };
    for (weight, definition) in weights() {
        let exposure = Exposure::of(definition);
        for (mode, moments, share) in modes(128) {
            let mut scene = disc();
            scene.shutter.weight = weight.clone();
            let picture = render(&scene, &exact(mode));
            let alpha = plane(&picture, Aov::Alpha, 0);
            let (mut worst, mut mean) = (0.0_f64, 0.0);
            for (i, &alpha) in alpha.iter().enumerate() {
                let [first, last] = covered((i % SIZE) as f64 + 0.5, (i / SIZE) as f64 + 0.5);
                let want = exposure.until(last) - exposure.until(first);
                worst = worst.max((f64::from(alpha) - want).abs());
                mean += (f64::from(alpha) - want) / (SIZE * SIZE) as f64;
            }
            // Two ends, and rounding: a rim within 1e-4 radii of a pixel's centre.
            let most = 2.0 * share * exposure.peak(moments) / moments + 2e-3;
            println!("{weight:?} {mode}: max {worst:.2e} of {most:.2e}, mean {mean:.1e}");
            assert!(worst <= most, "{weight:?} {mode}: {worst:.2e}, not within {most:.2e}");
            // Rounding of ends has no side that it prefers.
            assert!(mean.abs() < 0.1 * most, "{weight:?} {mode}: mean {mean:.1e}");
        }
    }
}

/// A patch, red on the left and green on the right, moves left by its half width: the centre sees red, then green.
#[test]
fn colours_count_by_when_they_are_seen() {
    // Its middle rows alone: others do not reach the centre.
    let grid = (-10..=10).flat_map(|j| (-50..=50).map(move |i| DVec3::new(f64::from(i), f64::from(j), 0.0) * 0.02));
    let colour = |p: DVec3| if p.x < 0.5 { Vec3::X } else { Vec3::Y };
    let mut mover = object(round_surfels(grid.map(|p| (p, DVec3::Z, 0.04, colour(p)))));
    mover.shape.surface_mut().unwrap().material = Some(UNLIT);
    mover.motions = vec![Motion::Linear { velocity: DVec3::new(-1.0, 0.0, 0.0) }];
    let mut scene = scene(vec![mover], [33, 33], DVec3::new(0.0, 0.0, 4.0), 40.0);
    for (weight, definition) in weights() {
        let exposure = Exposure::of(definition);
        scene.shutter.weight = weight.clone();
        // The border stands between columns 24 and 25 of the grid.
        let want = exposure.until(0.49);
        for intervals in [1, 3] {
            let once = SweptKernel { normalise: Normalise::Once, ..SweptKernel::default() };
            let once = (volumetric(intervals, once), f64::from(32 * intervals), 0.5);
            for (mode, moments, share) in modes(32 * intervals).into_iter().chain([once]) {
                let [red, green, blue, alpha] = render(&scene, &exact(mode)).rgba[16 * 33 + 16].map(f64::from);
                assert!((alpha - 1.0).abs() < 1e-5 && blue == 0.0, "{weight:?} {mode}: {alpha} {blue}");
                assert!((red + green - 1.0).abs() < 1e-5, "{weight:?} {mode}: {red} {green}");
                // Samples switch at moments; a volumetric mode's colours do not, but it draws a(t) as a line over each
                // interval. The blend of kernels of both colours is as long before the border as after it: over its
                // +-0.04 a(t) is nearly a line.
                let coarse = if mode.swept().is_some() {
                    line_error(&exposure, 0.49, intervals)
                } else {
                    share * exposure.peak(moments) / moments
                };
                // Normalised once, an interval counts by the sum of its weights, too, where both are seen: measured
                // .0112.
                let pooled = mode.swept().is_some_and(|swept| swept.normalise == Normalise::Once);
                let most = coarse + if pooled { 0.015 } else { 2e-3 };
                println!("{weight:?} {mode}: red {red:.4}, not {want:.4}; {:.4} of {most:.4}", (red - want).abs());
                assert!((red - want).abs() < most, "{weight:?} {mode}: {red}, not {want}");
            }
        }
    }
}

/// How far the integral of a(t) up to `t` lies from that of the line which stands for a(t) in one of `intervals`
/// intervals: the line with a's integral in each half, but nowhere below 0 (docs/math.md, section 7).
fn line_error(exposure: &Exposure, t: f64, intervals: u32) -> f64 {
    let n = f64::from(intervals);
    let from = (t * n).floor() / n;
    let within = |a: f64, b: f64| exposure.until(from + b / n) - exposure.until(from + a / n);
    let (early, late) = (within(0.0, 0.5), within(0.5, 1.0));
    let slope = (2.0 * (late - early) / (early + late)).clamp(-1.0, 1.0);
    let share = (t - from) * n;
    let line = (early + late) * (share + slope * share * (share - 1.0));
    (within(0.0, share) - line).abs()
}

/// A camera at (x, 0, 4) that pans and rises.
fn moving_camera() -> AnimationBinding {
    animation(&[
        ("translate.translateX", &[(0.0, 0.0), (1.0, -0.6)], "linear"),
        ("translate.translateY", &[(0.0, 0.0), (1.0, 0.1)], "linear"),
        ("translate.translateZ", &[(0.0, 4.0), (1.0, 3.7)], "linear"),
        ("rotate.rotateY", &[(0.0, 0.0), (1.0, -6.0)], "linear"),
    ])
}

/// The sphere in its colours alone, so that lights, which stay where they are, do not tell who moves.
fn unlit_sphere() -> Scene {
    let mut scene = sphere_scene(20_000, 96, false);
    scene.objects[0].shape.surface_mut().unwrap().material = Some(UNLIT);
    scene.image.transparent = true;
    scene
}

#[test]
fn a_moving_camera_blurs_like_moving_objects() {
    let mut with_camera = unlit_sphere();
    with_camera.camera.animation = Some(moving_camera());
    let mut with_object = unlit_sphere();
    let eye = DVec3::new(0.0, 0.0, 4.0);
    with_object.objects[0].motions = vec![
        Motion::Linear { velocity: DVec3::new(0.6, -0.1, 0.3) },
        Motion::Rotation { axis: DVec3::Y, per_frame: 6_f64.to_radians(), centre: eye },
    ];
    for mode in all_modes() {
        let options = RenderOptions { prefilter: Prefilter::Approx, ..exact(mode) };
        let [a, b] = [&with_camera, &with_object].map(|scene| render(scene, &options));
        let unlike = |x: f32, y: f32| (x - y).abs() > 2e-4 * x.abs().max(1.0);
        let mut differ = 0;
        let mut partly = 0;
        for i in 0..a.rgba.len() {
            let velocity = |picture: &Picture, c| plane(picture, Aov::Velocity, c)[i];
            let alike = (0..4).all(|c| !unlike(a.rgba[i][c], b.rgba[i][c]))
                && (0..2).all(|c| (velocity(&a, c) - velocity(&b, c)).abs() < 0.05);
            differ += usize::from(!alike);
            partly += usize::from((0.1..0.9).contains(&a.rgba[i][3]));
        }
        // Transforms are rounded to f32 by different ways; where a rim then lies on the other side of a pixel's centre,
        // a moment of the silhouette changes.
        println!("{mode}: {differ} of {} differ, {partly} half covered", a.rgba.len());
        assert!(differ * 500 < a.rgba.len() && partly > 200, "{mode}: {differ} differ, {partly} half covered");
    }
}

/// `blur="false"`: object and camera stand where they are at the frame number, beside what blurs.
#[test]
fn objects_without_blur_do_not_move_in_any_mode() {
    let mut scene = unlit_sphere();
    scene.camera.animation = Some(moving_camera());
    scene.objects[0].motions = vec![Motion::Linear { velocity: DVec3::new(-0.7, 0.4, -0.5) }];
    let mut sharp = scene.objects[0].clone();
    sharp.blur = false;
    // Far to the left, where nothing else comes.
    scene.objects[0].transform.translate = DVec3::new(3.0, 0.0, -3.0);
    sharp.transform.translate = DVec3::new(-1.6, 0.0, -3.0);
    scene.objects.push(sharp);
    let mut resting = scene.clone();
    resting.camera.animation = None;
    resting.objects.iter_mut().for_each(|object| object.motions.clear());
    for mode in all_modes() {
        let [picture, still] = [&scene, &resting].map(|scene| render(scene, &exact(mode)));
        let (mut sharp, mut blurred) = (0.0_f32, 0.0_f32);
        for (i, (a, b)) in still.rgba.iter().zip(&picture.rgba).enumerate() {
            let difference = (0..4).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
            let speed = plane(&picture, Aov::Velocity, 0)[i].abs();
            if i % 96 < 48 {
                sharp = sharp.max(difference).max(speed);
            } else {
                blurred = blurred.max(difference);
            }
        }
        println!("{mode}: sharp {sharp:.1e}, blurred {blurred:.2}");
        assert!(sharp < 2e-5 && blurred > 0.5, "{mode}: {sharp} {blurred}");
    }
}

/// A disc that stands at the left until 0.4, then at the right: a step key, or two objects of which one is hidden.
#[test]
fn a_teleport_shows_both_places_and_nothing_between() {
    let patch = || {
        let grid = (-10..=10).flat_map(|j| (-10..=10).map(move |i| DVec3::new(f64::from(i), f64::from(j), 0.0) * 0.02));
        let mut patch = object(round_surfels(grid.map(|p| (p, DVec3::Z, 0.03, Vec3::ONE))));
        patch.shape.surface_mut().unwrap().material = Some(UNLIT);
        patch
    };
    let mut steps = patch();
    steps.animation = Some(animation(&[("translate.translateX", &[(0.0, -1.0), (0.4, 1.0)], "step")]));
    let mut hides = patch();
    hides.transform.translate.x = -1.0;
    hides.animation = Some(animation(&[("visibility", &[(0.0, 1.0), (0.4, 0.0)], "step")]));
    let mut appears = patch();
    appears.transform.translate.x = 1.0;
    appears.animation = Some(animation(&[("visibility", &[(0.0, 0.0), (0.4, 1.0)], "step")]));
    for (what, objects) in [("step", vec![steps]), ("visibility", vec![hides, appears])] {
        let mut scene = scene(objects, [64, 64], DVec3::new(0.0, 0.0, 4.0), 40.0);
        for (weight, definition) in weights() {
            scene.shutter.weight = weight.clone();
            let want = Exposure::of(definition).until(0.4);
            for intervals in [1, 3, 10] {
                for swept in [SweptKernel::default(), ellipsoid()] {
                    let picture = render(&scene, &exact(volumetric(intervals, swept)));
                    let pixel = |x: usize| f64::from(plane(&picture, Aov::Alpha, 0)[32 * 64 + x]);
                    // At depth 4 a unit is 22 pixels.
                    let (left, right) = (pixel(10), pixel(53));
                    assert!((left - want).abs() < 1e-5, "{what} {weight:?} {intervals}: {left}, not {want}");
                    assert!((left + right - 1.0).abs() < 1e-5, "{what} {weight:?} {intervals}: {left} + {right}");
                    let colours = [10, 53].map(|x| f64::from(picture.rgba[32 * 64 + x][1]));
                    assert!((colours[0] - left).abs() < 1e-5 && (colours[1] - right).abs() < 1e-5);
                    assert!((16..48).all(|x| pixel(x) == 0.0), "{what} {weight:?} {intervals}: something between");
                }
            }
        }
    }
}

/// A bucket is shaded once, with the camera of its middle sample: a highlight on a wall that fills the image, before a
/// camera that pans.
#[test]
fn a_bucket_is_shaded_at_its_middle() {
    let grid = (-45..=45).flat_map(|j| (-45..=45).map(move |i| DVec3::new(f64::from(i), f64::from(j), 0.0) * 0.05));
    let mut wall = object(round_surfels(grid.map(|p| (p, DVec3::Z, 0.1, Vec3::splat(0.2)))));
    wall.shape.surface_mut().unwrap().material =
        Some(Material { ambient: 0.1, diffuse: 0.2, specular: 0.9, shininess: 40.0 });
    let mut still = scene(vec![wall], [48, 48], DVec3::new(0.0, 0.0, 4.0), 40.0);
    still.lights.push(Light::directional(DVec3::new(0.1, 0.0, -1.0).normalize(), DVec3::ONE).without_shadows());
    let mut panned = still.clone();
    panned.camera.animation = Some(animation(&[
        ("translate.translateZ", &[(0.0, 4.0), (1.0, 4.0)], "linear"),
        ("rotate.rotateY", &[(0.0, -4.0), (1.0, 4.0)], "linear"),
    ]));
    let want = render(&still, &exact(BlurMode::Still { pixel_samples: 1 })).rgba;
    let got = render(&panned, &exact(bucket(1, 3, Interleave::None))).rgba;
    let worst = got.iter().zip(&want).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f32::max);
    let [low, high] = want.iter().fold([1.0_f32, 0.0], |[low, high], p| [low.min(p[0]), high.max(p[0])]);
    println!("{worst:.1e}; from {low} to {high}");
    assert!(worst < 1e-4 && high > low + 0.5, "{worst}; from {low} to {high}");
}

/// Sub-pixel positions beyond the number of groups: the edge's closed form over the pixel's square, which few positions
/// miss.
#[test]
fn pixel_samples_approach_the_box_filter() {
    let truth = truth("edge_box_box");
    let of = |swept: bool, pixel_samples| {
        let mode = if swept {
            BlurMode::Volumetric { intervals: 2, pixel_samples, swept: SweptKernel::default() }
        } else {
            BlurMode::Bucket {
                buckets: 2,
                samples: 32,
                pixel_samples,
                interleave: Interleave::None,
                times: Times::Even,
            }
        };
        let picture = render(
            &edge(),
            &RenderOptions { look: Look { filter: PixelFilter::Box, ..exact(mode).look }, ..exact(mode) },
        );
        let pairs = plane(&picture, Aov::Alpha, 0).iter().zip(&truth);
        pairs.map(|(alpha, want)| (alpha - want[1] / 0.7).abs()).fold(0.0, f32::max)
    };
    for swept in [true, false] {
        let errors = [2, 8, 64, 256].map(|pixel_samples| of(swept, Some(pixel_samples)));
        println!("swept {swept}: {errors:.4?}");
        // The edge moves 38 pixels: within a pixel it gains 1/38 from side to side, in two strips 1/76 off centre at
        // the most.
        // 128 positions in each leave what 64 moments do: 1/64 in the bucket's case, half of that in the other.
        assert!(errors[3] < if swept { 0.004 } else { 0.01 }, "{errors:?}");
        assert!(errors[0] > 1.5 * errors[3] && errors.is_sorted_by(|a, b| a >= b), "{errors:?}");
    }
}

/// A surface that is hidden at a time covers all the same, as does what hides it: one depth test for many times takes
/// nothing from alpha, and leaves no colour out.
#[test]
fn coverage_does_not_depend_on_the_depth_test() {
    let mut scene = unlit_sphere();
    scene.objects[0].motions = vec![Motion::Linear { velocity: DVec3::new(0.5, 0.2, 0.0) }];
    let mut other = scene.objects[0].clone();
    other.motions = vec![Motion::Linear { velocity: DVec3::new(-0.8, -0.3, 1.2) }];
    other.transform.translate = DVec3::new(0.7, 0.1, -1.4);
    scene.objects.push(other);
    let of = |mode| render(&scene, &exact(mode)).rgba;
    // Two modes for each set of moments.
    let buckets = [BlurMode::supersample(64), bucket(16, 4, Interleave::None)];
    let swept = [BlurMode::supersample(128), volumetric(4, SweptKernel::default())];
    for [mode, moments] in [buckets, swept].map(|[moments, mode]| [mode, moments]) {
        let (got, want) = (of(mode), of(moments));
        let differ = got.iter().zip(&want).filter(|(got, want)| (got[3] - want[3]).abs() > 1e-5).count();
        let partly = want.iter().filter(|pixel| (0.01..0.99).contains(&pixel[3])).count();
        // The sphere's colours have red 0.9 and 0.7, under an ambient light of 0.3.
        let darkest = got.iter().filter(|pixel| pixel[3] > 0.0).map(|pixel| pixel[0] / pixel[3]).fold(1.0, f32::min);
        println!("{mode}: alpha of {differ} of {partly} pixels differs from {moments}'s; darkest {darkest}");
        assert!(differ * 500 < partly && darkest > 0.2099, "{mode}: {differ} of {partly} differ; {darkest}");
    }
}

/// A surfel whose centre lies on the plane of the camera has no image there, and no velocity; what it covers is finite.
#[test]
fn velocity_is_finite_where_a_centre_lies_on_the_camera_plane() {
    let floor = |z: f64| {
        let mut floor = object(round_surfels([(DVec3::new(0.0, -0.5, z), DVec3::Y, 3.0, Vec3::ONE)]));
        floor.shape.surface_mut().unwrap().material = Some(UNLIT);
        floor.motions = vec![Motion::Linear { velocity: DVec3::new(0.7, 0.0, 0.0) }];
        floor
    };
    for (mode, ..) in modes(32) {
        let scene = scene(vec![floor(4.0), floor(4.5), floor(3.0)], [32, 32], DVec3::new(0.0, 0.0, 4.0), 40.0);
        let picture = render(&scene, &RenderOptions { prefilter: Prefilter::Approx, ..exact(mode) });
        let velocity = (0..2).flat_map(|c| plane(&picture, Aov::Velocity, c));
        assert!(velocity.clone().all(|v| v.is_finite()), "{mode}");
        assert!(velocity.clone().any(|v| *v > 1.0), "{mode}");
    }
}

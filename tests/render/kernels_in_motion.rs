//! Kernels in motion (docs/math.md, section 7): invariants, closed forms of temporal alpha, and how little the density
//! of a model matters.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use crate::support;
use crate::support::closed_forms::{SIZE, disc, edge, spin_of, truth};
use crate::support::{UNLIT, object, render, round_surfels, scene, sphere_scene};
use glam::{DVec3, Vec3};
use splatblur::film::{Aov, Picture};
use splatblur::options::{
    BlurMode, Interleave, Look, Normalise, Overlap, PixelFilter, Prefilter, RenderOptions, Shading, SweptKernel,
    TemporalAlpha, Times,
};
use splatblur::scene::{Motion, Scene};
use splatblur::time::Weight;

fn volumetric(intervals: u32) -> BlurMode {
    BlurMode::Volumetric { intervals, pixel_samples: None, swept: SweptKernel::default() }
}

fn options(mode: BlurMode) -> RenderOptions {
    RenderOptions {
        quality: mode.into(),
        prefilter: Prefilter::None,
        look: Look { aovs: Aov::ALL[..4].to_vec(), ..Look::default() },
        ..RenderOptions::default()
    }
}

fn values(picture: &Picture) -> Vec<f32> {
    let layers = picture.layers.iter().flat_map(|layer| layer.planes.iter().flatten());
    picture.rgba.iter().flatten().chain(layers).copied().collect()
}

/// Greatest difference; infinities must stand in the same places.
fn difference(a: &Picture, b: &Picture) -> f32 {
    values(a).iter().zip(values(b)).map(|(a, b)| if *a == b { 0.0 } else { (a - b).abs() }).fold(0.0, f32::max)
}

#[test]
fn without_motion_a_tube_is_the_splat() {
    for (surfels, size) in [(3_000, 200), (100_000, 100)] {
        let scene = sphere_scene(surfels, size, false);
        let with = |mode| {
            let options = RenderOptions {
                look: Look { filter: PixelFilter::Point, shading: Shading::Gouraud, ..options(mode).look },
                ..options(mode)
            };
            render(&scene, &options)
        };
        let worst = difference(&with(BlurMode::Still { pixel_samples: 1 }), &with(volumetric(3)));
        println!("{surfels} surfels: {worst:.1e}");
        assert!(worst < 1e-5, "{surfels} surfels: {worst}");
    }
}

/// A surfel that is seen exactly from its edge covers nothing: neither it nor the low-pass disc.
#[test]
fn an_edge_shows_nothing() {
    let mut edge_on = object(round_surfels([(DVec3::ZERO, DVec3::Y, 0.3, Vec3::ONE)]));
    edge_on.motions = vec![Motion::Linear { velocity: DVec3::Z }];
    let mut scene = scene(vec![edge_on], [33, 33], DVec3::new(0.0, 0.0, 5.0), 40.0);
    scene.image.transparent = true;
    for mode in [volumetric(3), BlurMode::supersample(3)] {
        for two_sided in [false, true] {
            let options = RenderOptions {
                look: Look { two_sided, filter: PixelFilter::Point, ..options(mode).look },
                ..options(mode)
            };
            assert!(render(&scene, &options).rgba.iter().all(|pixel| pixel[3] == 0.0), "{mode} {two_sided}");
        }
    }
}

/// A ball at rest, one that passes before it and one that passes behind, in one interval: the static one shows, and
/// hides, for as long as it does in 512 samples.
#[test]
fn static_objects_show_where_they_are() {
    let moving = |z: f64, way: f64| {
        let mut ball = object(support::sphere(6_000));
        ball.transform.scale = DVec3::splat(0.3);
        ball.transform.translate = DVec3::new(-0.5 * way, 0.0, z);
        ball.motions = vec![Motion::Linear { velocity: DVec3::X * way }];
        ball
    };
    let mut still = object(support::sphere(20_000));
    still.transform.scale = DVec3::splat(0.4);
    for (z, name) in [(0.8, "before"), (-1.0, "behind")] {
        let mut scene = scene(vec![moving(z, 1.5), still.clone()], [120, 60], DVec3::new(0.0, 0.0, 4.0), 25.0);
        scene.lights = support::default_lights();
        let with = |mode| {
            let point = RenderOptions {
                prefilter: Prefilter::None,
                look: Look { filter: PixelFilter::Point, ..options(mode).look },
                ..options(mode)
            };
            render(
                &scene,
                &RenderOptions { look: Look { shading: Shading::Gouraud, aovs: Vec::new(), ..point.look }, ..point },
            )
        };
        let (one, want) = (with(volumetric(1)), with(BlurMode::supersample(512)));
        let off: Vec<f32> = values(&one).iter().zip(values(&want)).map(|(a, b)| (a - b).abs()).collect();
        let mean = off.iter().sum::<f32>() / off.len() as f32;
        let far = off.iter().filter(|&&off| off > 0.1).count();
        println!("{name}: mean {mean:.5}, {far} of {} off by more than 0.1", off.len());
        assert!(mean < 0.002 && far < 30, "{name}");
    }
}

struct Error {
    rmse: f64,
    max: f64,
}

/// Error of temporal alpha on the pixels for which `counts(x, y)`. The truth images are colour times alpha over black.
fn alpha_error(mut scene: Scene, name: &str, weight: &str, colour: [f32; 3], mode: BlurMode) -> Error {
    scene.shutter.weight = match weight {
        "box" => Weight::Box,
        _ => Weight::Ramp { centre: 1.0 },
    };
    let options = RenderOptions {
        quality: mode.into(),
        prefilter: Prefilter::None,
        look: Look { filter: PixelFilter::Point, aovs: vec![Aov::Alpha], ..options(mode).look },
        ..options(mode)
    };
    let picture = render(&scene, &options);
    let truth = truth(&format!("{name}_{weight}_point"));
    let (mut sum, mut max) = (0.0, 0.0_f64);
    for (alpha, want) in picture.layers[0].planes[0].iter().zip(&truth) {
        let difference = f64::from(*alpha) - f64::from(want[0] / colour[0]);
        sum += difference * difference;
        max = max.max(difference.abs());
    }
    let error = Error { rmse: (sum / (SIZE * SIZE) as f64).sqrt(), max };
    println!("{name} {weight} {mode}: rmse {:.2e}, max {:.2e} = {:.2}/255", error.rmse, error.max, error.max * 255.0);
    error
}

#[test]
fn temporal_alpha_of_disc_and_edge() {
    for weight in ["box", "ramp"] {
        for (name, scene, colour) in [("disc", disc(), [0.9, 0.5, 0.2]), ("edge", edge(), [0.3, 0.7, 0.95])] {
            for n in [1, 4, 16] {
                let error = alpha_error(scene.clone(), name, weight, colour, volumetric(n));
                // Moments of an interval are 1/(32 n) apart; the ramp is twice the box at its end.
                let step = if weight == "box" { 1.0 } else { 2.0 } / f64::from(32 * n);
                assert!(error.max <= step + 1e-3, "{name} {weight} {n}: {}", error.max);
            }
        }
    }
}

/// A disc in two colours turns by 200 degrees: its alpha is 1 at all times, and its colours are the shares of the
/// exposure for which each is seen. Compared away from centre and rim, as tests/truth.rs does.
#[test]
fn colours_of_a_turning_disc() {
    let bucket = BlurMode::Bucket {
        buckets: 64,
        samples: 4,
        pixel_samples: None,
        interleave: Interleave::None,
        times: Times::Even,
    };
    for (weight, a) in [("box", Weight::Box), ("ramp", Weight::Ramp { centre: 1.0 })] {
        let truth = truth(&format!("spin_{weight}_point"));
        for mode in [bucket, volumetric(16)] {
            let mut scene = spin_of(0.4);
            scene.shutter.weight = a.clone();
            let options = RenderOptions {
                prefilter: Prefilter::None,
                look: Look { filter: PixelFilter::Point, ..options(mode).look },
                ..options(mode)
            };
            let picture = render(&scene, &options);
            let (mut sum, mut count, mut worst, mut bare) = (0.0, 0, 0.0_f64, 0.0_f32);
            for (i, (got, want)) in picture.rgba.iter().zip(&truth).enumerate() {
                let radius = ((i % SIZE) as f64 + 0.5 - 31.4).hypot((i / SIZE) as f64 + 0.5 - 33.2);
                if !(4.0..=20.0).contains(&radius) {
                    continue;
                }
                bare = bare.max((1.0 - got[3]).abs());
                for c in 0..3 {
                    let error = f64::from(got[c] - want[c]);
                    (sum, count, worst) = (sum + error * error, count + 1, worst.max(error.abs()));
                }
            }
            let rmse = (sum / f64::from(count)).sqrt();
            println!(
                "spin {weight} {mode}: alpha {bare:.1e}, rmse {rmse:.2e}, max {worst:.2e} = {:.2}/255",
                worst * 255.0
            );
            assert!(
                bare < 1e-5 && worst < 2.0 / 255.0,
                "spin {weight} {mode}: alpha {bare:.1e}, {:.2}/255",
                worst * 255.0
            );
        }
    }
}

/// A square of surfels that moves `travel` to the right, over the shutter's middle at the origin, seen from 4 away.
fn passing(half: f64, spacing: f64, travel: f64) -> Scene {
    let n = (half / spacing) as i32;
    let grid = (-n..=n).flat_map(|j| (-n..=n).map(move |i| DVec3::new(f64::from(i), f64::from(j), 0.0) * spacing));
    let mut patch = object(round_surfels(grid.map(|p| (p, DVec3::Z, 1.5 * spacing, Vec3::ONE))));
    patch.shape.surface_mut().unwrap().material = Some(UNLIT);
    patch.motions = vec![Motion::Linear { velocity: DVec3::new(travel, 0.0, 0.0) }];
    let mut scene = scene(vec![patch], [65, 65], DVec3::new(0.0, 0.0, 4.0), 40.0);
    (scene.shutter.open, scene.shutter.close) = (-0.5, 0.5);
    scene
}

/// An object that covers a pixel for a fraction q of a(t) gives alpha q, however densely it is sampled.
#[test]
fn alpha_is_the_share_of_the_exposure() {
    for spacing in [0.1_f64, 0.05, 0.02] {
        for n in [1, 2, 5] {
            let half = 0.5;
            let reach = (half / spacing).floor() * spacing;
            let scene = passing(half, spacing, 3.0);
            let options = RenderOptions {
                prefilter: Prefilter::None,
                look: Look { filter: PixelFilter::Point, ..options(volumetric(n)).look },
                ..options(volumetric(n))
            };
            let picture = render(&scene, &options);
            let alpha = f64::from(picture.layers[0].planes[0][32 * 65 + 32]);
            // Centres reach `reach` to both sides, discs 1.5 spacings further; in row 0 of the grid a disc's rim is at
            // its radius.
            let q = (2.0 * reach + 3.0 * spacing) / 3.0;
            assert!((alpha - q).abs() <= 1.0 / f64::from(32 * n), "spacing {spacing}, N = {n}: {alpha}, not {q}");
        }
    }
}

/// A kernel that is longer covers each of its places for less time. The kernels of several intervals, laid over each
/// other, cover the middle of the streak for as long as ever.
#[test]
fn overlap_makes_kernels_longer_not_heavier() {
    let scene = passing(0.5, 0.05, 3.0);
    // As above.
    let q = (1.0 + 0.15) / 3.0;
    let alpha = |intervals, overlap| {
        let swept = SweptKernel { overlap: Overlap(overlap), ..SweptKernel::default() };
        let mode = BlurMode::Volumetric { intervals, pixel_samples: None, swept };
        let picture = render(
            &scene,
            &RenderOptions {
                prefilter: Prefilter::None,
                look: Look { filter: PixelFilter::Point, ..options(mode).look },
                ..options(mode)
            },
        );
        f64::from(picture.layers[0].planes[0][32 * 65 + 32])
    };
    for overlap in [0.5, 0.75, 1.0, 2.0, 4.0] {
        let (got, want) = (alpha(1, overlap), q / (2.0 * overlap));
        assert!((got - want).abs() <= 1.0 / 32.0, "overlap {overlap}: {got}, not {want}");
    }
    for overlap in [0.5, 1.0, 1.5] {
        // Two ends in each of up to five intervals, each off by up to half a 32nd of a fifth.
        let got = alpha(5, overlap);
        assert!((got - q).abs() <= 1.0 / 32.0, "overlap {overlap}: {got}, not {q}");
    }
}

/// A surface that comes nearer than the camera's near plane covers until then.
#[test]
fn what_comes_nearer_than_the_near_plane_ends_there() {
    // Depth 1.5 to 0.1 in one exposure.
    let mut scene = passing(1.0, 0.1, 0.0);
    scene.objects[0].transform.translate = DVec3::new(0.0, 0.0, 3.2);
    scene.objects[0].motions = vec![Motion::Linear { velocity: DVec3::new(0.0, 0.0, 1.4) }];
    scene.camera.near = 0.5;
    for n in [1, 3] {
        let options = RenderOptions {
            prefilter: Prefilter::None,
            look: Look { filter: PixelFilter::Point, ..options(volumetric(n)).look },
            ..options(volumetric(n))
        };
        let alpha = f64::from(render(&scene, &options).layers[0].planes[0][32 * 65 + 32]);
        // Half a moment, as the end is rounded.
        assert!((alpha - 1.0 / 1.4).abs() <= 0.5 / f64::from(32 * n) + 1e-6, "N = {n}: {alpha}");
    }
}

/// Surfaces seen one after the other mix by the time for which each is seen, not by how densely they are sampled.
#[test]
fn dense_and_sparse_count_by_time() {
    let half = |spacing: f64, radius: f64, from: f64, colour: Vec3| {
        let n = (0.6 / spacing).round() as i32;
        let grid = (-n..=n).flat_map(|j| (0..n).map(move |i| (f64::from(i) + 0.5, f64::from(j))));
        let places = grid.map(|(i, j)| DVec3::new(from + i * spacing, j * spacing, 0.0));
        let mut patch = object(round_surfels(places.map(|p| (p, DVec3::Z, radius, colour))));
        patch.shape.surface_mut().unwrap().material = Some(UNLIT);
        patch.motions = vec![Motion::Linear { velocity: DVec3::new(3.0, 0.0, 0.0) }];
        patch
    };
    let mut scene = passing(0.1, 0.05, 0.0);
    scene.objects = vec![half(0.1, 0.1, -0.6, Vec3::X), half(0.02, 0.08, 0.0, Vec3::Y)];
    for n in [1, 2] {
        let options = RenderOptions {
            prefilter: Prefilter::None,
            look: Look { filter: PixelFilter::Point, ..options(volumetric(n)).look },
            ..options(volumetric(n))
        };
        let [red, green, ..] = render(&scene, &options).rgba[32 * 65 + 32];
        // Discs reach from -.65 to .05 and from -.07 to .67, with 3 and 50 over each point; where they overlap both are
        // seen. Measured: .436 and .495; kernels weigh by the mean normalisation of their model, whose rims have a part
        // in it.
        let share = f64::from(red / (red + green));
        println!("N = {n}: red {red:.4}, green {green:.4}, share of red {share:.3}");
        assert!((0.98 * 0.58 / 1.32..=0.70 / 1.32).contains(&share), "N = {n}: {share}");
    }
}

/// What moves together hides what it hides at rest, also where neither is at mid-interval: the depth test is at the
/// source (Wolf 2008, fig. 4.5).
#[test]
fn what_moves_along_behind_stays_hidden() {
    let mut scene = passing(0.4, 0.05, 3.0);
    let mut behind = passing(0.2, 0.05, 3.0).objects.remove(0);
    let mut red = splatblur::model::Surfels::clone(behind.shape.surfels().unwrap().surfels());
    red.colour.fill(Vec3::X);
    behind.shape = red.into();
    behind.transform.translate = DVec3::new(0.0, 0.0, -0.3);
    scene.objects.push(behind);
    for n in [1, 2, 5] {
        let options = RenderOptions {
            prefilter: Prefilter::None,
            look: Look { filter: PixelFilter::Point, ..options(volumetric(n)).look },
            ..options(volumetric(n))
        };
        for (i, [r, g, _, _]) in render(&scene, &options).rgba.iter().enumerate() {
            // White; of what is hidden 2^-24 is left.
            assert!((r - g).abs() < 1e-5, "N = {n}, pixel {} {}: {r} {g}", i % 65, i / 65);
        }
    }
}

/// A patch on an arc, in one interval: its line lies where the arc is on average, not on the chord, so that the
/// streak's centre of mass is that of supersampling.
#[test]
fn a_line_stands_for_its_arc() {
    let mut scene = passing(0.3, 0.05, 0.0);
    let axis = DVec3::Z;
    scene.objects[0].motions =
        vec![Motion::Rotation { axis, per_frame: 40_f64.to_radians(), centre: DVec3::new(0.0, -2.0, 0.0) }];
    let height = |mode| {
        let options = RenderOptions {
            prefilter: Prefilter::None,
            look: Look { filter: PixelFilter::Point, ..options(mode).look },
            ..options(mode)
        };
        let alpha = &render(&scene, &options).layers[0].planes[0];
        let moment: f64 = alpha.iter().enumerate().map(|(i, alpha)| f64::from(*alpha) * (i / 65) as f64).sum();
        moment / alpha.iter().map(|alpha| f64::from(*alpha)).sum::<f64>()
    };
    let (line, arc) = (height(volumetric(1)), height(BlurMode::supersample(512)));
    println!("rows {line:.3} and {arc:.3}");
    // The arc's radius is 44.6 pixels, so that its middle lies 2.7 above the chord, its mean 1.8. Simpson's rule errs
    // by the radius times 0.35^4/180, .004; the rest is pixels that the sum of 61 rows rounds by.
    assert!((line - arc).abs() < 0.05, "{line} {arc}");
}

/// Kernels of neighbouring surfels move together: a turning disc has no tears.
#[test]
fn nothing_tears_on_rotation() {
    for n in [3, 5, 8] {
        let scene = spin_of(0.8);
        let options = RenderOptions {
            prefilter: Prefilter::None,
            look: Look { filter: PixelFilter::Point, ..options(volumetric(n)).look },
            ..options(volumetric(n))
        };
        let alpha = &render(&scene, &options).layers[0].planes[0];
        // 200 degrees in n intervals: lines come as near to the centre as (2 + cos(100 / n degrees))/3 of the radius,
        // 21.3.
        let inner = 21.3 * (2.0 + (100.0 / f64::from(n)).to_radians().cos()) / 3.0 - 1.0;
        for (i, &alpha) in alpha.iter().enumerate() {
            let distance = ((i % SIZE) as f64 + 0.5 - 31.4).hypot((i / SIZE) as f64 + 0.5 - 33.2);
            assert!(distance > inner || (alpha - 1.0).abs() < 1e-5, "N = {n}, {distance} from the centre: {alpha}");
        }
    }
}

/// A sphere of `n` random surfels, with `cover` discs over each point on average.
fn random_sphere(n: usize, seed: u64, cover: f64) -> Scene {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let surfels = (0..n).map(|_| {
        let (z, phi) = (2.0 * next() - 1.0, std::f64::consts::TAU * next());
        let p = DVec3::new((1.0 - z * z).sqrt() * phi.cos(), (1.0 - z * z).sqrt() * phi.sin(), z);
        (p, p, 2.0 * (cover / n as f64).sqrt(), Vec3::ONE)
    });
    let mut sphere = object(round_surfels(surfels));
    sphere.shape.surface_mut().unwrap().material = Some(UNLIT);
    sphere.motions = vec![Motion::Linear { velocity: DVec3::new(1.5, 0.6, 0.0) }];
    sphere.transform.translate = DVec3::new(-0.75, -0.3, 0.0);
    scene(vec![sphere], [64, 64], DVec3::new(0.0, 0.0, 6.0), 40.0)
}

/// Issue 5, item 2: the density of a model does not show. Alpha is that of supersampling at the 512 moments of the
/// intervals, also where random surfels leave holes (between discs that cover each point four times on average 1.8 % of
/// the area).
// Not deep: what kernels in motion are for, against the closed form of alpha.
#[test]
fn density_does_not_show() {
    let alpha = |scene: &Scene, mode| {
        let options = RenderOptions {
            prefilter: Prefilter::None,
            look: Look { filter: PixelFilter::Point, ..options(mode).look },
            ..options(mode)
        };
        render(scene, &options).layers[0].planes[0].clone()
    };
    for (density, seed) in [(1, 11), (4, 13)] {
        for cover in [4.0, 9.0] {
            let scene = random_sphere(1500 * density, seed, cover);
            let swept = alpha(&scene, volumetric(16));
            let difference = |samples| {
                let want = alpha(&scene, BlurMode::supersample(samples));
                let streak = swept.iter().zip(&want).filter(|(got, want)| **got > 0.0 || **want > 0.0);
                let differences: Vec<f64> = streak.map(|(got, want)| f64::from((got - want).abs())).collect();
                255.0 * differences.iter().sum::<f64>() / differences.len() as f64
            };
            let at_moments = difference(512);
            println!(
                "{density}x, {cover} discs: mean difference from supersampling at the same moments {at_moments:.4}/255"
            );
            // A handful of 1400 pixels, where rounding decides for a moment, 0.5/255.
            assert!(at_moments < 0.005, "{density}x, {cover} discs: {at_moments}");
            if cover > 4.0 && density == 1 {
                // Without holes a pixel is entered and left once at the most, each time rounded by up to half of 1/512:
                // the mean of the sum's magnitude is 2/3 of 1/1024, of a single end 1/2 of it.
                let mean = difference(4096);
                println!("{density}x: from supersampling with 4096 samples {mean:.4}/255");
                assert!(mean < 255.0 / 1024.0 * 2.0 / 3.0, "{density}x: {mean}");
            }
        }
    }
}

/// A lit, turning and moving sphere that another one crosses.
fn busy() -> Scene {
    let mut scene = sphere_scene(20_000, 97, true);
    let mut other = scene.objects[0].clone();
    other.motions = vec![Motion::Linear { velocity: DVec3::new(0.0, -0.5, 1.0) }];
    other.transform.translate = DVec3::new(0.3, 0.2, -0.7);
    scene.objects.push(other);
    scene
}

#[test]
fn many_intervals_are_supersampling() {
    let scene = busy();
    let with = |mode| {
        let options = RenderOptions {
            look: Look { filter: PixelFilter::Point, shading: Shading::Gouraud, ..options(mode).look },
            ..options(mode)
        };
        render(&scene, &options)
    };
    let (swept, many) = (with(volumetric(64)), with(BlurMode::supersample(512)));
    let error = swept.rgba.iter().flatten().zip(many.rgba.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2));
    let rmse = (error.sum::<f64>() / (swept.rgba.len() * 4) as f64).sqrt();
    println!("64 intervals against 512 samples: rmse {rmse:.1e}");
    // Both cut time, the one every 1/64 with errors of first order in depth order and shading, the other at random
    // rims.
    assert!(rmse < 3e-3, "{rmse}");
    // Depth, normal and velocity: means over the exposure in both.
    for (a, b, tolerance) in [(1, 1, 0.02), (2, 2, 0.02), (3, 3, 0.5)] {
        for (a, b) in swept.layers[a].planes.iter().zip(&many.layers[b].planes) {
            let pairs: Vec<f32> =
                a.iter().zip(b).filter(|(a, b)| a.is_finite() && b.is_finite()).map(|(a, b)| (a - b).abs()).collect();
            let mean = pairs.iter().sum::<f32>() / pairs.len() as f32;
            assert!(mean < tolerance, "{mean} {tolerance}");
        }
    }
}

#[test]
fn what_does_not_blur_stays_sharp() {
    let mut scene = busy();
    scene.objects.iter_mut().for_each(|object| object.blur = false);
    let with = |mode| {
        let options = RenderOptions {
            look: Look { filter: PixelFilter::Point, shading: Shading::Gouraud, ..options(mode).look },
            ..options(mode)
        };
        render(&scene, &options)
    };
    let worst = difference(&with(BlurMode::Still { pixel_samples: 1 }), &with(volumetric(3)));
    assert!(worst < 2e-5, "{worst}");
}

#[test]
fn variants_differ_as_they_say() {
    let scene = busy();
    let with = |intervals, swept| {
        let mode = BlurMode::Volumetric { intervals, pixel_samples: None, swept };
        render(
            &scene,
            &RenderOptions { look: Look { filter: PixelFilter::Point, ..options(mode).look }, ..options(mode) },
        )
    };
    let default = SweptKernel::default();
    let once = SweptKernel { normalise: Normalise::Once, ..default };
    // One interval is normalised once in both; rounding, and normals that are made unit vectors before or after the
    // mean.
    let (a, b) = (with(1, default), with(1, once));
    let worst = a.rgba.iter().flatten().zip(b.rgba.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < 1e-5, "{worst}");
    assert!(difference(&with(4, default), &with(4, once)) > 0.01);
    for swept in [SweptKernel { alpha: TemporalAlpha::Sum, ..default }, SweptKernel::PUBLISHED] {
        let picture = with(3, swept);
        let alpha = &picture.layers[0].planes[0];
        assert!(alpha.iter().all(|alpha| (0.0..=1.0).contains(alpha)));
        assert!(alpha.contains(&1.0) && alpha.iter().any(|&alpha| alpha > 0.0 && alpha < 0.9));
    }
}

#[test]
fn bytes_depend_on_neither_threads_nor_memory() {
    let scene = busy();
    let models = scene.objects[0].shape.surfels().unwrap().surfels().bytes();
    let with = |threads: usize, memory: u64| -> Vec<u32> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
        let options = RenderOptions { memory, ..options(volumetric(3)) };
        pool.install(|| values(&render(&scene, &options)).iter().map(|v| v.to_bits()).collect())
    };
    let plenty = with(1, 1 << 30);
    assert!(plenty == with(3, 1 << 30));
    // So little that splats come in batches and the image in bands.
    for threads in [1, 2] {
        let least =
            (1..400).map(|step| models + (step << 18)).find(|&memory| fits(&scene, threads, memory)).expect("a size");
        println!("{threads} threads: least memory beside the models {} MiB", (least - models) >> 20);
        assert!(plenty == with(threads, least), "{threads} threads, {least} bytes");
    }
}

fn fits(scene: &Scene, threads: usize, memory: u64) -> bool {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
    let options = RenderOptions { memory, ..options(volumetric(3)) };
    let mut cpu = splatblur::backend::cpu::Cpu::default();
    pool.install(|| splatblur::renderer::render_frame(&mut cpu, scene, 0, &options).is_ok())
}

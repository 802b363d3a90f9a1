//! Volumes against the definition marched along rays in f64, and closed forms. None shares mathematics with the
//! renderer.

#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, reason = "tests may stop and report")]

use std::sync::Arc;

use glam::{DVec3, Quat, Vec3};
use splatblur::backend::BackendError;
use splatblur::backend::cpu::Cpu;
use splatblur::compare::flip;
use splatblur::film::{Aov, Picture};
use splatblur::model::{self, Gaussians, Kind, LoadOptions, Optics, TransferFunction, TransferStop, VolumeOptions};
use splatblur::options::{
    BlurMode, ErrorTarget, Interleave, Look, PixelFilter, Prefilter, Quality, RenderOptions, Times,
};
use splatblur::renderer::render_frame;
use splatblur::scene::{Camera, Motion, Object, Scene};

use crate::support::volumes::{VolumeCamera, picture, pixel as support_pixel};
use crate::support::{render, scene};

const FOVY: f64 = 40.0;
/// Depth of a layer, in distances of neighbours, as models have it.
const LAYER: f32 = 1.25;

fn unfiltered() -> RenderOptions {
    RenderOptions {
        quality: BlurMode::Still { pixel_samples: 1 }.into(),
        prefilter: Prefilter::None,
        look: Look { filter: PixelFilter::Point, ..Look::default() },
        ..RenderOptions::default()
    }
}

fn seen(objects: Vec<Object>, view: &VolumeCamera) -> Scene {
    let mut scene = scene(objects, view.size, view.eye, view.fovy);
    scene.camera = Camera { fovy: view.fovy.to_radians(), ..Camera::new(view.eye, view.at) };
    scene.image.transparent = true;
    scene
}

/// Kernels with these positions, masses and colours, of standard deviation `sigma`.
fn kernels(sigma: f32, layer: f32, each: impl Iterator<Item = (Vec3, f32, Vec3)>) -> Gaussians {
    let mut out = Gaussians { optics: Optics::Extinction { layer }, linear: true, ..Gaussians::default() };
    for (position, mass, colour) in each {
        out.position.push(position);
        out.sigma.push(Vec3::splat(sigma));
        out.rotation.push(Quat::IDENTITY);
        out.opacity.push(mass);
        out.base.push((colour - 0.5) / 0.282_094_8);
    }
    out
}

/// A field on a grid of `n`^3 cells in [-1, 1]^3: extinction and colour at a point. `kernel`: in spacings.
fn grid(n: usize, kernel: f32, layer: f32, field: impl Fn(Vec3) -> (f32, Vec3)) -> Gaussians {
    let spacing = 2.0 / n as f32;
    let at = |i: usize| (i as f32 + 0.5) * spacing - 1.0;
    let places = (0..n).flat_map(|z| (0..n).flat_map(move |y| (0..n).map(move |x| Vec3::new(at(x), at(y), at(z)))));
    let each = places.map(|p| {
        let (extinction, colour) = field(p);
        (p, extinction * spacing.powi(3), colour)
    });
    kernels(kernel * spacing, layer * spacing, each.filter(|(_, mass, _)| *mass > 0.0))
}

fn torus(p: Vec3) -> (f32, Vec3) {
    let ring = (p.x * p.x + p.z * p.z).sqrt() - 0.6;
    let d2 = (ring * ring + p.y * p.y) / (0.22 * 0.22);
    let density = 10.0 * (-2.0 * d2).exp();
    (if density > 0.02 { density } else { 0.0 }, Vec3::new(0.9, 0.5 + 0.4 * p.x, 0.3 - 0.3 * p.y))
}

fn ball(p: Vec3) -> (f32, Vec3) {
    let r = p.length();
    let edge = ((0.8 - r) / 0.1).clamp(0.0, 1.0);
    (6.0 * edge * edge * (3.0 - 2.0 * edge), if r < 0.5 { Vec3::new(0.9, 0.2, 0.1) } else { Vec3::new(0.2, 0.4, 0.9) })
}

fn worst(found: &Picture, want: &[[f64; 4]]) -> f64 {
    let each = found.rgba.iter().flatten().zip(want.iter().flatten());
    each.map(|(&found, want)| (f64::from(found) - want).abs()).fold(0.0, f64::max)
}

fn truth(found: &Picture, want: &[[f64; 4]]) -> Picture {
    Picture { rgba: want.iter().map(|pixel| pixel.map(|v| v as f32)).collect(), ..found.clone() }
}

fn assert_near(name: &str, found: &Picture, want: &[[f64; 4]], most: [f64; 2]) {
    let (worst, flip) = (worst(found, want), flip::mean(found, &truth(found, want)).unwrap());
    println!("{name}: worst {worst:.5}, FLIP {flip:.5}");
    assert!(worst < most[0] && flip < most[1], "{name}: worst {worst:.5}, FLIP {flip:.5}");
}

/// One kernel: what a ray meets of it is integrated step by step. On the axis the difference is what is cut off. Away
/// from it an affine image has no skew, as the true one has (Zwicker et al. 2002, figure 9): the error grows with the
/// angle at which the eye sees the kernel, and cancels where kernels overlap.
#[test]
fn a_kernel_is_its_integral_along_rays() {
    for (position, sigma, turn, most) in [
        (Vec3::ZERO, Vec3::splat(0.05), Quat::IDENTITY, 1e-4),
        (Vec3::ZERO, Vec3::new(0.02, 0.06, 0.03), Quat::from_rotation_x(0.7), 4e-3),
        (Vec3::new(0.9, -0.6, 0.3), Vec3::splat(0.05), Quat::IDENTITY, 2e-3),
        (Vec3::new(1.1, 0.7, 0.5), Vec3::new(0.05, 0.02, 0.05), Quat::from_rotation_z(0.5), 4e-3),
    ] {
        let mut kernel = kernels(0.0, 0.1, std::iter::once((position, 0.02, Vec3::new(0.9, 0.4, 0.2))));
        kernel.sigma[0] = sigma;
        kernel.rotation[0] = turn;
        let view = VolumeCamera { eye: DVec3::new(0.0, 0.0, 8.0), at: DVec3::ZERO, fovy: FOVY, size: [160, 120] };
        let want = picture(&kernel, &view);
        let largest = want.iter().map(|pixel| pixel[3]).fold(0.0, f64::max);
        assert!(largest > 0.3, "{largest}");
        let found = render(&seen(vec![Object::new(kernel)], &view), &unfiltered());
        let worst = worst(&found, &want);
        println!("{position}: worst {worst:.2e} of {largest:.2}");
        assert!(worst < most, "{position}: {worst:.2e}");
    }
}

/// The same at a depth at which the eye sees the kernel at a small angle, as it sees cells of a grid.
#[test]
fn a_kernel_that_is_small_to_the_eye_is_exact() {
    for position in [Vec3::ZERO, Vec3::new(6.0, -4.0, 3.0)] {
        let kernel = kernels(0.05, 0.1, std::iter::once((position, 0.02, Vec3::new(0.9, 0.4, 0.2))));
        let view = VolumeCamera { eye: DVec3::new(0.0, 0.0, 50.0), at: DVec3::ZERO, fovy: FOVY, size: [1600, 1200] };
        let found = render(&seen(vec![Object::new(kernel.clone())], &view), &unfiltered());
        let focal = 600.0 / (FOVY.to_radians() / 2.0).tan();
        let depth = 50.0 - f64::from(position.z);
        let at = |i: usize, sign: f64| [800.0, 600.0][i] + sign * f64::from(position[i]) / depth * focal;
        let (x, y) = (at(0, 1.0) as u32, at(1, -1.0) as u32);
        let mut largest = 0.0_f64;
        let mut all = 0.0_f64;
        for y in y - 12..y + 12 {
            for x in x - 12..x + 12 {
                let want = support_pixel(&kernel, &view, [x, y]);
                let got = found.rgba[(y * 1600 + x) as usize];
                let worst = got.iter().zip(want).map(|(&got, want)| (f64::from(got) - want).abs()).fold(0.0, f64::max);
                all = all.max(worst);
                largest = largest.max(want[3]);
            }
        }
        println!("small: worst {all:.2e} of {largest}");
        assert!(largest > 0.5 && all < 3e-4, "{position}: {all:.2e}");
    }
}

const NEAR: [DVec3; 2] = [DVec3::new(1.0, 1.5, 2.0), DVec3::new(-1.6, 0.4, 1.9)];
const FAR: DVec3 = DVec3::new(2.0, 3.0, 9.0);

/// Extinction and colour at a point.
type Field = fn(Vec3) -> (f32, Vec3);

fn fields() -> [(&'static str, Field); 2] {
    [("torus", torus), ("ball", ball)]
}

/// Magnified: a cell is some pixels wide, and the eye is within a cell's hundredfold.
// Not deep: the truth of volumes that marches along rays.
#[test]
fn volumes_near_the_eye_are_the_marched_ones() {
    for ((name, field), eye) in fields().into_iter().zip(NEAR) {
        let volume = grid(32, 0.6, LAYER, field);
        let view = VolumeCamera { eye, at: DVec3::ZERO, fovy: FOVY, size: [64, 48] };
        let want = picture(&volume, &view);
        let found = render(&seen(vec![Object::new(volume)], &view), &unfiltered());
        assert_near(&format!("{name} from {eye}"), &found, &want, [0.01, 0.01]);
    }
}

/// Mean over squares of `n` x `n` pixels.
fn reduced(picture: &[[f64; 4]], width: usize, n: usize) -> Vec<[f64; 4]> {
    let rows = picture.len() / width / n;
    let mean = |x: usize, y: usize| {
        let parts = (0..n).flat_map(|j| (0..n).map(move |i| [x * n + i, y * n + j]));
        let mut sum = [0.0; 4];
        parts.for_each(|[x, y]| (0..4).for_each(|c| sum[c] += picture[y * width + x][c] / (n * n) as f64));
        sum
    };
    (0..rows).flat_map(|y| (0..width / n).map(move |x| [x, y])).map(|[x, y]| mean(x, y)).collect()
}

/// Minified: a pixel holds some cells. The truth is the mean over its square.
#[test]
#[ignore = "deep: many samples"]
fn volumes_far_away_are_filtered() {
    for (name, field) in fields() {
        let volume = grid(32, 0.6, LAYER, field);
        let view = VolumeCamera { eye: FAR, at: DVec3::ZERO, fovy: FOVY, size: [128, 96] };
        let want = reduced(&picture(&volume, &view), 128, 4);
        let coarse = VolumeCamera { size: [32, 24], ..view };
        let scene = seen(vec![Object::new(volume)], &coarse);
        let filtered = RenderOptions {
            prefilter: Prefilter::Ewa,
            look: Look { filter: PixelFilter::Box, ..unfiltered().look },
            ..unfiltered()
        };
        let error = |options: &RenderOptions| {
            let found = render(&scene, options);
            flip::mean(&found, &truth(&found, &want)).unwrap()
        };
        let (none, ewa) = (error(&unfiltered()), error(&filtered));
        println!("{name}, one sample: none {none:.4}, ewa {ewa:.4}");
        let many = RenderOptions { quality: BlurMode::Still { pixel_samples: 16 }.into(), ..filtered };
        assert_near(&format!("{name}, 16 samples"), &render(&scene, &many), &want, [0.03, 0.01]);
    }
}

/// A card of three layers with stripes: what a row of cells does to them is aliased without the filter, and blurred
/// with it (Zwicker et al. 2002, figures 14 and 15).
fn zebra(cells: [usize; 2]) -> Gaussians {
    let spacing = [4.0 / cells[0] as f32, 4.0 / cells[1] as f32, 0.01];
    let mut out = Gaussians {
        optics: Optics::Extinction { layer: LAYER * (spacing[0] * spacing[1] * spacing[2]).cbrt() },
        linear: true,
        ..Gaussians::default()
    };
    for z in 0..3 {
        for y in 0..cells[1] {
            for x in 0..cells[0] {
                let at = |i: usize, axis: usize| (i as f32 + 0.5) * spacing[axis] - 2.0;
                let p = Vec3::new(at(x, 0), at(y, 1), (z as f32 - 1.0) * spacing[2]);
                let dark = (p.x * 4.0 + (p.y * 3.0).sin()).rem_euclid(1.0) < 0.5;
                out.position.push(p);
                out.sigma.push(0.6 * Vec3::from_array(spacing));
                out.rotation.push(Quat::IDENTITY);
                out.opacity.push(60.0 * spacing[0] * spacing[1] * spacing[2]);
                out.base.push((Vec3::splat(if dark { 0.05 } else { 0.9 }) - 0.5) / 0.282_094_8);
            }
        }
    }
    out
}

// Not deep: it holds the filter of volumes where the test above is left out.
#[test]
fn a_zebra_is_smooth_with_the_filter_and_aliased_without() {
    for cells in [[256, 128], [256, 64]] {
        let mut card = Object::new(zebra(cells));
        card.transform.rotate.x = -1.2;
        let scene_of = |size: [u32; 2]| {
            let view = VolumeCamera { eye: DVec3::new(0.0, 0.0, 6.0), at: DVec3::ZERO, fovy: 30.0, size };
            let mut scene = seen(vec![card.clone()], &view);
            scene.image.transparent = false;
            scene.image.background = DVec3::splat(0.3);
            scene
        };
        let still = |pixel_samples| BlurMode::Still { pixel_samples }.into();
        let truth = RenderOptions {
            quality: still(256),
            look: Look { filter: PixelFilter::Box, ..unfiltered().look },
            ..unfiltered()
        };
        let truth = render(&scene_of([64, 48]), &truth);
        let error = |prefilter| {
            let options = RenderOptions {
                prefilter,
                look: Look { filter: PixelFilter::Box, ..unfiltered().look },
                ..unfiltered()
            };
            flip::mean(&render(&scene_of([64, 48]), &options), &truth).unwrap()
        };
        let (none, ewa) = (error(Prefilter::None), error(Prefilter::Ewa));
        println!("{cells:?}: none {none:.4}, ewa {ewa:.4}");
        assert!(ewa < 0.6 * none, "{cells:?}: none {none:.4}, ewa {ewa:.4}");
    }
}

/// Kernels without thickness are surface splats: the colours of a card, filtered, and the same opacity all over
/// (Zwicker et al. 2002, section 6.4, eq. 37).
#[test]
fn flattened_kernels_are_surface_splats() {
    // Surfels have kernels of standard deviation radius / 2, which lose some of it where they are cut.
    const CUT: f64 = 0.828_83;
    let n = 96;
    let spacing = 4.0 / n as f32;
    let at = |i: usize| (i as f32 + 0.5) * spacing - 2.0;
    let colour = |p: Vec3| {
        let dark = (p.x * 3.0 + (p.y * 3.0).sin()).rem_euclid(1.0) < 0.5;
        Vec3::splat(if dark { 0.05 } else { 0.9 })
    };
    let places: Vec<Vec3> = (0..n).flat_map(|y| (0..n).map(move |x| Vec3::new(at(x), at(y), 0.0))).collect();
    let sigma = spacing;
    let depth = 0.1_f32;
    let mut volume = kernels(sigma, 0.1, places.iter().map(|&p| (p, depth * spacing * spacing, colour(p))));
    volume.sigma.iter_mut().for_each(|sigma| sigma.z = 0.0);
    let surfels = crate::support::round_surfels(
        places.iter().map(|&p| (p.as_dvec3(), DVec3::Z, 2.0 * f64::from(sigma) / CUT, colour(p))),
    );
    let mut card = crate::support::object(surfels);
    card.shape.surface_mut().unwrap().material = Some(crate::support::UNLIT);
    card.shape.surface_mut().unwrap().two_sided = true;
    let options = RenderOptions {
        prefilter: Prefilter::Ewa,
        look: Look { filter: PixelFilter::Box, ..unfiltered().look },
        ..unfiltered()
    };
    for tilt in [0.0, 0.9] {
        let view = VolumeCamera { eye: DVec3::new(0.0, 0.0, 6.0), at: DVec3::ZERO, fovy: 30.0, size: [96, 72] };
        let shown = |mut object: Object| {
            object.transform.rotate.x = tilt;
            render(&seen(vec![object], &view), &options)
        };
        let (volume, card) = (shown(Object::new(volume.clone())), shown(card.clone()));
        // The colour of the volume is that of its kernels by weight; alpha is 1 - exp(-depth / cos).
        let mut worst = 0.0_f64;
        let mut sum = (0.0, 0);
        for (volume, card) in volume.rgba.iter().zip(&card.rgba) {
            if card[3] < 1.0 || volume[3] < 0.9 * (1.0 - (-depth / (tilt as f32).cos()).exp()) {
                continue;
            }
            let difference = f64::from((volume[0] / volume[3] - card[0]).abs());
            worst = worst.max(difference);
            sum = (sum.0 + difference, sum.1 + 1);
        }
        let mean = sum.0 / f64::from(sum.1);
        println!("tilt {tilt}: worst {worst:.4}, mean {mean:.5}, {} pixels", sum.1);
        assert!(sum.1 > 300 && worst < 0.06 && mean < 0.015, "tilt {tilt}: worst {worst:.4}, mean {mean:.5}");
    }
}

fn bits(picture: &Picture) -> Vec<u32> {
    let planes = picture.layers.iter().flat_map(|layer| layer.planes.iter().flatten());
    picture.rgba.iter().flatten().chain(planes).map(|value| value.to_bits()).collect()
}

/// A volume, a capture in it, an opaque ball through both, and a see-through one.
fn mixed(size: [u32; 2]) -> Scene {
    let mut smoke = Object::new(grid(72, 0.6, LAYER, torus));
    smoke.motions = vec![Motion::Rotation { axis: DVec3::Y, per_frame: 0.5, centre: DVec3::ZERO }];
    let resting = Object::new(grid(24, 0.6, LAYER, ball));
    let mut capture = kernels(0.2, 0.1, [(Vec3::new(0.6, 0.0, 0.1), 0.7, Vec3::new(0.1, 0.8, 0.2))].into_iter());
    capture.optics = Optics::Alpha;
    let mut solid = crate::support::object(crate::support::sphere(3000));
    solid.transform.scale = DVec3::splat(0.3);
    solid.motions = vec![Motion::Linear { velocity: DVec3::new(0.5, 0.1, 0.2) }];
    let mut glass = crate::support::object(crate::support::sphere(3000));
    glass.transform.scale = DVec3::splat(0.5);
    glass.shape.surface_mut().unwrap().two_sided = true;
    glass.opacity = 0.4;
    let view = VolumeCamera { eye: DVec3::new(0.5, 1.5, 4.0), at: DVec3::ZERO, fovy: FOVY, size };
    seen(vec![smoke, resting, Object::new(capture), solid, glass], &view)
}

fn modes() -> [BlurMode; 4] {
    let bucket = BlurMode::Bucket {
        buckets: 2,
        samples: 2,
        pixel_samples: None,
        interleave: Interleave::None,
        times: Times::default(),
    };
    [BlurMode::Still { pixel_samples: 2 }, BlurMode::supersample(3), BlurMode::interleaved(2, Interleave::Two), bucket]
}

#[test]
fn memory_and_threads_change_no_byte() {
    let scene = mixed([90, 70]);
    for mode in modes() {
        let options = RenderOptions {
            quality: mode.into(),
            look: Look { aovs: vec![Aov::Alpha, Aov::Depth, Aov::Normal, Aov::Velocity], ..Look::default() },
            ..RenderOptions::default()
        };
        let whole = render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap();
        let Err(BackendError::Memory { needed, .. }) =
            render_frame(&mut Cpu::default(), &scene, 0, &RenderOptions { memory: 1, ..options.clone() })
        else {
            panic!("{mode}: a byte is enough")
        };
        // More threads need more.
        for (threads, memory) in [(1, 1 << 30), (3, needed + needed / 2)] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let few = RenderOptions { memory, ..options.clone() };
            let found = pool.install(|| render_frame(&mut Cpu::default(), &scene, 0, &few)).unwrap();
            println!("{mode}, {threads} threads, {memory} bytes: {} splats", found.stats.splats);
            assert!(bits(&found.picture) == bits(&whole.picture), "{mode}, {threads} threads, {memory}");
        }
    }
}

/// Software devices end loops early: all kernels of a volume may lie in one tile, and layers of see-through surfels
/// before each of them.
#[cfg(feature = "gpu")]
#[test]
fn a_tile_holds_more_kernels_than_a_loop_has_turns() {
    let Some(mut gpu) = crate::support::gpu::gpu_or_skip("a_tile_holds_more_kernels_than_a_loop_has_turns") else {
        return;
    };
    let mut scene = mixed([16, 16]);
    let field = |p: Vec3| (0.3, Vec3::splat(0.5) + 0.4 * p);
    scene.objects.truncate(1);
    scene.objects[0] = Object::new(grid(56, 0.6, LAYER, field));
    let mut glass = mixed([16, 16]).objects.pop().unwrap();
    glass.transform.translate = DVec3::new(0.3, 0.2, 0.5);
    scene.objects.push(glass);
    let options = RenderOptions { detail: splatblur::options::Detail::Full, ..unfiltered() };
    let cpu = render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap();
    let found = render_frame(&mut gpu, &scene, 0, &options).unwrap().picture;
    assert!(cpu.stats.splats > 70_000, "{}", cpu.stats.splats);
    let pairs = found.rgba.iter().flatten().zip(cpu.picture.rgba.iter().flatten());
    let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    println!("worst {worst}");
    assert!(worst < 1e-4, "{worst}");
}

/// All modes show the same picture, up to what they sample.
// Not deep: the only test of volumes in mode auto.
#[test]
fn modes_agree_on_volumes_in_motion() {
    let scene = mixed([60, 45]);
    let with = |quality: Quality| render(&scene, &RenderOptions { quality, ..RenderOptions::default() });
    let want = with(BlurMode::supersample(128).into());
    let bucket = BlurMode::Bucket {
        buckets: 16,
        samples: 2,
        pixel_samples: None,
        interleave: Interleave::None,
        times: Times::default(),
    };
    for quality in [
        BlurMode::supersample(16).into(),
        BlurMode::interleaved(16, Interleave::Two).into(),
        bucket.into(),
        Quality::Error(ErrorTarget::default()),
    ] {
        let flip = flip::mean(&with(quality), &want).unwrap();
        println!("{quality:?}: FLIP {flip:.4}");
        assert!(flip < 0.02, "{quality:?}: FLIP {flip:.4}");
    }
}

/// The same field on a grid, on one of cells that are not cubes, and as samples in no order.
#[test]
fn grids_of_all_kinds_and_samples_show_the_same_field() {
    let field = |p: DVec3| 200.0 * (-(p.x * p.x + 1.5 * p.y * p.y + p.z * p.z) * 4.0).exp();
    let dir = tempfile::tempdir().unwrap();
    let load = |name: &str, bytes: &[u8]| {
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let stop = |value, opacity| TransferStop { value, colour: Vec3::new(0.9, 0.5, 0.2), opacity };
        let transfer = TransferFunction::new(vec![stop(1.0, 0.0), stop(201.0, 8.0)]).unwrap();
        let volume = VolumeOptions { transfer: Some(Arc::new(transfer)), ..VolumeOptions::default() };
        let options = LoadOptions { volume, kind: Some(Kind::Volume), ..LoadOptions::default() };
        Object::new(model::load(&path, &options, &|_, _| {}).unwrap())
    };
    let grid = |name: &str, [nx, ny, nz]: [usize; 3]| {
        let spacing = [nx, ny, nz].map(|n| 2.0 / n as f64);
        let at = |i: usize, axis: usize| (i as f64 + 0.5) * spacing[axis] - 1.0;
        let places = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
        let places = places.map(|[x, y, z]| DVec3::new(at(x, 0), at(y, 1), at(z, 2)));
        let values: Vec<u8> = places.flat_map(|p| (field(p) as f32).to_le_bytes()).collect();
        let [sx, sy, sz] = spacing;
        let header = format!(
            "NRRD0004\ntype: float\nendian: little\ndimension: 3\nsizes: {nx} {ny} {nz}\nencoding: raw\n\
             space dimension: 3\nspace directions: ({sx},0,0) (0,{sy},0) (0,0,{sz})\nspace origin: ({},{},{})\n\n",
            at(0, 0),
            at(0, 1),
            at(0, 2)
        );
        load(name, &[header.as_bytes(), &values].concat())
    };
    let regular = grid("regular.nrrd", [40, 40, 40]);
    let rectilinear = grid("rectilinear.nrrd", [56, 40, 48]);
    // Samples in a lattice that is turned by random angles, with its layers shifted: none is where a grid has one.
    let samples = {
        let r = 0.05;
        let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.8, -0.5);
        let steps = || -34..=34_i32;
        let places = steps().flat_map(|z| steps().flat_map(move |y| steps().map(move |x| [x, y, z])));
        let places = places.map(|[x, y, z]| {
            turn * DVec3::new(f64::from(x) + 0.37 * f64::from(z), f64::from(y) + 0.71 * f64::from(z), f64::from(z)) * r
        });
        let inside: Vec<DVec3> = places.filter(|p| p.abs().max_element() <= 1.0).collect();
        let header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
             property float z\nproperty float density\nproperty float radius\nend_header\n",
            inside.len()
        );
        let rows = inside.iter().flat_map(|p| [p.x, p.y, p.z, field(*p), r]).flat_map(|v| (v as f32).to_le_bytes());
        load("samples.ply", &[header.into_bytes(), rows.collect()].concat())
    };
    let view = VolumeCamera { eye: DVec3::new(1.0, 1.2, 3.0), at: DVec3::ZERO, fovy: FOVY, size: [96, 72] };
    let shown = |object: Object| render(&seen(vec![object], &view), &unfiltered());
    let want = shown(regular);
    assert!(want.rgba.iter().any(|pixel| pixel[3] > 0.9));
    for (name, object) in [("rectilinear", rectilinear), ("samples", samples)] {
        let flip = flip::mean(&shown(object), &want).unwrap();
        println!("{name}: FLIP {flip:.4}");
        assert!(flip < 0.01, "{name}: FLIP {flip:.4}");
    }
}

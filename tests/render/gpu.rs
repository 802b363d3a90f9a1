//! The GPU backend: whole images against the CPU's, and frames under way at the same time. Parity pass by pass stands
//! in src/backend/gpu/tests, closed forms in `closed_forms.rs`.

#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stderr, reason = "tests may stop and report")]

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::support::gaussians::psnr;
use crate::support::gpu::gpu_or_skip;
use crate::support::sphere_scene;
use splatblur::backend::Backend;
use splatblur::backend::cpu::Cpu;
use splatblur::film::{Aov, Picture};
use splatblur::image;
use splatblur::math::srgb::from_linear;
use splatblur::model::{ModelFormat, parse_capture};
use splatblur::options::{BlurMode, Detail, ErrorTarget, Interleave, Look, PixelFilter, Quality, RenderOptions};
use splatblur::renderer::{FrameQueue, render_frame};
use splatblur::scene::{Camera, ImageSettings, Object, Scene};

fn shipped() -> Vec<(String, Scene)> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut paths: Vec<PathBuf> = std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == "xml"));
    paths.sort();
    // Meshes are sampled for this size.
    let load = |path: &PathBuf| {
        let scene = Scene::open(path).size(192, 108).load().expect("a shipped scene");
        (scene.name.clone(), scene)
    };
    paths.iter().map(load).collect()
}

/// Is there a discontinuity of coverage or depth within one pixel of pixel `i`?
fn next_to_an_edge(picture: &Picture, i: usize) -> bool {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let (x, y) = (i % width, i / width);
    let plane = |aov: Aov| &picture.layers.iter().find(|layer| layer.aov == aov).expect("a layer").planes[0];
    let (alpha, depth) = (plane(Aov::Alpha), plane(Aov::Depth));
    let near = (y.saturating_sub(1)..(y + 2).min(height))
        .flat_map(|y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x));
    let jumps = |a: f32, b: f32| (a - b).abs() > 1e-3 * a.abs().min(b.abs());
    near.clone().any(|j| alpha[j] != alpha[i] || jumps(depth[j], depth[i]))
}

#[test]
#[ignore = "deep: whole pictures"]
fn shipped_scenes_look_the_same() {
    let Some(mut gpu) = gpu_or_skip("shipped_scenes_look_the_same") else { return };
    for (number, (name, scene)) in shipped().into_iter().enumerate() {
        // A lattice takes a minute where a scene has a million surfels. Those have one sample. Of the others every
        // second one has a lattice.
        let elements: usize = scene.objects.iter().map(|object| object.shape.elements()).sum();
        let (mode, most_weight) = match number % 2 {
            _ if elements >= 100_000 => (BlurMode::supersample(1), 1.0),
            0 => (BlurMode::supersample(2), 0.5),
            _ => (BlurMode::interleaved(1, Interleave::Two), 1.0),
        };
        let options = RenderOptions {
            quality: mode.into(),
            look: Look { aovs: vec![Aov::Alpha, Aov::Depth], ..Look::default() },
            ..RenderOptions::default()
        };
        let frame = scene.frames.first + 1;
        let want = render_frame(&mut Cpu::default(), &scene, frame, &options).unwrap().picture;
        let got = render_frame(&mut gpu, &scene, frame, &options).unwrap().picture;
        let colours = want.rgba.iter().flat_map(|p| p[..3].iter());
        let (least, most) = colours.fold((f32::MAX, f32::MIN), |(a, b), &c| (a.min(c), b.max(c)));
        let (mut differing, mut worst) = (0, 0.0_f32);
        for (i, (g, w)) in got.rgba.iter().zip(&want.rgba).enumerate() {
            let difference = g.iter().zip(w).map(|(g, w)| (g - w).abs()).fold(0.0, f32::max);
            assert!(difference.is_finite());
            worst = worst.max(difference);
            if difference > 1.0 / 255.0 {
                differing += 1;
                assert!(next_to_an_edge(&want, i), "{name}: pixel {i}");
                assert!(difference <= most_weight * (most - least) + 2.0 / 255.0, "{name}: pixel {i}");
            }
        }
        eprintln!("{name}, {mode}: {differing} pixels differ by more than 1/255; worst {worst:.1e}");
        assert!(f64::from(differing) < 1e-3 * got.rgba.len() as f64, "{name}: {differing} pixels differ");
    }
}

/// What a frame costs beside the work of its passes. Bind groups stay where buffers do.
#[test]
fn calls_to_the_device_are_counted() {
    let Some(mut gpu) = gpu_or_skip("calls_to_the_device_are_counted") else { return };
    let scene = sphere_scene(300, 40, true);
    let render = |backend: &mut dyn Backend, quality: Quality| {
        let options = RenderOptions { quality, ..RenderOptions::default() };
        render_frame(backend, &scene, 1, &options).unwrap().stats
    };
    let quality = Quality::from(BlurMode::supersample(2));
    assert_eq!(render(&mut Cpu::default(), quality).gpu, None);
    let [first, second, third] = [(); 3].map(|()| render(&mut gpu, quality).gpu.unwrap());
    eprintln!("{first:?}, then {second:?}");
    assert!(first.bind_groups > 20 && first.bytes_up > second.bytes_up, "pipelines and models are there later");
    assert_eq!((second.bind_groups, second), (0, third));
    // The film, and the marks of time where there are any.
    assert!(second.waits == 1 && (1..=2).contains(&second.maps), "{second:?}");
    assert!(second.bytes_down >= 4 * 4 * 40 * 40, "{second:?}");
    // Views, tables, segments, lights, and wanted blocks.
    assert!(second.submissions == 1 && (1..=5).contains(&second.writes), "{second:?}");
    // Two instants go through the passes together. Filtered kernels are walked over twice. No list of a tile has
    // all splats of an instant.
    assert_eq!(second.walks, 2);
    assert!(second.chain > 50 && second.chain < 2 * 300, "{second:?}");
    assert!(second.fill > 0.0 && second.fill < 0.1, "{second:?}");
    let many = render(&mut gpu, Quality::from(BlurMode::supersample(12))).gpu.unwrap();
    let most = second.dispatches + 8;
    assert!((12..40).contains(&second.dispatches) && many.dispatches <= most, "{second:?}, {many:?}");
    // A frame of mode auto alone waits for each pair of its renderings.
    let target = Quality::Error(ErrorTarget { error: 0.02, ..ErrorTarget::default() });
    let [auto, again] = [(); 2].map(|()| render(&mut gpu, target).gpu.unwrap());
    eprintln!("auto {auto:?}, then {again:?}");
    assert!(auto.waits > 0 && auto.waits == again.waits && auto.submissions == 2 * auto.waits, "{auto:?}");
    assert!(again.bind_groups < auto.bind_groups, "{again:?}");
}

#[test]
fn frames_under_way_change_nothing() {
    let Some(mut gpu) = gpu_or_skip("frames_under_way_change_nothing") else { return };
    let scene = sphere_scene(3000, 100, true);
    let options = RenderOptions { quality: BlurMode::supersample(2).into(), ..RenderOptions::default() };
    let alone: Vec<_> = (0..4).map(|frame| render_frame(&mut gpu, &scene, frame, &options).unwrap().picture).collect();
    assert_ne!(alone[0], alone[1]);
    // A fresh one must grow its buffers while frames are under way.
    let mut fresh = gpu_or_skip("frames_under_way_change_nothing").unwrap();
    for gpu in [&mut gpu, &mut fresh] {
        assert_eq!(gpu.in_flight(), 2);
        let mut queue = FrameQueue::new(gpu, &scene, &options).unwrap();
        let mut got = Vec::new();
        for frame in 0..4 {
            queue.begin(frame, frame * frame).unwrap();
            got.extend(queue.ready().unwrap());
            assert_eq!(got.len(), usize::try_from(frame).unwrap());
        }
        while let Some(done) = queue.finish().unwrap() {
            got.push(done);
        }
        assert_eq!(got.len(), 4);
        for (i, done) in got.iter().enumerate() {
            assert_eq!((done.number, done.tag), ((i as i64).into(), (i * i) as i64));
            assert_eq!(done.rendered.as_ref().unwrap().picture, alone[i], "frame {i}");
        }
    }
}

#[test]
fn counts_are_the_cpus() {
    let Some(mut gpu) = gpu_or_skip("counts_are_the_cpus") else { return };
    let scene = sphere_scene(3000, 100, true);
    let options = RenderOptions { quality: BlurMode::supersample(2).into(), ..RenderOptions::default() };
    let want = render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap().stats;
    let got = render_frame(&mut gpu, &scene, 0, &options).unwrap().stats;
    assert_eq!((got.samples, got.surfels), (want.samples, want.surfels));
    // A splat next to the image's rim may be cut by one and not by the other.
    assert!(got.splats.abs_diff(want.splats) <= 3, "{} and {}", got.splats, want.splats);
}

/// What does not fit is an error that says so.
#[test]
fn too_little_memory_is_an_error() {
    let Some(mut gpu) = gpu_or_skip("too_little_memory_is_an_error") else { return };
    let scene = sphere_scene(3000, 100, false);
    let options = RenderOptions { memory: 1 << 20, ..RenderOptions::default() };
    let error = render_frame(&mut gpu, &scene, 0, &options).unwrap_err().to_string();
    assert!(error.contains("RenderOptions::memory"), "{error}");
}

/// Software devices end loops early: all splats of a model may lie in one tile.
#[test]
fn a_tile_holds_more_splats_than_a_loop_has_turns() {
    let Some(mut gpu) = gpu_or_skip("a_tile_holds_more_splats_than_a_loop_has_turns") else { return };
    let scene = sphere_scene(300_000, 16, false);
    let quality = BlurMode::Still { pixel_samples: 1 }.into();
    let options = RenderOptions { quality, detail: Detail::Full, ..RenderOptions::default() };
    let cpu = render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap();
    let picture = render_frame(&mut gpu, &scene, 0, &options).unwrap().picture;
    assert!(cpu.stats.splats > 70_000, "{}", cpu.stats.splats);
    let pairs = picture.rgba.iter().flatten().zip(cpu.picture.rgba.iter().flatten());
    let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    // Sums of some thousand weights.
    assert!(worst < 1e-3, "{worst}");
}

/// The captured guitar on the device, against a picture of another program (tests/scene/captures.rs).
#[test]
fn the_guitar_is_the_exact_picture() {
    let Some(mut gpu) = gpu_or_skip("the_guitar_is_the_exact_picture") else { return };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(root.join("tests/data/models/guitar_3dgs.ply")).unwrap();
    let guitar = parse_capture(&bytes, ModelFormat::Ply).unwrap().unwrap();
    let mut scene = sphere_scene(1, 100, false);
    scene.objects = vec![Object::new(guitar)];
    scene.image = ImageSettings { width: 480, height: 360, transparent: true, ..ImageSettings::default() };
    scene.camera = Camera::new(DVec3::new(0.0, -2.0, 6.0), DVec3::new(0.0, -2.0, 0.0));
    (scene.camera.up, scene.camera.fovy, scene.camera.near) = (-DVec3::Y, 50_f64.to_radians(), 0.2);
    let still = BlurMode::Still { pixel_samples: 1 };
    let options = RenderOptions {
        quality: still.into(),
        look: Look { filter: PixelFilter::Point, ..Look::default() },
        ..RenderOptions::default()
    };
    let picture = render_frame(&mut gpu, &scene, 0, &options).unwrap().picture;
    // The truth has coded values.
    let coded = |&[r, g, b, a]: &[f32; 4]| {
        let of = |c: f32| if a > 0.0 { a * from_linear(c / a) } else { 0.0 };
        [of(r), of(g), of(b), a].map(f64::from)
    };
    let got: Vec<[f64; 4]> = picture.rgba.iter().map(coded).collect();
    let truth = image::read(&root.join("tests/data/truth/captures/guitar_0.exr")).unwrap();
    let want: Vec<[f64; 4]> = truth.rgba.iter().map(|pixel| pixel.map(f64::from)).collect();
    let found = psnr(&got, &want);
    eprintln!("{found:.1} dB");
    assert!(found >= 80.0, "{found:.1} dB");
}

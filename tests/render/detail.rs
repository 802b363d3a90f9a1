//! Levels of detail: fewer surfels make nearly the same picture, and all of them the old one.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::path::Path;

#[cfg(feature = "gpu")]
use splatblur::backend::Backend;
use splatblur::backend::cpu::Cpu;
use splatblur::compare::flip;
use splatblur::film::Picture;
use splatblur::options::{BlurMode, Detail, Quality, RenderOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::Scene;
use splatblur::scene_file::{self, SceneLoadOptions};

#[cfg(feature = "gpu")]
use crate::support::gpu::gpu_or_skip;

fn scene(name: &str, size: (u32, u32)) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let options = SceneLoadOptions { size: Some(size), ..SceneLoadOptions::default() };
    scene_file::load(&path, &options).unwrap().scene
}

fn render(scene: &Scene, frame: i64, quality: impl Into<Quality>, detail: Detail) -> (Picture, u64) {
    let options = RenderOptions { quality: quality.into(), detail, ..RenderOptions::default() };
    let rendered = render_frame(&mut Cpu::default(), scene, frame, &options).unwrap();
    (rendered.picture, rendered.stats.surfels)
}

/// Coarser detail has fewer surfels and a larger error, and `good` is within .005 of all surfels.
#[test]
fn less_detail_is_cheaper_and_near() {
    for (name, frame, least) in [("bottle.xml", 6, 1.5), ("three_objects.xml", 15, 1.1), ("propeller.xml", 2, 1.5)] {
        let scene = self::scene(name, (240, 135));
        let of = |detail| render(&scene, frame, BlurMode::supersample(8), detail);
        let (full, all) = of(Detail::Full);
        let made = [Detail::Final, Detail::Good, Detail::Draft].map(|detail| {
            let (picture, surfels) = of(detail);
            (flip::mean(&picture, &full).unwrap(), surfels)
        });
        println!("{name}: of {all} {made:?}");
        assert!(made.is_sorted_by(|fine, coarse| fine.0 <= coarse.0 && fine.1 >= coarse.1), "{name}: {made:?}");
        assert!(made[1].0 <= 0.005, "{name}: {made:?}");
        assert!(made[1].1 as f64 * least < all as f64, "{name}: {made:?} of {all}");
    }
}

/// In mode auto detail goes with the error.
#[test]
fn detail_goes_with_the_error() {
    let scene = scene("bottle.xml", (120, 68));
    let surfels = |text: &str, detail| {
        let quality: Quality = text.parse().unwrap();
        render(&scene, 6, quality, detail).1 as f64
    };
    // The first rounds of both errors differ: the surfels of a sample do not.
    let of_sample = |text: &str, detail| {
        let quality: Quality = text.parse().unwrap();
        let options = RenderOptions { quality, detail, ..RenderOptions::default() };
        let stats = render_frame(&mut Cpu::default(), &scene, 6, &options).unwrap().stats;
        stats.surfels as f64 / stats.samples as f64
    };
    assert_eq!(of_sample("auto:draft", Detail::Auto), of_sample("auto:draft", Detail::Draft));
    assert!(of_sample("auto:draft", Detail::Auto) < of_sample("auto:draft", Detail::Final));
    assert_eq!(surfels("supersample:8", Detail::Auto), surfels("supersample:8", Detail::Good));
    assert!(surfels("supersample:8", Detail::Auto) < surfels("supersample:8", Detail::Full));
}

/// A frame is the same whatever was rendered before it.
#[test]
fn a_frame_does_not_depend_on_the_one_before() {
    let shared = scene("bottle.xml", (120, 68));
    let bits = |picture: &Picture| picture.rgba.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
    let of = |scene: &Scene, frame| bits(&render(scene, frame, BlurMode::supersample(4), Detail::Good).0);
    let first = of(&shared, 6);
    assert_ne!(of(&shared, 1), first);
    assert_eq!(of(&shared, 6), first);
    assert_eq!(of(&scene("bottle.xml", (120, 68)), 6), first);
}

/// The surfels of a cut go through the GPU as those of a model do.
#[cfg(feature = "gpu")]
#[test]
fn both_backends_show_the_same_cut() {
    let Some(mut gpu) = gpu_or_skip("both_backends_show_the_same_cut") else { return };
    let bottle = scene("bottle.xml", (120, 68));
    // As small as this, the smoke is merged.
    let mut smoke = scene("smoke.xml", (60, 34));
    smoke.objects.truncate(1);
    let kernels = |detail| render(&smoke, 6, BlurMode::supersample(4), detail).1;
    let (some, all) = (kernels(Detail::Draft), kernels(Detail::Full));
    assert!(some < all, "{some} of {all}");
    let pairs =
        [(&bottle, "supersample:4"), (&bottle, "still:1"), (&bottle, "volumetric:2"), (&smoke, "supersample:4")];
    for (scene, text) in pairs {
        let quality: Quality = text.parse().unwrap();
        let options = RenderOptions { quality, detail: Detail::Draft, ..RenderOptions::default() };
        for frame in [6, 7] {
            let [a, b] = [&mut gpu as &mut dyn Backend, &mut Cpu::default()]
                .map(|backend| render_frame(backend, scene, frame, &options).unwrap().picture);
            let error = flip::mean(&a, &b).unwrap();
            assert!(error < 1e-3, "{text} {frame}: {error}");
        }
    }
}

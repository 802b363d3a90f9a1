//! Pictures as bytes, and how far they are from each other.

use splatblur::compare::{Comparison, Metric, compare};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::{Device, Look, Picture, PixelFilter, RenderOptions, Renderer, Scene};

/// Colours below, within and above the range, with this alpha.
fn gradient(alpha: fn(u32) -> f32) -> Picture {
    let pixel = |i: u32| {
        let a = alpha(i);
        [a * i as f32 / 60.0, a * 0.2, -0.1 * a, a]
    };
    Picture { width: 12, height: 6, rgba: (0..72).map(pixel).collect(), layers: Vec::new() }
}

#[test]
fn bytes_are_those_of_the_written_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gradient.png");
    for picture in [gradient(|_| 1.0), gradient(|i| i as f32 / 71.0)] {
        picture.write(&path).unwrap();
        let file = image::open(&path).unwrap().to_rgba8();
        assert_eq!(picture.to_srgb8().unwrap(), file.into_raw());
    }
    let mut broken = gradient(|_| 1.0);
    broken.rgba[7][1] = f32::NAN;
    assert!(broken.to_srgb8().is_err());
}

#[test]
fn metrics_come_in_the_order_that_was_asked_for() {
    let (a, b) = (gradient(|_| 1.0), gradient(|i| i as f32 / 71.0));
    let metrics = [Metric::Flip, Metric::Psnr, Metric::AlphaMae];
    let all = Comparison::new(&a, &b, &metrics).unwrap();
    assert_eq!(compare(&a, &b, &metrics).unwrap().map(Some), metrics.map(|metric| all.value(metric)));
    assert_eq!(compare(&a, &a, &[Metric::Mse]).unwrap(), [0.0]);
    let small = Picture { width: 6, rgba: a.rgba[..36].to_vec(), ..a.clone() };
    assert!(compare(&a, &small, &[Metric::Mse]).is_err());
}

/// The look of the options reaches the picture.
#[test]
fn a_reference_has_the_look_of_the_options() {
    let scene = Scene::open("scenes/blinker_fence.xml").size(24, 16).load().unwrap();
    let traced = |look: Look| {
        let options = RenderOptions { look: look.clone(), ..RenderOptions::default() };
        let options = ReferenceOptions::like(&options, 16);
        assert_eq!((&options.look, options.samples), (&look, 16));
        reference::picture(&scene, 0, &options).unwrap()
    };
    let plain = traced(Look::default());
    assert_eq!(plain, traced(Look::default()));
    assert_ne!(plain, traced(Look { filter: PixelFilter::Gaussian { sigma: 2.0 }, ..Look::default() }));
}

/// A renderer shows a scene as a new one does, whatever it has shown before: layers, captures, volumes.
#[test]
fn a_renderer_forgets_the_scene_before() {
    let options = RenderOptions { quality: "supersample:2".parse().unwrap(), ..RenderOptions::default() };
    let scenes = [("glass", 6), ("guitar_ball", 9), ("smoke", 4), ("crossing", 12)].map(|(name, frame)| {
        let scene = Scene::open(format!("scenes/{name}.xml")).size(96, 54).load().unwrap();
        let alone = Renderer::open(Device::Cpu).unwrap().render(&scene, frame, &options).unwrap().picture;
        (name, scene, frame, alone)
    });
    let mut renderer = Renderer::open(Device::Cpu).unwrap();
    for (first, before, frame, _) in &scenes {
        for (name, scene, number, alone) in &scenes {
            renderer.render(before, *frame, &options).unwrap();
            let picture = renderer.render(scene, *number, &options).unwrap().picture;
            assert!(picture.rgba == alone.rgba, "{name} after {first}");
        }
    }
}

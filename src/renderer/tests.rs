//! Sequences of frames, and the meter.

use std::path::Path;

use super::*;
use crate::model::{LoadOptions, load};
use crate::options::{BlurMode, Prefilter};
use crate::scene::{Object, Shape, Sphere};

fn scene() -> Scene {
    let mut scene = Scene::new([Object::new(Shape::default())]);
    (scene.image.width, scene.image.height) = (8, 6);
    scene
}

fn numbers(renderer: &mut Renderer, scene: &Scene, options: &RenderOptions) -> Vec<Result<f64, String>> {
    let frames = renderer.render_sequence(scene, [3.0, 1.5, 2.0], options);
    frames.map(|frame| frame.map(|(number, _)| number.get()).map_err(|error| error.to_string())).collect()
}

#[test]
fn a_sequence_gives_all_frames_in_order_then_nothing() {
    let mut renderer = Renderer::open(Device::Cpu).unwrap();
    for quality in [Quality::default(), BlurMode::supersample(2).into()] {
        let options = RenderOptions { quality, ..RenderOptions::default() };
        assert_eq!(numbers(&mut renderer, &scene(), &options), [Ok(3.0), Ok(1.5), Ok(2.0)]);
    }
}

#[test]
fn a_renderer_says_what_renders() {
    let renderer = Renderer::open(Device::Cpu).unwrap();
    let threads = rayon::current_num_threads();
    assert_eq!(renderer.describe(), renderer.describe_with(threads));
    assert_eq!(renderer.describe_with(1), "the CPU (1 thread)");
    assert_eq!(renderer.describe_with(8), "the CPU (8 threads)");
}

/// The meter stands at the end of the last rendering: one of a mode, two or more of mode auto.
#[test]
fn the_meter_counts_all_steps() {
    let mut renderer = Renderer::open(Device::Cpu).unwrap();
    let meter = Arc::new(Meter::default());
    renderer.watch(Arc::clone(&meter));
    let mut scene = Scene::load("scenes/swarm.xml").unwrap();
    (scene.image.width, scene.image.height) = (96, 64);
    let modes: [(Quality, u64); 4] = [
        (BlurMode::supersample(4).into(), 1),
        ("still:2".parse().unwrap(), 1),
        ("volumetric:3+published".parse().unwrap(), 1),
        (Quality::default(), 2),
    ];
    for (quality, least) in modes {
        meter.reset();
        assert_eq!(meter.read(), crate::backend::Reading::default());
        let options = RenderOptions { quality, prefilter: Prefilter::Approx, ..RenderOptions::default() };
        renderer.render(&scene, 3, &options).unwrap();
        let read = meter.read();
        assert!(read.share == 1.0 && read.renderings >= least, "{quality}: {read:?}");
        assert!(least > 1 || read.renderings == 1, "{quality}: {read:?}");
    }
}

#[test]
fn a_model_takes_its_memory_once() {
    let loaded = load(Path::new("scenes/models/swarm.1.ply"), &LoadOptions::default(), &|_, _| {}).unwrap();
    let shape = Shape::from(loaded);
    let model = shape.surfels().unwrap().surfels();
    let scene = Scene::new([Object::new(Arc::clone(model)), Object::new(Arc::clone(model))]);
    let frame = Frame::new(&scene, 0, BlurMode::supersample(1), &RenderOptions::default());
    // Position, two axes, normal and colour of each surfel.
    assert!(frame.model_bytes >= 60 * model.len() as u64, "{} for {}", frame.model_bytes, model.len());
    assert_eq!(frame.model_bytes, model.bytes());
}

#[test]
fn a_sequence_ends_with_its_first_error() {
    let mut renderer = Renderer::open(Device::Cpu).unwrap();
    let mut refused = |scene: &Scene, memory: u64, what: &str| {
        let options = RenderOptions { memory, ..RenderOptions::default() };
        let frames = numbers(&mut renderer, scene, &options);
        assert!(matches!(&frames[..], [Err(error)] if error.contains(what)), "{frames:?}");
    };
    refused(&scene(), 1, "RenderOptions::memory");
    let mut ideal = Object::new(crate::model::Surfels::default());
    ideal.shape = Sphere { radius: 1.0, colour: glam::Vec3::ONE }.into();
    refused(&Scene::new([ideal]), 1 << 30, "ideal sphere");
    assert_eq!(numbers(&mut renderer, &scene(), &RenderOptions::default()).len(), 3);
}

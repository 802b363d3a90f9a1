//! Sequences of frames, and the meter.

use super::*;
use crate::options::BlurMode;
use crate::scene::{Object, Sphere};

fn scene() -> Scene {
    let mut scene = Scene::new([]);
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
fn a_sequence_ends_with_its_first_error() {
    let mut renderer = Renderer::open(Device::Cpu).unwrap();
    let mut refused = |scene: &Scene, memory: u64, what: &str| {
        let options = RenderOptions { memory, ..RenderOptions::default() };
        let frames = numbers(&mut renderer, scene, &options);
        assert!(matches!(&frames[..], [Err(error)] if error.contains(what)), "{frames:?}");
    };
    refused(&scene(), 1, "RenderOptions::memory");
    let mut ideal = Object::new(crate::model::Surfels::default());
    ideal.sphere = Some(Sphere { radius: 1.0, colour: glam::Vec3::ONE });
    refused(&Scene::new([ideal]), 1 << 30, "ideal sphere");
    assert_eq!(numbers(&mut renderer, &scene(), &RenderOptions::default()).len(), 3);
}

//! Sequences of frames, and the meter.

use std::collections::VecDeque;
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
    let mut squashed = Object::new(Sphere { radius: 1.0, colour: glam::Vec3::ONE });
    squashed.transform.scale.y = 2.0;
    refused(&Scene::new([squashed]), 1 << 30, "has spheres");
    assert_eq!(numbers(&mut renderer, &scene(), &RenderOptions::default()).len(), 3);
}

/// The CPU as a device would be: it renders when it is waited for, and may have two frames under way.
#[derive(Default)]
struct Late {
    cpu: Cpu,
    under_way: VecDeque<Frame>,
    /// Calls of `begin` and `finish` so far, and those that fail.
    calls: [u32; 2],
    fails: [Option<u32>; 2],
}

impl Late {
    fn call(&mut self, which: usize) -> Result<(), BackendError> {
        self.calls[which] += 1;
        if self.fails[which] == Some(self.calls[which]) { Err(BackendError::Stopped) } else { Ok(()) }
    }
}

impl Backend for Late {
    fn describe(&self) -> String {
        "late".to_owned()
    }

    fn in_flight(&self) -> usize {
        2
    }

    fn begin(&mut self, frame: Frame) -> Result<(), BackendError> {
        self.call(0)?;
        self.under_way.push_back(frame);
        Ok(())
    }

    fn finish(&mut self) -> Result<Option<Rendered>, BackendError> {
        let frame = self.under_way.pop_front();
        self.call(1)?;
        frame.map(|frame| self.cpu.render(frame)).transpose()
    }

    fn abandon(&mut self) {
        self.under_way.pop_back();
    }

    fn heed(&mut self, _stop: Arc<Stop>) {}

    fn stop(&self) -> Arc<Stop> {
        Arc::default()
    }
}

/// A small scene of which blocks are refined, and its options.
fn refined() -> (Scene, RenderOptions) {
    let mut scene = Scene::load("scenes/swarm.xml").unwrap();
    (scene.image.width, scene.image.height) = (64, 40);
    (scene, RenderOptions { quality: "auto:0.006".parse().unwrap(), ..RenderOptions::default() })
}

/// The frames that come out of a queue, and the error that ends them.
fn sequence(backend: &mut dyn Backend, scene: &Scene, options: &RenderOptions) -> (Vec<Picture>, Option<BackendError>) {
    let mut pictures = Vec::new();
    for rendered in RenderedFrames::new(FrameQueue::new(backend, scene, options), [2.0, 2.5, 3.0, 4.0].into_iter()) {
        match rendered {
            Ok((_, Rendered { picture, .. })) => pictures.push(picture),
            Err(error) => return (pictures, Some(error)),
        }
    }
    (pictures, None)
}

/// Renderings of mode auto that come in turn with those of other frames are those of frames one by one.
#[test]
fn frames_under_way_together_are_frames_one_by_one() {
    let (scene, options) = refined();
    let mut late = Late::default();
    let (pictures, error) = sequence(&mut late, &scene, &options);
    assert!(error.is_none() && late.under_way.is_empty());
    for (frame, picture) in [2.0, 2.5, 3.0, 4.0].into_iter().zip(&pictures) {
        let alone = render_frame(&mut Cpu::default(), &scene, frame, &options).unwrap();
        assert!(alone.stats.achieved.unwrap().refined > 0, "frame {frame} has one round");
        assert!(alone.picture.rgba == picture.rgba, "frame {frame}");
        assert!(render_frame(&mut Late::default(), &scene, frame, &options).unwrap().picture.rgba == picture.rgba);
    }
    assert_eq!(pictures.len(), 4);
}

/// Whichever rendering fails: frames before it come out, then the error, and nothing stays under way.
#[test]
fn a_rendering_that_fails_ends_its_frame_alone() {
    let (scene, options) = refined();
    let mut all = Late::default();
    let (pictures, _) = sequence(&mut all, &scene, &options);
    let [begun, finished] = all.calls;
    assert!(begun == finished && begun >= 16, "{begun} begun, {finished} finished");
    for which in [0, 1] {
        let mut before = 0;
        for call in 1..=begun {
            let mut late = Late::default();
            late.fails[which] = Some(call);
            let (some, error) = sequence(&mut late, &scene, &options);
            assert!(matches!(error, Some(BackendError::Stopped)), "call {call}");
            assert!(late.under_way.is_empty(), "call {call}: {} under way", late.under_way.len());
            assert!(some.iter().zip(&pictures).all(|(a, b)| a.rgba == b.rgba), "call {call}");
            before = before.max(some.len());
            // A frame alone, too.
            let mut alone = Late { fails: late.fails, ..Late::default() };
            let rendered = render_frame(&mut alone, &scene, 2, &options);
            assert!(rendered.is_ok() || alone.under_way.is_empty());
        }
        assert_eq!(before, 3, "the last frame's renderings failed, too");
    }
}

#[test]
fn a_queue_gives_up_what_it_has_begun() {
    let (scene, options) = refined();
    let mut late = Late::default();
    let mut queue = FrameQueue::new(&mut late, &scene, &options).unwrap();
    for frame in [2, 3] {
        queue.begin(frame, ()).unwrap();
    }
    drop(queue);
    assert_eq!((late.under_way.len(), late.calls), (0, [4, 0]));
}

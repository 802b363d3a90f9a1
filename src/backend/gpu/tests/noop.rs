//! Calls to a device of hardware, counted without one: wgpu's `noop` adapter checks every call and runs none. So lists
//! are empty, pictures are black, and mode auto never goes on.

use glam::DVec3;
use wgpu::{BackendOptions, Backends, DeviceType, Instance, InstanceDescriptor, InstanceFlags, NoopBackendOptions};

use crate::backend::gpu::Gpu;
use crate::backend::gpu::device::{Device, UNCHECKED};
use crate::backend::gpu::pipelines::Pipelines;
use crate::backend::parity::captures;
use crate::backend::parity::cases::{ball, object, scene};
use crate::backend::{Backend, GpuCalls};
use crate::model::generate;
use crate::options::{BlurMode, Quality, RenderOptions};
use crate::renderer::{FrameQueue, render_frame};
use crate::scene::{Motion, Object, Scene};

/// A backend with the schedule of hardware.
fn hardware() -> Gpu {
    let descriptor = InstanceDescriptor {
        backends: Backends::NOOP,
        flags: InstanceFlags::default() - UNCHECKED,
        backend_options: BackendOptions { noop: NoopBackendOptions::enabled(), ..BackendOptions::default() },
        ..InstanceDescriptor::new_without_display_handle()
    };
    let adapters = pollster::block_on(Instance::new(descriptor).enumerate_adapters(Backends::NOOP));
    let mut info = adapters[0].get_info();
    info.device_type = DeviceType::DiscreteGpu;
    let device = Device::of(&adapters[0], info).unwrap();
    let mut gpu = Gpu::on(device, Pipelines::default()).unwrap();
    // As much as GPUs bind.
    gpu.most_bytes = (1 << 31) - 1024;
    gpu
}

/// The calls of the second of two equal frames.
fn steady(gpu: &mut dyn Backend, scene: &Scene, options: &RenderOptions) -> GpuCalls {
    let [_, second] = [(); 2].map(|()| render_frame(gpu, scene, 0, options).unwrap().stats.gpu.unwrap());
    eprintln!("{second:?}");
    second
}

#[test]
fn a_frame_is_one_submission_of_few_dispatches() {
    let mut gpu = hardware();
    // About as many surfels as `three_objects` has, and as many pixels.
    let moves = |number: u64, velocity: DVec3| {
        let mut moving = object(ball(30_000, number, false), DVec3::new(0.0, 0.5, -0.5 * number as f64));
        moving.motions = vec![Motion::Linear { velocity }];
        moving
    };
    let still = object(ball(50_000, 1, true), DVec3::new(-0.2, 0.0, -3.0));
    let scene =
        scene(vec![still, moves(2, 0.1 * DVec3::X), moves(3, 0.1 * DVec3::Y), moves(4, 0.1 * DVec3::Z)], [960, 540]);
    let auto = RenderOptions::default();
    let calls = steady(&mut gpu, &scene, &auto);
    assert_eq!((calls.submissions, calls.bind_groups), (2, 0), "two halves of the first round: {calls:?}");
    assert!(calls.dispatches <= 120 && calls.writes <= 12 && calls.maps <= 4, "{calls:?}");
    assert!(calls.bytes_down <= 17_000_000, "{calls:?}");

    // Many instants are a few rounds.
    let options = RenderOptions { quality: Quality::from(BlurMode::supersample(64)), ..auto };
    let calls = steady(&mut gpu, &scene, &options);
    assert_eq!((calls.submissions, calls.waits, calls.bind_groups), (1, 1, 0), "{calls:?}");
    assert!(calls.dispatches <= 400 && calls.writes <= 8 && calls.maps <= 2, "{calls:?}");
}

/// All instants of a capture are sorted together, and what is see-through is peeled together.
#[test]
fn captures_are_one_submission_of_few_dispatches() {
    let mut gpu = hardware();
    let cloud = |seed| object(captures::cloud(20_000, seed, 1, false), DVec3::new(0.1, 0.0, -0.5));
    let mut moving = cloud(1);
    moving.motions = vec![Motion::Linear { velocity: 0.1 * DVec3::X }];
    let options = RenderOptions { quality: Quality::from(BlurMode::supersample(64)), ..RenderOptions::default() };
    let alone = scene(vec![moving, cloud(2)], [960, 540]);
    let calls = steady(&mut gpu, &alone, &options);
    // Eight rounds of 37 or 38 dispatches, where 64 instants took 2,000.
    assert_eq!((calls.submissions, calls.waits, calls.bind_groups), (1, 1, 0), "{calls:?}");
    assert!(calls.dispatches <= 320 && calls.writes <= 8 && calls.maps <= 2, "{calls:?}");

    // Each layer takes five dispatches more.
    let mut glass = object(ball(5_000, 3, false), DVec3::ZERO);
    glass.opacity = 0.5;
    let both = scene(vec![cloud(2), glass], [480, 270]);
    let calls = steady(&mut gpu, &both, &options);
    assert_eq!((calls.submissions, calls.waits, calls.bind_groups), (1, 1, 0), "{calls:?}");
    assert!(calls.dispatches <= 600 && calls.writes <= 8, "{calls:?}");
}

/// The calls of each of some frames, of which two are under way together.
fn sequence(gpu: &mut dyn Backend, scene: &Scene, options: &RenderOptions, frames: i32) -> Vec<GpuCalls> {
    let mut queue = FrameQueue::new(gpu, scene, options).unwrap();
    let mut calls = Vec::new();
    for frame in 0..frames {
        queue.begin(frame, ()).unwrap();
        while let Some(done) = queue.ready().unwrap() {
            calls.push(done.rendered.unwrap().stats.gpu.unwrap());
        }
    }
    while let Some(done) = queue.finish().unwrap() {
        calls.push(done.rendered.unwrap().stats.gpu.unwrap());
    }
    calls
}

/// In a sequence the device always has work. Cuts of detail are other models in each frame, and take the rooms of those
/// before.
#[test]
fn frames_of_a_sequence_neither_wait_nor_bind() {
    let mut gpu = hardware();
    let falls = |number: u64| {
        let mut falling = Object::from_cloud(generate::sphere(30_000)).unwrap();
        falling.transform.translate = DVec3::new(3.0 * number as f64 - 7.5, 0.0, -24.0);
        falling.motions = vec![Motion::Linear { velocity: 0.2 * DVec3::Z }];
        falling
    };
    let scene = scene((1..5).map(falls).collect(), [320, 180]);
    let calls = sequence(&mut gpu, &scene, &RenderOptions::default(), 16);
    assert_eq!(calls.len(), 16);
    assert!(calls[..15].iter().all(|calls| calls.waits == 0 && calls.submissions == 2 && calls.writes <= 12));
    // By then there are rooms for the cuts of all frames that are under way together.
    let settled = &calls[7..13];
    assert_eq!(settled.iter().map(|calls| calls.bind_groups).sum::<u64>(), 0);
    let cuts = settled.iter().filter(|calls| calls.bytes_up > 1_000_000).count();
    assert!(cuts >= 4, "models were uploaded in {cuts} of {} frames", settled.len());
}

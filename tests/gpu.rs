//! The GPU backend against the CPU's, whole images. Parity pass by pass: src/backend/gpu/tests.

#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stderr, reason = "tests may stop and report")]

mod support;

use splatblur::backend::cpu::Cpu;
use splatblur::plan::{BlurMode, RenderOptions};
use splatblur::render::render_frame;
use support::gpu::gpu_or_skip;
use support::sphere_scene;

#[test]
fn quick() {
    let Some(mut gpu) = gpu_or_skip("quick") else { return };
    for (mode, moving) in [(BlurMode::Still { pixel_samples: 2 }, false), (BlurMode::supersample(3), true)] {
        let scene = sphere_scene(20_000, 200, moving);
        let options = RenderOptions { mode, ..RenderOptions::default() };
        let want = render_frame(&mut Cpu::default(), &scene, 0, &options).unwrap();
        let start = std::time::Instant::now();
        let got = render_frame(&mut gpu, &scene, 0, &options).unwrap();
        let mut worst = 0.0_f32;
        let mut count = 0;
        for (a, b) in want.picture.rgba.iter().flatten().zip(got.picture.rgba.iter().flatten()) {
            worst = worst.max((a - b).abs());
            count += usize::from((a - b).abs() > 1.0 / 255.0);
        }
        eprintln!("worst {worst}, {count} > 1/255, {:?} {:?}", start.elapsed(), got.stats);
        eprintln!("{:?}", want.stats);
    }
}

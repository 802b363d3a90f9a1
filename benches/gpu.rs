//! The GPU backend beside the CPU backend, in one run: frames a second and time of each pass, as tables in Markdown.
//!
//! `cargo bench --bench gpu [-- --adapter NAME]`. On hardware: the thesis's numbers of surfels (its table 5.1) at 1024 x 1024,
//! and 10^7 surfels at 1920 x 1080. On a software device: a tenth of the surfels at 256 x 256, and 10^5 surfels.
//! Loading and writing are excluded; frames are rendered one at a time, development of the film included.

#![allow(clippy::expect_used, clippy::print_stdout, reason = "a bench may stop and reports")]

#[path = "../tests/support/mod.rs"]
mod support;

use std::time::{Duration, Instant};

use splatblur::backend::Backend;
use splatblur::backend::cpu::Cpu;
use splatblur::backend::gpu::{Choice, Gpu, adapters};
use splatblur::plan::{BlurMode, Prefilter, RenderOptions};
use splatblur::render::{Stats, render_frame};
use splatblur::scene::Scene;
use support::sphere_scene;

/// Surfels of the thesis's three scenes, and its frames a second for a still, N = 10 and N = 50 (table 5.1).
const THESIS: [(usize, [f64; 3]); 3] =
    [(50_000, [39.6, 7.9, 2.3]), (466_000, [29.9, 4.7, 1.1]), (445_000, [37.9, 10.3, 4.4])];

/// Best of some frames: wall time, and what the passes took in that frame.
fn best(backend: &mut dyn Backend, scene: &Scene, mode: BlurMode, times: usize) -> (Duration, Stats) {
    let options = RenderOptions { mode, prefilter: Prefilter::None, memory: 64 << 30, ..RenderOptions::default() };
    let frame = |backend: &mut dyn Backend| {
        let start = Instant::now();
        let rendered = render_frame(backend, scene, 0, &options).expect("the frame fits");
        (start.elapsed(), rendered.stats)
    };
    // The first one compiles programs and makes room.
    frame(backend);
    (0..times).map(|_| frame(backend)).min_by_key(|(time, _)| *time).expect("at least one frame")
}

fn milliseconds(time: Duration) -> f64 {
    1e3 * time.as_secs_f64()
}

/// Bytes that the passes of a still move to and from the device's memory, counted from the layouts, without caches: per surfel
/// 36 of geometry and 4 + 3 x 4 of its count; per splat 64 + 8 + 64 + 48 of itself and its attributes; per entry (about one a
/// splat at these sizes) three rounds of sorting.
fn bytes(stats: &Stats) -> f64 {
    stats.surfels as f64 * 52.0 + stats.splats as f64 * (64.0 + 8.0 + 64.0 + 48.0 + 3.0 * 20.0)
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let name = arguments.iter().position(|a| a == "--adapter").and_then(|i| arguments.get(i + 1)).cloned();
    let mut gpu = match Gpu::open(&Choice { name, hardware_only: false }) {
        Ok(gpu) => gpu,
        Err(why) => return println!("{why}"),
    };
    let software = adapters().iter().any(|a| a.name == gpu.adapter() && a.kind == "software");
    let (size, repeats, fewer) = if software { (256, 3, 10) } else { (1024, 10, 1) };
    let mut cpu = Cpu::default();
    println!("{} beside {}, {size} x {size}\n", gpu.describe(), cpu.describe());

    println!("| surfels | time samples | GPU, ms | CPU, ms | CPU is faster by | GPU, frames/s | thesis, frames/s |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for (surfels, thesis) in THESIS {
        let surfels = surfels / fewer;
        let scene = sphere_scene(surfels, size, true);
        let modes = [1, 10, 50].map(BlurMode::supersample);
        for ((mode, samples), rate) in modes.into_iter().zip([1, 10, 50]).zip(thesis) {
            let (on_gpu, _) = best(&mut gpu, &scene, mode, repeats);
            let (on_cpu, _) = best(&mut cpu, &scene, mode, repeats);
            println!(
                "| {surfels} | {samples} | {:.1} | {:.1} | {:.2} | {:.1} | {rate} |",
                milliseconds(on_gpu),
                milliseconds(on_cpu),
                on_gpu.as_secs_f64() / on_cpu.as_secs_f64(),
                1.0 / on_gpu.as_secs_f64(),
            );
        }
    }

    let (surfels, width, height) = if software { (100_000, 256, 256) } else { (10_000_000, 1920, 1080) };
    let mut scene = sphere_scene(surfels, height, false);
    scene.image.width = width;
    let (time, stats) = best(&mut gpu, &scene, BlurMode::Still { pixel_samples: 1 }, repeats);
    let passes = [stats.project, stats.bin, stats.visibility, stats.attribute, stats.resolve];
    let device: Duration = passes.iter().sum();
    println!("\nA still of {surfels} surfels, {width} x {height}: {:.2} ms, on the device:\n", milliseconds(time));
    println!("| project | bin | visibility | attribute | resolve | all | surfels/s | moved/surfel | moved/s |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let columns: Vec<String> = passes.iter().map(|&pass| format!("{:.2} ms", milliseconds(pass))).collect();
    println!(
        "| {} | {:.2} ms | {:.2} M | {:.0} bytes | {:.3} GB |",
        columns.join(" | "),
        milliseconds(device),
        surfels as f64 / device.as_secs_f64() / 1e6,
        bytes(&stats) / surfels as f64,
        bytes(&stats) / device.as_secs_f64() / 1e9,
    );
}

//! The GPU backend beside the CPU backend, in one run: frames a second and time of each pass, as tables in Markdown.
//!
//! `cargo bench --bench gpu [-- --adapter NAME]`. On hardware it renders the numbers of surfels of Wolf 2008, table
//! 5.1, at 1024 x 1024, and 10^7 surfels at 1920 x 1080. On a software device it renders a tenth of the surfels at
//! 256 x 256, and 10^5 surfels. Times exclude loading and writing, and include development of the film. Frames do not
//! overlap.
//!
//! `cargo bench --bench gpu -- --modes [SURFELS]` measures seconds of a frame in all blur modes at 512 x 512, and of
//! kernels that sweep twice as far each time. On a software device a million surfels take half an hour.

#![allow(clippy::expect_used, clippy::print_stdout, reason = "a bench may stop and reports")]

#[path = "../tests/support/mod.rs"]
mod support;

use std::time::{Duration, Instant};

use splatblur::backend::Backend;
use splatblur::backend::cpu::Cpu;
use splatblur::backend::gpu::{Choice, Gpu, adapters};
use splatblur::options::{BlurMode, Interleave, Prefilter, RenderOptions, SweptKernel, Times};
use splatblur::renderer::{Stats, render_frame};
use splatblur::scene::{Motion, Scene};
use support::sphere_scene;

/// Wolf 2008, table 5.1: surfels of three scenes, and frames a second for a still, N = 10 and N = 50.
const WOLF_2008: [(usize, [f64; 3]); 3] =
    [(50_000, [39.6, 7.9, 2.3]), (466_000, [29.9, 4.7, 1.1]), (445_000, [37.9, 10.3, 4.4])];

/// The fastest of some frames: its wall time, and the times of its passes.
fn best(backend: &mut dyn Backend, scene: &Scene, mode: BlurMode, times: usize) -> (Duration, Stats) {
    let options = RenderOptions {
        quality: mode.into(),
        prefilter: Prefilter::None,
        memory: 64 << 30,
        ..RenderOptions::default()
    };
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

/// Bytes that the passes of a still move to and from the device's memory, counted from the layouts, without caches.
/// Each surfel takes 36 for geometry and 4 + 3 x 4 for its count. Each splat takes 64 + 8 + 64 + 48 for itself and its
/// attributes. Each entry (about one for each splat at these sizes) takes three rounds of sorting.
fn bytes(stats: &Stats) -> f64 {
    stats.surfels as f64 * 52.0 + stats.splats as f64 * (64.0 + 8.0 + 64.0 + 48.0 + 3.0 * 20.0)
}

/// Times of the passes, in their order.
const fn passes(stats: &Stats) -> [Duration; 5] {
    [stats.project, stats.bin, stats.visibility, stats.attribute, stats.resolve]
}

fn volumetric(intervals: u32, swept: SweptKernel) -> BlurMode {
    BlurMode::Volumetric { intervals, pixel_samples: None, swept }
}

/// Seconds of a frame in each mode on both backends, and their ratio to supersampling with 8 samples. They are the
/// least of three frames, or those of the only frame where it takes more than half a minute.
fn modes(gpu: &mut Gpu, cpu: &mut Cpu, surfels: usize) {
    let modes = [
        BlurMode::supersample(8),
        BlurMode::supersample(10),
        BlurMode::supersample(16),
        BlurMode::supersample(32),
        BlurMode::interleaved(8, Interleave::Two),
        BlurMode::Bucket {
            buckets: 8,
            samples: 4,
            pixel_samples: None,
            interleave: Interleave::None,
            times: Times::Even,
        },
        volumetric(1, SweptKernel::default()),
        volumetric(3, SweptKernel::default()),
        volumetric(10, SweptKernel::default()),
        volumetric(10, SweptKernel::PUBLISHED),
    ];
    let scene = sphere_scene(surfels, 512, true);
    let mut first = None;
    println!("| surfels | mode | CPU, s | over supersample 8 | GPU, s | over supersample 8 |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for mode in modes {
        let options = RenderOptions {
            quality: mode.into(),
            prefilter: Prefilter::None,
            memory: 64 << 30,
            ..RenderOptions::default()
        };
        let frame = |backend: &mut dyn Backend| {
            let start = Instant::now();
            render_frame(backend, &scene, 0, &options).expect("the frame fits");
            start.elapsed().as_secs_f64()
        };
        // The first of them compiles programs, which is nothing beside a slow one.
        let least = |backend: &mut dyn Backend| {
            let first = frame(backend);
            let others = if first > 30.0 { 0 } else { 2 };
            (0..others).map(|_| frame(backend)).fold(first, f64::min)
        };
        let [on_cpu, on_gpu] = [least(cpu), least(gpu)];
        let (cpu_first, gpu_first) = *first.get_or_insert((on_cpu, on_gpu));
        println!(
            "| {surfels} | {mode} | {on_cpu:.3} | {:.2} | {on_gpu:.4} | {:.2} |",
            on_cpu / cpu_first,
            on_gpu / gpu_first
        );
    }
}

/// Seconds of the attribute pass in one interval, in which kernels travel twice as far each time.
fn travel(gpu: &mut Gpu, cpu: &mut Cpu, surfels: usize) {
    let mut scene = sphere_scene(surfels, 512, false);
    println!("\n| surfels | travel, pixels | attribute on the CPU, s | on the GPU, s |");
    println!("| --- | --- | --- | --- |");
    for step in 0..5 {
        let way = 0.125 * f64::from(1 << step);
        scene.objects[0].motions = vec![Motion::Linear { velocity: glam::DVec3::new(way, 0.0, 0.0) }];
        let mode = volumetric(1, SweptKernel::default());
        let [on_cpu, on_gpu] =
            [best(cpu, &scene, mode, 2).1.attribute, best(gpu, &scene, mode, 1).1.attribute].map(|d| d.as_secs_f64());
        // The sphere's centre is at depth 4.
        let pixels = way / 4.0 * 256.0 / 20_f64.to_radians().tan();
        println!("| {surfels} | {pixels:.0} | {on_cpu:.3} | {on_gpu:.4} |");
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let name = arguments.iter().position(|a| a == "--adapter").and_then(|i| arguments.get(i + 1)).cloned();
    let mut gpu = match Gpu::open(&Choice { name, hardware_only: false }) {
        Ok(gpu) => gpu,
        Err(why) => return println!("{why}"),
    };
    let software = adapters().iter().any(|a| a.name == gpu.adapter() && a.kind == "software");
    if let Some(at) = arguments.iter().position(|a| a == "--modes") {
        let mut cpu = Cpu::default();
        println!("{} beside {}, 512 x 512\n", gpu.describe(), cpu.describe());
        let counts: Vec<usize> =
            arguments.get(at + 1).and_then(|n| n.parse().ok()).map_or(vec![50_000, 1_000_000], |n| vec![n]);
        for surfels in counts {
            modes(&mut gpu, &mut cpu, surfels);
        }
        travel(&mut gpu, &mut cpu, 50_000);
        return;
    }
    let (size, repeats, fewer) = if software { (256, 3, 10) } else { (1024, 10, 1) };
    let mut cpu = Cpu::default();
    println!("{} beside {}, {size} x {size}\n", gpu.describe(), cpu.describe());

    println!("| surfels | time samples | GPU, ms | CPU, ms | CPU is faster by | GPU, frames/s | Wolf 2008, frames/s |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    let mut on_device = Vec::new();
    for (surfels, published) in WOLF_2008 {
        let surfels = surfels / fewer;
        let scene = sphere_scene(surfels, size, true);
        let modes = [1, 10, 50].map(BlurMode::supersample);
        for ((mode, samples), rate) in modes.into_iter().zip([1, 10, 50]).zip(published) {
            let (on_gpu, stats) = best(&mut gpu, &scene, mode, repeats);
            let (on_cpu, _) = best(&mut cpu, &scene, mode, repeats);
            println!(
                "| {surfels} | {samples} | {:.1} | {:.1} | {:.2} | {:.1} | {rate} |",
                milliseconds(on_gpu),
                milliseconds(on_cpu),
                on_gpu.as_secs_f64() / on_cpu.as_secs_f64(),
                1.0 / on_gpu.as_secs_f64(),
            );
            let columns = passes(&stats).map(|pass| format!("{:.2}", milliseconds(pass)));
            on_device.push(format!("| {surfels} | {samples} | {} |", columns.join(" | ")));
        }
    }
    println!("\nMilliseconds of the passes on the device:\n");
    println!("| surfels | time samples | project | bin | visibility | attribute | resolve |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for row in on_device {
        println!("{row}");
    }

    let (surfels, width, height) = if software { (100_000, 256, 256) } else { (10_000_000, 1920, 1080) };
    let mut scene = sphere_scene(surfels, height, false);
    scene.image.width = width;
    let (time, stats) = best(&mut gpu, &scene, BlurMode::Still { pixel_samples: 1 }, repeats);
    let passes = passes(&stats);
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

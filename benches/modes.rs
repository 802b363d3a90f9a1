//! CPU seconds of a frame by blur mode, split by pass: the tables of docs/measurements/interleaving.md and
//! performance.md.
//!
//! `cargo bench --bench modes [-- [WORD ...] [SURFELS ...]]`: only modes whose names contain one of the words, only
//! these numbers of surfels. The modes take turns, and the least of some rounds counts, so that ratios survive a busy
//! computer.

#![allow(clippy::expect_used, clippy::print_stdout, reason = "a bench may stop and reports")]

#[path = "../tests/support/mod.rs"]
mod support;

use std::time::{Duration, Instant};

use splatblur::backend::cpu::Cpu;
use splatblur::options::{BlurMode, Interleave, Look, Prefilter, RenderOptions, Shading, SweptKernel, Times};
use splatblur::renderer::{Stats, render_frame};
use support::sphere_scene;

const ROUNDS: usize = 5;

fn modes() -> Vec<BlurMode> {
    let lattice = |samples, interleave| BlurMode::interleaved(samples, interleave);
    let volumetric = |intervals, swept| BlurMode::Volumetric { intervals, pixel_samples: None, swept };
    vec![
        BlurMode::supersample(8),
        lattice(8, Interleave::Two),
        lattice(8, Interleave::Four),
        BlurMode::supersample(16),
        BlurMode::supersample(32),
        BlurMode::Bucket {
            buckets: 8,
            samples: 4,
            pixel_samples: None,
            interleave: Interleave::None,
            times: Times::Even,
        },
        BlurMode::Bucket {
            buckets: 8,
            samples: 4,
            pixel_samples: None,
            interleave: Interleave::Two,
            times: Times::Even,
        },
        volumetric(1, SweptKernel::default()),
        volumetric(3, SweptKernel::default()),
        volumetric(10, SweptKernel::default()),
        volumetric(10, SweptKernel::PUBLISHED),
    ]
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let (numbers, words): (Vec<_>, Vec<_>) = arguments.into_iter().partition(|a| a.parse::<usize>().is_ok());
    let mut counts: Vec<usize> = numbers.iter().filter_map(|n| n.parse().ok()).collect();
    if counts.is_empty() {
        counts = vec![50_000, 1_000_000];
    }
    let of_mode =
        |mode: &BlurMode| words.is_empty() || words.iter().any(|word| mode.to_string().contains(word.as_str()));
    let modes: Vec<BlurMode> = modes().into_iter().filter(of_mode).collect();
    let threads = rayon::current_num_threads();
    println!("{threads} threads, 512 x 512, milliseconds; passes: CPU time over all threads\n");
    for shading in [Shading::Phong, Shading::Gouraud] {
        for &surfels in &counts {
            let scene = sphere_scene(surfels, 512, true);
            let mut best: Vec<Option<(Duration, Stats)>> = modes.iter().map(|_| None).collect();
            let mut cpu = Cpu::default();
            for _ in 0..ROUNDS {
                for (&mode, best) in modes.iter().zip(&mut best) {
                    let options = RenderOptions {
                        quality: mode.into(),
                        prefilter: Prefilter::None,
                        look: Look { shading, ..Look::default() },
                        ..RenderOptions::default()
                    };
                    let start = Instant::now();
                    let stats = render_frame(&mut cpu, &scene, 0, &options).expect("the frame fits").stats;
                    let wall = start.elapsed();
                    if best.as_ref().is_none_or(|(least, _)| wall < *least) {
                        *best = Some((wall, stats));
                    }
                }
            }
            println!("{surfels} surfels, {shading:?}\n");
            println!("| mode | wall | ratio | project + bin | visibility | attribute | resolve | splats |");
            println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
            let first = best.iter().flatten().next().map_or(Duration::ZERO, |(wall, _)| *wall);
            for (mode, (wall, stats)) in modes.iter().zip(best.iter().flatten()) {
                let ms = |time: Duration| format!("{:.1}", 1e3 * time.as_secs_f64());
                println!(
                    "| {mode} | {} | {:.2} | {} | {} | {} | {} | {} |",
                    ms(*wall),
                    wall.as_secs_f64() / first.as_secs_f64(),
                    ms(stats.project),
                    ms(stats.visibility),
                    ms(stats.attribute),
                    ms(stats.resolve),
                    stats.splats,
                );
            }
            println!();
        }
    }
}

//! Whole frames of the speed-test sphere, and their split by pass. Loading and writing are excluded.
//!
//! `cargo bench --bench render`. On one thread wall time is CPU time, which is what `docs/measurements/performance.md`
//! quotes for moving scenes; `threads=all` is what a user waits for. The 10^7 case takes a while to build:
//! `cargo bench -- 10000000`.

#![allow(clippy::expect_used, reason = "a bench may stop")]

#[path = "../tests/support/mod.rs"]
mod support;

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use splatblur::backend::cpu::Cpu;
use splatblur::options::{BlurMode, Prefilter, RenderOptions};
use splatblur::renderer::{Stats, render_frame};
use support::{hall_scene, sphere_scene};

fn options(mode: BlurMode) -> RenderOptions {
    RenderOptions { quality: mode.into(), prefilter: Prefilter::None, ..RenderOptions::default() }
}

const STILL: BlurMode = BlurMode::Still { pixel_samples: 1 };
const SIXTEEN: BlurMode = BlurMode::supersample(16);

fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool")
}

fn frames(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame");
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    let cases = [
        ("still", 1024, false, STILL, &[10_000, 100_000, 1_000_000, 10_000_000][..]),
        ("supersample16", 512, true, SIXTEEN, &[50_000, 277_000, 1_000_000][..]),
    ];
    for (name, size, moving, mode, counts) in cases {
        for &surfels in counts {
            for (label, threads) in [("1", 1), ("all", 0)] {
                let id = BenchmarkId::new(format!("{name}/threads={label}"), surfels);
                // The scene is built only for benches that the filter lets through.
                let mut scene = None;
                let pool = pool(threads);
                group.bench_function(id, |bencher| {
                    let scene = scene.get_or_insert_with(|| sphere_scene(surfels, size, moving));
                    let mut cpu = Cpu::default();
                    let options = options(mode);
                    pool.install(|| bencher.iter(|| black_box(render_frame(&mut cpu, scene, 0, &options))));
                });
            }
        }
    }
}

/// A floor under the camera: surfels that reach the camera plane.
fn halls(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("hall");
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    for surfels in [100_000, 1_000_000] {
        for prefilter in [Prefilter::None, Prefilter::Ewa] {
            let mut scene = None;
            let pool = pool(1);
            group.bench_function(BenchmarkId::new(format!("still/{prefilter}"), surfels), |bencher| {
                let scene = scene.get_or_insert_with(|| hall_scene(surfels, [960, 540]));
                let options = RenderOptions { prefilter, ..options(STILL) };
                let mut cpu = Cpu::default();
                pool.install(|| bencher.iter(|| black_box(render_frame(&mut cpu, scene, 0, &options))));
            });
        }
    }
}

type Split = fn(&Stats) -> Duration;

fn passes(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("pass");
    group.sample_size(10).measurement_time(Duration::from_secs(3));
    let split: [(&str, Split); 4] = [
        ("project+bin", |stats| stats.project),
        ("visibility", |stats| stats.visibility),
        ("attribute", |stats| stats.attribute),
        ("resolve", |stats| stats.resolve),
    ];
    let scene = sphere_scene(1_000_000, 1024, false);
    let pool = pool(1);
    for (name, time) in split {
        group.bench_function(BenchmarkId::new("still", name), |bencher| {
            let mut cpu = Cpu::default();
            let options = options(STILL);
            bencher.iter_custom(|times| {
                let frame = |_| render_frame(&mut cpu, &scene, 0, &options).expect("the frame fits");
                pool.install(|| (0..times).map(frame).map(|rendered| time(&rendered.stats)).sum())
            });
        });
    }
}

criterion_group!(benches, frames, halls, passes);
criterion_main!(benches);

//! Speed of the reference on the speed-test sphere: samples a second with the building of the hierarchy included, at
//! 512 x 512.
//!
//! `cargo bench --bench reference [-- SAMPLES [SURFELS]]`. Each case runs once, for seconds: not a matter for
//! criterion.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "a bench may stop and report")]

#[path = "../tests/support/mod.rs"]
mod support;

use std::time::Instant;

use splatblur::reference::{ReferenceOptions, render};
use support::sphere_scene;

fn main() {
    let numbers: Vec<u64> = std::env::args().filter_map(|arg| arg.parse().ok()).collect();
    let samples = numbers.first().copied().unwrap_or(64);
    let sizes = numbers.get(1).map_or(vec![50_000, 277_000, 1_000_000], |&n| vec![n]);
    println!("{} threads, {samples} samples a pixel", rayon::current_num_threads());
    for surfels in sizes {
        let scene = sphere_scene(surfels as usize, 512, true);
        {
            let options = ReferenceOptions { samples, ..ReferenceOptions::default() };
            let start = Instant::now();
            let reference = render(&scene, 0, &options, None, &|_| ()).expect("valid options");
            let (wall, stats) = (start.elapsed().as_secs_f64(), reference.stats);
            let alpha = reference.sums.mean_coverage();
            println!(
                "{surfels:>8} surfels: {:.2} M samples/s, build {:.3} s, trace {:.3} s, {:.1} bytes a surfel, coverage \
                 {alpha:.3}, mean standard error {:.2e}",
                stats.traced as f64 / wall / 1e6,
                stats.build.as_secs_f64(),
                stats.trace.as_secs_f64(),
                stats.hierarchy_bytes as f64 / stats.surfels as f64,
                stats.mean_error,
            );
        }
    }
}

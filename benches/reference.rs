//! Speed of the reference on the speed-test sphere: samples a second with the building of the hierarchy included, at
//! 512 x 512.
//!
//! `cargo bench --bench reference [-- SAMPLES [SURFELS]]`. Each case runs once, for seconds: not a matter for
//! criterion. With the word `moving`: spheres of 20,000 surfels with velocities of their own beside one at rest, at
//! 320 x 240.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "a bench may stop and report")]

#[path = "../tests/support/mod.rs"]
mod support;

use std::time::Instant;

use splatblur::glam::Vec3;
use splatblur::reference::{ReferenceOptions, render};
use splatblur::sampling::hash;
use splatblur::{Shape, Surfels, VelocityUnit};
use support::{object, sphere_scene};

fn main() {
    let numbers: Vec<u64> = std::env::args().filter_map(|arg| arg.parse().ok()).collect();
    let samples = numbers.first().copied().unwrap_or(64);
    let sizes = numbers.get(1).map_or(vec![50_000, 277_000, 1_000_000], |&n| vec![n]);
    println!("{} threads, {samples} samples a pixel", rayon::current_num_threads());
    if std::env::args().any(|arg| arg == "moving") {
        return moving(samples, numbers.get(1).copied().unwrap_or(1));
    }
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

/// Ways in which points move by themselves.
const WAYS: [&str; 7] = ["at rest", "burst", "one way", "rotation", "random", "random, fast", "one in a hundred"];

/// Surfels of a sphere, as scenes of each of [`WAYS`].
fn moving(samples: u64, seed: u64) {
    let mut rigid = 0.0;
    for way in WAYS {
        let mut scene = sphere_scene(20_000, 320, false);
        scene.image.height = 240;
        let Shape::Surfels { model, .. } = &scene.objects[0].shape else { panic!("surfels") };
        let mut surfels = Surfels::clone(model.surfels());
        let turn = Vec3::new(0.0, 0.8, 0.0);
        let velocity = |(i, &p): (usize, &Vec3)| {
            let random = |k: u64| f64::from(hash(seed << 32 | i as u64, k)) as f32 / 4_294_967_296.0;
            let any = Vec3::new(random(0), random(1), random(2)) * 2.0 - 1.0;
            match way {
                "burst" => 0.4 * p,
                "one way" => Vec3::new(0.4, 0.1, 0.0),
                "rotation" => turn.cross(p),
                "random" => 0.5 * any,
                "random, fast" => 4.0 * any,
                _ if random(3) < 0.01 => 2.0 * any,
                _ => Vec3::ZERO,
            }
        };
        if way != "at rest" {
            surfels.velocity = surfels.position.iter().enumerate().map(velocity).collect();
            surfels.velocity_unit = VelocityUnit::Frame;
        }
        if way == "rotation" {
            surfels.acceleration = surfels.velocity.iter().map(|&v| turn.cross(v)).collect();
        }
        scene.objects[0].shape = object(surfels).shape;
        let options = ReferenceOptions { samples, ..ReferenceOptions::default() };
        let stats = render(&scene, 0, &options, None, &|_| ()).expect("valid options").stats;
        let rate = stats.traced as f64 / (stats.build + stats.trace).as_secs_f64() / 1e6;
        if way == "at rest" {
            rigid = rate;
        }
        println!(
            "{way:>16}: {rate:.2} M samples/s, {:.1} times slower, build {:.3} s, trace {:.3} s, {:.1} MB",
            rigid / rate,
            stats.build.as_secs_f64(),
            stats.trace.as_secs_f64(),
            stats.hierarchy_bytes as f64 / 1e6,
        );
    }
}

//! Tests that reach into the backend: programs and layouts (`wgsl`), parity with the CPU's passes (`parity`), broken programs
//! (`mutants`), buffers that are too small (`room`), kernels in motion (`swept`).
#![allow(clippy::panic, clippy::print_stderr, reason = "tests may stop and report")]

mod cases;
mod harness;
mod mutants;
mod parity;
mod room;
mod swept;
mod wgsl;

use super::{Choice, Gpu};

/// Opens any adapter; where there is none, says so and skips, unless `REQUIRE_GPU` is set.
fn gpu_or_skip(test: &str) -> Option<Gpu> {
    match Gpu::open(&Choice::default()) {
        Ok(gpu) => Some(gpu),
        Err(why) if std::env::var_os("REQUIRE_GPU").is_none() => {
            eprintln!("SKIPPED {test}: {why}");
            None
        }
        Err(why) => panic!("REQUIRE_GPU is set, but {test} found no GPU: {why}"),
    }
}

//! A GPU for a test, or a reason why there is none.

use splatblur::backend::gpu::{Choice, Gpu};

/// Opens any adapter; where there is none, says so and skips, unless `REQUIRE_GPU` is set.
pub fn gpu_or_skip(test: &str) -> Option<Gpu> {
    match Gpu::open(&Choice::default()) {
        Ok(gpu) => {
            eprintln!("{test}: on {}", gpu.adapter());
            Some(gpu)
        }
        Err(why) if std::env::var_os("REQUIRE_GPU").is_none() => {
            eprintln!("SKIPPED {test}: {why}");
            None
        }
        Err(why) => panic!("REQUIRE_GPU is set, but {test} found no GPU: {why}"),
    }
}

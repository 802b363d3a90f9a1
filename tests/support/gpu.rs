//! A GPU for a test, or a reason why there is none. The unit tests of the backend include this file too.

use std::io::Write;

use super::{Choice, Gpu};

/// Opens any adapter; where there is none, says so and skips, unless `REQUIRE_GPU` is set.
pub fn gpu_or_skip(test: &str) -> Option<Gpu> {
    match Gpu::open(&Choice::default()) {
        Ok(gpu) => {
            log(&format!("{test} on {}", gpu.adapter()));
            Some(gpu)
        }
        Err(why) if std::env::var_os("REQUIRE_GPU").is_none() => {
            log(&format!("SKIPPED {test}: {why}"));
            // Past the capture of the test harness: a skip is never silent.
            let _ = writeln!(std::io::stderr(), "SKIPPED {test}: {why}");
            None
        }
        Err(why) => panic!("REQUIRE_GPU is set, but {test} found no GPU: {why}"),
    }
}

/// One line for `tests/run`, which counts them.
fn log(line: &str) {
    if let Some(path) = std::env::var_os("GPU_TEST_LOG") {
        let file = std::fs::OpenOptions::new().append(true).create(true).open(path);
        let _ = file.and_then(|mut file| file.write_all(format!("{line}\n").as_bytes()));
    }
}

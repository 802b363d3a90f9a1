//! The program as a user meets it: what it writes, what it prints, what it refuses.

#[path = "../support/mod.rs"]
mod support;

#[path = "../support/saved.rs"]
#[allow(clippy::unwrap_used, clippy::expect_used, clippy::cast_lossless, reason = "tests may stop")]
mod saved;

mod coloured;
mod compare;
mod convert;
mod dataset;
mod environments;
mod gpu;
mod hostile_input;
mod input;
mod licences;
mod meshes;
mod messages;
mod movie;
mod pipes;
mod reference;
mod render;
mod report;
mod saves;
#[cfg(feature = "formats")]
mod scans;
mod shell;
mod studio;
mod training;
mod volumes;
mod what_is_taken;

use std::path::Path;
use std::process::{Command, Stdio};

/// Runs the program in a folder with the words of a line. Exit status, stdout and stderr.
#[allow(clippy::expect_used, reason = "tests may stop")]
fn run(dir: &Path, line: &str) -> (Option<i32>, String, String) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_splatblur"));
    let output = program.current_dir(dir).stdin(Stdio::null()).args(line.split(' ')).output().expect("the program");
    let [stdout, stderr] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).expect("text"));
    (output.status.code(), stdout, stderr)
}

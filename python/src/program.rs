//! The program `splatblur`.

use std::ffi::OsString;
use std::io::Write as _;
use std::process::ExitCode;

use pyo3::prelude::*;

use crate::cli;

/// Runs the program with `arguments`, the first of which is its name; gives its exit status.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    let code = py.detach(|| {
        let code = cli::main(&arguments);
        // As the end of a program of its own would do. A reader that has gone is no error.
        let _ = std::io::stdout().flush();
        code
    });
    // An exit code does not tell its number, but it can be compared.
    (0..=u8::MAX).find(|&number| ExitCode::from(number) == code).unwrap_or(u8::MAX)
}

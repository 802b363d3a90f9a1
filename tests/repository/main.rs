//! The repository itself: the library's face, the order of modules, widths of lines, lengths of guides, citations,
//! the package, licences, tiers of the tests.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may stop")]

mod face;
mod inputs;
mod licences;
mod modules;
mod package;
mod source;
mod text;
mod tiers;

use std::fs;
use std::path::{Path, PathBuf};

/// Adds the files of Rust below a folder.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

//! The viewer as a page, a browser and an enemy meet it.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may stop")]

mod browser;
mod devtools;
mod files;
mod hostile;
mod measure;
mod movies;
mod paths;
mod pictures;
#[path = "../support/saved.rs"]
mod saved;
mod saves;
mod support;

//! The repository itself: the library's face, the order of modules, widths of lines, lengths of guides, citations,
//! the package.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may stop")]

mod face;
mod inputs;
mod modules;
mod package;
mod source;
mod text;

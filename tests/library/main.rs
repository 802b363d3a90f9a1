//! The library as its users have it: what the face promises, and its examples.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may stop")]

mod examples;
mod memory;
mod opening;
mod pictures;
mod words;

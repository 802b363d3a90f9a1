//! Measuring pictures: the metrics.

#[path = "../support/mod.rs"]
mod support;

mod metrics;

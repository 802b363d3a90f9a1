//! Tests of programs and of the layouts that they share with the host.
#![allow(clippy::panic, clippy::print_stderr, reason = "tests may stop and report")]

#[allow(unreachable_pub, reason = "integration tests share the file")]
#[path = "../../../../tests/support/gpu.rs"]
mod open;
mod wgsl;

pub(in crate::backend) use self::open::gpu_or_skip;
use super::{Choice, Gpu};

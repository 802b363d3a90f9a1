//! Tests of programs and of the layouts that they share with the host.
#![allow(clippy::panic, clippy::print_stderr, reason = "tests may stop and report")]

mod noop;
#[allow(unreachable_pub, reason = "integration tests share the file")]
#[path = "../../../../tests/support/gpu.rs"]
mod open;
mod wgsl;

pub(in crate::backend) use self::open::gpu_or_skip;
use super::{Choice, DeviceState, Gpu};

impl Gpu {
    /// Another backend on the same device, with the pipelines that are there by now, and nothing else.
    pub(in crate::backend) fn beside(&self) -> Self {
        let DeviceState { device, pipelines, .. } = &self.state;
        Self::on(device.clone(), pipelines.clone()).unwrap_or_else(|why| panic!("{why}"))
    }
}

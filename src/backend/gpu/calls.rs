//! Counts the calls to the device. All calls that cost time go through [`Device`](super::device::Device), or through
//! [`BoundProgram`](super::bind::BoundProgram), and both count here.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::backend::GpuCalls;

/// A counter that all parts of a device share.
#[derive(Debug, Default)]
pub(in crate::backend) struct Calls {
    submissions: AtomicU64,
    waits: AtomicU64,
    maps: AtomicU64,
    dispatches: AtomicU64,
    writes: AtomicU64,
    bind_groups: AtomicU64,
    bytes_up: AtomicU64,
    bytes_down: AtomicU64,
}

fn add(counter: &AtomicU64, count: u64) {
    counter.fetch_add(count, Ordering::Relaxed);
}

impl Calls {
    pub(super) fn submit(&self) {
        add(&self.submissions, 1);
    }

    pub(super) fn wait(&self) {
        add(&self.waits, 1);
    }

    pub(super) fn map(&self, bytes: u64) {
        add(&self.maps, 1);
        add(&self.bytes_down, bytes);
    }

    pub(super) fn dispatch(&self) {
        add(&self.dispatches, 1);
    }

    pub(super) fn write(&self, bytes: u64) {
        add(&self.writes, 1);
        add(&self.bytes_up, bytes);
    }

    pub(super) fn bind(&self) {
        add(&self.bind_groups, 1);
    }

    /// All calls since those `before`.
    pub(super) fn since(&self, before: &GpuCalls) -> GpuCalls {
        let now = self.so_far();
        GpuCalls {
            submissions: now.submissions - before.submissions,
            waits: now.waits - before.waits,
            maps: now.maps - before.maps,
            dispatches: now.dispatches - before.dispatches,
            writes: now.writes - before.writes,
            bind_groups: now.bind_groups - before.bind_groups,
            bytes_up: now.bytes_up - before.bytes_up,
            bytes_down: now.bytes_down - before.bytes_down,
            ..GpuCalls::default()
        }
    }

    /// All calls so far.
    pub(super) fn so_far(&self) -> GpuCalls {
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        GpuCalls {
            submissions: read(&self.submissions),
            waits: read(&self.waits),
            maps: read(&self.maps),
            dispatches: read(&self.dispatches),
            writes: read(&self.writes),
            bind_groups: read(&self.bind_groups),
            bytes_up: read(&self.bytes_up),
            bytes_down: read(&self.bytes_down),
            ..GpuCalls::default()
        }
    }
}

//! What passes take, over all threads.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use super::waste::Wasted;
use crate::backend::Stats;
use crate::frame::Frame;

/// Time of one pass over all threads, nanoseconds.
#[derive(Debug, Default)]
pub(in crate::backend) struct Clock(AtomicU64);

impl Clock {
    pub(in crate::backend) fn add(&self, start: Instant) {
        self.0.fetch_add(start.elapsed().as_nanos() as u64, Relaxed);
    }

    pub(in crate::backend) fn total(&self) -> Duration {
        Duration::from_nanos(self.0.load(Relaxed))
    }
}

#[derive(Debug, Default)]
pub(in crate::backend) struct Clocks {
    pub project: Clock,
    pub sort: Clock,
    pub bin: Clock,
    pub composite: Clock,
    pub visibility: Clock,
    pub attribute: Clock,
    pub resolve: Clock,
    pub splats: AtomicU64,
    /// Pixels with more layers of see-through surfels than are composited, over all groups.
    pub left_out: AtomicU64,
    /// What bounds waste; `None` where nobody asks for it.
    pub wasted: Option<Wasted>,
}

impl Clocks {
    pub(in crate::backend) fn stats(&self, frame: &Frame) -> Stats {
        Stats {
            splats: self.splats.load(Relaxed),
            left_out: self.left_out.load(Relaxed),
            project: self.project.total(),
            sort: self.sort.total(),
            bin: self.bin.total(),
            composite: self.composite.total(),
            visibility: self.visibility.total(),
            attribute: self.attribute.total(),
            resolve: self.resolve.total(),
            waste: self.wasted.as_ref().map(Wasted::total).unwrap_or_default(),
            ..Stats::of(frame)
        }
    }
}

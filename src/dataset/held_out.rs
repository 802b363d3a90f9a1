//! Views that no program is trained on, but judged by.

use std::collections::BTreeSet;

use crate::time::FrameNumber;

/// Every n-th view of a dataset. Its picture is sharp: that of the middle of the exposure, with all rows at once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeldOut {
    every: u32,
    frames: BTreeSet<FrameNumber>,
}

impl HeldOut {
    /// Least distance of two such views: with 1 none would be left for training.
    pub const LEAST: u32 = 2;

    /// The first one of these frames and every n-th after it, in the order of the names of their files, as readers of
    /// LLFF's files take them.
    pub fn every(every: u32, frames: &[FrameNumber]) -> Self {
        let mut sorted = frames.to_vec();
        sorted.sort_by_cached_key(|frame| frame.padded());
        Self { every, frames: sorted.into_iter().step_by(every.max(1) as usize).collect() }
    }

    /// Is this the frame of such a view?
    pub fn contains(&self, frame: FrameNumber) -> bool {
        self.frames.contains(&frame)
    }

    /// Number of such views.
    pub fn count(&self) -> usize {
        self.frames.len()
    }

    /// One view of so many is held out.
    pub(super) fn distance(&self) -> u32 {
        self.every
    }
}

//! How far a backend is within a frame.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::stop::{Done, Progress};

/// Counts the steps of the rendering that a backend is at. Others may read it meanwhile; pictures do not depend on it.
///
/// A frame of mode auto takes several renderings; other frames take one.
#[derive(Debug, Default)]
pub struct Meter {
    renderings: AtomicU64,
    steps: AtomicU64,
    done: AtomicU64,
    /// Whom it tells of each step.
    listener: Option<Progress>,
}

/// What a [`Meter`] shows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Renderings of the frame that were begun.
    pub renderings: u64,
    /// Finished share of the last of them, 0 to 1.
    pub share: f64,
}

impl Meter {
    /// A meter that tells `listener` of each step.
    pub fn telling(listener: Progress) -> Self {
        Self { listener: Some(listener), ..Self::default() }
    }

    /// A frame begins: no renderings yet.
    pub fn reset(&self) {
        for count in [&self.renderings, &self.steps, &self.done] {
            count.store(0, Ordering::Relaxed);
        }
    }

    /// What it shows now.
    pub fn read(&self) -> Reading {
        let [renderings, steps, done] =
            [&self.renderings, &self.steps, &self.done].map(|count| count.load(Ordering::Relaxed));
        // The three are read one after the other, while they change.
        let share = if steps > 0 { (done as f64 / steps as f64).min(1.0) } else { 0.0 };
        Reading { renderings, share }
    }

    /// A rendering of so many steps begins.
    pub(super) fn begin(&self, steps: u64) {
        self.done.store(0, Ordering::Relaxed);
        self.steps.store(steps, Ordering::Relaxed);
        self.renderings.fetch_add(1, Ordering::Relaxed);
        self.tell();
    }

    /// A step is done.
    pub(super) fn advance(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
        self.tell();
    }

    fn tell(&self) {
        if let Some(listener) = &self.listener {
            let Reading { renderings, share } = self.read();
            listener.tell(Done { round: renderings, share });
        }
    }
}

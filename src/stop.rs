//! A word to work under way that nobody waits for it any more.

use std::sync::atomic::{AtomicBool, Ordering};

/// Set by one thread, heeded by others. Work that heeds it ends soon, without a result.
#[derive(Debug, Default)]
pub struct Stop(AtomicBool);

impl Stop {
    /// Stops the work.
    pub fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Lets work begin again.
    pub fn clear(&self) {
        self.0.store(false, Ordering::Relaxed);
    }

    /// Is the work to end?
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

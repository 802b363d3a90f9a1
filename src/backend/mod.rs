//! Machines that execute a plan.

pub mod cpu;

/// Why a backend could not render.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BackendError {
    /// The frame does not fit into the memory that it may take.
    #[error("a frame of {width} x {height} needs at least {needed} bytes, but may take {allowed} (--memory)")]
    Memory {
        /// Image width.
        width: u32,
        /// Image height.
        height: u32,
        /// Smallest workable budget, bytes.
        needed: u64,
        /// Budget, bytes.
        allowed: u64,
    },
}

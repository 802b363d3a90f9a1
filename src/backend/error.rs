//! Why a backend could not render.

use crate::frame::Frame;

/// Why a backend could not render.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BackendError {
    /// An ideal sphere has no surfels to splat.
    #[error("object `{object}` is an ideal sphere, which only the reference can show")]
    Sphere {
        /// Name of the object.
        object: String,
    },
    /// The frame does not fit into the memory that it may take.
    #[error(
        "a frame of {width} x {height} and models of {models} bytes need at least {needed} bytes, but may take {allowed} \
         (--memory)"
    )]
    Memory {
        /// Image width.
        width: u32,
        /// Image height.
        height: u32,
        /// Bytes of the models.
        models: u64,
        /// Smallest workable budget, bytes.
        needed: u64,
        /// Budget, bytes.
        allowed: u64,
    },
    /// There is no device to render on.
    #[error(
        "there is no graphics adapter{wanted} (found: {found}); a GPU needs its Vulkan driver and the Vulkan loader (Debian: \
         libvulkan1), a software device mesa-vulkan-drivers"
    )]
    NoAdapter {
        /// What it was looked for by, with a space in front; empty for any.
        wanted: String,
        /// Names of those that there are.
        found: String,
    },
    /// The device refused, or lacks something.
    #[error("{adapter}: {what}")]
    Device {
        /// Name of the adapter.
        adapter: String,
        /// What it says or lacks.
        what: String,
    },
}

impl BackendError {
    /// Refuses a frame that needs more bytes than it may take, `needed` being the least with which its backend can work.
    pub(super) fn check_memory(frame: &Frame, needed: u64) -> Result<(), Self> {
        if needed <= frame.memory {
            return Ok(());
        }
        let [width, height] = frame.size;
        Err(Self::Memory { width, height, models: frame.model_bytes, needed, allowed: frame.memory })
    }
}

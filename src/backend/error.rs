//! Why a backend could not render.

use crate::frame::Frame;
use crate::limits::Invalid;
use crate::model::ModelError;
use crate::options::KernelWeight;
use crate::scene::{ImageSettings, Scene};
use crate::time::FrameNumber;

/// Why a backend could not render.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BackendError {
    /// A value of the scene or of the options is out of its bounds.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// Spheres are shaded by pixels, at instants.
    #[error("object `{object}` has spheres, which {what} cannot show: take {instead}")]
    Spheres {
        /// Name of the object.
        object: String,
        /// What cannot show them.
        what: &'static str,
        /// What can.
        instead: &'static str,
    },
    /// A file of a sequence cannot be read, or does not go with the one beside it.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Full EWA and kernels in motion whose weights add up to nothing.
    #[error(
        "prefilter `ewa` is not for kernels in motion with the weight `{weight}`: take `--kernel-weight integral`, or \
         the prefilter `approx` or `none`"
    )]
    Filter {
        /// How kernels weigh.
        weight: KernelWeight,
    },
    /// Kernels in motion do not composite.
    #[error(
        "light passes through object `{object}`, which mode `volumetric` cannot show: take `supersample`, `bucket` or \
         `auto`; of a capture also `kind=\"surfels\"` in its <pointModel>"
    )]
    Volumetric {
        /// Name of the object.
        object: String,
    },
    /// Kernels in motion are not read out row by row.
    #[error(
        "mode `volumetric` has no rolling shutter: swept anew for every few rows, it took three times as long as \
         samples for more error; take `supersample`, `bucket` or `auto`, or `readout=\"0\"` in <shutter> \
         (`--readout 0`)"
    )]
    RollingShutter,
    /// Something that has no shadows.
    #[error("{what} no shadows: take {instead}, `shadows=\"false\"`, or leave all out (`--no-shadows`)")]
    Shadows {
        /// What has none, with its verb.
        what: &'static str,
        /// What has some.
        instead: &'static str,
    },
    /// Something that cannot catch shadows, or where they cannot be caught.
    #[error("object `{object}` is a shadow catcher, {why}: take {instead}, or `shadowCatcher=\"false\"`")]
    Catcher {
        /// Name of the object.
        object: String,
        /// The reason why it is none.
        why: &'static str,
        /// A thing that may be one, or a mode that shows some.
        instead: &'static str,
    },
    /// Captures are composited over a background that is known at each instant.
    #[error(
        "object `{object}` is a capture with colours for the display, which cannot be composited over an environment: \
         take `background=\"false\"` in <environment>, or `kind=\"surfels\"` in its <pointModel>"
    )]
    Panorama {
        /// Name of the object.
        object: String,
    },
    /// The number of the frame is infinite or NaN.
    #[error("there is no frame {frame}; a finite number is needed")]
    Frame {
        /// What was asked for.
        frame: FrameNumber,
    },
    /// The frame does not fit into `RenderOptions::memory`.
    #[error(
        "a frame of {width} x {height} and models of {models} bytes need at least {needed} bytes, but may take \
         {allowed}: it takes RenderOptions::memory {}M", needed.div_ceil(1 << 20)
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
    /// Nobody waits for the frame any more ([`crate::stop::Stop`]).
    #[error("stopped before the frame was finished")]
    Stopped,
    /// A GPU is wanted, but the crate was built without its feature `gpu`.
    #[error("built without the GPU backend (cargo feature `gpu`); use Device::Cpu")]
    NotBuilt,
    /// There is no device to render on.
    #[error(
        "there is no graphics adapter{wanted} (found: {found}); a GPU needs its Vulkan driver and the Vulkan loader \
         (Debian: libvulkan1), a software device mesa-vulkan-drivers"
    )]
    NoAdapter {
        /// The name that it was looked for by, in words and with a space in front; empty for any.
        wanted: String,
        /// Names of the adapters that there are.
        found: String,
    },
    /// The device failed, or lacks something.
    #[error("{adapter}: {what}")]
    Device {
        /// Name of the adapter.
        adapter: String,
        /// The failure, or what it lacks.
        what: String,
    },
}

impl BackendError {
    /// Refuses a frame whose time samples alone need more bytes than it may take, before they are made. Few samples are
    /// made first: their backend knows what the whole frame needs, and says so.
    pub(crate) fn check_samples(scene: &Scene, samples: u64, memory: u64) -> Result<(), Self> {
        const FEW: u64 = 16 << 20;
        let needed = Frame::posed_bytes(scene, samples);
        if needed <= memory || needed.saturating_sub(Frame::model_bytes(scene)) <= FEW {
            return Ok(());
        }
        let ImageSettings { width, height, .. } = scene.image;
        Err(Self::Memory { width, height, models: Frame::model_bytes(scene), needed, allowed: memory })
    }

    /// Refuses a frame that needs more bytes than it may take. `needed` is the least with which its backend can
    /// work.
    pub(super) fn check_memory(frame: &Frame, needed: u64) -> Result<(), Self> {
        if needed <= frame.memory {
            return Ok(());
        }
        let [width, height] = frame.size;
        Err(Self::Memory { width, height, models: frame.model_bytes, needed, allowed: frame.memory })
    }
}

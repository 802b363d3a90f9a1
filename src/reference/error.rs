//! Why a reference cannot be made.

use super::sampler::{MOST_SAMPLES, SCRAMBLINGS};
use crate::limits::Invalid;
use crate::model::ModelError;
use crate::time::FrameNumber;

/// Why there is no reference.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// A value of the scene or of the options is out of its bounds.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// A file of a sequence cannot be read, or does not go with the one beside it.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The scramblings cannot share the samples equally.
    #[error(
        "{samples} samples of a pixel cannot be shared by {SCRAMBLINGS} scramblings: a multiple of {SCRAMBLINGS} is \
         needed, such as {}",
        samples.next_multiple_of(SCRAMBLINGS as u64).max(SCRAMBLINGS as u64)
    )]
    Samples {
        /// What was asked for.
        samples: u64,
    },
    /// There are more samples than the sequences have points.
    #[error("{samples} samples of a pixel are too many (at most {MOST_SAMPLES})")]
    TooMany {
        /// What was asked for.
        samples: u64,
    },
    /// A jittered grid has a fixed size, so its samples cannot be stopped or continued.
    #[error(
        "the jittered sampler has a fixed number of samples: it can neither stop at an error \
         nor go on from an earlier run"
    )]
    Fixed,
    /// The number of the frame is infinite or NaN.
    #[error("there is no frame {frame}; a finite number is needed")]
    Frame {
        /// What was asked for.
        frame: FrameNumber,
    },
    /// The image is too large.
    #[error("the sums of {width} x {height} pixels do not fit into memory")]
    Memory {
        /// Width of the image.
        width: u32,
        /// Height of the image.
        height: u32,
    },
    /// A capture is too large.
    #[error("the tree of {count} Gaussians does not fit into memory")]
    Gaussians {
        /// Gaussians of the capture.
        count: usize,
    },
    /// A capture is composited over a background that is known at each instant.
    #[error(
        "object `{object}` is a capture with colours for the display, which cannot be composited over an environment: \
         take `background=\"false\"` in <environment>, or `kind=\"surfels\"` in its <pointModel>"
    )]
    Panorama {
        /// Name of the object.
        object: String,
    },
    /// Light passes through a volume everywhere: it has no surface that moves.
    #[error("object `{object}` is a volume, which has no surface and no flow: use Recipe::flow = false")]
    Flow {
        /// Name of the object.
        object: String,
    },
    /// Nobody waits for the reference any more ([`crate::stop::Stop`]).
    #[error("stopped before the reference was finished")]
    Stopped,
    /// The bytes are no partial sums, or they are damaged.
    #[error("these are no partial sums of a reference, or they are damaged")]
    Damaged,
    /// The pixel is outside the image.
    #[error("pixel {x},{y} is outside the image of {width} x {height}")]
    NoPixel {
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// Width of the image.
        width: u32,
        /// Height of the image.
        height: u32,
    },
    /// The sample is beyond the last one.
    #[error("sample {sample} is beyond the last of {samples} samples, {}", samples - 1)]
    NoSample {
        /// The sample.
        sample: u64,
        /// Number of samples.
        samples: u64,
    },
    /// The earlier run was of another kind.
    #[error("the earlier run has {found}, this one {expected}")]
    Unlike {
        /// What the earlier run has.
        found: String,
        /// The kind that this run has.
        expected: String,
    },
}

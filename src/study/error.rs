//! Why a study failed.

use std::error::Error;
use std::io;
use std::path::PathBuf;

use super::contestant::ContestantError;
use super::provenance::ProvenanceError;
use super::sheet::SheetError;
use crate::backend::BackendError;
use crate::compare::{CompareError, LimitError, ssim};
use crate::image::ImageError;
use crate::model::ModelError;
use crate::reference::ReferenceError;
use crate::time::FrameNumber;

/// Why a study failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A backend cannot be opened.
    #[error(transparent)]
    Open(Box<dyn Error + Send + Sync>),
    /// A backend cannot render a frame.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The reference cannot be made.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// Pictures cannot be compared.
    #[error(transparent)]
    Compare(#[from] CompareError),
    /// A picture cannot be written or read.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A model of the study's own cannot be made.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Pictures cannot be shown.
    #[error(transparent)]
    Sheet(#[from] SheetError),
    /// A file of the scene cannot be read again.
    #[error(transparent)]
    Provenance(#[from] ProvenanceError),
    /// A limit is there twice.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// A contestant is there twice.
    #[error(transparent)]
    Contestant(#[from] ContestantError),
    /// Something is wrong in a frame.
    #[error("frame {frame}")]
    Frame {
        /// The frame.
        frame: FrameNumber,
        /// The fault.
        source: Box<Self>,
    },
    /// Something is wrong in a mode.
    #[error("mode {mode}")]
    Mode {
        /// The mode.
        mode: String,
        /// The fault.
        source: Box<Self>,
    },
    /// SSIM has a window of a fixed size.
    #[error("a report needs pictures of at least {0} x {0} pixels, for SSIM", ssim::WINDOW)]
    Small,
    /// The reference cannot say how sure it is.
    #[error("the reference has no standard error")]
    NoStandardError,
    /// The regions of a picture cannot be told apart.
    #[error("the pictures of the moments lack depth or velocity")]
    NoLayers,
    /// A file cannot be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// JSON cannot be made.
    #[error("cannot write JSON")]
    Json(#[from] serde_json::Error),
}

impl StudyError {
    /// With the frame in which it happened.
    pub(super) fn in_frame(frame: FrameNumber) -> impl FnOnce(Self) -> Self {
        move |source| Self::Frame { frame, source: Box::new(source) }
    }

    /// With the mode in which it happened.
    pub(super) fn in_mode(mode: String) -> impl FnOnce(Self) -> Self {
        move |source| Self::Mode { mode, source: Box::new(source) }
    }
}

//! How fine the surfels are that a picture shows.

use super::blur::{ErrorTarget, Quality};
use super::words;

/// How fine the surfels are that a picture shows. Where many lie within a pixel, or blur washes them out, fewer and
/// larger ones take their place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Detail {
    /// As the error of mode auto asks, and [`Self::Good`] in other modes.
    #[default]
    Auto,
    /// For quick looks.
    Draft,
    /// Missing detail is as good as never seen.
    Good,
    /// Half of what [`Self::Good`] leaves out.
    Final,
    /// All surfels of the models.
    Full,
}

words!(Detail, "detail", [Auto = "auto", Draft = "draft", Good = "good", Final = "final", Full = "full"]);

impl Detail {
    /// The error of a picture ([`ErrorTarget::error`]) that this detail goes with; `None` for all surfels.
    pub fn error(self, quality: Quality) -> Option<f64> {
        match (self, quality) {
            (Self::Auto, Quality::Error(target)) => Some(target.error),
            (Self::Auto | Self::Good, _) => Some(ErrorTarget::GOOD),
            (Self::Draft, _) => Some(ErrorTarget::DRAFT),
            (Self::Final, _) => Some(ErrorTarget::FINAL),
            (Self::Full, _) => None,
        }
    }
}

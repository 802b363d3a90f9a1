//! What a caller chooses about a reference.

use std::borrow::Cow;

use super::error::ReferenceError;
use super::sampler::{MOST_SAMPLES, SCRAMBLINGS, Sampler};
use crate::film::Aov;
use crate::limits;
use crate::options::{PixelFilter, Shading};
use crate::scene::Scene;
use crate::time::FrameNumber;

/// Samples of a pixel in one round of a run that stops at an error.
pub const ROUND: u64 = 256;

/// The choices for a reference.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceOptions {
    /// Samples of a pixel, a multiple of [`SCRAMBLINGS`]. If `error` is set, this is the most.
    pub samples: u64,
    /// Standard error at which to stop: after the first round ([`ROUND`] samples) with a smaller mean.
    pub error: Option<f64>,
    /// The way positions and times are chosen.
    pub sampler: Sampler,
    /// How positions are spread about the pixel's centre.
    pub filter: PixelFilter,
    /// The place of shading: at surfels, or at the averaged surface.
    pub shading: Shading,
    /// Show back faces, with their normals turned to the viewer, of all objects.
    pub two_sided: bool,
    /// Depth tolerance of all objects, world units, >= 0. It overrides the scene's.
    pub epsilon: Option<f64>,
    /// Seed of positions and times.
    pub seed: u64,
    /// Extra channels in the order of [`Aov::ALL`], each at most once.
    pub aovs: Vec<Aov>,
}

impl Default for ReferenceOptions {
    fn default() -> Self {
        Self {
            samples: 1024,
            error: None,
            sampler: Sampler::Sobol,
            filter: PixelFilter::Box,
            shading: Shading::Phong,
            two_sided: false,
            epsilon: None,
            seed: 1,
            aovs: Vec::new(),
        }
    }
}

impl ReferenceOptions {
    /// Checks whether a reference can be made with these options.
    ///
    /// # Errors
    /// The number of samples does not suit the scramblings, or the sampler cannot stop at an error.
    pub const fn check(&self) -> Result<(), ReferenceError> {
        let samples = self.samples;
        if samples > MOST_SAMPLES {
            return Err(ReferenceError::TooMany { samples });
        }
        if samples == 0 || !samples.is_multiple_of(SCRAMBLINGS as u64) {
            return Err(ReferenceError::Samples { samples });
        }
        if self.error.is_some() && !self.sampler.is_progressive() {
            return Err(ReferenceError::Fixed);
        }
        Ok(())
    }

    /// The number of a frame and the scene there, both checked with these options, but for the number of samples.
    pub(super) fn enter<'a>(
        &self,
        scene: &'a Scene,
        frame: FrameNumber,
    ) -> Result<(FrameNumber, Cow<'a, Scene>), ReferenceError> {
        scene.check()?;
        self.filter.check()?;
        if let Some(epsilon) = self.epsilon {
            limits::EPSILON.check("epsilon", epsilon)?;
        }
        if !frame.get().is_finite() {
            return Err(ReferenceError::Frame { frame });
        }
        Ok((frame, scene.at_frame(frame.get())?))
    }
}

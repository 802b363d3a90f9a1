//! What a caller chooses about a reference.

use super::error::ReferenceError;
use super::sampler::{MOST_SAMPLES, SCRAMBLINGS, Sampler};
use crate::film::Aov;
use crate::options::{PixelFilter, Shading};

/// Samples of a pixel in one round of a run that stops at an error.
pub const ROUND: u64 = 256;

/// How a reference is made.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceOptions {
    /// Samples of a pixel, a multiple of [`SCRAMBLINGS`]; with `error`, the most.
    pub samples: u64,
    /// Stop after the round ([`ROUND`] samples) in which the mean standard error falls below this.
    pub error: Option<f64>,
    /// How positions and times are chosen.
    pub sampler: Sampler,
    /// Positions over the pixel's square, or at its centre.
    pub filter: PixelFilter,
    /// Where shading happens.
    pub shading: Shading,
    /// Show back faces, with their normals turned to the viewer.
    pub two_sided: bool,
    /// Depth tolerance for all objects, world units, >= 0; overrides the scene's.
    pub epsilon: Option<f64>,
    /// Seed of positions and times.
    pub seed: u64,
    /// Extra channels, in the order of [`Aov::ALL`], each at most once.
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
    /// Whether there can be a reference with these options.
    ///
    /// # Errors
    /// The number of samples does not suit the scramblings, or the sampler cannot stop at an error.
    pub const fn check(&self) -> Result<(), ReferenceError> {
        let samples = self.samples;
        if samples == 0 || !samples.is_multiple_of(SCRAMBLINGS as u64) || samples > MOST_SAMPLES {
            return Err(ReferenceError::Samples { samples });
        }
        if self.error.is_some() && !self.sampler.is_progressive() {
            return Err(ReferenceError::Fixed);
        }
        Ok(())
    }
}

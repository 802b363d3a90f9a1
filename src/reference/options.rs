//! What a caller chooses about a reference.

use std::borrow::Cow;

use super::error::ReferenceError;
use super::sampler::{MOST_SAMPLES, SCRAMBLINGS, Sampler};
use crate::film::Aov;
use crate::limits::Invalid;
use crate::options::{Look, RenderOptions, words};
use crate::scene::Scene;
use crate::time::FrameNumber;

/// Samples of a pixel in one round of a run that stops at an error.
pub const ROUND: u64 = 256;

/// What of a mesh is traced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Meshes {
    /// Its triangles, with textures as they lie between their texels. What sampling a mesh to surfels costs is then a
    /// part of the error of a picture.
    #[default]
    Triangles,
    /// The surfels that it was sampled to, as a renderer has them.
    Surfels,
}

words!(Meshes, "part of a mesh to trace", [Triangles = "triangles", Surfels = "surfels"]);

/// The choices for a reference.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceOptions {
    /// Samples of a pixel, a multiple of [`SCRAMBLINGS`]. If `error` is set, this is the most.
    pub samples: u64,
    /// Standard error at which to stop: after the first round ([`ROUND`] samples) with a smaller mean.
    pub error: Option<f64>,
    /// The way positions and times are chosen.
    pub sampler: Sampler,
    /// What of meshes is traced.
    pub meshes: Meshes,
    /// What the picture has in common with those of the renderer: filter, shading, sides, tolerance, seed and extra
    /// channels.
    pub look: Look,
}

impl Default for ReferenceOptions {
    fn default() -> Self {
        Self { samples: 1024, error: None, sampler: Sampler::Sobol, meshes: Meshes::default(), look: Look::default() }
    }
}

impl ReferenceOptions {
    /// The reference that pictures of the renderer with these options are compared with: the same look, `samples` of a
    /// pixel ([`Self::samples`]).
    pub fn like(options: &RenderOptions, samples: u64) -> Self {
        Self { samples, look: options.look.clone(), ..Self::default() }
    }

    /// Checks whether a reference can be made with these options.
    ///
    /// # Errors
    /// The number of samples does not suit the scramblings, or the sampler cannot stop at an error. The look is not
    /// valid, or asks for [`Aov::LodError`] or [`Aov::Object`].
    pub fn check(&self) -> Result<(), ReferenceError> {
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
        self.check_look()
    }

    /// The most rays that a picture of a scene takes from its eye.
    pub(super) fn rays(&self, scene: &Scene) -> u64 {
        self.samples.saturating_mul(u64::from(scene.image.width) * u64::from(scene.image.height))
    }

    fn check_look(&self) -> Result<(), ReferenceError> {
        self.look.check().map_err(|e| e.within("options.look"))?;
        if let Some(other) = self.look.aovs.iter().find(|aov| matches!(aov, Aov::LodError | Aov::Object)) {
            let expected = format!("channels of a reference: {}, error", Aov::ALL.map(Aov::name).join(", "));
            return Err(Invalid::new("options.look.aovs", other.name(), expected).into());
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
        self.check_look()?;
        if !frame.get().is_finite() {
            return Err(ReferenceError::Frame { frame });
        }
        Ok((frame, scene.at_frame(frame.get())?))
    }
}

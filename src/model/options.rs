//! What a caller may say about a model, and what the caller is told meanwhile.

use super::volume::VolumeOptions;

/// The colour space of a model file's colours (`<pointModel colourSpace="...">`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourSpace {
    /// sRGB transfer curve.
    Srgb,
    /// Linear light.
    Linear,
}

/// What a model is drawn as (`<pointModel kind="...">`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Opaque discs, without the fainter half of a capture.
    Surfels,
    /// Transparent 3D Gaussians. Only captures have them.
    Gaussians,
    /// Kernels of a medium that light passes through: grids, and points with densities and radii.
    Volume,
}

/// The choices that a scene has for a model.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// What a model becomes; `None`: Gaussians of a capture, kernels of a volume, else surfels.
    pub kind: Option<Kind>,
    /// Factor on all cut-off radii, > 0; on the standard deviations of Gaussians and of the kernels of volumes.
    pub radius_scale: f64,
    /// The colour space, in place of the one that the storage type implies.
    pub colour_space: Option<ColourSpace>,
    /// How a volume becomes kernels; nothing for other models.
    pub volume: VolumeOptions,
    /// The node of a glTF file whose mesh is wanted, in its own space: its name, the name of its mesh, or `#index`.
    /// `None`: the whole scene.
    pub node: Option<String>,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { kind: None, radius_scale: 1.0, colour_space: None, volume: VolumeOptions::default(), node: None }
    }
}

/// Receives the name of the current step and its finished share (0..=1). It is called from several threads.
pub type Progress<'a> = &'a (dyn Fn(&str, f32) + Sync);

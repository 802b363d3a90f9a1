//! The content of a model file, before anything is estimated.

use glam::{DVec3, Vec3};

use super::surfels::Material;

/// How a file stored its colours; decides the default colour space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColourStorage {
    /// 8- or 16-bit integers: sRGB unless the scene says otherwise.
    #[default]
    Integer,
    /// Floats: linear unless the scene says otherwise.
    Float,
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
    /// The signs of the normals mean nothing (Gaussian splats): both sides are to be shown.
    pub two_sided: bool,
    /// What a user should know about the reading: points dropped, properties ignored, conventions assumed.
    pub notes: Vec<String>,
}

//! Point models: file formats into a [`Cloud`], and a cloud completed into [`Surfels`].

mod bin;
mod complete;
mod error;
mod gaussian;
pub mod generate;
mod map;
mod mesh;
mod neighbours;
mod normals;
mod obj;
mod order;
mod orient;
mod ply;
mod ply_body;
mod ply_header;
mod radii;
mod sfl;
mod sfl_codes;
mod sfl_container;
mod store;
mod tidy;
mod write_ply;

use std::path::Path;

use glam::{DVec3, Vec3};

pub use bin::write_bin;
pub use complete::complete;
pub use error::{ModelError, ParseError, Place};
pub use write_ply::write_ply;

use crate::math::{Bounds, srgb};

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
    /// The signs of the normals mean nothing (Gaussian splats): both sides are to be shown.
    pub two_sided: bool,
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
    /// The signs of the normals mean nothing: both sides are shown unless the scene says otherwise.
    pub two_sided: bool,
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

    /// Bytes that the columns take.
    pub fn bytes(&self) -> u64 {
        let vectors = [&self.position, &self.axis_u, &self.axis_v, &self.normal, &self.colour, &self.velocity];
        let vectors: usize = vectors.iter().map(|column| size_of_val(column.as_slice())).sum();
        (vectors + size_of_val(self.material.as_slice())) as u64
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

/// A file format of models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Polygon file format: point clouds, surfels, meshes taken as points, Gaussian-splat captures.
    Ply,
    /// `Pointshop3D` surfels.
    Sfl,
    /// Wavefront OBJ: vertices taken as points.
    Obj,
    /// Our own (docs/bin-format.md).
    Bin,
}

impl Format {
    /// What can be read, as messages say it.
    pub const KNOWN: &'static str = "PLY, Pointshop3D .sfl, Wavefront .obj, splatblur .bin";

    /// The format of a file: by its first bytes, else (OBJ has no mark) by its extension.
    pub fn detect(bytes: &[u8], path: &Path) -> Option<Self> {
        if bytes.starts_with(&bin::MAGIC) {
            Some(Self::Bin)
        } else if bytes.starts_with(b"GFLF") {
            Some(Self::Sfl)
        } else if bytes.starts_with(b"ply") && bytes.get(3).is_none_or(u8::is_ascii_whitespace) {
            Some(Self::Ply)
        } else {
            path.extension().filter(|e| e.eq_ignore_ascii_case("obj")).map(|_| Self::Obj)
        }
    }
}

/// What [`parse`] reads.
#[derive(Clone, Debug)]
pub enum Parsed {
    /// Points as the file gives them.
    Cloud(Cloud),
    /// Complete surfels, from our own format.
    Surfels(Surfels),
}

/// Reads the bytes of a model file. Points that cannot be drawn are dropped; nothing is estimated yet.
///
/// Memory stays within a small multiple of the file's size, whatever the file says.
///
/// # Errors
/// The bytes are not a valid file of this format.
pub fn parse(bytes: &[u8], format: Format) -> Result<Parsed, ParseError> {
    parse_told(bytes, format, &|_| {})
}

/// Reads a model file of any format (by its content, then by its extension) and completes it.
///
/// # Errors
/// The file cannot be read, is not a regular file, or is not a valid model of a known format with at least one point.
pub fn load(path: &Path, options: &LoadOptions, progress: Progress<'_>) -> Result<Loaded, ModelError> {
    let parsed = {
        let bytes = map::map(path)?;
        let format = Format::detect(&bytes, path).ok_or_else(|| ModelError::UnknownFormat { path: path.to_owned() })?;
        parse_told(&bytes, format, &|share| progress("reading", share))
            .map_err(|why| ModelError::Invalid { path: path.to_owned(), why })?
    };
    match parsed {
        Parsed::Surfels(surfels) if surfels.is_empty() => {
            Err(ModelError::NoPointsIn { path: path.to_owned(), dropped: String::new() })
        }
        Parsed::Surfels(surfels) => Ok(Loaded { surfels: adjust(surfels, options), notes: Vec::new() }),
        Parsed::Cloud(mut cloud) => {
            let mut notes = std::mem::take(&mut cloud.notes);
            let (surfels, completed) = complete::complete(cloud, options, progress).map_err(|error| match error {
                ModelError::NoPoints => {
                    let dropped = if notes.is_empty() { String::new() } else { format!(": {}", notes.join("; ")) };
                    ModelError::NoPointsIn { path: path.to_owned(), dropped }
                }
                other => other,
            })?;
            notes.extend(completed);
            Ok(Loaded { surfels, notes })
        }
    }
}

fn parse_told(bytes: &[u8], format: Format, progress: &dyn Fn(f32)) -> Result<Parsed, ParseError> {
    let cloud = match format {
        Format::Ply => ply::parse(bytes, progress)?,
        Format::Sfl => sfl::parse(bytes, progress)?,
        Format::Obj => obj::parse(bytes, progress)?,
        Format::Bin => return bin::parse(bytes).map(Parsed::Surfels),
    };
    Ok(Parsed::Cloud(tidy::tidy(cloud)))
}

/// What a scene says, for surfels that are already complete: their colours are linear unless the scene insists.
fn adjust(mut surfels: Surfels, options: &LoadOptions) -> Surfels {
    if options.radius_scale != 1.0 {
        let scale = options.radius_scale as f32;
        surfels.axis_u.iter_mut().chain(&mut surfels.axis_v).for_each(|axis| *axis *= scale);
    }
    if options.colour_space == Some(ColourSpace::Srgb) {
        for c in &mut surfels.colour {
            *c = Vec3::from_array(c.to_array().map(srgb::to_linear));
        }
    }
    surfels
}

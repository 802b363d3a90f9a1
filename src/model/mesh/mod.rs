//! Triangle meshes with textures, before they are sampled to surfels.
//!
//! Readers give a [`Mesh`] in the space of the model. Nothing of it is filtered or reduced yet. Data flow: `gltf` with
//! `gltf_material`, `obj` with `mtl` and `polygon`, `of_cloud` (bytes to a mesh), `smooth` (normals where there are
//! none), and `texture` (images to texels).
//! Sampling makes surfels of it: `facets` (triangles with an area, and how they hang together) -> `fineness` (how
//! fine each part has to be) -> `edges` (which are sharp) -> `spacing` (how many surfels) -> `band` (where they are
//! finer) -> `raster` (hits of rays) -> `piles` (those that coincide) -> `fill` (what rays miss) -> `paint` (normals,
//! colours, and textures by `pyramid`) -> `sample` (all of it). `surface` shows rays the triangles themselves.

mod band;
mod edges;
mod facets;
mod fill;
mod fineness;
mod gltf;
mod gltf_material;
mod mtl;
mod obj;
mod of_cloud;
mod paint;
mod piles;
pub(super) mod polygon;
mod pyramid;
mod raster;
mod sample;
mod smooth;
mod spacing;
mod surface;
mod texture;

pub(crate) use fineness::{Fineness, Lens};
pub(super) use of_cloud::of_cloud;
pub(crate) use sample::{Sampled, Unsampled, sample, sample_as};
pub(crate) use surface::{MeshSurface, SurfacePoint};

use std::path::{Path, PathBuf};

use glam::{DVec3, Vec2, Vec3, Vec4};

use super::error::ParseError;
use super::format::ModelFormat;
use crate::gltf::Nodes;

/// A triangle mesh.
///
/// Every array of vertices has one entry for each vertex, or is empty where the file has no such property. Vertices are
/// shared by triangles only where all their properties are the same.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Positions in model space.
    pub position: Vec<DVec3>,
    /// Unit normals. A zero vector means that this vertex lacks one.
    pub normal: Vec<Vec3>,
    /// Texture coordinates, as in glTF: (0, 0) is the upper left corner of the image.
    pub uv: Vec<Vec2>,
    /// Colour and opacity, linear. They multiply those of the material.
    pub colour: Vec<Vec4>,
    /// In file order.
    pub triangles: Vec<Triangle>,
    /// What [`Triangle::material`] counts. At least one.
    pub materials: Vec<MeshMaterial>,
    /// What [`MeshMaterial::texture`] counts.
    pub textures: Vec<Texture>,
    /// What a user should know: what was ignored, and conventions that were assumed.
    pub notes: Vec<String>,
}

impl Mesh {
    /// True if the other one is the same in all that is drawn.
    pub(super) fn looks_like(&self, other: &Self) -> bool {
        self.triangles == other.triangles
            && self.materials == other.materials
            && self.position == other.position
            && self.normal == other.normal
            && self.uv == other.uv
            && self.colour == other.colour
            && self.textures == other.textures
    }

    /// Drops normals, texture coordinates or colours that no vertex has.
    fn keep(&mut self, [normals, uvs, colours]: [bool; 3]) {
        if !normals {
            self.normal = Vec::new();
        }
        if !uvs {
            self.uv = Vec::new();
        }
        if !colours {
            self.colour = Vec::new();
        }
    }
}

/// Three vertices, counter-clockwise seen from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triangle {
    /// Indices of vertices, all valid.
    pub corners: [u32; 3],
    /// Index of a material, valid.
    pub material: u32,
}

/// How a surface looks.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshMaterial {
    /// Its name in the file, or nothing.
    pub name: String,
    /// Colour and opacity, linear. It multiplies the texture.
    pub colour: Vec4,
    /// Index of a texture, valid.
    pub texture: Option<u32>,
    /// What its opacity means.
    pub alpha: AlphaMode,
    /// Both sides are shown.
    pub two_sided: bool,
}

/// What the opacity of a material means, as in glTF.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Nothing: all of it is opaque.
    #[default]
    Opaque,
    /// The surface is there where its opacity is at least this, and opaque.
    Mask(f32),
    /// It is the opacity.
    Blend,
}

impl Default for MeshMaterial {
    fn default() -> Self {
        Self { name: String::new(), colour: Vec4::ONE, texture: None, alpha: AlphaMode::Opaque, two_sided: false }
    }
}

/// A decoded image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texture {
    /// Width and height, texels, both > 0.
    pub size: [u32; 2],
    /// Rows from the top; red, green and blue in sRGB, straight alpha.
    pub texels: Vec<[u8; 4]>,
    /// What lies beyond the image, along u and v.
    pub wrap: [Wrap; 2],
}

/// What lies beyond the edge of a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The texture again.
    #[default]
    Repeat,
    /// Its mirror image.
    Mirror,
    /// The texel at the edge.
    Clamp,
}

impl Wrap {
    /// The cell that is like that of any index, of `count` cells and `pad` more at each end that does not repeat.
    fn cell(self, index: i64, count: i64, pad: i64) -> i64 {
        match self {
            Self::Repeat => index.rem_euclid(count),
            Self::Mirror => index.rem_euclid(2 * count).min(2 * count - 1 - index.rem_euclid(2 * count)),
            Self::Clamp => index.clamp(-pad, count - 1 + pad),
        }
    }
}

/// Begins the note on animations, which a mesh does not have.
pub(crate) const NOT_PLAYED: &str = "animations, which an `<animation node>` plays";

/// Reads the triangles of a file; `None` for a file without any, and for a capture.
///
/// A glTF file gives its default scene at rest in world space, or the mesh of one `node` in the space of that node,
/// without its children. The node is found by its name, else by the name of its mesh, else as `#index`. Files that
/// `bytes` names lie in the folder of `path` or below; no other is opened. A glTF file that names others is refused;
/// for an OBJ they are looked for by the end of their path.
///
/// Memory stays within a small multiple of the files, whatever they say.
///
/// # Errors
/// The bytes are no valid file of this format, or `node` means no mesh, or several.
pub fn read(bytes: &[u8], format: ModelFormat, path: &Path, node: Option<&str>) -> Result<Option<Mesh>, ParseError> {
    match format {
        ModelFormat::Glb | ModelFormat::Gltf => Ok(gltf::read(bytes, path, node)?),
        ModelFormat::Obj => obj::read(bytes, path),
        _ => Ok(None),
    }
}

/// The other files that a glTF file names and that are there.
///
/// # Errors
/// The bytes are no glTF file.
pub fn files(bytes: &[u8], path: &Path) -> Result<Vec<PathBuf>, ParseError> {
    Ok(gltf::files(bytes, path)?)
}

/// Lists the nodes and the animations of a glTF file.
///
/// # Errors
/// The bytes are no valid glTF file.
pub fn nodes(bytes: &[u8], path: &Path) -> Result<Nodes, ParseError> {
    Ok(gltf::nodes(bytes, path)?)
}

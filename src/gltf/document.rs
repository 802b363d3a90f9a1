//! The part of a glTF text that matters here, as the file says it.
//!
//! Nothing is checked but types. Rare properties are boxed: a hostile text has as many nodes as it has pairs of braces.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;

use super::column::ValueShape;

/// Extensions of an item, by name.
type Extensions = BTreeMap<String, Value>;

/// A whole text.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct Document {
    pub(crate) asset: Asset,
    pub(crate) scene: Option<usize>,
    pub(crate) scenes: Vec<Scene>,
    pub(crate) nodes: Vec<Node>,
    pub(crate) meshes: Vec<Mesh>,
    pub(crate) accessors: Vec<Accessor>,
    pub(crate) buffer_views: Vec<BufferView>,
    pub(crate) buffers: Vec<Buffer>,
    pub(crate) materials: Vec<Material>,
    pub(crate) textures: Vec<Texture>,
    pub(crate) images: Vec<Image>,
    pub(crate) samplers: Vec<TextureSampler>,
    pub(crate) animations: Vec<Clip>,
    pub(crate) extensions_used: Vec<String>,
    pub(crate) extensions_required: Vec<String>,
}

/// What a text says about itself.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct Asset {
    /// The version that it is written in, as `2.0`.
    pub(crate) version: Option<Box<str>>,
    /// The least version that a reader must know.
    pub(crate) min_version: Option<Box<str>>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(crate) struct Scene {
    pub(crate) nodes: Vec<usize>,
}

/// Its transform is a matrix by columns, or a scale, then a rotation, then a translation.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(crate) struct Node {
    pub(crate) name: Option<Box<str>>,
    pub(crate) children: Vec<usize>,
    pub(crate) mesh: Option<usize>,
    pub(crate) matrix: Option<Box<[f64; 16]>>,
    pub(crate) rotation: Option<Box<[f64; 4]>>,
    pub(crate) scale: Option<Box<[f64; 3]>>,
    pub(crate) translation: Option<Box<[f64; 3]>>,
    pub(crate) skin: Option<IgnoredAny>,
    pub(crate) camera: Option<IgnoredAny>,
    pub(crate) extensions: Option<Box<Extensions>>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(crate) struct Mesh {
    pub(crate) name: Option<Box<str>>,
    pub(crate) primitives: Vec<Primitive>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(crate) struct Primitive {
    pub(crate) attributes: BTreeMap<String, usize>,
    pub(crate) indices: Option<usize>,
    pub(crate) material: Option<usize>,
    pub(crate) mode: Option<u32>,
    pub(crate) targets: Vec<IgnoredAny>,
    pub(crate) extensions: Extensions,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Accessor {
    pub(crate) buffer_view: Option<usize>,
    #[serde(default)]
    pub(crate) byte_offset: usize,
    pub(crate) component_type: u32,
    #[serde(default)]
    pub(crate) normalized: bool,
    pub(crate) count: usize,
    #[serde(rename = "type")]
    pub(crate) shape: ValueShape,
    pub(crate) sparse: Option<IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct BufferView {
    pub(crate) buffer: usize,
    #[serde(default)]
    pub(crate) byte_offset: usize,
    pub(crate) byte_length: usize,
    pub(crate) byte_stride: Option<usize>,
    #[serde(default)]
    pub(crate) extensions: Option<Box<Extensions>>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Buffer {
    pub(crate) byte_length: usize,
    pub(crate) uri: Option<Box<str>>,
}

/// How a surface looks.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct Material {
    pub(crate) name: Option<Box<str>>,
    pub(crate) pbr_metallic_roughness: BaseColour,
    pub(crate) normal_texture: Option<IgnoredAny>,
    pub(crate) occlusion_texture: Option<IgnoredAny>,
    pub(crate) emissive_texture: Option<IgnoredAny>,
    pub(crate) emissive_factor: Option<[f64; 3]>,
    pub(crate) alpha_mode: Option<AlphaWord>,
    pub(crate) alpha_cutoff: Option<f64>,
    pub(crate) double_sided: bool,
    pub(crate) extensions: Extensions,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct BaseColour {
    pub(crate) base_color_factor: Option<[f64; 4]>,
    pub(crate) base_color_texture: Option<TextureInfo>,
    pub(crate) metallic_factor: Option<f64>,
    pub(crate) roughness_factor: Option<f64>,
    pub(crate) metallic_roughness_texture: Option<IgnoredAny>,
}

#[derive(Clone, Copy, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
pub(crate) enum AlphaWord {
    Opaque,
    Mask,
    Blend,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct TextureInfo {
    pub(crate) index: usize,
    #[serde(default)]
    pub(crate) tex_coord: usize,
    #[serde(default)]
    pub(crate) extensions: Extensions,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(crate) struct Texture {
    pub(crate) sampler: Option<usize>,
    pub(crate) source: Option<usize>,
    pub(crate) extensions: Extensions,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct Image {
    pub(crate) uri: Option<Box<str>>,
    pub(crate) buffer_view: Option<usize>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct TextureSampler {
    pub(crate) wrap_s: Option<u32>,
    pub(crate) wrap_t: Option<u32>,
}

/// An animation.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(crate) struct Clip {
    pub(crate) name: Option<Box<str>>,
    pub(crate) channels: Vec<Channel>,
    pub(crate) samplers: Vec<Sampler>,
}

#[derive(Deserialize)]
pub(crate) struct Channel {
    pub(crate) sampler: usize,
    pub(crate) target: Target,
}

#[derive(Deserialize)]
pub(crate) struct Target {
    pub(crate) node: Option<usize>,
    pub(crate) path: String,
}

#[derive(Deserialize)]
pub(crate) struct Sampler {
    pub(crate) input: usize,
    pub(crate) output: usize,
    pub(crate) interpolation: Option<String>,
}

impl Node {
    /// Scale, rotation (unit) and translation; for a node that has no matrix.
    pub(crate) fn parts(&self) -> Result<(DVec3, DQuat, DVec3), &'static str> {
        let rotation = self.rotation.as_ref().map_or(DQuat::IDENTITY, |xyzw| DQuat::from_array(**xyzw));
        let length = rotation.length();
        if !(1e-15..1e15).contains(&length) {
            return Err("a rotation without direction");
        }
        let scale = self.scale.as_ref().map_or(DVec3::ONE, |s| DVec3::from_array(**s));
        let translation = self.translation.as_ref().map_or(DVec3::ZERO, |t| DVec3::from_array(**t));
        Ok((scale, (rotation / length).normalize(), translation))
    }

    /// From the node to its parent, at rest.
    pub(crate) fn transform(&self) -> Result<DAffine3, &'static str> {
        if let Some(matrix) = &self.matrix {
            let matrix = DMat4::from_cols_array(matrix);
            if !matrix.is_finite() || matrix.row(3).to_array() != [0.0, 0.0, 0.0, 1.0] {
                return Err("a matrix whose last row is not 0 0 0 1");
            }
            return Ok(DAffine3::from_mat4(matrix));
        }
        let (scale, rotation, translation) = self.parts()?;
        Ok(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
    }
}

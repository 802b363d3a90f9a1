//! Materials and textures of glTF files.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use glam::{DVec2, Vec4};
use serde::Deserialize;

use super::texture::{self, Budget, NoTexture};
use super::{AlphaMode, Mesh, MeshMaterial, Texture, Wrap};
use crate::gltf::{AlphaWord, GltfError, GltfFile, Image, Material, TextureInfo, inline, named, read_beside, wrong};

/// The extension that shifts, turns and scales texture coordinates.
const TRANSFORM: &str = "KHR_texture_transform";

/// The materials of a file, of which only those are read that a triangle has.
pub(super) struct Materials<'a> {
    file: &'a GltfFile<'a>,
    path: &'a Path,
    /// Index in the mesh, by index in the file, where `None` stands for the default material, and by whether the
    /// texture can be drawn.
    known: HashMap<(Option<usize>, bool), u32>,
    /// Index in the mesh, by what the image is and what lies beyond its edge.
    textures: HashMap<(ImageSource<'a>, [Wrap; 2]), Option<u32>>,
    /// Features that are not drawn, and how many materials have them.
    ignored: BTreeMap<String, usize>,
    notes: Vec<String>,
    budget: Budget,
}

/// Where an image is.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum ImageSource<'a> {
    View(usize),
    Uri(&'a str),
}

/// `KHR_texture_transform`.
#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Transform {
    offset: [f64; 2],
    rotation: f64,
    scale: [f64; 2],
    tex_coord: Option<usize>,
}

impl Default for Transform {
    fn default() -> Self {
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

impl<'a> Materials<'a> {
    /// `size`: bytes of the model's files.
    pub(super) fn new(file: &'a GltfFile<'a>, path: &'a Path, size: usize) -> Self {
        Self {
            file,
            path,
            known: HashMap::new(),
            textures: HashMap::new(),
            ignored: BTreeMap::new(),
            notes: Vec::new(),
            budget: Budget::new(size),
        }
    }

    /// Index in the mesh of a material of the file; it is added if it is new. `textured`: what it is on has the
    /// coordinates of its texture.
    pub(super) fn index(&mut self, material: Option<usize>, textured: bool, mesh: &mut Mesh) -> Result<u32, GltfError> {
        if let Some(&index) = self.known.get(&(material, textured)) {
            return Ok(index);
        }
        let mut made = match material {
            None => MeshMaterial::default(),
            Some(index) => {
                let material = named(&self.file.document.materials, index, "material")?;
                if !self.known.contains_key(&(Some(index), !textured)) {
                    self.note(material);
                }
                self.material(material, mesh).map_err(|why| why.of(&format!("material {index}")))?
            }
        };
        if !textured {
            made.texture = None;
        }
        let index = mesh.materials.len() as u32;
        mesh.materials.push(made);
        self.known.insert((material, textured), index);
        Ok(index)
    }

    /// The set of texture coordinates that a material uses; `None` for one without a texture.
    pub(super) fn uv_set(&self, material: Option<usize>) -> Option<usize> {
        self.info(material).map(|info| transform_of(info).tex_coord.unwrap_or(info.tex_coord))
    }

    /// What a material makes of texture coordinates: scaled, then turned, then shifted. A positive rotation turns
    /// coordinates counter-clockwise as the image is seen, that is with v downwards.
    pub(super) fn uv_transform(&self, material: Option<usize>) -> impl Fn(DVec2) -> DVec2 + 'static {
        let Transform { offset, rotation, scale, .. } = self.info(material).map(transform_of).unwrap_or_default();
        let (sine, cosine) = libm::sincos(rotation);
        let (scale, offset) = (DVec2::from_array(scale), DVec2::from_array(offset));
        move |uv| {
            let uv = uv * scale;
            DVec2::new(cosine * uv.x + sine * uv.y, cosine * uv.y - sine * uv.x) + offset
        }
    }

    /// Gives the mesh at least one material, and the notes.
    pub(super) fn finish(self, mesh: &mut Mesh) {
        if mesh.materials.is_empty() {
            mesh.materials.push(MeshMaterial::default());
        }
        mesh.notes.extend(self.notes);
        let lines = self.ignored.into_iter().map(|(what, count)| format!("ignored: {what} ({count} materials)"));
        mesh.notes.extend(lines);
    }

    fn info(&self, material: Option<usize>) -> Option<&'a TextureInfo> {
        let material = self.file.document.materials.get(material?)?;
        material.pbr_metallic_roughness.base_color_texture.as_ref()
    }

    fn material(&mut self, material: &'a Material, mesh: &mut Mesh) -> Result<MeshMaterial, GltfError> {
        let base = &material.pbr_metallic_roughness;
        let colour = base.base_color_factor.unwrap_or([1.0; 4]).map(|c| c as f32);
        if !colour.iter().all(|c| (0.0..=1e6).contains(c)) {
            return Err(wrong("a base colour that is negative or no number", "four numbers from 0 to 1"));
        }
        let cutoff = material.alpha_cutoff.unwrap_or(0.5);
        if !(0.0..=1e6).contains(&cutoff) {
            return Err(wrong(format!("an alpha cutoff of {cutoff}"), "0 or more"));
        }
        let texture = match &base.base_color_texture {
            Some(info) => self.texture(info, mesh)?,
            None => None,
        };
        Ok(MeshMaterial {
            name: material.name.as_deref().unwrap_or_default().to_owned(),
            colour: Vec4::from_array(colour),
            texture,
            alpha: match material.alpha_mode {
                None | Some(AlphaWord::Opaque) => AlphaMode::Opaque,
                Some(AlphaWord::Mask) => AlphaMode::Mask(cutoff as f32),
                Some(AlphaWord::Blend) => AlphaMode::Blend,
            },
            two_sided: material.double_sided,
        })
    }

    /// Notes what of a material is not drawn.
    fn note(&mut self, material: &Material) {
        let base = &material.pbr_metallic_roughness;
        let metal = base.metallic_factor != Some(0.0) || base.metallic_roughness_texture.is_some();
        let rough = base.roughness_factor.is_some_and(|rough| rough != 1.0);
        let emits = material.emissive_texture.is_some() || material.emissive_factor.is_some_and(|e| e != [0.0; 3]);
        let rows = [
            (metal || rough, "metal and roughness"),
            (material.normal_texture.is_some(), "normal maps"),
            (material.occlusion_texture.is_some(), "occlusion maps"),
            (emits, "emitted light"),
        ];
        let names = rows.iter().filter(|(has, _)| *has).map(|(_, name)| (*name).to_owned());
        let extensions = material.extensions.keys().map(|name| name.chars().take(60).collect::<String>());
        for name in names.chain(extensions) {
            // A hostile file has any number of names.
            if self.ignored.len() < 50 || self.ignored.contains_key(&name) {
                *self.ignored.entry(name).or_default() += 1;
            }
        }
    }

    /// Index in the mesh of a texture; `None` where its image is missing or of an unknown kind, which is noted.
    fn texture(&mut self, info: &TextureInfo, mesh: &mut Mesh) -> Result<Option<u32>, GltfError> {
        if let Some(value) = info.extensions.get(TRANSFORM)
            && let Err(why) = Transform::deserialize(value)
        {
            return Err(wrong(format!("`{TRANSFORM}` that fails: {why}"), "offset, rotation and scale"));
        }
        let document = &self.file.document;
        let texture = named(&document.textures, info.index, "texture")?;
        let webp = texture.extensions.get("EXT_texture_webp").and_then(|value| value.get("source"));
        let webp = webp.and_then(serde_json::Value::as_u64).map(|index| index as usize);
        let Some(source) = texture.source.or(webp) else {
            let kinds: Vec<&str> = texture.extensions.keys().map(String::as_str).take(3).collect();
            self.notes.push(format!("texture {} has no image that is known ({})", info.index, kinds.join(", ")));
            return Ok(None);
        };
        let image = named(&document.images, source, "image")?;
        let wrap = match texture.sampler {
            None => [Wrap::Repeat; 2],
            Some(index) => {
                let sampler = named(&document.samplers, index, "sampler")?;
                [wrap_of(sampler.wrap_s)?, wrap_of(sampler.wrap_t)?]
            }
        };
        let place = match image {
            Image { buffer_view: Some(view), .. } => ImageSource::View(*view),
            Image { uri: Some(uri), .. } => ImageSource::Uri(uri),
            Image { .. } => return Err(wrong(format!("image {source} without data"), "a buffer view or a URI")),
        };
        if let Some(&known) = self.textures.get(&(place, wrap)) {
            return Ok(known);
        }
        let found = match self.decode(place, wrap) {
            Ok(texture) => {
                mesh.textures.push(texture);
                Some(mesh.textures.len() as u32 - 1)
            }
            Err(Lost::Note(why)) => {
                self.notes.push(format!("image {source}: {why}; drawn without"));
                None
            }
            Err(Lost::Error(why)) => return Err(why.of(&format!("image {source}"))),
        };
        self.textures.insert((place, wrap), found);
        Ok(found)
    }

    fn decode(&mut self, place: ImageSource<'_>, wrap: [Wrap; 2]) -> Result<Texture, Lost> {
        let read;
        let bytes = match place {
            ImageSource::View(view) => self.file.view(view).map_err(Lost::Error)?,
            ImageSource::Uri(uri) => {
                read = if let Some(data) = inline(uri) {
                    // Its text is a part of the file, which counted already.
                    data.map_err(|found| Lost::Error(wrong(found, "base64 after a comma")))?
                } else {
                    let data = read_beside(self.path, uri).map_err(Lost::Note)?;
                    self.budget.add(data.len());
                    data
                };
                &read
            }
        };
        texture::decode(bytes, wrap, &mut self.budget).map_err(|why| match why {
            NoTexture::Unknown(found) => Lost::Note(found),
            NoTexture::Broken(found) => Lost::Error(wrong(found, "an image that can be decoded")),
        })
    }
}

/// Why a texture is not there.
enum Lost {
    /// The rest can be drawn.
    Note(String),
    Error(GltfError),
}

fn transform_of(info: &TextureInfo) -> Transform {
    info.extensions.get(TRANSFORM).and_then(|value| Transform::deserialize(value).ok()).unwrap_or_default()
}

fn wrap_of(code: Option<u32>) -> Result<Wrap, GltfError> {
    Ok(match code {
        None | Some(10_497) => Wrap::Repeat,
        Some(33_648) => Wrap::Mirror,
        Some(33_071) => Wrap::Clamp,
        Some(other) => return Err(wrong(format!("a texture that wraps by {other}"), "10497, 33071 or 33648")),
    })
}

//! Meshes of glTF files, .glb and .gltf.
//!
//! The default scene at rest, in world space, or the mesh of one node in its own space. A material keeps its base
//! colour, its texture, its opacity, and whether both sides show. Anything else in a file is a note.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DVec2, DVec3, Vec2, Vec3, Vec4};
use serde_json::Value;

use super::gltf_material::Materials;
use super::{Mesh, Triangle};
use crate::gltf::{Column, GltfError, GltfFile, Nodes, Primitive, Tree, ValueShape, find_beside, inline, named, wrong};
use crate::math::Bounds;
use crate::model::tidy;

/// Bytes of a mesh that every file may have, however small it is.
const FREE_BYTES: u64 = 64 << 20;

/// Most bytes of a mesh for each byte of a file. A file that names one mesh in many places has more than one that does
/// not.
const MOST_GROWTH: u64 = 100;

/// Most notes on what is ignored.
const MOST_NOTES: usize = 50;

/// Memory of a vertex, and of a triangle.
const VERTEX_BYTES: u64 = 64;
const TRIANGLE_BYTES: u64 = 16;

/// Largest coordinate. Its square is far from the largest number.
const FAR: f64 = 1e30;

/// The extension of primitives that are 3D Gaussians.
const GAUSSIANS: &str = "KHR_gaussian_splatting";

/// Extensions that a file may require. What they do is done, or it changes nothing that is drawn here.
const KNOWN: [&str; 23] = [
    "KHR_texture_transform",
    "KHR_mesh_quantization",
    "EXT_texture_webp",
    "KHR_materials_unlit",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_clearcoat",
    "KHR_materials_sheen",
    "KHR_materials_anisotropy",
    "KHR_materials_iridescence",
    "KHR_materials_dispersion",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_variants",
    "KHR_lights_punctual",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "KHR_node_visibility",
    "KHR_animation_pointer",
    "EXT_lights_ies",
    "EXT_lights_image_based",
];

/// Reads the triangles of a file; `None` where it has none, or is a capture.
pub(super) fn read(bytes: &[u8], path: &Path, node: Option<&str>) -> Result<Option<Mesh>, GltfError> {
    let text = GltfFile::read_text(bytes)?;
    if is_capture(&text) {
        return Ok(None);
    }
    drop(text);
    let file = GltfFile::read(bytes, path)?;
    refuse_unknown(&file)?;
    let tree = Tree::new(&file.document)?;
    let placed = match node {
        Some(name) => vec![(Nodes::of(&file)?.one_mesh(name)?, DAffine3::IDENTITY)],
        None => tree.placed(&file.document)?,
    };
    let size = bytes.len() + file.outside();
    let mut reader = Reader {
        file: &file,
        mesh: Mesh::default(),
        materials: Materials::new(&file, path, size),
        notes: BTreeMap::new(),
        columns: [false; 3],
        left: FREE_BYTES + MOST_GROWTH * size as u64,
        slots: Slots::default(),
        local: Bounds::default(),
    };
    for (index, affine) in placed {
        reader.node(index, &affine)?;
    }
    let mesh = reader.finish();
    Ok((!mesh.triangles.is_empty()).then_some(mesh))
}

/// The files that a file names and that are there.
pub(super) fn files(bytes: &[u8], path: &Path) -> Result<Vec<PathBuf>, GltfError> {
    let document = GltfFile::read_text(bytes)?.document;
    let buffers = document.buffers.iter().map(|buffer| buffer.uri.as_deref());
    let images = document.images.iter().map(|image| image.uri.as_deref());
    let names = buffers.chain(images).flatten().filter(|name| inline(name).is_none());
    Ok(names.filter_map(|name| find_beside(path, name).ok()).collect())
}

/// Lists the nodes and the animations of a file.
pub(super) fn nodes(bytes: &[u8], path: &Path) -> Result<Nodes, GltfError> {
    Nodes::of(&GltfFile::read(bytes, path)?)
}

/// True if a primitive is 3D Gaussians.
fn is_capture(file: &GltfFile<'_>) -> bool {
    let mut primitives = file.document.meshes.iter().flat_map(|mesh| &mesh.primitives);
    primitives.any(|primitive| primitive.extensions.contains_key(GAUSSIANS))
}

/// Refuses what the file cannot be read without.
fn refuse_unknown(file: &GltfFile<'_>) -> Result<(), GltfError> {
    let unknown = file.document.extensions_required.iter().find(|name| !KNOWN.contains(&name.as_str()));
    match unknown {
        Some(name) => {
            let shown: String = name.chars().take(60).flat_map(char::escape_debug).collect();
            Err(wrong(format!("`{shown}`, an extension that the file requires"), "none, or one that is known"))
        }
        None => Ok(()),
    }
}

/// Makes one mesh of the primitives of many places.
struct Reader<'a> {
    file: &'a GltfFile<'a>,
    mesh: Mesh,
    materials: Materials<'a>,
    /// Parts that are ignored, and how often.
    notes: BTreeMap<Cow<'static, str>, usize>,
    /// Whether any vertex has a normal, texture coordinates, a colour.
    columns: [bool; 3],
    /// Bytes that the mesh may still take.
    left: u64,
    slots: Slots,
    /// Box around the 32-bit coordinates of vertices, each in the space of its node.
    local: Bounds,
}

/// The vertices of a primitive that are in the mesh already: several primitives may share one long column, of which
/// each uses a part.
#[derive(Default)]
struct Slots {
    round: u32,
    /// The round in which a vertex was used, and its index in the mesh.
    used: Vec<(u32, u32)>,
}

/// The attributes of a primitive.
struct Columns<'a> {
    position: Column<'a>,
    normal: Option<Column<'a>>,
    uv: Option<Column<'a>>,
    colour: Option<(Column<'a>, ValueShape)>,
}

impl<'a> Reader<'a> {
    fn node(&mut self, index: usize, affine: &DAffine3) -> Result<(), GltfError> {
        let document = &self.file.document;
        let node = named(&document.nodes, index, "node")?;
        self.note("cameras", usize::from(node.camera.is_some()));
        if let Some(extensions) = &node.extensions {
            self.note("lights", usize::from(extensions.contains_key("KHR_lights_punctual")));
            self.note("instances (EXT_mesh_gpu_instancing)", usize::from(has(extensions, "EXT_mesh_gpu_instancing")));
        }
        let Some(mesh) = node.mesh else { return Ok(()) };
        self.note("skins (their meshes are drawn at rest)", usize::from(node.skin.is_some()));
        if !affine.is_finite() || affine.matrix3.determinant() == 0.0 {
            self.note("meshes in nodes with a scale of 0", 1);
            return Ok(());
        }
        for primitive in &named(&document.meshes, mesh, "mesh")?.primitives {
            self.primitive(primitive, affine)?;
        }
        Ok(())
    }

    fn primitive(&mut self, primitive: &Primitive, affine: &DAffine3) -> Result<(), GltfError> {
        let mode = primitive.mode.unwrap_or(4);
        if mode > 6 {
            return Err(wrong(format!("a primitive of mode {mode}"), "0 to 6"));
        }
        if mode < 4 {
            self.note("primitives that are points or lines", 1);
            return Ok(());
        }
        let Some(&position) = primitive.attributes.get("POSITION") else {
            self.note("primitives without positions", 1);
            return Ok(());
        };
        if has(&primitive.extensions, "KHR_draco_mesh_compression")
            && named(&self.file.document.accessors, position, "accessor")?.buffer_view.is_none()
        {
            let found = "a primitive packed by `KHR_draco_mesh_compression`";
            return Err(wrong(found, "triangles that are not packed"));
        }
        self.note("morph targets (meshes are drawn without)", primitive.targets.len());
        let columns = self.columns(primitive, position)?;
        let set = self.materials.uv_set(primitive.material);
        let textured = columns.uv.is_some() || set.is_none();
        if let Some(set) = set.filter(|_| !textured) {
            self.note(format!("textures of primitives without their coordinates, TEXCOORD_{set}"), 1);
        }
        let material = self.materials.index(primitive.material, textured, &mut self.mesh)?;
        let indices =
            primitive.indices.map(|index| self.file.column(index, ValueShape::Scalar, "indices")).transpose()?;
        if indices.as_ref().is_some_and(|indices| !indices.counts()) {
            return Err(wrong("indices that are signed, normalised or floats", "whole numbers from 0"));
        }
        let count = indices.as_ref().map_or(columns.position.count, |indices| indices.count);
        self.slots.start(columns.position.count);
        let uv = self.materials.uv_transform(primitive.material);
        // What a transform mirrors shows its other side, so its corners are counted the other way.
        let linear = affine.matrix3;
        let mirrored = linear.determinant() < 0.0;
        let turn = normal_matrix(&linear);
        let mut lost = 0;
        for triangle in corners_of(mode, count) {
            let rows = triangle.map(|at| indices.as_ref().map_or(at, |indices| indices.index(at)));
            if let Some(row) = rows.into_iter().find(|&row| row >= columns.position.count) {
                return Err(wrong(format!("index {row}"), format!("below {}, the vertices", columns.position.count)));
            }
            let finite = |row: &usize| {
                let p = affine.transform_point3(DVec3::from_array(columns.position.get(*row)));
                p.abs().max_element() <= FAR && p.is_finite()
            };
            if !rows.iter().all(finite) {
                lost += 1;
                continue;
            }
            let mut corners = [0; 3];
            for (corner, row) in corners.iter_mut().zip(rows) {
                *corner = match self.slots.get(row) {
                    Some(known) => known,
                    None => self.vertex(&columns, row, affine, &turn, &uv)?,
                };
            }
            if mirrored {
                corners.swap(1, 2);
            }
            self.take(TRIANGLE_BYTES)?;
            self.mesh.triangles.push(Triangle { corners, material });
        }
        self.note("triangles with positions that are no numbers", lost);
        self.note("corners at the end of a list that make no triangle", if mode == 4 { count % 3 } else { 0 });
        Ok(())
    }

    fn columns(&mut self, primitive: &Primitive, position: usize) -> Result<Columns<'a>, GltfError> {
        let file = self.file;
        let attribute = |name: &str| primitive.attributes.get(name).copied();
        let column =
            |name: &str, shape: ValueShape| attribute(name).map(|index| file.column(index, shape, name)).transpose();
        let uv = format!("TEXCOORD_{}", self.materials.uv_set(primitive.material).unwrap_or(0));
        let colour = attribute("COLOR_0").map(|index| -> Result<_, GltfError> {
            let shape = if file.shape(index)? == ValueShape::Vec3 { ValueShape::Vec3 } else { ValueShape::Vec4 };
            Ok((file.column(index, shape, "COLOR_0")?, shape))
        });
        let columns = Columns {
            position: file.column(position, ValueShape::Vec3, "POSITION")?,
            normal: column("NORMAL", ValueShape::Vec3)?,
            uv: column(&uv, ValueShape::Vec2)?,
            colour: colour.transpose()?,
        };
        let count = columns.position.count;
        let others = [columns.normal.as_ref(), columns.uv.as_ref(), columns.colour.as_ref().map(|(c, _)| c)];
        if let Some(odd) = others.into_iter().flatten().find(|column| column.count != count) {
            let found = format!("{} values of an attribute", odd.count);
            return Err(wrong(found, format!("{count}, as many as positions")));
        }
        if columns.colour.as_ref().is_some_and(|(colour, _)| !colour.is_real()) {
            return Err(wrong("colours in whole numbers", "floats, or normalised integers").of("COLOR_0"));
        }
        self.note("joints and weights of skins", usize::from(attribute("JOINTS_0").is_some()));
        for (present, column) in self.columns.iter_mut().zip(others) {
            *present |= column.is_some();
        }
        Ok(columns)
    }

    /// Appends a vertex.
    fn vertex(
        &mut self,
        columns: &Columns<'_>,
        row: usize,
        affine: &DAffine3,
        turn: &DMat3,
        uv: &dyn Fn(DVec2) -> DVec2,
    ) -> Result<u32, GltfError> {
        self.take(VERTEX_BYTES)?;
        let index = u32::try_from(self.mesh.position.len())
            .map_err(|_| wrong("more than 4294967295 vertices", "at most as many"))?;
        let place = DVec3::from_array(columns.position.get(row));
        if columns.position.is_f32() {
            self.local.add(place);
        }
        self.mesh.position.push(affine.transform_point3(place));
        let normal = columns.normal.as_ref().map(|normal| *turn * DVec3::from_array(normal.get(row)));
        self.mesh.normal.push(normal.and_then(DVec3::try_normalize).unwrap_or(DVec3::ZERO).as_vec3());
        let at = columns.uv.as_ref().map_or(DVec2::ZERO, |column| uv(DVec2::from_array(column.get(row)))).as_vec2();
        self.mesh.uv.push(if at.is_finite() { at } else { Vec2::ZERO });
        let colour = columns.colour.as_ref().map(|(column, shape)| match shape {
            ValueShape::Vec3 => Vec3::from_array(column.get(row).map(|c| c as f32)).extend(1.0),
            _ => Vec4::from_array(column.get(row).map(|c| c as f32)),
        });
        let colour = colour.filter(|colour| colour.is_finite()).unwrap_or(Vec4::ONE);
        self.mesh.colour.push(colour.max(Vec4::ZERO));
        self.slots.set(row, index);
        Ok(index)
    }

    /// Counts memory before it is taken: a small file may name one mesh in millions of places.
    fn take(&mut self, bytes: u64) -> Result<(), GltfError> {
        self.left = self.left.checked_sub(bytes).ok_or_else(|| {
            wrong("more triangles in all places than the file can mean", "fewer places, or a larger file")
        })?;
        Ok(())
    }

    fn note(&mut self, what: impl Into<Cow<'static, str>>, count: usize) {
        let what = what.into();
        // A hostile file has any number of names.
        if count > 0 && (self.notes.len() < MOST_NOTES || self.notes.contains_key(&what)) {
            *self.notes.entry(what).or_default() += count;
        }
    }

    fn finish(mut self) -> Mesh {
        let animations = self.file.document.animations.len();
        self.note(super::NOT_PLAYED, animations);
        let Self { mut mesh, materials, notes, columns, local, .. } = self;
        mesh.keep(columns);
        mesh.notes.extend(tidy::coarse(&local, mesh.position.len()));
        materials.finish(&mut mesh);
        mesh.notes.extend(notes.into_iter().map(|(what, count)| format!("ignored: {what} ({count})")));
        mesh
    }
}

impl Slots {
    fn start(&mut self, count: usize) {
        self.round += 1;
        // Positions lie in the file, so this is no more than it.
        if self.used.len() < count {
            self.used.resize(count, (0, 0));
        }
    }

    fn get(&self, row: usize) -> Option<u32> {
        self.used.get(row).filter(|(round, _)| *round == self.round).map(|(_, index)| *index)
    }

    fn set(&mut self, row: usize, index: u32) {
        if let Some(slot) = self.used.get_mut(row) {
            *slot = (self.round, index);
        }
    }
}

fn has(extensions: &BTreeMap<String, Value>, name: &str) -> bool {
    extensions.contains_key(name)
}

/// The corners of all triangles of a primitive with `count` corners: glTF 2.0, section 3.7.2.1.
fn corners_of(mode: u32, count: usize) -> impl Iterator<Item = [usize; 3]> {
    let triangles = if mode == 4 { count / 3 } else { count.saturating_sub(2) };
    (0..triangles).map(move |i| match mode {
        4 => [3 * i, 3 * i + 1, 3 * i + 2],
        // A strip turns every other triangle.
        5 => [i, i + 1 + i % 2, i + 2 - i % 2],
        _ => [i + 1, i + 2, 0],
    })
}

/// Inverse transpose up to a positive factor: the cofactors, with the determinant's sign.
fn normal_matrix(m: &DMat3) -> DMat3 {
    let (a, b, c) = (m.x_axis, m.y_axis, m.z_axis);
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b)) * sign
}

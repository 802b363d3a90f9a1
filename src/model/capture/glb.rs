//! GLB files (glTF 2.0 in one file) with the extension `KHR_gaussian_splatting`.
//!
//! ```text
//! "glTF", u32 version 2, u32 length | u32 length, "JSON", text | u32 length, "BIN\0", data
//! ```
//! The text places columns of numbers (accessors in buffer views) in the data. Primitives name columns by attribute,
//! meshes hold primitives, and nodes place meshes. The frame is x left, y up, z front.

use std::collections::{BTreeMap, HashSet};

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Vec3};
use serde::Deserialize;
use serde_json::Value;

use super::{Gaussian, Gaussians, MOST_DEGREE, MOST_HARMONICS, allowance};
use crate::model::error::{ParseError, quote};

/// The extension of primitives that are Gaussians, and the prefix of their attributes.
const EXTENSION: &str = "KHR_gaussian_splatting";
/// Where the text begins: what is wrong in it has no better place.
const TEXT: usize = 20;
/// Longest text. Its parsed form is about twenty times as large.
const MOST_TEXT: usize = 16 << 20;
/// The mode of a primitive that is points.
const POINTS: u32 = 0;
/// Signs of the harmonics of degrees 1 to 3 in the common frame: a turn by 180 degrees about z.
const SIGNS: [f32; MOST_HARMONICS] =
    [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0];
/// About the memory of a primitive in one place.
const PART_BYTES: u64 = 1024;
/// Memory of a Gaussian with all its harmonics.
const GAUSSIAN_BYTES: u64 = 236;
/// Largest difference of directions and scales that still counts as rounding.
const ROUNDING: f64 = 1e-4;

/// Reads a GLB file.
///
/// # Errors
/// The error names the byte: the start of the text where the text is at fault. The file is cut short, has no Gaussians,
/// has some of an unknown kind, or places them by a transform that Gaussians cannot follow.
pub(in crate::model) fn parse(bytes: &[u8]) -> Result<Gaussians, ParseError> {
    let file = File::read(bytes)?;
    let mut notes = Vec::new();
    let parts = file.parts(allowance(bytes.len()), &mut notes)?;
    let Some(degree) = parts.iter().map(|part| part.degree).max() else {
        return Err(wrong("a mesh without Gaussians", format!("primitives with `{EXTENSION}`")));
    };
    let linear = parts.iter().any(|part| part.linear);
    if linear && parts.iter().any(|part| !part.linear) {
        return Err(wrong("Gaussians of two colour spaces", "one for all"));
    }
    // A program writes one kind of scale, whatever the numbers of one of its primitives are.
    let logarithms = parts.iter().any(|part| part.scale.any_negative());
    if logarithms {
        notes.push("Gaussian splats: negative scales, so all are taken as logarithms".to_owned());
    }
    let mut gaussians =
        Gaussians { linear, notes, turned: Some("180 degrees about z"), ..Gaussians::of_degree(degree) };
    for part in &parts {
        part.append(logarithms, &mut gaussians);
    }
    Ok(gaussians)
}

/// An error of the text.
fn wrong(found: impl Into<String>, expected: impl Into<String>) -> ParseError {
    ParseError::byte(TEXT, found, expected)
}

/// The part of a glTF text that matters here.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Document {
    scene: Option<usize>,
    scenes: Vec<Scene>,
    nodes: Vec<Node>,
    meshes: Vec<Mesh>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<BufferView>,
    buffers: Vec<Buffer>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Scene {
    nodes: Vec<usize>,
}

/// Its transform is a matrix by columns, or a scale, then a rotation, then a translation.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Node {
    children: Vec<usize>,
    mesh: Option<usize>,
    matrix: Option<Box<[f64; 16]>>,
    rotation: Option<Box<[f64; 4]>>,
    scale: Option<Box<[f64; 3]>>,
    translation: Option<Box<[f64; 3]>>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Mesh {
    primitives: Vec<Primitive>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Primitive {
    attributes: BTreeMap<String, usize>,
    mode: Option<u32>,
    extensions: BTreeMap<String, Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: usize,
    #[serde(rename = "type")]
    shape: Shape,
    sparse: Option<serde::de::IgnoredAny>,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
enum Shape {
    Scalar,
    Vec2,
    Vec3,
    Vec4,
    Mat2,
    Mat3,
    Mat4,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct BufferView {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Buffer {
    byte_length: usize,
    uri: Option<serde::de::IgnoredAny>,
}

/// A file taken apart.
struct File<'a> {
    document: Document,
    data: &'a [u8],
}

/// One primitive in one place.
struct Part<'a> {
    position: Column<'a>,
    rotation: Column<'a>,
    scale: Column<'a>,
    opacity: Column<'a>,
    base: Column<'a>,
    harmonics: Vec<Column<'a>>,
    degree: u8,
    linear: bool,
    place: Place,
}

/// From a mesh to the common frame.
struct Place {
    affine: DAffine3,
    rotation: DQuat,
    scale: f64,
}

/// Numbers of one attribute. All of them lie in `data`.
struct Column<'a> {
    data: &'a [u8],
    stride: usize,
    component: Component,
    normalized: bool,
    count: usize,
}

#[derive(Clone, Copy)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl<'a> File<'a> {
    fn read(bytes: &'a [u8]) -> Result<Self, ParseError> {
        let magic: [u8; 4] = array(bytes, 0)?;
        if magic != *b"glTF" {
            return Err(ParseError::byte(0, quote(&magic), "`glTF`"));
        }
        let version = u32::from_le_bytes(array(bytes, 4)?);
        if version != 2 {
            return Err(ParseError::byte(4, format!("glTF version {version}"), "2"));
        }
        let length = u32::from_le_bytes(array(bytes, 8)?) as usize;
        let Some(whole) = bytes.get(..length) else {
            return Err(ParseError::byte(8, format!("a length of {length} bytes"), format!("at most {}", bytes.len())));
        };
        let text = chunk(whole, 12, *b"JSON")?;
        if text.len() > MOST_TEXT {
            return Err(ParseError::byte(12, format!("{} bytes of text", text.len()), format!("at most {MOST_TEXT}")));
        }
        let document: Document = serde_json::from_slice(text).map_err(|why| {
            let place = format!("line {} column {}", why.line(), why.column());
            wrong(format!("a text that fails at {place}: {}", quote(why.to_string().as_bytes())), "glTF 2.0 in JSON")
        })?;
        let after = TEXT + text.len();
        // A file without data has no second chunk.
        let data = if after < whole.len() { chunk(whole, after, *b"BIN\0")? } else { &[] };
        Ok(Self { document, data })
    }

    /// All primitives that are Gaussians, in each place where the scene has them: at most `most` bytes.
    fn parts(&self, most: u64, notes: &mut Vec<String>) -> Result<Vec<Part<'a>>, ParseError> {
        let mut parts = Vec::new();
        let mut total = 0_u64;
        let (mut other, mut unsaid) = (0_usize, 0_usize);
        for (node, affine) in self.placed_nodes()? {
            let Some(index) = self.document.nodes.get(node).and_then(|node| node.mesh) else { continue };
            let mesh = named(&self.document.meshes, index, "mesh")?;
            for primitive in &mesh.primitives {
                refuse_compressed(primitive.extensions.keys())?;
                let Some(extension) = primitive.extensions.get(EXTENSION) else {
                    other += 1;
                    continue;
                };
                let place = Place::new(affine).map_err(|found| {
                    wrong(format!("node {node}, {found}"), "rotation, translation and one scale for all axes")
                })?;
                unsaid += usize::from(extension.get("colorSpace").is_none());
                let part = self.part(primitive, extension, place, notes)?;
                // Counted at once: a small file may name one mesh in millions of places.
                total = total.saturating_add(PART_BYTES + GAUSSIAN_BYTES.saturating_mul(part.position.count as u64));
                if total > most {
                    let found = "more Gaussians than the file can mean";
                    return Err(wrong(found, format!("at most {most} bytes of them in all places")));
                }
                parts.push(part);
            }
        }
        if other > 0 && !parts.is_empty() {
            notes.push(format!("{other} primitives that are no Gaussians ignored"));
        }
        if unsaid > 0 {
            notes.push("Gaussian splats: the file does not say the colour space".to_owned());
        }
        Ok(parts)
    }

    fn part(
        &self,
        primitive: &Primitive,
        extension: &Value,
        place: Place,
        notes: &mut Vec<String>,
    ) -> Result<Part<'a>, ParseError> {
        if let Some(inner) = extension.get("extensions").and_then(Value::as_object) {
            refuse_compressed(inner.keys())?;
        }
        let mode = primitive.mode.unwrap_or(4);
        if mode != POINTS {
            return Err(wrong(format!("Gaussians of mode {mode}"), "mode 0 (points)"));
        }
        one_of(extension, "kernel", &["ellipse"])?;
        one_of(extension, "projection", &["perspective"])?;
        let space = one_of(extension, "colorSpace", &["srgb_rec709_display", "lin_rec709_display"])?;
        let column = |name: &str, shape| self.attribute(primitive, name, shape);
        let own = |name: &str, shape| self.attribute(primitive, &format!("{EXTENSION}:{name}"), shape);
        let position = column("POSITION", Shape::Vec3)?;
        let mut part = Part {
            rotation: own("ROTATION", Shape::Vec4)?,
            scale: own("SCALE", Shape::Vec3)?,
            opacity: own("OPACITY", Shape::Scalar)?,
            base: own("SH_DEGREE_0_COEF_0", Shape::Vec3)?,
            harmonics: Vec::new(),
            degree: 0,
            linear: space == Some("lin_rec709_display"),
            place,
            position,
        };
        let has = |name: &String| primitive.attributes.contains_key(name);
        for degree in 1..=MOST_DEGREE {
            let names: Vec<String> =
                (0..=2 * degree).map(|n| format!("{EXTENSION}:SH_DEGREE_{degree}_COEF_{n}")).collect();
            if !names.iter().all(has) {
                if names.iter().any(has) {
                    notes.push(format!("Gaussian splats: harmonics of degree {degree} are incomplete: ignored"));
                }
                break;
            }
            for name in names {
                part.harmonics.push(self.attribute(primitive, &name, Shape::Vec3)?);
            }
            part.degree = degree;
        }
        let columns = [&part.rotation, &part.scale, &part.opacity, &part.base];
        if let Some(odd) = columns.into_iter().chain(&part.harmonics).find(|c| c.count != part.position.count) {
            let found = format!("{} values of an attribute", odd.count);
            return Err(wrong(found, format!("{}, as many as positions", part.position.count)));
        }
        if part.degree > 0 && part.place.turns() {
            return Err(wrong(
                "a node that rotates Gaussians with harmonics",
                "no rotation, or colours that are the same from all sides",
            ));
        }
        Ok(part)
    }

    /// The column of an attribute.
    fn attribute(&self, primitive: &Primitive, name: &str, shape: Shape) -> Result<Column<'a>, ParseError> {
        let Some(&index) = primitive.attributes.get(name) else {
            return Err(wrong(format!("Gaussians without `{name}`"), "this attribute"));
        };
        let accessor = named(&self.document.accessors, index, "accessor")?;
        let fault = |found: String, expected: String| wrong(format!("accessor {index}, {found}"), expected).of(name);
        if accessor.shape != shape {
            return Err(fault(format!("type {:?}", accessor.shape), format!("{shape:?}")));
        }
        if accessor.sparse.is_some() {
            return Err(fault("sparse values".into(), "values in a buffer view".into()));
        }
        let Some(component) = Component::of(accessor.component_type) else {
            return Err(fault(
                format!("component type {}", accessor.component_type),
                "5120 to 5123, 5125 or 5126".into(),
            ));
        };
        let Some(view_index) = accessor.buffer_view else {
            return Err(fault("no buffer view".into(), "one".into()));
        };
        let view = named(&self.document.buffer_views, view_index, "buffer view")?;
        let data = self.view(view_index, view)?;
        let size = component.size() * shape.width();
        let stride = view.byte_stride.unwrap_or(size);
        if stride < size {
            return Err(fault(format!("a stride of {stride} bytes"), format!("at least {size}")));
        }
        // The last value need not have the padding of a stride.
        let before_last = accessor.count.saturating_sub(1).checked_mul(stride);
        let needed = before_last.and_then(|n| n.checked_add(if accessor.count > 0 { size } else { 0 }));
        let end = needed.and_then(|needed| accessor.byte_offset.checked_add(needed));
        let Some(data) = end.and_then(|end| data.get(accessor.byte_offset..end)) else {
            let found = format!("{} values from byte {}", accessor.count, accessor.byte_offset);
            return Err(fault(found, format!("values inside buffer view {view_index} of {} bytes", view.byte_length)));
        };
        Ok(Column { data, stride, component, normalized: accessor.normalized, count: accessor.count })
    }

    /// The bytes of a buffer view.
    fn view(&self, index: usize, view: &BufferView) -> Result<&'a [u8], ParseError> {
        let buffer = named(&self.document.buffers, view.buffer, "buffer")?;
        if view.buffer != 0 || buffer.uri.is_some() {
            return Err(wrong(format!("buffer view {index} in another file"), "all data in this file"));
        }
        let Some(data) = self.data.get(..buffer.byte_length) else {
            let found = format!("a buffer of {} bytes", buffer.byte_length);
            return Err(wrong(found, format!("at most the {} of the data", self.data.len())));
        };
        let end = view.byte_offset.checked_add(view.byte_length);
        end.and_then(|end| data.get(view.byte_offset..end)).ok_or_else(|| {
            let found = format!("buffer view {index} of {} bytes at {}", view.byte_length, view.byte_offset);
            wrong(found, format!("inside the buffer of {} bytes", data.len()))
        })
    }

    /// Nodes of the scene and their transforms to the world.
    fn placed_nodes(&self) -> Result<Vec<(usize, DAffine3)>, ParseError> {
        let Document { scene, scenes, nodes, .. } = &self.document;
        let roots: Vec<usize> = if scenes.is_empty() && scene.is_none() {
            let children: HashSet<usize> = nodes.iter().flat_map(|node| node.children.iter().copied()).collect();
            (0..nodes.len()).filter(|index| !children.contains(index)).collect()
        } else {
            named(scenes, scene.unwrap_or(0), "scene")?.nodes.clone()
        };
        let mut seen = vec![false; nodes.len()];
        let mut placed = Vec::new();
        let mut open: Vec<_> = roots.into_iter().rev().map(|root| (root, DAffine3::IDENTITY)).collect();
        while let Some((index, parent)) = open.pop() {
            let node = named(nodes, index, "node")?;
            if std::mem::replace(&mut seen[index], true) {
                return Err(wrong(format!("node {index} a second time"), "a tree without cycles"));
            }
            let affine =
                parent * node.transform().map_err(|found| wrong(format!("node {index}, {found}"), "a transform"))?;
            open.extend(node.children.iter().rev().map(|child| (*child, affine)));
            placed.push((index, affine));
        }
        Ok(placed)
    }
}

impl Node {
    fn transform(&self) -> Result<DAffine3, &'static str> {
        if let Some(matrix) = &self.matrix {
            let matrix = DMat4::from_cols_array(matrix);
            if !matrix.is_finite() || matrix.row(3).to_array() != [0.0, 0.0, 0.0, 1.0] {
                return Err("a matrix whose last row is not 0 0 0 1");
            }
            return Ok(DAffine3::from_mat4(matrix));
        }
        let rotation = self.rotation.as_ref().map_or(DQuat::IDENTITY, |xyzw| DQuat::from_array(**xyzw));
        let length = rotation.length();
        if !(1e-15..1e15).contains(&length) {
            return Err("a rotation without direction");
        }
        let scale = self.scale.as_ref().map_or(DVec3::ONE, |s| DVec3::from_array(**s));
        let translation = self.translation.as_ref().map_or(DVec3::ZERO, |t| DVec3::from_array(**t));
        Ok(DAffine3::from_scale_rotation_translation(scale, (rotation / length).normalize(), translation))
    }
}

impl Place {
    /// Takes a transform apart; the error says what Gaussians cannot follow.
    fn new(affine: DAffine3) -> Result<Self, &'static str> {
        // From x left, y up, z front to x right, y down, z front.
        let turn = DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0);
        let linear = affine.matrix3;
        let scale = linear.determinant().abs().cbrt();
        if !(affine.is_finite() && scale.is_finite() && scale > 1e-30) {
            return Err("a scale of 0 or without bounds");
        }
        let unit = DMat3::from_cols_array(&linear.to_cols_array().map(|x| x / scale));
        if !(unit * unit.transpose()).abs_diff_eq(DMat3::IDENTITY, ROUNDING) {
            return Err("a scale that is not the same along all axes");
        }
        if unit.determinant() < 0.0 {
            return Err("a scale that mirrors");
        }
        let rotation = turn * DQuat::from_mat3(&unit).normalize();
        Ok(Self { affine: DAffine3::from_quat(turn) * affine, rotation, scale })
    }

    /// True if it does more than the turn into the common frame.
    fn turns(&self) -> bool {
        self.rotation.z.abs() < 1.0 - ROUNDING * ROUNDING
    }
}

impl Part<'_> {
    fn append(&self, logarithms: bool, gaussians: &mut Gaussians) {
        for row in 0..self.position.count {
            let [x, y, z, w] = self.rotation.get(row);
            let turned = self.place.rotation * DQuat::from_xyzw(x, y, z, w);
            let [opacity] = self.opacity.get(row);
            let mut gaussian = Gaussian {
                position: self.place.affine.transform_point3(DVec3::from_array(self.position.get(row))).to_array(),
                sigma: self.scale.get(row).map(|s| self.place.scale * if logarithms { s.exp() } else { s }),
                rotation: [turned.w, turned.x, turned.y, turned.z],
                opacity,
                base: self.base.get(row),
                harmonics: [Vec3::ZERO; MOST_HARMONICS],
            };
            for ((harmonic, column), sign) in gaussian.harmonics.iter_mut().zip(&self.harmonics).zip(SIGNS) {
                *harmonic = sign * Vec3::from_array(column.get(row).map(|c| c as f32));
            }
            gaussians.push(&gaussian);
        }
    }
}

impl Column<'_> {
    /// The numbers of one value.
    fn get<const N: usize>(&self, row: usize) -> [f64; N] {
        let size = self.component.size();
        std::array::from_fn(|index| {
            self.data.get(row * self.stride + index * size..).map_or(f64::NAN, |b| self.number(b))
        })
    }

    fn number(&self, bytes: &[u8]) -> f64 {
        fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
            bytes.first_chunk().copied().unwrap_or([0; N])
        }
        let (value, most) = match self.component {
            Component::I8 => (f64::from(i8::from_le_bytes(first(bytes))), f64::from(i8::MAX)),
            Component::U8 => (f64::from(u8::from_le_bytes(first(bytes))), f64::from(u8::MAX)),
            Component::I16 => (f64::from(i16::from_le_bytes(first(bytes))), f64::from(i16::MAX)),
            Component::U16 => (f64::from(u16::from_le_bytes(first(bytes))), f64::from(u16::MAX)),
            Component::U32 => (f64::from(u32::from_le_bytes(first(bytes))), f64::from(u32::MAX)),
            Component::F32 => return f64::from(f32::from_le_bytes(first(bytes))),
        };
        if self.normalized { (value / most).max(-1.0) } else { value }
    }

    fn any_negative(&self) -> bool {
        (0..self.count).any(|row| self.get::<3>(row).iter().any(|s| *s < 0.0))
    }
}

impl Component {
    fn of(code: u32) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

impl Shape {
    fn width(self) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Vec2 => 2,
            Self::Vec3 => 3,
            Self::Vec4 | Self::Mat2 => 4,
            Self::Mat3 => 9,
            Self::Mat4 => 16,
        }
    }
}

/// Refuses Gaussians that an extension packs: the axes of what it packs are not settled.
fn refuse_compressed<'a>(mut names: impl Iterator<Item = &'a String>) -> Result<(), ParseError> {
    let packed = names.find(|name| name.starts_with("KHR_gaussian_splatting_compression"));
    packed.map_or(Ok(()), |name| Err(wrong(quote(name.as_bytes()), "Gaussians that are not packed by an extension")))
}

/// The known word of a property, if the file has this property.
fn one_of<'a>(extension: &Value, property: &str, known: &[&'a str]) -> Result<Option<&'a str>, ParseError> {
    let Some(value) = extension.get(property) else { return Ok(None) };
    let found = known.iter().find(|word| value.as_str() == Some(**word));
    let list = || known.iter().map(|word| format!("`{word}`")).collect::<Vec<_>>().join(" or ");
    match found {
        Some(word) => Ok(Some(*word)),
        None => Err(wrong(format!("{property} {}", quote(value.as_str().unwrap_or("?").as_bytes())), list())),
    }
}

/// The item of this index.
fn named<'a, T>(items: &'a [T], index: usize, what: &str) -> Result<&'a T, ParseError> {
    let missing = || wrong(format!("{what} {index}"), format!("below {}, the number there are", items.len()));
    items.get(index).ok_or_else(missing)
}

/// The content of the chunk at `at`.
fn chunk(bytes: &[u8], at: usize, kind: [u8; 4]) -> Result<&[u8], ParseError> {
    let length = u32::from_le_bytes(array(bytes, at)?) as usize;
    let found: [u8; 4] = array(bytes, at + 4)?;
    if found != kind {
        return Err(ParseError::byte(at + 4, format!("chunk {}", quote(&found)), quote(&kind)));
    }
    let end = (at + 8).saturating_add(length);
    bytes.get(at + 8..end).ok_or_else(|| {
        let left = bytes.len() - (at + 8);
        ParseError::byte(at, format!("a chunk of {length} bytes"), format!("at most {left}"))
    })
}

fn array<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], ParseError> {
    let found = bytes.get(at..).and_then(<[u8]>::first_chunk::<N>);
    found.copied().ok_or_else(|| ParseError::byte(at, "the end of the file", format!("{N} bytes")))
}

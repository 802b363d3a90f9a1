//! GLB files (glTF 2.0 in one file) with the extension `KHR_gaussian_splatting`.
//!
//! Primitives name columns of numbers by attribute, meshes hold primitives, and nodes place meshes. All data is in the
//! one file. The frame is x left, y up, z front.

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use serde_json::Value;

use super::{Gaussian, Gaussians, MOST_DEGREE, MOST_HARMONICS, allowance};
use crate::gltf::{Column, GltfError, GltfFile, Primitive, Tree, ValueShape, named, wrong};
use crate::model::error::{ParseError, quote};

/// The extension of primitives that are Gaussians, and the prefix of their attributes.
const EXTENSION: &str = "KHR_gaussian_splatting";
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
    let file = GltfFile::read_text(bytes)?;
    let mut notes = Vec::new();
    let (parts, others) = Reader { file: &file }.parts(allowance(bytes.len()), &mut notes)?;
    let Some(degree) = parts.iter().map(|part| part.degree).max() else {
        // Triangles were looked for before.
        return Err(if others > 0 {
            wrong("a mesh without Gaussians", format!("primitives with `{EXTENSION}`"))
        } else {
            let expected = format!("nodes with meshes of triangles, or of Gaussians (`{EXTENSION}`)");
            wrong("a scene that shows no mesh", expected)
        }
        .into());
    };
    let linear = parts.iter().any(|part| part.linear);
    if linear && parts.iter().any(|part| !part.linear) {
        return Err(wrong("Gaussians of two colour spaces", "one for all").into());
    }
    // A program writes one kind of scale, whatever the numbers of one of its primitives are.
    let logarithms = parts.iter().any(Part::any_negative_scale);
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
    place: MeshPose,
}

/// From a mesh to the common frame.
struct MeshPose {
    affine: DAffine3,
    rotation: DQuat,
    scale: f64,
}

/// The Gaussians of a file.
struct Reader<'a> {
    file: &'a GltfFile<'a>,
}

impl<'a> Reader<'a> {
    /// All primitives that are Gaussians, in each place where the scene has them: at most `most` bytes. With them the
    /// number of those that are none.
    fn parts(&self, most: u64, notes: &mut Vec<String>) -> Result<(Vec<Part<'a>>, usize), GltfError> {
        let mut parts = Vec::new();
        let mut total = 0_u64;
        let (mut other, mut unsaid) = (0_usize, 0_usize);
        for (node, affine) in Tree::new(&self.file.document)?.placed(&self.file.document)? {
            let Some(index) = self.file.document.nodes.get(node).and_then(|node| node.mesh) else { continue };
            let mesh = named(&self.file.document.meshes, index, "mesh")?;
            for primitive in &mesh.primitives {
                refuse_compressed(primitive.extensions.keys())?;
                let Some(extension) = primitive.extensions.get(EXTENSION) else {
                    other += 1;
                    continue;
                };
                let place = MeshPose::new(affine).map_err(|found| {
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
        Ok((parts, other))
    }

    fn part(
        &self,
        primitive: &Primitive,
        extension: &Value,
        place: MeshPose,
        notes: &mut Vec<String>,
    ) -> Result<Part<'a>, GltfError> {
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
        let position = column("POSITION", ValueShape::Vec3)?;
        let mut part = Part {
            rotation: own("ROTATION", ValueShape::Vec4)?,
            scale: own("SCALE", ValueShape::Vec3)?,
            opacity: own("OPACITY", ValueShape::Scalar)?,
            base: own("SH_DEGREE_0_COEF_0", ValueShape::Vec3)?,
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
                part.harmonics.push(self.attribute(primitive, &name, ValueShape::Vec3)?);
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
    fn attribute(&self, primitive: &Primitive, name: &str, shape: ValueShape) -> Result<Column<'a>, GltfError> {
        let Some(&index) = primitive.attributes.get(name) else {
            return Err(wrong(format!("Gaussians without `{name}`"), "this attribute"));
        };
        self.file.column(index, shape, name)
    }
}

impl MeshPose {
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
    fn any_negative_scale(&self) -> bool {
        (0..self.scale.count).any(|row| self.scale.get::<3>(row).iter().any(|s| *s < 0.0))
    }

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

/// Refuses Gaussians that an extension packs: the axes of what it packs are not settled.
fn refuse_compressed<'a>(mut names: impl Iterator<Item = &'a String>) -> Result<(), GltfError> {
    let packed = names.find(|name| name.starts_with("KHR_gaussian_splatting_compression"));
    packed.map_or(Ok(()), |name| Err(wrong(quote(name.as_bytes()), "Gaussians that are not packed by an extension")))
}

/// The known word of a property, if the file has this property.
fn one_of<'a>(extension: &Value, property: &str, known: &[&'a str]) -> Result<Option<&'a str>, GltfError> {
    let Some(value) = extension.get(property) else { return Ok(None) };
    let found = known.iter().find(|word| value.as_str() == Some(**word));
    let list = || known.iter().map(|word| format!("`{word}`")).collect::<Vec<_>>().join(" or ");
    match found {
        Some(word) => Ok(Some(*word)),
        None => Err(wrong(format!("{property} {}", quote(value.as_str().unwrap_or("?").as_bytes())), list())),
    }
}

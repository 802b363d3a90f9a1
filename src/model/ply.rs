//! PLY files: point clouds, surfels, meshes, and Gaussian-splat captures.
//!
//! The header (`ply_header`) becomes a list of steps, one for each property. The body (`ply_body`) is then read in one
//! pass. Names count in any letter case and order, values in any type. The names for points are in `columns`;
//! `ply_scales` knows which whole number stands for 1. Others are:
//!
//! | what | names |
//! |---|---|
//! | normals where vertices have none | vertex_indices, vertex_index of faces; tristrips |
//! | Gaussian splat | f_dc_0.. opacity scale_0.. rot_0.. ; f_rest_0.. ; packed ones: `capture::compressed_ply` |

use glam::{DVec3, Vec3};

use super::area_normals::{self, AreaNormals};
use super::capture::compressed_ply;
use super::capture::{Gaussian, Gaussians, MOST_HARMONICS, harmonics_of, logistic};
use super::cloud::Cloud;
use super::colour_by::ColourBy;
use super::columns::{Columns, Finder};
use super::error::ParseError;
use super::mesh::polygon::fans;
use super::ply_body::{Body, within};
use super::ply_faces::{self, Triangles};
use super::ply_header::{self, Element, Encoding, Header, PropertyKind, Scalar};
use super::ply_scales;
use super::surfels::VelocityUnit;
use super::tidy;

/// Comment with which [`super::write_ply`] says that float colours are linear light and may exceed 1.
pub(super) const LINEAR_COLOURS: &str = "splatblur colours are linear light";
/// Comment of our own files whose normals have no sign.
pub(super) const TWO_SIDED: &str = "splatblur shows both sides";
/// Comment of our own files whose normals were estimated.
pub(super) const SIGNS_ESTIMATED: &str = "splatblur estimated the signs of the normals";

/// Comment of our own files with velocities per frame.
pub(super) const PER_FRAME: &str = "splatblur velocities are per frame";

/// What a PLY file holds.
pub(super) enum PlyContent {
    /// Points, surfels, or the vertices of a mesh.
    Cloud(Cloud),
    /// Vertices, and the corners of triangles: at least one, all valid.
    Mesh(Cloud, Vec<[u32; 3]>),
    /// Gaussians.
    Capture(Gaussians),
}

impl PlyContent {
    fn notes(&mut self) -> &mut Vec<String> {
        match self {
            Self::Cloud(cloud) | Self::Mesh(cloud, _) => &mut cloud.notes,
            Self::Capture(gaussians) => &mut gaussians.notes,
        }
    }

    fn note_surplus(&mut self, body: &Body<'_>) {
        let surplus = body.surplus();
        if surplus > 0 {
            self.notes().push(format!("{surplus} bytes after the last element ignored"));
        }
    }

    fn has_points(&self) -> bool {
        match self {
            Self::Cloud(cloud) | Self::Mesh(cloud, _) => !cloud.position.is_empty(),
            Self::Capture(gaussians) => !gaussians.is_empty(),
        }
    }
}

/// Reads a PLY file. `progress` now and then gets the share of vertices read. `faces`: a file with faces is a mesh;
/// else its vertices are points, with normals from the faces. Surfels and samples of volumes stay points in any case.
/// `by`: the column that points are coloured by.
///
/// # Errors
/// The error names the line or the byte. Something is outside the grammar, the body is cut short, vertices have no
/// positions, or face indices are bad. Where the faces of a text are at fault, its points are used, with a note.
pub(super) fn parse(
    bytes: &[u8],
    faces: bool,
    by: Option<&ColourBy>,
    progress: &dyn Fn(f32),
) -> Result<PlyContent, ParseError> {
    let header = ply_header::parse(bytes)?;
    let mut body = Body::new(bytes, header.body, header.encoding);
    if compressed_ply::is_compressed(&header) {
        let mut content = PlyContent::Capture(compressed_ply::parse(&header, &mut body, progress)?);
        content.note_surplus(&body);
        return Ok(content);
    }
    let mut content = None;
    let as_mesh = faces;
    let mut faces = Vec::new();
    let mut damage = None;
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => content = Some(read_vertices(&mut body, element, &header, by, progress)?),
            "face" | "tristrips" => {
                faces.push((element, body.at));
                if let Err(fault) = body.skip_element(element) {
                    damage = Some(spare_points(fault, &header, content.as_ref())?);
                    break;
                }
            }
            _ => body.skip_element(element)?,
        }
    }
    let Some(mut content) = content else {
        return Err(ParseError::line(1, "no element `vertex`", "`element vertex COUNT` in the header"));
    };
    if damage.is_none() {
        content.note_surplus(&body);
    }
    if as_mesh
        && let PlyContent::Cloud(cloud) = &mut content
        && is_vertices(cloud)
        && damage.is_none()
    {
        match triangles(&mut body, &faces, &cloud.position) {
            Ok((corners, _)) if corners.is_empty() => {}
            Ok((corners, note)) => {
                cloud.notes.extend(note);
                return Ok(PlyContent::Mesh(std::mem::take(cloud), corners));
            }
            Err(fault) => damage = Some(spare_points(fault, &header, Some(&content))?),
        }
    }
    if let PlyContent::Cloud(cloud) = &mut content
        && cloud.normal.is_empty()
        && !faces.is_empty()
        && damage.is_none()
    {
        match mesh_normals(&mut body, &faces, &cloud.position) {
            Ok((_, 0)) => {}
            Ok((normal, polygons)) => {
                cloud.normal = normal;
                cloud.notes.push(format!("normals from {polygons} faces, weighted by area"));
                cloud.notes.extend(area_normals::too_few(cloud.position.len(), polygons));
            }
            Err(fault) => damage = Some(spare_points(fault, &header, Some(&content))?),
        }
    }
    content.notes().extend(damage);
    Ok(content)
}

/// What to say about faces that cannot be read where the points before them can be used; else the fault itself. A text
/// whose faces were edited or cut still has its points. Bytes that are out of step may have shifted anything.
fn spare_points(fault: ParseError, header: &Header, before: Option<&PlyContent>) -> Result<String, ParseError> {
    if header.encoding == Encoding::Ascii && before.is_some_and(PlyContent::has_points) {
        Ok(format!("faces ignored, points used ({fault})"))
    } else {
        Err(fault)
    }
}

/// True for points that may be the vertices of a mesh: they are no surfels and no samples of a volume.
fn is_vertices(cloud: &Cloud) -> bool {
    cloud.radius.is_empty() && cloud.axes.is_empty() && cloud.density.is_empty()
}

/// The triangles of all faces, and what a user should know of them.
fn triangles(
    body: &mut Body<'_>,
    faces: &[(&Element, usize)],
    vertices: &[DVec3],
) -> Result<(Vec<[u32; 3]>, Option<String>), ParseError> {
    let mut triangles = Triangles::new(vertices);
    for &(element, at) in faces {
        body.at = at;
        let strips = ply_faces::are_strips(element);
        ply_faces::read(body, element, &mut |indices| {
            if strips { triangles.add_strips(indices) } else { triangles.add(indices) }
        })?;
    }
    let note = (triangles.fans > 0).then(|| fans(triangles.fans));
    Ok((triangles.corners, note))
}

/// Normals of the vertices, and the number of polygons.
fn mesh_normals(
    body: &mut Body<'_>,
    faces: &[(&Element, usize)],
    position: &[DVec3],
) -> Result<(Vec<Vec3>, usize), ParseError> {
    let mut normals = AreaNormals::new(position);
    let mut polygons = 0;
    for &(element, at) in faces {
        body.at = at;
        let strips = ply_faces::are_strips(element);
        polygons += ply_faces::read(body, element, &mut |indices| {
            if strips { normals.add_strips(indices) } else { normals.add(indices) }
        })?;
    }
    Ok((normals.finish(), polygons))
}

/// Places of the columns of a Gaussian-splat capture.
struct GaussianColumns {
    /// `f_dc` 0..2, opacity, scale 0..2, rot 0..3.
    own: [usize; 11],
    /// All harmonics above degree 0 of red, then of green, then of blue.
    rest: Vec<usize>,
    /// Their highest degree.
    degree: u8,
    /// Note on harmonics of the file that are left out.
    note: Option<String>,
}

impl GaussianColumns {
    /// The columns, if the file is a capture. `f_rest` columns count if they are exactly those of a degree from 1 to 4.
    /// A file of degree 4 keeps its degrees 1 to 3.
    fn find(finder: &mut Finder<'_>) -> Option<Self> {
        let own = finder.take([
            "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2",
            "rot_3",
        ])?;
        let given = (0..=3 * harmonics_of(4)).take_while(|k| finder.has(&format!("f_rest_{k}"))).count();
        let of_file = (1..=4_u8).rev().find(|&degree| 3 * harmonics_of(degree) == given).unwrap_or(0);
        let degree = of_file.min(3);
        let (each, used) = (harmonics_of(of_file), harmonics_of(degree));
        let wanted = (0..3).flat_map(|channel| (0..used).map(move |k| format!("f_rest_{}", channel * each + k)));
        let rest = wanted.filter_map(|name| finder.take([name.as_str()])).map(|[index]| index).collect();
        let note = match of_file {
            0 if given > 0 => {
                Some(format!("Gaussian splats: {given} columns f_rest ignored, expected 9, 24, 45 or 72"))
            }
            4 => Some("Gaussian splats: harmonics of degree 4 dropped".to_owned()),
            _ => None,
        };
        Some(Self { own, rest, degree, note })
    }

    /// The Gaussian of a record: ln sigma, logit of opacity, coefficients channel by channel.
    fn gaussian(&self, position: [f64; 3], values: &[f64]) -> Gaussian {
        let [r, g, b, opacity, s0, s1, s2, w, x, y, z] = self.own.map(|index| values[index]);
        let mut harmonics = [Vec3::ZERO; MOST_HARMONICS];
        let each = self.rest.len() / 3;
        for (k, harmonic) in harmonics[..each].iter_mut().enumerate() {
            *harmonic = Vec3::from_array([0, 1, 2].map(|channel| values[self.rest[channel * each + k]] as f32));
        }
        Gaussian {
            position,
            sigma: [s0, s1, s2].map(f64::exp),
            rotation: [w, x, y, z],
            opacity: logistic(opacity),
            base: [r, g, b],
            harmonics,
        }
    }
}

/// What the reader does with the next property of a record.
enum Step {
    Take { scalar: Scalar, index: usize },
    Skip(PropertyKind),
}

/// What the vertices of a file are.
enum Vertices {
    Points(Box<Columns>),
    /// Gaussians; the indices are those of their places.
    Gaussians([usize; 3], GaussianColumns),
}

fn read_vertices(
    body: &mut Body<'_>,
    element: &Element,
    header: &Header,
    by: Option<&ColourBy>,
    progress: &dyn Fn(f32),
) -> Result<PlyContent, ParseError> {
    const CHUNK: usize = 1 << 16;
    let mut cloud = Cloud::default();
    let mut finder = Finder::new(element);
    let vertices = match GaussianColumns::find(&mut finder) {
        Some(gaussians) => Vertices::Gaussians(finder.position()?, gaussians),
        None => Vertices::Points(Box::new(Columns::find(&mut finder, element, by, &mut cloud.notes)?)),
    };
    let mut gaussians = Gaussians::default();
    let count = body.count(element)?;
    match &vertices {
        Vertices::Gaussians(_, columns) => {
            gaussians = Gaussians::of_degree(columns.degree);
            cloud.notes.extend(columns.note.clone());
        }
        Vertices::Points(_) => {
            cloud.notes.extend(finder.ignored().map(|names| format!("vertex properties ignored: {names}")));
            cloud.columns = finder.numbers();
            cloud.position.reserve_exact(count);
        }
    }
    let steps = steps(&finder, element);
    let mut values = vec![0.0; finder.wanted()];
    for row in 0..count {
        if row % CHUNK == 0 {
            progress(row as f32 / count as f32);
        }
        for (step, property) in steps.iter().zip(&element.properties) {
            match *step {
                Step::Take { scalar, index } => {
                    let at = body.at;
                    body.scalar(scalar).and_then(|value| {
                        values[index] = value;
                        let expected = match &vertices {
                            Vertices::Points(columns) => columns.fault(index, value),
                            Vertices::Gaussians(..) => None,
                        };
                        expected.map_or(Ok(()), |expected| Err(body.fault(at, value.to_string(), expected)))
                    })
                }
                Step::Skip(kind) => body.skip(kind),
            }
            .map_err(|e| within(e, element, row, &property.name))?;
        }
        match &vertices {
            Vertices::Points(columns) => columns.push(&values, &mut cloud),
            Vertices::Gaussians(position, columns) => {
                gaussians.push(&columns.gaussian(position.map(|index| values[index]), &values));
            }
        }
    }
    let Vertices::Points(columns) = vertices else {
        return Ok(PlyContent::Capture(Gaussians { notes: cloud.notes, ..gaussians }));
    };
    let says = |comment: &str| header.comments.iter().any(|c| c == comment);
    (cloud.two_sided, cloud.signs_estimated) = (says(TWO_SIDED), says(SIGNS_ESTIMATED));
    cloud.velocity_unit = if says(PER_FRAME) { VelocityUnit::Frame } else { VelocityUnit::Second };
    ply_scales::scale(&mut cloud, &columns, says(LINEAR_COLOURS));
    if finder.position_type() == Scalar::F32 {
        let coarse = tidy::coarse(&tidy::box_of(&cloud.position), cloud.position.len());
        // The numbers of a text may be finer than they say.
        let narrow = |p: &DVec3| p.as_vec3().as_dvec3() == *p || !p.is_finite();
        cloud.notes.extend(coarse.filter(|_| cloud.position.iter().all(narrow)));
    }
    Ok(PlyContent::Cloud(cloud))
}

fn steps(finder: &Finder<'_>, element: &Element) -> Vec<Step> {
    let steps =
        element.properties.iter().zip(finder.indices()).map(|(property, index)| match (property.kind, *index) {
            (PropertyKind::Scalar(scalar), Some(index)) => Step::Take { scalar, index },
            (kind, _) => Step::Skip(kind),
        });
    steps.collect()
}

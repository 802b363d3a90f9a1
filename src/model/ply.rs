//! PLY files: point clouds, surfels, meshes, and Gaussian-splat captures.
//!
//! The header (`ply_header`) becomes a list of steps, one for each property. The body (`ply_body`) is then read in one
//! pass. The file is long because all columns of one table are read here. Names count in any letter case and order,
//! values in any type:
//!
//! | what | names |
//! |---|---|
//! | position | x y z |
//! | normal | nx ny nz, normal_x.. ; else from faces (vertex_indices, vertex_index; tristrips) |
//! | colour | red green blue, r g b, diffuse_red.. ; else grey: intensity, quality, grey, gray, scalar_* |
//! | cut-off radius | radius, psz, point_size, size, value, scale (a float) |
//! | axes | tux tuy tuz tvx tvy tvz |
//! | velocity, acceleration | vx vy vz, velocity_x.. ; ax ay az, acceleration_x.. |
//! | identity in a sequence | id, particle_id, point_id |
//! | material (ours) | ambient diffuse specular shininess |
//! | opacity | alpha, opacity (not beside f_dc_0 and scale_0) |
//! | sample of a volume | density; volume |
//! | Gaussian splat | f_dc_0.. opacity scale_0.. rot_0.. ; f_rest_0.. ; packed ones: `capture::compressed_ply` |

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::area_normals::{self, AreaNormals};
use super::capture::compressed_ply;
use super::capture::{Gaussian, Gaussians, MOST_HARMONICS, harmonics_of, logistic};
use super::cloud::{Cloud, ColourStorage};
use super::error::ParseError;
use super::mesh::polygon::fans;
use super::ply_body::{Body, within};
use super::ply_faces::{self, Triangles};
use super::ply_header::{self, Element, Encoding, Header, Kind, Scalar};
use super::surfels::{Material, VelocityUnit};
use super::tidy::MAX_COORDINATE;

/// Comment with which [`super::write_ply`] says that float colours are linear light and may exceed 1.
pub(super) const LINEAR_COLOURS: &str = "splatblur colours are linear light";
/// Comment of our own files whose normals have no sign.
pub(super) const TWO_SIDED: &str = "splatblur shows both sides";
/// Comment of our own files whose normals were estimated.
pub(super) const SIGNS_ESTIMATED: &str = "splatblur estimated the signs of the normals";

/// Comment of our own files with velocities per frame.
pub(super) const PER_FRAME: &str = "splatblur velocities are per frame";

/// Numbers of a PLY file are read as `f64`, which has all whole numbers up to this.
const MOST_ID: f64 = (1_u64 << 53) as f64;

/// Names of the material properties, in the order of [`Material`]'s fields.
pub(super) const MATERIAL: [&str; 4] = ["ambient", "diffuse", "specular", "shininess"];

/// What a PLY file holds.
pub(super) enum Content {
    /// Points, surfels, or the vertices of a mesh.
    Cloud(Cloud),
    /// Vertices, and the corners of triangles: at least one, all valid.
    Mesh(Cloud, Vec<[u32; 3]>),
    /// Gaussians.
    Capture(Gaussians),
}

impl Content {
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
///
/// # Errors
/// The error names the line or the byte. Something is outside the grammar, the body is cut short, vertices have no
/// positions, or face indices are bad. Where the faces of a text are at fault, its points are used, with a note.
pub(super) fn parse(bytes: &[u8], faces: bool, progress: &dyn Fn(f32)) -> Result<Content, ParseError> {
    let header = ply_header::parse(bytes)?;
    let mut body = Body::new(bytes, header.body, header.encoding);
    if compressed_ply::is_compressed(&header) {
        let mut content = Content::Capture(compressed_ply::parse(&header, &mut body, progress)?);
        content.note_surplus(&body);
        return Ok(content);
    }
    let mut content = None;
    let as_mesh = faces;
    let mut faces = Vec::new();
    let mut damage = None;
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => content = Some(read_vertices(&mut body, element, &header, progress)?),
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
        && let Content::Cloud(cloud) = &mut content
        && is_vertices(cloud)
        && damage.is_none()
    {
        match triangles(&mut body, &faces, &cloud.position) {
            Ok((corners, _)) if corners.is_empty() => {}
            Ok((corners, note)) => {
                cloud.notes.extend(note);
                return Ok(Content::Mesh(std::mem::take(cloud), corners));
            }
            Err(fault) => damage = Some(spare_points(fault, &header, Some(&content))?),
        }
    }
    if let Content::Cloud(cloud) = &mut content
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
fn spare_points(fault: ParseError, header: &Header, before: Option<&Content>) -> Result<String, ParseError> {
    if header.encoding == Encoding::Ascii && before.is_some_and(Content::has_points) {
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

/// Places of the columns of a cloud in a record: indices of the wanted numbers.
struct Columns {
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    colour: Option<[usize; 3]>,
    grey: Option<usize>,
    radius: Option<usize>,
    axes: Option<[usize; 6]>,
    velocity: Option<[usize; 3]>,
    acceleration: Option<[usize; 3]>,
    id: Option<usize>,
    material: [Option<usize>; 4],
    /// The number, and what stands for 1.
    opacity: Option<(usize, f64)>,
    density: Option<usize>,
    volume: Option<usize>,
    gaussian: Option<GaussianColumns>,
    colour_type: Scalar,
}

/// Places of the columns of a Gaussian-splat capture.
struct GaussianColumns {
    /// `f_dc` 0..2, opacity, scale 0..2, rot 0..3.
    own: [usize; 11],
    /// All harmonics above degree 0 of red, then of green, then of blue.
    rest: Vec<usize>,
    /// Their highest degree.
    degree: u8,
    /// What is left out of the file's harmonics.
    note: Option<String>,
}

impl GaussianColumns {
    /// The columns, if the file is a capture. `f_rest` columns count if they are exactly those of a degree from 1 to 4.
    /// Of degree 4 what lies beyond degree 3 is dropped.
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
    Skip(Kind),
}

fn read_vertices(
    body: &mut Body<'_>,
    element: &Element,
    header: &Header,
    progress: &dyn Fn(f32),
) -> Result<Content, ParseError> {
    const CHUNK: usize = 1 << 16;
    let mut cloud = Cloud::default();
    let mut finder = Finder::new(element);
    let columns = columns(&mut finder, element, &mut cloud.notes)?;
    let steps = finder.steps();
    let count = body.count(element)?;
    let mut values = vec![0.0; steps.len()];
    if columns.gaussian.is_none() {
        cloud.position.reserve_exact(count);
    }
    let mut gaussians = Gaussians::of_degree(columns.gaussian.as_ref().map_or(0, |columns| columns.degree));
    cloud.notes.extend(columns.gaussian.as_ref().and_then(|columns| columns.note.clone()));
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
                        columns
                            .fault(index, value)
                            .map_or(Ok(()), |expected| Err(body.fault(at, value.to_string(), expected)))
                    })
                }
                Step::Skip(kind) => body.skip(kind),
            }
            .map_err(|e| within(e, element, row, &property.name))?;
        }
        columns.push(&values, &mut cloud, &mut gaussians);
    }
    if columns.gaussian.is_some() {
        return Ok(Content::Capture(Gaussians { notes: cloud.notes, ..gaussians }));
    }
    let says = |comment: &str| header.comments.iter().any(|c| c == comment);
    (cloud.two_sided, cloud.signs_estimated) = (says(TWO_SIDED), says(SIGNS_ESTIMATED));
    cloud.velocity_unit = if says(PER_FRAME) { VelocityUnit::Frame } else { VelocityUnit::Second };
    if columns.colour.is_some() || columns.grey.is_some() {
        let declared_linear = says(LINEAR_COLOURS);
        scale_colours(&mut cloud, columns.colour_type, columns.grey.is_some(), declared_linear);
    }
    Ok(Content::Cloud(cloud))
}

impl Columns {
    /// What was expected in place of a number of a record that would put a point in a wrong place later on.
    fn fault(&self, index: usize, value: f64) -> Option<&'static str> {
        let is_of = |column: Option<[usize; 3]>| column.is_some_and(|column| column.contains(&index));
        if is_of(self.velocity) || is_of(self.acceleration) {
            let usable = value.abs() <= MAX_COORDINATE;
            return (!usable).then_some("a finite number up to 1e18");
        }
        let usable = self.id != Some(index) || value.fract() == 0.0 && value.abs() <= MOST_ID;
        (!usable).then_some("a whole number up to 2^53")
    }

    fn push(&self, values: &[f64], cloud: &mut Cloud, gaussians: &mut Gaussians) {
        let vector = |s: [usize; 3]| Vec3::new(values[s[0]] as f32, values[s[1]] as f32, values[s[2]] as f32);
        let position = self.position.map(|s| values[s]);
        if let Some(columns) = &self.gaussian {
            gaussians.push(&columns.gaussian(position, values));
            return;
        }
        cloud.position.push(DVec3::from_array(position));
        if let Some(n) = self.normal {
            // The vector is scaled in f64: an f32 overflow would lose the direction.
            let wide = DVec3::new(values[n[0]], values[n[1]], values[n[2]]);
            let largest = wide.abs().max_element();
            let near_one = (0.5..2.0).contains(&largest) || largest == 0.0;
            cloud.normal.push(if near_one { wide.as_vec3() } else { (wide / largest).as_vec3() });
        }
        if let Some(c) = self.colour {
            cloud.colour.push(vector(c));
        } else if let Some(g) = self.grey {
            cloud.colour.push(Vec3::splat(values[g] as f32));
        }
        if let Some(r) = self.radius {
            cloud.radius.push(values[r] as f32);
        }
        if let Some([a, b, c, d, e, f]) = self.axes {
            cloud.axes.push([vector([a, b, c]), vector([d, e, f])]);
        }
        if let Some(v) = self.velocity {
            cloud.velocity.push(vector(v));
        }
        cloud.acceleration.extend(self.acceleration.map(vector));
        cloud.id.extend(self.id.map(|id| values[id] as i64));
        if let Some((opacity, one)) = self.opacity {
            // The sign of a signed byte is an accident, as in colours.
            let value = values[opacity] / one;
            cloud.opacity.push(if one == 255.0 && value < 0.0 { value + 256.0 / 255.0 } else { value } as f32);
        }
        cloud.density.extend(self.density.map(|density| values[density] as f32));
        cloud.volume.extend(self.volume.map(|volume| values[volume] as f32));
        if self.material.iter().any(Option::is_some) {
            let d = Material::default();
            let value = |i: usize, default: f32| {
                let found = self.material[i].map(|index| values[index] as f32);
                found.filter(|x| x.is_finite() && *x >= 0.0).unwrap_or(default)
            };
            cloud.material.push(Material {
                ambient: value(0, d.ambient),
                diffuse: value(1, d.diffuse),
                specular: value(2, d.specular),
                shininess: value(3, d.shininess),
            });
        }
    }
}

/// Chooses the properties to use, and names the unused ones in the notes.
fn columns(finder: &mut Finder<'_>, element: &Element, notes: &mut Vec<String>) -> Result<Columns, ParseError> {
    let Some(position) = finder.take(["x", "y", "z"]) else {
        let found = "an element `vertex` without x, y and z";
        return Err(ParseError::line(element.line, found, "numbers x, y and z"));
    };
    let gaussian = GaussianColumns::find(finder);
    if gaussian.is_some() {
        return Ok(Columns {
            position,
            normal: None,
            colour: None,
            grey: None,
            radius: None,
            axes: None,
            velocity: None,
            acceleration: None,
            id: None,
            material: [None; 4],
            opacity: None,
            density: None,
            volume: None,
            gaussian,
            colour_type: Scalar::F32,
        });
    }
    let normal = finder.take_first(&[["nx", "ny", "nz"], ["normal_x", "normal_y", "normal_z"]]);
    let colour_names = [["red", "green", "blue"], ["r", "g", "b"], ["diffuse_red", "diffuse_green", "diffuse_blue"]];
    let colour = finder.take_first(&colour_names);
    let mut colour_type = colour.map_or(Scalar::U8, |c| finder.scalar(c[0]));
    if let Some(other) = colour.and_then(|c| c.into_iter().map(|s| finder.scalar(s)).find(|s| *s != colour_type)) {
        let found = format!("colour channels of types {} and {}", colour_type.name(), other.name());
        return Err(ParseError::line(element.line, found, "one type"));
    }
    let axes = finder.take(["tux", "tuy", "tuz", "tvx", "tvy", "tvz"]);
    let mut radius = finder.take_first(&[["radius"], ["psz"], ["point_size"], ["size"], ["value"]]);
    if radius.is_none() && !finder.by_name.contains_key("scale_0") {
        radius = finder.take(["scale"]).filter(|s| finder.scalar(s[0]).is_float());
    }
    let velocity = finder.take_first(&[["vx", "vy", "vz"], ["velocity_x", "velocity_y", "velocity_z"]]);
    let acceleration = [["ax", "ay", "az"], ["acceleration_x", "acceleration_y", "acceleration_z"]];
    let acceleration = finder.take_first(&acceleration);
    let id = finder.take_first(&[["id"], ["particle_id"], ["point_id"]]).map(|s| s[0]);
    let material = MATERIAL.map(|name| finder.take([name]).map(|s| s[0]));
    // What stands beside the columns of a capture is the logit of one, even where others of them are missing.
    let logit = finder.has("f_dc_0") && finder.has("scale_0");
    let opacity = finder.take(["alpha"]).or_else(|| if logit { None } else { finder.take(["opacity"]) });
    let opacity = opacity.map(|[index]| (index, finder.scalar(index).largest_of_whole()));
    let density = finder.take(["density"]).map(|s| s[0]);
    let volume = density.and_then(|_| finder.take(["volume"])).map(|s| s[0]);
    let mut grey = None;
    if colour.is_none() {
        let scalars = element.properties.iter().map(|p| p.name.as_str()).filter(|n| n.starts_with("scalar_"));
        let name = ["intensity", "quality", "grey", "gray"].into_iter().chain(scalars).find(|n| finder.has(n));
        if let Some(name) = name {
            grey = finder.take([name]).map(|s| s[0]);
            colour_type = grey.map_or(colour_type, |s| finder.scalar(s));
            notes.push(format!("no colours: `{name}` is shown as grey"));
        }
    }
    finder.note_ignored(notes);
    Ok(Columns {
        position,
        normal,
        colour,
        grey,
        radius: radius.map(|s| s[0]),
        axes,
        velocity,
        acceleration,
        id,
        material,
        opacity,
        density,
        volume,
        gaussian,
        colour_type,
    })
}

/// Brings colours to 0..=1. 8-bit and other whole numbers are divided by 255 (by 65535 if that is not enough), 16-bit
/// ones by 65535. Floats are in 0..=1, or in 0..=255 where one exceeds 1 by more than rounding.
fn scale_colours(cloud: &mut Cloud, scalar: Scalar, grey: bool, declared_linear: bool) {
    let largest = cloud.colour.iter().filter(|c| c.is_finite()).fold(0.0_f32, |m, c| m.max(c.max_element()));
    let divisor = match scalar {
        _ if declared_linear && scalar.is_float() => 1.0,
        Scalar::I8 | Scalar::U8 => 255.0,
        Scalar::U16 => 65535.0,
        Scalar::F32 | Scalar::F64 if largest <= 1.001 => 1.0,
        _ if largest <= 255.0 => 255.0,
        _ if grey => f64::from(largest),
        _ if scalar.is_float() => 255.0,
        _ => 65535.0,
    };
    if scalar.is_float() && divisor == 1.0 {
        cloud.colour_storage = ColourStorage::Float;
    } else if scalar.is_float() {
        cloud.notes.push(format!("float colours up to {largest}: divided by {divisor}, taken as sRGB"));
    }
    let scale = |x: f32| {
        // The sign of a signed byte is an accident: it is meant as an unsigned one.
        let x = if scalar == Scalar::I8 && x < 0.0 { x + 256.0 } else { x };
        (f64::from(x) / divisor) as f32
    };
    cloud.colour.iter_mut().for_each(|c| *c = Vec3::new(scale(c.x), scale(c.y), scale(c.z)));
}

/// Gives each wanted property an index in the record that is read.
struct Finder<'a> {
    element: &'a Element,
    /// Properties that are plain numbers, by name.
    by_name: HashMap<&'a str, (usize, Scalar)>,
    /// Index of each property of the element, if it is wanted.
    indices: Vec<Option<usize>>,
    /// Type of the number at each index.
    types: Vec<Scalar>,
}

impl<'a> Finder<'a> {
    fn new(element: &'a Element) -> Self {
        let plain = element.properties.iter().enumerate().filter_map(|(i, p)| match p.kind {
            Kind::Scalar(scalar) => Some((p.name.as_str(), (i, scalar))),
            Kind::List { .. } => None,
        });
        Self { element, by_name: plain.collect(), indices: vec![None; element.properties.len()], types: Vec::new() }
    }

    fn has(&self, name: &str) -> bool {
        self.by_name.contains_key(name)
    }

    /// Indices of all the names, or `None` if one is missing.
    fn take<const N: usize>(&mut self, names: [&str; N]) -> Option<[usize; N]> {
        let mut found = [(0, Scalar::F32); N];
        for (place, name) in found.iter_mut().zip(names) {
            *place = *self.by_name.get(name)?;
        }
        Some(found.map(|(property, scalar)| {
            let index = self.types.len();
            self.types.push(scalar);
            self.indices[property] = Some(index);
            index
        }))
    }

    /// The indices of the first of several namings that is complete.
    fn take_first<const N: usize>(&mut self, namings: &[[&str; N]]) -> Option<[usize; N]> {
        namings.iter().find_map(|names| self.take(*names))
    }

    fn scalar(&self, index: usize) -> Scalar {
        self.types[index]
    }

    fn steps(&self) -> Vec<Step> {
        let steps =
            self.element.properties.iter().zip(&self.indices).map(|(property, index)| match (property.kind, *index) {
                (Kind::Scalar(scalar), Some(index)) => Step::Take { scalar, index },
                (kind, _) => Step::Skip(kind),
            });
        steps.collect()
    }

    fn note_ignored(&self, notes: &mut Vec<String>) {
        const SHOWN: usize = 12;
        let unused = self.element.properties.iter().zip(&self.indices).filter(|(_, index)| index.is_none());
        // Confidence has no meaning for surfels, but many files have it.
        let names: Vec<&str> = unused.map(|(p, _)| p.name.as_str()).filter(|n| *n != "confidence").collect();
        if !names.is_empty() {
            let more = names.len().saturating_sub(SHOWN);
            let shown: Vec<String> =
                names.iter().take(SHOWN).map(|n| n.chars().take(40).flat_map(char::escape_debug).collect()).collect();
            let tail = if more > 0 { format!(" and {more} more") } else { String::new() };
            notes.push(format!("vertex properties ignored: {}{tail}", shown.join(", ")));
        }
    }
}

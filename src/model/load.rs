//! Reading a model file of any format.

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;

use super::bin_stream::Fault;
use super::capture::{self, Gaussians};
use super::cloud::{Cloud, ColourStorage};
#[cfg(not(feature = "formats"))]
use super::colour_by::ColourBy;
use super::complete::complete;
use super::error::{ModelError, ParseError};
use super::format::ModelFormat;
use super::mesh::{self, Fineness, Mesh, Sampled, Unsampled};
#[cfg(feature = "formats")]
use super::npz::parse as parse_npz;
use super::options::{ColourSpace, Kind, LoadOptions, LoadProgress, MeshOptions, PointOptions, Spacing};
use super::surfels::{KeptLevels, Normalisation, Surfels};
use super::volume::{self, Grid, Made, Samples, VolumeFacts};
use super::{arrays, bin, colour_by, inward, obj, ply, scan, several, sfl, spheres, tidy, xyz};
use crate::files;
use crate::math::srgb;

/// Kernels of a volume that every file may become, however small it is.
const FREE_KERNELS: u64 = 1 << 23;

/// Most kernels above [`FREE_KERNELS`] for each byte of a file. A raw grid has one at most, a packed one a few.
const MOST_KERNELS_A_BYTE: u64 = 8;

/// A model, and what a user should know about how it was read.
#[derive(Clone, Debug)]
pub struct LoadedModel {
    /// What it is made of.
    pub shape: LoadedShape,
    /// One line each for points that were dropped, normals and radii that were estimated, and conventions that were
    /// assumed.
    pub notes: Vec<String>,
    /// The values that have the first and the last colour, where points are coloured by a column of numbers.
    pub colour_range: Option<[f64; 2]>,
}

/// What a model is made of, in file order: exactly one of these.
#[derive(Clone, Debug)]
pub enum LoadedShape {
    /// Surfels, and the mesh that they are samples of; `None` for those of all other files.
    Surfels(Surfels, Option<MeshSource>),
    /// The Gaussians of a capture.
    Capture(Gaussians),
    /// The kernels of a volume, and what its file held.
    Volume(Gaussians, VolumeFacts),
}

impl LoadedModel {
    /// The mesh that its surfels are samples of; `None` for all other models.
    pub fn mesh(&self) -> Option<&MeshSource> {
        if let LoadedShape::Surfels(_, mesh) = &self.shape { mesh.as_ref() } else { None }
    }
}

/// A mesh, and how it was sampled.
#[derive(Clone, Debug)]
pub struct MeshSource {
    mesh: Arc<Mesh>,
    options: MeshOptions,
    radius_scale: f64,
    spacing: f64,
}

impl MeshSource {
    /// Distance of the sampling rays, model units.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Number of triangles in the file.
    pub fn triangles(&self) -> usize {
        self.mesh.triangles.len()
    }

    /// The triangles.
    pub(crate) fn into_mesh(self) -> Arc<Mesh> {
        self.mesh
    }

    /// True if the same mesh was sampled in this way, from whatever file it came.
    pub(crate) fn is_of(&self, mesh: &Mesh, options: &LoadOptions) -> bool {
        self.options == options.mesh && self.radius_scale == options.radius_scale && self.mesh.looks_like(mesh)
    }

    /// The mesh sampled again: as finely as its parts need, but within a range of numbers of surfels. Without a
    /// camera that sees it, as before. `None` if it cannot be sampled.
    pub(crate) fn resampled(&self, fineness: &Fineness, surfels: [f64; 2]) -> Option<LoadedModel> {
        let Self { mesh, options, radius_scale, spacing } = self;
        if fineness.is_empty() {
            let options = MeshOptions { spacing: Spacing::Of(*spacing), ..*options };
            return sampled(Arc::clone(mesh), options, *radius_scale).ok();
        }
        let sampled = mesh::sample_as(mesh, fineness, surfels, options.reduce, *radius_scale)?;
        let options = MeshOptions { spacing: Spacing::Of(sampled.spacing), ..*options };
        Some(of_samples(Arc::clone(mesh), sampled, options, *radius_scale))
    }
}

/// The result of [`parse`].
#[derive(Clone, Debug)]
pub enum Parsed {
    /// Points as the file gives them.
    Cloud(Cloud),
    /// Complete surfels, from our own format.
    Surfels(Surfels),
    /// The grid of a volume.
    Grid(Grid),
}

/// Reads the bytes of a model file. Points that cannot be drawn are dropped. Nothing is estimated yet.
///
/// Memory stays within a small multiple of the file's size, whatever the file says.
///
/// # Errors
/// The bytes are not a valid file of this format.
pub fn parse(bytes: &[u8], format: ModelFormat) -> Result<Parsed, ParseError> {
    Ok(tidied(read(bytes, format, false, &PointOptions::default(), &|_| {})?))
}

/// Reads the mesh of a file with faces, or `None` if it has none.
///
/// # Errors
/// The bytes are not a valid file of this format.
pub fn parse_mesh(bytes: &[u8], format: ModelFormat) -> Result<Option<Mesh>, ParseError> {
    Ok(match read(bytes, format, true, &PointOptions::default(), &|_| {})? {
        ModelContent::Mesh(cloud, triangles) => Some(mesh::of_cloud(cloud, triangles, None)),
        ModelContent::Capture(_) | ModelContent::Cloud(_) | ModelContent::Surfels(_) | ModelContent::Grid(_) => None,
    })
}

/// Reads the Gaussians of a capture as the file gives them, or `None` if the file holds none.
///
/// # Errors
/// The bytes are not a valid file of this format.
pub fn parse_capture(bytes: &[u8], format: ModelFormat) -> Result<Option<Gaussians>, ParseError> {
    Ok(match read(bytes, format, false, &PointOptions::default(), &|_| {})? {
        ModelContent::Capture(gaussians) => Some(gaussians),
        ModelContent::Cloud(_) | ModelContent::Mesh(..) | ModelContent::Surfels(_) | ModelContent::Grid(_) => None,
    })
}

/// Reads a model file of any format and completes it. The content shows the format; if it does not, the extension does.
///
/// # Errors
/// The file cannot be read, is not a regular file, or is not a valid model of a known format with at least one point.
pub fn load(path: &Path, options: &LoadOptions, progress: LoadProgress<'_>) -> Result<LoadedModel, ModelError> {
    match open(path, options, progress)? {
        ReadFile::Ready(loaded) => Ok(*loaded),
        ReadFile::Mesh(mesh) => sample_mesh(mesh, options, path, progress),
    }
}

/// A model file that was read.
pub(crate) enum ReadFile {
    /// With all that was to be made of it.
    Ready(Box<LoadedModel>),
    /// To be sampled.
    Mesh(Mesh),
}

/// As [`load`], but a mesh is not sampled yet.
pub(crate) fn open(path: &Path, options: &LoadOptions, progress: LoadProgress<'_>) -> Result<ReadFile, ModelError> {
    let ready = |loaded| ReadFile::Ready(Box::new(loaded));
    let (content, size) = match files::steady(|| contents(path, options, progress))? {
        Contents::Mesh(mesh) if options.mesh.spacing != Spacing::None && options.kind != Some(Kind::Spheres) => {
            return Ok(ReadFile::Mesh(mesh));
        }
        Contents::Mesh(mesh) => return vertices(mesh, options, path, progress).map(ready),
        Contents::Other(content, size) => (*content, size),
    };
    let owned = || path.to_owned();
    let parsed = match (content, options.kind) {
        (ModelContent::Capture(gaussians), None | Some(Kind::Gaussians)) => {
            return capture(gaussians, options, path).map(ready);
        }
        (_, Some(Kind::Gaussians)) => return Err(ModelError::NoGaussians { path: owned() }),
        (ModelContent::Grid(_), Some(Kind::Surfels | Kind::Spheres)) => {
            return Err(ModelError::NoSurfels { path: owned() });
        }
        (ModelContent::Grid(grid), None | Some(Kind::Volume)) => {
            let made = volume::of_grid(&grid, &options.volume, options.radius_scale, most_kernels(size), progress);
            return of_volume(made, path).map(ready);
        }
        (ModelContent::Cloud(_), Some(Kind::Volume)) if options.points.colour_by.is_some() => {
            let why = ParseError::byte(0, "points as a volume", "surfels or spheres, as `colourBy` is given");
            return Err(ModelError::Invalid { path: owned(), why });
        }
        // Points that are coloured by a column are no medium.
        (ModelContent::Cloud(cloud), kind)
            if kind == Some(Kind::Volume)
                || kind.is_none() && is_volume(&cloud) && options.points.colour_by.is_none() =>
        {
            let linear = options.colour_space.map(|space| space == ColourSpace::Linear);
            let moves = !(cloud.velocity.is_empty() && cloud.acceleration.is_empty());
            let samples = Samples::from_cloud(tidy::tidy(cloud), linear);
            let samples = samples.ok_or_else(|| ModelError::NoVolume { path: owned() })?;
            let made =
                volume::of_samples(&samples, &options.volume, options.radius_scale, most_kernels(size), progress);
            let mut loaded = of_volume(made, path)?;
            if moves {
                loaded.notes.push("velocities ignored: they move surfels, not volumes".to_owned());
            }
            return Ok(ready(loaded));
        }
        (_, Some(Kind::Volume)) => return Err(ModelError::NoVolume { path: owned() }),
        (ModelContent::Mesh(cloud, triangles), _) => {
            return Ok(ReadFile::Mesh(mesh::of_cloud(cloud, triangles, options.colour_space)));
        }
        (content, _) => tidied(content),
    };
    match parsed {
        Parsed::Grid(_) => Err(ModelError::NoSurfels { path: owned() }),
        Parsed::Surfels(surfels) if surfels.is_empty() => {
            Err(ModelError::NoPointsIn { path: path.to_owned(), dropped: String::new() })
        }
        Parsed::Surfels(surfels) if surfels.spheres && options.kind == Some(Kind::Surfels) => {
            Err(ModelError::AreSpheres { path: owned() })
        }
        Parsed::Surfels(surfels) => {
            let mut surfels = adjust(surfels, options);
            let (colour_range, note) = recolour(&mut surfels, options, path)?.unzip();
            let shape = LoadedShape::Surfels(surfels, None);
            Ok(ready(LoadedModel { shape, notes: note.into_iter().collect(), colour_range }))
        }
        Parsed::Cloud(cloud) => completed(cloud, options, path, progress).map(ready),
    }
}

/// What the bytes of a file say, and of the files that it names.
enum Contents {
    /// With its materials.
    Mesh(Mesh),
    /// And the size of the file, bytes.
    Other(Box<ModelContent>, u64),
}

/// Reads the bytes of a model file, and those of the files that it names, and nothing more: what comes after need not
/// be done again where a file has changed meanwhile.
fn contents(path: &Path, options: &LoadOptions, progress: LoadProgress<'_>) -> Result<Contents, ModelError> {
    let Some(files) = several::matching(path)? else { return contents_of(path, options, progress) };
    let mut size = 0;
    let mut clouds = Vec::with_capacity(files.len());
    for (number, file) in files.iter().enumerate() {
        let part = |what: &str, share: f32| progress(what, (number as f32 + share) / files.len() as f32);
        let Contents::Other(content, bytes) = contents_of(file, options, &part)? else {
            return Err(ModelError::NoCloud { path: file.clone() });
        };
        let ModelContent::Cloud(cloud) = *content else { return Err(ModelError::NoCloud { path: file.clone() }) };
        clouds.push(cloud);
        size += bytes;
    }
    let mut all = several::joined(clouds);
    all.notes.insert(0, format!("{} files", files.len()));
    Ok(Contents::Other(Box::new(ModelContent::Cloud(all)), size))
}

/// As [`contents`], of one file.
fn contents_of(path: &Path, options: &LoadOptions, progress: LoadProgress<'_>) -> Result<Contents, ModelError> {
    let invalid = |why| ModelError::Invalid { path: path.to_owned(), why };
    let of_input = |why| ModelError::of_input(path, why);
    refuse_by_name(path)?;
    let mut input = files::open(path).map_err(of_input)?;
    let size = input.size();
    if size == 0 {
        return Err(ModelError::EmptyFile { path: path.to_owned() });
    }
    let no_nodes = || invalid(ParseError::byte(0, "a file without nodes", "glTF, as a `node` is named"));
    // Our own format goes straight into its columns: the bytes beside them would double what it takes.
    if bin::is_at(&mut input).map_err(|why| of_input(why.into()))? {
        if options.node.is_some() {
            return Err(no_nodes());
        }
        // They have columns to colour them by, and nothing else to choose.
        scan::refuse(&PointOptions { colour_by: None, ..options.points.clone() }).map_err(invalid)?;
        let surfels = bin::read(input, size).map_err(|why| match why {
            Fault::Format(why) => invalid(why),
            Fault::Io(why) => of_input(why.into()),
        })?;
        return Ok(Contents::Other(Box::new(ModelContent::Surfels(surfels)), size));
    }
    let bytes = input.whole(u64::MAX).map_err(of_input)?;
    let format =
        ModelFormat::detect(&bytes, path).ok_or_else(|| ModelError::UnknownFormat { path: path.to_owned() })?;
    if options.node.is_some() && !matches!(format, ModelFormat::Glb | ModelFormat::Gltf) {
        return Err(no_nodes());
    }
    let sampled = options.mesh.spacing != Spacing::None;
    if matches!(options.kind, None | Some(Kind::Surfels | Kind::Spheres))
        && (sampled || format != ModelFormat::Obj)
        && let Some(mesh) = mesh::read(&bytes, format, path, options.node.as_deref()).map_err(invalid)?
    {
        let mut points = options.points.clone();
        // Vertices that are drawn as spheres may have a radius.
        if options.kind == Some(Kind::Spheres) {
            points.radius = None;
        }
        scan::refuse(&points).map_err(invalid)?;
        return Ok(Contents::Mesh(mesh));
    }
    let told = |share| progress("reading", share);
    let content = read(&bytes, format, sampled, &options.points, &told).map_err(invalid)?;
    Ok(Contents::Other(Box::new(content), size))
}

/// The surfels of points, with what they lack.
fn completed(
    mut cloud: Cloud,
    options: &LoadOptions,
    path: &Path,
    progress: LoadProgress<'_>,
) -> Result<LoadedModel, ModelError> {
    let mut notes = std::mem::take(&mut cloud.notes);
    if !cloud.density.is_empty() && options.points.colour_by.is_none() {
        notes.push("`density` ignored: it is for the kind `volume`".to_owned());
    }
    let invalid = |why| ModelError::Invalid { path: path.to_owned(), why };
    let mut options = options.clone();
    if let Some(by) = &mut options.points.colour_by {
        colour_by::derive(&mut cloud, by);
        if cloud.value.is_empty() && !cloud.position.is_empty() {
            return Err(invalid(colour_by::missing(by, &cloud.columns)));
        }
        by.range = by.range.or(colour_by::range(&cloud.value));
        notes.extend(by.range.map(|range| by.note(range)));
    }
    let colour_range = options.points.colour_by.as_ref().and_then(|by| by.range);
    let (surfels, completed) = complete(cloud, &options, progress).map_err(|error| match error {
        ModelError::NoPoints => {
            let dropped = if notes.is_empty() { String::new() } else { format!(": {}", notes.join("; ")) };
            ModelError::NoPointsIn { path: path.to_owned(), dropped }
        }
        other => other,
    })?;
    notes.extend(completed);
    notes.extend(inward::note(&surfels));
    Ok(LoadedModel { shape: LoadedShape::Surfels(surfels, None), notes, colour_range })
}

/// Colours surfels that are complete by one of their columns; the range of its values, and a note.
fn recolour(
    surfels: &mut Surfels,
    options: &LoadOptions,
    path: &Path,
) -> Result<Option<([f64; 2], String)>, ModelError> {
    let Some(by) = &options.points.colour_by else { return Ok(None) };
    let values =
        colour_by::of_surfels(surfels, by).map_err(|why| ModelError::Invalid { path: path.to_owned(), why })?;
    let Some(range) = by.range.or(colour_by::range(&values)) else { return Ok(None) };
    surfels.colour = by.colours(&values, range);
    surfels.levels = KeptLevels::default();
    Ok(Some((range, by.note(range))))
}

/// The least and the greatest value of the column that colours the points of a file; `None` where it has no point with
/// one, or where nothing colours them.
///
/// # Errors
/// The file cannot be read, is not a valid cloud of points, or lacks the column.
pub(crate) fn value_range(path: &Path, options: &LoadOptions) -> Result<Option<[f64; 2]>, ModelError> {
    let Some(by) = &options.points.colour_by else { return Ok(None) };
    let invalid = |why| ModelError::Invalid { path: path.to_owned(), why };
    let Contents::Other(content, _) = files::steady(|| contents(path, options, &|_, _| {}))? else {
        return Err(ModelError::NoCloud { path: path.to_owned() });
    };
    match tidied(*content) {
        Parsed::Cloud(cloud) if cloud.value.is_empty() && !cloud.position.is_empty() => {
            Err(invalid(colour_by::missing(by, &cloud.columns)))
        }
        Parsed::Cloud(cloud) => Ok(colour_by::range(&cloud.value)),
        Parsed::Surfels(surfels) => {
            colour_by::of_surfels(&surfels, by).map(|values| colour_by::range(&values)).map_err(invalid)
        }
        Parsed::Grid(_) => Err(ModelError::NoSurfels { path: path.to_owned() }),
    }
}

/// The vertices of a mesh as points.
fn vertices(
    mesh: Mesh,
    options: &LoadOptions,
    path: &Path,
    progress: LoadProgress<'_>,
) -> Result<LoadedModel, ModelError> {
    let cloud = Cloud {
        position: mesh.position,
        normal: mesh.normal,
        colour: mesh.colour.iter().map(|colour| colour.truncate()).collect(),
        colour_storage: ColourStorage::Float,
        notes: mesh.notes,
        ..Cloud::default()
    };
    completed(tidy::tidy(cloud), options, path, progress)
}

/// Samples a mesh to surfels (Pfister et al. 2000, section 5). `path` stands for its file in messages.
///
/// # Errors
/// No triangle has an area, the spacing is too small, or all is cut out.
pub fn sample_mesh(
    mesh: impl Into<Arc<Mesh>>,
    options: &LoadOptions,
    path: &Path,
    progress: LoadProgress<'_>,
) -> Result<LoadedModel, ModelError> {
    progress("sampling", 0.0);
    let loaded = sampled(mesh.into(), options.mesh, options.radius_scale).map_err(|why| match why {
        Unsampled::Flat { triangles } => ModelError::FlatMesh { path: path.to_owned(), triangles },
        Unsampled::Fine { spacing, least } => ModelError::FineSpacing { path: path.to_owned(), spacing, least },
    })?;
    progress("sampling", 1.0);
    if matches!(&loaded.shape, LoadedShape::Surfels(surfels, _) if surfels.is_empty()) {
        let dropped = format!(": {}", loaded.notes.join("; "));
        return Err(ModelError::NoPointsIn { path: path.to_owned(), dropped });
    }
    Ok(loaded)
}

fn sampled(mesh: Arc<Mesh>, options: MeshOptions, radius_scale: f64) -> Result<LoadedModel, Unsampled> {
    let sampled = mesh::sample(&mesh, &options, radius_scale)?;
    Ok(of_samples(mesh, sampled, options, radius_scale))
}

fn of_samples(mesh: Arc<Mesh>, sampled: Sampled, options: MeshOptions, radius_scale: f64) -> LoadedModel {
    let Sampled { surfels, spacing, notes: of_sampling } = sampled;
    let mut notes = mesh.notes.clone();
    notes.extend(of_sampling);
    notes.extend(inward::note(&surfels));
    let mesh = MeshSource { mesh, options, radius_scale, spacing };
    LoadedModel { shape: LoadedShape::Surfels(surfels, Some(mesh)), notes, colour_range: None }
}

/// Refuses an archive of arrays: what unpacks it is not part of this program.
#[cfg(not(feature = "formats"))]
fn parse_npz(_: &[u8], _: Option<&ColourBy>, _: &dyn Fn(f32)) -> Result<Cloud, ParseError> {
    Err(capture::needs_formats("an .npz archive"))
}

/// Most kernels of a volume whose file has `size` bytes: a small file that packs more is an attempt to fill memory.
fn most_kernels(size: u64) -> u64 {
    FREE_KERNELS.saturating_add(MOST_KERNELS_A_BYTE.saturating_mul(size))
}

/// True for points that are samples of a volume by themselves: they have densities and radii, and no surface.
fn is_volume(cloud: &Cloud) -> bool {
    !cloud.density.is_empty() && !cloud.radius.is_empty() && cloud.normal.is_empty() && cloud.axes.is_empty()
}

/// The kernels of a volume, of which there is one at least.
fn of_volume(made: Result<Made, ParseError>, path: &Path) -> Result<LoadedModel, ModelError> {
    let Made { gaussians, facts, notes } = made.map_err(|why| ModelError::Invalid { path: path.to_owned(), why })?;
    if gaussians.is_empty() {
        let mut why = notes;
        why.push("no sample has an extinction above 0".to_owned());
        return Err(ModelError::NoPointsIn { path: path.to_owned(), dropped: format!(": {}", why.join("; ")) });
    }
    Ok(LoadedModel { shape: LoadedShape::Volume(gaussians, facts), notes, colour_range: None })
}

/// Refuses captures of programs that keep the meaning of their bytes to themselves, or spread them over many files.
fn refuse_by_name(path: &Path) -> Result<(), ModelError> {
    let refused = |found: &str| {
        let why = ParseError::byte(0, found, "the PLY, SPZ or SOG that it was made from");
        Err(ModelError::Invalid { path: path.to_owned(), why })
    };
    let name = path.file_name().unwrap_or_default().to_ascii_lowercase();
    match name.to_str() {
        Some("lod-meta.json") => refused("a streamed SOG (lod-meta.json)"),
        Some(name) if name.ends_with(".ksplat") => refused("a .ksplat capture"),
        _ => Ok(()),
    }
}

/// Points that are drawn as surfels, without those that cannot be drawn.
fn tidied(content: ModelContent) -> Parsed {
    match content {
        // A mesh that is not sampled was read as its vertices.
        ModelContent::Cloud(cloud) | ModelContent::Mesh(cloud, _) => Parsed::Cloud(tidy::tidy(cloud)),
        ModelContent::Capture(gaussians) => Parsed::Cloud(tidy::tidy(gaussians.into_cloud())),
        ModelContent::Surfels(surfels) => Parsed::Surfels(surfels),
        ModelContent::Grid(grid) => Parsed::Grid(grid),
    }
}

/// A capture that stays one.
fn capture(mut gaussians: Gaussians, options: &LoadOptions, path: &Path) -> Result<LoadedModel, ModelError> {
    let mut notes = std::mem::take(&mut gaussians.notes);
    if gaussians.dropped > 0 {
        notes.push(format!(
            "Gaussian splats: {} of {} dropped, with a bad scale, rotation or opacity or another number that is none",
            gaussians.dropped,
            gaussians.dropped + gaussians.len()
        ));
    }
    if gaussians.is_empty() {
        let dropped = if notes.is_empty() { String::new() } else { format!(": {}", notes.join("; ")) };
        return Err(ModelError::NoPointsIn { path: path.to_owned(), dropped });
    }
    if options.radius_scale != 1.0 {
        gaussians.sigma.iter_mut().for_each(|sigma| *sigma *= options.radius_scale as f32);
    }
    if let Some(space) = options.colour_space {
        gaussians.linear = space == ColourSpace::Linear;
    }
    Ok(LoadedModel { shape: LoadedShape::Capture(gaussians), notes, colour_range: None })
}

/// What the readers give.
enum ModelContent {
    Cloud(Cloud),
    /// Vertices, and the corners of triangles.
    Mesh(Cloud, Vec<[u32; 3]>),
    Capture(Gaussians),
    Surfels(Surfels),
    Grid(Grid),
}

/// `faces`: files with faces are meshes.
fn read(
    bytes: &[u8],
    format: ModelFormat,
    faces: bool,
    points: &PointOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<ModelContent, ParseError> {
    let by = points.colour_by.as_ref();
    let mut content = match format {
        ModelFormat::Ply => match ply::parse(bytes, faces, by, progress)? {
            ply::PlyContent::Cloud(cloud) => ModelContent::Cloud(cloud),
            ply::PlyContent::Mesh(cloud, triangles) => ModelContent::Mesh(cloud, triangles),
            ply::PlyContent::Capture(gaussians) => ModelContent::Capture(gaussians),
        },
        ModelFormat::Sfl => ModelContent::Cloud(sfl::parse(bytes, progress)?),
        ModelFormat::Obj => ModelContent::Cloud(obj::parse(bytes, progress)?),
        ModelFormat::Xyz => ModelContent::Cloud(xyz::parse(bytes, xyz::TextKind::Xyz, by, progress)?),
        ModelFormat::Pts => ModelContent::Cloud(xyz::parse(bytes, xyz::TextKind::Pts, by, progress)?),
        ModelFormat::Splat => ModelContent::Capture(capture::parse_splat(bytes, progress)?),
        ModelFormat::Sog => ModelContent::Capture(capture::parse_sog(bytes, progress)?),
        ModelFormat::Spz => ModelContent::Capture(capture::parse_spz(bytes)?),
        ModelFormat::Glb => ModelContent::Capture(capture::parse_glb(bytes)?),
        // Its triangles are read by `mesh::read`.
        ModelFormat::Gltf => return Err(ParseError::byte(0, "a glTF text without triangles", "triangles")),
        ModelFormat::Bin => ModelContent::Surfels(bin::parse(bytes)?),
        ModelFormat::Nrrd => ModelContent::Grid(volume::parse_nrrd(bytes, progress)?),
        ModelFormat::Npy => ModelContent::Cloud(arrays::parse_npy(bytes, by, progress)?),
        ModelFormat::Npz => ModelContent::Cloud(parse_npz(bytes, by, progress)?),
        ModelFormat::Las => ModelContent::Cloud(scan::parse_las(bytes, points, progress)?),
        ModelFormat::E57 => ModelContent::Cloud(scan::parse_e57(bytes, points, progress)?),
    };
    let is_scan = matches!(format, ModelFormat::Las | ModelFormat::E57);
    match &mut content {
        ModelContent::Cloud(cloud) => {
            if !is_scan {
                scan::choose(cloud, points)?;
            }
            scan::stand(cloud, points);
            if let Some(by) = by {
                colour_by::derive(cloud, by);
            }
        }
        _ => scan::refuse(points)?,
    }
    Ok(content)
}

/// Applies what a scene says to surfels that are already complete. Their colours are linear unless the scene names
/// another space.
fn adjust(mut surfels: Surfels, options: &LoadOptions) -> Surfels {
    if options.radius_scale != 1.0 {
        let scale = options.radius_scale as f32;
        surfels.axis_u.iter_mut().chain(&mut surfels.axis_v).for_each(|axis| *axis *= scale);
        // Larger discs overlap more.
        surfels.normalisation = Normalisation::default();
        surfels.levels = KeptLevels::default();
    }
    if options.kind == Some(Kind::Spheres) && !surfels.spheres {
        for i in 0..surfels.len() {
            [surfels.axis_u[i], surfels.axis_v[i]] = spheres::axes(surfels.radius(i));
        }
        surfels.normal.fill(Vec3::Z);
        (surfels.spheres, surfels.two_sided, surfels.signs_estimated) = (true, true, false);
        (surfels.normalisation, surfels.levels) = (Normalisation::default(), KeptLevels::default());
    }
    if options.colour_space == Some(ColourSpace::Srgb) {
        surfels.levels = KeptLevels::default();
        for c in &mut surfels.colour {
            *c = Vec3::from_array(c.to_array().map(srgb::to_linear));
        }
    }
    surfels
}

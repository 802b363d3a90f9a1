//! Scene files: reads XML into a [`Scene`], and writes it back. `xml.rs` alone knows how to read XML.
//!
//! A file goes through `xml` (bytes to a tree), `check` (the tree against the `schema`), `document` (values, without
//! files) and `resolve` (files read, defaults filled in); `write` goes back. `play` makes
//! a scene of a glTF file. The format: docs/scene-format.md.

mod attributes;
mod check;
mod document;
mod dom;
mod error;
mod flight;
mod opening;
mod paths;
mod play;
mod resolve;
mod schema;
#[cfg(test)]
mod tests;
mod write;
mod xml;

use std::io::Read as _;
use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::files;
use crate::image::{Display, ViewTransform};
use crate::math::Trs;
use crate::model::{self, ColourBy, Kind, LoadProgress, ModelFormat};
use crate::options::words;
use crate::scene::{Camera, Object, Scene, Studio, StudioLight, StudioOptions};
use crate::time::Readout;

use self::attributes::Part;
use self::resolve::Flown;

pub use self::error::{EnvironmentError, Location, SceneError};
pub use self::opening::Opening;
pub use self::play::{NoPlay, Play, play};
pub use self::write::{camera_line, camera_path, to_xml};

/// How scene files are read.
#[derive(Clone, Copy, Default)]
pub struct SceneLoadOptions<'a> {
    /// Unknown elements and attributes become notes instead of errors.
    pub lenient: bool,
    /// Paths that leave this directory are refused.
    pub restrict: Option<&'a Path>,
    /// Width and height of the image, pixels, in place of the scene's. Meshes without a spacing depend on it, and so
    /// does a camera that is found.
    pub size: Option<(u32, u32)>,
    /// The axis that is up in a model file that does not say so; `None`: z in LAS and E57, y in all others. Scene files
    /// say it of each object.
    pub up: Option<Up>,
    /// What a model alone is drawn as; `None`: as its file is. Scene files say it of each object.
    pub kind: Option<Kind>,
    /// Radius of all points of a model alone, model units. Scene files say it of each object.
    pub radius: Option<f64>,
    /// The column of numbers that colours the points of a model alone. Scene files say it of each object.
    pub colour_by: Option<&'a ColourBy>,
    /// When the shutter opens and closes on a model alone, frames around the frame number; its camera in a studio
    /// depends on it. Scene files say it themselves.
    pub shutter: Option<(f64, f64)>,
    /// How the image of a model alone is read out, as with `shutter`.
    pub readout: Option<Readout>,
    /// The studio of a model alone; `None`: the bare model. Scene files have none.
    pub studio: Option<StudioOptions>,
    /// A file with one `<camera>`, which takes the place of the scene's. Where it has keys, the frames are theirs.
    pub camera_path: Option<&'a Path>,
    /// Told about slow steps.
    pub progress: Option<LoadProgress<'a>>,
}

/// A scene, and what a user should know about its reading.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// The scene.
    pub scene: Scene,
    /// Normals or radii estimated, unknown words skipped, the automatic camera: one line each.
    pub notes: Vec<String>,
    /// The studio that a model alone stands in.
    pub studio: Option<Studio>,
}

/// The axis of a model that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    /// +y, as in glTF and in most files that say nothing.
    #[default]
    Y,
    /// +z, as in maps, CAD and many scans.
    Z,
    /// -y, as in what is reconstructed from photographs: there y points down in the first of them.
    MinusY,
}

words!(Up, "axis that points up", [Y = "y", Z = "z", MinusY = "-y"]);

impl LoadedScene {
    /// How pictures are shown that nobody chose another way for: in a studio with dither, and by `AgX` where lamps
    /// shade the model; else as they are.
    pub fn display(&self) -> Display {
        self.studio.map_or_else(Display::default, |studio| Display {
            view: match studio.light {
                StudioLight::Lit => ViewTransform::Agx,
                StudioLight::Unlit | StudioLight::Own => ViewTransform::Standard,
            },
            dither: true,
            ..Display::default()
        })
    }
}

impl Scene {
    /// Reads a scene file (XML, docs/scene-format.md) with the models and animations that it names, and fills in every
    /// default. [`Scene::open`] also takes a size for the image; a size that is set afterwards is not the same
    /// ([`ImageSettings`](crate::scene::ImageSettings)).
    ///
    /// # Errors
    /// The scene, or a file that it names, cannot be read or is not valid. The message says where, what was found
    /// there, and what would be right.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        Ok(load(path.as_ref(), &SceneLoadOptions::default())?.scene)
    }
}

/// Reads a scene file with all that it names.
///
/// # Errors
/// The scene, or a file that it names, cannot be read or is not valid.
pub fn load(path: &Path, options: &SceneLoadOptions<'_>) -> Result<LoadedScene, SceneError> {
    let (loaded, files) = files::listed(|| load_scene(path, options));
    loaded.map(|(scene, notes)| LoadedScene { scene: Scene { files, ..scene }, notes, studio: None })
}

fn load_scene(path: &Path, options: &SceneLoadOptions<'_>) -> Result<(Scene, Vec<String>), SceneError> {
    let (source, mut document, notes) = files::steady(|| {
        let source = xml::decode(path, &xml::read(path)?)?;
        let root = xml::parse(&source)?;
        let notes = check::check(&source, &root, options.lenient)?;
        let document = document::read(&source, &root)?;
        Ok::<_, SceneError>((source, document, notes))
    })?;
    if let Some((width, height)) = options.size {
        (document.image.width, document.image.height, document.size_given) = (width, height, true);
    }
    let flown = flown(options)?;
    resolve::resolve(&source, document, options, notes, flown.as_ref())
}

/// Reads the file of the camera that takes the place of the scene's.
fn flown(options: &SceneLoadOptions<'_>) -> Result<Option<Flown>, SceneError> {
    let Some(path) = options.camera_path else { return Ok(None) };
    files::steady(|| {
        let source = xml::decode(path, &xml::read(path)?)?;
        let root = xml::parse(&source)?;
        check::check_camera(&source, &root)?;
        let spec = document::camera(&Part::new(&source, &root, "camera"))?;
        Ok(Some(Flown { source, spec }))
    })
}

/// A scene of one model file, as a scene file with this model alone would be: 1024 x 768 pixels if the options do not
/// say more, a black background, a light from the upper right front, ambient light, one frame, and a camera that sees
/// all. With a [`StudioOptions`], the same model in a studio.
///
/// # Errors
/// The file cannot be read, or is not a valid model with at least one point ([`SceneError::Alone`]), or the file of
/// the camera is not valid.
pub fn load_model(path: &Path, options: &SceneLoadOptions<'_>) -> Result<LoadedScene, SceneError> {
    let (loaded, files) = files::listed(|| load_alone(path, options));
    loaded.map(|(scene, notes, studio)| LoadedScene { scene: Scene { files, ..scene }, notes, studio })
}

type Alone = (Scene, Vec<String>, Option<Studio>);

fn load_alone(path: &Path, options: &SceneLoadOptions<'_>) -> Result<Alone, SceneError> {
    let silent = |_: &str, _: f32| {};
    let progress = options.progress.unwrap_or(&silent);
    let colour_by = options.colour_by.cloned();
    let points = model::PointOptions { radius: options.radius, colour_by, ..model::PointOptions::default() };
    let of_model = model::LoadOptions { kind: options.kind, points, ..model::LoadOptions::default() };
    let loaded = model::load(path, &resolve::coarse(of_model.clone()), progress)?;
    let mut notes: Vec<String> = loaded.notes.iter().map(|note| format!("{}: {note}", path.display())).collect();
    let (mesh, colour_range) = (loaded.mesh().cloned(), loaded.colour_range);
    let mut object = Object::new(loaded);
    path.clone_into(&mut object.source.path);
    object.source.options = of_model;
    resolve::take_range(&mut object.source.options, colour_range);
    notes.extend(stand(&mut object, options.up, path));
    let shape = object.shape.clone();
    let mut scene = Scene::new([object]);
    if let Some((width, height)) = options.size {
        (scene.image.width, scene.image.height) = (width, height);
        scene.camera = Camera::automatic(&scene);
    }
    // Before the studio frames what moves.
    if let Some((open, close)) = options.shutter {
        (scene.shutter.open, scene.shutter.close) = (open, close);
    }
    if let Some(readout) = options.readout {
        scene.shutter.readout = readout;
    }
    // Before a mesh is sampled as finely as its camera sees it.
    let coloured = options.colour_by.is_some();
    let unlit = |wanted: StudioOptions| if coloured { StudioOptions { unlit: Some(true), ..wanted } } else { wanted };
    let studio = options.studio.map(|wanted| scene.enter_studio(&unlit(wanted)));
    if studio.is_none() {
        // The light of a bare model is grey, so that this cannot fail.
        let _ = scene.unlight_coloured_by();
    }
    if let Some(flown) = flown(options)? {
        flown.enter(&mut scene)?;
    }
    if let Some(source) = mesh {
        notes.clear();
        let mesh = resolve::SampledMesh { path: path.to_owned(), source, shape, is_coarse: true };
        resolve::refine(&mut scene, &mesh, 1, &mut notes);
    }
    scene.name = name_of(path);
    Ok((scene, notes, studio))
}

/// The name of the scene of a model: that of its file without the ending. Of several files it is what stands beside the
/// stars, or the name of their folder.
fn name_of(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    if !stem.contains('*') {
        return stem.into_owned();
    }
    let beside = stem.replace('*', "");
    let beside = beside.trim_matches(['-', '_', '.', ' ']);
    let folder = || path.parent().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
    if beside.is_empty() { folder().unwrap_or_else(|| "model".to_owned()) } else { beside.to_owned() }
}

/// Turns what stands on another axis, unless its file says which; then the note says so.
fn stand(object: &mut Object, up: Option<Up>, path: &Path) -> Option<String> {
    let format = format_of(path);
    let is_scan = matches!(format, Some(ModelFormat::Las | ModelFormat::E57));
    let note = (up.is_none() && is_scan).then(|| format!("{}: z is taken as up, as scans have it", path.display()));
    let up = up.unwrap_or(if is_scan { Up::Z } else { Up::Y });
    // Three quarters of a turn about x take z to y. A quarter back would do the same, but for the sign of a rounding
    // error that the up direction of captures goes by.
    let turn: f64 = match up {
        Up::Y => return None,
        Up::Z => 270.0,
        Up::MinusY => 180.0,
    };
    if matches!(format, Some(ModelFormat::Glb | ModelFormat::Gltf)) {
        return Some(format!("{}: up {up} is left out, because glTF has y up", path.display()));
    }
    object.place = Trs { rotate: DVec3::new(turn.to_radians(), 0.0, 0.0), ..Trs::default() };
    note
}

/// The format of a file, or of the first of several, by its first bytes.
fn format_of(path: &Path) -> Option<ModelFormat> {
    let files = model::matching(path).ok()?;
    let first = files.as_ref().and_then(|files| files.first()).map_or(path, PathBuf::as_path);
    let mut head = Vec::new();
    files::open(first).ok()?.take(512).read_to_end(&mut head).ok()?;
    ModelFormat::detect(&head, first)
}

/// Checks the bytes of a scene file without looking at the files that it names; gives the notes of `lenient`.
///
/// # Errors
/// The bytes are not a valid scene; `path` stands for the file in the message.
pub fn validate(path: &Path, bytes: &[u8], lenient: bool) -> Result<Vec<String>, SceneError> {
    let source = xml::decode(path, bytes)?;
    let root = xml::parse(&source)?;
    let notes = check::check(&source, &root, lenient)?;
    document::read(&source, &root).map(|_| notes)
}

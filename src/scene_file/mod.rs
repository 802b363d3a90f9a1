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
mod opening;
mod paths;
mod play;
mod resolve;
mod schema;
#[cfg(test)]
mod tests;
mod write;
mod xml;

use std::path::Path;

use crate::files;
use crate::model::{self, LoadProgress, ModelError};
use crate::scene::{Camera, Object, Scene};

pub use self::error::{EnvironmentError, Location, SceneError};
pub use self::opening::Opening;
pub use self::play::{NoPlay, Play, play};
pub use self::write::{camera_line, to_xml};

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
    loaded.map(|(scene, notes)| LoadedScene { scene: Scene { files, ..scene }, notes })
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
    resolve::resolve(&source, document, options, notes)
}

/// A scene of one model file, as a scene file with this model alone would be: 1024 x 768 pixels if the options do not
/// say more, a black background, a light from the upper right front, ambient light, one frame, and a camera that sees
/// all.
///
/// # Errors
/// The file cannot be read, or is not a valid model with at least one point.
pub fn load_model(path: &Path, options: &SceneLoadOptions<'_>) -> Result<LoadedScene, ModelError> {
    let (loaded, files) = files::listed(|| load_alone(path, options));
    loaded.map(|(scene, notes)| LoadedScene { scene: Scene { files, ..scene }, notes })
}

fn load_alone(path: &Path, options: &SceneLoadOptions<'_>) -> Result<(Scene, Vec<String>), ModelError> {
    let silent = |_: &str, _: f32| {};
    let progress = options.progress.unwrap_or(&silent);
    let loaded = model::load(path, &resolve::coarse(model::LoadOptions::default()), progress)?;
    let mut notes: Vec<String> = loaded.notes.iter().map(|note| format!("{}: {note}", path.display())).collect();
    let mesh = loaded.mesh().cloned();
    let mut object = Object::new(loaded);
    path.clone_into(&mut object.source.path);
    let shape = object.shape.clone();
    let mut scene = Scene::new([object]);
    if let Some((width, height)) = options.size {
        (scene.image.width, scene.image.height) = (width, height);
        scene.camera = Camera::automatic(&scene);
    }
    if let Some(source) = mesh {
        notes.clear();
        let mesh = resolve::SampledMesh { path: path.to_owned(), source, shape, is_coarse: true };
        resolve::refine(&mut scene, &mesh, 1, &mut notes);
    }
    scene.name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    Ok((scene, notes))
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

//! Scene files: reads XML into a [`Scene`], and writes it back. `xml.rs` alone knows how to read XML.
//!
//! A file goes through `xml` (bytes to a tree), `check` (the tree against the `schema`), `document` (values, without
//! files) and `resolve` (files read, defaults filled in); `write` goes back. The format: docs/scene-format.md.

mod attributes;
mod check;
mod document;
mod dom;
mod error;
mod paths;
mod resolve;
mod schema;
mod write;
mod xml;

use std::path::Path;

use crate::model::Progress;
use crate::scene::Scene;

pub use self::error::{Location, SceneError};
pub use self::write::to_xml;

/// How scene files are read.
#[derive(Clone, Copy, Default)]
pub struct LoadOptions<'a> {
    /// Unknown elements and attributes become notes instead of errors.
    pub lenient: bool,
    /// Paths that leave this directory are refused.
    pub restrict: Option<&'a Path>,
    /// Told about slow steps.
    pub progress: Option<Progress<'a>>,
}

/// A scene, and what a user should know about its reading.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// Normals or radii estimated, unknown words skipped, the automatic camera: one line each.
    pub notes: Vec<String>,
}

impl Scene {
    /// Reads a scene file (XML, docs/scene-format.md) with the models and animations that it names, and fills in every
    /// default.
    ///
    /// # Errors
    /// The scene, or a file that it names, cannot be read or is not valid. The message says where, what was found
    /// there, and what would be right.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        Ok(load(path.as_ref(), &LoadOptions::default())?.scene)
    }
}

/// Reads a scene file with all that it names.
///
/// # Errors
/// The scene, or a file that it names, cannot be read or is not valid.
pub fn load(path: &Path, options: &LoadOptions<'_>) -> Result<Loaded, SceneError> {
    let source = xml::decode(path, &xml::read(path)?)?;
    let root = xml::parse(&source)?;
    let notes = check::check(&source, &root, options.lenient)?;
    let document = document::read(&source, &root)?;
    drop(root);
    resolve::resolve(&source, document, options, notes)
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

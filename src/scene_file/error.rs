//! Why a scene is refused: where, what was found, what would be right.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::anim::AnimError;
use crate::environment::NotLatLong;
use crate::files::Changed;
use crate::image::ImageError;
use crate::limits::Invalid;
use crate::model::ModelError;

/// A place in a scene file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// The file.
    pub file: Arc<Path>,
    /// Line, from 1.
    pub line: u32,
    /// Column, in characters, from 1.
    pub column: u32,
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file.display(), self.line, self.column)
    }
}

/// Why a scene was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A model that is shown alone was refused.
    #[error(transparent)]
    Alone(#[from] ModelError),
    /// The size that was asked for is out of its bounds.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// The file could not be read.
    #[error("cannot read scene {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Directories, pipes and devices are not opened: reading them may never end.
    #[error("scene {} is {found}, expected a regular file", path.display())]
    NotAFile {
        /// The path.
        path: PathBuf,
        /// The text that was found.
        found: &'static str,
    },
    /// The file changes while it is read.
    #[error(transparent)]
    Changed(#[from] Changed),
    /// The file is larger than any scene.
    #[error("scene {} has more than {limit} bytes, the most that a scene may have", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The limit in bytes.
        limit: u64,
    },
    /// The bytes are not text in the encoding that the file declares.
    #[error("{at}: {found}, expected {expected}")]
    Encoding {
        /// Where.
        at: Location,
        /// What was found.
        found: String,
        /// What would be right.
        expected: &'static str,
    },
    /// Not well-formed XML, or XML of a kind that scenes do not use.
    #[error("{at}: {found}, expected {expected}")]
    Syntax {
        /// Where.
        at: Location,
        /// What was found.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// An element that scenes do not have there. Typos must never become defaults.
    #[error("{at}: <{parent}> has no element {found}{} (it takes: {known})", hint(closest.as_deref()))]
    UnknownElement {
        /// Where.
        at: Location,
        /// The element that it stands in.
        parent: &'static str,
        /// Its quoted name.
        found: String,
        /// The known name nearest to it, if one is near.
        closest: Option<String>,
        /// What the parent takes.
        known: String,
    },
    /// An attribute that the element does not have. Typos must never become defaults.
    #[error("{at}: <{element}> has no attribute {found}{} (it takes: {known})", hint(closest.as_deref()))]
    UnknownAttribute {
        /// Where.
        at: Location,
        /// The element.
        element: &'static str,
        /// Its quoted name.
        found: String,
        /// The known name nearest to it, if one is near.
        closest: Option<String>,
        /// What the element takes.
        known: String,
    },
    /// A known attribute that means nothing beside the others.
    #[error("{at}: `{attribute}` does not apply to <{element}> with {found} (it takes: {known})")]
    Inapplicable {
        /// Where.
        at: Location,
        /// The element.
        element: &'static str,
        /// The attribute.
        attribute: &'static str,
        /// What it does not go with.
        found: String,
        /// What would apply.
        known: String,
    },
    /// An attribute that has no default is missing.
    #[error("{at}: <{element}> needs the attribute `{attribute}`: {expected}")]
    MissingAttribute {
        /// Where.
        at: Location,
        /// The element.
        element: &'static str,
        /// The attribute.
        attribute: &'static str,
        /// What it holds.
        expected: String,
    },
    /// An element that must be there is missing.
    #[error("{at}: <{parent}> has no <{element}>, expected {expected}")]
    MissingElement {
        /// Where the parent is.
        at: Location,
        /// The parent.
        parent: &'static str,
        /// The missing element.
        element: &'static str,
        /// How many there may be.
        expected: &'static str,
    },
    /// An element that may be there once is there again.
    #[error("{at}: a second <{element}> in <{parent}>, expected {expected}")]
    RepeatedElement {
        /// Where the second one is.
        at: Location,
        /// The parent.
        parent: &'static str,
        /// The element.
        element: &'static str,
        /// How many there may be.
        expected: &'static str,
    },
    /// Text where only elements belong.
    #[error("{at}: text {found} in <{element}>, expected {expected}")]
    UnexpectedText {
        /// Where.
        at: Location,
        /// The element.
        element: &'static str,
        /// The quoted text.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// A value of the wrong kind or out of its range.
    #[error("{at}: {what} is {found}, expected {expected}")]
    BadValue {
        /// Where.
        at: Location,
        /// The attribute or element.
        what: String,
        /// The quoted value.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// A file that the scene names is nowhere.
    #[error("{at}: no file {found}, expected a readable regular file at one of: {tried}")]
    MissingFile {
        /// Where.
        at: Location,
        /// The quoted path, as in the scene.
        found: String,
        /// All places tried.
        tried: String,
    },
    /// A path leaves the directory that paths are restricted to.
    #[error("{at}: {found} is the file {}, expected one in {}", real.display(), dir.display())]
    Restricted {
        /// Where.
        at: Location,
        /// The quoted path, as in the scene.
        found: String,
        /// Where it leads.
        real: Box<Path>,
        /// The directory.
        dir: Box<Path>,
    },
    /// The directory that paths are restricted to cannot be used.
    #[error("cannot restrict paths to {}", path.display())]
    RestrictTo {
        /// The directory.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A model was refused.
    #[error("{at}: <pointModel> was refused")]
    Model {
        /// Where the scene names it.
        at: Location,
        /// Why.
        source: Box<ModelError>,
    },
    /// The picture of the environment was refused.
    #[error("{at}: <environment> was refused")]
    Environment {
        /// Where the scene names it.
        at: Location,
        /// Why.
        source: Box<EnvironmentError>,
    },
    /// An animation, or the choice of its node, was refused.
    #[error("{at}: <animation> was refused")]
    Animation {
        /// Where the scene names it.
        at: Location,
        /// Why.
        source: Box<AnimError>,
    },
}

/// Why a file cannot be an environment.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EnvironmentError {
    /// It is no picture that can be read.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// It is a picture of something else.
    #[error("{}: {why}", path.display())]
    Map {
        /// The file.
        path: PathBuf,
        /// Why.
        why: NotLatLong,
    },
}

fn hint(closest: Option<&str>) -> String {
    closest.map_or_else(String::new, |name| format!(", did you mean `{name}`?"))
}

/// What a user wrote, in back quotes: shortened, and without control characters, which could play with a terminal.
pub(super) fn quoted(text: &str) -> String {
    const MOST: usize = 60;
    let mut out = String::from("`");
    for (i, c) in text.chars().enumerate() {
        if i == MOST {
            out.push_str("...");
            break;
        }
        if c.is_control() { out.extend(c.escape_default()) } else { out.push(c) }
    }
    out.push('`');
    out
}

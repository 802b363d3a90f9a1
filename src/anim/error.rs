//! Reasons to refuse an animation.

use std::fmt;
use std::path::PathBuf;

use crate::files::Changed;

/// A line of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AnimLocation {
    /// The file.
    pub path: PathBuf,
    /// Line number, from 1.
    pub line: usize,
}

impl fmt::Display for AnimLocation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.path.display(), self.line)
    }
}

/// Why an animation was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnimError {
    /// The file could not be read.
    #[error("cannot read animation {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The path names a directory, a pipe or a device. Reading a pipe or a device may never end.
    #[error("{} is not a regular file, so it cannot be read as an animation", path.display())]
    NotAFile {
        /// What was named.
        path: PathBuf,
    },
    /// The file, or one that it names, changes while it is read.
    #[error(transparent)]
    Changed(#[from] Changed),
    /// The file is larger than any animation. It is refused before it is read.
    #[error("{} is too large for an animation: {bytes} bytes, the limit is {limit}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Lower bound of its size, bytes.
        bytes: u64,
        /// Largest size that is read.
        limit: u64,
    },
    /// The file is a Unity clip (YAML), which has the same extension.
    #[error(
        "{} is a Unity animation clip (YAML); expected Maya's .anim format, which begins with `animVersion`",
        path.display()
    )]
    Unity {
        /// The file.
        path: PathBuf,
    },
    /// The file is of some other kind.
    #[error("{at}: not a Maya .anim file: found {found}, expected `animVersion`")]
    NotAnim {
        /// Where the first word is.
        at: AnimLocation,
        /// The first word, or what the data look like.
        found: String,
    },
    /// The text breaks the grammar.
    #[error("{at}: found {found}, expected {expected}")]
    Expected {
        /// Where.
        at: AnimLocation,
        /// The text found.
        found: String,
        /// What the grammar expects.
        expected: &'static str,
    },
    /// The unit is unknown. Guessing one would scale the motion.
    #[error("{at}: unknown {what} `{found}` (known: {known})")]
    UnknownUnit {
        /// Where.
        at: AnimLocation,
        /// The header word.
        what: &'static str,
        /// The unit found.
        found: String,
        /// The units that are understood.
        known: &'static str,
    },
    /// A number contains a comma, which may separate thousands or decimals.
    #[error(
        "{at}: found `{found}`, expected a number with a decimal point and no comma: a comma may separate thousands or \
         decimals, so the value is not guessed (write the file again with the C locale)"
    )]
    Comma {
        /// Where.
        at: AnimLocation,
        /// The word found.
        found: String,
    },
    /// A number is infinite, undefined or too large to calculate with.
    #[error("{at}: found `{found}`, expected a finite number of magnitude 1e30 or less")]
    NotFinite {
        /// Where.
        at: AnimLocation,
        /// The word found.
        found: String,
    },
    /// The file is well formed but moves nothing.
    #[error(
        "{} holds no usable curve: expected at least one curve over time that has keys{}",
        path.display(),
        hint(notes)
    )]
    NoCurves {
        /// The file.
        path: PathBuf,
        /// Notes on what was skipped.
        notes: Vec<String>,
    },
    /// A file of camera poses is not valid, or its lens cannot be had.
    #[error("{}: {place}found {found}, expected {expected}", path.display())]
    Track {
        /// The file.
        path: PathBuf,
        /// Empty, or where, with a colon and a blank behind it.
        place: String,
        /// The text that was found.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// A glTF file is not valid, or has no such node.
    #[error("{}: {why}", path.display())]
    Gltf {
        /// The file.
        path: PathBuf,
        /// Where and what.
        why: String,
    },
    /// No node has a translate, rotate, scale or visibility curve.
    #[error(
        "{} animates no transform: expected translate, rotate, scale or visibility curves (nodes: {known})",
        path.display()
    )]
    NoTransform {
        /// The file.
        path: PathBuf,
        /// The nodes there are.
        known: String,
    },
    /// The named node is not in the file.
    #[error("{} has no node `{found}` (it has: {known})", path.display())]
    UnknownNode {
        /// The file.
        path: PathBuf,
        /// The name asked for.
        found: String,
        /// The nodes there are.
        known: String,
    },
    /// Several nodes share the short name.
    #[error("{} has several nodes named `{found}`; give the full path (it has: {known})", path.display())]
    AmbiguousNode {
        /// The file.
        path: PathBuf,
        /// The name asked for.
        found: String,
        /// The nodes there are.
        known: String,
    },
}

fn hint(notes: &[String]) -> String {
    if notes.is_empty() { String::new() } else { format!(" ({})", notes.join("; ")) }
}

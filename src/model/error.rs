//! Reasons to refuse a model: the place in the file, what was found there and what was expected.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::files::{Changed, InputError};
use crate::gltf::GltfError;
use crate::limits::Invalid;

/// The formats of models that are known, for messages. It stands here because `format` looks into files with readers
/// that report errors.
pub(super) const KNOWN_FORMATS: &str = "PLY, Pointshop3D .sfl, Wavefront .obj, points as text .xyz, .csv, .txt and \
     .pts, arrays .npy and .npz, splatblur .bin, glTF .glb and .gltf, Gaussian splats .splat, .spz, .sog and .glb, \
     volumes .nrrd, scans .las, .laz and .e57";

/// Why a model was refused or could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The file could not be read.
    #[error("cannot read model {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file could not be written; nothing is left behind.
    #[error("cannot write model {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The path names a directory, a device, a pipe or a socket. It was not opened.
    #[error("model {} is {found}, expected a regular file", path.display())]
    NotAFile {
        /// What was named.
        path: PathBuf,
        /// What it is.
        found: &'static str,
    },
    /// The file, or one that it names, changes while it is read.
    #[error(transparent)]
    Changed(#[from] Changed),
    /// The file has no bytes.
    #[error("model {} is empty (0 bytes)", path.display())]
    EmptyFile {
        /// The file.
        path: PathBuf,
    },
    /// Neither the content nor the extension shows a known format.
    #[error("model {} is of no known format (known: {})", path.display(), KNOWN_FORMATS)]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file breaks the rules of its format.
    #[error("model {}: {why}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Where and what.
        why: ParseError,
    },
    /// The columns of a cloud do not go together.
    #[error(transparent)]
    Column(#[from] Invalid),
    /// The cloud has no point that could be drawn.
    #[error("the model has no usable points")]
    NoPoints,
    /// The file has no point that could be drawn.
    #[error("model {} has no usable points{dropped}", path.display())]
    NoPointsIn {
        /// The file.
        path: PathBuf,
        /// Either empty, or `: ` and why points were dropped.
        dropped: String,
    },
    /// A name with stars fits no file.
    #[error("no file {}, expected one at least that the stars fit", path.display())]
    NoMatch {
        /// The name.
        path: PathBuf,
    },
    /// One of several files that make a model is no cloud of points.
    #[error("model {} is not a cloud of points: several files are one model only if all are", path.display())]
    NoCloud {
        /// The file.
        path: PathBuf,
    },
    /// A sequence of files has a gap.
    #[error("no file {}, expected the numbers {first} to {last} of the sequence without a gap", path.display())]
    Gap {
        /// The file.
        path: PathBuf,
        /// Its number.
        number: i64,
        /// The first number.
        first: i64,
        /// The last number.
        last: i64,
    },
    /// A shutter touches too many files of a sequence.
    #[error("the shutter touches {files} files of the sequence {}, expected at most {most}", path.display())]
    ManyFiles {
        /// The pattern of the files.
        path: PathBuf,
        /// Files that the shutter touches.
        files: i64,
        /// Most files.
        most: i64,
    },
    /// Two points of a file of a sequence have the same identity.
    #[error("model {} has two points with the `id` {id}, expected each once", path.display())]
    Twice {
        /// The file.
        path: PathBuf,
        /// The identity.
        id: i64,
    },
    /// Two files of a sequence have different points.
    #[error(
        "model {} has {} points and {} beside it {}, expected as many, or velocities, or an `id` for each point",
        path.display(), points[0], beside.display(), points[1]
    )]
    Unmatched {
        /// The file.
        path: PathBuf,
        /// The file beside it.
        beside: PathBuf,
        /// Points of both.
        points: [usize; 2],
    },
    /// The file was to be drawn as Gaussians and is no capture.
    #[error("model {} holds no 3D Gaussians, which kind `gaussians` needs", path.display())]
    NoGaussians {
        /// The file.
        path: PathBuf,
    },
    /// The file was to be drawn as a volume and is none.
    #[error(
        "model {} holds no volume, which kind `volume` needs: an NRRD grid, or points with `density` and `radius`",
        path.display()
    )]
    NoVolume {
        /// The file.
        path: PathBuf,
    },
    /// The file was to be drawn as surfels and is a grid of a volume.
    #[error("model {} is a grid of a volume, which has no surfels (kind `surfels`)", path.display())]
    NoSurfels {
        /// The file.
        path: PathBuf,
    },
    /// The file was to be drawn as surfels and holds spheres.
    #[error("model {} holds spheres, which are no surfels (kind `surfels`)", path.display())]
    AreSpheres {
        /// The file.
        path: PathBuf,
    },
    /// The mesh has no triangle that could be sampled.
    #[error(
        "model {} has {triangles} triangles and none has an area (spacing `none` takes its vertices as points)",
        path.display()
    )]
    FlatMesh {
        /// The file.
        path: PathBuf,
        /// Their number.
        triangles: usize,
    },
    /// The spacing of the surfels of a mesh is too small.
    #[error("model {}: spacing {spacing} is too small for its size, expected at least {least:.3e}", path.display())]
    FineSpacing {
        /// The file.
        path: PathBuf,
        /// What was given.
        spacing: f64,
        /// About the least one that is possible.
        least: f64,
    },
    /// The arrays of surfels to be written differ in length.
    #[error("surfels to be written have {found} of `{column}`, expected {expected}")]
    UnequalColumns {
        /// Name of the array.
        column: &'static str,
        /// Its length.
        found: usize,
        /// The number of surfels.
        expected: usize,
    },
}

impl ModelError {
    /// The error of a model file that is no input.
    pub(super) fn of_input(path: &Path, why: InputError) -> Self {
        let path = path.to_owned();
        match why {
            InputError::NotAFile { found } => Self::NotAFile { path, found },
            InputError::Changed(changed) => changed.into(),
            other => Self::Read { path, source: other.into() },
        }
    }
}

/// A place in a model file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line of a text file or text header, from 1.
    Line(u64),
    /// Offset in a binary file, from 0.
    Byte(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(n) => write!(f, "line {n}"),
            Self::Byte(n) => write!(f, "byte {n}"),
        }
    }
}

/// How a file breaks the rules of its format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{at}: found {found}, expected {expected}")]
pub struct ParseError {
    /// Where.
    pub at: Place,
    /// The content found.
    pub found: String,
    /// The content expected.
    pub expected: String,
}

impl ParseError {
    /// An error at a line (from 1).
    pub(super) fn line(line: u64, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { at: Place::Line(line), found: found.into(), expected: expected.into() }
    }

    /// An error at a byte offset (from 0).
    pub(super) fn byte(at: usize, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { at: Place::Byte(at as u64), found: found.into(), expected: expected.into() }
    }

    /// Adds the name of what was being read.
    pub(super) fn of(mut self, what: &str) -> Self {
        self.expected.push_str(" (");
        self.expected.push_str(what);
        self.expected.push(')');
        self
    }
}

impl From<GltfError> for ParseError {
    fn from(error: GltfError) -> Self {
        Self::byte(error.at, error.found, error.expected)
    }
}

/// Text of a file for a message: quoted, escaped, at most 60 characters.
pub(super) fn quote(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text.get(..256).unwrap_or(text));
    let mut shown: String = text.chars().take(60).flat_map(char::escape_debug).collect();
    if text.chars().nth(60).is_some() {
        shown.push_str("...");
    }
    format!("`{shown}`")
}

/// Line (from 1) of byte `at`. LF, CRLF and CR each end a line.
pub(super) fn line_of(bytes: &[u8], at: usize) -> u64 {
    let before = bytes.get(..at).unwrap_or(bytes);
    let lf = before.split(|&b| b == b'\n').count() - 1;
    let lone_cr = before.windows(2).filter(|w| w.first() == Some(&b'\r') && w.last() != Some(&b'\n')).count();
    let last_cr = usize::from(before.last() == Some(&b'\r') && bytes.get(before.len()) != Some(&b'\n'));
    1 + (lf + lone_cr + last_cr) as u64
}

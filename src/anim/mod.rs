//! Keyframe animation: curves, their evaluation, and Maya's `.anim` files.
//!
//! Times are in seconds at this interface where nothing else is said (a file's time unit is `Animation::rate` units a second),
//! lengths in cm (one cm is one scene unit), angles in radians.
//!
//! Data flow: `maya` (text to raw keys) → `tangent` (types to vectors) → `curve` and `segment` (value at a time), `breaks` (jumps) →
//! `node` (curves to a transform).

mod breaks;
mod curve;
mod error;
mod maya;
mod node;
mod segment;
mod tangent;

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use error::{AnimError, Location};
pub use maya::parse;
pub use node::{Drift, NodeAnimation};

use crate::math::Trs;

/// How values between keys are found. Step keys and the rules beyond the first and last key hold in every mode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// As Maya does: tangents and weights of the file.
    #[default]
    Maya,
    /// Straight lines between the keys.
    Linear,
    /// A Catmull-Rom cubic through the keys, for uneven spacing: the slope at a key is that between its neighbours. At the
    /// ends, and beside a step, the slope is that of the segment itself; two keys give a straight line.
    Spline,
}

/// A `.anim` file, read whole.
#[derive(Clone, Debug)]
pub struct Animation {
    /// The file.
    pub path: PathBuf,
    /// File time units a second.
    pub rate: f64,
    /// Nodes in file order, each with at least one curve; at least one.
    pub nodes: Vec<Arc<NodeAnimation>>,
    /// What a user should know about the reading: words skipped, units assumed.
    pub notes: Vec<String>,
}

/// A node's transform at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeState {
    /// Translation (cm), rotation (radians), scale.
    pub transform: Trs,
    /// Visibility.
    pub visible: bool,
}

/// Largest file that is read, bytes: a hundred curves of 60,000 keys.
const MAX_BYTES: u64 = 256 << 20;

/// Names listed in one message.
const MAX_NAMES: usize = 20;

/// Reads a `.anim` file.
///
/// # Errors
/// The file cannot be read, is not a regular file, is larger than 256 MiB, or is not a valid `.anim` file.
pub fn load(path: &Path) -> Result<Animation, AnimError> {
    // Before opening: to open a pipe may wait for ever.
    let about = fs::metadata(path).map_err(|e| AnimError::read(path, e))?;
    if !about.is_file() {
        return Err(AnimError::NotAFile { path: path.to_owned() });
    }
    let too_large = |bytes| AnimError::TooLarge { path: path.to_owned(), bytes, limit: MAX_BYTES };
    if about.len() > MAX_BYTES {
        return Err(too_large(about.len()));
    }
    let mut bytes = Vec::with_capacity(about.len() as usize);
    let file = File::open(path).map_err(|e| AnimError::read(path, e))?;
    // The file may grow meanwhile.
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(|e| AnimError::read(path, e))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(too_large(bytes.len() as u64));
    }
    parse(&bytes, path)
}

impl Animation {
    /// Adds the notes that concern the whole file.
    fn assemble(path: &Path, rate: f64, nodes: Vec<NodeAnimation>, mut notes: Vec<String>) -> Self {
        let mut ignored: Vec<&str> = nodes.iter().flat_map(NodeAnimation::ignored).collect();
        ignored.sort_unstable();
        ignored.dedup();
        if !ignored.is_empty() {
            notes.push(format!("attributes that do not move a model are ignored: {}", listed(ignored.into_iter())));
        }
        let moving: Vec<&str> = nodes.iter().filter(|n| n.has_transform()).map(|n| n.name.as_str()).collect();
        if let [first, _, ..] = moving[..] {
            let names = listed(moving.iter().copied());
            notes.push(format!("several nodes move: {names}; where none is named, {first} is used"));
        }
        Self { path: path.to_owned(), rate, nodes: nodes.into_iter().map(Arc::new).collect(), notes }
    }

    /// The node called `name`: its whole name, or the last part of its path without namespace if no other node shares that. Without
    /// a name: the first node with a transform curve, else the first with a visibility curve.
    ///
    /// # Errors
    /// No such node, several of them, or without a name no node that could move a model. The known nodes are listed.
    pub fn node(&self, name: Option<&str>) -> Result<&Arc<NodeAnimation>, AnimError> {
        let path = || self.path.clone();
        let known = || listed(self.nodes.iter().map(|n| if n.name.is_empty() { "(no name)" } else { &n.name }));
        let Some(name) = name else {
            let moving = self.nodes.iter().find(|n| n.has_transform());
            let found = moving.or_else(|| self.nodes.iter().find(|n| n.has_visibility()));
            return found.ok_or_else(|| AnimError::NoTransform { path: path(), known: known() });
        };
        if let Some(node) = self.nodes.iter().find(|n| n.name == name) {
            return Ok(node);
        }
        let mut short = self.nodes.iter().filter(|n| n.name.rsplit(['|', ':']).next() == Some(name));
        match (short.next(), short.next()) {
            (Some(node), None) => Ok(node),
            (None, _) => Err(AnimError::UnknownNode { path: path(), found: name.to_owned(), known: known() }),
            (Some(_), Some(_)) => {
                Err(AnimError::AmbiguousNode { path: path(), found: name.to_owned(), known: known() })
            }
        }
    }

    /// First and last key of all nodes' transform and visibility curves, in seconds.
    pub fn range(&self) -> (f64, f64) {
        let (first, last) = self.key_range();
        (first / self.rate, last / self.rate)
    }

    /// As [`Self::range`], in file time units.
    pub fn key_range(&self) -> (f64, f64) {
        let ranges = self.nodes.iter().map(|n| n.key_range());
        ranges.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or((0.0, 0.0))
    }

    /// A table of all curves: a column `frame`, then `node.attribute` (the attribute alone where the node has no name) in file order,
    /// in cm, degrees or plain numbers with six decimals; one row for each of `frames` (file time units). Lines end in LF; names
    /// with commas or quotes are quoted as RFC 4180 says.
    pub fn csv(&self, frames: impl IntoIterator<Item = f64>, interpolation: Interpolation) -> String {
        let mut table = "frame".to_owned();
        for node in &self.nodes {
            for attribute in node.attributes() {
                let dot = if node.name.is_empty() { "" } else { "." };
                table.push(',');
                table.push_str(&csv_field(&format!("{}{dot}{attribute}", node.name)));
            }
        }
        table.push('\n');
        for frame in frames {
            // Writing to a string cannot fail.
            let _ = write!(table, "{frame}");
            for value in self.nodes.iter().flat_map(|n| n.values(frame, interpolation)) {
                let _ = write!(table, ",{:.6}", without_sign_of_zero(value));
            }
            table.push('\n');
        }
        table
    }
}

/// 0 for what six decimals show as zero, so that no `-0.000000` appears.
fn without_sign_of_zero(value: f64) -> f64 {
    if value.abs() < 0.5e-6 { 0.0 } else { value }
}

fn csv_field(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

/// Names for a message, the first few only.
fn listed<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> String {
    let more = names.len().saturating_sub(MAX_NAMES);
    let mut list = names.take(MAX_NAMES).collect::<Vec<_>>().join(", ");
    if more > 0 {
        let _ = write!(list, " and {more} more");
    }
    list
}

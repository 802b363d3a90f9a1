//! The content of a whole `.anim` file.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::curve::Interpolation;
use super::error::AnimError;
use super::node::NodeAnimation;

/// Most names that one message lists.
const MAX_NAMES: usize = 20;

/// A `.anim` file, read whole.
#[derive(Clone, Debug)]
pub struct Animation {
    /// The file.
    pub path: PathBuf,
    /// File time units a second.
    pub rate: f64,
    /// Nodes in file order; at least one, each with at least one curve.
    pub nodes: Vec<Arc<NodeAnimation>>,
    /// What a user should know: words that were skipped, units that were assumed.
    pub notes: Vec<String>,
}

impl Animation {
    /// Adds the notes that concern the whole file.
    pub(super) fn assemble(path: &Path, rate: f64, nodes: Vec<NodeAnimation>, mut notes: Vec<String>) -> Self {
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

    /// The node called `name`: the node's whole name, or the last part of its path without namespace if no other node
    /// shares that part. Without a name it is the first node with a transform curve, else the first with a visibility
    /// curve.
    ///
    /// # Errors
    /// There is no such node, or several match. Without a name: no node could move a model. The error lists the known
    /// nodes.
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

    /// [`Self::range`] in time units of the file.
    pub fn key_range(&self) -> (f64, f64) {
        let ranges = self.nodes.iter().map(|n| n.key_range());
        ranges.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or((0.0, 0.0))
    }

    /// All curves as a table in CSV.
    ///
    /// The first column is `frame`. Then there is one column for each curve, in file order, with the head
    /// `node.attribute` (the attribute alone where the node has no name). There is one row for each of `frames` (file
    /// time units); values are in cm, degrees or plain numbers with six decimals. Lines end in LF; names with commas or
    /// quotes are quoted as RFC 4180 says.
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

/// The value, or 0 where six decimals show it as zero, so that no `-0.000000` appears.
fn without_sign_of_zero(value: f64) -> f64 {
    if value.abs() < 0.5e-6 { 0.0 } else { value }
}

fn csv_field(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

/// The first names as one text for a message, and how many more there are.
fn listed<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> String {
    let more = names.len().saturating_sub(MAX_NAMES);
    let mut list = names.take(MAX_NAMES).collect::<Vec<_>>().join(", ");
    if more > 0 {
        let _ = write!(list, " and {more} more");
    }
    list
}

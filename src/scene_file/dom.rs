//! A scene file as a tree of elements with positions: what `xml.rs` makes and the other files read.

use std::path::Path;
use std::sync::Arc;

use super::error::Location;

/// The decoded text of a scene file; turns byte offsets into lines and columns.
#[derive(Debug)]
pub(super) struct Source {
    path: Arc<Path>,
    text: String,
    /// Byte offsets at which lines start.
    lines: Vec<usize>,
}

impl Source {
    pub(super) fn new(path: &Path, text: String) -> Self {
        let starts = text.bytes().enumerate().filter(|&(_, b)| b == b'\n').map(|(i, _)| i + 1);
        let lines = std::iter::once(0).chain(starts).collect();
        Self { path: path.into(), text, lines }
    }

    pub(super) fn text(&self) -> &str {
        &self.text
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The name that begins at the byte `offset`, as it is written.
    pub(super) fn word(&self, offset: usize) -> &str {
        let rest = self.text.get(offset..).unwrap_or_default();
        rest.split(|c: char| c == '=' || c.is_whitespace()).next().unwrap_or_default()
    }

    /// Line and column of the byte at `offset`; costs the length of its line, so only for what is reported.
    pub(super) fn locate(&self, offset: usize) -> Location {
        let line = self.lines.partition_point(|&start| start <= offset).max(1);
        let before = self.text.get(self.lines[line - 1]..offset).unwrap_or_default();
        Location { file: Arc::clone(&self.path), line: line as u32, column: before.chars().count() as u32 + 1 }
    }
}

/// A file that the scene names: the text, and where it stands.
#[derive(Debug)]
pub(super) struct FileRef {
    pub(super) text: String,
    pub(super) at: usize,
}

/// An element. Offsets are bytes of [`Source::text`].
#[derive(Debug, Default)]
pub(super) struct Element {
    pub(super) name: String,
    /// Where its `<` is.
    pub(super) at: usize,
    /// In document order, names distinct.
    pub(super) attributes: Vec<Attribute>,
    /// In document order.
    pub(super) children: Vec<Element>,
    /// Its own text, references resolved, comments left out, trimmed.
    pub(super) text: String,
    /// Where the text starts.
    pub(super) text_at: usize,
}

/// An attribute, its value unescaped.
#[derive(Debug)]
pub(super) struct Attribute {
    pub(super) name: String,
    pub(super) value: String,
    /// Where its name is.
    pub(super) at: usize,
}

impl Element {
    pub(super) fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|a| a.name == name)
    }

    pub(super) fn child(&self, name: &str) -> Option<&Self> {
        self.children.iter().find(|c| c.name == name)
    }

    pub(super) fn children<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Self> {
        self.children.iter().filter(move |c| c.name == name)
    }
}

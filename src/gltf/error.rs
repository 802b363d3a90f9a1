//! Reasons to refuse a glTF file.

/// Where the text of a GLB begins: what is wrong in it has no better place.
pub(crate) const TEXT: usize = 20;

/// How a glTF file breaks the rules.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("byte {at}: found {found}, expected {expected}")]
pub(crate) struct GltfError {
    /// Byte, from 0; the start of the text where the text is at fault.
    pub(crate) at: usize,
    /// The content found.
    pub(crate) found: String,
    /// The content expected.
    pub(crate) expected: String,
}

impl GltfError {
    pub(crate) fn byte(at: usize, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { at, found: found.into(), expected: expected.into() }
    }

    /// Adds the name of what was being read.
    pub(crate) fn of(mut self, what: &str) -> Self {
        self.expected = format!("{} ({what})", self.expected);
        self
    }
}

/// An error of the text.
pub(crate) fn wrong(found: impl Into<String>, expected: impl Into<String>) -> GltfError {
    GltfError::byte(TEXT, found, expected)
}

/// The item of this index.
pub(crate) fn named<'a, T>(items: &'a [T], index: usize, what: &str) -> Result<&'a T, GltfError> {
    let missing = || wrong(format!("{what} {index}"), format!("below {}, the number there are", items.len()));
    items.get(index).ok_or_else(missing)
}

/// Text of a file for a message: quoted, escaped, at most 60 characters.
pub(super) fn quote(text: &str) -> String {
    let mut shown: String = text.chars().take(60).flat_map(char::escape_debug).collect();
    if text.chars().nth(60).is_some() {
        shown.push_str("...");
    }
    format!("`{shown}`")
}

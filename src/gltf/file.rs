//! A glTF file taken apart: its text, and the buffers that the text names.
//!
//! ```text
//! GLB:  "glTF", u32 version 2, u32 length | u32 length, "JSON", text | u32 length, "BIN\0", data
//! glTF: the text alone
//! ```
//! The text places columns of numbers (accessors in buffer views) in buffers. A buffer is the data of the GLB, another
//! file, or base64 in the text.

use std::borrow::Cow;
use std::path::Path;

use super::column::{Column, Component, ValueShape};
use super::document::{Asset, BufferView, Document};
use super::error::{GltfError, TEXT, named, quote, wrong};
use super::uri;

/// Longest text without its long strings. Its parsed form is about twenty times as large.
const MOST_TEXT: usize = 16 << 20;

/// A file taken apart.
pub(crate) struct GltfFile<'a> {
    pub(crate) document: Document,
    /// As many as the text has; `None` where it was not asked for.
    buffers: Vec<Option<Cow<'a, [u8]>>>,
}

/// True for a glTF text: JSON that has an `asset`, which every glTF text must have.
pub(crate) fn is_text(bytes: &[u8]) -> bool {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    text.starts_with(b"{") && text.windows(7).any(|word| word == b"\"asset\"")
}

impl<'a> GltfFile<'a> {
    /// Reads a GLB or a glTF text, and all buffers. Files that it names lie beside `path`, or below.
    pub(crate) fn read(bytes: &'a [u8], path: &Path) -> Result<Self, GltfError> {
        let mut file = Self::read_text(bytes)?;
        for (index, slot) in file.buffers.iter_mut().enumerate() {
            let Some(buffer) = file.document.buffers.get(index) else { continue };
            let Some(name) = buffer.uri.as_deref() else { continue };
            let data = match uri::inline(name) {
                Some(data) => {
                    data.map_err(|found| wrong(format!("buffer {index}, {found}"), "base64 after a comma"))?
                }
                None => uri::read_beside(path, name).map_err(|why| wrong(format!("buffer {index}, {why}"), FILE))?,
            };
            *slot = Some(Cow::Owned(data));
        }
        Ok(file)
    }

    /// Reads the text, and of all buffers only the data of a GLB.
    pub(crate) fn read_text(bytes: &'a [u8]) -> Result<Self, GltfError> {
        let (text, at, data) = if bytes.starts_with(b"glTF") {
            chunks(bytes)?
        } else if is_text(bytes) {
            (bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), 0, None)
        } else {
            let magic: [u8; 4] = array(bytes, 0)?;
            return Err(GltfError::byte(0, quote(&String::from_utf8_lossy(&magic)), "`glTF`"));
        };
        let length = without_strings(text);
        if length > MOST_TEXT {
            return Err(GltfError::byte(at, format!("{length} bytes of text"), format!("at most {MOST_TEXT}")));
        }
        let document: Document = serde_json::from_slice(text).map_err(|why| {
            let place = format!("line {} column {}", why.line(), why.column());
            wrong(format!("a text that fails at {place}: {}", quote(&why.to_string())), "glTF 2.0 in JSON")
        })?;
        refuse_versions(&document)?;
        let mut buffers: Vec<Option<Cow<'a, [u8]>>> = Vec::new();
        buffers.resize_with(document.buffers.len(), || None);
        if let (Some(slot), Some(buffer), Some(data)) = (buffers.first_mut(), document.buffers.first(), data)
            && buffer.uri.is_none()
        {
            *slot = Some(Cow::Borrowed(data));
        }
        Ok(Self { document, buffers })
    }

    /// The numbers of accessor `index`, which must have this shape; `name` is what they are, for messages.
    pub(crate) fn column(&self, index: usize, shape: ValueShape, name: &str) -> Result<Column<'_>, GltfError> {
        let accessor = named(&self.document.accessors, index, "accessor")?;
        let fault = |found: String, expected: String| wrong(format!("accessor {index}, {found}"), expected).of(name);
        if accessor.shape != shape {
            return Err(fault(format!("type {:?}", accessor.shape), format!("{shape:?}")));
        }
        if accessor.sparse.is_some() {
            return Err(fault("sparse values".into(), "values in a buffer view".into()));
        }
        let Some(component) = Component::of(accessor.component_type) else {
            return Err(fault(
                format!("component type {}", accessor.component_type),
                "5120 to 5123, 5125 or 5126".into(),
            ));
        };
        let Some(view_index) = accessor.buffer_view else {
            return Err(fault("no buffer view".into(), "one".into()));
        };
        let view = named(&self.document.buffer_views, view_index, "buffer view")?;
        let data = self.view_data(view_index, view)?;
        let size = component.size() * shape.width();
        let stride = view.byte_stride.unwrap_or(size);
        if stride < size {
            return Err(fault(format!("a stride of {stride} bytes"), format!("at least {size}")));
        }
        // The last value need not have the padding of a stride.
        let before_last = accessor.count.saturating_sub(1).checked_mul(stride);
        let needed = before_last.and_then(|n| n.checked_add(if accessor.count > 0 { size } else { 0 }));
        let end = needed.and_then(|needed| accessor.byte_offset.checked_add(needed));
        let Some(data) = end.and_then(|end| data.get(accessor.byte_offset..end)) else {
            let found = format!("{} values from byte {}", accessor.count, accessor.byte_offset);
            return Err(fault(found, format!("values inside buffer view {view_index} of {} bytes", view.byte_length)));
        };
        Ok(Column { data, stride, component, normalized: accessor.normalized, count: accessor.count })
    }

    /// The shape of accessor `index`.
    pub(crate) fn shape(&self, index: usize) -> Result<ValueShape, GltfError> {
        Ok(named(&self.document.accessors, index, "accessor")?.shape)
    }

    /// The bytes of buffer view `index`.
    pub(crate) fn view(&self, index: usize) -> Result<&[u8], GltfError> {
        self.view_data(index, named(&self.document.buffer_views, index, "buffer view")?)
    }

    fn view_data(&self, index: usize, view: &BufferView) -> Result<&[u8], GltfError> {
        const PACKED: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
        if let Some(name) =
            view.extensions.as_ref().and_then(|all| PACKED.into_iter().find(|name| all.contains_key(*name)))
        {
            return Err(wrong(format!("buffer view {index} packed by `{name}`"), "data that is not packed"));
        }
        let buffer = named(&self.document.buffers, view.buffer, "buffer")?;
        let Some(data) = self.buffers.get(view.buffer).and_then(Option::as_deref) else {
            return Err(if buffer.uri.is_some() {
                wrong(format!("buffer view {index} in another file"), "all data in this file")
            } else {
                wrong(format!("buffer {} without data", view.buffer), FILE)
            });
        };
        let Some(data) = data.get(..buffer.byte_length) else {
            let found = format!("a buffer of {} bytes", buffer.byte_length);
            return Err(wrong(found, format!("at most the {} of the data", data.len())));
        };
        let end = view.byte_offset.checked_add(view.byte_length);
        end.and_then(|end| data.get(view.byte_offset..end)).ok_or_else(|| {
            let found = format!("buffer view {index} of {} bytes at {}", view.byte_length, view.byte_offset);
            wrong(found, format!("inside the buffer of {} bytes", data.len()))
        })
    }

    /// Bytes of all buffers that were read from elsewhere.
    pub(crate) fn outside(&self) -> usize {
        let owned = |slot: &Option<Cow<'_, [u8]>>| match slot {
            Some(Cow::Owned(data)) => data.len(),
            _ => 0,
        };
        self.buffers.iter().map(owned).sum()
    }
}

/// Refuses a text of another version than 2.x, or one that needs more than 2.0 (glTF 2.0, section 3.2): its numbers may
/// mean something else.
fn refuse_versions(document: &Document) -> Result<(), GltfError> {
    let parse = |text: &str| {
        let (major, minor) = text.split_once('.')?;
        Some((major.parse::<u32>().ok()?, minor.parse::<u32>().ok()?))
    };
    let Asset { version, min_version } = &document.asset;
    if let Some(least) = min_version
        && parse(least).is_none_or(|least| least > (2, 0))
    {
        return Err(wrong(format!("glTF that needs version {}", quote(least)), "2.0"));
    }
    match version {
        None => Err(wrong("an `asset` without `version`", "`\"version\": \"2.0\"`")),
        Some(version) if parse(version).is_none_or(|(major, _)| major != 2) => {
            Err(wrong(format!("glTF version {}", quote(version)), "2.0"))
        }
        Some(_) => Ok(()),
    }
}

/// What a buffer must be.
const FILE: &str = "data in the file, or a file beside it";

/// The text of a GLB, the byte at which its chunk begins, and its data.
#[allow(clippy::type_complexity, reason = "three things of one header")]
fn chunks(bytes: &[u8]) -> Result<(&[u8], usize, Option<&[u8]>), GltfError> {
    let version = u32::from_le_bytes(array(bytes, 4)?);
    if version != 2 {
        return Err(GltfError::byte(4, format!("glTF version {version}"), "2"));
    }
    let length = u32::from_le_bytes(array(bytes, 8)?) as usize;
    let Some(whole) = bytes.get(..length) else {
        return Err(GltfError::byte(8, format!("a length of {length} bytes"), format!("at most {}", bytes.len())));
    };
    let text = chunk(whole, 12, *b"JSON")?;
    let after = TEXT + text.len();
    // A file without data has no second chunk.
    let data = if after < whole.len() { chunk(whole, after, *b"BIN\0")? } else { &[] };
    Ok((text, 12, Some(data)))
}

/// Bytes of a text outside its strings, and the first of each string: what decides how large its parsed form is.
fn without_strings(text: &[u8]) -> usize {
    /// Longer strings cost what they are long.
    const LONG: usize = 64;
    let (mut total, mut inside, mut escaped, mut run) = (0, false, false, 0_usize);
    for &byte in text {
        run = if inside { run + 1 } else { 0 };
        total += usize::from(run < LONG);
        match byte {
            b'"' if !escaped => inside = !inside,
            _ => {}
        }
        escaped = inside && byte == b'\\' && !escaped;
    }
    total
}

/// The content of the chunk at `at`.
fn chunk(bytes: &[u8], at: usize, kind: [u8; 4]) -> Result<&[u8], GltfError> {
    let length = u32::from_le_bytes(array(bytes, at)?) as usize;
    let found: [u8; 4] = array(bytes, at + 4)?;
    if found != kind {
        let text = |kind: &[u8]| quote(&String::from_utf8_lossy(kind));
        return Err(GltfError::byte(at + 4, format!("chunk {}", text(&found)), text(&kind)));
    }
    let end = (at + 8).saturating_add(length);
    bytes.get(at + 8..end).ok_or_else(|| {
        let left = bytes.len() - (at + 8);
        GltfError::byte(at, format!("a chunk of {length} bytes"), format!("at most {left}"))
    })
}

fn array<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], GltfError> {
    let found = bytes.get(at..).and_then(<[u8]>::first_chunk::<N>);
    found.copied().ok_or_else(|| GltfError::byte(at, "the end of the file", format!("{N} bytes")))
}

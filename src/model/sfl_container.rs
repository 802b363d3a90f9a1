//! The container of `Pointshop3D`'s .sfl files: a big-endian tree of tagged directories, in the manner of TIFF.
//!
//! ```text
//!  0  "GFLF"
//!  4  u32 container version 0
//!  8  "SFLF"
//! 12  u32 format version 0
//! 16  u32 offset of the root directory
//! directory = entries of 12 bytes: u16 tag, u16 type, u32 count, u32 value or offset
//! ```
//! A directory ends with the first entry whose tag is UPLINK, LINK or DOWNLINK; its value is the next directory in
//! depth-first order, 0 after the last. So the tree is read as a chain, and its levels are known by the tags in it.

use std::collections::HashSet;

use super::error::{ParseError, quote};

/// Most directories. Real files have far fewer (3 levels of sets and resolutions).
const MAX_DIRECTORIES: usize = 100_000;

const UPLINK: u16 = 0;
const DOWNLINK: u16 = 2;

/// One tagged value of a directory.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    tag: u16,
    kind: u16,
    count: u32,
    /// Offset of the entry itself.
    at: usize,
}

/// One directory.
#[derive(Clone, Debug)]
pub(super) struct Directory {
    pub(super) at: usize,
    entries: Vec<Entry>,
}

/// The bytes of a file, with typed access to its entries.
#[derive(Clone, Copy)]
pub(super) struct Container<'a> {
    bytes: &'a [u8],
}

impl<'a> Container<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    /// All directories in depth-first order.
    pub(super) fn directories(&self) -> Result<Vec<Directory>, ParseError> {
        for (at, magic) in [(0, b"GFLF"), (8, b"SFLF")] {
            let found = self.array::<4>(at)?;
            if found != *magic {
                return Err(ParseError::byte(at, quote(&found), quote(magic)));
            }
        }
        for (at, what) in [(4, "container"), (12, "format")] {
            let version = self.u32(at)?;
            if version != 0 {
                return Err(ParseError::byte(at, format!("{what} version {version}"), "0"));
            }
        }
        let mut found = Vec::new();
        let mut seen = HashSet::new();
        let mut named_at = 16;
        loop {
            let at = self.u32(named_at)? as usize;
            if at == 0 && !found.is_empty() {
                return Ok(found);
            }
            if at < 20 || at >= self.bytes.len() {
                let end = self.bytes.len();
                return Err(ParseError::byte(named_at, format!("directory offset {at}"), format!("20 to {}", end - 1)));
            }
            if !seen.insert(at) {
                return Err(ParseError::byte(
                    named_at,
                    format!("directory {at} a second time"),
                    "a tree without cycles",
                ));
            }
            if found.len() == MAX_DIRECTORIES {
                return Err(ParseError::byte(named_at, "yet another directory", format!("at most {MAX_DIRECTORIES}")));
            }
            let (directory, last) = self.directory(at)?;
            found.push(directory);
            named_at = last + 8;
        }
    }

    /// Entries up to the link that ends the directory, and the offset of that link.
    fn directory(&self, at: usize) -> Result<(Directory, usize), ParseError> {
        let mut entries = Vec::new();
        let mut entry_at = at;
        loop {
            let tag = u16::from_be_bytes(self.array(entry_at)?);
            if (UPLINK..=DOWNLINK).contains(&tag) {
                return Ok((Directory { at, entries }, entry_at));
            }
            let kind = u16::from_be_bytes(self.array(entry_at + 2)?);
            entries.push(Entry { tag, kind, count: self.u32(entry_at + 4)?, at: entry_at });
            entry_at += 12;
        }
    }

    /// The whole numbers of a tag, of any unsigned or signed integer type; `None` if the directory has no such tag.
    pub(super) fn integers(&self, directory: &Directory, tag: u16) -> Result<Option<Vec<i64>>, ParseError> {
        let Some(entry) = directory.get(tag) else { return Ok(None) };
        let data = self.data(entry)?;
        let values = match entry.kind {
            0 => data.iter().map(|b| i64::from(*b)).collect(),
            1 => data.iter().map(|b| i64::from(b.cast_signed())).collect(),
            2 => data.as_chunks().0.iter().map(|b| i64::from(u16::from_be_bytes(*b))).collect(),
            3 => data.as_chunks().0.iter().map(|b| i64::from(i16::from_be_bytes(*b))).collect(),
            4 => data.as_chunks().0.iter().map(|b| i64::from(u32::from_be_bytes(*b))).collect(),
            5 => data.as_chunks().0.iter().map(|b| i64::from(i32::from_be_bytes(*b))).collect(),
            kind => return Err(entry.fault(format!("type {kind}"), "a whole-number type, 0 to 5")),
        };
        Ok(Some(values))
    }

    /// The first whole number of a tag; `None` if there is none. It must not be negative.
    pub(super) fn integer(&self, directory: &Directory, tag: u16) -> Result<Option<usize>, ParseError> {
        let Some(values) = self.integers(directory, tag)? else { return Ok(None) };
        match (directory.get(tag), values.first().map(|v| usize::try_from(*v))) {
            (_, Some(Ok(value))) => Ok(Some(value)),
            (Some(entry), _) => Err(entry.fault(format!("{values:?}"), "a whole number, not negative")),
            (None, _) => Ok(None),
        }
    }

    /// The `N` finite floats of a tag; `None` if the directory has no such tag.
    pub(super) fn floats<const N: usize>(
        &self,
        directory: &Directory,
        tag: u16,
    ) -> Result<Option<[f64; N]>, ParseError> {
        let Some(entry) = directory.get(tag) else { return Ok(None) };
        let data = self.data(entry)?;
        let values: Vec<f64> = match entry.kind {
            6 => data.as_chunks().0.iter().map(|b| f64::from(f32::from_be_bytes(*b))).collect(),
            7 => data.as_chunks().0.iter().map(|b| f64::from_be_bytes(*b)).collect(),
            kind => return Err(entry.fault(format!("type {kind}"), "a float type, 6 or 7")),
        };
        match <[f64; N]>::try_from(values.as_slice()) {
            Ok(values) if values.iter().all(|v| v.is_finite()) => Ok(Some(values)),
            Ok(_) => Err(entry.fault("a value that is not finite", "finite numbers")),
            Err(_) => Err(entry.fault(format!("{} numbers", values.len()), format!("{N}"))),
        }
    }

    /// A block of bytes and where it begins; `None` if the directory has no such tag.
    pub(super) fn block(&self, directory: &Directory, tag: u16) -> Result<Option<(usize, &'a [u8])>, ParseError> {
        let Some(entry) = directory.get(tag) else { return Ok(None) };
        let at = self.u32(entry.at + 8)? as usize;
        let block = self.slice(entry, at, entry.count as usize)?;
        Ok(Some((at, block)))
    }

    /// The bytes of an entry: in the entry itself where they fit into four bytes, else at an offset.
    fn data(&self, entry: Entry) -> Result<&'a [u8], ParseError> {
        let size = match entry.kind {
            0 | 1 | 8 | 9 => 1,
            2 | 3 => 2,
            4 | 5 | 6 | 11 => 4,
            7 | 12 => 8,
            kind => return Err(entry.fault(format!("type {kind}"), "a type from 0 to 12 that holds values")),
        };
        let Some(length) = (entry.count as usize).checked_mul(size) else {
            return Err(entry.fault(format!("{} values", entry.count), "as many as the file can hold"));
        };
        let at = if length <= 4 { entry.at + 8 } else { self.u32(entry.at + 8)? as usize };
        self.slice(entry, at, length)
    }

    fn slice(&self, entry: Entry, at: usize, length: usize) -> Result<&'a [u8], ParseError> {
        let range = at..at.saturating_add(length);
        self.bytes.get(range).ok_or_else(|| {
            let size = self.bytes.len();
            entry.fault(format!("{length} bytes at offset {at}"), format!("bytes inside the file of {size} bytes"))
        })
    }

    fn u32(&self, at: usize) -> Result<u32, ParseError> {
        Ok(u32::from_be_bytes(self.array(at)?))
    }

    fn array<const N: usize>(&self, at: usize) -> Result<[u8; N], ParseError> {
        let found = self.bytes.get(at..).and_then(<[u8]>::first_chunk::<N>);
        found.copied().ok_or_else(|| ParseError::byte(at, "the end of the file", format!("{N} bytes")))
    }
}

impl Directory {
    pub(super) fn has(&self, tag: u16) -> bool {
        self.get(tag).is_some()
    }

    /// An error about this directory as a whole.
    pub(super) fn fault(&self, found: impl Into<String>, expected: impl Into<String>) -> ParseError {
        ParseError::byte(self.at, found, expected)
    }

    fn get(&self, tag: u16) -> Option<Entry> {
        self.entries.iter().find(|e| e.tag == tag).copied()
    }
}

impl Entry {
    fn fault(self, found: impl Into<String>, expected: impl Into<String>) -> ParseError {
        ParseError::byte(self.at, found, expected).of(&format!("tag {:04x}", self.tag))
    }
}

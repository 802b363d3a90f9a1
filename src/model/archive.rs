//! Zip archives: those of captures (SOG) and of arrays (`.npz`).

/// Is this a zip archive whose first file is an array of `NumPy`?
pub(super) fn begins_with_npy(bytes: &[u8]) -> bool {
    const NAME_AT: usize = 30;
    let length = bytes.get(26..28).map_or(0, |length| usize::from(u16::from_le_bytes([length[0], length[1]])));
    bytes.get(NAME_AT..NAME_AT + length).is_some_and(|name| name.ends_with(b".npy"))
}

#[cfg(feature = "formats")]
pub(super) use self::reading::Archive;

#[cfg(feature = "formats")]
mod reading {
    use std::borrow::Cow;
    use std::io::{Cursor, Read};

    use zip::ZipArchive;

    use crate::model::error::{ParseError, quote};

    /// An archive in memory.
    pub(in crate::model) struct Archive<'a> {
        zip: ZipArchive<Cursor<&'a [u8]>>,
        expected: &'static str,
    }

    impl<'a> Archive<'a> {
        /// `expected`: what it is to be, for messages.
        pub(in crate::model) fn open(bytes: &'a [u8], expected: &'static str) -> Result<Self, ParseError> {
            let zip = ZipArchive::new(Cursor::new(bytes));
            let fault = |e| ParseError::byte(0, format!("a damaged zip archive ({e})"), expected);
            Ok(Self { zip: zip.map_err(fault)?, expected })
        }

        /// Is there a file of this name?
        pub(in crate::model) fn has(&self, name: &str) -> bool {
            self.zip.index_for_name(name).is_some()
        }

        /// The names of its files, in order.
        pub(in crate::model) fn names(&self) -> Vec<String> {
            self.zip.file_names().filter_map(Result::ok).map(Cow::into_owned).collect()
        }

        /// Where an entry begins, and its content of at most `most` bytes.
        pub(in crate::model) fn entry(&mut self, name: &str, most: usize) -> Result<(usize, Vec<u8>), ParseError> {
            let shown = quote(name.as_bytes());
            let mut entry = self.zip.by_name(name).map_err(|e| {
                ParseError::byte(0, format!("an archive with no readable entry {shown} ({e})"), self.expected)
            })?;
            let at = entry.data_start().map_or(0, |at| at as usize);
            let too_long = |size: &str| {
                ParseError::byte(at, format!("an entry {shown} of {size} bytes"), format!("at most {most}"))
            };
            if entry.size() > most as u64 {
                return Err(too_long(&entry.size().to_string()));
            }
            // What the archive says of the size may be less than what comes.
            let mut content = Vec::new();
            let read = entry.by_ref().take(most as u64 + 1).read_to_end(&mut content);
            read.map_err(|e| ParseError::byte(at, format!("a damaged entry {shown} ({e})"), "what its checksum says"))?;
            if content.len() > most { Err(too_long("more")) } else { Ok((at, content)) }
        }
    }
}

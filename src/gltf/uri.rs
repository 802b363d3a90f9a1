//! Other files that a file names, and data in place of a name.
//!
//! A file may name only what lies in its own folder or below: names that lead out, by `..`, by a root, by a scheme or
//! by a link, are refused. So a scene that keeps to one folder stays there.

use std::borrow::Cow;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use base64::alphabet;
use base64::engine::{DecodePaddingMode, Engine as _, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::percent_decode_str;

use super::error::quote;
use crate::files::{self, InputError};

/// Largest file that is read beside another, bytes.
const MOST_BYTES: u64 = 1 << 30;

/// The data of a `data:` URI; `None` for other URIs, an error text where it is not base64.
pub(crate) fn inline(uri: &str) -> Option<Result<Vec<u8>, String>> {
    let rest = uri.get(..5).filter(|scheme| scheme.eq_ignore_ascii_case("data:")).and_then(|_| uri.get(5..))?;
    let Some((kind, text)) = rest.split_once(',') else {
        return Some(Err(format!("{} without a comma", quote(uri))));
    };
    if kind.rsplit(';').next() != Some("base64") {
        return Some(Err(format!("{} that is not base64", quote(uri))));
    }
    Some(base64(text.as_bytes()).ok_or_else(|| format!("{} with bad base64", quote(uri))))
}

/// Base64 of RFC 4648, section 4; padding may be left out.
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    /// Some programs leave bits after the last byte.
    const CONFIG: GeneralPurposeConfig = GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::RequireNone)
        .with_decode_allow_trailing_bits(true);
    let text = text.trim_ascii();
    let text = text.strip_suffix(b"==").or_else(|| text.strip_suffix(b"=")).unwrap_or(text);
    GeneralPurpose::new(&alphabet::STANDARD, CONFIG).decode(text).ok()
}

/// `%20` and the like as the bytes that they stand for; anything else as it is.
fn unescaped(uri: &str) -> String {
    percent_decode_str(uri).decode_utf8().map_or_else(|_| uri.to_owned(), Cow::into_owned)
}

/// The file that a relative name means beside the file `path`; an error text where it leads out of that folder.
pub(crate) fn beside(path: &Path, name: &str) -> Result<PathBuf, String> {
    let leads_out = || format!("{} which leads out of the folder", quote(name));
    let mut depth = 0_usize;
    let mut inside = PathBuf::new();
    for part in name.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                depth = depth.checked_sub(1).ok_or_else(leads_out)?;
                inside.pop();
            }
            // A colon is a scheme or a drive, and a backslash a folder elsewhere.
            part if part.contains([':', '\\', '\0']) => return Err(leads_out()),
            part => {
                depth += 1;
                inside.push(part);
            }
        }
    }
    if name.starts_with('/') {
        return Err(leads_out());
    }
    if depth == 0 {
        return Err(format!("{} which names no file", quote(name)));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let found = folder.join(inside);
    let root = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    if let (Ok(real), Ok(root)) = (found.canonicalize(), root.canonicalize())
        && !real.starts_with(root)
    {
        return Err(leads_out());
    }
    Ok(found)
}

/// The file beside `path` that a URI means; an error text where it leads out of the folder.
pub(crate) fn find_beside(path: &Path, uri: &str) -> Result<PathBuf, String> {
    // Some programs write names with a `%` that escapes nothing.
    let decoded = beside(path, &unescaped(uri));
    match decoded {
        Ok(file) if file.exists() => Ok(file),
        decoded => beside(path, uri).ok().filter(|file| file.exists()).map_or(decoded, Ok),
    }
}

/// The bytes of a file beside `path`, by its URI; an error text where there are none.
pub(crate) fn read_beside(path: &Path, uri: &str) -> Result<Vec<u8>, String> {
    let found = find_beside(path, uri)?;
    read(&found).map_err(|why| format!("{} which {why}", quote(uri)))
}

/// The bytes of a regular file; else why not, as `is missing`.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, String> {
    files::read(path, MOST_BYTES).map_err(|why| match why {
        InputError::Io(why) if why.kind() == ErrorKind::NotFound => "is missing".to_owned(),
        InputError::NotAFile { found } => format!("is {found}, expected a regular file"),
        InputError::TooLarge { bytes, most } => format!("has {bytes} bytes, more than {most}"),
        other => format!("cannot be read: {other}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_read_with_and_without_padding() {
        for (text, bytes) in [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm8", "fo"), ("Zm9vYmE=", "fooba")] {
            assert_eq!(base64(text.as_bytes()).unwrap(), bytes.as_bytes(), "{text}");
        }
        // The last letter of the second has bits after the last byte.
        assert_eq!(base64(b"Zh==").unwrap(), b"f");
        for text in ["Z", "Zg=g", "Z!", "Zm9v YmE=", "Zg==="] {
            assert!(base64(text.as_bytes()).is_none(), "{text}");
        }
        assert_eq!(inline("data:application/octet-stream;base64,Zm8=").unwrap().unwrap(), b"fo");
        assert!(inline("data:text/plain,fo").unwrap().is_err());
        assert!(inline("DATA:;base64").unwrap().is_err());
        assert!(inline("fo.bin").is_none());
    }

    #[test]
    fn names_stay_in_their_folder() {
        let beside = |name: &str| beside(Path::new("a/b.gltf"), name);
        assert_eq!(beside("x y.bin").unwrap(), Path::new("a/x y.bin"));
        assert_eq!(beside("./t/../x.bin").unwrap(), Path::new("a/x.bin"));
        for out in ["../x.bin", "t/../../x.bin", "/x.bin", "http://x/y", "C:\\x", "", ".", "t/.."] {
            assert!(beside(out).is_err(), "{out}");
        }
        assert_eq!(unescaped("a%20b%zz%%+f"), "a b%zz%%+f");
        assert_eq!(unescaped("%ff"), "%ff");
    }
}

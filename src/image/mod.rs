//! Pictures to files and back. A file appears whole or not at all: it is written under a temporary name, then renamed.
//!
//! A file carries the settings that it was made with, as text: a PNG file in an `iTXt` chunk, an EXR file in a header
//! attribute, both named [`SETTINGS`]. It carries nothing that would differ between two runs, such as the time or the
//! computer's name. The same picture, format and settings give the same bytes.

mod display;
mod exr;
mod format;
mod legend;
mod png;
mod radiance;
mod response;

use std::io::{self, Read, Seek};
use std::path::{Path, PathBuf};

pub use self::display::{Display, ViewTransform};
pub use self::format::{Bits, Compression, Exr, Format, Precision};
pub use self::legend::draw_legends;
pub use self::response::{Response, ResponseError};
use crate::files::{self, Changed, InputError};
use crate::film::Picture;

/// Name of the PNG chunk and of the EXR attribute that hold the settings.
pub const SETTINGS: &str = "splatblur";

/// Greatest width and height in pixels.
pub const MAX_SIZE: u32 = Picture::MAX_SIZE;

/// Deflate, which PNG and EXR use, shrinks by at most this factor: a file that promises more is damaged.
const DEFLATE_LIMIT: u64 = 1032;

/// Pixels of so many bytes are read whatever the length of the file: an empty 4K frame with all AOVs takes 365 MB.
const READ_ALWAYS: u64 = 1 << 29;

/// Beyond [`READ_ALWAYS`], pixels in memory may take this many times the length of the file.
const READ_RATIO: u64 = 256;

/// Why a picture could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The picture has no pixels, or too many.
    #[error("a picture of {width} x {height} pixels cannot be written (each side: 1 to {MAX_SIZE})")]
    Size {
        /// Width.
        width: u32,
        /// Height.
        height: u32,
    },
    /// A plane has not one value a pixel.
    #[error("picture channel `{channel}` has {found} values, expected {expected}")]
    Length {
        /// The channel.
        channel: String,
        /// Values found.
        found: usize,
        /// Pixels.
        expected: usize,
    },
    /// A layer has the wrong number of planes, or appears twice.
    #[error("picture layer `{layer}`: {what}")]
    Layer {
        /// The layer.
        layer: &'static str,
        /// The fault.
        what: String,
    },
    /// NaN, or infinite colour.
    #[error("picture channel `{channel}` is {value} at pixel ({x}, {y})")]
    NotFinite {
        /// The channel.
        channel: String,
        /// Column.
        x: usize,
        /// Row, from the top.
        y: usize,
        /// The value.
        value: f32,
    },
    /// Half-precision numbers end at 65504.
    #[error(
        "picture channel `{channel}` is {value} at pixel ({x}, {y}); half-precision EXR ends at 65504, 32-bit EXR does \
         not"
    )]
    BeyondHalf {
        /// The channel.
        channel: String,
        /// Column.
        x: usize,
        /// Row, from the top.
        y: usize,
        /// The value.
        value: f32,
    },
    /// PNG holds colour and alpha only.
    #[error("PNG cannot hold the layer `{layer}`; EXR can")]
    PngLayer {
        /// The first layer.
        layer: &'static str,
    },
    /// The name of a file to be written tells no format.
    #[error("cannot write {}: the name ends in neither .png nor .exr", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The encoder failed.
    #[error("cannot encode the picture: {what}")]
    Encode {
        /// What the encoder says.
        what: String,
    },
    /// The file could not be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file could not be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file changes while it is read.
    #[error(transparent)]
    Changed(#[from] Changed),
    /// The file is not a picture that can be read.
    #[error("{}: {what}", path.display())]
    Decode {
        /// The file.
        path: PathBuf,
        /// The fault in it.
        what: String,
    },
}

impl Picture {
    /// Writes the picture to a file, which appears whole or not at all. What was there is replaced.
    ///
    /// The extension names the format: `.png` (8 bits a channel, sRGB, straight alpha) or `.exr` (32-bit float, linear,
    /// premultiplied). A PNG file has an alpha channel if a pixel is not opaque.
    ///
    /// # Errors
    /// The extension is neither, a value is not finite, PNG cannot hold the picture's layers, or the file cannot be
    /// written.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), ImageError> {
        let path = path.as_ref();
        let alpha = self.rgba.iter().any(|pixel| pixel[3] < 1.0);
        let format = Format::of(path, alpha).ok_or_else(|| ImageError::UnknownFormat { path: path.to_owned() })?;
        write(path, self, format, "")
    }

    /// The picture as 8-bit sRGB: R G B A, row by row from the top, 4 bytes a pixel, with straight alpha. They are the
    /// values of the PNG file that [`Self::write`] makes; alpha is 255 where that file has none. Layers are left out.
    ///
    /// # Errors
    /// A value is not finite, or the pixels do not fit the size.
    pub fn to_srgb8(&self) -> Result<Vec<u8>, ImageError> {
        srgb_codes(self, true)
    }

    /// Reads a picture from a PNG, EXR or Radiance HDR file, whatever its name, into linear premultiplied floats.
    ///
    /// # Errors
    /// The file cannot be read, or is no such picture.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, ImageError> {
        read(path.as_ref())
    }
}

/// The bytes of a picture file. They depend on the arguments alone.
///
/// # Errors
/// The picture is not valid, or the format cannot hold it.
pub fn encode(picture: &Picture, format: Format, settings: &str) -> Result<Vec<u8>, ImageError> {
    check(picture)?;
    match format {
        Format::Png { bits, alpha } => png::encode(picture, bits, alpha, Response::Srgb, settings),
        Format::Exr(options) => exr::encode(picture, options, settings, None),
    }
}

/// The codes of a picture that an 8-bit PNG file of it has, row by row: R G B or, with `alpha`, R G B A. Layers are
/// left out.
///
/// # Errors
/// The picture is not valid.
pub fn srgb_codes(picture: &Picture, alpha: bool) -> Result<Vec<u8>, ImageError> {
    check(picture)?;
    Ok(png::codes_8(picture, alpha))
}

/// As [`srgb_codes`], of a 16-bit PNG file.
///
/// # Errors
/// As [`srgb_codes`].
pub fn srgb_codes_16(picture: &Picture, alpha: bool) -> Result<Vec<u16>, ImageError> {
    check(picture)?;
    Ok(png::codes_16(picture, alpha))
}

/// As [`encode`]; an EXR file carries `comment`, which is no part of the settings.
///
/// # Errors
/// As [`encode`].
pub fn encode_with_comment(
    picture: &Picture,
    format: Format,
    settings: &str,
    comment: Option<&str>,
) -> Result<Vec<u8>, ImageError> {
    let Format::Exr(options) = format else { return encode(picture, format, settings) };
    check(picture)?;
    exr::encode(picture, options, settings, comment)
}

/// Writes a picture file, which appears whole or not at all.
///
/// # Errors
/// The picture is not valid, the format cannot hold it, or the file cannot be written.
pub fn write(path: &Path, picture: &Picture, format: Format, settings: &str) -> Result<(), ImageError> {
    let bytes = encode(picture, format, settings)?;
    files::replace(path, &bytes).map_err(|source| ImageError::Write { path: path.to_owned(), source })
}

/// As [`write()`]; an EXR file carries `comment`, which is no part of the settings.
///
/// # Errors
/// As [`write()`].
pub fn write_with_comment(
    path: &Path,
    picture: &Picture,
    format: Format,
    settings: &str,
    comment: &str,
) -> Result<(), ImageError> {
    let bytes = encode_with_comment(picture, format, settings, Some(comment))?;
    files::replace(path, &bytes).map_err(|source| ImageError::Write { path: path.to_owned(), source })
}

/// As [`write()`]; a PNG file has the codes of a camera with this `response` in place of sRGB. EXR stays linear.
///
/// # Errors
/// As [`write()`].
pub fn write_with_response(
    path: &Path,
    picture: &Picture,
    format: Format,
    response: Response,
    settings: &str,
) -> Result<(), ImageError> {
    let Format::Png { bits, alpha } = format else { return write(path, picture, format, settings) };
    check(picture)?;
    let bytes = png::encode(picture, bits, alpha, response, settings)?;
    files::replace(path, &bytes).map_err(|source| ImageError::Write { path: path.to_owned(), source })
}

/// Writes an EXR file of other numbers than colours: `channels` of floats by name, row by row, of a picture `width`
/// wide, and `meaning`, which says what they hold.
///
/// # Errors
/// A channel has not as many values as the first, or the file cannot be written.
pub fn write_planes(
    path: &Path,
    width: u32,
    channels: &[(&str, &[f32])],
    meaning: &str,
    settings: &str,
) -> Result<(), ImageError> {
    let expected = channels.first().map_or(0, |(_, plane)| plane.len());
    if expected == 0 || width == 0 || !expected.is_multiple_of(width as usize) {
        return Err(ImageError::Size { width, height: (expected / width.max(1) as usize) as u32 });
    }
    if let Some((name, plane)) = channels.iter().find(|(_, plane)| plane.len() != expected) {
        return Err(ImageError::Length { channel: (*name).to_owned(), found: plane.len(), expected });
    }
    let bytes = exr::encode_planes(width, channels, meaning, settings)?;
    files::replace(path, &bytes).map_err(|source| ImageError::Write { path: path.to_owned(), source })
}

/// Reads channels that [`write_planes`] wrote: the width of the picture, and for each name its values, row by row.
///
/// # Errors
/// The file cannot be read, is no EXR file, or lacks a channel.
pub fn read_planes(path: &Path, channels: &[&str]) -> Result<(u32, Vec<Vec<f32>>), ImageError> {
    let refused = |what: String| ImageError::Decode { path: path.to_owned(), what };
    let (width, planes) = files::steady(|| exr::decode_planes(&bytes(path)?, channels).map_err(refused))?;
    let missing = |(plane, name): (Option<Vec<f32>>, &&str)| {
        plane.ok_or_else(|| refused(format!("there is no channel `{name}`")))
    };
    Ok((width, planes.into_iter().zip(channels).map(missing).collect::<Result<_, _>>()?))
}

/// Reads a PNG or EXR picture, as written by [`write()`], or a Radiance one, into linear premultiplied floats.
///
/// # Errors
/// The file cannot be read, or is no such picture.
pub fn read(path: &Path) -> Result<Picture, ImageError> {
    files::steady(|| {
        let bytes = bytes(path)?;
        let decoded = match kind(&bytes) {
            Some(FileKind::Png) => png::decode(&bytes),
            Some(FileKind::Exr) => exr::decode(&bytes),
            Some(FileKind::Radiance) => radiance::decode(&bytes),
            None => Err("neither a PNG, an EXR nor a Radiance HDR file".to_owned()),
        };
        decoded.map_err(|what| ImageError::Decode { path: path.to_owned(), what })
    })
}

/// The settings that a picture file carries; `None` where there are none, or where the file is not readable.
///
/// Reads the header only.
pub fn read_settings(path: &Path) -> Option<String> {
    let mut file = io::BufReader::new(files::open(path).ok()?);
    let mut head = [0; 8];
    file.read_exact(&mut head).ok()?;
    file.rewind().ok()?;
    match kind(&head)? {
        FileKind::Png => png::settings(&mut file),
        FileKind::Exr => exr::settings(&mut file),
        FileKind::Radiance => None,
    }
}

/// True for a picture file that has all its pixels and nothing more: a PNG whose chunks are undamaged and end with
/// `IEND`, an EXR of one part whose blocks can all be read, or a Radiance picture with all its rows. The file ends
/// where its format ends.
///
/// A file that was cut short while it was copied keeps its header, and so its settings. One that goes on was spoilt.
pub fn is_whole(path: &Path) -> bool {
    let Ok(bytes) = files::read(path, u64::MAX) else { return false };
    match kind(&bytes) {
        Some(FileKind::Png) => png::is_whole(&bytes),
        Some(FileKind::Exr) => exr::is_whole(&bytes),
        Some(FileKind::Radiance) => radiance::is_whole(&bytes),
        None => false,
    }
}

#[derive(Clone, Copy)]
enum FileKind {
    Png,
    Exr,
    Radiance,
}

fn kind(head: &[u8]) -> Option<FileKind> {
    if head.starts_with(png::SIGNATURE) {
        Some(FileKind::Png)
    } else if head.starts_with(exr::SIGNATURE) {
        Some(FileKind::Exr)
    } else if head.starts_with(radiance::SIGNATURE) {
        Some(FileKind::Radiance)
    } else {
        None
    }
}

fn bytes(path: &Path) -> Result<Vec<u8>, ImageError> {
    files::read(path, u64::MAX).map_err(|why| match why {
        InputError::Changed(changed) => changed.into(),
        other => ImageError::Read { path: path.to_owned(), source: other.into() },
    })
}

/// Refuses pictures whose planes do not fit their size, and values that would hide a fault.
fn check(picture: &Picture) -> Result<(), ImageError> {
    let (width, height) = (picture.width, picture.height);
    if !(1..=MAX_SIZE).contains(&width) || !(1..=MAX_SIZE).contains(&height) {
        return Err(ImageError::Size { width, height });
    }
    let (w, expected) = (width as usize, width as usize * height as usize);
    let length = |channel: &dyn Fn() -> String, found: usize| {
        if found == expected { Ok(()) } else { Err(ImageError::Length { channel: channel(), found, expected }) }
    };
    length(&|| "RGBA".to_owned(), picture.rgba.len())?;
    for (i, pixel) in picture.rgba.iter().enumerate() {
        if let Some(c) = pixel.iter().position(|v| !v.is_finite()) {
            let channel = ["R", "G", "B", "A"][c].to_owned();
            return Err(ImageError::NotFinite { channel, x: i % w, y: i / w, value: pixel[c] });
        }
    }
    for (i, layer) in picture.layers.iter().enumerate() {
        let name = layer.aov.name();
        let (found, needed) = (layer.planes.len(), layer.aov.channels().len());
        if found != needed {
            return Err(ImageError::Layer { layer: name, what: format!("{found} planes, expected {needed}") });
        }
        if picture.layers[..i].iter().any(|l| l.aov == layer.aov) {
            return Err(ImageError::Layer { layer: name, what: "appears twice".to_owned() });
        }
        for (plane, channel) in layer.planes.iter().zip(layer.aov.channels()) {
            length(&|| format!("{name}.{channel}"), plane.len())?;
            // +inf is the depth of nothing.
            if let Some(at) = plane.iter().position(|v| v.is_nan()) {
                let channel = format!("{name}.{channel}");
                return Err(ImageError::NotFinite { channel, x: at % w, y: at / w, value: plane[at] });
            }
        }
    }
    Ok(())
}

/// Refuses what a damaged header promises, before memory is taken for it. `bytes_a_pixel` as stored; `ratio`: of stored
/// bytes to bytes of the file, at most.
fn plausible(width: u64, height: u64, bytes_a_pixel: u64, ratio: u64, file_length: usize) -> Result<(), String> {
    let limit = u64::from(MAX_SIZE);
    if !(1..=limit).contains(&width) || !(1..=limit).contains(&height) {
        return Err(format!("the header says {width} x {height} pixels, expected 1 to {MAX_SIZE} each"));
    }
    let promised = width * height * bytes_a_pixel;
    if promised > ratio.saturating_mul(file_length as u64) {
        return Err(format!("the header promises {promised} bytes of pixels; the file has only {file_length} bytes"));
    }
    // In memory a pixel takes four floats at the least, however few bits the file gives it.
    let memory = width * height * bytes_a_pixel.max(16);
    let limit = READ_ALWAYS.max(READ_RATIO.saturating_mul(file_length as u64));
    if memory > limit {
        return Err(format!(
            "{memory} bytes of pixels from a file of {file_length} bytes, expected at most {limit}: too much memory"
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_file_with_all_its_pixels_is_whole() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a");
        // Three blocks of an EXR file; noise, which does not shrink.
        let noise = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 24) as f32;
        let rgba = (0..20 * 40).map(|i| [noise(3 * i), noise(3 * i + 1), noise(3 * i + 2), 1.0]).collect();
        let picture = Picture { width: 20, height: 40, rgba, layers: Vec::new() };
        let is_whole = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            super::is_whole(&path)
        };
        for format in [Format::Png { bits: Bits::Eight, alpha: false }, Format::EXR] {
            let bytes = encode(&picture, format, "the settings").unwrap();
            assert!(is_whole(&bytes), "{format:?}");
            for length in (0..bytes.len()).step_by(61).chain([bytes.len() - 1]) {
                assert!(!is_whole(&bytes[..length]), "{format:?} cut to {length} of {}", bytes.len());
            }
            // As a download that was given its full length before its bytes came.
            let mut hollow = bytes.clone();
            hollow[bytes.len() / 2..].fill(0);
            assert!(!is_whole(&hollow), "{format:?}, half of it zeros");
            assert_eq!(read_settings(&path).as_deref(), Some("the settings"));
            for more in [&b"junk"[..], &[0], &bytes] {
                assert!(!is_whole(&[&bytes, more].concat()), "{format:?} and {} bytes after its end", more.len());
            }
        }
        for (_, compression) in Compression::ALL {
            let exr = Format::Exr(Exr { compression, ..Exr::default() });
            assert!(is_whole(&encode(&picture, exr, "").unwrap()), "{compression:?}");
        }
        assert!(!super::is_whole(directory.path()) && !is_whole(b""));
    }

    #[test]
    fn a_header_promises_no_more_than_a_file_can_hold() {
        // 80,000 bytes of pixels, and a tenth of them in the file.
        assert!(plausible(100, 100, 8, 10, 8_000).is_ok());
        assert!(plausible(100, 100, 8, 10, 7_999).unwrap_err().contains("80000 bytes"));
    }

    #[test]
    fn a_picture_is_written_in_the_format_that_the_extension_names() {
        let directory = tempfile::tempdir().unwrap();
        let path = |name: &str| directory.path().join(name);
        let mut picture = Picture { width: 2, height: 1, rgba: vec![[0.25, 0.5, 1.0, 1.0]; 2], layers: Vec::new() };
        let bytes = |picture: &Picture, name: &str| {
            picture.write(path(name)).unwrap();
            std::fs::read(path(name)).unwrap()
        };
        let png = |alpha| Format::Png { bits: Bits::Eight, alpha };
        assert!(bytes(&picture, "a.png") == encode(&picture, png(false), "").unwrap());
        assert!(bytes(&picture, "a.EXR") == encode(&picture, Format::EXR, "").unwrap());
        assert_eq!(Picture::read(path("a.EXR")).unwrap(), picture);
        picture.rgba[1] = [0.0; 4];
        assert!(bytes(&picture, "b.png") == encode(&picture, png(true), "").unwrap());
        for name in ["a.jpg", "a", ".png"] {
            let error = picture.write(path(name)).unwrap_err().to_string();
            assert!(error.ends_with("the name ends in neither .png nor .exr"), "{error}");
            assert!(!path(name).exists());
        }
    }
}

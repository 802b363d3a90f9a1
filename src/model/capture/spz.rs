//! SPZ files, versions 1 to 4: planes of bytes, one for each attribute, compressed.
//!
//! ```text
//! versions 1 to 3: one gzip stream of a header of 16 bytes and the planes
//! version 4: header of 32 bytes | extension records | table of streams | one Zstandard frame for each plane
//! header = "NGSP", u32 version, u32 count, u8 degree, u8 fractional bits, u8 flags, u8 streams (version 4), ..
//! planes = position, alpha, colour, scale, rotation, harmonics
//! ```
//! All numbers are little-endian. The frame is x right, y up, z back. The size of a plane follows from count and
//! degree, so a size that lies, and one that the length of the file cannot mean, is noticed before a plane is inflated.

use std::io::Read;

use flate2::bufread::GzDecoder;
use glam::Vec3;
use ruzstd::decoding::StreamingDecoder;

use super::{Gaussian, Gaussians, MOST_DEGREE, MOST_HARMONICS, harmonics_of};
use crate::model::error::{ParseError, quote};

/// The first bytes of version 4, and of what the older ones hold when inflated.
const MAGIC: [u8; 4] = *b"NGSP";
/// Bytes of the header that all versions share.
const HEADER: usize = 16;
/// Bytes of the header of version 4.
const LONG_HEADER: usize = 32;
/// Highest degree of harmonics that a file may have.
const FILE_DEGREE: u8 = 4;
/// Most fractional bits of a position. Its whole number has 24.
const MOST_FRACTION: u8 = 31;
/// Flag: trained with the filter of an antialiased rasteriser.
const ANTIALIASED: u8 = 1;
/// Flag: extension records lie between header and table.
const EXTENDED: u8 = 2;
/// Type of the extension record that names the axes.
const AXES: u32 = 0xADBE_0003;
/// Names of axes, from 1: left or right, up or down, front or back.
const AXES_NAMES: [&str; 8] = ["LDB", "RDB", "LUB", "RUB", "LDF", "RDF", "LUF", "RUF"];
/// Bytes of planes that every file may have, however small it is.
const FREE_BYTES: u64 = 4 << 20;
/// Most bytes of planes above [`FREE_BYTES`] for each byte of a file. Captures have 1 to 3; a bomb has a thousand.
const MOST_GROWTH: u64 = 50;
/// Largest window of a Zstandard frame: what every decoder has to support. A plane may be its own window.
const WINDOW: u64 = 8 << 20;
/// Signs of the harmonics of degrees 1 to 3 in the common frame: a turn by 180 degrees about x.
const SIGNS: [f32; MOST_HARMONICS] =
    [-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0];

/// Planes, in the order of the file.
const PLANES: [&str; 6] = ["position", "alpha", "colour", "scale", "rotation", "harmonics"];

/// Reads an SPZ file.
///
/// # Errors
/// The error names the byte. The version is unknown, sizes contradict the count, the file is cut short, or its axes are
/// others.
pub(in crate::model) fn parse(bytes: &[u8]) -> Result<Gaussians, ParseError> {
    if bytes.starts_with(&MAGIC) { parse_streams(bytes) } else { parse_gzip(bytes) }
}

/// What the header says.
struct Header {
    version: u32,
    count: usize,
    degree: u8,
    fraction: u8,
    flags: u8,
    /// Version 4 only.
    streams: u8,
}

impl Header {
    fn read(raw: [u8; HEADER]) -> Result<Self, ParseError> {
        let [m0, m1, m2, m3, v0, v1, v2, v3, c0, c1, c2, c3, degree, fraction, flags, streams] = raw;
        if [m0, m1, m2, m3] != MAGIC {
            return Err(ParseError::byte(0, quote(&raw[..4]), quote(&MAGIC)).of("the content of the gzip stream"));
        }
        let version = u32::from_le_bytes([v0, v1, v2, v3]);
        if !(1..=4).contains(&version) {
            return Err(ParseError::byte(4, format!("SPZ version {version}"), "1 to 4"));
        }
        if degree > FILE_DEGREE {
            return Err(ParseError::byte(12, format!("harmonics of degree {degree}"), format!("0 to {FILE_DEGREE}")));
        }
        if fraction > MOST_FRACTION {
            return Err(ParseError::byte(13, format!("{fraction} fractional bits"), format!("0 to {MOST_FRACTION}")));
        }
        let count = u32::from_le_bytes([c0, c1, c2, c3]) as usize;
        Ok(Self { version, count, degree, fraction, flags, streams })
    }

    /// Bytes of one Gaussian in each plane.
    fn widths(&self) -> [usize; 6] {
        let (position, rotation) = (if self.version == 1 { 6 } else { 9 }, if self.version < 3 { 3 } else { 4 });
        [position, 1, 3, 3, rotation, 3 * harmonics_of(self.degree)]
    }

    /// Bytes of each plane, if a file of `size` bytes may have that many.
    fn planes(&self, size: usize) -> Result<[usize; 6], ParseError> {
        let plain = self.widths().map(|width| width as u64 * self.count as u64);
        let most = FREE_BYTES.saturating_add(MOST_GROWTH.saturating_mul(size as u64));
        if plain.iter().sum::<u64>() > most {
            let found = format!("{} Gaussians of degree {}", self.count, self.degree);
            return Err(ParseError::byte(8, found, format!("at most {most} bytes of them in a file of {size} bytes")));
        }
        Ok(plain.map(|length| length as usize))
    }
}

/// Versions 1 to 3.
fn parse_gzip(bytes: &[u8]) -> Result<Gaussians, ParseError> {
    let mut stream = GzDecoder::new(bytes);
    let damaged = |why: std::io::Error| ParseError::byte(0, format!("a gzip stream that fails ({why})"), "a whole one");
    let mut raw = [0; HEADER];
    stream.read_exact(&mut raw).map_err(damaged)?;
    let header = Header::read(raw)?;
    if header.version > 3 {
        return Err(ParseError::byte(4, format!("SPZ version {} inside gzip", header.version), "1 to 3"));
    }
    let sizes = header.planes(bytes.len())?;
    let expected: usize = sizes.iter().sum();
    let plain = inflate(&mut stream, expected).map_err(damaged)?;
    if plain.len() < expected {
        let found = format!("{} bytes of planes", plain.len());
        return Err(ParseError::byte(0, found, format!("{expected} for {} Gaussians", header.count)));
    }
    let mut rest = &plain[..];
    let planes = sizes.map(|size| rest.split_off(..size).unwrap_or_default());
    let mut gaussians = header.gaussians(planes);
    if rest.is_empty() {
        note_surplus(&mut gaussians, stream.into_inner().len());
    } else {
        gaussians.notes.push("bytes after the last plane ignored".to_owned());
    }
    Ok(gaussians)
}

/// Version 4.
fn parse_streams(bytes: &[u8]) -> Result<Gaussians, ParseError> {
    let raw: [u8; LONG_HEADER] = array(bytes, 0)?;
    let header = Header::read(array(&raw, 0)?)?;
    if header.version != 4 {
        return Err(ParseError::byte(4, format!("SPZ version {} that is not gzip", header.version), "version 4"));
    }
    let table = u32::from_le_bytes(array(&raw, 16)?) as usize;
    if table < LONG_HEADER || table > bytes.len() {
        let expected = format!("{LONG_HEADER} to {}", bytes.len());
        return Err(ParseError::byte(16, format!("the table of streams at {table}"), expected));
    }
    if header.flags & EXTENDED != 0 {
        check_extensions(&bytes[..table])?;
    }
    let sizes = header.planes(bytes.len())?;
    let expected = sizes.iter().filter(|size| **size > 0).count();
    if usize::from(header.streams) != expected {
        let expected = format!("{expected} for {} Gaussians of degree {}", header.count, header.degree);
        return Err(ParseError::byte(15, format!("{} streams", header.streams), expected));
    }
    let (mut entry, mut at) = (table, table + 16 * expected);
    let mut planes: [Vec<u8>; 6] = Default::default();
    for ((plane, size), name) in planes.iter_mut().zip(sizes).zip(PLANES) {
        if size == 0 {
            continue;
        }
        let packed = u64::from_le_bytes(array(bytes, entry)?);
        let plain = u64::from_le_bytes(array(bytes, entry + 8)?);
        if plain != size as u64 {
            return Err(ParseError::byte(entry + 8, format!("{plain} plain bytes"), format!("{size}")).of(name));
        }
        let end = usize::try_from(packed).ok().and_then(|packed| at.checked_add(packed));
        let Some(stream) = end.and_then(|end| bytes.get(at..end)) else {
            let left = bytes.len().saturating_sub(at);
            return Err(ParseError::byte(entry, format!("{packed} packed bytes"), format!("at most {left}")).of(name));
        };
        *plane = unpack(stream, at, size).map_err(|fault| fault.of(name))?;
        at += stream.len();
        entry += 16;
    }
    let mut gaussians = header.gaussians(planes.each_ref().map(Vec::as_slice));
    note_surplus(&mut gaussians, bytes.len() - at);
    Ok(gaussians)
}

/// Refuses axes that are not ours to turn. Unknown records do not change the meaning of the planes.
fn check_extensions(bytes: &[u8]) -> Result<(), ParseError> {
    let mut at = LONG_HEADER;
    while at < bytes.len() {
        let kind = u32::from_le_bytes(array(bytes, at)?);
        let length = u32::from_le_bytes(array(bytes, at + 4)?) as usize;
        let payload = at + 8;
        let end = payload.saturating_add(length);
        let Some(record) = bytes.get(payload..end) else {
            let left = bytes.len() - payload;
            return Err(ParseError::byte(at + 4, format!("{length} bytes of a record"), format!("at most {left}")));
        };
        if kind == AXES {
            let axes = u32::from_le_bytes(array(record, 0).map_err(|_| {
                ParseError::byte(at + 4, format!("{length} bytes"), "4 (the record that names the axes)")
            })?);
            if axes != 0 && axes != 4 {
                let name = (axes as usize).checked_sub(1).and_then(|index| AXES_NAMES.get(index));
                let name = name.map(|name| format!(" ({name})")).unwrap_or_default();
                return Err(ParseError::byte(payload, format!("axes {axes}{name}"), "0 (not said) or 4 (RUB)"));
            }
        }
        at = end;
    }
    Ok(())
}

/// The plane of one Zstandard frame, which lies at `at`.
fn unpack(frame: &[u8], at: usize, size: usize) -> Result<Vec<u8>, ParseError> {
    let damaged = |why: String| ParseError::byte(at, format!("a Zstandard frame that fails ({why})"), "a whole one");
    // The decoder allocates a window ahead of the data.
    let window = WINDOW.max(size as u64);
    let mut stream =
        StreamingDecoder::new_with_max_window_size(frame, window).map_err(|why| damaged(one_line(&why)))?;
    let plain = inflate(&mut stream, size).map_err(|why| damaged(one_line(&why)))?;
    let left = stream.into_inner().len();
    if plain.len() == size && left == 0 {
        return Ok(plain);
    }
    let found = match plain.len() {
        more if more > size => format!("a frame of more than {size} bytes"),
        less if less < size => format!("a frame of {less} bytes"),
        _ => format!("{left} bytes after the frame"),
    };
    Err(ParseError::byte(at, found, format!("one frame of {size} bytes")))
}

/// Text of an error of another crate: short and on one line.
fn one_line(why: &impl ToString) -> String {
    why.to_string().split_whitespace().collect::<Vec<_>>().join(" ").chars().take(120).collect()
}

/// What a stream holds, up to one byte more than expected. Memory grows with the data that arrives.
fn inflate(stream: &mut impl Read, expected: usize) -> std::io::Result<Vec<u8>> {
    let mut plain = Vec::new();
    stream.take(expected as u64 + 1).read_to_end(&mut plain)?;
    Ok(plain)
}

fn note_surplus(gaussians: &mut Gaussians, surplus: usize) {
    if surplus > 0 {
        gaussians.notes.push(format!("{surplus} bytes after the last stream ignored"));
    }
}

fn array<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], ParseError> {
    let found = bytes.get(at..).and_then(<[u8]>::first_chunk::<N>);
    found.copied().ok_or_else(|| ParseError::byte(at, "the end of the file", format!("{N} bytes")))
}

impl Header {
    /// Decodes planes of the sizes that [`Self::planes`] gives.
    fn gaussians(&self, planes: [&[u8]; 6]) -> Gaussians {
        let mut gaussians = Gaussians::of_degree(self.degree);
        gaussians.antialiased = self.flags & ANTIALIASED != 0;
        gaussians.turned = Some("180 degrees about x");
        let kept = gaussians.harmonics_each();
        let [position, alpha, colour, scale, rotation, harmonics] = planes;
        let [position_width, _, _, _, rotation_width, harmonics_width] = self.widths();
        let step = (-f64::from(self.fraction)).exp2();
        let colours = colour.as_chunks::<3>().0.iter().zip(scale.as_chunks::<3>().0);
        let frames = position.chunks_exact(position_width).zip(rotation.chunks_exact(rotation_width));
        for (index, ((alpha, (colour, scale)), (place, turn))) in alpha.iter().zip(colours).zip(frames).enumerate() {
            let [x, y, z] = if self.version == 1 { half_floats(place) } else { fixed_points(place, step) };
            let [rw, rx, ry, rz] = if self.version < 3 { three_bytes(turn) } else { smallest_three(turn) };
            let mut gaussian = Gaussian {
                position: [x, -y, -z],
                sigma: scale.map(|b| (f64::from(b) / 16.0 - 10.0).exp()),
                rotation: [rw, rx, -ry, -rz],
                opacity: f64::from(*alpha) / 255.0,
                base: colour.map(|b| (f64::from(b) / 255.0 - 0.5) / 0.15),
                harmonics: [Vec3::ZERO; MOST_HARMONICS],
            };
            let own = harmonics.get(index * harmonics_width..).unwrap_or_default().as_chunks::<3>().0;
            let coefficients = gaussian.harmonics[..kept].iter_mut().zip(own).zip(SIGNS);
            for ((harmonic, bytes), sign) in coefficients {
                *harmonic = sign * Vec3::from_array(bytes.map(|b| (f32::from(b) - 128.0) / 128.0));
            }
            gaussians.push(&gaussian);
        }
        if self.degree > MOST_DEGREE {
            gaussians.notes.push(format!("Gaussian splats: harmonics of degree {} ignored", self.degree));
        }
        gaussians
    }
}

/// Three signed numbers of 24 bits.
fn fixed_points(bytes: &[u8], step: f64) -> [f64; 3] {
    let mut place = [0.0; 3];
    for (coordinate, [low, middle, high]) in place.iter_mut().zip(bytes.as_chunks::<3>().0) {
        *coordinate = f64::from(i32::from_le_bytes([0, *low, *middle, *high]) >> 8) * step;
    }
    place
}

/// Three numbers of 16 bits, IEEE 754.
fn half_floats(bytes: &[u8]) -> [f64; 3] {
    let mut place = [0.0; 3];
    for (coordinate, raw) in place.iter_mut().zip(bytes.as_chunks::<2>().0) {
        let raw = u16::from_le_bytes(*raw);
        let (exponent, fraction) = (i32::from(raw >> 10 & 31), f64::from(raw & 1023));
        let size = match exponent {
            0 => fraction * (-24.0_f64).exp2(),
            // Infinite, or not a number: not drawn either way.
            31 => f64::INFINITY,
            _ => (1024.0 + fraction) * f64::from(exponent - 25).exp2(),
        };
        *coordinate = if raw >> 15 == 0 { size } else { -size };
    }
    place
}

/// w, x, y, z of x, y and z in a byte each.
fn three_bytes(bytes: &[u8]) -> [f64; 4] {
    let [x, y, z] = bytes.first_chunk().copied().unwrap_or([128; 3]).map(|b| f64::from(b) / 127.5 - 1.0);
    [(1.0 - x * x - y * y - z * z).max(0.0).sqrt(), x, y, z]
}

/// w, x, y, z of the three smallest in 10 bits each and the index of the largest, which is positive.
fn smallest_three(bytes: &[u8]) -> [f64; 4] {
    let mut raw = u32::from_le_bytes(bytes.first_chunk().copied().unwrap_or_default());
    let largest = (raw >> 30) as usize;
    let mut xyzw = [0.0; 4];
    let mut rest = 1.0;
    for index in (0..4).rev().filter(|index| *index != largest) {
        let size = f64::from(raw & 511) / 511.0 * std::f64::consts::FRAC_1_SQRT_2;
        xyzw[index] = if raw & 512 == 0 { size } else { -size };
        rest -= size * size;
        raw >>= 10;
    }
    xyzw[largest] = rest.max(0.0).sqrt();
    let [x, y, z, w] = xyzw;
    [w, x, y, z]
}

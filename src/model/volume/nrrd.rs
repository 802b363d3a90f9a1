//! NRRD files with their data in the same file (`NRRD0001` to `NRRD0005`; raw, text, gzip).
//!
//! The header (`nrrd_header`) says how many bytes of values there are, so a size that lies is noticed before anything
//! is allocated. Values become `f32`, 4 bytes each, whatever their type is. Gzip may pack a thousand bytes into one,
//! and smoke is mostly zeros. So the number of values is bounded by [`most_values`].

use std::io::{self, Read};

use super::grid::Grid;
use super::nrrd_header::{self, Encoding, Header, Type};
use crate::model::error::{ParseError, line_of, quote};
use crate::model::ply_body::number;

/// Values that every file may have, however small it is: 512 x 512 x 512.
const FREE_VALUES: u64 = 1 << 27;

/// Most values above [`FREE_VALUES`] for each byte of a file. A raw file has one at most.
const MOST_VALUES_A_BYTE: u64 = 25;

/// Bytes that are decoded at a time; a multiple of every type's size.
const CHUNK: usize = 1 << 16;

/// Most values that a file of `size` bytes may hold.
fn most_values(size: usize) -> u64 {
    FREE_VALUES.saturating_add(MOST_VALUES_A_BYTE.saturating_mul(size as u64))
}

/// Reads an NRRD file. `progress` now and then gets the share of values read.
///
/// # Errors
/// The error names the line or the byte. The header is outside the grammar or says something that cannot be drawn (see
/// `nrrd_header`), the data are in another file, are fewer than the sizes say or, when packed, more.
pub(in crate::model) fn parse(bytes: &[u8], progress: &dyn Fn(f32)) -> Result<Grid, ParseError> {
    let header = nrrd_header::parse(bytes)?;
    let most = most_values(bytes.len());
    if header.count as u64 > most {
        let found = format!("{} values", header.count);
        let expected = format!("at most {most} in a file of {} bytes", bytes.len());
        return Err(ParseError::line(header.sizes_line, found, expected));
    }
    let at = skip_lines(bytes, &header)?;
    let body = bytes.get(at..).unwrap_or_default();
    let mut notes = header.notes.clone();
    let mut values = match header.encoding {
        Encoding::Raw => raw(body, at, &header, progress, &mut notes)?,
        Encoding::Text => text(bytes, at, &header, progress)?,
        Encoding::Gzip => packed(body, at, &header, progress, &mut notes)?,
    };
    replace_odd(&mut values, &mut notes);
    let Header { sizes, origin, steps, kind, .. } = header;
    Ok(Grid { sizes, origin, steps, values, storage: kind.name(), notes })
}

/// The byte at which the data begin, after the lines that are to be passed over.
fn skip_lines(bytes: &[u8], header: &Header) -> Result<usize, ParseError> {
    let mut at = header.body;
    for skipped in 0..header.line_skip {
        let rest = bytes.get(at..).unwrap_or_default();
        let Some(length) = rest.iter().position(|b| *b == b'\n') else {
            let expected = format!("{} lines before the data (line skip)", header.line_skip);
            return Err(ParseError::line(header.body_line + skipped, "the end of the file", expected));
        };
        at += length + 1;
    }
    Ok(at)
}

fn raw(
    body: &[u8],
    at: usize,
    header: &Header,
    progress: &dyn Fn(f32),
    notes: &mut Vec<String>,
) -> Result<Vec<f32>, ParseError> {
    let expected = header.count * header.kind.size();
    let skip = header.byte_skip.map_or_else(
        || body.len().saturating_sub(expected),
        |skip| usize::try_from(skip).map_or(body.len(), |skip| skip.min(body.len())),
    );
    let body = body.get(skip..).unwrap_or_default();
    let Some(data) = body.get(..expected) else {
        return Err(too_few(at + skip, body.len(), expected, header));
    };
    let surplus = body.len() - expected;
    if surplus > 0 {
        notes.push(format!("{surplus} bytes after the last value ignored"));
    }
    let mut values = Vec::new();
    values.reserve_exact(header.count);
    // Reading from memory does not fail.
    let _ = decode(&mut &data[..], header, &mut values, progress);
    Ok(values)
}

fn text(bytes: &[u8], at: usize, header: &Header, progress: &dyn Fn(f32)) -> Result<Vec<f32>, ParseError> {
    let skip = usize::try_from(header.byte_skip.unwrap_or(0)).unwrap_or(usize::MAX);
    let mut at = at.saturating_add(skip).min(bytes.len());
    let left = bytes.len() - at;
    // Each number has a digit and, but for the last, a blank.
    if header.count > left.div_ceil(2) {
        return Err(too_few(at, left, (2 * header.count).saturating_sub(1), header));
    }
    let mut values = Vec::new();
    values.reserve_exact(header.count);
    while values.len() < header.count {
        if values.len().is_multiple_of(CHUNK) {
            progress(values.len() as f32 / header.count as f32);
        }
        let rest = bytes.get(at..).unwrap_or_default();
        let start = rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
        let word = rest.get(start..).unwrap_or_default();
        let length = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
        let word = word.get(..length).unwrap_or_default();
        at += start;
        if word.is_empty() {
            let found = format!("the end of the file after {} values", values.len());
            return Err(ParseError::line(line_of(bytes, at), found, format!("{}", header.count)));
        }
        let value = number(word);
        let value = value.ok_or_else(|| ParseError::line(line_of(bytes, at), quote(word), "a number"))?;
        values.push(value as f32);
        at += length;
    }
    let rest = bytes.get(at..).unwrap_or_default().trim_ascii();
    if rest.is_empty() {
        return Ok(values);
    }
    let found = format!("{} after the last value", quote(rest.get(..20).unwrap_or(rest)));
    Err(ParseError::line(line_of(bytes, bytes.len() - rest.len()), found, format!("{} values", header.count)))
}

#[cfg(not(feature = "formats"))]
fn packed(_: &[u8], at: usize, _: &Header, _: &dyn Fn(f32), _: &mut Vec<String>) -> Result<Vec<f32>, ParseError> {
    let expected = "a program built with the Cargo feature `formats`, which reads it";
    Err(ParseError::byte(at, "values packed by gzip", expected))
}

#[cfg(feature = "formats")]
fn packed(
    body: &[u8],
    at: usize,
    header: &Header,
    progress: &dyn Fn(f32),
    notes: &mut Vec<String>,
) -> Result<Vec<f32>, ParseError> {
    /// Most bytes that one byte of a deflate stream gives: 258 bytes for two bits.
    const MOST_INFLATION: usize = 1032;
    let damaged = |why: &io::Error| {
        let why: String = why.to_string().split_whitespace().collect::<Vec<_>>().join(" ").chars().take(120).collect();
        ParseError::byte(at, format!("a gzip stream that fails ({why})"), "a whole one")
    };
    let expected = header.count * header.kind.size();
    if expected > body.len().saturating_mul(MOST_INFLATION) {
        return Err(too_few(at, body.len(), expected, header).of("no gzip stream holds as much"));
    }
    let mut stream = flate2::bufread::GzDecoder::new(body);
    let skip = header.byte_skip.ok_or_else(|| ParseError::byte(at, "a byte skip of -1 in gzip", "from 0, or raw"))?;
    let skipped = io::copy(&mut (&mut stream).take(skip), &mut io::sink()).map_err(|why| damaged(&why))?;
    if skipped < skip {
        return Err(ParseError::byte(at, format!("{skipped} inflated bytes"), format!("{skip} to skip (byte skip)")));
    }
    let mut values = Vec::new();
    values.reserve_exact(header.count);
    decode(&mut (&mut stream).take(expected as u64), header, &mut values, progress).map_err(|why| damaged(&why))?;
    if values.len() < header.count {
        return Err(too_few(at, values.len() * header.kind.size(), expected, header).of("inflated"));
    }
    // The end of the stream holds its checksum.
    let more = stream.read(&mut [0]).map_err(|why| damaged(&why))?;
    if more > 0 {
        let found = format!("more than {expected} bytes of values when inflated");
        return Err(ParseError::byte(at, found, format!("{expected} for {} values", header.count)));
    }
    let surplus = stream.into_inner().len();
    if surplus > 0 {
        notes.push(format!("{surplus} bytes after the gzip stream ignored"));
    }
    Ok(values)
}

fn too_few(at: usize, found: usize, expected: usize, header: &Header) -> ParseError {
    let [x, y, z] = header.sizes;
    let expected = format!("{expected} for {x} x {y} x {z} of type {}: is the file cut short?", header.kind.name());
    ParseError::byte(at, format!("{found} bytes of values"), expected)
}

/// Appends the values of a stream of bytes, as many as there are whole ones.
fn decode(stream: &mut impl Read, header: &Header, values: &mut Vec<f32>, progress: &dyn Fn(f32)) -> io::Result<()> {
    let mut buffer = vec![0; CHUNK];
    loop {
        let mut filled = 0;
        while filled < CHUNK {
            match stream.read(buffer.get_mut(filled..).unwrap_or_default())? {
                0 => break,
                more => filled += more,
            }
        }
        append(buffer.get(..filled).unwrap_or_default(), header.kind, header.little, values);
        progress(values.len() as f32 / header.count as f32);
        if filled < CHUNK {
            return Ok(());
        }
    }
}

fn append(bytes: &[u8], kind: Type, little: bool, values: &mut Vec<f32>) {
    macro_rules! numbers {
        ($type:ty, $as_single:expr) => {{
            let (numbers, _) = bytes.as_chunks::<{ size_of::<$type>() }>();
            let decode = if little { <$type>::from_le_bytes } else { <$type>::from_be_bytes };
            values.extend(numbers.iter().map(|raw| $as_single(decode(*raw))));
        }};
    }
    match kind {
        Type::I8 => numbers!(i8, f32::from),
        Type::U8 => numbers!(u8, f32::from),
        Type::I16 => numbers!(i16, f32::from),
        Type::U16 => numbers!(u16, f32::from),
        Type::I32 => numbers!(i32, |x| x as f32),
        Type::U32 => numbers!(u32, |x| x as f32),
        Type::I64 => numbers!(i64, |x| x as f32),
        Type::U64 => numbers!(u64, |x| x as f32),
        Type::F32 => numbers!(f32, f32::from),
        Type::F64 => numbers!(f64, |x| x as f32),
    }
}

/// Values that are not finite become the least of the others.
fn replace_odd(values: &mut [f32], notes: &mut Vec<String>) {
    let finite = values.iter().copied().filter(|value| value.is_finite());
    let least = finite.reduce(f32::min).unwrap_or(0.0);
    let mut odd = 0_usize;
    for value in values.iter_mut().filter(|value| !value.is_finite()) {
        *value = least;
        odd += 1;
    }
    if odd > 0 {
        notes.push(format!("{odd} values that are not finite are taken as the least, {least}"));
    }
}

//! The header of a PLY file: its elements, their properties and where the body begins.
//!
//! The grammar is that of Turk 1994, extended by what real files have: `ply`, `format ENCODING 1.0`, then `comment`,
//! `obj_info`, `element NAME COUNT`, `property TYPE NAME`, `property list COUNT_TYPE ITEM_TYPE NAME`, and `end_header`.
//! Lines end in LF, CRLF or CR. Everything else is refused: a misspelt keyword must not become a comment.

use std::collections::HashSet;

use super::error::{ParseError, quote};

/// Longest header that is read, bytes. Real headers have a few hundred.
const MAX_HEADER: usize = 1 << 20;

const TYPES: &str = "one of char, uchar, short, ushort, int, uint, float, double, int8, uint8, int16, uint16, int32, \
                     uint32, float32, float64";

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Size in a binary file, bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    pub(super) fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }

    pub(super) fn is_unsigned(self) -> bool {
        matches!(self, Self::U8 | Self::U16 | Self::U32)
    }

    /// What stands for 1 where a share is stored as a whole number; 1 for floats. A signed byte is taken as an unsigned
    /// one.
    pub(super) fn largest_of_whole(self) -> f64 {
        match self {
            Self::I8 | Self::U8 => u8::MAX.into(),
            Self::I16 => i16::MAX.into(),
            Self::U16 => u16::MAX.into(),
            Self::I32 => i32::MAX.into(),
            Self::U32 => u32::MAX.into(),
            Self::F32 | Self::F64 => 1.0,
        }
    }

    /// The usual name.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::I8 => "char",
            Self::U8 => "uchar",
            Self::I16 => "short",
            Self::U16 => "ushort",
            Self::I32 => "int",
            Self::U32 => "uint",
            Self::F32 => "float",
            Self::F64 => "double",
        }
    }

    /// True if the type can hold a number of a text file.
    pub(super) fn holds(self, value: f64) -> bool {
        let (low, high) = match self {
            Self::I8 => (f64::from(i8::MIN), f64::from(i8::MAX)),
            Self::U8 => (0.0, f64::from(u8::MAX)),
            Self::I16 => (f64::from(i16::MIN), f64::from(i16::MAX)),
            Self::U16 => (0.0, f64::from(u16::MAX)),
            Self::I32 => (f64::from(i32::MIN), f64::from(i32::MAX)),
            Self::U32 => (0.0, f64::from(u32::MAX)),
            Self::F32 | Self::F64 => return true,
        };
        value >= low && value <= high && value.fract() == 0.0
    }
}

/// A number, or a list of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PropertyKind {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Clone, Debug)]
pub(super) struct Property {
    /// In lower case.
    pub(super) name: String,
    pub(super) kind: PropertyKind,
}

#[derive(Clone, Debug)]
pub(super) struct Element {
    /// In lower case.
    pub(super) name: String,
    /// Number of records by the file's word, which is not yet checked.
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    /// Line of the header that declares it.
    pub(super) line: u64,
}

impl Element {
    /// Fewest bytes that `count` records can take. In a text each number has at least one digit and one blank. `None`
    /// if the result needs more than 64 bits.
    pub(super) fn least_bytes(&self, encoding: Encoding) -> Option<u64> {
        let record: u64 = self
            .properties
            .iter()
            .map(|p| match (encoding, p.kind) {
                (Encoding::Ascii, _) => 2,
                (_, PropertyKind::Scalar(s) | PropertyKind::List { count: s, .. }) => s.size() as u64,
            })
            .sum();
        let bytes = record.checked_mul(self.count)?;
        // The last number of a text file needs no blank after it.
        Some(if encoding == Encoding::Ascii { bytes.saturating_sub(1) } else { bytes })
    }
}

/// How numbers are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    pub(super) comments: Vec<String>,
    /// Offset of the first byte after the line end of `end_header`.
    pub(super) body: usize,
}

/// Reads a header.
///
/// # Errors
/// The error names the line. Something is outside the grammar, names are duplicate, the header is above 1 MiB, or it
/// does not end.
pub(super) fn parse(bytes: &[u8]) -> Result<Header, ParseError> {
    let mut lines = Lines::new(bytes);
    let first = lines.next()?;
    if first.trim_end() != "ply" {
        return Err(lines.fault(quote(first.as_bytes()), "`ply`"));
    }
    let mut encoding = None;
    let mut comments = Vec::new();
    let mut elements: Vec<Element> = Vec::new();
    let mut element_names: HashSet<String> = HashSet::new();
    let mut names: HashSet<String> = HashSet::new();
    loop {
        let line = lines.next()?;
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            [] | ["obj_info", ..] => {}
            ["comment", ..] => {
                comments.push(line.trim().strip_prefix("comment").unwrap_or_default().trim().to_owned());
            }
            ["format", rest @ ..] => {
                if encoding.is_some() {
                    return Err(lines.fault("a second `format` line", "one"));
                }
                encoding = Some(parse_format(rest).map_err(|(found, expected)| lines.fault(found, expected))?);
            }
            ["element", name, count] => {
                let name = name.to_ascii_lowercase();
                if !element_names.insert(name.clone()) {
                    return Err(lines.fault(format!("a second element {}", quote(name.as_bytes())), "different names"));
                }
                let count = count.parse().map_err(|_| {
                    lines.fault(
                        format!("element count {}", quote(count.as_bytes())),
                        "a whole number from 0 to 2^64 - 1",
                    )
                })?;
                names.clear();
                elements.push(Element { name, count, properties: Vec::new(), line: lines.number });
            }
            ["property", rest @ ..] => {
                let property = parse_property(rest).map_err(|(found, expected)| lines.fault(found, expected))?;
                if !names.insert(property.name.clone()) {
                    let found = format!("a second property {}", quote(property.name.as_bytes()));
                    return Err(lines.fault(found, "different names (letter case does not count)"));
                }
                let Some(element) = elements.last_mut() else {
                    return Err(lines.fault("a property before the first element", "`element NAME COUNT`"));
                };
                element.properties.push(property);
            }
            ["end_header"] => break,
            _ => {
                let expected = "`comment ...`, `obj_info ...`, `format ENCODING 1.0`, `element NAME COUNT`, \
                                `property TYPE NAME`, `property list TYPE TYPE NAME` or `end_header`";
                return Err(lines.fault(quote(line.as_bytes()), expected));
            }
        }
    }
    let Some(encoding) = encoding else {
        return Err(lines.fault("no `format` line before `end_header`", "`format ENCODING 1.0`"));
    };
    Ok(Header { encoding, elements, comments, body: lines.at })
}

/// What was found, and what was expected.
type Fault = (String, String);

fn parse_format(words: &[&str]) -> Result<Encoding, Fault> {
    let expected = "`ascii`, `binary_little_endian` or `binary_big_endian`, then `1.0`";
    let [encoding, version] = words else {
        return Err((format!("format {}", quote(words.join(" ").as_bytes())), expected.to_owned()));
    };
    if *version != "1.0" {
        return Err((format!("PLY version {}", quote(version.as_bytes())), "1.0".to_owned()));
    }
    match *encoding {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::Little),
        "binary_big_endian" => Ok(Encoding::Big),
        other => Err((format!("encoding {}", quote(other.as_bytes())), expected.to_owned())),
    }
}

fn parse_property(words: &[&str]) -> Result<Property, Fault> {
    let scalar = |name: &str| {
        Scalar::from_name(name).ok_or_else(|| (format!("property type {}", quote(name.as_bytes())), TYPES.to_owned()))
    };
    let (kind, name) = match words {
        ["list", count, item, name] => {
            let count = scalar(count)?;
            if count.is_float() {
                return Err((format!("list count type `{}`", count.name()), "a whole-number type".to_owned()));
            }
            (PropertyKind::List { count, item: scalar(item)? }, name)
        }
        [kind, name] => (PropertyKind::Scalar(scalar(kind)?), name),
        _ => {
            let found = format!("property {}", quote(words.join(" ").as_bytes()));
            return Err((found, "`property TYPE NAME` or `property list TYPE TYPE NAME`".to_owned()));
        }
    };
    Ok(Property { name: name.to_ascii_lowercase(), kind })
}

/// The lines of the header, of at most [`MAX_HEADER`] bytes in all.
struct Lines<'a> {
    window: &'a [u8],
    /// The byte that ends a line: LF in LF and CRLF files (the CR is trimmed), CR in CR files. The body may begin with
    /// the other byte.
    end: u8,
    at: usize,
    number: u64,
    capped: bool,
}

impl<'a> Lines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let window = bytes.get(..MAX_HEADER).unwrap_or(bytes);
        let first_end = window.iter().position(|&b| b == b'\n' || b == b'\r');
        let end = match first_end.map(|i| (window.get(i), window.get(i + 1))) {
            Some((Some(b'\r'), next)) if next != Some(&b'\n') => b'\r',
            _ => b'\n',
        };
        Self { window, end, at: 0, number: 0, capped: bytes.len() > MAX_HEADER }
    }

    fn next(&mut self) -> Result<String, ParseError> {
        self.number += 1;
        let rest = self.window.get(self.at..).unwrap_or_default();
        let Some(length) = rest.iter().position(|&b| b == self.end) else {
            let found = if self.capped { "a header longer than 1 MiB" } else { "the end of the file" };
            return Err(self.fault(found, "`end_header` and a line end"));
        };
        self.at += length + 1;
        let line = rest.get(..length).unwrap_or_default();
        Ok(String::from_utf8_lossy(line.strip_suffix(b"\r").unwrap_or(line)).into_owned())
    }

    fn fault(&self, found: impl Into<String>, expected: impl Into<String>) -> ParseError {
        ParseError::line(self.number, found, expected)
    }
}

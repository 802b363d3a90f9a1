//! Reads the numbers of a PLY body in any of its three encodings.

use super::error::{ParseError, line_of, quote};
use super::ply_header::{Element, Encoding, PropertyKind, Scalar};

/// A cursor over the body. Every read is checked against the end of the file.
pub(super) struct Body<'a> {
    bytes: &'a [u8],
    pub(super) at: usize,
    encoding: Encoding,
}

impl<'a> Body<'a> {
    /// Starts at byte `at` of the whole file.
    pub(super) fn new(bytes: &'a [u8], at: usize, encoding: Encoding) -> Self {
        Self { bytes, at, encoding }
    }

    /// Returns the number of records of an element, which is at most the number of bytes left. Refuses an element whose
    /// records cannot fit into the rest of the file. This must come before any allocation.
    pub(super) fn count(&self, element: &Element) -> Result<usize, ParseError> {
        if element.properties.is_empty() {
            return Ok(0);
        }
        let left = self.left();
        match (element.least_bytes(self.encoding), usize::try_from(element.count)) {
            (Some(least), Ok(count)) if least <= left as u64 => Ok(count),
            (least, _) => {
                let least = least.map_or_else(|| "2^64 or more".to_owned(), |n| n.to_string());
                let found = format!("{} of element `{}` ({left} bytes are left)", element.count, element.name);
                Err(ParseError::line(
                    element.line,
                    found,
                    format!("at least {least} bytes for them: is the file cut short?"),
                ))
            }
        }
    }

    /// Reads one number.
    pub(super) fn scalar(&mut self, scalar: Scalar) -> Result<f64, ParseError> {
        if self.encoding == Encoding::Ascii {
            return self.word(scalar);
        }
        let little = self.encoding == Encoding::Little;
        macro_rules! number {
            ($type:ty) => {{
                let raw = self.take()?;
                f64::from(if little { <$type>::from_le_bytes(raw) } else { <$type>::from_be_bytes(raw) })
            }};
        }
        Ok(match scalar {
            Scalar::I8 => number!(i8),
            Scalar::U8 => number!(u8),
            Scalar::I16 => number!(i16),
            Scalar::U16 => number!(u16),
            Scalar::I32 => number!(i32),
            Scalar::U32 => number!(u32),
            Scalar::F32 => number!(f32),
            Scalar::F64 => number!(f64),
        })
    }

    /// Skips one number or list.
    pub(super) fn skip(&mut self, kind: PropertyKind) -> Result<(), ParseError> {
        let (scalar, items) = match kind {
            PropertyKind::Scalar(scalar) => (scalar, 1),
            PropertyKind::List { count, item } => (item, self.list_length(count, item)?),
        };
        if self.encoding == Encoding::Ascii {
            for _ in 0..items {
                self.word(scalar)?;
            }
            return Ok(());
        }
        match items.checked_mul(scalar.size()) {
            Some(bytes) if bytes <= self.left() => {
                self.at += bytes;
                Ok(())
            }
            _ => Err(self.end_of_file(scalar.name())),
        }
    }

    /// Skips all records of an element.
    pub(super) fn skip_element(&mut self, element: &Element) -> Result<(), ParseError> {
        for row in 0..self.count(element)? {
            for property in &element.properties {
                self.skip(property.kind).map_err(|e| within(e, element, row, &property.name))?;
            }
        }
        Ok(())
    }

    /// Reads a list of whole numbers into `items`, which is cleared first.
    pub(super) fn indices(&mut self, count: Scalar, item: Scalar, items: &mut Vec<i64>) -> Result<(), ParseError> {
        items.clear();
        for _ in 0..self.list_length(count, item)? {
            let at = self.at;
            let value = self.scalar(item)?;
            if value.fract() != 0.0 || value.abs() > 4.3e9 {
                return Err(self.fault(at, format!("vertex index {value}"), "a whole number"));
            }
            items.push(value as i64);
        }
        Ok(())
    }

    /// Number of bytes after the cursor. White space at the end of a text does not count.
    pub(super) fn surplus(&self) -> usize {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        if self.encoding == Encoding::Ascii { rest.trim_ascii().len() } else { rest.len() }
    }

    /// An error at byte `at`; for text it names the line.
    pub(super) fn fault(&self, at: usize, found: impl Into<String>, expected: impl Into<String>) -> ParseError {
        if self.encoding == Encoding::Ascii {
            // The error is at the word itself, not at the white space before it.
            let blanks = self.bytes.get(at..).and_then(|rest| rest.iter().position(|b| !b.is_ascii_whitespace()));
            ParseError::line(line_of(self.bytes, at + blanks.unwrap_or(0)), found, expected)
        } else {
            ParseError::byte(at, found, expected)
        }
    }

    fn list_length(&mut self, count: Scalar, item: Scalar) -> Result<usize, ParseError> {
        let at = self.at;
        let length = self.scalar(count)?;
        let room = if self.encoding == Encoding::Ascii { self.left().div_ceil(2) } else { self.left() / item.size() };
        // A NaN or a negative length fails the first comparison.
        if length >= 0.0 && length <= room as f64 {
            Ok(length as usize)
        } else {
            Err(self.fault(
                at,
                format!("a list of {length} items"),
                format!("0 to {room}, which is what the file can hold"),
            ))
        }
    }

    fn left(&self) -> usize {
        self.bytes.len().saturating_sub(self.at)
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], ParseError> {
        match self.bytes.get(self.at..).and_then(<[u8]>::first_chunk::<N>) {
            Some(raw) => {
                self.at += N;
                Ok(*raw)
            }
            None => Err(self.end_of_file(&format!("{N} bytes"))),
        }
    }

    fn word(&mut self, scalar: Scalar) -> Result<f64, ParseError> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let Some(start) = rest.iter().position(|b| !b.is_ascii_whitespace()) else {
            self.at = self.bytes.len();
            return Err(self.end_of_file(scalar.name()));
        };
        let rest = rest.get(start..).unwrap_or_default();
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let word = rest.get(..length).unwrap_or_default();
        let begin = self.at + start;
        match number(word) {
            Some(value) if scalar.holds(value) => {
                self.at = begin + length;
                Ok(value)
            }
            _ => Err(self.fault(begin, quote(word), format!("a number of type {}", scalar.name()))),
        }
    }

    fn end_of_file(&self, expected: &str) -> ParseError {
        self.fault(self.at, "the end of the file", expected)
    }
}

/// Adds to an error which number of which record could not be read.
pub(super) fn within(error: ParseError, element: &Element, row: usize, property: &str) -> ParseError {
    error.of(&format!("`{property}` of {} {row} of {}", element.name, element.count))
}

/// Reads a decimal number. The spellings of "not a number" and infinity by C libraries (`-nan(ind)`, `1.#QNAN`,
/// `1.#INF`) are read too.
pub(super) fn number(word: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(word).ok()?;
    if let Ok(value) = text.parse() {
        return Some(value);
    }
    let lower = text.to_ascii_lowercase();
    let lower = lower.trim_start_matches(['+', '-']);
    if lower.starts_with("nan(") || lower.starts_with("1.#ind") || lower.starts_with("1.#qnan") {
        Some(f64::NAN)
    } else if lower.starts_with("1.#inf") {
        Some(f64::INFINITY)
    } else {
        None
    }
}

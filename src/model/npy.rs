//! Arrays of `NumPy`: `.npy` files, versions 1.0 to 3.0, of numbers or of records of numbers.
//!
//! The header is the text of a Python dictionary. Crates that read it bring a parser of all of Python's literals; this
//! one reads what `NumPy` writes, and nothing else. Arrays of Python objects are refused: they hold programs.

use super::error::{ParseError, quote};
use super::ply_header::Scalar;

/// First bytes of a file.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";
/// Longest header that is read, bytes.
const MOST_HEADER: usize = 1 << 20;
/// Most fields of a record, with their parts.
pub(super) const MOST_FIELDS: usize = 1024;
/// Deepest nesting of a header.
const DEPTH: usize = 16;

/// How a number is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Number {
    /// `b`, `i`, `u`, `f` as `NumPy` names kinds.
    kind: u8,
    size: usize,
    big: bool,
}

impl Number {
    /// The number of `<f4` and the like, or the size of what is no number.
    fn of(text: &str) -> Option<Result<Self, usize>> {
        let (order, rest) = match text.split_at_checked(1)? {
            (order @ ("<" | ">" | "=" | "|"), rest) => (order, rest),
            _ => ("=", text),
        };
        let (kind, size) = rest.split_at_checked(1)?;
        let kind = kind.bytes().next()?;
        let digits: String = size.chars().take_while(char::is_ascii_digit).collect();
        let size: usize = digits.parse().ok().filter(|size| *size <= 1 << 20)?;
        let known = match kind {
            b'b' | b'?' => size == 1,
            b'i' | b'u' => matches!(size, 1 | 2 | 4 | 8),
            b'f' => matches!(size, 2 | 4 | 8),
            // Texts, complex numbers, times and padding are passed over. UTF-32 takes four bytes a letter.
            b'S' | b'a' | b'V' | b'c' | b'm' | b'M' => return Some(Err(size)),
            b'U' => return Some(Err(4 * size)),
            _ => return None,
        };
        known.then_some(Ok(Self { kind, size, big: order == ">" }))
    }

    /// The type by which ranges are told.
    pub(super) fn scalar(self) -> Scalar {
        match (self.kind, self.size) {
            (b'f', 8) => Scalar::F64,
            (b'f', _) => Scalar::F32,
            (b'i', 1) => Scalar::I8,
            (b'i', 2) => Scalar::I16,
            (b'i', _) => Scalar::I32,
            (b'u', 2) => Scalar::U16,
            (b'u', 4 | 8) => Scalar::U32,
            _ => Scalar::U8,
        }
    }

    /// The number at the beginning of `bytes`, which are long enough.
    fn read(self, bytes: &[u8]) -> f64 {
        let mut little = [0; 8];
        for (i, place) in little.iter_mut().enumerate().take(self.size) {
            *place = bytes[if self.big { self.size - 1 - i } else { i }];
        }
        let whole = u64::from_le_bytes(little);
        match (self.kind, self.size) {
            (b'f', 8) => f64::from_bits(whole),
            (b'f', 4) => f64::from(f32::from_bits(whole as u32)),
            (b'f', _) => half(whole as u16),
            (b'i', 1) => f64::from(whole as u8 as i8),
            (b'i', 2) => f64::from(whole as u16 as i16),
            (b'i', 4) => f64::from(whole as u32 as i32),
            (b'i', _) => whole as i64 as f64,
            _ => whole as f64,
        }
    }
}

/// A float of 16 bits.
fn half(bits: u16) -> f64 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
    sign * match exponent {
        0 => fraction * libm::exp2(-24.0),
        0x1f if fraction == 0.0 => f64::INFINITY,
        0x1f => f64::NAN,
        _ => (1024.0 + fraction) * libm::exp2(f64::from(exponent - 25)),
    }
}

/// A field of a record, or a part of one; the only one of an array of numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Field {
    /// Empty for an array of numbers.
    name: String,
    number: Number,
    /// Byte in the item.
    offset: usize,
}

/// A column of numbers: one for each row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Column<'a> {
    number: Number,
    bytes: &'a [u8],
    /// Byte of the first, and from one to the next.
    first: usize,
    step: usize,
}

impl Column<'_> {
    pub(super) fn scalar(&self) -> Scalar {
        self.number.scalar()
    }

    /// The number of a row that the array has.
    pub(super) fn value(&self, row: usize) -> f64 {
        self.bytes.get(self.first + row * self.step..).map_or(f64::NAN, |bytes| self.number.read(bytes))
    }
}

/// An array whose header was checked against the size of its data.
#[derive(Debug)]
pub(super) struct Array<'a> {
    fields: Vec<Field>,
    /// Size of an item, bytes.
    item: usize,
    shape: Vec<usize>,
    fortran: bool,
    data: &'a [u8],
}

impl<'a> Array<'a> {
    /// Reads a file.
    ///
    /// # Errors
    /// The header is not what `NumPy` writes, or the data are cut short. Data behind the array are left out.
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, ParseError> {
        let cut = || ParseError::byte(bytes.len(), "the end of the file", "the header of an array of NumPy");
        if !bytes.starts_with(MAGIC) {
            return Err(ParseError::byte(0, "other bytes", "an array of NumPy (\\x93NUMPY)"));
        }
        let version = *bytes.get(6).ok_or_else(cut)?;
        let (length, begin) = match version {
            1 => (bytes.get(8..10).map(|b| usize::from(u16::from_le_bytes([b[0], b[1]]))), 10),
            2 | 3 => (bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize), 12),
            other => return Err(ParseError::byte(6, format!("version {other}"), "1, 2 or 3")),
        };
        let length = length.ok_or_else(cut)?;
        if length > MOST_HEADER {
            return Err(ParseError::byte(8, format!("a header of {length} bytes"), format!("at most {MOST_HEADER}")));
        }
        let header = bytes.get(begin..begin + length).ok_or_else(cut)?;
        let wrong = |found: String, expected: &str| ParseError::byte(begin, found, expected);
        let text = std::str::from_utf8(header).map_err(|_| wrong("a header that is no text".to_owned(), "UTF-8"))?;
        let mut reader = Reader { text, at: 0, depth: 0 };
        let literal = reader.literal().filter(|_| reader.rest().trim().is_empty());
        let Some(Literal::Dictionary(entries)) = literal else {
            return Err(wrong(format!("a header {}", quote(&header[..header.len().min(60)])), "a Python dictionary"));
        };
        let entry = |name: &str| entries.iter().find(|(key, _)| key == name).map(|(_, value)| value);
        let fortran = match entry("fortran_order") {
            Some(Literal::Boolean(fortran)) => *fortran,
            _ => return Err(wrong("a header without `fortran_order`".to_owned(), "True or False")),
        };
        let shape = entry("shape").and_then(Literal::lengths);
        let shape = shape.ok_or_else(|| wrong("a header without a `shape`".to_owned(), "lengths, as (1000, 3)"))?;
        let descr = entry("descr").ok_or_else(|| wrong("a header without `descr`".to_owned(), "a type, as '<f4'"))?;
        let mut fields = Vec::new();
        let item = add_fields(&mut fields, "", descr, 0).map_err(|found| {
            wrong(found, "numbers of 1 to 8 bytes, or records of them (save without Python objects)")
        })?;
        let items = shape.iter().try_fold(1_usize, |product, length| product.checked_mul(*length));
        let needed = items.and_then(|items| items.checked_mul(item));
        let data = &bytes[begin + length..];
        match needed {
            Some(needed) if needed <= data.len() && item > 0 => Ok(Self { fields, item, shape, fortran, data }),
            _ => {
                let found = format!("an array of shape {shape:?} of items of {item} bytes");
                Err(wrong(found, &format!("at most {} bytes, which the file has", data.len())))
            }
        }
    }

    /// Lengths of its axes.
    pub(super) fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// Its columns, with their names: fields of records; else the numbers of a row, without names. `None` for an array
    /// that has no rows: of more than two axes, of none, or of records along two axes.
    pub(super) fn columns(&self) -> Option<Vec<(&str, Column<'a>)>> {
        let (rows, across) = match *self.shape {
            [rows] => (rows, 1),
            [rows, across] if self.fields.len() == 1 && across <= MOST_FIELDS => (rows, across),
            _ => return None,
        };
        let mut columns = Vec::new();
        for k in 0..across {
            let (first, step) =
                if self.fortran { (k * rows * self.item, self.item) } else { (k * self.item, across * self.item) };
            for field in &self.fields {
                let column = Column { number: field.number, bytes: self.data, first: first + field.offset, step };
                columns.push((field.name.as_str(), column));
            }
        }
        Some(columns)
    }
}

/// Adds the fields of a type at byte `offset` of an item, and gives its size.
fn add_fields(fields: &mut Vec<Field>, name: &str, descr: &Literal, offset: usize) -> Result<usize, String> {
    match descr {
        Literal::Text(text) => match Number::of(text) {
            Some(Ok(number)) => {
                if fields.len() >= MOST_FIELDS {
                    return Err(format!("more than {MOST_FIELDS} fields"));
                }
                fields.push(Field { name: name.to_lowercase(), number, offset });
                Ok(number.size)
            }
            Some(Err(size)) => Ok(size),
            None => Err(format!("a type {}", quote(text.as_bytes()))),
        },
        Literal::List(list) => {
            let mut size: usize = 0;
            for field in list {
                let Literal::List(parts) = field else { return Err("a field without a name".to_owned()) };
                let (title, descr, shape) = match &parts[..] {
                    [title, descr] => (title, descr, Some(Vec::new())),
                    [title, descr, shape] => (title, descr, shape.lengths()),
                    _ => return Err(format!("a field of {} parts", parts.len())),
                };
                let title = match title {
                    Literal::Text(name) => name,
                    // A title, and the name.
                    Literal::List(names) => match &names[..] {
                        [_, Literal::Text(name)] => name,
                        _ => return Err("a field without a name".to_owned()),
                    },
                    _ => return Err("a field without a name".to_owned()),
                };
                let count =
                    shape.and_then(|shape| shape.iter().try_fold(1_usize, |all, length| all.checked_mul(*length)));
                let count = count.filter(|count| *count <= MOST_FIELDS);
                let count = count.ok_or_else(|| format!("a field {} of too many parts", quote(title.as_bytes())))?;
                for part in 0..count {
                    let name = match (name, count) {
                        ("", 1) => title.clone(),
                        ("", 3) => format!("{title}_{}", ["x", "y", "z"][part]),
                        ("", _) => format!("{title}_{part}"),
                        (outer, 1) => format!("{outer}_{title}"),
                        (outer, _) => format!("{outer}_{title}_{part}"),
                    };
                    size += add_fields(fields, &name, descr, offset + size)?;
                }
            }
            Ok(size)
        }
        _ => Err("a type that is no text".to_owned()),
    }
}

/// A literal of Python, as far as headers have them.
#[derive(Debug, PartialEq)]
enum Literal {
    Text(String),
    Number(usize),
    Boolean(bool),
    /// A list or a tuple.
    List(Vec<Literal>),
    Dictionary(Vec<(String, Literal)>),
}

impl Literal {
    /// Lengths of axes.
    fn lengths(&self) -> Option<Vec<usize>> {
        match self {
            Self::Number(length) => Some(vec![*length]),
            Self::List(list) => {
                list.iter().map(|item| if let Self::Number(length) = item { Some(*length) } else { None }).collect()
            }
            _ => None,
        }
    }
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
}

impl<'a> Reader<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    /// Takes a text, after blanks, if it comes next.
    fn take(&mut self, next: &str) -> bool {
        let trimmed = self.rest().trim_start();
        let found = trimmed.starts_with(next);
        if found {
            self.at = self.text.len() - trimmed.len() + next.len();
        }
        found
    }

    /// Items until `end`, with commas between them.
    fn items<T>(&mut self, end: &str, mut item: impl FnMut(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        let mut items = Vec::new();
        loop {
            if self.take(end) {
                return Some(items);
            }
            items.push(item(self)?);
            if !self.take(",") {
                return self.take(end).then_some(items);
            }
        }
    }

    fn text(&mut self) -> Option<String> {
        let quote = ["'", "\""].into_iter().find(|quote| self.take(quote))?;
        let (text, _) = self.rest().split_once(quote)?;
        self.at += text.len() + 1;
        (!text.contains('\\')).then(|| text.to_owned())
    }

    fn literal(&mut self) -> Option<Literal> {
        self.depth += 1;
        if self.depth > DEPTH {
            return None;
        }
        let literal = if self.take("{") {
            let entry = |reader: &mut Self| {
                let key = reader.text()?;
                if reader.take(":") { Some((key, reader.literal()?)) } else { None }
            };
            Literal::Dictionary(self.items("}", entry)?)
        } else if self.take("(") {
            Literal::List(self.items(")", Self::literal)?)
        } else if self.take("[") {
            Literal::List(self.items("]", Self::literal)?)
        } else if self.take("True") {
            Literal::Boolean(true)
        } else if self.take("False") {
            Literal::Boolean(false)
        } else if let Some(text) = self.text() {
            Literal::Text(text)
        } else {
            let trimmed = self.rest().trim_start();
            let digits: &str = &trimmed[..trimmed.bytes().take_while(u8::is_ascii_digit).count()];
            let number = digits.parse().ok()?;
            self.at = self.text.len() - trimmed.len() + digits.len();
            // Numbers of Python 2 end in L.
            self.take("L");
            Literal::Number(number)
        };
        self.depth -= 1;
        Some(literal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    fn values(bytes: &[u8]) -> Vec<(String, Vec<f64>)> {
        let array = Array::parse(bytes).unwrap();
        let rows = array.shape()[0];
        let columns = array.columns().unwrap();
        columns.into_iter().map(|(name, c)| (name.to_owned(), (0..rows).map(|row| c.value(row)).collect())).collect()
    }

    #[test]
    fn orders_of_rows_and_of_bytes() {
        let data: Vec<u8> = (0_u8..6).flat_map(|i| f32::from(i).to_le_bytes()).collect();
        let c = file("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }", &data);
        let unnamed = |columns: [[f64; 2]; 3]| columns.map(|column| (String::new(), column.to_vec())).to_vec();
        assert_eq!(values(&c), unnamed([[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]]));
        let fortran = file("{'descr': '<f4', 'fortran_order': True, 'shape': (2, 3), }", &data);
        assert_eq!(values(&fortran), unnamed([[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]]));
        let big = file("{'descr': '>i2', 'fortran_order': False, 'shape': (2,), }", &[255, 254, 1, 0]);
        assert_eq!(values(&big), [(String::new(), vec![-2.0, 256.0])]);
    }

    #[test]
    fn halves_and_longs() {
        let halves = [0x3c00_u16, 0xc000, 0x0001, 0x7c00, 0x3555].map(half);
        assert_eq!(halves, [1.0, -2.0, 2.0_f64.powi(-24), f64::INFINITY, 0.333_251_953_125]);
        assert!(half(0x7e00).is_nan());
        let longs: Vec<u8> = [-5_i64, 1 << 40].into_iter().flat_map(i64::to_le_bytes).collect();
        let bytes = file("{'descr': '<i8', 'fortran_order': False, 'shape': (2,), }", &longs);
        assert_eq!(values(&bytes)[0].1, [-5.0, (1_u64 << 40) as f64]);
    }

    #[test]
    fn records_have_names_and_parts() {
        let header = "{'descr': [('Pos', '<f4', (3,)), ('name', '<U2'), ('T', '|u1'), ('sub', [('a', '|i1')])], \
                      'fortran_order': False, 'shape': (1,), }";
        let mut data: Vec<u8> = [1.0_f32, 2.0, 3.0].into_iter().flat_map(f32::to_le_bytes).collect();
        data.extend([0; 8]);
        data.extend([200, 255]);
        let want = [("pos_x", 1.0), ("pos_y", 2.0), ("pos_z", 3.0), ("t", 200.0), ("sub_a", -1.0)];
        assert_eq!(values(&file(header, &data)), want.map(|(name, value)| (name.to_owned(), vec![value])));
    }

    #[test]
    fn lying_headers_are_refused() {
        let refused = |header: &str| Array::parse(&file(header, &[0; 24])).unwrap_err().to_string();
        let shape = |shape: &str| format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}");
        assert!(refused(&shape("(3, 3)")).contains("at most 24 bytes"));
        assert!(refused(&shape("(18446744073709551615, 3)")).contains("at most 24 bytes"));
        assert!(refused(&shape("(99999999999999999999,)")).contains("Python dictionary"));
        assert!(refused(&shape("(-1,)")).contains("Python dictionary"));
        assert!(refused("{'descr': '|O', 'fortran_order': False, 'shape': (3,), }").contains("type `|O`"));
        assert!(refused("{'descr': '<f4', 'shape': (3,), }").contains("fortran_order"));
        assert!(refused(&"[".repeat(100)).contains("Python dictionary"));
        let many = "{'descr': [('a', '<f4', (999999,))], 'fortran_order': False, 'shape': (0,), }";
        assert!(refused(many).contains("too many parts"));
        let none = "{'descr': [], 'fortran_order': False, 'shape': (99999999999,), }";
        assert!(refused(none).contains("0 bytes"));
        let whole = file(&shape("(2, 3)"), &[0; 24]);
        for length in 0..whole.len() {
            assert!(Array::parse(&whole[..length]).is_err(), "{length} bytes");
        }
    }
}

//! Makers of model files, and short ways to read them.

use std::path::PathBuf;

use splatblur::model::{
    Cloud, LoadOptions, LoadedModel, ModelError, ModelFormat, ParseError, Parsed, Surfels, load, parse,
};

/// A file of tests/data/models.
pub(crate) fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/models").join(name)
}

pub(crate) fn read(name: &str) -> Vec<u8> {
    std::fs::read(data(name)).unwrap()
}

pub(crate) fn cloud(bytes: &[u8], format: ModelFormat) -> Cloud {
    match parse(bytes, format) {
        Ok(Parsed::Cloud(cloud)) => cloud,
        Ok(Parsed::Surfels(_) | Parsed::Grid(_)) => panic!("surfels or a grid instead of a cloud"),
        Err(error) => panic!("{error}"),
    }
}

pub(crate) fn refused(bytes: &[u8], format: ModelFormat) -> ParseError {
    match parse(bytes, format) {
        Err(error) => error,
        Ok(parsed) => panic!("accepted: {parsed:?}"),
    }
}

pub(crate) fn surfels(bytes: &[u8]) -> Result<Surfels, ParseError> {
    match parse(bytes, ModelFormat::Bin)? {
        Parsed::Surfels(surfels) => Ok(surfels),
        Parsed::Cloud(_) | Parsed::Grid(_) => panic!("a cloud or a grid instead of surfels"),
    }
}

/// Loads bytes through a file of this name.
pub(crate) fn load_as(name: &str, bytes: &[u8]) -> Result<LoadedModel, ModelError> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    load(&path, &LoadOptions::default(), &|_, _| {})
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Encoding {
    Ascii,
    Little,
    Big,
}

pub(crate) const ENCODINGS: [Encoding; 3] = [Encoding::Ascii, Encoding::Little, Encoding::Big];

/// A PLY file in the making: any properties in any encoding.
pub(crate) struct Ply {
    pub(crate) encoding: Encoding,
    pub(crate) line_end: &'static str,
    header: Vec<String>,
    body: Vec<u8>,
}

impl Ply {
    pub(crate) fn new(encoding: Encoding) -> Self {
        Self { encoding, line_end: "\n", header: Vec::new(), body: Vec::new() }
    }

    pub(crate) fn line(mut self, line: &str) -> Self {
        self.header.push(line.to_owned());
        self
    }

    /// Adds an element of plain numbers: (type, name) of its properties, and its rows.
    pub(crate) fn element(mut self, name: &str, properties: &[(&str, &str)], rows: &[Vec<f64>]) -> Self {
        self.header.push(format!("element {name} {}", rows.len()));
        for (kind, name) in properties {
            self.header.push(format!("property {kind} {name}"));
        }
        for row in rows {
            assert_eq!(row.len(), properties.len());
            for (value, (kind, _)) in row.iter().zip(properties) {
                self.number(kind, *value);
            }
            self.end_row();
        }
        self
    }

    /// Adds an element with one list a row, of these types, between a plain `uchar` before and a `double` after it.
    pub(crate) fn lists(mut self, element: &str, list: &str, count: &str, item: &str, rows: &[Vec<f64>]) -> Self {
        self.header.push(format!("element {element} {}", rows.len()));
        self.header.push("property uchar before".to_owned());
        self.header.push(format!("property list {count} {item} {list}"));
        self.header.push("property double after".to_owned());
        for row in rows {
            self.number("uchar", 7.0);
            self.number(count, row.len() as f64);
            for value in row {
                self.number(item, *value);
            }
            self.number("double", 0.5);
            self.end_row();
        }
        self
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        let encoding = match self.encoding {
            Encoding::Ascii => "ascii",
            Encoding::Little => "binary_little_endian",
            Encoding::Big => "binary_big_endian",
        };
        let mut bytes = Vec::new();
        let format = format!("format {encoding} 1.0");
        let lines = ["ply", &format].into_iter().chain(self.header.iter().map(String::as_str)).chain(["end_header"]);
        for line in lines {
            bytes.extend_from_slice(line.as_bytes());
            bytes.extend_from_slice(self.line_end.as_bytes());
        }
        bytes.extend_from_slice(&self.body);
        bytes
    }

    fn end_row(&mut self) {
        if self.encoding == Encoding::Ascii {
            self.body.extend_from_slice(self.line_end.as_bytes());
        }
    }

    fn number(&mut self, kind: &str, v: f64) {
        macro_rules! put {
            ($type:ty) => {{
                let raw = v as $type;
                if self.encoding == Encoding::Big { raw.to_be_bytes().to_vec() } else { raw.to_le_bytes().to_vec() }
            }};
        }
        let raw = if self.encoding == Encoding::Ascii {
            format!("{v} ").into_bytes()
        } else {
            match kind {
                "char" | "int8" => put!(i8),
                "uchar" | "uint8" => put!(u8),
                "short" | "int16" => put!(i16),
                "ushort" | "uint16" => put!(u16),
                "int" | "int32" => put!(i32),
                "uint" | "uint32" => put!(u32),
                "float" | "float32" => put!(f32),
                "double" | "float64" => put!(f64),
                other => panic!("{other}"),
            }
        };
        self.body.extend(raw);
    }
}

/// One entry of an .sfl directory: tag, type, count, bytes.
pub(crate) type Entry = (u16, u16, u32, Vec<u8>);

pub(crate) fn sfl_u32(tag: u16, values: &[u32]) -> Entry {
    (tag, 4, values.len() as u32, values.iter().flat_map(|v| v.to_be_bytes()).collect())
}

pub(crate) fn sfl_u16(tag: u16, values: &[u16]) -> Entry {
    (tag, 2, values.len() as u32, values.iter().flat_map(|v| v.to_be_bytes()).collect())
}

pub(crate) fn sfl_f32(tag: u16, values: &[f32]) -> Entry {
    (tag, 6, values.len() as u32, values.iter().flat_map(|v| v.to_be_bytes()).collect())
}

/// An .sfl file of these directories, chained depth first.
pub(crate) fn sfl_file(directories: &[Vec<Entry>]) -> Vec<u8> {
    let mut bytes = b"GFLF\0\0\0\0SFLF\0\0\0\0\0\0\0\x14".to_vec();
    for (i, entries) in directories.iter().enumerate() {
        let start = bytes.len();
        let mut values = start + 12 * (entries.len() + 1);
        let mut tail = Vec::new();
        for (tag, kind, count, data) in entries {
            bytes.extend(tag.to_be_bytes());
            bytes.extend(kind.to_be_bytes());
            bytes.extend(count.to_be_bytes());
            // A data block is always out of line.
            if data.len() <= 4 && *kind != 10 {
                let mut inline = data.clone();
                inline.resize(4, 0);
                bytes.extend(inline);
            } else {
                bytes.extend((values as u32).to_be_bytes());
                tail.extend_from_slice(data);
                tail.resize(tail.len().next_multiple_of(4), 0);
                values = start + 12 * (entries.len() + 1) + tail.len();
            }
        }
        let next = if i + 1 == directories.len() { 0 } else { values as u32 };
        bytes.extend([0, 1, 0, 11, 0, 0, 0, 1]);
        bytes.extend(next.to_be_bytes());
        bytes.extend(tail);
        assert_eq!(bytes.len(), values);
    }
    bytes
}

/// A surfel set and its one resolution: (bit, offset) of the properties, size and bytes of the records.
pub(crate) fn sfl_set(
    mask: u32,
    properties: &[(u16, u32)],
    size: u32,
    records: &[u8],
    more: &[Entry],
) -> [Vec<Entry>; 2] {
    let (bits, offsets): (Vec<u16>, Vec<u32>) = properties.iter().copied().unzip();
    let mut set = vec![
        sfl_u32(0x0140, &[1]),
        sfl_u32(0x0151, &[size]),
        sfl_u32(0x0152, &[mask]),
        sfl_u16(0x0153, &bits),
        sfl_u32(0x0154, &offsets),
    ];
    set.extend_from_slice(more);
    let resolution = vec![
        sfl_u32(0x0170, &[records.len() as u32 / size.max(1)]),
        (0x0171, 10, records.len() as u32, records.to_vec()),
    ];
    [set, resolution]
}

/// Bytes of big-endian floats.
pub(crate) fn be(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_be_bytes()).collect()
}

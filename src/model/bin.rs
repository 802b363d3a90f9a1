//! Our own binary format: complete surfels in columns, exact and fast to load. docs/bin-format.md describes it byte by
//! byte.

use std::io::{self, Write};
use std::path::Path;

use glam::{DVec3, Vec3};

use super::error::{ModelError, ParseError, quote};
use super::format::BIN_MAGIC;
use super::store;
use super::surfels::{Material, Normalisation, Surfels};
use super::tidy::{MAX_COORDINATE, usable};

const VERSION: u32 = 1;
const HEADER: usize = 64;
const CRC_AT: usize = 48;
const HAS_MATERIAL: u32 = 1;
const HAS_VELOCITY: u32 = 2;
const TWO_SIDED: u32 = 4;
const SIGNS_ESTIMATED: u32 = 8;

/// Reads a file into surfels.
///
/// # Errors
/// The error names the byte. The magic or the version is wrong, there are unknown columns, the length does not fit the
/// count, the checksum is wrong, or there are surfels that no other reader would accept (not finite, without extent,
/// normals not of unit length).
pub(super) fn parse(bytes: &[u8]) -> Result<Surfels, ParseError> {
    let magic: [u8; 8] = field(bytes, 0)?;
    if magic != BIN_MAGIC {
        return Err(ParseError::byte(0, quote(&magic), quote(&BIN_MAGIC)));
    }
    let version = u32::from_le_bytes(field(bytes, 8)?);
    if version != VERSION {
        return Err(ParseError::byte(8, format!("version {version}"), format!("{VERSION}")));
    }
    let mask = u32::from_le_bytes(field(bytes, 12)?);
    if mask & !(HAS_MATERIAL | HAS_VELOCITY | TWO_SIDED | SIGNS_ESTIMATED) != 0 {
        return Err(ParseError::byte(
            12,
            format!("column mask {mask:#x}"),
            "bits 0 (material), 1 (velocity), 2 (two-sided) and 3 (signs estimated) only",
        ));
    }
    let count = u64::from_le_bytes(field(bytes, 16)?);
    let origin = [24, 32, 40].map(|at| field(bytes, at).map(f64::from_le_bytes));
    let [x, y, z] = origin;
    let origin = DVec3::new(x?, y?, z?);
    if !origin.is_finite() || origin.abs().max_element() > MAX_COORDINATE {
        return Err(ParseError::byte(24, format!("origin {origin}"), "finite coordinates up to 1e18"));
    }
    let length = file_length(count, mask);
    if length != Some(bytes.len() as u64) {
        let expected = length.map_or_else(|| "2^64 or more".to_owned(), |n| n.to_string());
        let found = format!("{count} surfels in a file of {} bytes", bytes.len());
        return Err(ParseError::byte(16, found, format!("a file of {expected} bytes: is it cut short?")));
    }
    let reserved: [u8; 12] = field(bytes, CRC_AT + 4)?;
    if reserved != [0; 12] {
        return Err(ParseError::byte(CRC_AT + 4, "reserved bytes that are not 0", "12 zeros"));
    }
    let found = u32::from_le_bytes(field(bytes, CRC_AT)?);
    let computed = checksum(bytes);
    if found != computed {
        let expected = format!("{computed:08x}: the file is damaged");
        return Err(ParseError::byte(CRC_AT, format!("checksum {found:08x}"), expected));
    }
    let mut columns = Columns { bytes, at: HEADER, count: count as usize };
    let position = columns.vectors();
    let surfels = Surfels {
        origin,
        position,
        axis_u: columns.vectors(),
        axis_v: columns.vectors(),
        normal: columns.vectors(),
        colour: columns.vectors(),
        material: if mask & HAS_MATERIAL == 0 { Vec::new() } else { columns.materials() },
        velocity: if mask & HAS_VELOCITY == 0 { Vec::new() } else { columns.vectors() },
        normalisation: Normalisation::default(),
        two_sided: mask & TWO_SIDED != 0,
        signs_estimated: mask & SIGNS_ESTIMATED != 0,
    };
    check(&surfels)?;
    Ok(surfels)
}

/// Writes surfels so that [`super::load()`] gives back the same bits.
///
/// # Errors
/// The file cannot be written (then no part of it is left), or the arrays differ in length.
pub fn write_bin(path: &Path, surfels: &Surfels) -> Result<(), ModelError> {
    store::check_columns(surfels)?;
    let mut mask = 0;
    if !surfels.material.is_empty() {
        mask |= HAS_MATERIAL;
    }
    if !surfels.velocity.is_empty() {
        mask |= HAS_VELOCITY;
    }
    if surfels.two_sided {
        mask |= TWO_SIDED;
    }
    if surfels.signs_estimated {
        mask |= SIGNS_ESTIMATED;
    }
    let mut header = [0; HEADER];
    let origin = surfels.origin.to_array().map(f64::to_le_bytes);
    let parts: [&[u8]; 5] = [
        &BIN_MAGIC,
        &VERSION.to_le_bytes(),
        &u32::to_le_bytes(mask),
        &(surfels.len() as u64).to_le_bytes(),
        origin.as_flattened(),
    ];
    for (to, from) in header.iter_mut().zip(parts.into_iter().flatten()) {
        *to = *from;
    }
    // The checksum precedes the columns. They are encoded twice, which needs no memory for the encoded bytes.
    let mut sum = Sum(crc32fast::Hasher::new());
    let summed = sum.write_all(&header).and_then(|()| write_columns(&mut sum, surfels));
    summed.map_err(|source| ModelError::Write { path: path.to_owned(), source })?;
    let crc = sum.0.finalize().to_le_bytes();
    for (to, from) in header.iter_mut().skip(CRC_AT).zip(crc) {
        *to = from;
    }
    store::write(path, |out| {
        out.write_all(&header)?;
        write_columns(out, surfels)
    })
}

fn write_columns(out: &mut impl Write, surfels: &Surfels) -> io::Result<()> {
    let s = surfels;
    for column in [&s.position, &s.axis_u, &s.axis_v, &s.normal, &s.colour] {
        write_vectors(out, column)?;
    }
    for m in &s.material {
        write_floats(out, &[m.ambient, m.diffuse, m.specular, m.shininess])?;
    }
    write_vectors(out, &s.velocity)
}

fn write_vectors(out: &mut impl Write, column: &[Vec3]) -> io::Result<()> {
    for v in column {
        write_floats(out, &v.to_array())?;
    }
    out.write_all(if column.len() % 2 == 1 { &[0; 4] } else { &[] })
}

fn write_floats<const N: usize>(out: &mut impl Write, values: &[f32; N]) -> io::Result<()> {
    out.write_all(values.map(f32::to_le_bytes).as_flattened())
}

/// A checksum that can be written to.
struct Sum(crc32fast::Hasher);

impl Write for Sum {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Length of a file, bytes; `None` if it needs more than 64 bits.
fn file_length(count: u64, mask: u32) -> Option<u64> {
    let vectors = 5 + u64::from(mask & HAS_VELOCITY != 0);
    let vector_column = count.checked_mul(12)?.checked_next_multiple_of(8)?;
    let material = if mask & HAS_MATERIAL == 0 { 0 } else { count.checked_mul(16)? };
    vector_column.checked_mul(vectors)?.checked_add(material)?.checked_add(HEADER as u64)
}

/// CRC-32 (IEEE) of the whole file, with its own four bytes taken as 0.
fn checksum(bytes: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(bytes.get(..CRC_AT).unwrap_or_default());
    hasher.update(&[0; 4]);
    hasher.update(bytes.get(CRC_AT + 4..).unwrap_or_default());
    hasher.finalize()
}

fn field<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], ParseError> {
    let found = bytes.get(at..).and_then(<[u8]>::first_chunk::<N>);
    found.copied().ok_or_else(|| ParseError::byte(at, "the end of the file", format!("a header of {HEADER} bytes")))
}

/// Copies columns out of a file after its length was checked.
struct Columns<'a> {
    bytes: &'a [u8],
    at: usize,
    count: usize,
}

impl Columns<'_> {
    fn vectors(&mut self) -> Vec<Vec3> {
        self.rows::<12>().map(|row| Vec3::from_array(floats(row))).collect()
    }

    fn materials(&mut self) -> Vec<Material> {
        let material = |row: &[u8; 16]| {
            let [ambient, diffuse, specular, shininess] = floats(row);
            Material { ambient, diffuse, specular, shininess }
        };
        self.rows::<16>().map(material).collect()
    }

    fn rows<const N: usize>(&mut self) -> impl Iterator<Item = &[u8; N]> {
        let column = self.bytes.get(self.at..).unwrap_or_default();
        self.at += (N * self.count).next_multiple_of(8);
        column.as_chunks::<N>().0.iter().take(self.count)
    }
}

fn floats<const N: usize, const M: usize>(row: &[u8; N]) -> [f32; M] {
    let mut values = [0.0; M];
    for (value, raw) in values.iter_mut().zip(row.as_chunks::<4>().0) {
        *value = f32::from_le_bytes(*raw);
    }
    values
}

/// Checks what every other part relies on. A checksum guards against accidents, not against programs that write
/// nonsense.
fn check(s: &Surfels) -> Result<(), ParseError> {
    let finite = |v: &Vec3| f64::from(v.abs().max_element()) <= MAX_COORDINATE && v.is_finite();
    let unit = |n: &Vec3| (n.length_squared() - 1.0).abs() < 1e-4;
    let sane =
        |m: &Material| [m.ambient, m.diffuse, m.specular, m.shininess].iter().all(|x| x.is_finite() && *x >= 0.0);
    let axes = s.axis_u.iter().zip(&s.axis_v);
    let faults = [
        ("position", s.position.iter().position(|v| !finite(v))),
        ("pair of axes", axes.into_iter().position(|(u, v)| !usable(*u, *v))),
        ("normal", s.normal.iter().position(|n| !unit(n))),
        ("colour", s.colour.iter().position(|c| !c.is_finite())),
        ("material", s.material.iter().position(|m| !sane(m))),
        ("velocity", s.velocity.iter().position(|v| !finite(v))),
    ];
    match faults.into_iter().find_map(|(what, fault)| fault.map(|i| (what, i))) {
        Some((what, i)) => {
            let expected = "finite numbers, axes that span a plane, unit normals, coefficients of at least 0";
            Err(ParseError::byte(HEADER, format!("an unusable {what} at surfel {i}"), expected))
        }
        None => Ok(()),
    }
}

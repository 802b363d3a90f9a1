//! Our own binary format: complete surfels in columns, exact and fast to load. docs/bin-format.md describes it byte by
//! byte.

use std::collections::BTreeSet;
use std::io::{self, Read, Seek as _, Write};
use std::ops::Range;
use std::path::Path;

use glam::{DVec3, Vec3};

use super::bin_columns::{COLUMNS, HEADER, Known, Places, Rows, byte_of, check_columns, check_levels, place_of};
use super::bin_stream::{Fault, Stream};
use super::error::{ModelError, ParseError, quote};
use super::format::BIN_MAGIC;
use super::levels::{Levels, TreeColumns, VERSION as LEVELS_VERSION, fingerprint, keep};
use super::normalisation::LARGEST;
use super::store;
use super::surfels::{KeptLevels, Material, Surfels, VelocityUnit};
use super::tidy::MAX_COORDINATE;
use crate::files::Input;

/// The version that is written. The first one is read too.
const VERSION: u32 = 2;
const CRC_AT: usize = 48;
/// Offset of the number of columns in version 2.
const COLUMNS_AT: usize = 52;
/// Bytes of a column's entry in the directory: name, type, components, offset, length.
const ENTRY: usize = 48;
const NAME: usize = 24;
// The first version has bits for columns, where the second one has a directory.
const HAS_MATERIAL: u32 = 1;
const HAS_VELOCITY: u32 = 2;
const TWO_SIDED: u32 = 4;
const SIGNS_ESTIMATED: u32 = 8;
/// Flag of version 2: velocities are per second and not per frame.
const PER_SECOND: u32 = 16;
const SPHERES: u32 = 32;

/// True if a file begins as ours does. The next byte to be read is its first one.
pub(super) fn is_at(input: &mut Input) -> io::Result<bool> {
    let mut magic = Vec::new();
    input.take(BIN_MAGIC.len() as u64).read_to_end(&mut magic)?;
    input.rewind()?;
    Ok(magic == BIN_MAGIC)
}

/// Reads bytes in memory, as [`read`].
pub(super) fn parse(bytes: &[u8]) -> Result<Surfels, ParseError> {
    read(bytes, bytes.len() as u64).map_err(|why| match why {
        Fault::Format(why) => why,
        Fault::Io(why) => ParseError::byte(0, format!("bytes that cannot be read: {why}"), "bytes"),
    })
}

/// Reads a file of `size` bytes into surfels, from its first byte to its last. Each column goes straight to its place:
/// the file is never whole in memory.
///
/// # Errors
/// The error names the byte. The magic or the version is wrong, columns are missing or do not fit the count, the
/// checksum is wrong, or there are surfels that no other reader would accept (not finite, without extent, normals not
/// of unit length).
pub(super) fn read(from: impl Read, size: u64) -> Result<Surfels, Fault> {
    let mut bytes = Stream::new(from, size, CRC_AT as u64..CRC_AT as u64 + 4);
    let mut header = vec![0; size.min(HEADER as u64) as usize];
    bytes.fill(&mut header)?;
    let magic: [u8; 8] = field(&header, 0)?;
    if magic != BIN_MAGIC {
        return Err(ParseError::byte(0, quote(&magic), quote(&BIN_MAGIC)).into());
    }
    let version = u32::from_le_bytes(field(&header, 8)?);
    if version == 0 || version > VERSION {
        return Err(ParseError::byte(8, format!("version {version}"), format!("1 to {VERSION}")).into());
    }
    let mask = u32::from_le_bytes(field(&header, 12)?);
    let (bits, known) = if version == 1 {
        (
            HAS_MATERIAL | HAS_VELOCITY | TWO_SIDED | SIGNS_ESTIMATED,
            "bits 0 (material), 1 (velocity), 2 (two-sided) and 3 (signs estimated) only",
        )
    } else {
        let known = "bits 2 (two-sided), 3 (signs estimated), 4 (velocities per second) and 5 (spheres) only";
        (TWO_SIDED | SIGNS_ESTIMATED | PER_SECOND | SPHERES, known)
    };
    if mask & !bits != 0 {
        return Err(ParseError::byte(12, format!("column mask {mask:#x}"), known).into());
    }
    let count = u64::from_le_bytes(field(&header, 16)?);
    let origin = [24, 32, 40].map(|at| field(&header, at).map(f64::from_le_bytes));
    let [x, y, z] = origin;
    let origin = DVec3::new(x?, y?, z?);
    if !origin.is_finite() || origin.abs().max_element() > MAX_COORDINATE {
        return Err(ParseError::byte(24, format!("origin {origin}"), "finite coordinates up to 1e18").into());
    }
    let places =
        if version == 1 { first_version(&header, size, count, mask)? } else { directory(&header, &mut bytes, count)? };
    let found = u32::from_le_bytes(field(&header, CRC_AT)?);
    let (mut surfels, tree) = columns(&mut bytes, &places)?;
    let computed = bytes.checksum()?;
    if found != computed {
        let expected = format!("{computed:08x}: the file is damaged");
        return Err(ParseError::byte(CRC_AT, format!("checksum {found:08x}"), expected).into());
    }
    let moves = !(surfels.velocity.is_empty() && surfels.acceleration.is_empty());
    surfels.origin = origin;
    surfels.velocity_unit = if moves && mask & PER_SECOND == 0 { VelocityUnit::Frame } else { VelocityUnit::Second };
    surfels.two_sided = mask & TWO_SIDED != 0;
    surfels.signs_estimated = mask & SIGNS_ESTIMATED != 0;
    surfels.spheres = mask & SPHERES != 0;
    if let Some(factors) = surfels.normalisation.known() {
        check_factors(factors, &places)?;
    }
    check_columns("", &surfels, &places)?;
    surfels.levels = levels(tree, &surfels, &places)?;
    Ok(surfels)
}

/// The columns of levels of detail, as they were read.
#[derive(Default)]
struct ReadTree {
    /// Version of its rules, and fingerprint of the surfels.
    of: Vec<[i64; 2]>,
    columns: TreeColumns,
    merged: Surfels,
}

/// The tree of levels of a file, if it has one, and it is of the version and the surfels that this program has.
fn levels(tree: ReadTree, surfels: &Surfels, places: &Places) -> Result<KeptLevels, ParseError> {
    let ReadTree { of, columns, merged } = tree;
    let Some(&[version, of]) = of.first() else { return Ok(KeptLevels::default()) };
    let Some(of) = u32::try_from(of).ok().filter(|_| version == LEVELS_VERSION) else {
        return Ok(KeptLevels::default());
    };
    check_columns("level_", &merged, places)?;
    let tree = Levels::from_columns(columns, merged, surfels.len()).map_err(|wrong| {
        let name = format!("level_{}", wrong.column);
        let column = COLUMNS.iter().position(|known| known.name == name).unwrap_or_default();
        let found = format!("row {} of `{name}`", wrong.row);
        ParseError::byte(byte_of(places, column, wrong.row), found, wrong.expected)
    })?;
    Ok(keep(of, tree))
}

/// The columns of a file, whose next byte is the first behind its directory.
fn columns<R: Read>(bytes: &mut Stream<R>, places: &Places) -> Result<(Surfels, ReadTree), Fault> {
    let (mut surfels, mut tree) = (Surfels::default(), ReadTree::default());
    let mut factors = Vec::new();
    let has_tree = place_of(places, "level_of").is_some();
    let there = places.iter().zip(&COLUMNS).filter_map(|(place, column)| Some((place.clone()?, column)));
    let there = there.filter(|(_, column)| has_tree || column.rows == Rows::Surfels);
    let mut there: Vec<(Range<usize>, &Known)> = there.collect();
    there.sort_by_key(|(place, _)| place.start);
    for (place, column) in there {
        bytes.skip_to(place.start as u64)?;
        let (s, merged, levels) = (&mut surfels, &mut tree.merged, &mut tree.columns);
        match column.name {
            "position" => bytes.vectors(&place, &mut s.position)?,
            "axis_u" => bytes.vectors(&place, &mut s.axis_u)?,
            "axis_v" => bytes.vectors(&place, &mut s.axis_v)?,
            "normal" => bytes.vectors(&place, &mut s.normal)?,
            "colour" => bytes.vectors(&place, &mut s.colour)?,
            "material" => bytes.floats::<4, 16, _>(&place, &mut s.material, material)?,
            "velocity" => bytes.vectors(&place, &mut s.velocity)?,
            "normalisation" => bytes.floats::<1, 4, _>(&place, &mut factors, |[factor]| factor)?,
            "opacity" => bytes.floats::<1, 4, _>(&place, &mut s.opacity, |[opacity]| opacity)?,
            "acceleration" => bytes.vectors(&place, &mut s.acceleration)?,
            "id" => bytes.rows(&place, &mut s.id, |row: &[u8; 8]| i64::from_le_bytes(*row))?,
            "level_of" => bytes.rows(&place, &mut tree.of, whole::<2, 16>)?,
            "level_node" => bytes.rows(&place, &mut levels.ranges, whole::<4, 32>)?,
            "level_box" => bytes.floats::<6, 24, _>(&place, &mut levels.corners, |row| row)?,
            "level_axis" => bytes.vectors(&place, &mut levels.axis)?,
            "level_errors" => bytes.floats::<4, 16, _>(&place, &mut levels.errors, |row| row)?,
            "level_along" => bytes.floats::<6, 24, _>(&place, &mut levels.along, |row| row)?,
            "level_position" => bytes.vectors(&place, &mut merged.position)?,
            "level_axis_u" => bytes.vectors(&place, &mut merged.axis_u)?,
            "level_axis_v" => bytes.vectors(&place, &mut merged.axis_v)?,
            "level_normal" => bytes.vectors(&place, &mut merged.normal)?,
            "level_colour" => bytes.vectors(&place, &mut merged.colour)?,
            "level_share" => bytes.floats::<1, 4, _>(&place, &mut levels.share, |[share]| share)?,
            "level_alike" => bytes.floats::<1, 4, _>(&place, &mut levels.alike, |[alike]| alike)?,
            "level_material" => bytes.floats::<4, 16, _>(&place, &mut merged.material, material)?,
            "level_opacity" => bytes.floats::<1, 4, _>(&place, &mut merged.opacity, |[opacity]| opacity)?,
            "level_velocity" => bytes.vectors(&place, &mut merged.velocity)?,
            "level_acceleration" => bytes.vectors(&place, &mut merged.acceleration)?,
            "level_velocities" => bytes.floats::<10, 40, _>(&place, &mut levels.rates[0], |row| row)?,
            "level_accelerations" => bytes.floats::<10, 40, _>(&place, &mut levels.rates[1], |row| row)?,
            // A column that this version knows, and does not keep.
            _ => bytes.skip_to(place.end as u64)?,
        }
    }
    if !factors.is_empty() {
        surfels.normalisation = factors.into();
    }
    Ok((surfels, tree))
}

/// The columns of the first version: they follow the header in their order.
fn first_version(header: &[u8], size: u64, count: u64, mask: u32) -> Result<Places, ParseError> {
    let mut places = Places::default();
    let mut end = Some(HEADER as u64);
    for (place, column) in places.iter_mut().zip(&COLUMNS) {
        let is_there = match column.name {
            "material" => mask & HAS_MATERIAL != 0,
            "velocity" => mask & HAS_VELOCITY != 0,
            _ => column.required,
        };
        if is_there {
            let (start, length) = (end, column.length(count));
            let stop = start.zip(length).and_then(|(start, length)| start.checked_add(length));
            end = stop.and_then(|stop| stop.checked_next_multiple_of(8));
            // An end beyond the file is found below.
            *place = start.zip(stop).map(|(start, stop)| start as usize..stop as usize);
        }
    }
    if end != Some(size) {
        let expected = end.map_or_else(|| "2^64 or more".to_owned(), |n| n.to_string());
        let found = format!("{count} surfels in a file of {size} bytes");
        return Err(ParseError::byte(16, found, format!("a file of {expected} bytes: is it cut short?")));
    }
    let reserved: [u8; 12] = field(header, CRC_AT + 4)?;
    if reserved != [0; 12] {
        return Err(ParseError::byte(CRC_AT + 4, "reserved bytes that are not 0", "12 zeros"));
    }
    Ok(places)
}

/// The columns of the second version: a directory follows the header, and the columns follow the directory in its
/// order. Columns of other names are skipped.
fn directory<R: Read>(header: &[u8], bytes: &mut Stream<R>, count: u64) -> Result<Places, Fault> {
    let columns = u32::from_le_bytes(field(header, COLUMNS_AT)?);
    let reserved: [u8; 8] = field(header, COLUMNS_AT + 4)?;
    if reserved != [0; 8] {
        return Err(ParseError::byte(COLUMNS_AT + 4, "reserved bytes that are not 0", "8 zeros").into());
    }
    let left = bytes.size.saturating_sub(HEADER as u64);
    let entries = u64::from(columns) * ENTRY as u64;
    if entries > left {
        let expected = format!("at most {}: {left} bytes are left", left / ENTRY as u64);
        return Err(ParseError::byte(COLUMNS_AT, format!("{columns} columns"), expected).into());
    }
    let mut places = Places::default();
    let mut names = BTreeSet::new();
    let mut end = HEADER as u64 + entries;
    for at in (HEADER..).step_by(ENTRY).take(columns as usize) {
        let mut entry = [0; ENTRY];
        bytes.fill(&mut entry)?;
        let raw: [u8; NAME] = field(&entry, 0)?;
        let name = name(&raw).ok_or_else(|| {
            let expected = "a name of a to z, 0 to 9 and _, filled up with zeros";
            ParseError::byte(at, format!("column name {}", quote(&raw)), expected)
        })?;
        if !names.insert(raw) {
            return Err(ParseError::byte(at, format!("a second column `{name}`"), "different names").into());
        }
        let kind = u32::from_le_bytes(field(&entry, NAME)?);
        let components = u32::from_le_bytes(field(&entry, NAME + 4)?);
        let start = u64::from_le_bytes(field(&entry, NAME + 8)?);
        let length = u64::from_le_bytes(field(&entry, NAME + 16)?);
        if start != end {
            let found = format!("column `{name}` at byte {start}");
            return Err(ParseError::byte(at + NAME + 8, found, format!("byte {end}, the next multiple of 8")).into());
        }
        let left = bytes.size.saturating_sub(start);
        if length > left {
            let found = format!("column `{name}` of {length} bytes");
            return Err(
                ParseError::byte(at + NAME + 16, found, format!("at most {left}: is the file cut short?")).into()
            );
        }
        end = (start + length).next_multiple_of(8);
        let Some((place, column)) = places.iter_mut().zip(&COLUMNS).find(|(_, known)| known.name == name) else {
            continue;
        };
        if (kind, components as usize) != (column.kind, column.components) {
            let found = format!("column `{name}` of type {kind} with {components} components");
            let expected = format!("type {} with {}", column.kind, column.components);
            return Err(ParseError::byte(at + NAME, found, expected).into());
        }
        let rows = match column.rows {
            Rows::Surfels => count,
            Rows::Tree => 1,
            // That those of one kind are as many is checked when all are known.
            Rows::Nodes | Rows::Merged => length / column.row() as u64,
        };
        if column.length(rows) != Some(length) {
            let what = if column.rows == Rows::Surfels { "surfel" } else { "row" };
            let found = format!("column `{name}` of {length} bytes for {rows} {what}s");
            let expected = format!("{} bytes for each {what}", column.row());
            return Err(ParseError::byte(at + NAME + 16, found, expected).into());
        }
        *place = Some(start as usize..(start + length) as usize);
    }
    if end != bytes.size {
        let found = format!("columns up to byte {end} in a file of {} bytes", bytes.size);
        return Err(ParseError::byte(COLUMNS_AT, found, "a file that ends with its last column").into());
    }
    let missing = places.iter().zip(&COLUMNS).find(|(place, column)| place.is_none() && column.required);
    if let Some((_, column)) = missing {
        return Err(ParseError::byte(HEADER, format!("no column `{}`", column.name), "one").into());
    }
    check_levels(&places)?;
    Ok(places)
}

/// The name in an entry; `None` if it is empty or has other characters.
fn name(raw: &[u8; NAME]) -> Option<&str> {
    let length = raw.iter().position(|&b| b == 0).unwrap_or(NAME);
    let (name, rest) = raw.split_at_checked(length)?;
    let is_plain = |b: &u8| b.is_ascii_lowercase() || b.is_ascii_digit() || *b == b'_';
    let fits = !name.is_empty() && name.iter().all(is_plain) && rest.iter().all(|&b| b == 0);
    if fits { std::str::from_utf8(name).ok() } else { None }
}

/// Writes surfels so that [`super::load()`] gives back the same bits. The normalisation of the kernels is computed
/// unless it is known, and written too.
///
/// # Errors
/// The file cannot be written (then no part of it is left), or the arrays differ in length.
pub fn write_bin(path: &Path, surfels: &Surfels) -> Result<(), ModelError> {
    store::check_columns(surfels)?;
    // A renderer puts the surfels in this order, whatever that of the file, which says which points are the same. What
    // shows all its surfels at all distances needs no tree: loose discs.
    let ordered = surfels.clone().spatially_ordered();
    let levels = if ordered.tolerance() >= ordered.median_radius() { ordered.tree() } else { None };
    let of = if levels.is_some() { fingerprint(&ordered) } else { 0 };
    drop(ordered);
    let tree = levels.as_ref().map(|levels| WrittenTree {
        of: [LEVELS_VERSION, of.into()],
        columns: levels.columns(),
        merged: levels.merged(),
    });
    let columns = Column::all(surfels, tree.as_ref());
    let mut mask = 0;
    if surfels.two_sided {
        mask |= TWO_SIDED;
    }
    if surfels.signs_estimated {
        mask |= SIGNS_ESTIMATED;
    }
    if surfels.spheres {
        mask |= SPHERES;
    }
    let moves = !(surfels.velocity.is_empty() && surfels.acceleration.is_empty());
    if moves && surfels.velocity_unit == VelocityUnit::Second {
        mask |= PER_SECOND;
    }
    let mut header = [0; HEADER];
    let origin = surfels.origin.to_array().map(f64::to_le_bytes);
    let parts: [&[u8]; 7] = [
        &BIN_MAGIC,
        &VERSION.to_le_bytes(),
        &u32::to_le_bytes(mask),
        &(surfels.len() as u64).to_le_bytes(),
        origin.as_flattened(),
        &[0; 4],
        &(columns.len() as u32).to_le_bytes(),
    ];
    for (to, from) in header.iter_mut().zip(parts.into_iter().flatten()) {
        *to = *from;
    }
    // The checksum precedes the columns. They are encoded twice, which needs no memory for the encoded bytes.
    let mut sum = Sum(crc32fast::Hasher::new());
    let summed = sum.write_all(&header).and_then(|()| write_columns(&mut sum, &columns));
    summed.map_err(|source| ModelError::Write { path: path.to_owned(), source })?;
    let crc = sum.0.finalize().to_le_bytes();
    for (to, from) in header.iter_mut().skip(CRC_AT).zip(crc) {
        *to = from;
    }
    store::write(path, |out| {
        out.write_all(&header)?;
        write_columns(out, &columns)
    })
}

/// A column to be written.
struct Column<'a> {
    known: &'static Known,
    values: Values<'a>,
}

/// Levels of detail to be written.
struct WrittenTree<'a> {
    of: [i64; 2],
    columns: TreeColumns,
    merged: &'a Surfels,
}

enum Values<'a> {
    Vectors(&'a [Vec3]),
    Materials(&'a [Material]),
    Numbers(&'a [f32]),
    Whole(&'a [i64]),
}

impl<'a> Column<'a> {
    /// The columns of a model that are not empty.
    fn all(s: &'a Surfels, tree: Option<&'a WrittenTree<'_>>) -> Vec<Self> {
        let own = [
            Values::Vectors(&s.position),
            Values::Vectors(&s.axis_u),
            Values::Vectors(&s.axis_v),
            Values::Vectors(&s.normal),
            Values::Vectors(&s.colour),
            Values::Materials(&s.material),
            Values::Vectors(&s.velocity),
            Values::Numbers(s.normalisation()),
            Values::Numbers(&s.opacity),
            Values::Vectors(&s.acceleration),
            Values::Whole(&s.id),
        ];
        let of_tree = tree.map(|WrittenTree { of, columns, merged }| {
            [
                Values::Whole(of),
                Values::Whole(columns.ranges.as_flattened()),
                Values::Numbers(columns.corners.as_flattened()),
                Values::Vectors(&columns.axis),
                Values::Numbers(columns.errors.as_flattened()),
                Values::Numbers(columns.along.as_flattened()),
                Values::Vectors(&merged.position),
                Values::Vectors(&merged.axis_u),
                Values::Vectors(&merged.axis_v),
                Values::Vectors(&merged.normal),
                Values::Vectors(&merged.colour),
                Values::Numbers(&columns.share),
                Values::Numbers(&columns.alike),
                Values::Materials(&merged.material),
                Values::Numbers(&merged.opacity),
                Values::Vectors(&merged.velocity),
                Values::Vectors(&merged.acceleration),
                Values::Numbers(columns.rates[0].as_flattened()),
                Values::Numbers(columns.rates[1].as_flattened()),
            ]
        });
        let values = own.into_iter().chain(of_tree.into_iter().flatten());
        let columns = COLUMNS.iter().zip(values).map(|(known, values)| Self { known, values });
        columns.filter(|column| column.known.required || column.bytes() > 0).collect()
    }

    fn bytes(&self) -> u64 {
        let bytes = match self.values {
            Values::Vectors(values) => size_of_val(values),
            Values::Materials(values) => size_of_val(values),
            Values::Numbers(values) => size_of_val(values),
            Values::Whole(values) => size_of_val(values),
        };
        bytes as u64
    }

    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        match self.values {
            Values::Vectors(values) => values.iter().try_for_each(|v| write_floats(out, &v.to_array())),
            Values::Materials(values) => {
                values.iter().try_for_each(|m| write_floats(out, &[m.ambient, m.diffuse, m.specular, m.shininess]))
            }
            Values::Numbers(values) => values.iter().try_for_each(|&value| write_floats(out, &[value])),
            Values::Whole(values) => values.iter().try_for_each(|value| out.write_all(&value.to_le_bytes())),
        }
    }
}

/// Writes the directory and the columns, each at a multiple of 8 bytes.
fn write_columns(out: &mut impl Write, columns: &[Column<'_>]) -> io::Result<()> {
    let mut start = (HEADER + ENTRY * columns.len()) as u64;
    for column in columns {
        let mut name = [0; NAME];
        for (to, from) in name.iter_mut().zip(column.known.name.bytes()) {
            *to = from;
        }
        out.write_all(&name)?;
        out.write_all(&column.known.kind.to_le_bytes())?;
        out.write_all(&(column.known.components as u32).to_le_bytes())?;
        out.write_all(&start.to_le_bytes())?;
        out.write_all(&column.bytes().to_le_bytes())?;
        start += column.bytes().next_multiple_of(8);
    }
    for column in columns {
        column.write(out)?;
        out.write_all(if column.bytes() % 8 == 4 { &[0; 4] } else { &[] })?;
    }
    Ok(())
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

fn field<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], ParseError> {
    let found = bytes.get(at..).and_then(<[u8]>::first_chunk::<N>);
    found.copied().ok_or_else(|| ParseError::byte(at, "the end of the file", format!("a header of {HEADER} bytes")))
}

fn whole<const N: usize, const BYTES: usize>(row: &[u8; BYTES]) -> [i64; N] {
    let mut numbers = [0; N];
    for (number, bytes) in numbers.iter_mut().zip(row.as_chunks::<8>().0) {
        *number = i64::from_le_bytes(*bytes);
    }
    numbers
}

fn material([ambient, diffuse, specular, shininess]: [f32; 4]) -> Material {
    Material { ambient, diffuse, specular, shininess }
}

/// Checks that factors are in the range that [`Surfels::normalisation`] gives.
fn check_factors(factors: &[f32], places: &Places) -> Result<(), ParseError> {
    match factors.iter().position(|&factor| !(factor > 0.0 && factor <= LARGEST)) {
        Some(i) => {
            let found = format!("the normalisation {} at surfel {i}", factors[i]);
            Err(ParseError::byte(byte_of(places, 7, i), found, format!("a factor above 0, at most {LARGEST}")))
        }
        None => Ok(()),
    }
}

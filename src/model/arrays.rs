//! Points of arrays: one array of `NumPy`, or several by their names (`.npz`).
//!
//! Columns with names are taken as those of tables (`columns`). An array of the archive gives its columns its own name:
//! `velocity` of three columns is `velocity_x`, `velocity_y` and `velocity_z`. Columns without any name are taken as
//! those of a text are (`xyz`).

#[cfg(feature = "formats")]
use super::archive::Archive;
use super::cloud::Cloud;
use super::colour_by::ColourBy;
use super::columns::{Columns, Finder, is_place, list};
use super::error::{ParseError, quote};
use super::npy::{Array, Column, MOST_FIELDS};
use super::ply_header::{Element, Property, PropertyKind};
use super::xyz;

/// Names of arrays of places.
const PLACES: [&str; 11] =
    ["points", "point", "positions", "position", "pos", "xyz", "coords", "vertices", "p", "x", "arr_0"];
/// Rows between two reports of progress.
const REPORT: usize = 1 << 16;

/// Reads a file of one array.
///
/// # Errors
/// It is not valid, or has no places.
pub(super) fn parse_npy(bytes: &[u8], by: Option<&ColourBy>, progress: &dyn Fn(f32)) -> Result<Cloud, ParseError> {
    let array = Array::parse(bytes)?;
    let Some(columns) = array.columns() else {
        let found = format!("an array of shape {:?}", array.shape());
        return Err(ParseError::byte(0, found, "a row for each point: shape (N, 3) or more columns, or records (N,)"));
    };
    let rows = array.shape().first().copied().unwrap_or(0);
    if columns.iter().all(|(name, _)| name.is_empty()) {
        let columns: Vec<Column<'_>> = columns.into_iter().map(|(_, column)| column).collect();
        return unnamed(&columns, rows, progress);
    }
    let columns = columns.into_iter().map(|(name, column)| (name.to_owned(), column)).collect();
    named(columns, rows, by, Vec::new(), progress)
}

/// Most bytes of all arrays of an archive that every file may hold, however small it is.
#[cfg(feature = "formats")]
const FREE_BYTES: u64 = 1 << 28;
/// Most bytes above [`FREE_BYTES`] for each byte of the archive: deflate shrinks real numbers less than tenfold.
#[cfg(feature = "formats")]
const MOST_GROWTH: u64 = 100;

/// Reads an archive of arrays.
///
/// # Errors
/// It is damaged, unpacks to more than its size allows, an array is not valid, or none has places.
#[cfg(feature = "formats")]
pub(super) fn parse_npz(bytes: &[u8], by: Option<&ColourBy>, progress: &dyn Fn(f32)) -> Result<Cloud, ParseError> {
    let mut archive = Archive::open(bytes, "an archive of arrays of NumPy")?;
    let mut left = FREE_BYTES.saturating_add(MOST_GROWTH.saturating_mul(bytes.len() as u64));
    let mut files = Vec::new();
    for name in archive.names() {
        let Some(bare) = name.strip_suffix(".npy") else { continue };
        let (_, content) = archive.entry(&name, usize::try_from(left).unwrap_or(usize::MAX))?;
        left -= content.len() as u64;
        files.push((bare.to_owned(), content));
    }
    parse_all(&files, by, progress)
}

/// Refuses an archive of arrays: what unpacks it is not part of this program.
#[cfg(not(feature = "formats"))]
pub(super) fn parse_npz(_: &[u8], _: Option<&ColourBy>, _: &dyn Fn(f32)) -> Result<Cloud, ParseError> {
    Err(super::capture::needs_formats("an .npz archive"))
}

/// Reads the arrays of an archive: names without `.npy`, and the bytes of each.
///
/// # Errors
/// One is not valid, or none has places.
#[cfg(feature = "formats")]
fn parse_all(files: &[(String, Vec<u8>)], by: Option<&ColourBy>, progress: &dyn Fn(f32)) -> Result<Cloud, ParseError> {
    let mut arrays = Vec::new();
    for (name, bytes) in files {
        arrays.push((name.to_lowercase(), Array::parse(bytes).map_err(|why| why.of(&quote(name.as_bytes())))?));
    }
    let of_places = |name: &str, array: &Array<'_>| {
        let columns = array.columns().unwrap_or_default();
        let records = columns.iter().any(|(field, _)| is_place(field));
        records || PLACES.contains(&name) && columns.len() >= 3 || matches!(name, "x") && columns.len() == 1
    };
    let places =
        PLACES.iter().find_map(|wanted| arrays.iter().find(|(name, array)| name == wanted && of_places(name, array)));
    let Some((of_places, array)) = places.or_else(|| arrays.iter().find(|(name, array)| of_places(name, array))) else {
        let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
        let expected = "an array `positions` of three columns, or `x`, `y` and `z`";
        return Err(ParseError::byte(0, format!("arrays {}", list(&names)), expected));
    };
    let rows = array.shape().first().copied().unwrap_or(0);
    if arrays.len() == 1 && array.columns().is_some_and(|columns| columns.iter().all(|(name, _)| name.is_empty())) {
        let columns: Vec<Column<'_>> = array.columns().unwrap_or_default().into_iter().map(|(_, c)| c).collect();
        return unnamed(&columns, rows, progress);
    }
    let (mut columns, mut idle) = (Vec::new(), Vec::new());
    for (name, array) in &arrays {
        let parts = array.columns().filter(|_| array.shape().first() == Some(&rows));
        let Some(parts) = parts else {
            idle.push(format!("{name} {:?}", array.shape()));
            continue;
        };
        let count = parts.len();
        for (k, (field, column)) in parts.into_iter().enumerate() {
            let vector = if name == of_places && count >= 3 { "position" } else { name };
            columns.push(match (field, count) {
                ("", 1) => (name.clone(), column),
                ("", 3..) if vector == "position" => {
                    (["x", "y", "z"].get(k).map_or_else(|| format!("{name}_{k}"), |part| (*part).to_owned()), column)
                }
                ("", 3) => (format!("{name}_{}", ["x", "y", "z"][k]), column),
                ("", _) => (format!("{name}_{k}"), column),
                (field, _) => (field.to_owned(), column),
            });
        }
    }
    let mut notes = Vec::new();
    if !idle.is_empty() {
        let idle: Vec<&str> = idle.iter().map(String::as_str).collect();
        notes.push(format!("arrays ignored: {} (not {rows} rows)", list(&idle)));
    }
    named(columns, rows, by, notes, progress)
}

/// Points of columns with names.
fn named(
    mut columns: Vec<(String, Column<'_>)>,
    rows: usize,
    by: Option<&ColourBy>,
    notes: Vec<String>,
    progress: &dyn Fn(f32),
) -> Result<Cloud, ParseError> {
    if columns.len() > MOST_FIELDS {
        return Err(ParseError::byte(0, format!("{} columns", columns.len()), format!("at most {MOST_FIELDS}")));
    }
    // The first of two with one name counts.
    let mut known = std::collections::HashSet::new();
    columns.retain(|(name, _)| known.insert(name.clone()));
    let property = |(name, column): &(String, Column<'_>)| Property {
        name: name.clone(),
        kind: PropertyKind::Scalar(column.scalar()),
    };
    let properties = columns.iter().map(property).collect();
    let element = Element { name: "array".to_owned(), count: rows as u64, properties, line: 1 };
    let mut cloud = Cloud { notes, ..Cloud::default() };
    let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    cloud.notes.push(format!("columns: {}", list(&names)));
    let mut finder = Finder::new(&element);
    let places = |_| ParseError::byte(0, format!("columns {}", list(&names)), "x, y and z among them");
    let wanted = Columns::find(&mut finder, &element, by, &mut cloud.notes).map_err(places)?;
    cloud.notes.extend(finder.ignored().map(|names| format!("columns ignored: {names}")));
    cloud.columns = finder.numbers();
    let taken: Vec<(usize, &(String, Column<'_>))> = finder
        .indices()
        .iter()
        .zip(&columns)
        .filter_map(|(index, column)| index.map(|index| (index, column)))
        .collect();
    let mut values = vec![0.0; finder.wanted()];
    for row in 0..rows {
        if row.is_multiple_of(REPORT) {
            progress(row as f32 / rows as f32);
        }
        for (index, (name, column)) in &taken {
            let value = column.value(row);
            if let Some(expected) = wanted.fault(*index, value) {
                return Err(ParseError::byte(
                    0,
                    format!("{value} in row {row} of {}", quote(name.as_bytes())),
                    expected,
                ));
            }
            values[*index] = value;
        }
        wanted.push(&values, &mut cloud);
    }
    super::ply_scales::scale(&mut cloud, &wanted, false);
    Ok(cloud)
}

/// Points of columns without names.
fn unnamed(columns: &[Column<'_>], rows: usize, progress: &dyn Fn(f32)) -> Result<Cloud, ParseError> {
    let value = |row: usize, column: usize| columns[column].value(row);
    // Rows are no lines.
    xyz::of_numbers([rows, columns.len()], value, progress)
        .map_err(|why| ParseError::byte(0, why.found, format!("{}, or a name for each column", why.expected)))
}

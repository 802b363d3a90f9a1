//! Points of columns of numbers in memory: those of an array of `NumPy`, and of several (`npz`).
//!
//! Columns with names are taken as those of tables (`columns`), columns without any name as those of a text (`xyz`).

use super::cloud::Cloud;
use super::colour_by::ColourBy;
use super::columns::{Columns, Finder, list};
use super::error::{ParseError, quote};
use super::npy::{Array, Column, MOST_FIELDS};
use super::ply_header::{Element, Property, PropertyKind};
use super::xyz;

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

/// Points of columns with names.
pub(super) fn named(
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
pub(super) fn unnamed(columns: &[Column<'_>], rows: usize, progress: &dyn Fn(f32)) -> Result<Cloud, ParseError> {
    let value = |row: usize, column: usize| columns[column].value(row);
    // Rows are no lines.
    xyz::of_numbers([rows, columns.len()], value, progress)
        .map_err(|why| ParseError::byte(0, why.found, format!("{}, or a name for each column", why.expected)))
}

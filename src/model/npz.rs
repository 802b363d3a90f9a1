//! Several arrays of `NumPy` in one zip archive (`.npz`): each is a column, or a vector, by its name.
//!
//! An array gives its columns its own name: `velocity` of three columns is `velocity_x`, `velocity_y` and `velocity_z`.

use super::archive::Archive;
use super::arrays::{named, unnamed};
use super::cloud::Cloud;
use super::colour_by::ColourBy;
use super::columns::{is_place, list};
use super::error::{ParseError, quote};
use super::npy::{Array, Column};

/// Names of arrays of places.
const PLACES: [&str; 11] =
    ["points", "point", "positions", "position", "pos", "xyz", "coords", "vertices", "p", "x", "arr_0"];
/// Most bytes of all arrays of an archive that every file may hold, however small it is.
const FREE_BYTES: u64 = 1 << 28;
/// Most bytes above [`FREE_BYTES`] for each byte of the archive: deflate shrinks real numbers less than tenfold.
const MOST_GROWTH: u64 = 100;

/// Reads an archive of arrays.
///
/// # Errors
/// It is damaged, unpacks to more than its size allows, an array is not valid, or none has places.
pub(super) fn parse(bytes: &[u8], by: Option<&ColourBy>, progress: &dyn Fn(f32)) -> Result<Cloud, ParseError> {
    let mut archive = Archive::open(bytes, "an archive of arrays of NumPy")?;
    let mut left = FREE_BYTES.saturating_add(MOST_GROWTH.saturating_mul(bytes.len() as u64));
    let mut files = Vec::new();
    for name in archive.names() {
        let Some(bare) = name.strip_suffix(".npy") else { continue };
        let (_, content) = archive.entry(&name, usize::try_from(left).unwrap_or(usize::MAX))?;
        left -= content.len() as u64;
        files.push((bare.to_owned(), content));
    }
    join(&files, by, progress)
}

/// Reads the arrays of an archive: names without `.npy`, and the bytes of each.
///
/// # Errors
/// One is not valid, or none has places.
fn join(files: &[(String, Vec<u8>)], by: Option<&ColourBy>, progress: &dyn Fn(f32)) -> Result<Cloud, ParseError> {
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

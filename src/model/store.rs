//! Writing model files.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::error::ModelError;
use super::surfels::Surfels;
use crate::files;

/// Writes the file `path`, which appears whole or not at all.
pub(super) fn write(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), ModelError> {
    files::replace_with(path, |temporary| {
        let mut writer = BufWriter::new(File::create(temporary)?);
        content(&mut writer)?;
        writer.flush()
    })
    .map_err(|source| ModelError::Write { path: path.to_owned(), source })
}

/// Checks that all arrays have one entry for each surfel.
pub(super) fn check_columns(surfels: &Surfels) -> Result<(), ModelError> {
    let expected = surfels.len();
    let known = surfels.normalisation.known();
    let columns = [
        ("axis_u", surfels.axis_u.len(), false),
        ("axis_v", surfels.axis_v.len(), false),
        ("normal", surfels.normal.len(), false),
        ("colour", surfels.colour.len(), false),
        ("material", surfels.material.len(), true),
        ("velocity", surfels.velocity.len(), true),
        ("acceleration", surfels.acceleration.len(), true),
        ("id", surfels.id.len(), true),
        ("opacity", surfels.opacity.len(), true),
        ("normalisation", known.map_or(expected, <[f32]>::len), false),
    ];
    for (column, found, optional) in columns {
        if found != expected && !(optional && found == 0) {
            return Err(ModelError::UnequalColumns { column, found, expected });
        }
    }
    Ok(())
}

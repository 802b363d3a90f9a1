//! Writing a model file so that no half-written file can be taken for a whole one.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use super::{ModelError, Surfels};

/// Writes `path` through a temporary file beside it that is renamed when complete, and removed when anything fails.
pub(super) fn write(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), ModelError> {
    write_then_rename(path, content).map_err(|source| ModelError::Write { path: path.to_owned(), source })
}

/// Checks that all arrays have one entry a surfel.
pub(super) fn check_columns(surfels: &Surfels) -> Result<(), ModelError> {
    let expected = surfels.len();
    let columns = [
        ("axis_u", surfels.axis_u.len(), false),
        ("axis_v", surfels.axis_v.len(), false),
        ("normal", surfels.normal.len(), false),
        ("colour", surfels.colour.len(), false),
        ("material", surfels.material.len(), true),
        ("velocity", surfels.velocity.len(), true),
    ];
    for (column, found, optional) in columns {
        if found != expected && !(optional && found == 0) {
            return Err(ModelError::UnequalColumns { column, found, expected });
        }
    }
    Ok(())
}

/// The temporary file; removed when dropped, unless it was renamed.
struct Temporary(PathBuf);

impl Drop for Temporary {
    fn drop(&mut self) {
        // It is gone after the rename; a failure to remove it has nobody to be told to.
        let _ = fs::remove_file(&self.0);
    }
}

fn write_then_rename(path: &Path, content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    static COUNTER: AtomicU32 = AtomicU32::new(0);
    let name = path.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"))?;
    let unique = format!(".{}.{}.tmp", std::process::id(), COUNTER.fetch_add(1, Ordering::Relaxed));
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(unique);
    let target = path.with_file_name(hidden);
    let file = File::create_new(&target)?;
    let temporary = Temporary(target);
    let mut writer = BufWriter::new(file);
    content(&mut writer)?;
    writer.flush()?;
    writer.get_ref().sync_all()?;
    drop(writer);
    fs::rename(&temporary.0, path)
}

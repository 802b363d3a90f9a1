//! Opens a model file safely and maps it into memory.
//!
//! Limit: if another process truncates the file while it is read, the system kills this process (`SIGBUS`). Readers
//! copy what they keep, so the risk ends when loading ends.

use std::fs::{File, FileType};
use std::io;
use std::path::Path;

use memmap2::Mmap;

use super::error::ModelError;
use crate::files;

/// The bytes of a regular file that is not empty. Directories, devices, pipes and sockets are refused without being
/// opened: opening a pipe would wait for its writer.
pub(super) fn map(path: &Path) -> Result<Mmap, ModelError> {
    let failed = |source| ModelError::Read { path: path.to_owned(), source };
    files::reads(path);
    let before = std::fs::metadata(path).map_err(failed)?;
    if !before.is_file() {
        return Err(ModelError::NotAFile { path: path.to_owned(), found: kind(before.file_type()) });
    }
    let file = File::open(path).map_err(failed)?;
    // The opened file is asked again: the name may mean another file by now.
    let opened = file.metadata().map_err(failed)?;
    if !opened.is_file() {
        return Err(ModelError::NotAFile { path: path.to_owned(), found: kind(opened.file_type()) });
    }
    if opened.len() == 0 {
        return Err(ModelError::EmptyFile { path: path.to_owned() });
    }
    map_file(&file).map_err(failed)
}

#[allow(unsafe_code, reason = "a memory map is a promise about other processes that Rust cannot check")]
fn map_file(file: &File) -> io::Result<Mmap> {
    // SAFETY: the map is read-only and private to the loader. If another process writes the file meanwhile, the bytes
    // may change between two reads: every parser checks the very values that it uses, and copies them.
    unsafe { Mmap::map(file) }
}

fn kind(file_type: FileType) -> &'static str {
    if file_type.is_dir() { "a directory" } else { "a device, pipe or socket" }
}

//! Files that appear whole or not at all.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// Writes `bytes` to `path`, replacing what was there in one step.
///
/// # Errors
/// The file cannot be written; then `path` is as it was, and nothing is left beside it.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    replace_with(path, |temporary| {
        let mut file = File::create(temporary)?;
        file.write_all(bytes)
    })
}

/// Lets `write` make a file under a temporary name in the directory of `path`, then moves it to `path` in one step.
///
/// # Errors
/// As `write` says, or the file cannot be moved; then `path` is as it was, and nothing is left beside it.
pub fn replace_with<E: From<io::Error>>(path: &Path, write: impl FnOnce(&Path) -> Result<(), E>) -> Result<(), E> {
    let temporary = Temporary(temporary_name(path)?);
    // Claimed here, so that two programs never write into one file.
    File::create_new(&temporary.0)?;
    write(&temporary.0)?;
    // A rename must not reach the disk before the data: after a power cut the file would be there, but empty.
    File::open(&temporary.0)?.sync_all()?;
    fs::rename(&temporary.0, path)?;
    Ok(())
}

/// Finds out whether files can be made in a directory, by making and removing one.
///
/// # Errors
/// They cannot.
pub fn check_writable(directory: &Path) -> io::Result<()> {
    let probe = Temporary(temporary_name(&directory.join("probe"))?);
    File::create_new(&probe.0).map(drop)
}

/// Removed when dropped; after the rename there is nothing left to remove.
struct Temporary(PathBuf);

impl Drop for Temporary {
    fn drop(&mut self) {
        // Nothing useful can be done where this fails.
        let _ = fs::remove_file(&self.0);
    }
}

/// A hidden name beside `path`, unlike that of any other running process or call. It keeps the extension, by which some
/// writers choose their format.
fn temporary_name(path: &Path) -> io::Result<PathBuf> {
    static CALLS: AtomicU32 = AtomicU32::new(0);
    let name = path.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "not a file name"))?;
    let call = CALLS.fetch_add(1, Ordering::Relaxed);
    let mut hidden = std::ffi::OsString::from(format!(".splatblur-{}-{call}-", std::process::id()));
    hidden.push(name);
    Ok(path.with_file_name(hidden))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn replaces_what_was_there() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        replace(&path, b"old").unwrap();
        replace(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(dir.path()), ["a.png"]);
    }

    #[test]
    fn a_failing_writer_leaves_nothing_and_keeps_the_old_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        replace(&path, b"old").unwrap();
        let failed: io::Result<()> = replace_with(&path, |temporary| {
            assert_eq!(temporary.extension(), path.extension());
            fs::write(temporary, b"half")?;
            Err(io::Error::other("the disk is full"))
        });
        assert_eq!(failed.unwrap_err().to_string(), "the disk is full");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(dir.path()), ["a.png"]);
    }

    #[test]
    fn a_target_that_cannot_be_replaced_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        fs::create_dir(&path).unwrap();
        assert!(replace(&path, b"new").is_err());
        assert_eq!(names(dir.path()), ["a.png"]);
        assert!(replace(&dir.path().join("no/such/a.png"), b"new").is_err());
        assert!(replace(Path::new("/"), b"new").is_err());
    }
}

//! Files: how they are opened to be read (`input`), whether they stand still meanwhile (`seen`), and how they appear
//! whole or not at all.

mod input;
mod seen;

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

pub(crate) use self::input::kind;
pub use self::input::{Input, InputError, of_system, open, read};
pub(crate) use self::seen::listed;
pub use self::seen::{Changed, Seen, Stamp, steady};

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
/// As `write` says, or the file cannot be moved; then `path` is as it was, and nothing is left beside it. A pipe, a
/// socket or a device is not replaced: whoever named it meant something else.
pub fn replace_with<E: From<io::Error>>(path: &Path, write: impl FnOnce(&Path) -> Result<(), E>) -> Result<(), E> {
    if let Ok(there) = fs::symlink_metadata(path)
        && !(there.is_file() || there.is_symlink())
    {
        let what = format!("it is {}, expected a regular file or none", kind(there.file_type()));
        return Err(io::Error::other(what).into());
    }
    let temporary = Temporary::claim(path)?;
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
    Temporary::claim(&directory.join("probe")).map(drop)
}

/// Our own file; removed when dropped. After the rename there is nothing left to remove.
struct Temporary(PathBuf);

impl Temporary {
    /// Makes an empty file beside `path`, under a name that no one else has: two programs never write into one file.
    ///
    /// Computers that share a directory may use the same process number, and a program that was killed leaves its file.
    /// Names that are taken are passed over, and left alone.
    fn claim(path: &Path) -> io::Result<Self> {
        loop {
            let name = temporary_name(path, CALLS.fetch_add(1, Ordering::Relaxed))?;
            match File::create_new(&name) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                made => return made.map(|_| Self(name)),
            }
        }
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // Nothing useful can be done where this fails.
        let _ = fs::remove_file(&self.0);
    }
}

/// The next number of a temporary name.
static CALLS: AtomicU32 = AtomicU32::new(0);

/// A hidden name beside `path`, for call number `call` of this process. It keeps the extension, by which some writers
/// choose their format.
fn temporary_name(path: &Path, call: u32) -> io::Result<PathBuf> {
    let name = path.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "not a file name"))?;
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

    /// Another computer's process has the same number, or it had it and was killed.
    #[test]
    fn names_of_others_are_passed_over_and_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        // More than the other tests of this process can use up meanwhile.
        let next = CALLS.load(Ordering::Relaxed);
        let taken =
            |path: &Path| (next..next + 500).map(|call| temporary_name(path, call).unwrap()).collect::<Vec<_>>();
        let others = [taken(&path), taken(&dir.path().join("probe"))].concat();
        for other in &others {
            fs::write(other, b"half").unwrap();
        }
        check_writable(dir.path()).unwrap();
        replace(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert!(others.iter().all(|other| fs::read(other).unwrap() == b"half"));
        assert_eq!(names(dir.path()).len(), others.len() + 1);
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

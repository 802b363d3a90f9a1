//! Files: how they are opened to be read (`input`), whether they stand still meanwhile (`seen`), how they appear whole
//! or not at all, and what decoders of pictures say (`pictures`).

mod input;
mod pictures;
mod seen;

use std::fs::{self, File};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

pub(crate) use self::input::kind;
pub use self::input::{Input, InputError, of_system, open, read};
pub(crate) use self::pictures::cause;
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
    check_replaceable(path)?;
    let temporary = Temporary::claim(path)?;
    write(&temporary.0)?;
    // A rename must not reach the disk before the data: after a power cut the file would be there, but empty.
    File::open(&temporary.0)?.sync_all()?;
    fs::rename(&temporary.0, path)?;
    Ok(())
}

/// Finds out whether a file may take the place of what is at `path`: of a regular file, a link, or nothing.
///
/// # Errors
/// It may not.
pub fn check_replaceable(path: &Path) -> io::Result<()> {
    match fs::symlink_metadata(path) {
        Ok(there) if !(there.is_file() || there.is_symlink()) => {
            Err(io::Error::other(format!("it is {}, expected a regular file or none", kind(there.file_type()))))
        }
        _ => Ok(()),
    }
}

/// Lets `write` make a file under a temporary name, then gives it the first of `paths` that nothing has: nothing is
/// ever replaced, whoever else makes files there at the same time. A link that leads nowhere has its name, too. All
/// paths are in one directory. Returns the path; `None` where all are taken.
///
/// # Errors
/// As `write` says, or the file cannot be made; then nothing is left.
pub fn create_with<E: From<io::Error>>(
    paths: impl IntoIterator<Item = PathBuf>,
    write: impl FnOnce(&Path) -> Result<(), E>,
) -> Result<Option<PathBuf>, E> {
    let mut paths = paths.into_iter().peekable();
    let Some(first) = paths.peek() else { return Ok(None) };
    let temporary = Temporary::claim(first)?;
    write(&temporary.0)?;
    File::open(&temporary.0)?.sync_all()?;
    for path in paths {
        if take_name(&temporary.0, &path, |from, to| fs::hard_link(from, to))? {
            return Ok(Some(path));
        }
    }
    Ok(None)
}

/// Gives a file a name, unless something has it; false: something has.
///
/// A second name (`link`) is refused where the name is taken, and shows the whole file at once. Where the file system
/// has no second names, the name is taken by an empty file, which the file replaces.
fn take_name(file: &Path, name: &Path, link: impl FnOnce(&Path, &Path) -> io::Result<()>) -> io::Result<bool> {
    let is_taken = |error: &io::Error| error.kind() == io::ErrorKind::AlreadyExists;
    match link(file, name) {
        Ok(()) => return Ok(true),
        Err(error) if is_taken(&error) => return Ok(false),
        Err(_) => {}
    }
    match File::create_new(name) {
        Ok(_) => fs::rename(file, name).map(|()| true),
        Err(error) if is_taken(&error) => Ok(false),
        Err(error) => Err(error),
    }
}

/// A file without a name. It ends with the programs that have it open, even where they are killed.
#[derive(Debug)]
pub struct Nameless(File);

impl Nameless {
    /// Makes one in the directory of `path`, where the disk is that of the file to come.
    ///
    /// # Errors
    /// No file can be made there.
    pub fn beside(path: &Path) -> io::Result<Self> {
        let temporary = Temporary::claim(path)?;
        File::options().read(true).write(true).open(&temporary.0).map(Self)
    }

    /// Its bytes.
    pub const fn file(&self) -> &File {
        &self.0
    }

    /// Copies it to `path`, replacing what was there in one step.
    ///
    /// # Errors
    /// As [`replace`].
    pub fn replace(&mut self, path: &Path) -> io::Result<()> {
        replace_with(path, |temporary| self.copy(temporary))
    }

    /// Copies it to the first of `paths` that nothing has, as [`create_with`] does.
    ///
    /// # Errors
    /// As [`create_with`].
    pub fn create(&mut self, paths: impl IntoIterator<Item = PathBuf>) -> io::Result<Option<PathBuf>> {
        create_with(paths, |temporary| self.copy(temporary))
    }

    fn copy(&mut self, to: &Path) -> io::Result<()> {
        self.0.rewind()?;
        io::copy(&mut self.0, &mut File::create(to)?).map(drop)
    }
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

    /// `a-1`, `a-2`, ... in a directory.
    fn numbered(dir: &Path) -> impl Iterator<Item = PathBuf> {
        (1..=40).map(move |number| dir.join(format!("a-{number}")))
    }

    #[test]
    fn a_new_file_takes_the_next_name_and_replaces_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let create = |bytes: &[u8]| {
            create_with(numbered(dir.path()), |temporary| fs::write(temporary, bytes)).unwrap().map(|path| {
                assert_eq!(fs::read(&path).unwrap(), bytes);
                path.file_name().unwrap().to_str().unwrap().to_owned()
            })
        };
        fs::write(dir.path().join("a-1"), "old").unwrap();
        fs::create_dir(dir.path().join("a-2")).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink("nowhere", dir.path().join("a-3")).unwrap();
        #[cfg(not(unix))]
        fs::write(dir.path().join("a-3"), "").unwrap();
        assert_eq!([create(b"new"), create(b"newer")], [Some("a-4".to_owned()), Some("a-5".to_owned())]);
        assert_eq!(fs::read(dir.path().join("a-1")).unwrap(), b"old");
        assert!(!dir.path().join("nowhere").exists());
        assert_eq!(names(dir.path()), ["a-1", "a-2", "a-3", "a-4", "a-5"]);
        assert!((6..=40).all(|_| create(b"more").is_some()) && create(b"one too many").is_none());
        assert_eq!(names(dir.path()).len(), 40);
    }

    /// As on a FAT disk. The empty file that takes the name is not left where another has it.
    #[test]
    fn names_are_taken_without_second_names_too() {
        let dir = tempfile::tempdir().unwrap();
        let no_links = |_: &Path, _: &Path| Err(io::Error::from(io::ErrorKind::Unsupported));
        let [file, name] = ["file", "name"].map(|name| dir.path().join(name));
        for (name, bytes) in [(&file, "new"), (&name, "old")] {
            fs::write(name, bytes).unwrap();
        }
        assert!(!take_name(&file, &name, no_links).unwrap());
        assert_eq!((fs::read(&file).unwrap(), fs::read(&name).unwrap()), (b"new".to_vec(), b"old".to_vec()));
        fs::remove_file(&name).unwrap();
        assert!(take_name(&file, &name, no_links).unwrap());
        assert_eq!((names(dir.path()), fs::read(&name).unwrap()), (vec!["name".to_owned()], b"new".to_vec()));
        assert!(take_name(&name, &dir.path().join("no/such"), no_links).is_err());
    }

    #[test]
    fn many_at_a_time_get_names_of_their_own() {
        let dir = tempfile::tempdir().unwrap();
        let make = |maker: u8| {
            let one =
                |_| create_with(numbered(dir.path()), |temporary| fs::write(temporary, [maker])).unwrap().unwrap();
            (0..10).map(|i| (one(i), maker)).collect::<Vec<_>>()
        };
        let made = std::thread::scope(|scope| {
            let makers: Vec<_> = (0..4).map(|maker| scope.spawn(move || make(maker))).collect();
            makers.into_iter().flat_map(|maker| maker.join().unwrap()).collect::<Vec<_>>()
        });
        assert_eq!((made.len(), names(dir.path()).len()), (40, 40));
        assert!(made.iter().all(|(path, maker)| fs::read(path).unwrap() == [*maker]));
    }

    #[test]
    fn a_file_without_a_name_is_seen_when_it_is_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a-1");
        let mut nameless = Nameless::beside(&path).unwrap();
        nameless.file().write_all(b"whole").unwrap();
        assert_eq!(names(dir.path()), [""; 0]);
        nameless.replace(&path).unwrap();
        assert_eq!(nameless.create(numbered(dir.path())).unwrap(), Some(dir.path().join("a-2")));
        assert!(["a-1", "a-2"].iter().all(|name| fs::read(dir.path().join(name)).unwrap() == b"whole"));
        drop(nameless);
        assert_eq!(names(dir.path()), ["a-1", "a-2"]);
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

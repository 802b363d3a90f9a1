//! Which files were read, and whether they are still what they were then.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// How often a file that changes is read.
const TRIES: usize = 3;

/// By what a change of a regular file is seen: its size, the time of its last change (nanoseconds) and its inode.
///
/// Two limits. A change within one tick of the file system's clock that keeps the size is not seen; so a file is
/// opened only when its last change is some ticks old ([`super::open`]). A program that writes through a memory map of
/// its own may change the bytes long before the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    bytes: u64,
    /// Since 1970.
    changed: Duration,
    device: u64,
    inode: u64,
}

impl Stamp {
    /// The stamp of the file that a path names now; `None` where no regular file is there.
    pub(crate) fn of(path: &Path) -> Option<Self> {
        fs::metadata(path).ok().filter(Metadata::is_file).map(|about| Self::in_words_of(&about))
    }

    #[cfg(unix)]
    pub(super) fn in_words_of(about: &Metadata) -> Self {
        use std::os::unix::fs::MetadataExt as _;
        let seconds = u64::try_from(about.ctime()).unwrap_or(0);
        let changed = Duration::new(seconds, u32::try_from(about.ctime_nsec()).unwrap_or(0));
        Self { bytes: about.len(), changed, device: about.dev(), inode: about.ino() }
    }

    #[cfg(not(unix))]
    pub(super) fn in_words_of(about: &Metadata) -> Self {
        let changed = about.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok()).unwrap_or_default();
        Self { bytes: about.len(), changed, device: 0, inode: 0 }
    }

    /// Size of the file, bytes.
    pub(super) const fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Time since the last change; nothing where the clock of the file system is ahead of ours.
    pub(super) fn age(&self) -> Duration {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        now.saturating_sub(self.changed)
    }
}

/// Files that were read, or looked for, with what they were when they were opened first; `None`: no regular file was
/// there.
pub type Seen = BTreeMap<PathBuf, Option<Stamp>>;

/// A file was another each time that it had been read to its end.
#[derive(Debug, thiserror::Error)]
#[error("{} changes while it is read (tried {TRIES} times): is it being saved?", path.display())]
pub struct Changed {
    /// The file.
    pub path: PathBuf,
}

/// What a piece of work has read.
struct List {
    seen: Seen,
    /// True for [`steady`] work.
    steady: bool,
}

thread_local! {
    /// The lists of work of this thread that is under way, the outermost first.
    static LISTS: RefCell<Vec<List>> = const { RefCell::new(Vec::new()) };
}

/// Takes the last list away, even where the work panics.
struct Pop;

impl Drop for Pop {
    fn drop(&mut self) {
        LISTS.with_borrow_mut(Vec::pop);
    }
}

fn listing<T>(steady: bool, work: impl FnOnce() -> T) -> (T, Seen) {
    LISTS.with_borrow_mut(|lists| lists.push(List { seen: Seen::new(), steady }));
    let _pop = Pop;
    let done = work();
    (
        done,
        LISTS.with_borrow_mut(|lists| lists.last_mut().map(|list| std::mem::take(&mut list.seen))).unwrap_or_default(),
    )
}

/// Does `work`, and lists the files that this thread has read for it or tried to read.
///
/// Readers of many formats open files that other files name. The function that opens them tells it here, so that no
/// reader hands a list through, and none is forgotten. Work that reads on other threads is not seen.
pub(crate) fn listed<T>(work: impl FnOnce() -> T) -> (T, Seen) {
    let (done, seen) = listing(false, work);
    tell(&seen);
    (done, seen)
}

/// Does `work`, which reads files, again while they change under its hands, and gives what it made of files that
/// stood still: from their opening to the end of `work`, none of them was written, removed or replaced.
///
/// What fails is tried again, too, if a file has changed since: half a file is no broken one. Work within other steady
/// work is part of it, and is not tried again by itself.
///
/// # Errors
/// As `work` says, or the files change each of three times.
pub fn steady<T, E: From<Changed>>(mut work: impl FnMut() -> Result<T, E>) -> Result<T, E> {
    if LISTS.with_borrow(|lists| lists.iter().any(|list| list.steady)) {
        return work();
    }
    let mut path = PathBuf::new();
    for _ in 0..TRIES {
        let (done, seen) = listing(true, &mut work);
        match seen.iter().find(|(path, stamp)| Stamp::of(path) != **stamp) {
            None => {
                tell(&seen);
                return done;
            }
            Some((changed, _)) => path.clone_from(changed),
        }
    }
    Err(Changed { path }.into())
}

/// Tells that a file was opened, or that there was none to be opened.
pub(super) fn saw(path: &Path, stamp: Option<Stamp>) {
    LISTS.with_borrow_mut(|lists| {
        if let Some(list) = lists.last_mut() {
            // What was read first counts: a file that is another at the second reading has changed.
            list.seen.entry(path.to_owned()).or_insert(stamp);
        }
    });
}

/// Work within other work is part of it.
fn tell(seen: &Seen) {
    for (path, stamp) in seen {
        saw(path, *stamp);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{InputError, read};
    use super::*;

    fn text(path: &Path) -> Result<String, InputError> {
        read(path, u64::MAX).map(|bytes| String::from_utf8(bytes).unwrap())
    }

    #[test]
    fn what_is_read_is_listed() {
        let names = |seen: Seen| seen.keys().map(|path| path.display().to_string()).collect::<Vec<_>>();
        let reads = |name: &str| drop(text(Path::new(name)));
        reads("no/before");
        let (inner, outer) = listed(|| {
            reads("no/b");
            let ((), inner) = listed(|| reads("no/a"));
            reads("no/b");
            inner
        });
        assert_eq!((names(inner), names(outer)), (vec!["no/a".to_owned()], vec!["no/a".to_owned(), "no/b".to_owned()]));
    }

    /// The size stays, and a tick of the clock passes while the file is open.
    #[test]
    fn a_file_that_changes_while_it_is_read_is_read_again() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        fs::write(&path, "old").unwrap();
        let mut tries = 0;
        let found = steady(|| {
            let found = text(&path)?;
            tries += 1;
            if tries == 1 {
                fs::write(&path, "new").unwrap();
            }
            Ok::<_, InputError>(found)
        });
        assert_eq!((found.unwrap().as_str(), tries), ("new", 2));
        let mut tries = 0;
        let found = steady(|| {
            tries += 1;
            let found = text(&path);
            fs::write(&path, "new").unwrap();
            found
        });
        let why = found.unwrap_err();
        assert!(matches!(&why, InputError::Changed(Changed { path: found }) if *found == path), "{why}");
        assert!(why.to_string().ends_with("a changes while it is read (tried 3 times): is it being saved?"), "{why}");
        assert_eq!(tries, 3);
    }

    #[test]
    fn an_error_counts_if_the_file_stood_still() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        for (after, expected) in [("whole", 2), ("", 1)] {
            fs::write(&path, "").unwrap();
            let mut tries = 0;
            let found = steady(|| {
                tries += 1;
                let found = text(&path)?;
                if tries == 1 && !after.is_empty() {
                    fs::write(&path, after).unwrap();
                }
                if found.is_empty() { Err(std::io::Error::other("empty").into()) } else { Ok::<_, InputError>(found) }
            });
            assert_eq!((found.is_ok(), tries), (!after.is_empty(), expected));
        }
    }

    /// Two files belong together, as a glTF text and its data: one is replaced while the other is read.
    #[test]
    fn files_that_belong_together_stand_still_together() {
        let dir = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| dir.path().join(name));
        let save = |text: &str| {
            for path in [&a, &b] {
                super::super::replace(path, text.as_bytes()).unwrap();
            }
        };
        save("1");
        let mut tries = 0;
        let found = steady(|| {
            tries += 1;
            let first = text(&a)?;
            if tries == 1 {
                save("2");
            }
            // Reading alone is steady by itself, and part of the whole here.
            Ok::<_, InputError>(first + &text(&b)?)
        });
        assert_eq!((found.unwrap().as_str(), tries), ("22", 2));
        // A file that was not there comes.
        let c = dir.path().join("c");
        let mut tries = 0;
        let found = steady(|| {
            tries += 1;
            let found = text(&c).unwrap_or_default();
            fs::write(&c, "3").unwrap();
            Ok::<_, InputError>(found)
        });
        assert!(found.is_err() && tries == 3, "it was written again");
    }
}

//! The one place that opens files to read them. A test of the repository forbids others.
//!
//! Input is a regular file. A directory, a device, a pipe or a socket is refused: reading it may wait for ever.

use std::fs::{self, File, FileType, Metadata, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use super::seen::{self, Changed, Stamp};

/// Age of a file's last change from which the file may be opened. It is some ticks of the clock by which file systems
/// tell times (4 to 10 ms), so that each later change has another time. A program that saves in pieces is not taken
/// for done between two of them.
const REST: Duration = Duration::from_millis(20);

/// Longest time that an opening waits for a file to come to rest.
const PATIENCE: Duration = Duration::from_secs(2);

/// Why a file is no input.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// It cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It is something else. It was not opened.
    #[error("it is {found}, expected a regular file")]
    NotAFile {
        /// What it is.
        found: &'static str,
    },
    /// It is larger than any such file.
    #[error("it has {bytes} bytes, expected at most {most}")]
    TooLarge {
        /// Its size, bytes.
        bytes: u64,
        /// Largest size that is read.
        most: u64,
    },
    /// It is written again and again.
    #[error("it is being written, and did not come to rest within {} s", PATIENCE.as_secs())]
    Restless,
    /// It is another each time that it was read.
    #[error(transparent)]
    Changed(#[from] Changed),
}

impl From<InputError> for io::Error {
    fn from(error: InputError) -> Self {
        match error {
            InputError::Io(error) => error,
            other => Self::other(other),
        }
    }
}

/// A regular file that was opened to be read. It reads as many bytes as the file had when it was opened, at most.
#[derive(Debug)]
pub struct Input {
    file: File,
    stamp: Stamp,
}

/// Opens a file to read it, once it rests.
///
/// Nothing waits for the other end of a pipe. A file that was written less than 20 ms ago is waited for, up to two
/// seconds. Whether it changes afterwards, [`super::steady`] finds out.
///
/// # Errors
/// There is no such file, it is no regular file, or it does not come to rest.
pub fn open(path: &Path) -> Result<Input, InputError> {
    let opened = rest(path).and_then(|()| open_now(path));
    seen::saw(
        path,
        match &opened {
            Ok(input) => Some(input.stamp),
            Err(_) => Stamp::of(path),
        },
    );
    opened
}

/// The bytes of a file of at most `most` bytes that stood still while it was read ([`super::steady`]).
///
/// # Errors
/// As [`open`], it is larger, or it changes each time.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>, InputError> {
    seen::steady(|| open(path)?.whole(most))
}

/// A text that the operating system makes while it is read, as those in `/proc`; `None` where there is none.
pub fn of_system(path: &Path) -> Option<String> {
    fs::read_to_string(path).ok()
}

/// Names the kind of a file that is not a regular one.
pub(crate) fn kind(about: FileType) -> &'static str {
    if about.is_dir() {
        return "a directory";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        if about.is_fifo() {
            return "a pipe";
        }
        if about.is_socket() {
            return "a socket";
        }
    }
    "a device"
}

/// Waits until the last change of a file is old enough, by the clock or because it was watched so long.
fn rest(path: &Path) -> Result<(), InputError> {
    let start = Instant::now();
    let mut watched: Option<(Stamp, Instant)> = None;
    loop {
        let stamp = stamp(&fs::metadata(path)?)?;
        let since = match watched {
            Some((before, since)) if before == stamp => since,
            _ => Instant::now(),
        };
        watched = Some((stamp, since));
        let Some(left) = REST.checked_sub(stamp.age().max(since.elapsed())).filter(|left| !left.is_zero()) else {
            return Ok(());
        };
        if start.elapsed() > PATIENCE {
            return Err(InputError::Restless);
        }
        thread::sleep(left);
    }
}

fn open_now(path: &Path) -> Result<Input, InputError> {
    let mut options = OpenOptions::new();
    options.read(true);
    // The name may mean a pipe since it was looked at: opening one must not wait for its writer.
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, libc::O_NONBLOCK | libc::O_NOCTTY);
    let file = options.open(path)?;
    let stamp = stamp(&file.metadata()?)?;
    Ok(Input { file, stamp })
}

fn stamp(about: &Metadata) -> Result<Stamp, InputError> {
    if about.is_file() {
        Ok(Stamp::in_words_of(about))
    } else {
        Err(InputError::NotAFile { found: kind(about.file_type()) })
    }
}

impl Input {
    /// Size of the file, bytes.
    pub const fn size(&self) -> u64 {
        self.stamp.bytes()
    }

    /// What the file was when it was opened.
    pub(crate) const fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// All bytes of a file of at most `most` bytes.
    ///
    /// # Errors
    /// It is larger, there is not enough memory, or its bytes cannot be read.
    pub fn whole(&mut self, most: u64) -> Result<Vec<u8>, InputError> {
        let size = self.size();
        if size > most {
            return Err(InputError::TooLarge { bytes: size, most });
        }
        let mut bytes = Vec::new();
        let room = usize::try_from(size).map_err(io::Error::other)?;
        bytes.try_reserve_exact(room).map_err(|_| io::Error::from(io::ErrorKind::OutOfMemory))?;
        self.rewind()?;
        self.read_to_end(&mut bytes)?;
        Ok(bytes)
    }
}

impl Read for Input {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let left = self.size().saturating_sub(self.file.stream_position()?);
        let room = to.len().min(usize::try_from(left).unwrap_or(usize::MAX));
        self.file.read(&mut to[..room])
    }
}

impl Seek for Input {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_are_opened() {
        let dir = tempfile::tempdir().unwrap();
        let words = |path: &Path| open(path).map(drop).unwrap_err().to_string();
        assert_eq!(words(dir.path()), "it is a directory, expected a regular file");
        assert!(
            matches!(open(&dir.path().join("none")), Err(InputError::Io(why)) if why.kind() == io::ErrorKind::NotFound)
        );
        #[cfg(unix)]
        {
            assert_eq!(words(Path::new("/dev/zero")), "it is a device, expected a regular file");
            let socket = dir.path().join("socket");
            let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
            assert_eq!(words(&socket), "it is a socket, expected a regular file");
            let pipe = dir.path().join("pipe");
            assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
            assert_eq!(words(&pipe), "it is a pipe, expected a regular file");
            // A pipe that took the place of a file since it was looked at.
            let why = open_now(&pipe).unwrap_err();
            assert_eq!(why.to_string(), "it is a pipe, expected a regular file");
        }
    }

    #[test]
    fn sizes_are_checked_before_memory_is_taken() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        fs::write(&path, "12345").unwrap();
        assert_eq!(read(&path, 5).unwrap(), b"12345");
        assert_eq!(read(&path, 4).unwrap_err().to_string(), "it has 5 bytes, expected at most 4");
        // A hole of a petabyte.
        if File::create(&path).unwrap().set_len(1 << 50).is_ok() {
            assert!(read(&path, u64::MAX).is_err());
        }
    }

    /// Bytes that are added behind the end while a file is read are no part of it.
    #[test]
    fn no_more_is_read_than_was_there() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        fs::write(&path, "12345").unwrap();
        let mut input = open(&path).unwrap();
        fs::write(&path, "1234567").unwrap();
        assert_eq!(input.whole(u64::MAX).unwrap(), b"12345");
    }

    #[test]
    fn a_file_is_opened_when_it_rests() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        fs::write(&path, "0").unwrap();
        let input = open(&path).unwrap();
        assert!(input.stamp().age() >= REST, "{:?}", input.stamp().age());
        // What it holds then is what was written last, though its size is the same.
        fs::write(&path, "1").unwrap();
        let before = Instant::now();
        assert_eq!(read(&path, 1).unwrap(), b"1");
        assert!(before.elapsed() + Duration::from_millis(10) >= REST, "{:?}", before.elapsed());
    }
}

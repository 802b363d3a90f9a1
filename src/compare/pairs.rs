//! Pictures that are named by a file, a folder, or a pattern such as `out/a.%04d.png`, and pairs of them.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use crate::time::FrameNumber;

/// Why pictures cannot be put together in pairs.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PairError {
    /// A sequence without a frame that the other has.
    #[error("{} has no frame {frame}, which the other has", path.display())]
    Lacks {
        /// The name of the sequence.
        path: PathBuf,
        /// The frame.
        frame: FrameNumber,
    },
    /// One picture and a sequence.
    #[error("{} is one picture, {} a sequence: nothing to pair", one.display(), sequence.display())]
    Unlike {
        /// The name of the picture.
        one: PathBuf,
        /// The name of the sequence.
        sequence: PathBuf,
    },
    /// A folder with more than one sequence.
    #[error("{} holds several sequences: name one, as {first} or {second}", folder.display())]
    Several {
        /// The folder.
        folder: PathBuf,
        /// Pattern of a sequence.
        first: String,
        /// Pattern of another one.
        second: String,
    },
    /// A folder without numbered pictures.
    #[error("{} holds no numbered PNG or EXR files", folder.display())]
    Empty {
        /// The folder.
        folder: PathBuf,
    },
    /// A pattern that no file has.
    #[error("no file is named like {}", pattern.display())]
    NoMatch {
        /// The pattern.
        pattern: PathBuf,
    },
    /// Two files of one frame.
    #[error("frame {frame} is there twice: {} and {}", first.display(), second.display())]
    Twice {
        /// The frame.
        frame: FrameNumber,
        /// A file.
        first: PathBuf,
        /// Another file.
        second: PathBuf,
    },
    /// A folder that cannot be read.
    #[error("cannot read the folder {}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// One picture, or a sequence by frame number.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Pictures {
    One(PathBuf),
    Sequence(BTreeMap<FrameNumber, PathBuf>),
}

impl Pictures {
    /// What `argument` names.
    fn find(argument: &Path) -> Result<Self, PairError> {
        if argument.is_dir() {
            return folder(argument);
        }
        let name = argument.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        match Pattern::parse(&name) {
            // A file may well have such a name.
            Some(_) if argument.exists() => Ok(Self::One(argument.to_owned())),
            Some(pattern) => sequence(argument, &pattern),
            None => Ok(Self::One(argument.to_owned())),
        }
    }
}

/// Two pictures that belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pair {
    /// Frame number; `None` of single pictures.
    pub frame: Option<FrameNumber>,
    /// File of the first name.
    pub a: PathBuf,
    /// File of the second name.
    pub b: PathBuf,
}

/// The pictures of two names, in pairs by frame number. Each name is a file, a folder with one numbered sequence, or a
/// pattern with one place for the frame number: `%d`, `%04d` or `####`.
///
/// # Errors
/// The two do not have the same frames, or a name is none of these.
pub fn pairs(a: &Path, b: &Path) -> Result<Vec<Pair>, PairError> {
    let lacks = |path: &Path, frame: FrameNumber| PairError::Lacks { path: path.to_owned(), frame };
    let unlike = |one: &Path, sequence: &Path| PairError::Unlike { one: one.to_owned(), sequence: sequence.to_owned() };
    match (Pictures::find(a)?, Pictures::find(b)?) {
        (Pictures::One(a), Pictures::One(b)) => Ok(vec![Pair { frame: None, a, b }]),
        (Pictures::Sequence(mine), Pictures::Sequence(mut others)) => {
            let mut pairs = Vec::new();
            for (frame, path) in mine {
                let other = others.remove(&frame).ok_or_else(|| lacks(b, frame))?;
                pairs.push(Pair { frame: Some(frame), a: path, b: other });
            }
            match others.keys().next() {
                Some(&frame) => Err(lacks(a, frame)),
                None => Ok(pairs),
            }
        }
        (Pictures::One(_), Pictures::Sequence(_)) => Err(unlike(a, b)),
        (Pictures::Sequence(_), Pictures::One(_)) => Err(unlike(b, a)),
    }
}

/// The numbered PNG and EXR files of a folder, which must be one sequence; others are passed over.
fn folder(directory: &Path) -> Result<Pictures, PairError> {
    let mut sequences: BTreeMap<(String, String), BTreeMap<FrameNumber, PathBuf>> = BTreeMap::new();
    for (name, path) in entries(directory)? {
        let Some((stem, extension)) = name.rsplit_once('.') else { continue };
        if !["png", "exr"].contains(&extension.to_ascii_lowercase().as_str()) || name.starts_with('.') {
            continue;
        }
        let at = number_at(stem);
        let Some(frame) = FrameNumber::from_padded(&stem[at..]) else { continue };
        let frames = sequences.entry((stem[..at].to_owned(), extension.to_owned())).or_default();
        insert(frames, frame, &path)?;
    }
    let mut names = sequences.keys().map(|(stem, extension)| format!("{stem}%04d.{extension}"));
    match (names.next(), names.next()) {
        (Some(first), Some(second)) => {
            return Err(PairError::Several { folder: directory.to_owned(), first, second });
        }
        (None, _) => return Err(PairError::Empty { folder: directory.to_owned() }),
        (Some(_), None) => {}
    }
    drop(names);
    Ok(Pictures::Sequence(sequences.into_values().next().unwrap_or_default()))
}

/// Start of the number that ends a name. Digits with `_` are one number where they look as frames between two others
/// do, `0001_5000` after a dot or at the start; else the digits after `_` are the number, as in `take12_0007`.
fn number_at(stem: &str) -> usize {
    let start = |text: &str| text.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let at = start(stem);
    if let Some(before) = stem[..at].strip_suffix('_')
        && stem.len() - at == FrameNumber::DECIMALS
        && before.len() - start(before) >= 4
    {
        let whole = sign_before(stem, start(before));
        if whole == 0 || stem[..whole].ends_with('.') {
            return whole;
        }
    }
    sign_before(stem, at)
}

/// Start of a number that starts at `digits`, its minus included: one after a dot or at the start of the name.
fn sign_before(stem: &str, digits: usize) -> usize {
    match stem[..digits].strip_suffix('-') {
        Some(before) if before.is_empty() || before.ends_with('.') => before.len(),
        _ => digits,
    }
}

fn sequence(argument: &Path, pattern: &Pattern) -> Result<Pictures, PairError> {
    let directory = argument.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut frames = BTreeMap::new();
    for (name, path) in entries(directory)? {
        if let Some(frame) = pattern.frame(&name) {
            insert(&mut frames, frame, &path)?;
        }
    }
    if frames.is_empty() {
        return Err(PairError::NoMatch { pattern: argument.to_owned() });
    }
    Ok(Pictures::Sequence(frames))
}

fn insert(frames: &mut BTreeMap<FrameNumber, PathBuf>, frame: FrameNumber, path: &Path) -> Result<(), PairError> {
    match frames.insert(frame, path.to_owned()) {
        Some(first) => Err(PairError::Twice { frame, first, second: path.to_owned() }),
        None => Ok(()),
    }
}

/// Names (those that are Unicode) and paths of a folder, in the order of names.
fn entries(directory: &Path) -> Result<Vec<(String, PathBuf)>, PairError> {
    let failed = |source| PairError::Folder { folder: directory.to_owned(), source };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(directory).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        if let Ok(name) = entry.file_name().into_string() {
            found.push((name, entry.path()));
        }
    }
    found.sort();
    Ok(found)
}

/// A file name with one place for the frame number: `%d`, `%04d` or `####`.
#[derive(Debug, PartialEq, Eq)]
struct Pattern {
    before: String,
    after: String,
}

impl Pattern {
    fn parse(name: &str) -> Option<Self> {
        let (at, length) = if let Some(at) = name.find('#') {
            (at, name[at..].len() - name[at..].trim_start_matches('#').len())
        } else {
            let at = name.find('%')?;
            let digits = name[at + 1..].bytes().take_while(u8::is_ascii_digit).count();
            name[at + 1 + digits..].starts_with('d').then_some((at, digits + 2))?
        };
        Some(Self { before: name[..at].to_owned(), after: name[at + length..].to_owned() })
    }

    fn frame(&self, name: &str) -> Option<FrameNumber> {
        FrameNumber::from_padded(name.strip_prefix(&self.before)?.strip_suffix(&self.after)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn directory(names: &[&str]) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        for name in names {
            std::fs::write(dir.path().join(name), "").unwrap();
        }
        dir
    }

    fn frames(pictures: Pictures) -> Vec<(f64, String)> {
        let Pictures::Sequence(frames) = pictures else { panic!("{pictures:?}") };
        let name = |path: PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
        frames.into_iter().map(|(frame, path)| (frame.get(), name(path))).collect()
    }

    #[test]
    fn folders() {
        let dir = directory(&["s.0002.png", "s.-0001.png", "s.0010.png", "notes.txt", "sheet.png", ".x.0001.png"]);
        let found = frames(Pictures::find(dir.path()).unwrap());
        assert_eq!(found.iter().map(|(f, _)| *f).collect::<Vec<_>>(), [-1.0, 2.0, 10.0]);
        assert_eq!(found[0].1, "s.-0001.png");
        // A minus between words is no sign.
        let found = frames(Pictures::find(directory(&["take-0007.exr"]).path()).unwrap());
        assert_eq!(found, [(7.0, "take-0007.exr".to_owned())]);
        // Frames between others; but a number of four digits after a word and `_` is a frame by itself.
        let found =
            frames(Pictures::find(directory(&["s.0002.png", "s.0001_5000.png", "s.-0000_5000.png"]).path()).unwrap());
        assert_eq!(found.iter().map(|(f, _)| *f).collect::<Vec<_>>(), [-0.5, 1.5, 2.0]);
        let found = frames(Pictures::find(directory(&["take0012_0007.exr"]).path()).unwrap());
        assert_eq!(found, [(7.0, "take0012_0007.exr".to_owned())]);
        for (names, hint) in [
            (&["a.0001.png", "b.0001.png"][..], "several sequences: name one, as a.%04d.png or b.%04d.png"),
            (&["a.0001.png", "a.0001.exr"], "several sequences"),
            (&["a.1.png", "a.01.png"], "frame 1 is there twice"),
            (&["a.png", "99999999999999999999.png"], "no numbered"),
            (&[], "no numbered"),
        ] {
            let error = format!("{:#}", Pictures::find(directory(names).path()).unwrap_err());
            assert!(error.contains(hint), "{error}");
        }
    }

    #[test]
    fn patterns() {
        let dir = directory(&[
            "s.0002.png",
            "s.-0001.png",
            "s.10.png",
            "s.x.png",
            "s.+3.png",
            "s.2.exr",
            "s.0001_5000.png",
            "t.0002.png",
        ]);
        for pattern in ["s.%04d.png", "s.%d.png", "s.####.png", "s.#.png"] {
            let found = frames(Pictures::find(&dir.path().join(pattern)).unwrap());
            assert_eq!(found.iter().map(|(f, _)| *f).collect::<Vec<_>>(), [-1.0, 1.5, 2.0, 10.0], "{pattern}");
        }
        assert!(Pictures::find(&dir.path().join("u.%04d.png")).is_err());
        assert!(Pictures::find(&dir.path().join("none/u.%04d.png")).is_err());
        // A name without a place for the number is a file, whether it exists or not.
        for name in ["50%.png", "a%s.png", "plain.png", "%", "%04"] {
            assert_eq!(Pictures::find(Path::new(name)).unwrap(), Pictures::One(name.into()));
        }
        let dir = directory(&["take#1.png"]);
        assert!(matches!(Pictures::find(&dir.path().join("take#1.png")).unwrap(), Pictures::One(_)));
    }

    #[test]
    fn pairs_have_the_same_frames() {
        let (a, b) = (directory(&["a.1.png", "a.2.png"]), directory(&["b.0001.exr", "b.0002.exr"]));
        let paired = pairs(a.path(), b.path()).unwrap();
        assert_eq!(paired.iter().map(|p| p.frame).collect::<Vec<_>>(), [1, 2].map(|frame| Some(frame.into())));
        std::fs::write(b.path().join("b.0003.exr"), "").unwrap();
        let error = pairs(a.path(), b.path()).unwrap_err().to_string();
        assert!(error.contains("has no frame 3"), "{error}");
        assert!(pairs(b.path(), a.path()).unwrap_err().to_string().contains("has no frame 3"));
        assert!(pairs(a.path(), Path::new("x.png")).unwrap_err().to_string().contains("nothing to pair"));
        assert!(pairs(Path::new("x.png"), a.path()).unwrap_err().to_string().contains("nothing to pair"));
    }
}

//! Where the files are that a scene names.

use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use super::dom::{FileRef, Source};
use super::error::{SceneError, quoted};
use crate::{files, model};

/// Finds the files that one scene names.
pub(super) struct Finder<'a> {
    source: &'a Source,
    /// Directories that relative paths are tried in, in this order.
    bases: Vec<PathBuf>,
    /// The directory that no path may leave, canonical.
    restrict: Option<PathBuf>,
}

impl<'a> Finder<'a> {
    pub(super) fn new(source: &'a Source, restrict: Option<&Path>) -> Result<Self, SceneError> {
        let restrict = restrict
            .map(|dir| directory(dir).map_err(|source| SceneError::RestrictTo { path: dir.to_owned(), source }))
            .transpose()?;
        let beside = source.path().parent().unwrap_or(Path::new("")).to_owned();
        let mut bases = vec![beside];
        if !bases[0].as_os_str().is_empty() {
            bases.push(PathBuf::new());
        }
        Ok(Self { source, bases, restrict })
    }

    /// The file, relative to the working directory, and a note if its name is written otherwise.
    pub(super) fn find(&self, file: &FileRef) -> Result<(PathBuf, Option<String>), SceneError> {
        let wanted = PathBuf::from(file.text.replace('\\', "/"));
        let mut tried = Vec::new();
        for base in &self.bases {
            let path = base.join(&wanted);
            if let Ok(Some(files)) = model::matching(&path) {
                for several in files {
                    self.permitted(file, several)?;
                }
                return Ok((path, None));
            }
            match fs::metadata(&path) {
                Ok(data) if data.is_file() => return Ok((self.permitted(file, path)?, None)),
                Ok(data) => tried.push(format!("{} ({})", path.display(), files::kind(data.file_type()))),
                Err(_) => tried.push(path.display().to_string()),
            }
            if wanted.is_absolute() {
                break;
            }
        }
        for base in &self.bases {
            if let Some(path) = in_any_case(base, &wanted) {
                let at = self.source.locate(file.at);
                let note = format!("{at}: no file {}, took {}", quoted(&file.text), path.display());
                return Ok((self.permitted(file, path)?, Some(note)));
            }
        }
        tried.dedup();
        Err(SceneError::MissingFile {
            at: self.source.locate(file.at),
            found: quoted(&file.text),
            tried: tried.join(", "),
        })
    }

    /// The path, unless it leads out of the directory that paths are restricted to.
    fn permitted(&self, file: &FileRef, path: PathBuf) -> Result<PathBuf, SceneError> {
        let Some(dir) = &self.restrict else { return Ok(path) };
        let at = || self.source.locate(file.at);
        match path.canonicalize() {
            Ok(real) if real.starts_with(dir) => Ok(path),
            Ok(real) => Err(SceneError::Restricted {
                at: at(),
                found: quoted(&file.text),
                real: real.into(),
                dir: dir.as_path().into(),
            }),
            // It was there a moment ago.
            Err(_) => {
                Err(SceneError::MissingFile { at: at(), found: quoted(&file.text), tried: path.display().to_string() })
            }
        }
    }
}

fn directory(dir: &Path) -> io::Result<PathBuf> {
    let real = dir.canonicalize()?;
    if real.is_dir() { Ok(real) } else { Err(io::ErrorKind::NotADirectory.into()) }
}

/// A regular file at `wanted` below `base` if upper and lower case are the same; the first by name if there are
/// several.
fn in_any_case(base: &Path, wanted: &Path) -> Option<PathBuf> {
    let mut path = base.to_owned();
    for component in wanted.components() {
        let Component::Normal(name) = component else {
            path.push(component);
            continue;
        };
        let exact = path.join(name);
        if exact.exists() {
            path = exact;
            continue;
        }
        let folded = name.to_str()?.to_lowercase();
        let here = if path.as_os_str().is_empty() { Path::new(".") } else { &path };
        let alike = |found: &std::ffi::OsString| found.to_str().is_some_and(|f| f.to_lowercase() == folded);
        let found = fs::read_dir(here).ok()?.filter_map(|e| Some(e.ok()?.file_name())).filter(alike).min()?;
        path.push(found);
    }
    fs::metadata(&path).ok()?.is_file().then_some(path)
}

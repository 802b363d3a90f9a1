//! Renderings that a report has finished, on disk, so that an interrupted report goes on where it was.
//!
//! `DIR/renderings/<frame>/<mode>.<machine>.exr` with `.json` beside it, which has the settings and the times.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use anyhow::Context as _;
use serde::{Deserialize, Serialize};
use splatblur::files;
use splatblur::film::Picture;
use splatblur::image::{self, Format};

/// The folder of a report.
pub(super) struct Store<'a> {
    pub(super) directory: &'a Path,
    /// Held while files are being written.
    pub(super) gate: &'a Mutex<()>,
    /// Take nothing from earlier runs.
    pub(super) fresh: bool,
}

/// What lies beside a picture.
#[derive(Serialize, Deserialize)]
struct Record {
    settings: String,
    /// Of the picture's file: a damaged one is rendered anew.
    crc32: u32,
    seconds: Vec<f64>,
}

impl Store<'_> {
    /// Path of a picture. Names of modes have nothing that a file name could not have, but for the separators.
    pub(super) fn path(&self, frame: i64, name: &str) -> PathBuf {
        let name: String = name
            .chars()
            .map(|c| match c {
                ':' | '=' => '-',
                '+' => '_',
                '@' => '.',
                other => other,
            })
            .collect();
        self.directory.join("renderings").join(frame.to_string()).join(name + ".exr")
    }

    /// The times of a rendering with these settings, if it is finished and sound.
    pub(super) fn finished(&self, path: &Path, settings: &str) -> Option<Vec<f64>> {
        if self.fresh {
            return None;
        }
        let record: Record = serde_json::from_slice(&bytes(&path.with_extension("json"))?).ok()?;
        let timed = !record.seconds.is_empty() && record.seconds.iter().all(|s| s.is_finite() && *s >= 0.0);
        let sound = timed && record.settings == settings && crc32fast::hash(&bytes(path)?) == record.crc32;
        sound.then_some(record.seconds)
    }

    /// Keeps a finished rendering.
    pub(super) fn keep(&self, path: &Path, picture: &Picture, settings: &str, seconds: &[f64]) -> anyhow::Result<()> {
        let context = || format!("cannot write {}", path.display());
        let _held = self.gate.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).with_context(context)?;
        }
        let bytes = image::encode(picture, Format::Exr, settings)?;
        let crc32 = crc32fast::hash(&bytes);
        let record = Record { settings: settings.to_owned(), crc32, seconds: seconds.to_vec() };
        // A picture without its record, or with that of another, is not finished.
        files::replace(&path.with_extension("json"), &serde_json::to_vec(&record)?).with_context(context)?;
        files::replace(path, &bytes).with_context(context)
    }
}

/// The bytes of a file that can be read to its end.
fn bytes(path: &Path) -> Option<Vec<u8>> {
    std::fs::metadata(path).ok()?.is_file().then(|| std::fs::read(path).ok())?
}

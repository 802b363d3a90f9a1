//! The folder of a report: finished renderings, from which an interrupted report goes on, and the report's files.
//!
//! `DIR/renderings/<frame>/<mode>.<backend>.exr` with `.json` beside it, which has the settings, the times and a
//! checksum.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use super::StudyError;
use super::report::page::page;
use super::report::{FramePictures, Study, csv};
use super::trial::Trial;
use crate::files;
use crate::film::Picture;
use crate::image::{self, Format};
use crate::options::PixelFilter;
use crate::time::FrameNumber;

/// The folder of a report.
#[derive(Clone, Copy, Debug)]
pub struct Store<'a> {
    /// The folder; it must be there.
    pub directory: &'a Path,
    /// Held while files are being written: whoever holds it may end the program and leave nothing half done.
    pub gate: &'a Mutex<()>,
    /// Take nothing from earlier runs.
    pub fresh: bool,
}

/// What stands beside a picture.
#[derive(Serialize, Deserialize)]
struct Record {
    settings: String,
    /// Checksum of the picture's file: a damaged one is rendered again.
    crc32: u32,
    seconds: Vec<f64>,
}

impl Store<'_> {
    /// File of a picture. Names of modes have no characters that a file name could not have, except the separators.
    pub(super) fn path(&self, frame: FrameNumber, name: &str) -> PathBuf {
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

    /// File of the reference with this pixel filter that judges the others.
    pub(super) fn path_of_judge(&self, trial: &Trial<'_>, frame: FrameNumber, filter: PixelFilter) -> PathBuf {
        self.path(frame, &format!("judge-{}", trial.name_of_judge(filter)))
    }

    /// The times of a rendering with these settings, if it is finished and sound; with `fresh`, never.
    pub(super) fn finished(&self, path: &Path, settings: &str) -> Option<Vec<f64>> {
        if self.fresh { None } else { times(path, settings) }
    }

    /// Keeps a finished rendering.
    pub(super) fn keep(
        &self,
        path: &Path,
        picture: &Picture,
        settings: &str,
        seconds: &[f64],
    ) -> Result<(), StudyError> {
        let bytes = image::encode(picture, Format::EXR, settings)?;
        let crc32 = crc32fast::hash(&bytes);
        let record = Record { settings: settings.to_owned(), crc32, seconds: seconds.to_vec() };
        let record = serde_json::to_vec(&record)?;
        let _held = self.gate.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|source| StudyError::Write { path: path.to_owned(), source })?;
        }
        // A picture without its record, or with that of another, is not finished.
        write(&path.with_extension("json"), &record)?;
        write(path, &bytes)
    }

    /// Writes `report.json`, `report.csv` and `index.html`, the page, whose path it returns.
    ///
    /// # Errors
    /// A picture cannot be encoded, or a file cannot be written.
    pub fn publish(&self, study: &Study, pictures: &[FramePictures]) -> Result<PathBuf, StudyError> {
        let (json, page) = (serde_json::to_vec_pretty(&study.json())?, page(study, pictures)?);
        let index = self.directory.join("index.html");
        let _held = self.gate.lock().unwrap_or_else(PoisonError::into_inner);
        write(&self.directory.join("report.json"), &json)?;
        write(&self.directory.join("report.csv"), csv(study).as_bytes())?;
        write(&index, page.as_bytes())?;
        Ok(index)
    }
}

/// The times of a rendering with these settings, if it is finished and sound.
pub(super) fn times(path: &Path, settings: &str) -> Option<Vec<f64>> {
    let record: Record = serde_json::from_slice(&bytes(&path.with_extension("json"))?).ok()?;
    let timed = !record.seconds.is_empty() && record.seconds.iter().all(|s| s.is_finite() && *s >= 0.0);
    let sound = timed && record.settings == settings && crc32fast::hash(&bytes(path)?) == record.crc32;
    sound.then_some(record.seconds)
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), StudyError> {
    files::replace(path, bytes).map_err(|source| StudyError::Write { path: path.to_owned(), source })
}

/// The bytes of a file that can be read.
fn bytes(path: &Path) -> Option<Vec<u8>> {
    files::read(path, u64::MAX).ok()
}

//! The files of a dataset, as they are written.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use anyhow::Context as _;
use serde::Serialize;
use splatblur::FrameNumber;
use splatblur::dataset::{self, DatasetError, Made, Recipe, TRANSFORMS};
use splatblur::files;
use splatblur::image::{self, ImageError};
use splatblur::renderer::Renderer;
use splatblur::scene::Scene;
use splatblur::study::provenance::Settings;

use super::FrameReport;

/// Where frames go, and what is made of them.
pub(super) struct Output<'a> {
    pub(super) scene: &'a Scene,
    pub(super) recipe: &'a Recipe,
    pub(super) seed: u64,
    pub(super) settings: &'a Settings,
    pub(super) directory: &'a Path,
}

/// What a file carries: the settings of its frame's blurred picture, and what a dataset adds.
#[derive(Serialize)]
struct FileSettings<'a> {
    file: &'a str,
    sharp: u32,
    response: String,
    noise: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    shake: Option<String>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    exact: bool,
    /// The sharp picture may have the name that the blurred one had before.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    held_out: bool,
    #[serde(flatten)]
    settings: Settings,
}

/// Why a frame was not written.
#[derive(Debug, thiserror::Error)]
pub(super) enum DatasetFrameError {
    #[error(transparent)]
    Made(#[from] DatasetError),
    #[error(transparent)]
    Written(#[from] ImageError),
    #[error("cannot make the directory {}", .0.display())]
    Directory(PathBuf, #[source] std::io::Error),
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

impl Output<'_> {
    /// The text that a file carries: equal texts, equal files.
    fn settings_of(&self, file: &str, frame: FrameNumber) -> Result<String, serde_json::Error> {
        let Recipe { sharp, response, noise, shake, exact, .. } = *self.recipe;
        let (response, noise) = (response.to_string(), noise.to_string());
        let shake = shake.map(|shake| shake.to_string());
        let (held_out, settings) = (self.recipe.holds_out(frame), self.settings.with_frame(frame));
        serde_json::to_string(&FileSettings { file, sharp, response, noise, shake, exact, held_out, settings })
    }

    /// Are all files of a frame there, whole and with these settings?
    pub(super) fn is_done(&self, frame: FrameNumber) -> anyhow::Result<bool> {
        for dataset::File { path, .. } in dataset::files(&self.scene.name, frame, self.recipe) {
            let (settings, path) = (self.settings_of(&path, frame)?, self.directory.join(path));
            if image::read_settings(&path).is_none_or(|found| found != settings) || !image::is_whole(&path) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Makes and writes a frame. `gate` is held while a file is being written.
    pub(super) fn frame(
        &self,
        renderer: &mut Renderer,
        gate: &Mutex<()>,
        frame: FrameNumber,
    ) -> Result<FrameReport, DatasetFrameError> {
        let start = Instant::now();
        let write = |file: &dataset::File, content: dataset::FileContents| {
            let settings = self.settings_of(&file.path, frame)?;
            let path = self.directory.join(&file.path);
            let folder = path.parent().unwrap_or(self.directory);
            let _held = gate.lock().unwrap_or_else(PoisonError::into_inner);
            fs::create_dir_all(folder).map_err(|source| DatasetFrameError::Directory(folder.to_owned(), source))?;
            Ok(content.write(&path, &settings)?)
        };
        let backend = renderer.backend();
        let Made { achieved, mean_error } =
            dataset::frame::<DatasetFrameError>(backend, self.scene, frame, self.recipe, self.seed, write)?;
        let seconds = start.elapsed().as_secs_f64();
        Ok(FrameReport { frame, skipped: false, seconds, auto: achieved, mean_error })
    }

    /// Writes the files that all frames share, of these `frames`; last of all the text of `transforms.json`.
    pub(super) fn conclude(&self, gate: &Mutex<()>, frames: &[FrameNumber], transforms: &str) -> anyhow::Result<()> {
        let depth = |file: &dataset::File| {
            let (_, planes) = image::read_planes(&self.directory.join(&file.path), &["Y"])?;
            Ok(planes.into_iter().next().unwrap_or_default())
        };
        let common = dataset::common_files::<DatasetFrameError>(self.scene, frames, self.recipe, self.seed, depth)?;
        self.forget_other_holds(&common)?;
        let files = common.iter().map(|file| (&*file.path, &*file.bytes)).chain([(TRANSFORMS, transforms.as_bytes())]);
        for (path, bytes) in files {
            let path = self.directory.join(path);
            let folder = path.parent().unwrap_or(self.directory);
            let _held = gate.lock().unwrap_or_else(PoisonError::into_inner);
            fs::create_dir_all(folder).with_context(|| format!("cannot make the directory {}", folder.display()))?;
            files::replace(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
        }
        Ok(())
    }

    /// Removes empty files `hold=n` of runs before that held out others: a reader takes the first that it finds.
    fn forget_other_holds(&self, common: &[dataset::CommonFile]) -> anyhow::Result<()> {
        let cannot = || format!("cannot look into {}", self.directory.display());
        for entry in fs::read_dir(self.directory).with_context(cannot)? {
            let entry = entry.with_context(cannot)?;
            let name = entry.file_name();
            let is_hold = name.to_str().is_some_and(|name| name.starts_with("hold="));
            let is_ours = common.iter().any(|file| name.to_str() == Some(&file.path));
            if is_hold && !is_ours && entry.metadata().is_ok_and(|about| about.is_file() && about.len() == 0) {
                let path = entry.path();
                fs::remove_file(&path).with_context(|| format!("cannot remove {}", path.display()))?;
            }
        }
        Ok(())
    }
}

//! What `render --json` prints. The long help of `render` lists the fields.

use std::path::Path;

use serde::Serialize;
use splatblur::render::Stats;

use super::sequence::Finished;
use super::settings::Settings;

/// `--json`.
#[derive(Serialize)]
pub(super) struct Report<'a> {
    pub(super) program: &'static str,
    pub(super) scene: &'a str,
    pub(super) directory: &'a Path,
    pub(super) backend: &'static str,
    pub(super) frames: Vec<FrameReport<'a>>,
    pub(super) load_seconds: f64,
    pub(super) seconds: f64,
    pub(super) notes: &'a [String],
    pub(super) ffmpeg: Option<String>,
    pub(super) settings: &'a Settings,
}

#[derive(Serialize)]
pub(super) struct FrameReport<'a> {
    frame: i64,
    path: &'a Path,
    skipped: bool,
    seconds: f64,
    samples: u64,
    surfels: u64,
    splats: u64,
    cpu_seconds: CpuSeconds,
}

#[derive(Serialize)]
struct CpuSeconds {
    project: f64,
    visibility: f64,
    attribute: f64,
    resolve: f64,
    total: f64,
}

impl<'a> FrameReport<'a> {
    pub(super) fn new(finished: &'a Finished) -> Self {
        let (seconds, stats) = finished.rendered.unwrap_or((0.0, Stats::default()));
        let [project, visibility, attribute, resolve] =
            [stats.project, stats.visibility, stats.attribute, stats.resolve].map(|pass| pass.as_secs_f64());
        let total = project + visibility + attribute + resolve;
        Self {
            frame: finished.frame,
            path: &finished.path,
            skipped: finished.rendered.is_none(),
            seconds,
            samples: stats.samples,
            surfels: stats.surfels,
            splats: stats.splats,
            cpu_seconds: CpuSeconds { project, visibility, attribute, resolve, total },
        }
    }
}

//! `splatblur report`: modes measured against the reference, as one HTML page with JSON and CSV.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Arc, Mutex};

use anyhow::Context as _;
use clap::Args;
use splatblur::compare::Limit;
use splatblur::study::{self, BackendKind, Contestant, Entry, Experiment, Store};

use super::common::{frames_of, open_directory, stop_on_interrupt};
use super::frames::{self, FrameList};
use super::output::{is_closed_pipe, print, say};
use super::progress::Steps;
use super::studio::ModelAlone;
use super::study::{Common, MODES, ReadyScene};

/// Measure modes against the ray-traced reference: an HTML page, JSON and CSV.
///
/// Renders each frame in each mode and on each backend in turn, after one rendering of each to warm up, measures the
/// times, and compares the pictures with the reference. Writes DIR/index.html, one file that needs no other and no
/// network, DIR/report.json, DIR/report.csv, and DIR/renderings, from which an interrupted report goes on when it is
/// started again.
#[derive(Debug, Args)]
#[command(after_long_help = format!("{}

Examples:
  Which mode, how many samples, how wrong, how slow:
    splatblur report scenes/spin.xml --frames 12 --modes supersample:8,supersample:32,bucket:8x4 --reference 4096 \\
      --out report
  As a gate: every mode, frame and backend must pass
    splatblur report scene.xml --frames 1..24 --modes supersample:32 --reference 1024 --limit flip=0.02 --out report

Limits are those of `splatblur compare`. JSON and CSV: metrics by the names of `compare`, seconds (median, least, most),
z_pass (share of values that the standard error of the reference explains), regions; for each frame, and for all.

Exit status: 0 within the limits (or none given), 1 over a limit, 2 error, 130 interrupted.", *MODES))]
pub(super) struct Report {
    /// Scene file (XML), or a model file, as in `splatblur render`.
    scene: PathBuf,

    #[arg(
        long,
        value_name = "LIST",
        allow_hyphen_values = true,
        value_parser = frames::frames,
        help = frames::HELP,
        help_heading = "Report"
    )]
    frames: Option<FrameList>,
    /// Modes, several with commas.
    #[arg(long, value_name = "MODES", value_parser = study::entries, help_heading = "Report")]
    modes: std::vec::Vec<Entry>,
    /// Backends for modes that do not name one, several with commas: cpu, gpu.
    #[arg(
        long,
        value_name = "LIST",
        default_value = "cpu",
        value_parser = study::backends,
        help_heading = "Report"
    )]
    backends: std::vec::Vec<BackendKind>,
    /// Samples of a pixel of the reference (a multiple of 16).
    #[arg(
        long,
        value_name = "SPP",
        default_value_t = 1024,
        value_parser = study::reference_samples,
        help_heading = "Report"
    )]
    reference: u64,
    /// Directory of the report; made if missing.
    #[arg(long, value_name = "DIR", help_heading = "Report")]
    out: PathBuf,
    /// Timed renderings of each mode (one of references).
    #[arg(
        long,
        value_name = "R",
        default_value_t = 3,
        value_parser = clap::value_parser!(u32).range(1..=1000),
        help_heading = "Report"
    )]
    repeats: u32,
    /// Exit with status 1 where METRIC of a mode, in a frame or in all, is beyond VALUE; may be repeated.
    #[arg(long, value_name = "METRIC=VALUE", value_delimiter = ',', help_heading = "Report")]
    limit: Vec<Limit>,
    /// Render everything again, instead of taking what an earlier run with the same settings has finished.
    #[arg(long, help_heading = "Report")]
    fresh: bool,

    #[command(flatten)]
    common: Common,
}

impl Report {
    pub(super) fn run(&self) -> anyhow::Result<ExitCode> {
        let contestants = Contestant::of(&self.modes, &self.backends).context("--modes")?;
        Limit::check_unique(&self.limit).context("--limit")?;
        let ReadyScene { mut trial, notes, pool, .. } = self.common.load(&self.scene, &ModelAlone::default())?;
        let frames = frames_of(self.frames.as_ref(), trial.scene())?.all().to_vec();
        let (reference, repeats, limits) = (self.reference, self.repeats, self.limit.clone());
        let experiment = Experiment { contestants, frames, reference, repeats, limits };
        experiment.check(&trial)?;
        open_directory(&self.out)?;
        let gate = Arc::new(Mutex::new(()));
        stop_on_interrupt(&gate, &self.out, "the same command", self.common.quiet())?;
        let store = Store { directory: &self.out, gate: &gate, fresh: self.fresh };
        let bar = Steps::new(experiment.steps(&trial), self.common.quiet());
        let (mut study, pictures) = pool.install(|| experiment.run(&mut trial, &store, &|at| bar.tell(at)))?;
        drop(bar);
        study.notes = notes;
        let index = pool.install(|| store.publish(&study, &pictures))?;
        for over in &study.over {
            say(&format!("over the limit: {over}"));
        }
        let code = if study.over.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(super::OVER) };
        match if self.common.quiet() { Ok(()) } else { print(&format!("{}\n", index.display())) } {
            // The verdict stands, whoever stopped reading.
            Err(error) if !is_closed_pipe(&error) => Err(error),
            _ => Ok(code),
        }
    }
}

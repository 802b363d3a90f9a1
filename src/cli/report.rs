//! `splatblur report`: modes measured against the reference, as one HTML page with JSON and CSV.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context as _, bail};
use clap::Args;
use splatblur::compare::{self, Comparison, Metric, flip, ssim};
use splatblur::film::Picture;
use splatblur::study::report::page::page;
use splatblur::study::report::{Floor, FrameStudy, ModeStudy, Region, SceneStudy, Study, Times, csv, pass_rate, split};
use splatblur::{files, image};

use super::common::{open_directory, stop_on_interrupt};
use super::grammar::{self, Frames};
use super::limits::{self, Limit};
use super::modes::{self, Machine, Method, Mode};
use super::output::{is_closed_pipe, print, say};
use super::progress::Steps;
use super::report_pictures::{pictured, pictures_of, regions};
use super::report_store::Store;
use super::trial::{Common, Trial, samples_of};

/// Measure modes against the ray-traced reference: an HTML page, JSON and CSV.
///
/// Renders each frame in each mode and on each backend in turn, after one rendering of each to warm up, measures the times, and
/// compares the pictures with the reference. Writes DIR/index.html, one file that needs no other and no network, DIR/report.json,
/// DIR/report.csv, and DIR/renderings, from which an interrupted report goes on when it is started again.
#[derive(Debug, Args)]
#[command(after_long_help = format!("{}

Examples:
  Which mode, how many samples, how wrong, how slow:
    splatblur report scenes/spin.xml --frames 12 --modes supersample:8,supersample:32,bucket:8x4 --reference 4096 --out report
  As a gate: every mode, frame and backend must pass
    splatblur report scene.xml --frames 1..24 --modes supersample:32 --reference 1024 --limit flip=0.02 --out report

Limits are those of `splatblur compare`. JSON and CSV: metrics by the names of `compare`, seconds (median, least, most),
z_pass (share of values that the standard error of the reference explains), regions; for each frame, and for all.

Exit status: 0 within the limits (or none given), 1 over a limit, 2 error, 130 interrupted.", modes::HELP))]
pub(super) struct Report {
    /// Scene file (XML).
    scene: PathBuf,

    /// Frames, inclusive: A..B, A-B or one; negative ones with `..` only, as in -5..-2 [default: the scene's].
    #[arg(long, value_name = "A..B", allow_hyphen_values = true, value_parser = grammar::frames, help_heading = "Report")]
    frames: Option<Frames>,
    /// Modes, several with commas.
    #[arg(long, value_name = "MODES", value_parser = modes::list, help_heading = "Report")]
    modes: std::vec::Vec<Mode>,
    /// Machines for modes that do not name one, several with commas: cpu, gpu.
    #[arg(long, value_name = "LIST", default_value = "cpu", value_parser = modes::machines, help_heading = "Report")]
    backends: std::vec::Vec<Machine>,
    /// Samples of a pixel of the reference (a multiple of 16).
    #[arg(long, value_name = "SPP", default_value_t = 1024, value_parser = modes::reference_samples, help_heading = "Report")]
    reference: u64,
    /// Directory of the report; made if missing.
    #[arg(long, value_name = "DIR", help_heading = "Report")]
    out: PathBuf,
    /// Timed renderings of each mode (one of references).
    #[arg(long, value_name = "R", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000), help_heading = "Report")]
    repeats: u32,
    /// Exit with status 1 where METRIC of a mode, in a frame or in all, is beyond VALUE; may be repeated.
    #[arg(long, value_name = "METRIC=VALUE", value_delimiter = ',', value_parser = limits::limit, help_heading = "Report")]
    limit: Vec<Limit>,
    /// Render all anew, instead of taking what an earlier run with the same settings has finished.
    #[arg(long, help_heading = "Report")]
    fresh: bool,

    #[command(flatten)]
    common: Common,
}

/// A mode on a machine.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    method: Method,
    machine: Machine,
}

impl Entry {
    pub(super) fn name(self) -> String {
        format!("{}@{}", self.method, self.machine)
    }
}

impl Report {
    pub(super) fn run(&self) -> anyhow::Result<ExitCode> {
        let entries = self.entries()?;
        let mut trial = self.common.load(&self.scene)?;
        let frames = self
            .frames
            .map_or_else(
                || grammar::check_range(Frames { first: trial.scene.frames.first, last: trial.scene.frames.last }),
                Ok,
            )
            .map_err(anyhow::Error::msg)
            .context("frames of the scene")?;
        self.check_size(&trial)?;
        open_directory(&self.out)?;
        let gate = Arc::new(Mutex::new(()));
        stop_on_interrupt(&gate, &self.out, "the same command", self.common.quiet)?;
        let store = Store { directory: &self.out, gate: &gate, fresh: self.fresh };
        let bar = Steps::new(frames.count() * self.steps_of_frame(&entries), self.common.quiet);
        let mut step = 0;
        for frame in frames.first..=frames.last {
            self.render(&mut trial, &store, frame, &entries, &bar, step).with_context(|| format!("frame {frame}"))?;
            step += self.steps_of_frame(&entries);
        }
        drop(bar);
        let study = self.study(&mut trial, &store, frames, &entries)?;
        let pictures = pictured(&study)
            .into_iter()
            .map(|frame| pictures_of(&mut trial, &store, frame, &entries))
            .collect::<anyhow::Result<Vec<_>>>()?;
        let index = self.out.join("index.html");
        {
            let _held = gate.lock().unwrap_or_else(PoisonError::into_inner);
            write(&self.out.join("report.json"), &serde_json::to_vec_pretty(&study.json())?)?;
            write(&self.out.join("report.csv"), csv(&study).as_bytes())?;
            write(&index, page(&study, &pictures)?.as_bytes())?;
        }
        for over in &study.over {
            say(&format!("over the limit: {over}"));
        }
        let code = if study.over.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(super::OVER) };
        match if self.common.quiet { Ok(()) } else { print(&format!("{}\n", index.display())) } {
            // The verdict stands, whoever stopped reading.
            Err(error) if !is_closed_pipe(&error) => Err(error),
            _ => Ok(code),
        }
    }

    /// Modes times machines; references are made on the CPU.
    fn entries(&self) -> anyhow::Result<Vec<Entry>> {
        let mut entries = Vec::new();
        for mode in &self.modes {
            let machines = match (mode.machine, mode.method) {
                (Some(machine), _) => vec![machine],
                (None, Method::Reference(_)) => vec![Machine::Cpu],
                (None, Method::Splat(_)) => self.backends.clone(),
            };
            for machine in machines {
                let entry = Entry { method: mode.method, machine };
                if entries.iter().any(|other: &Entry| other.name() == entry.name()) {
                    bail!("--modes: {} is there twice", entry.name());
                }
                entries.push(entry);
            }
        }
        Ok(entries)
    }

    fn check_size(&self, trial: &Trial<'_>) -> anyhow::Result<()> {
        let smallest = trial.scene.image.width.min(trial.scene.image.height);
        if smallest < ssim::WINDOW {
            bail!("a report needs pictures of at least {0} x {0} pixels, for SSIM", ssim::WINDOW);
        }
        for (i, limit) in self.limit.iter().enumerate() {
            if self.limit[..i].iter().any(|other| other.metric == limit.metric) {
                bail!("--limit: {} has two limits", limit.metric.name());
            }
        }
        Ok(())
    }

    fn repeats_of(&self, method: Method) -> u32 {
        // Slow, and hardly varying.
        if matches!(method, Method::Reference(_)) { 1 } else { self.repeats }
    }

    /// Renderings of a frame: the reference, and for each mode one to warm up and the timed ones.
    fn steps_of_frame(&self, entries: &[Entry]) -> u64 {
        1 + entries.iter().map(|entry| 1 + u64::from(self.repeats_of(entry.method))).sum::<u64>()
    }

    /// Renders what is missing of a frame. Where modes are missing, they are measured in turn.
    fn render(
        &self,
        trial: &mut Trial<'_>,
        store: &Store<'_>,
        frame: i64,
        entries: &[Entry],
        bar: &Steps,
        first_step: u64,
    ) -> anyhow::Result<()> {
        let mut step = first_step;
        let judge = Method::Reference(self.reference);
        let path = store.path(frame, "judge");
        let settings = trial.settings(judge, Machine::Cpu, frame, true)?;
        if store.finished(&path, &settings).is_none() {
            let shot = trial
                .judge(self.reference, frame, &|share| bar.at(step, &format!("frame {frame}, reference"), share))?;
            store.keep(&path, &shot.picture, &settings, &[shot.seconds])?;
        }
        step += 1;
        let mut missing = Vec::new();
        for &entry in entries {
            let path = store.path(frame, &entry.name());
            let settings = trial.settings(entry.method, entry.machine, frame, false)?;
            match store.finished(&path, &settings) {
                // An earlier run may have measured fewer times.
                Some(seconds) if seconds.len() >= self.repeats_of(entry.method) as usize => {
                    step += 1 + u64::from(self.repeats_of(entry.method));
                }
                _ => missing.push((entry, path, settings, Vec::new())),
            }
        }
        bar.skip_to(step);
        let most = missing.iter().map(|(entry, ..)| self.repeats_of(entry.method)).max().unwrap_or(0);
        for round in 0..=most {
            for (entry, path, settings, seconds) in &mut missing {
                let repeats = self.repeats_of(entry.method);
                // A reference is its own warm-up: nothing is gained by tracing twice.
                let traced = matches!(entry.method, Method::Reference(_));
                if round > repeats || (traced && round == 0) {
                    continue;
                }
                let what = format!("frame {frame}, {}", entry.name());
                bar.at(step, &what, 0.0);
                let shot = trial
                    .shoot(entry.method, entry.machine, frame, &|share| bar.at(step, &what, share))
                    .with_context(|| format!("mode {}", entry.name()))?;
                step += if traced { 2 } else { 1 };
                if round > 0 {
                    seconds.push(shot.seconds);
                }
                if round == repeats {
                    store.keep(path, &shot.picture, settings, seconds)?;
                }
            }
        }
        Ok(())
    }

    /// Compares what was rendered.
    fn study(
        &self,
        trial: &mut Trial<'_>,
        store: &Store<'_>,
        range: Frames,
        entries: &[Entry],
    ) -> anyhow::Result<Study> {
        let mut frames = Vec::new();
        for frame in range.first..=range.last {
            let regions = regions(trial, frame)?;
            let path = store.path(frame, "judge");
            let reference = image::read(&path)?;
            let settings = trial.settings(Method::Reference(self.reference), Machine::Cpu, frame, true)?;
            let seconds = Store { fresh: false, ..*store }.finished(&path, &settings).unwrap_or_default();
            let mut modes = Vec::new();
            for entry in entries {
                modes.push(measure(trial, store, frame, *entry, &reference, &regions)?);
            }
            let floor = Floor::of(&reference)?.context("the reference has no standard error")?;
            frames.push(FrameStudy { frame, reference_seconds: Times::of(&seconds).median, floor, modes });
        }
        let sequence: Vec<_> = (0..entries.len())
            .filter_map(|i| ModeStudy::pooled(&frames.iter().map(|f| &f.modes[i]).collect::<Vec<_>>()))
            .collect();
        let mut over = Vec::new();
        for limit in &self.limit {
            for f in &frames {
                over.extend(
                    f.modes.iter().filter_map(|m| limit.check(&m.errors, format!("frame {}, {}", f.frame, m.name()))),
                );
            }
            if frames.len() > 1 {
                over.extend(
                    sequence.iter().filter_map(|m| limit.check(&m.errors, format!("all frames, {}", m.name()))),
                );
            }
        }
        let mut machines: Vec<Machine> = entries.iter().map(|entry| entry.machine).collect();
        machines.sort();
        machines.dedup();
        Ok(Study {
            program: concat!("splatblur ", env!("CARGO_PKG_VERSION")).to_owned(),
            scene: self.scene_study(trial, range)?,
            machines: machines.into_iter().map(|machine| trial.describe(machine)).collect::<anyhow::Result<_>>()?,
            frames,
            sequence,
            over: over.iter().map(ToString::to_string).collect(),
            notes: trial.notes.clone(),
        })
    }

    /// The settings that all modes share, and the reference's.
    fn scene_study(&self, trial: &Trial<'_>, range: Frames) -> anyhow::Result<SceneStudy> {
        let text = trial.settings(Method::Reference(self.reference), Machine::Cpu, range.first, true)?;
        let fields: serde_json::Map<String, serde_json::Value> = serde_json::from_str(&text)?;
        // Those that say nothing here, stand elsewhere, or are of one rendering only.
        let left_out = ["program", "width", "height", "frame", "mode", "backend", "format", "bits", "aovs", "epsilon"];
        let mut settings = vec![("scene file".to_owned(), self.scene.display().to_string())];
        settings.extend(
            fields
                .iter()
                .filter(|(name, value)| !left_out.contains(&name.as_str()) && !value.is_null())
                .map(|(name, value)| (name.replace('_', " "), in_words(name, value))),
        );
        settings.push(("seed of references among the modes".to_owned(), trial.seed_of_others().to_string()));
        let own = |value: Option<f64>| value.map_or_else(|| "the scene's".to_owned(), |e| e.to_string());
        settings.push(("epsilon of the modes".to_owned(), own(self.common.epsilon())));
        settings.push(("epsilon of the reference".to_owned(), own(None)));
        let (width, height) = (trial.scene.image.width, trial.scene.image.height);
        let (name, reference, repeats) = (trial.scene.name.clone(), self.reference, self.repeats);
        Ok(SceneStudy { name, size: [width, height], reference, repeats, settings })
    }
}

/// A setting of the reference for people.
fn in_words(name: &str, value: &serde_json::Value) -> String {
    let text = |value: &serde_json::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    match (name, value.as_array().map(Vec::as_slice)) {
        ("shutter", Some([open, close])) => format!("{open} to {close} frames"),
        ("inputs", Some(files)) => {
            let file = |f: &serde_json::Value| {
                format!("{} ({} bytes, CRC-32 {})", text(&f["file"]), f["bytes"], text(&f["crc32"]))
            };
            files.iter().map(file).collect::<Vec<_>>().join(", ")
        }
        (_, Some(list)) => list.iter().map(text).collect::<Vec<_>>().join(", "),
        _ => text(value),
    }
}

/// One mode against the reference.
fn measure(
    trial: &Trial<'_>,
    store: &Store<'_>,
    frame: i64,
    entry: Entry,
    reference: &Picture,
    regions: &[Region],
) -> anyhow::Result<ModeStudy> {
    let path = store.path(frame, &entry.name());
    let settings = trial.settings(entry.method, entry.machine, frame, false)?;
    let seconds = Store { fresh: false, ..*store }.finished(&path, &settings).unwrap_or_default();
    let picture = image::read(&path)?;
    let mut errors = Comparison::new(&picture, reference, &[Metric::Ssim])?;
    let map = flip::map(&picture, reference)?;
    errors.flip = Some(compare::mean(&map, picture.width as usize));
    Ok(ModeStudy {
        mode: entry.method.to_string(),
        family: entry.method.family(),
        backend: entry.machine.to_string(),
        samples: samples_of(entry.method, &picture),
        times: Times::of(&seconds),
        z_pass: pass_rate(&picture, reference).context("the reference has no standard error")?,
        regions: split(&picture, reference, &map, regions),
        errors,
    })
}

fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    files::replace(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

//! `splatblur reference`: a scene to ray-traced reference images with a standard error for each pixel.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context as _, bail};
use clap::Args;
use serde::Serialize;
use splatblur::FrameNumber;
use splatblur::files;
use splatblur::film::Aov;
use splatblur::image::{self, Display, Format};
use splatblur::reference::{
    self, MOST_SAMPLES, Meshes, ReferenceError, ReferenceOptions, ReferenceStats, SCRAMBLINGS, Sampler, Sums,
};
use splatblur::scene::Scene;
use splatblur::study::provenance::{PROGRAM, Provenance};

use super::common::{
    Images, Overrides, Ready, Running, Sampling, Surfaces, aov_help, open_directory, stop_on_interrupt,
};
use super::output::{print, print_json, say};
use super::progress::Loading;
use super::render::file_name;
use super::values;

/// Ray-trace the reference of a scene, with a standard error for each pixel.
///
/// Takes the same scene, shutter and surfaces as `render`, without prefilter, and meshes by their triangles. Integrates
/// over pixel and shutter by quasi-Monte-Carlo sampling, each sample at a time of its own. Writes DIR/<scene>.<frame, 4
/// digits>.exr with a layer `error` (the standard error of r, g, b and coverage), and beside it a .ref file from which
/// --resume goes on.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  The reference of frame 12, 4096 samples a pixel:
    splatblur reference scene.xml --frames 12 --samples 4096
  As many samples as a mean standard error of 0.0005 takes, at most 65536:
    splatblur reference scene.xml --frames 12 --error 5e-4 --samples 65536
  More samples for an existing one:
    splatblur reference scene.xml --frames 12 --samples 16384 --resume
  Why is this pixel so dark?
    splatblur reference scene.xml --frames 12 --pixel 320,200 --sample 17

JSON (--json), one object: program, scene, directory, frames: [{frame, path, samples, traced (samples of this run, all
pixels), mean_error, surfels, triangles, gaussians, hierarchy_bytes, build_seconds, trace_seconds}], notes.")]
#[command(mut_arg("out", |arg| arg.help("Directory of the images; made if missing [default: out/<scene>.reference]")))]
#[command(mut_arg("format", |arg| {
    arg.default_value("exr").help("File format; PNG has neither errors nor other layers")
}))]
#[command(mut_arg("aov", |arg| arg.help(aov_help_of_reference())))]
pub(super) struct Reference {
    #[command(flatten)]
    images: Images,
    /// Go on from the .ref files of an earlier run with the same settings; frames without one start from nothing.
    #[arg(long, help_heading = "Output")]
    resume: bool,
    /// Write no .ref files (up to 544 bytes for each pixel that is not empty); then --resume cannot go on.
    #[arg(long, conflicts_with = "resume", help_heading = "Output")]
    no_sums: bool,
    /// Print everything about pixel X,Y of the first frame, and write nothing.
    #[arg(
        long,
        value_name = "X,Y",
        allow_hyphen_values = true,
        value_parser = pixel,
        conflicts_with_all = ["error", "resume", "json"],
        help_heading = "Output"
    )]
    pixel: Option<[u32; 2]>,
    /// Print everything about this sample of the pixel: its ray, time, hits, depths, weights.
    #[arg(long, value_name = "I", allow_hyphen_values = true, requires = "pixel", help_heading = "Output")]
    sample: Option<u64>,

    /// Samples a pixel, a multiple of 16; with --error, the most.
    #[arg(
        long,
        value_name = "SPP",
        default_value_t = 1024,
        allow_hyphen_values = true,
        value_parser = samples,
        help_heading = "Sampling"
    )]
    samples: u64,
    /// Stop after the round of 256 samples in which the mean standard error falls below this.
    #[arg(
        long,
        value_name = "E",
        allow_hyphen_values = true,
        value_parser = values::positive,
        help_heading = "Sampling"
    )]
    error: Option<f64>,
    /// How positions and times are chosen. sobol: together, as Owen-scrambled Sobol' points; jittered: as the product
    /// of jittered grids of Wolf (2008), with a fixed number of samples; random: as independent random numbers.
    #[arg(
        long,
        value_parser = ["sobol", "jittered", "random"],
        default_value = "sobol",
        help_heading = "Sampling"
    )]
    sampler: String,
    /// Cells of the jittered grid of times for each time sample: 1 bands, many are noisy [default: 4].
    #[arg(
        long,
        value_name = "CELLS",
        allow_hyphen_values = true,
        value_parser = clap::value_parser!(u32).range(1..=1024),
        help_heading = "Sampling"
    )]
    jitter_density: Option<u32>,
    /// What of a mesh is traced: its triangles, or the surfels that a renderer makes of it.
    #[arg(
        long,
        value_name = "WHAT",
        default_value_t,
        value_parser = values::one_of::<Meshes>(Meshes::WORDS),
        help_heading = "Sampling"
    )]
    meshes: Meshes,

    #[command(flatten)]
    sampling: Sampling,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    surfaces: Surfaces,
    #[command(flatten)]
    running: Running,
}

/// The error is no choice here.
fn aov_help_of_reference() -> String {
    format!("{}\nA reference always has the layer `error`: {}.", aov_help(&Aov::ALL), Aov::Error.meaning())
}

/// Samples of a pixel; the library says which it can take.
fn samples(text: &str) -> Result<u64, String> {
    let expected = |_| format!("expected a multiple of {SCRAMBLINGS} of at most {MOST_SAMPLES}, as in 4096");
    text.trim().parse().map_err(expected)
}

/// `X,Y`.
fn pixel(text: &str) -> Result<[u32; 2], String> {
    let expected = || "expected column and row of a pixel, as in 320,200".to_owned();
    let (x, y) = text.split_once(',').ok_or_else(expected)?;
    let number = |part: &str| part.trim().parse().map_err(|_| expected());
    Ok([number(x)?, number(y)?])
}

#[derive(Serialize)]
struct Report<'a> {
    program: &'static str,
    scene: &'a str,
    directory: &'a Path,
    frames: Vec<FrameReport>,
    notes: &'a [String],
}

#[derive(Serialize)]
struct FrameReport {
    frame: FrameNumber,
    path: PathBuf,
    samples: u64,
    traced: u64,
    mean_error: f64,
    surfels: u64,
    triangles: u64,
    gaussians: u64,
    hierarchy_bytes: u64,
    build_seconds: f64,
    trace_seconds: f64,
}

impl Reference {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        let options = self.options()?;
        let pool = self.running.pool()?;
        let Ready { scene, notes, frames, format, display, .. } =
            Ready::new(&self.images, false, &self.overrides, &self.running, &pool)?;
        if let Some(pixel) = self.pixel {
            let probe = pool.install(|| reference::probe(&scene, frames.first(), &options, pixel, self.sample))?;
            return print(&probe.to_string());
        }
        let directory =
            self.images.out.clone().unwrap_or_else(|| Path::new("out").join(format!("{}.reference", scene.name)));
        open_directory(&directory)?;
        let gate = Arc::new(Mutex::new(()));
        stop_on_interrupt(&gate, &directory, "--resume", self.running.quiet)?;
        let provenance = Provenance::of(&scene, &self.images.scene)?.shown(display);
        let output = Output {
            scene: &scene,
            provenance,
            options: &options,
            format,
            display,
            directory: &directory,
            gate: &gate,
        };
        let mut reports = Vec::new();
        for &frame in frames.all() {
            let report = pool.install(|| self.frame(&output, frame)).with_context(|| format!("frame {frame}"))?;
            if !self.running.quiet && !self.images.json {
                print(&summary(&report))?;
            }
            reports.push(report);
        }
        if self.images.json {
            let (scene, directory) = (&*scene.name, &*directory);
            return print_json(&Report { program: PROGRAM, scene, directory, frames: reports, notes: &notes });
        }
        Ok(())
    }

    fn frame(&self, output: &Output<'_>, frame: FrameNumber) -> anyhow::Result<FrameReport> {
        let path = output.directory.join(file_name(&output.scene.name, frame, output.format));
        let sums_path = path.with_extension("ref");
        let kind = output.settings(frame, SCRAMBLINGS as u64)?;
        let earlier = if self.resume { self.earlier(&sums_path, &kind)? } else { None };
        let progress = Loading::new(self.running.quiet);
        let made = reference::render(output.scene, frame, output.options, earlier, &|step| {
            let error = step.error.map_or_else(String::new, |e| format!(", error {e:.1e}"));
            let what = if step.is_building() {
                format!("frame {frame}, building what is traced")
            } else {
                format!("frame {frame}, samples {} to {}{error}", step.samples, step.end)
            };
            progress.step(&what, step.share as f32);
        })?;
        drop(progress);
        let settings = output.settings(frame, made.stats.samples)?;
        let mut picture = made.picture;
        if let Format::Png { bits, alpha } = output.format {
            picture.layers.clear();
            picture = output.display.shown(picture, bits, alpha);
        }
        let _held = output.gate.lock().unwrap_or_else(PoisonError::into_inner);
        // Sums first: after an interruption between the two files the run can still go on.
        if !self.no_sums && output.options.sampler.is_progressive() {
            let written = files::replace(&sums_path, &made.sums.to_bytes(&kind));
            written.with_context(|| format!("cannot write {}", sums_path.display()))?;
        }
        image::write(&path, &picture, output.format, &settings)?;
        let ReferenceStats {
            samples,
            traced,
            mean_error,
            surfels,
            triangles,
            gaussians,
            hierarchy_bytes,
            build,
            trace,
            ..
        } = made.stats;
        let (build_seconds, trace_seconds) = (build.as_secs_f64(), trace.as_secs_f64());
        Ok(FrameReport {
            frame,
            path,
            samples,
            traced,
            mean_error,
            surfels,
            triangles,
            gaussians,
            hierarchy_bytes,
            build_seconds,
            trace_seconds,
        })
    }

    /// The sums of an earlier run of the same kind.
    fn earlier(&self, path: &Path, kind: &str) -> anyhow::Result<Option<Sums>> {
        if !path.exists() {
            return Ok(None);
        }
        let context = || format!("cannot go on from {}", path.display());
        let (sums, settings) =
            Sums::from_bytes(&files::read(path, u64::MAX).with_context(context)?).with_context(context)?;
        if settings != kind {
            if !self.running.quiet {
                say(&format!("note: {} was made with other settings; starting from nothing", path.display()));
            }
            return Ok(None);
        }
        Ok(Some(sums))
    }

    fn options(&self) -> anyhow::Result<ReferenceOptions> {
        let sampler = match &*self.sampler {
            "jittered" => Sampler::Jittered { density: self.jitter_density.unwrap_or(4) },
            _ if self.jitter_density.is_some() => bail!("--jitter-density is for --sampler jittered"),
            "random" => Sampler::Random,
            _ => Sampler::Sobol,
        };
        let options = ReferenceOptions {
            samples: self.samples,
            error: self.error,
            sampler,
            meshes: self.meshes,
            look: self.surfaces.look(&self.sampling, self.images.aovs()?),
        };
        if let Some(other) = options.look.aovs.iter().find(|aov| matches!(aov, Aov::LodError | Aov::Object)) {
            bail!("--aov {} is for `splatblur render`", other.name());
        }
        if options.look.aovs.contains(&Aov::Error) {
            bail!("--aov: a reference always has its error (others: alpha, depth, normal, velocity, samples)");
        }
        options.check()?;
        if self.resume && !options.sampler.is_progressive() {
            return Err(ReferenceError::Fixed.into());
        }
        Ok(options)
    }
}

/// Where the frames of a run go, and with what settings.
struct Output<'a> {
    scene: &'a Scene,
    provenance: Provenance,
    options: &'a ReferenceOptions,
    format: Format,
    display: Display,
    directory: &'a Path,
    /// Held while files are being written.
    gate: &'a Mutex<()>,
}

impl Output<'_> {
    /// The text that a frame's file carries. With a fixed number of samples it says whether partial sums are of the
    /// same kind.
    fn settings(&self, frame: FrameNumber, samples: u64) -> anyhow::Result<String> {
        Ok(self.provenance.traced(self.options, samples, self.format)?.of_frame(frame)?)
    }
}

fn summary(report: &FrameReport) -> String {
    let rate = report.traced as f64 / report.trace_seconds.max(1e-9) / 1e6;
    let all = [(report.surfels, "surfels"), (report.triangles, "triangles"), (report.gaussians, "Gaussians")];
    let there: Vec<String> =
        all.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect();
    let what = if there.is_empty() { "nothing".to_owned() } else { there.join(" and ") };
    format!(
        "{}: {} samples a pixel, mean standard error {:.2e}, {:.1} s ({:.2} M samples/s), hierarchies of {what} in \
         {:.2} s\n",
        report.path.display(),
        report.samples,
        report.mean_error,
        report.build_seconds + report.trace_seconds,
        rate,
        report.build_seconds
    )
}

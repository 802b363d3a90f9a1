//! `splatblur reference`: a scene to ray-traced reference images with a standard error for each pixel.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context as _, bail};
use clap::{Args, ValueEnum};
use glam::DVec3;
use serde::Serialize;
use splatblur::files;
use splatblur::image::{self, Format};
use splatblur::plan::{self, BlurMode, RenderOptions};
use splatblur::reference::{self, ReferenceOptions, SCRAMBLINGS, Stats, Sums};
use splatblur::scene::{Loaded, Scene};
use splatblur::time::Weight;

use super::grammar::{self, Frames};
use super::output::{print, print_json, say};
use super::progress::Loading;
use super::render::{Depth, FileFormat, Filter, Shading, file_format, load_scene, open_directory, stop_on_interrupt};
use super::sequence::file_name;
use super::settings::Settings;

/// Ray-trace the reference of a scene, with a standard error for each pixel.
///
/// Takes the same scene, shutter and surfaces as `render`, without prefilter, and integrates over pixel and shutter by
/// quasi-Monte-Carlo sampling, each sample at a time of its own. Writes DIR/<scene>.<frame, 4 digits>.exr with a layer `error` (the
/// standard error of r, g, b and coverage), and beside it a .ref file from which --resume goes on.
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

JSON (--json), one object: program, scene, directory, frames: [{frame, path, samples, traced (samples of this run, all pixels),
mean_error, surfels, hierarchy_bytes, build_seconds, trace_seconds}], notes.")]
#[allow(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
pub(super) struct Reference {
    /// Scene file (XML).
    scene: PathBuf,

    /// Directory of the images; made if missing [default: out/<scene>.reference].
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    out: Option<PathBuf>,
    /// Frames, inclusive: A..B, A-B or one; negative ones with `..` only, as in -5..-2 [default: the scene's].
    #[arg(long, value_name = "A..B", allow_hyphen_values = true, value_parser = grammar::frames, help_heading = "Output")]
    frames: Option<Frames>,
    /// Image size in pixels [default: the scene's, else 1024x768].
    #[arg(long, value_name = "WxH", value_parser = grammar::size, help_heading = "Output")]
    size: Option<(u32, u32)>,
    /// File format; PNG has neither errors nor other layers.
    #[arg(long, value_enum, default_value = "exr", help_heading = "Output")]
    format: FileFormat,
    /// Bits of a PNG channel [default: 8].
    #[arg(long, value_enum, value_name = "BITS", help_heading = "Output")]
    bits: Option<Depth>,
    /// Extra layers, EXR only: alpha, depth, normal, velocity, samples; several with commas.
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Output")]
    aov: Vec<String>,
    /// Background in linear light [default: the scene's].
    #[arg(long, value_name = "R,G,B", allow_hyphen_values = true, value_parser = grammar::colour, help_heading = "Output")]
    background: Option<DVec3>,
    /// Leave the background out and keep alpha.
    #[arg(long, conflicts_with = "background", help_heading = "Output")]
    transparent: bool,
    /// Go on from the .ref files of an earlier run with the same settings; frames without one start anew.
    #[arg(long, help_heading = "Output")]
    resume: bool,
    /// Write no .ref files (up to 536 bytes for each pixel that is not empty): --resume will have nothing to go on from.
    #[arg(long, conflicts_with = "resume", help_heading = "Output")]
    no_sums: bool,
    /// Print all about pixel X,Y of the first frame, and write nothing.
    #[arg(long, value_name = "X,Y", value_parser = pixel, help_heading = "Output")]
    pixel: Option<[u32; 2]>,
    /// Print all about this sample of the pixel: its ray, time, hits, depths, weights.
    #[arg(long, value_name = "I", requires = "pixel", help_heading = "Output")]
    sample: Option<u64>,

    /// Samples a pixel, a multiple of 16; with --error, the most.
    #[arg(long, value_name = "SPP", default_value_t = 1024, help_heading = "Sampling")]
    samples: u64,
    /// Stop after the round of 256 samples in which the mean standard error falls below this.
    #[arg(long, value_name = "E", value_parser = grammar::positive, help_heading = "Sampling")]
    error: Option<f64>,
    /// How positions and times are chosen.
    #[arg(long, value_enum, default_value_t, help_heading = "Sampling")]
    sampler: Sampler,
    /// Cells of the jittered grid of times for each time sample: 1 bands, many are noisy [default: 4].
    #[arg(long, value_name = "CELLS", value_parser = clap::value_parser!(u32).range(1..=1024), help_heading = "Sampling")]
    jitter_density: Option<u32>,
    /// Seed of positions and times.
    #[arg(long, value_name = "S", default_value_t = 1, help_heading = "Sampling")]
    seed: u64,

    /// Shutter opening and closing, frames around the frame number [default: the scene's, else -0.25,0.25].
    #[arg(long, value_name = "OPEN,CLOSE", allow_hyphen_values = true, value_parser = grammar::shutter, help_heading = "Blur")]
    shutter: Option<(f64, f64)>,
    /// Time weight over the shutter: box, tent, ramp:centre=1, exponential:rate=3,centre=1, gaussian:centre=.5,width=.2
    /// (parameters optional) [default: the scene's, else box].
    #[arg(long, value_name = "WEIGHT", value_parser = grammar::weight, help_heading = "Blur")]
    weight: Option<Weight>,
    /// Where samples lie: over the pixel's square, or at its centre.
    #[arg(long, value_enum, default_value_t, help_heading = "Blur")]
    filter: Filter,

    /// Shading per pixel (phong) or per surfel (gouraud).
    #[arg(long, value_enum, default_value_t, help_heading = "Surfaces")]
    shading: Shading,
    /// Show back faces, with their normals turned to the viewer.
    #[arg(long, help_heading = "Surfaces")]
    two_sided: bool,
    /// Depth tolerance of visibility, scene units, for all objects [default: the scene's, else the median splat radius].
    #[arg(long, value_name = "E", allow_hyphen_values = true, value_parser = grammar::epsilon, help_heading = "Surfaces")]
    epsilon: Option<f64>,

    /// Threads [default: all cores]. The images do not depend on it.
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = "Running")]
    threads: Option<u16>,
    /// Report unknown words of the scene instead of refusing them.
    #[arg(long, help_heading = "Running")]
    lenient: bool,
    /// Refuse scenes that name files outside DIR.
    #[arg(long, value_name = "DIR", help_heading = "Running")]
    restrict: Option<PathBuf>,
    /// Print one JSON object about the run on stdout instead of text.
    #[arg(long, help_heading = "Running")]
    json: bool,
    /// Say nothing but errors.
    #[arg(long, help_heading = "Running")]
    quiet: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Sampler {
    /// Position and time together: Owen-scrambled Sobol' points.
    #[default]
    Sobol,
    /// The thesis's product of jittered grids; a fixed number of samples.
    Jittered,
    /// Independent random numbers.
    Random,
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
    frame: i64,
    path: PathBuf,
    samples: u64,
    traced: u64,
    mean_error: f64,
    surfels: u64,
    hierarchy_bytes: u64,
    build_seconds: f64,
    trace_seconds: f64,
}

impl Reference {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        let options = self.options()?;
        let format = file_format(self.format, self.bits, self.transparent, &self.aov)?;
        // 0: as many as there are cores.
        let threads = self.threads.map_or(0, usize::from);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().context("cannot start the threads")?;
        let Loaded { mut scene, notes } =
            load_scene(&self.scene, self.lenient, self.restrict.as_deref(), self.quiet, &pool)?;
        if !self.quiet {
            for note in &notes {
                say(&format!("note: {note}"));
            }
        }
        self.apply(&mut scene);
        let format = match format {
            Format::Png { bits, .. } => Format::Png { bits, alpha: scene.image.transparent },
            Format::Exr => Format::Exr,
        };
        let frames = self
            .frames
            .map_or_else(|| grammar::check_range(Frames { first: scene.frames.first, last: scene.frames.last }), Ok)
            .map_err(anyhow::Error::msg)
            .context("frames of the scene")?;
        if let Some(pixel) = self.pixel {
            let probe = pool.install(|| reference::probe(&scene, frames.first, &options, pixel, self.sample))?;
            return print(&probe.to_string());
        }
        let directory = self.out.clone().unwrap_or_else(|| Path::new("out").join(format!("{}.reference", scene.name)));
        open_directory(&directory)?;
        let gate = Arc::new(Mutex::new(()));
        stop_on_interrupt(&gate, &directory, "--resume", self.quiet)?;
        let output = Output { scene: &scene, options: &options, format, directory: &directory, gate: &gate };
        let mut reports = Vec::new();
        for frame in frames.first..=frames.last {
            let report = pool.install(|| self.frame(&output, frame)).with_context(|| format!("frame {frame}"))?;
            if !self.quiet && !self.json {
                print(&summary(&report))?;
            }
            reports.push(report);
        }
        if self.json {
            let program = concat!("splatblur ", env!("CARGO_PKG_VERSION"));
            let (scene, directory) = (&*scene.name, &*directory);
            return print_json(&Report { program, scene, directory, frames: reports, notes: &notes });
        }
        Ok(())
    }

    fn frame(&self, output: &Output<'_>, frame: i64) -> anyhow::Result<FrameReport> {
        let path = output.directory.join(file_name(&output.scene.name, frame, output.format));
        let sums_path = path.with_extension("ref");
        let kind = output.settings(&self.scene, frame, SCRAMBLINGS as u64)?;
        let earlier = if self.resume { self.earlier(&sums_path, &kind)? } else { None };
        let progress = Loading::new(self.quiet);
        let made = reference::render(output.scene, frame, output.options, earlier, &|step| {
            let error = step.error.map_or_else(String::new, |e| format!(", error {e:.1e}"));
            let what = format!("frame {frame}, samples {} to {}{error}", step.samples, step.end);
            progress.step(&what, step.share as f32);
        })?;
        drop(progress);
        let settings = output.settings(&self.scene, frame, made.stats.samples)?;
        let mut picture = made.picture;
        if output.format != Format::Exr {
            picture.layers.clear();
        }
        let _held = output.gate.lock().unwrap_or_else(PoisonError::into_inner);
        // Sums first: an interruption between the two files leaves nothing that could not go on.
        if !self.no_sums && output.options.sampler.is_progressive() {
            let written = files::replace(&sums_path, &made.sums.to_bytes(&kind));
            written.with_context(|| format!("cannot write {}", sums_path.display()))?;
        }
        image::write(&path, &picture, output.format, &settings)?;
        let Stats { samples, traced, mean_error, surfels, hierarchy_bytes, build, trace, .. } = made.stats;
        let (build_seconds, trace_seconds) = (build.as_secs_f64(), trace.as_secs_f64());
        Ok(FrameReport {
            frame,
            path,
            samples,
            traced,
            mean_error,
            surfels,
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
        let (sums, settings) = Sums::from_bytes(&fs::read(path).with_context(context)?).with_context(context)?;
        if settings != kind {
            if !self.quiet {
                say(&format!("note: {} was made with other settings; starting anew", path.display()));
            }
            return Ok(None);
        }
        Ok(Some(sums))
    }

    fn options(&self) -> anyhow::Result<ReferenceOptions> {
        if self.jitter_density.is_some() && self.sampler != Sampler::Jittered {
            bail!("--jitter-density is for --sampler jittered");
        }
        Ok(ReferenceOptions {
            samples: self.samples,
            error: self.error,
            sampler: match self.sampler {
                Sampler::Sobol => reference::Sampler::Sobol,
                Sampler::Jittered => reference::Sampler::Jittered { density: self.jitter_density.unwrap_or(4) },
                Sampler::Random => reference::Sampler::Random,
            },
            filter: self.filter.into(),
            shading: self.shading.into(),
            two_sided: self.two_sided,
            epsilon: self.epsilon,
            seed: self.seed,
            aovs: grammar::aovs(&self.aov).map_err(anyhow::Error::msg)?,
        })
    }

    /// Options that replace what the scene says.
    fn apply(&self, scene: &mut Scene) {
        if let Some((width, height)) = self.size {
            (scene.image.width, scene.image.height) = (width, height);
        }
        if let Some(colour) = self.background {
            (scene.image.background, scene.image.transparent) = (colour, false);
        }
        scene.image.transparent |= self.transparent;
        if let Some((open, close)) = self.shutter {
            (scene.shutter.open, scene.shutter.close) = (open, close);
        }
        if let Some(weight) = &self.weight {
            scene.shutter.weight = weight.clone();
        }
    }
}

/// Where the frames of a run go, and with what settings.
struct Output<'a> {
    scene: &'a Scene,
    options: &'a ReferenceOptions,
    format: Format,
    directory: &'a Path,
    /// Held while files are being written.
    gate: &'a Mutex<()>,
}

impl Output<'_> {
    /// The text that a frame's file carries: that of `render`, with the sampler. With a fixed number of samples it says whether
    /// partial sums are of the same kind.
    fn settings(&self, scene_path: &Path, frame: i64, samples: u64) -> anyhow::Result<String> {
        let options = RenderOptions {
            mode: BlurMode::supersample(u32::try_from(samples).unwrap_or(u32::MAX)),
            filter: self.options.filter,
            prefilter: plan::Prefilter::None,
            shading: self.options.shading,
            two_sided: self.options.two_sided,
            epsilon: self.options.epsilon,
            seed: self.options.seed,
            aovs: self.options.aovs.clone(),
            ..RenderOptions::default()
        };
        let text = Settings::new(self.scene, scene_path, &options, self.format, "reference")?.of_frame(frame)?;
        let mut settings: serde_json::Map<String, serde_json::Value> = serde_json::from_str(&text)?;
        settings.insert("samples".to_owned(), samples.into());
        settings.insert("sampler".to_owned(), format!("{:?}", self.options.sampler).to_lowercase().into());
        Ok(serde_json::to_string(&settings)?)
    }
}

fn summary(report: &FrameReport) -> String {
    let rate = report.traced as f64 / report.trace_seconds.max(1e-9) / 1e6;
    format!(
        "{}: {} samples a pixel, mean standard error {:.2e}, {:.1} s ({:.2} M samples/s), hierarchies of {} surfels in {:.2} s\n",
        report.path.display(),
        report.samples,
        report.mean_error,
        report.build_seconds + report.trace_seconds,
        rate,
        report.surfels,
        report.build_seconds
    )
}

//! `splatblur render`: a scene to an image sequence.

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use anyhow::Context as _;
use clap::{Args, ValueEnum};
use splatblur::backend::Achieved;
use splatblur::film::Aov;
use splatblur::options;
use splatblur::options::{BlurMode, ErrorTarget, Interleave, Quality, RenderOptions, SourceSamples, SweptKernel};
use splatblur::renderer::{self, Rendered};
use splatblur::scene::Scene;

use super::backend::{Machine, Wanted};
use super::common::{Exposure, Images, Prefilter, Ready, Running, Surfaces, open_directory, stop_on_interrupt};
use super::grammar::{self, Frames};
use super::movie::Movie;
use super::output::{print, print_json, say};
use super::progress::Rendering;
use super::render_report::{FrameReport, Report};
use super::sequence::{Finished, Sequence};
use super::settings::Settings;
use super::words::with_flags;

/// Render a scene to an image sequence.
///
/// Reads the scene with all that it names, renders each frame with motion blur, writes DIR/<scene>.<frame, 4 digits>.<ext>
/// (frame -5 is <scene>.-0005.png, as ffmpeg counts), says where the images are and how to make a movie of them. Files of
/// an earlier run are replaced; each appears whole or not at all, also after Ctrl-C.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  All frames of the scene, into out/three_objects/:
    splatblur render scenes/three_objects.xml
  A quick look at one frame, without blur:
    splatblur render scene.xml --frames 12 --mode still --pixel-samples 4 --size 320x240
  Quickly, with an error that shows where one looks for it:
    splatblur render scene.xml --error draft
  Smooth long trails that fade, as PNG with alpha:
    splatblur render scene.xml --shutter -1,0 --weight ramp --samples 128 --transparent
  For compositing: float, linear, premultiplied, with layers; go on after an interruption:
    splatblur render scene.xml --format exr --aov depth,normal,velocity --resume

JSON (--json), one object: program, scene, directory, backend, frames: [{frame, path, skipped, seconds (wall, rendering),
samples, surfels, splats, auto (error, way, samples, most_samples, interleave, blocks, refined, capped), cpu_seconds or device_seconds: {project, bin, visibility, attribute, resolve, total}}], load_seconds, seconds (whole run),
notes, ffmpeg (null for one frame), settings (as each file carries them, with `frame`, in its header).")]
pub(super) struct Render {
    #[command(flatten)]
    images: Images,
    /// Skip frames whose file was made with the same settings.
    #[arg(long, help_heading = "Output")]
    resume: bool,

    /// How motion becomes blur [default: auto; supersample with --samples or --interleave].
    #[arg(long, value_enum, help_heading = "Blur")]
    mode: Option<Mode>,
    /// Mode auto: the largest error of any part of the image, as root mean square of display values: draft (0.05), good
    /// (0.025), final (0.0125), or a number [default: good].
    #[arg(long, value_name = "E", allow_hyphen_values = true, value_parser = grammar::error, help_heading = "Blur")]
    error: Option<f64>,
    /// Mode auto: most time samples of a pixel [default: 256].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = grammar::samples_max, help_heading = "Blur")]
    samples_max: Option<u32>,
    /// Time samples of mode supersample [default: 32], or of each bucket [default: 4]; intervals of mode volumetric [default: 10].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = grammar::samples, help_heading = "Blur")]
    samples: Option<u32>,
    /// Buckets of mode bucket: intervals with one visibility test and one shading each [default: 8].
    #[arg(long, value_name = "B", allow_hyphen_values = true, value_parser = grammar::samples, help_heading = "Blur")]
    buckets: Option<u32>,
    /// Interleaved sampling: each pixel of a lattice of S x S (1, 2 or 4) has times of its own [default: 1].
    #[arg(long, value_name = "S", allow_hyphen_values = true, value_parser = grammar::interleave, help_heading = "Blur")]
    interleave: Option<Interleave>,
    /// Sub-pixel positions of mode still [default: 16], and of what lies still in mode auto [default: 8]; else those of all time
    /// samples, buckets or intervals [default: one for each]. Fewer are shared out, and what lies still is splatted once at each; with
    /// more each is rendered at several.
    #[arg(long, value_name = "P", allow_hyphen_values = true, value_parser = grammar::samples, help_heading = "Blur")]
    pixel_samples: Option<u32>,
    /// Mode volumetric: what a kernel sweeps over an interval [default: tube].
    #[arg(long, value_enum, value_name = "KERNEL", help_heading = "Blur")]
    kernel: Option<Kernel>,
    /// Mode volumetric: its weight on a ray [default: integral].
    #[arg(long, value_enum, value_name = "WEIGHT", help_heading = "Blur")]
    kernel_weight: Option<KernelWeight>,
    /// Mode volumetric: places within a kernel, on a ray, whose visibility is tested [default: 1].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = grammar::source_samples, help_heading = "Blur")]
    source_samples: Option<u32>,
    /// Mode volumetric: where the coverage of a moving surface comes from [default: union].
    #[arg(long, value_enum, value_name = "ALPHA", help_heading = "Blur")]
    alpha: Option<Alpha>,
    /// Mode volumetric: when sums of colours are divided by sums of weights [default: interval].
    #[arg(long, value_enum, value_name = "WHEN", help_heading = "Blur")]
    normalise: Option<Normalise>,
    /// Mode volumetric as the thesis has it: ellipsoids that overlap in time, chord, sum, once.
    #[arg(long, conflicts_with_all = ["kernel", "kernel_weight", "alpha", "normalise"], help_heading = "Blur")]
    published: bool,
    /// What is done to the finished image.
    #[arg(long, value_enum, default_value_t, help_heading = "Blur")]
    reconstruct: Reconstruct,
    #[command(flatten)]
    exposure: Exposure,

    /// Screen-space prefilter against aliasing of small splats.
    #[arg(long, value_enum, default_value_t, help_heading = "Surfaces")]
    prefilter: Prefilter,
    #[command(flatten)]
    surfaces: Surfaces,

    /// Machine to render on.
    #[arg(long, value_enum, default_value_t, help_heading = "Running")]
    backend: Wanted,
    /// Part of the name of the adapter to render on (`splatblur info --adapters` lists them).
    #[arg(long, value_name = "NAME", help_heading = "Running")]
    adapter: Option<String>,
    /// Memory that a frame may take beside the models, as in 64M, 1G. The images do not depend on it.
    #[arg(long, value_name = "SIZE", default_value = "1G", allow_hyphen_values = true, value_parser = grammar::memory, help_heading = "Running")]
    memory: u64,
    #[command(flatten)]
    running: Running,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Mode {
    /// Motion blur: as many time samples as the error takes that is asked for.
    Auto,
    /// No motion: everything at the frame number.
    Still,
    /// Motion blur: the mean of N renderings over the shutter.
    Supersample,
    /// Motion blur: the mean of B buckets of N renderings that share one visibility test and one shading.
    Bucket,
    /// Motion blur: the mean of N intervals over which each kernel sweeps a volume.
    Volumetric,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Reconstruct {
    /// Nothing.
    #[default]
    None,
    /// A 1-2-1 filter along the mean motion, where that is longer than 4 pixels: evens out the pattern of interleaving.
    Along,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Kernel {
    /// The 2D kernel moved along: the same weight at all times.
    #[default]
    Tube,
    /// 2D Gaussian times a Gaussian along the motion.
    Ellipsoid,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum KernelWeight {
    /// The integral over time.
    #[default]
    Integral,
    /// By the length of the ray within the kernel; with --kernel ellipsoid only.
    Chord,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Alpha {
    /// The times at which any kernel covers the pixel.
    #[default]
    Union,
    /// The sum of all weights, at most 1.
    Sum,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Normalise {
    /// For each interval.
    #[default]
    Interval,
    /// Once, at the end.
    Once,
}

impl Render {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        let start = Instant::now();
        let options = self.options()?;
        let pool = self.running.pool()?;
        // Before the scene, which may take long to load.
        let mut machine = Machine::open(self.backend, self.adapter.as_deref(), pool.current_num_threads())?;
        let backend_name = machine.name;
        let Ready { scene, notes, frames, format } = Ready::new(&self.images, &self.exposure, &self.running, &pool)?;
        let load_seconds = start.elapsed().as_secs_f64();
        let settings = Settings::new(&scene, &self.images.scene, &options, format, backend_name)?;

        let directory = self.images.out.clone().unwrap_or_else(|| Path::new("out").join(&scene.name));
        open_directory(&directory)?;
        if !self.running.quiet {
            say(&headline(&scene, frames, &options, &machine.place));
        }
        let gate = Arc::new(Mutex::new(()));
        stop_on_interrupt(&gate, &directory, "--resume", self.running.quiet)?;
        let sequence =
            Sequence { frames, directory: &directory, stem: &scene.name, format, resume: self.resume, gate: &gate };
        let progress = Rendering::new(frames.count(), self.running.quiet);
        let mut under_way = renderer::Frames::new(machine.backend(), &scene, &options)?;
        let finished = sequence.run(
            |frame| settings.of_frame(frame),
            |frame| pool.install(|| step(&mut under_way, frame)),
            |done| progress.finished(done.rendered.is_none()),
        )?;
        drop(progress);

        let movie = Movie {
            directory: &directory,
            stem: &scene.name,
            format,
            first: frames.first,
            last: frames.last,
            rate: scene.frames.rate,
            size: (scene.image.width, scene.image.height),
            transparent: scene.image.transparent,
        };
        let seconds = start.elapsed().as_secs_f64();
        if self.running.json {
            return print_json(&Report {
                program: concat!("splatblur ", env!("CARGO_PKG_VERSION")),
                scene: &scene.name,
                directory: &directory,
                backend: backend_name,
                frames: finished.iter().map(|done| FrameReport::new(done, backend_name)).collect(),
                load_seconds,
                seconds,
                notes: &notes,
                ffmpeg: movie.ffmpeg(),
                settings: &settings,
            });
        }
        if self.running.quiet { Ok(()) } else { conclude(&finished, &movie, seconds) }
    }

    fn options(&self) -> anyhow::Result<RenderOptions> {
        let quality = self.quality()?;
        let aovs = self.images.aovs()?;
        if aovs.contains(&Aov::Error) && !matches!(quality, Quality::Error(_)) {
            anyhow::bail!("--aov error is for --mode auto, which estimates it");
        }
        Ok(RenderOptions {
            quality,
            filter: self.exposure.filter(),
            prefilter: self.prefilter.into(),
            shading: self.surfaces.shading(),
            two_sided: self.surfaces.two_sided,
            epsilon: self.surfaces.epsilon,
            seed: self.exposure.seed,
            memory: self.memory,
            reconstruct: self.reconstruct == Reconstruct::Along,
            aovs,
        })
    }

    fn quality(&self) -> anyhow::Result<Quality> {
        let refuse = |given: bool, message: &str| if given { Err(anyhow::anyhow!("{message}")) } else { Ok(()) };
        let interleave = self.interleave.unwrap_or_default();
        let counted = self.samples.is_some() || self.interleave.is_some();
        let mode = self.mode.unwrap_or(if counted { Mode::Supersample } else { Mode::Auto });
        if mode != Mode::Auto {
            refuse(self.error.is_some(), "--error is for --mode auto")?;
            refuse(self.samples_max.is_some(), "--samples-max is for --mode auto")?;
        }
        if mode != Mode::Bucket {
            refuse(self.buckets.is_some(), "--buckets is for --mode bucket")?;
        }
        if mode != Mode::Volumetric {
            for (given, option) in [
                (self.kernel.is_some(), "--kernel"),
                (self.kernel_weight.is_some(), "--kernel-weight"),
                (self.source_samples.is_some(), "--source-samples"),
                (self.alpha.is_some(), "--alpha"),
                (self.normalise.is_some(), "--normalise"),
                (self.published, "--published"),
            ] {
                refuse(given, &format!("{option} is for --mode volumetric"))?;
            }
        }
        match mode {
            Mode::Auto => {
                refuse(
                    self.samples.is_some(),
                    "--mode auto chooses the samples; use --samples-max, or --mode supersample",
                )?;
                refuse(
                    self.interleave.is_some(),
                    "--mode auto chooses the lattice; --interleave is for --mode supersample",
                )?;
                let default = ErrorTarget::default();
                Ok(Quality::Error(ErrorTarget {
                    error: self.error.unwrap_or(default.error),
                    samples_max: self.samples_max.unwrap_or(default.samples_max),
                    pixel_samples: self.pixel_samples.unwrap_or(default.pixel_samples),
                }))
            }
            Mode::Volumetric => {
                refuse(
                    self.interleave.is_some(),
                    "--interleave is not for --mode volumetric, which has no time samples",
                )?;
                let swept = self.swept();
                refuse(
                    swept.weight == options::KernelWeight::Chord && swept.shape == options::KernelShape::Tube,
                    "--kernel-weight chord is the length within an ellipsoid: it needs --kernel ellipsoid",
                )?;
                let intervals = self.samples.unwrap_or(10);
                Ok(Quality::Mode(BlurMode::Volumetric { intervals, pixel_samples: self.positions(intervals), swept }))
            }
            Mode::Still => {
                refuse(
                    self.samples.is_some(),
                    "--samples counts time samples, which --mode still has not; use --pixel-samples",
                )?;
                refuse(self.interleave.is_some(), "--interleave is for modes with time samples, not for --mode still")?;
                Ok(Quality::Mode(BlurMode::Still { pixel_samples: self.pixel_samples.unwrap_or(16) }))
            }
            Mode::Supersample => {
                let samples = self.samples.unwrap_or(32);
                Ok(Quality::Mode(BlurMode::Supersample { samples, pixel_samples: self.positions(samples), interleave }))
            }
            Mode::Bucket => {
                let (buckets, samples) = (self.buckets.unwrap_or(8), self.samples.unwrap_or(4));
                refuse(
                    u64::from(buckets) * u64::from(samples) > u64::from(grammar::MAX_SAMPLES),
                    &format!("{buckets} buckets of {samples} samples: at most {} in all", grammar::MAX_SAMPLES),
                )?;
                Ok(Quality::Mode(BlurMode::Bucket {
                    buckets,
                    samples,
                    pixel_samples: self.positions(buckets),
                    interleave,
                }))
            }
        }
    }

    /// Sub-pixel positions; as many as groups of time samples is what there is without.
    fn positions(&self, groups: u32) -> Option<u32> {
        self.pixel_samples.filter(|&positions| positions != groups)
    }

    /// Of mode volumetric.
    fn swept(&self) -> SweptKernel {
        let source_samples = SourceSamples(self.source_samples.unwrap_or(1));
        if self.published {
            return SweptKernel { source_samples, ..SweptKernel::PUBLISHED };
        }
        SweptKernel {
            shape: match self.kernel.unwrap_or_default() {
                Kernel::Tube => options::KernelShape::Tube,
                Kernel::Ellipsoid => options::KernelShape::Ellipsoid,
            },
            weight: match self.kernel_weight.unwrap_or_default() {
                KernelWeight::Integral => options::KernelWeight::Integral,
                KernelWeight::Chord => options::KernelWeight::Chord,
            },
            source_samples,
            alpha: match self.alpha.unwrap_or_default() {
                Alpha::Union => options::TemporalAlpha::Union,
                Alpha::Sum => options::TemporalAlpha::Sum,
            },
            normalise: match self.normalise.unwrap_or_default() {
                Normalise::Interval => options::Normalise::Interval,
                Normalise::Once => options::Normalise::Once,
            },
        }
    }
}

/// Begins a frame or, without one, finishes one that was begun.
fn step(under_way: &mut renderer::Frames<'_>, frame: Option<i64>) -> anyhow::Result<Option<(i64, Rendered)>> {
    match frame {
        Some(number) => under_way.begin(number).with_context(|| format!("frame {number}")),
        None => Ok(under_way.finish()?),
    }
}

/// Backend, size, mode, frames: one line.
fn headline(scene: &Scene, frames: Frames, options: &RenderOptions, place: &str) -> String {
    let range = if frames.first == frames.last {
        format!("frame {}", frames.first)
    } else {
        format!("frames {}..{}", frames.first, frames.last)
    };
    format!(
        "{}: {range}, {} x {} pixels, mode {}, on {place}",
        scene.name, scene.image.width, scene.image.height, options.quality
    )
}

/// What mode auto reached in the frame with the largest error.
fn worst(finished: &[Finished]) -> Option<Achieved> {
    let achieved = finished.iter().filter_map(|done| done.rendered.and_then(|(_, stats)| stats.achieved));
    achieved.max_by(|a, b| a.error.total_cmp(&b.error))
}

/// Where the images are, and how to make a movie.
fn conclude(finished: &[Finished], movie: &Movie<'_>, seconds: f64) -> anyhow::Result<()> {
    let skipped = finished.iter().filter(|f| f.rendered.is_none()).count();
    let also = if skipped > 0 { format!(" ({skipped} were there already)") } else { String::new() };
    let word = if finished.len() == 1 { "image" } else { "images" };
    let movie_line = movie.ffmpeg().map_or_else(String::new, |line| format!("as a movie: {line}\n"));
    let reached = worst(finished)
        .map_or_else(String::new, |achieved| with_flags(&format!("the frame with the largest: {achieved}\n")));
    print(&format!("{} {word}{also} in {seconds:.1} s: {}\n{reached}{movie_line}", finished.len(), movie.files()))
}

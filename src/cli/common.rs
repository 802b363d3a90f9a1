//! What all commands share that make images of a scene: their options, and what happens before the first frame.
//!
//! Four groups of options, one for each heading of the help, so that a command puts its own options beside them.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context as _, bail};
use clap::{Args, ValueEnum};
use glam::DVec3;
use splatblur::film::Aov;
use splatblur::image::{Bits, Format};
use splatblur::scene::Scene;
use splatblur::scene_file;
use splatblur::scene_file::Loaded;
use splatblur::time::Weight;
use splatblur::{files, options};

use super::grammar::{self, Frames};
use super::output::say;
use super::progress::Loading;

/// The scene, and the files to make of it.
#[derive(Debug, Args)]
pub(super) struct Images {
    /// Scene file (XML).
    pub(super) scene: PathBuf,

    /// Directory of the images; made if missing [default: out/<scene>].
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    pub(super) out: Option<PathBuf>,
    /// Frames, inclusive: A..B, A-B or one; negative ones with `..` only, as in -5..-2 [default: the scene's].
    #[arg(long, value_name = "A..B", allow_hyphen_values = true, value_parser = grammar::frames, help_heading = "Output")]
    frames: Option<Frames>,
    /// Image size in pixels [default: the scene's, else 1024x768].
    #[arg(long, value_name = "WxH", allow_hyphen_values = true, value_parser = grammar::size, help_heading = "Output")]
    size: Option<(u32, u32)>,
    /// File format: PNG is sRGB with straight alpha; EXR is float, linear, premultiplied.
    #[arg(long, value_enum, default_value_t, help_heading = "Output")]
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
}

/// What falls on the film.
#[derive(Debug, Args)]
pub(super) struct Exposure {
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
    /// Seed of the samples.
    #[arg(long, value_name = "S", default_value_t = 1, allow_hyphen_values = true, help_heading = "Blur")]
    pub(super) seed: u64,
}

/// How surfels become a surface.
#[derive(Debug, Args)]
pub(super) struct Surfaces {
    /// Shading per pixel (phong) or per surfel (gouraud).
    #[arg(long, value_enum, default_value_t, help_heading = "Surfaces")]
    shading: Shading,
    /// Show back faces, with their normals turned to the viewer.
    #[arg(long, help_heading = "Surfaces")]
    pub(super) two_sided: bool,
    /// Depth tolerance of visibility, scene units, for all objects [default: the scene's, else the median splat radius].
    #[arg(long, value_name = "E", allow_hyphen_values = true, value_parser = grammar::epsilon, help_heading = "Surfaces")]
    pub(super) epsilon: Option<f64>,
}

/// How the program goes about it. None of it changes the images.
#[derive(Debug, Args)]
pub(super) struct Running {
    /// Threads [default: all cores]. The images do not depend on it.
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = "Running")]
    threads: Option<u16>,
    /// Report unknown words of the scene instead of refusing them.
    #[arg(long, help_heading = "Running")]
    lenient: bool,
    /// Refuse scenes that name files outside DIR.
    #[arg(long, value_name = "DIR", help_heading = "Running")]
    restrict: Option<PathBuf>,
    /// Print one JSON object about the run on stdout instead of text.
    #[arg(long, help_heading = "Running")]
    pub(super) json: bool,
    /// Say nothing but errors.
    #[arg(long, help_heading = "Running")]
    pub(super) quiet: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum FileFormat {
    #[default]
    Png,
    Exr,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Depth {
    #[value(name = "8")]
    Eight,
    #[value(name = "16")]
    Sixteen,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum Filter {
    #[default]
    Box,
    Point,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum Prefilter {
    #[default]
    Approx,
    None,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum Shading {
    #[default]
    Phong,
    Gouraud,
}

impl From<Filter> for options::PixelFilter {
    fn from(filter: Filter) -> Self {
        match filter {
            Filter::Box => Self::Box,
            Filter::Point => Self::Point,
        }
    }
}

impl From<Prefilter> for options::Prefilter {
    fn from(prefilter: Prefilter) -> Self {
        match prefilter {
            Prefilter::Approx => Self::Approx,
            Prefilter::None => Self::None,
        }
    }
}

impl From<Shading> for options::Shading {
    fn from(shading: Shading) -> Self {
        match shading {
            Shading::Phong => Self::Phong,
            Shading::Gouraud => Self::Gouraud,
        }
    }
}

/// A scene that is ready for its first frame.
pub(super) struct Ready {
    /// As the options change it.
    pub(super) scene: Scene,
    pub(super) notes: Vec<String>,
    pub(super) frames: Frames,
    pub(super) format: Format,
}

impl Images {
    /// Extra channels, in the order of their layers.
    pub(super) fn aovs(&self) -> anyhow::Result<Vec<Aov>> {
        grammar::aovs(&self.aov).map_err(anyhow::Error::msg)
    }

    /// What the options on files ask for; what the format cannot hold is refused.
    fn format(&self) -> anyhow::Result<Format> {
        match self.format {
            FileFormat::Png if !self.aov.is_empty() => {
                bail!("--aov needs --format exr: PNG holds colour and alpha only")
            }
            FileFormat::Exr if self.bits.is_some() => bail!("--bits is for --format png: EXR is always 32-bit float"),
            FileFormat::Exr => Ok(Format::Exr),
            FileFormat::Png => {
                let bits = match self.bits {
                    Some(Depth::Sixteen) => Bits::Sixteen,
                    Some(Depth::Eight) | None => Bits::Eight,
                };
                Ok(Format::Png { bits, alpha: self.transparent })
            }
        }
    }

    fn apply(&self, scene: &mut Scene) {
        if let Some((width, height)) = self.size {
            (scene.image.width, scene.image.height) = (width, height);
        }
        if let Some(colour) = self.background {
            (scene.image.background, scene.image.transparent) = (colour, false);
        }
        scene.image.transparent |= self.transparent;
    }
}

impl Exposure {
    pub(super) fn filter(&self) -> options::PixelFilter {
        self.filter.into()
    }

    fn apply(&self, scene: &mut Scene) {
        if let Some((open, close)) = self.shutter {
            (scene.shutter.open, scene.shutter.close) = (open, close);
        }
        if let Some(weight) = &self.weight {
            scene.shutter.weight = weight.clone();
        }
    }
}

impl Surfaces {
    pub(super) fn shading(&self) -> options::Shading {
        self.shading.into()
    }
}

impl Running {
    /// The threads that everything runs on.
    pub(super) fn pool(&self) -> anyhow::Result<rayon::ThreadPool> {
        // 0: as many as there are cores.
        let threads = self.threads.map_or(0, usize::from);
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().context("cannot start the threads")
    }
}

impl Ready {
    /// Checks the options, reads the scene with the threads of `pool`, says its notes, and lets the options replace what it says.
    pub(super) fn new(
        images: &Images,
        exposure: &Exposure,
        running: &Running,
        pool: &rayon::ThreadPool,
    ) -> anyhow::Result<Self> {
        let format = images.format()?;
        let restrict = running.restrict.as_deref();
        let Loaded { mut scene, notes } = load_scene(&images.scene, running.lenient, restrict, running.quiet, pool)?;
        if !running.quiet {
            for note in &notes {
                say(&format!("note: {note}"));
            }
        }
        images.apply(&mut scene);
        exposure.apply(&mut scene);
        let format = match format {
            Format::Png { bits, .. } => Format::Png { bits, alpha: scene.image.transparent },
            Format::Exr => Format::Exr,
        };
        let of_scene = Frames { first: scene.frames.first, last: scene.frames.last };
        let frames = images.frames.map_or_else(|| grammar::check_range(of_scene), Ok);
        let frames = frames.map_err(anyhow::Error::msg).context("frames of the scene")?;
        Ok(Self { scene, notes, frames, format })
    }
}

/// Reads the scene with the threads of `pool`, showing progress on a terminal.
pub(super) fn load_scene(
    path: &Path,
    lenient: bool,
    restrict: Option<&Path>,
    quiet: bool,
    pool: &rayon::ThreadPool,
) -> anyhow::Result<Loaded> {
    if let Some(directory) = restrict.filter(|directory| !directory.is_dir()) {
        bail!("--restrict: {} is not a directory", directory.display());
    }
    let progress = Loading::new(quiet);
    let step = |what: &str, share: f32| progress.step(what, share);
    let options = scene_file::LoadOptions { lenient, restrict, progress: Some(&step) };
    Ok(pool.install(|| scene_file::load(path, &options))?)
}

/// Makes the output directory, and finds out now, not after the first frame, whether files can be written there.
pub(super) fn open_directory(directory: &Path) -> anyhow::Result<()> {
    let context = || format!("cannot write into the output directory {}", directory.display());
    std::fs::create_dir_all(directory).with_context(context)?;
    files::check_writable(directory).with_context(context)
}

/// On Ctrl-C: lets the file that is being written become whole, and ends the program. `how` goes on later.
pub(super) fn stop_on_interrupt(
    gate: &Arc<Mutex<()>>,
    directory: &Path,
    how: &'static str,
    quiet: bool,
) -> anyhow::Result<()> {
    let (gate, directory) = (Arc::clone(gate), directory.to_owned());
    let stop = move || {
        let _held = gate.lock().unwrap_or_else(PoisonError::into_inner);
        if !quiet {
            // Below the ^C of the terminal.
            say("");
            say(&format!("interrupted; finished frames are in {} ({how} goes on)", directory.display()));
        }
        std::process::exit(i32::from(super::INTERRUPTED));
    };
    ctrlc::set_handler(stop).context("cannot watch for Ctrl-C")
}

//! What commands share that read a scene and make pictures of it: groups of options, and what happens before the first
//! frame.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context as _, bail};
use clap::Args;
use glam::DVec3;
use splatblur::files;
use splatblur::film::Aov;
use splatblur::image::{Bits, Compression, Display, Exr, Format, Precision};
use splatblur::model::{self, ModelError};
use splatblur::movie;
use splatblur::options::{self, Detail, Look, PixelFilter, Prefilter, Shading};
use splatblur::scene::{Scene, Studio};
use splatblur::scene_file::{self, LoadedScene, SceneError};
use splatblur::time::{Readout, Weight};

use super::frames::{self, FrameList};
use super::info::{self, InputKind};
use super::memory;
use super::output::say;
use super::progress::Loading;
use super::studio::{self, DisplayArgs, ModelAlone, StudioArgs};
use super::values::{self, ShutterTimes};

/// The grammar of modes, for long helps.
pub(super) const MODES: &str = "\
Modes: NAME[:COUNTS][+OPTION=VALUE]...
  auto:0.025                  as many time samples as the error takes (or auto:draft, auto:good, auto:final);
                              +samples-max=N, +pixel-samples=P, +interleave=S: none, 2 or 4, or auto, where it finds S,
                              +white=W: the error also holds for the picture exposed so that light W is white (HDR)
  still:16                    no motion, P sub-pixel positions
  supersample:32              N time samples; +pixel-samples=P: at P sub-pixel positions (here and below; without it
                              they depend on the mode and on what rests). What is at rest is splatted
                              once at each.
  supersample:8+interleave=2  neighbouring pixels of a 2 x 2 (or 4 x 4) lattice see different times
  supersample:8+times=random  random times; or +times=stratified: one in each of N equal shares of the exposure
  bucket:8x4                  B buckets of N time samples; +interleave=S, +times=T, +pixel-samples=P
  volumetric:10               N intervals of swept kernels; +kernel=ellipsoid (or +ellipsoid), +kernel-weight=chord or
                              =line (or +chord, +line), +alpha=sum (or +sum), +normalise=once (or +once), +overlap=S,
                              +source-samples=K, +pixel-samples=P; +published: all as in Wolf (2008)
All take +filter=F, +prefilter=P and +detail=D, which say what --filter, --prefilter and --detail do.
Counts may be left out; those shown are the defaults (auto: good).";

/// Values that replace those of the scene.
#[derive(Debug, Args)]
pub(super) struct Overrides {
    /// Image size in pixels [default: the scene's, else 1024x768].
    #[arg(long, value_name = "WxH", allow_hyphen_values = true, value_parser = values::size, help_heading = "Scene")]
    size: Option<(u32, u32)>,
    /// Background in linear light [default: the scene's; a grey in the studio of a model].
    #[arg(
        long,
        value_name = "R,G,B",
        allow_hyphen_values = true,
        value_parser = values::colour,
        help_heading = "Scene"
    )]
    pub(super) background: Option<DVec3>,
    /// Shutter opening and closing, frames around the frame number; or how long it is open, half of that before the
    /// frame number: an angle, as in 180deg (360deg is a frame), or a time at the scene's frame rate, as in 1/48s or
    /// 0.02s [default: the scene's, else -0.25,0.25].
    #[arg(
        long,
        value_name = "OPEN,CLOSE|ANGLEdeg|TIMEs",
        allow_hyphen_values = true,
        value_parser = values::shutter,
        help_heading = "Scene"
    )]
    shutter: Option<ShutterTimes>,
    /// Time weight over the shutter: box, tent, ramp:centre=1, exponential:rate=3,centre=1,
    /// one-minus-exponential:centre=1, gaussian:centre=.5,width=.2
    /// (parameters optional) [default: the scene's, else box].
    #[arg(long, value_name = "WEIGHT", help_heading = "Scene")]
    weight: Option<Weight>,
    /// Rolling shutter: frames from the exposure of the first edge of the image to that of the last one, then where the
    /// read-out goes (down, up, right, left) and what is exposed at the shutter's own times (middle, first), as in
    /// 0.4,down,middle [default: the scene's, else 0].
    #[arg(long, value_name = "FRAMES[,DIRECTION][,ANCHOR]", allow_hyphen_values = true, help_heading = "Scene")]
    readout: Option<Readout>,
    /// XML file with one <camera>, which takes the place of the scene's; where it has keys, the frames are theirs.
    #[arg(long, value_name = "FILE", help_heading = "Scene")]
    pub(super) camera_path: Option<PathBuf>,
}

impl Overrides {
    /// All but the size, with which a scene is read.
    fn apply(&self, scene: &mut Scene) -> anyhow::Result<()> {
        if let Some(colour) = self.background {
            (scene.image.background, scene.image.transparent) = (colour, false);
        }
        if let Some(times) = self.shutter {
            let at_rate = times.at(scene.frames.rate).map_err(anyhow::Error::msg);
            (scene.shutter.open, scene.shutter.close) =
                at_rate.with_context(|| format!("--shutter at {} frames a second", scene.frames.rate))?;
        }
        if let Some(weight) = &self.weight {
            scene.shutter.weight = weight.clone();
        }
        if let Some(readout) = self.readout {
            scene.shutter.readout = readout;
        }
        Ok(())
    }
}

/// Where samples are.
#[derive(Debug, Args)]
pub(super) struct Sampling {
    /// What a pixel is a mean of: its square (box), its centre (point), or a Gaussian about it, cut at 2 SIGMA
    /// (gaussian:SIGMA in pixels, 0.25 to 4; gaussian is gaussian:1) [default: box].
    #[arg(long, value_name = "FILTER", help_heading = "Sampling")]
    pub(super) filter: Option<PixelFilter>,
    /// Seed of positions and times.
    #[arg(long, value_name = "S", default_value_t = 1, allow_hyphen_values = true, help_heading = "Sampling")]
    pub(super) seed: u64,
}

/// How surfels become a surface.
#[derive(Debug, Args)]
pub(super) struct Surfaces {
    /// Shading per pixel (phong) or per surfel (gouraud).
    #[arg(
        long,
        default_value_t,
        value_parser = values::one_of::<Shading>(Shading::WORDS),
        help_heading = "Surfaces"
    )]
    pub(super) shading: Shading,
    /// Show back faces, with their normals turned to the viewer.
    #[arg(long, help_heading = "Surfaces")]
    pub(super) two_sided: bool,
    /// Leave shadows out.
    #[arg(long, help_heading = "Surfaces")]
    pub(super) no_shadows: bool,
    /// Depth tolerance of visibility, scene units, for all objects [default: the scene's, else the median splat
    /// radius].
    #[arg(
        long,
        value_name = "E",
        allow_hyphen_values = true,
        value_parser = values::epsilon,
        help_heading = "Surfaces"
    )]
    pub(super) epsilon: Option<f64>,
}

impl Surfaces {
    /// The look of a picture: surfaces, where its samples are, and its extra channels.
    pub(super) fn look(&self, sampling: &Sampling, aovs: Vec<Aov>) -> Look {
        Look {
            filter: sampling.filter.unwrap_or_default(),
            shading: self.shading,
            two_sided: self.two_sided,
            epsilon: self.epsilon,
            shadows: !self.no_shadows,
            seed: sampling.seed,
            aovs,
        }
    }
}

/// What only splatting has.
#[derive(Debug, Args)]
pub(super) struct Splatting {
    /// Screen-space prefilter against aliasing of small splats [default: auto, which is ewa with few sub-pixel
    /// positions and for minified splats, else none]. The reference has none.
    #[arg(
        long,
        value_parser = values::one_of::<Prefilter>(Prefilter::WORDS),
        help_heading = "Surfaces"
    )]
    pub(super) prefilter: Option<Prefilter>,
    /// How fine the surfels are that show. Where many lie within a pixel, or blur washes them out, fewer and larger
    /// ones take their place. auto goes with --error, and is good in other modes; full shows all [default: auto].
    #[arg(long, value_parser = values::one_of::<Detail>(Detail::WORDS), help_heading = "Surfaces")]
    pub(super) detail: Option<Detail>,
    #[command(flatten)]
    pub(super) limit: Limit,
}

/// What rendering may take.
#[derive(Debug, Args)]
pub(super) struct Limit {
    /// Memory that a frame and the models may take together, as in 64M, 1G [default: half of the computer's or
    /// container's, at least 1G, on a GPU at most 8G]. The images do not depend on it.
    #[arg(
        long,
        value_name = "SIZE",
        allow_hyphen_values = true,
        value_parser = values::memory,
        help_heading = "Running"
    )]
    memory: Option<u64>,
}

impl Limit {
    /// Bytes that a frame and the models may take together; `backend` is the renderer's name.
    pub(super) fn memory(&self, backend: &str, quiet: bool) -> u64 {
        memory::budget(self.memory, backend == "gpu", quiet)
    }
}

/// How the program goes about it. None of it changes the images.
#[derive(Debug, Args)]
pub(super) struct Running {
    /// Threads [default: all cores]. The images do not depend on it.
    #[arg(
        long,
        value_name = "T",
        allow_hyphen_values = true,
        value_parser = clap::value_parser!(u16).range(1..=1024),
        help_heading = "Running"
    )]
    threads: Option<u16>,
    /// Report unknown words of the scene instead of refusing them.
    #[arg(long, help_heading = "Running")]
    lenient: bool,
    /// Refuse scenes that name files outside DIR.
    #[arg(long, value_name = "DIR", help_heading = "Running")]
    restrict: Option<PathBuf>,
    /// Say nothing but errors.
    #[arg(long, help_heading = "Running")]
    pub(super) quiet: bool,
}

impl Running {
    /// The threads that everything runs on.
    pub(super) fn pool(&self) -> anyhow::Result<rayon::ThreadPool> {
        // 0: as many as there are cores.
        let threads = self.threads.map_or(0, usize::from);
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().context("cannot start the threads")
    }

    /// The directory that no path may leave.
    pub(super) fn restrict(&self) -> anyhow::Result<Option<&Path>> {
        let restrict = self.restrict.as_deref();
        if let Some(directory) = restrict.filter(|directory| !directory.is_dir()) {
            bail!("--restrict: {} is not a directory", directory.display());
        }
        Ok(restrict)
    }

    /// Reads a scene with the threads of `pool`, showing progress on a terminal; says its notes, and puts the overrides
    /// into it.
    ///
    /// `alone`: how a model file is shown; scene files have none of it.
    pub(super) fn load(
        &self,
        path: &Path,
        overrides: &Overrides,
        alone: &ModelAlone,
        pool: &rayon::ThreadPool,
    ) -> anyhow::Result<LoadedScene> {
        let restrict = self.restrict()?;
        let progress = Loading::new(self.quiet);
        let step = |what: &str, share: f32| progress.step(what, share);
        let head = info::head(path).with_context(|| format!("cannot read {}", path.display()))?;
        let kind = info::kind(&head, path);
        let shutter = match overrides.shutter {
            Some(ShutterTimes::Frames(open, close)) => Some((open, close)),
            Some(ShutterTimes::Seconds(_)) if kind == InputKind::Model => bail!(
                "--shutter in seconds needs the frame rate of a scene, and {} is a model: name an angle, as in 180deg",
                path.display()
            ),
            Some(ShutterTimes::Seconds(_)) | None => None,
        };
        let options = scene_file::SceneLoadOptions {
            lenient: self.lenient,
            restrict,
            size: overrides.size,
            up: alone.up,
            kind: alone.kind,
            radius: alone.radius,
            colour_by: alone.colour_by.as_ref(),
            shutter,
            readout: overrides.readout,
            studio: alone.studio,
            camera_path: overrides.camera_path.as_deref(),
            progress: Some(&step),
        };
        let mut loaded = match kind {
            InputKind::Scene => {
                alone.refuse_choices(path)?;
                pool.install(|| scene_file::load(path, &options))?
            }
            InputKind::Model => pool.install(|| scene_file::load_model(path, &options)).map_err(explained)?,
            InputKind::Animation => {
                bail!("{} is an animation: name it in the <animation> of a scene, and render that", path.display())
            }
            InputKind::Image => bail!("{} is a picture, neither a scene nor a model", path.display()),
        };
        drop(progress);
        if !self.quiet {
            for note in &loaded.notes {
                say(&format!("note: {note}"));
            }
        }
        overrides.apply(&mut loaded.scene)?;
        if kind == InputKind::Model {
            let camera = match &overrides.camera_path {
                Some(path) => format!("the camera of {}", path.display()),
                None => scene_file::camera_line(&loaded.scene.camera),
            };
            let mut notes = vec![format!("{} is a model: took a scene of it alone, seen by {camera}", path.display())];
            notes.extend(loaded.studio.map(studio::in_words));
            if !self.quiet {
                for note in &notes {
                    say(&format!("note: {note}"));
                }
            }
            loaded.notes.extend(notes);
        }
        Ok(loaded)
    }
}

/// A file of unknown content may have been meant as a scene.
fn explained(error: SceneError) -> anyhow::Error {
    match error {
        SceneError::Alone(ModelError::UnknownFormat { path }) => anyhow::anyhow!(
            "{} is neither a scene (XML) nor a model of a known format ({})",
            path.display(),
            model::ModelFormat::KNOWN
        ),
        other => other.into(),
    }
}

/// The scene, and the files to make of it.
#[derive(Debug, Args)]
pub(super) struct Images {
    /// Scene file (XML), or a model file: then the scene is this model alone, on 1024x768 pixels, in a studio.
    pub(super) scene: PathBuf,

    /// Directory of the images; made if missing [default: out/<scene>].
    #[arg(long, value_name = "DIR", value_parser = values::directory(), help_heading = "Output")]
    pub(super) out: Option<PathBuf>,
    #[arg(
        long,
        value_name = "LIST",
        allow_hyphen_values = true,
        value_parser = frames::frames,
        help = frames::HELP,
        help_heading = "Output"
    )]
    frames: Option<FrameList>,
    /// File format: PNG is sRGB with straight alpha; EXR is linear, premultiplied, float or half.
    #[arg(long, value_parser = ["png", "exr"], default_value = "png", help_heading = "Output")]
    format: String,
    /// Bits of a channel: PNG 8 or 16; EXR 16 (half: colours and layers with 11 significant bits, but depth and samples
    /// in float) or 32 (float) [default: PNG 8, EXR 32].
    #[arg(long, value_name = "BITS", value_parser = ["8", "16", "32"], help_heading = "Output")]
    bits: Option<String>,
    /// Compression of EXR files; all keep every value: none, rle, zips (deflate, each row), zip (16 rows), piz
    /// (wavelets, 32 rows) [default: zip].
    #[arg(long, value_name = "METHOD", value_parser = values::compression(), help_heading = "Output")]
    compression: Option<Compression>,
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        help = aov_help(&Aov::LAYERS),
        help_heading = "Output"
    )]
    aov: Vec<Aov>,
    /// Leave the background out and keep alpha.
    #[arg(long, conflicts_with = "background", help_heading = "Output")]
    transparent: bool,
    /// Print one JSON object about the run on stdout instead of text.
    #[arg(long, help_heading = "Output")]
    pub(super) json: bool,
    #[command(flatten)]
    alone: StudioArgs,
    #[command(flatten)]
    display: DisplayArgs,
}

impl Images {
    /// Extra channels, in the order of their layers.
    pub(super) fn aovs(&self) -> anyhow::Result<Vec<Aov>> {
        options::in_order(&self.aov).context("--aov")
    }

    /// What the options on files ask for; what the format cannot hold is refused.
    fn format(&self) -> anyhow::Result<Format> {
        match &*self.format {
            "exr" => {
                let precision = match self.bits.as_deref() {
                    Some("8") => bail!("--bits 8 is for --format png: EXR has 16 or 32 bits"),
                    Some("16") => Precision::Half,
                    _ => Precision::Float,
                };
                Ok(Format::Exr(Exr { precision, compression: self.compression.unwrap_or_default() }))
            }
            _ if !self.aov.is_empty() => bail!("--aov needs --format exr: PNG holds colour and alpha only"),
            _ if self.compression.is_some() => bail!("--compression is for --format exr: PNG has one of its own"),
            _ => {
                let bits = match self.bits.as_deref() {
                    Some("32") => bail!("--bits 32 is for --format exr: PNG has 8 or 16 bits"),
                    Some("16") => Bits::Sixteen,
                    _ => Bits::Eight,
                };
                Ok(Format::Png { bits, alpha: self.transparent })
            }
        }
    }
}

/// Help of `--aov`, with what each layer holds.
pub(super) fn aov_help(aovs: &[Aov]) -> String {
    let mut text =
        "Extra layers, EXR only, several with commas. Headers of files say the same (attribute `layers`):".to_owned();
    for aov in aovs {
        // Writing to a string cannot fail.
        let _ = write!(text, "\n{}: {}", aov.name(), aov.meaning());
        if *aov == Aov::Object {
            text.push_str(". One more rendering of the frame for each object");
        }
    }
    text
}

/// A scene that is ready for its first frame.
pub(super) struct Ready {
    /// As the options change it.
    pub(super) scene: Scene,
    pub(super) notes: Vec<String>,
    pub(super) frames: FrameList,
    pub(super) format: Format,
    /// How PNG files and movies show light.
    pub(super) display: Display,
    /// The studio that the model alone stands in.
    pub(super) studio: Option<Studio>,
}

impl Ready {
    /// Checks the options, reads the scene with the threads of `pool`, says its notes, and lets the options replace its
    /// values. `has_movie`: there is more than files of pictures.
    pub(super) fn new(
        images: &Images,
        has_movie: bool,
        overrides: &Overrides,
        running: &Running,
        pool: &rayon::ThreadPool,
    ) -> anyhow::Result<Self> {
        let format = images.format()?;
        if matches!(format, Format::Exr(_)) && !has_movie {
            images.display.refuse("PNG")?;
        }
        let alone = images.alone.of(overrides.background, images.transparent)?;
        let loaded = running.load(&images.scene, overrides, &alone, pool)?;
        let display = images.display.or(loaded.display(), &loaded.scene)?;
        let LoadedScene { mut scene, notes, studio } = loaded;
        scene.image.transparent |= images.transparent;
        let format = match format {
            Format::Png { bits, .. } => Format::Png { bits, alpha: scene.image.transparent },
            exr @ Format::Exr(_) => exr,
        };
        let frames = frames_of(images.frames.as_ref(), &scene)?;
        Ok(Self { scene, notes, frames, format, display, studio })
    }
}

/// The frames that are asked for, else the scene's.
pub(super) fn frames_of(asked: Option<&FrameList>, scene: &Scene) -> anyhow::Result<FrameList> {
    let of_scene = || FrameList::range(scene.frames.first, scene.frames.last);
    let frames = asked.map_or_else(of_scene, |asked| Ok(asked.clone()));
    frames.map_err(anyhow::Error::msg).context("frames of the scene")
}

/// Makes the output directory, and finds out now, not after the first frame, whether files can be written there.
pub(super) fn open_directory(directory: &Path) -> anyhow::Result<()> {
    if directory.exists() && !directory.is_dir() {
        bail!(
            "cannot write into the output directory {}: it is a file; name a directory, which is made if missing",
            directory.display()
        );
    }
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
    let line = format!("interrupted; finished frames are in {} ({how} goes on)", directory.display());
    stop_with_a_line(gate, line, quiet)
}

/// As [`stop_on_interrupt`], with another `line` to say.
pub(super) fn stop_with_a_line(gate: &Arc<Mutex<()>>, line: String, quiet: bool) -> anyhow::Result<()> {
    let gate = Arc::clone(gate);
    let stop = move || {
        let _held = gate.lock().unwrap_or_else(PoisonError::into_inner);
        movie::abandon();
        if !quiet {
            // Below the ^C of the terminal.
            say("");
            say(&line);
        }
        // Without exit handlers: those of some graphics drivers crash while another thread uses the device
        // (https://github.com/gfx-rs/wgpu/issues/8365).
        signal_hook::low_level::exit(i32::from(super::INTERRUPTED));
    };
    ctrlc::set_handler(stop).context("cannot watch for Ctrl-C")
}

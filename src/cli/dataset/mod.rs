//! `splatblur dataset`: blurred pictures with the truth about them. A little above 400 lines, as its options stand in
//! one place.

mod replay;
mod written;

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use anyhow::{Context as _, bail};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser as _};
use serde::Serialize;
use splatblur::FrameNumber;
use splatblur::backend::{Achieved, Meter};
use splatblur::dataset::{self, By, FolderLayout, HeldOut, MOST_SHARP, Noise, Recipe, Shake, TRANSFORMS};
use splatblur::files;
use splatblur::image::{Bits, Exr, Format, Precision, Response};
use splatblur::options::{BlurMode, Quality};
use splatblur::reference::ReferenceOptions;
use splatblur::renderer::Renderer;
use splatblur::scene::Scene;
use splatblur::scene_file::LoadedScene;
use splatblur::study::provenance::{PROGRAM, Provenance, Settings};
use splatblur::study::reference_samples;

use self::replay::Recorded;
use self::written::Output;
use super::backend::{BackendArgs, Wanted};
use super::common::{
    MODES, Overrides, Running, Sampling, Splatting, Surfaces, frames_of, open_directory, stop_on_interrupt,
};
use super::frames::{self, FrameList};
use super::output::{print, print_json, say};
use super::progress::{ProgressArgs, Rendering};
use super::render::blur::Blur;
use super::studio::ModelAlone;
use super::values;

/// Render blurred pictures with the truth about them: sharp pictures, flow, depth, cameras.
///
/// Writes for each frame the blurred picture, N sharp ones at even times from where the shutter opens to where it
/// closes, the flow from open to close and from the middle to close, depth and alpha of the middle, and the error of
/// the blurred picture; and for all frames DIR/transforms.json, when they are done. Numbers are EXR files that every
/// reader opens. docs/dataset.md says what each file holds. Neighbouring pixels see the same times, so that no pattern
/// is woven into the pictures; --interleave auto is what mode auto does in `splatblur render`.
#[derive(Debug, Args)]
#[command(after_long_help = format!("\
{MODES}

Examples:
  All frames of the scene, three sharp pictures each:
    splatblur dataset scenes/three_objects.xml --out out/truth
  Seven sharp pictures, as linear EXR, each blurred picture with its standard error:
    splatblur dataset scene.xml --out truth --sharp 7 --format exr --reference 256
  Blurred pictures that are the mean of 31 sharp ones:
    splatblur dataset scene.xml --out truth --sharp 31 --exact --format exr
  A camera with noise and a response of its own:
    splatblur dataset scene.xml --out truth --noise shot=4000,read=0.002 --response gamma:2.2
  A camera in a hand:
    splatblur dataset scene.xml --out truth --shake degrees=1,units=0.02 --seed 7
  The folders of the GOPRO dataset:
    splatblur dataset scene.xml --out train --layout gopro
  Pictures, cameras and points for programs that fit 3D Gaussians:
    splatblur dataset scene.xml --out train --layout colmap
  The same for Deblur-NeRF and its successors; every eighth view is sharp, for a test:
    splatblur dataset scene.xml --out train --layout deblur-nerf --hold 8
  The same bytes once more:
    splatblur dataset --replay truth/transforms.json --out again

Files (--layout nerfstudio): images/0012.png, sharp/0012-0.png and so on, flow/0012-open-close.exr and
0012-middle-close.exr (R: pixels right, G: pixels down, B: valid, A: seen at the second instant too), depth/0012.exr,
alpha/0012.exr, error/0012.exr, transforms.json. --layout gopro: <scene>/blur/000012.png, <scene>/sharp/000012.png (the
middle), <scene>/instants/000012-0.png and so on, and all others in <scene>/ too. --layout colmap: as nerfstudio, and
sparse/0/cameras.txt, images.txt and points3D.txt. --layout deblur-nerf: as colmap, and poses_bounds.npy, hold=8,
images_test/0000.png and so on (sharp), images_test_blurred/0000.png (docs/training.md).

JSON (--json), one object: program, scene, directory, transforms, backend, frames: [{{frame, skipped, seconds, auto (as
in `render`), mean_error (with --reference)}}], seconds, notes."))]
#[allow(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
pub(super) struct Dataset {
    /// Scene file (XML), or a model file, as in `splatblur render`.
    #[arg(required_unless_present = "replay")]
    scene: Option<PathBuf>,

    /// Directory of the dataset; made if missing [default: out/<scene>.dataset].
    #[arg(long, value_name = "DIR", value_parser = values::directory(), help_heading = "Output")]
    out: Option<PathBuf>,
    #[arg(
        long,
        value_name = "LIST",
        allow_hyphen_values = true,
        value_parser = frames::frames,
        help = frames::HELP,
        help_heading = "Output"
    )]
    frames: Option<FrameList>,
    /// Where files lie: as nerfstudio loads them, in the folders of the GOPRO dataset, with cameras and points as
    /// COLMAP writes them, or as the reader of Deblur-NeRF wants them.
    #[arg(
        long,
        default_value = "nerfstudio",
        value_parser = PossibleValuesParser::new(FolderLayout::ALL.map(|(name, _)| name)).map(|word| {
            let named = FolderLayout::ALL.into_iter().find(|(name, _)| *name == word);
            named.map_or_else(FolderLayout::default, |(_, layout)| layout)
        }),
        help_heading = "Output"
    )]
    layout: FolderLayout,
    /// Sharp pictures of a frame: 3 are those of open, middle and close; 1 is that of the middle.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 3,
        allow_hyphen_values = true,
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_SHARP)),
        help_heading = "Output"
    )]
    sharp: u32,
    /// Make the blurred picture the plain mean of the sharp ones in linear light, all with the same weight. With few of
    /// them it shows steps.
    #[arg(long, help_heading = "Output")]
    exact: bool,
    /// Hold out the first of all views and every N-th after it, in the order of their names: their pictures in images/
    /// are sharp, as those are that results are judged by [default: 8 with --layout deblur-nerf, else none].
    #[arg(
        long,
        value_name = "N",
        allow_hyphen_values = true,
        value_parser = clap::value_parser!(u32).range(i64::from(HeldOut::LEAST)..),
        help_heading = "Output"
    )]
    hold: Option<u32>,
    /// Leave the flow out. Volumes have none.
    #[arg(long, help_heading = "Output")]
    no_flow: bool,
    /// Format of blurred and sharp pictures: PNG through --response, or linear EXR.
    #[arg(long, value_parser = ["png", "exr"], default_value = "png", help_heading = "Output")]
    format: String,
    /// Bits of a channel: PNG 8 or 16; EXR 16 (half) or 32 (float) [default: PNG 8, EXR 32].
    #[arg(long, value_name = "BITS", value_parser = ["8", "16", "32"], help_heading = "Output")]
    bits: Option<String>,
    /// Skip frames whose files were made with the same settings and are whole.
    #[arg(long, help_heading = "Output")]
    resume: bool,
    /// Make the dataset of this transforms.json again, byte for byte. It says all choices; SCENE says where the scene
    /// is, if it has moved.
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    replay: Option<PathBuf>,
    /// Print one JSON object about the run on stdout instead of text.
    #[arg(long, help_heading = "Output")]
    json: bool,

    /// How light becomes the codes of PNG files: srgb, linear or gamma:G [default: srgb].
    #[arg(long, value_name = "RESPONSE", help_heading = "Camera")]
    response: Option<Response>,
    /// Noise of blurred pictures, before the response: shot=E (electrons of white), read=S (standard deviation, share
    /// of white), or both with a comma. --seed chooses it [default: none].
    #[arg(long, value_name = "NOISE", default_value_t, help_heading = "Camera")]
    noise: Noise,
    /// Shake the camera of each picture on a random path of its own: degrees=A, the largest angle within the exposure,
    /// units=D, the largest distance (scene units), or both with a comma. --seed chooses the paths [default: none].
    #[arg(long, value_name = "SHAKE", help_heading = "Camera")]
    shake: Option<Shake>,

    /// Make all pictures by ray tracing, with so many samples of a pixel (a multiple of 16), in place of a mode.
    #[arg(
        long,
        value_name = "SPP",
        value_parser = reference_samples,
        conflicts_with_all = ["mode", "error", "samples_max", "samples", "buckets", "interleave", "times",
            "pixel_samples", "kernel", "kernel_weight", "source_samples", "overlap", "alpha", "normalise", "published",
            "prefilter", "detail"],
        help_heading = "Blur"
    )]
    reference: Option<u64>,
    #[command(flatten)]
    blur: Blur,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    sampling: Sampling,
    #[command(flatten)]
    surfaces: Surfaces,
    #[command(flatten)]
    splatting: Splatting,
    #[command(flatten)]
    place: BackendArgs,
    #[command(flatten)]
    running: Running,
    #[command(flatten)]
    progress: ProgressArgs,
}

/// One view of so many is held out in data for Deblur-NeRF, as in that of LLFF.
const HOLD: u32 = 8;

#[derive(Serialize)]
struct Report<'a> {
    program: &'static str,
    scene: &'a str,
    directory: &'a Path,
    transforms: &'a Path,
    backend: &'a str,
    frames: Vec<FrameReport>,
    seconds: f64,
    notes: &'a [String],
}

#[derive(Clone, Copy, Serialize)]
struct FrameReport {
    frame: FrameNumber,
    skipped: bool,
    seconds: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    auto: Option<Achieved>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mean_error: Option<f64>,
}

impl Dataset {
    /// `arguments` are those of the program, the first of which is its name.
    pub(super) fn run(&self, arguments: &[OsString]) -> anyhow::Result<()> {
        let given = replay::given(arguments)?;
        let Some(path) = &self.replay else {
            let Some(scene) = &self.scene else { bail!("the scene is missing") };
            let unsaid = if self.reference.is_none() { self.blur.without_lattice() } else { Vec::new() };
            let recorded = Recorded::new(scene, [given, unsaid].concat());
            return self.make(&recorded.choices()?, scene, &recorded);
        };
        if let Some(option) = given.first() {
            bail!("--replay takes all choices from its file: leave {option} out");
        }
        let recorded = replay::read(path)?;
        let choices = recorded.choices().with_context(|| format!("cannot replay {}", path.display()))?;
        let scene = self.scene.clone().unwrap_or_else(|| PathBuf::from(&recorded.scene));
        self.make(&choices, &scene, &recorded)
    }

    /// Makes what `choices` say; the rest is as `self` says.
    fn make(&self, choices: &Self, path: &Path, recorded: &Recorded) -> anyhow::Result<()> {
        let start = Instant::now();
        let pool = self.running.pool()?;
        let mut recipe = choices.recipe()?;
        let wanted = match recipe.by {
            By::Splatting(_) => recorded.backend(self.place.backend),
            By::Tracing(_) => Wanted::Cpu,
        };
        let mut renderer = Renderer::open(self.place.device_of(wanted)?)?;
        let backend = renderer.backend_name();
        if let By::Splatting(options) = &mut recipe.by {
            options.memory = self.splatting.limit.memory(backend, self.running.quiet);
        }
        let LoadedScene { scene, notes, .. } =
            self.running.load(path, &choices.overrides, &ModelAlone::default(), &pool)?;
        if let Format::Png { alpha, .. } = &mut recipe.format {
            *alpha = scene.image.transparent;
        }
        if recipe.noise.is_any() && scene.image.transparent {
            bail!("--noise is that of a sensor, which sees no transparent background; take --background");
        }
        let frames = frames_of(choices.frames.as_ref(), &scene)?;
        recipe.held_out = choices.held_out(frames.all())?;
        let settings = settings(&scene, path, &recipe, backend)?;
        let origin = recorded.origin(&settings, backend, &recipe)?;
        let seed = choices.sampling.seed;
        let transforms = dataset::transforms(&scene, frames.all(), &recipe, seed, &origin)?;

        let directory = self.out.clone().unwrap_or_else(|| Path::new("out").join(format!("{}.dataset", scene.name)));
        open_directory(&directory)?;
        let list = directory.join(TRANSFORMS);
        if files::read(&list, u64::MAX).is_ok_and(|found| found != transforms.as_bytes()) {
            // It says that all frames are there, as it has them.
            fs::remove_file(&list).with_context(|| format!("cannot remove {}", list.display()))?;
        }
        if !self.running.quiet {
            let place = renderer.describe_with(pool.current_num_threads());
            say(&headline(&scene, &frames, &recipe, &place));
        }
        let gate = Arc::new(Mutex::new(()));
        stop_on_interrupt(&gate, &directory, "--resume", self.running.quiet)?;
        let meter = Arc::new(Meter::default());
        renderer.watch(Arc::clone(&meter));
        let progress = Rendering::new(frames.count(), meter, true, self.running.quiet, &self.progress);
        let output = Output { scene: &scene, recipe: &recipe, seed, settings: &settings, directory: &directory };
        let mut reports = Vec::new();
        for &frame in frames.all() {
            let report = if self.resume && output.is_done(frame)? {
                FrameReport { frame, skipped: true, seconds: 0.0, auto: None, mean_error: None }
            } else {
                let made = pool.install(|| output.frame(&mut renderer, &gate, frame));
                made.with_context(|| format!("frame {frame}"))?
            };
            progress.finished(frame, (!report.skipped).then_some(report.seconds));
            reports.push(report);
        }
        drop(progress);
        output.conclude(&gate, frames.all(), &transforms)?;
        let seconds = start.elapsed().as_secs_f64();
        if self.json {
            let (scene, directory, transforms) = (&*scene.name, &*directory, &*list);
            let (program, notes) = (PROGRAM, &*notes);
            let report = Report { program, scene, directory, transforms, backend, frames: reports, seconds, notes };
            return print_json(&report);
        }
        if self.running.quiet { Ok(()) } else { conclude(&reports, &list, seconds) }
    }

    fn recipe(&self) -> anyhow::Result<Recipe> {
        let format = match (&*self.format, self.bits.as_deref()) {
            ("exr", Some("8")) => bail!("--bits 8 is for --format png: EXR has 16 or 32 bits"),
            ("exr", _) if self.response.is_some() => bail!("--response is for --format png: EXR is linear"),
            ("exr", bits) => {
                let precision = if bits == Some("16") { Precision::Half } else { Precision::Float };
                Format::Exr(Exr { precision, ..Exr::default() })
            }
            (_, Some("32")) => bail!("--bits 32 is for --format exr: PNG has 8 or 16 bits"),
            (_, bits) => {
                let bits = if bits == Some("16") { Bits::Sixteen } else { Bits::Eight };
                Format::Png { bits, alpha: false }
            }
        };
        if self.exact && self.sharp < 2 {
            bail!("--exact is the mean of several sharp pictures: take --sharp 2 or more");
        }
        Ok(Recipe {
            layout: self.layout,
            sharp: self.sharp,
            by: self.by()?,
            format,
            response: self.response.unwrap_or_default(),
            noise: self.noise,
            flow: !self.no_flow,
            shake: self.shake,
            exact: self.exact,
            held_out: None,
        })
    }

    /// The views that are held out.
    fn held_out(&self, frames: &[FrameNumber]) -> anyhow::Result<Option<HeldOut>> {
        let by_layout = (self.layout == FolderLayout::DeblurNerf).then_some(HOLD);
        let Some(every) = self.hold.or(by_layout) else { return Ok(None) };
        if self.layout == FolderLayout::Gopro {
            bail!("--hold is not for --layout gopro, which has a directory for training and one for tests");
        }
        let held_out = HeldOut::every(every, frames);
        if held_out.count() == frames.len() {
            bail!("--hold {every} leaves no view for training: there is only one frame");
        }
        Ok(Some(held_out))
    }

    fn by(&self) -> anyhow::Result<By> {
        if let Some(samples) = self.reference {
            return Ok(By::Tracing(ReferenceOptions {
                samples,
                look: self.surfaces.look(&self.sampling, Vec::new()),
                ..ReferenceOptions::default()
            }));
        }
        let options = self.blur.options(&self.surfaces, &self.sampling, &self.splatting, Vec::new())?;
        if let Quality::Mode(BlurMode::Still { .. }) = options.quality {
            bail!("--mode still makes no blur");
        }
        Ok(By::Splatting(options))
    }
}

/// The settings of blurred pictures.
fn settings(scene: &Scene, path: &Path, recipe: &Recipe, backend: &str) -> anyhow::Result<Settings> {
    let provenance = Provenance::of(scene, path)?;
    Ok(match &recipe.by {
        By::Splatting(options) => provenance.splatted(options, recipe.format, backend)?,
        By::Tracing(options) => provenance.traced(options, options.samples, recipe.format)?,
    })
}

/// Frames, size, mode, pictures: one line.
fn headline(scene: &Scene, frames: &FrameList, recipe: &Recipe, place: &str) -> String {
    let (by, place) = match &recipe.by {
        By::Splatting(options) => (format!("mode {}", options.quality), place.to_owned()),
        By::Tracing(options) => (format!("{} samples a pixel", options.samples), "the reference".to_owned()),
    };
    let pictures = if recipe.sharp == 1 { "picture" } else { "pictures" };
    let blurred = if recipe.exact { ", blurred by their mean" } else { "" };
    format!(
        "{}: {}, {} x {} pixels, {} sharp {pictures} each{blurred}, {by}, on {place}",
        scene.name,
        frames.in_words(),
        scene.image.width,
        scene.image.height,
        recipe.sharp
    )
}

/// Where the dataset is, and how many pictures a minute it took.
fn conclude(reports: &[FrameReport], list: &Path, seconds: f64) -> anyhow::Result<()> {
    let skipped = reports.iter().filter(|report| report.skipped).count();
    let also = if skipped > 0 { format!(" ({skipped} were there already)") } else { String::new() };
    let word = if reports.len() == 1 { "frame" } else { "frames" };
    print(&format!("{} {word}{also} in {seconds:.1} s: {}\n", reports.len(), list.display()))
}

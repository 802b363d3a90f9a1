//! `splatblur render`: a scene to an image sequence.

pub(super) mod blur;
mod json;
mod legend;
mod movie;
mod nothing;
mod sequence;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use anyhow::Context as _;
use clap::builder::{PossibleValuesParser, TypedValueParser as _};
use clap::{ArgAction, Args, ValueHint};
use splatblur::FrameNumber;
use splatblur::backend::{Achieved, Meter};
use splatblur::files;
use splatblur::film::Aov;
use splatblur::image::{Bits, Format};
use splatblur::movie::{Movie, MovieKind, MovieShape, Rate};
use splatblur::options::{Quality, RenderOptions};
use splatblur::plan::LAYERS;
use splatblur::renderer::{FrameQueue, Renderer};
use splatblur::scene::Scene;
use splatblur::study::provenance::{PROGRAM, Provenance};

use self::blur::Blur;
use self::json::{FrameReport, Report};
use self::legend::LegendArgs;
use self::movie::Sources;
use self::nothing::Nothing;
pub(super) use self::sequence::file_name;
use self::sequence::{Finished, FrameOutput, Rendering};
use super::backend::BackendArgs;
use super::common::{
    Images, MODES, Overrides, Ready, Running, Sampling, Splatting, Surfaces, open_directory, stop_on_interrupt,
    stop_with_a_line,
};
use super::frames::FrameList;
use super::output::{print, print_json, say};
use super::progress;
use super::values;
use super::words::with_flags;

/// Render a scene to an image sequence.
///
/// Reads the scene with all that it names, renders each frame with motion blur, writes DIR/<scene>.<frame, 4
/// digits>.<ext> (frame -5 is <scene>.-0005.png, as ffmpeg counts; frame 1.5 is `<scene>.0001_5000.png`), says where
/// the images are and how to make a movie of them. Files of an earlier run are replaced; each appears whole or not at
/// all, also after Ctrl-C.
#[derive(Debug, Args)]
#[command(after_long_help = format!("\
{MODES}

Examples:
  All frames of the scene, into out/three_objects/:
    splatblur render scenes/three_objects.xml
  Every tenth frame, then all others:
    splatblur render scene.xml --frames 1..100x10,1..100
  A quick look at one frame, without blur:
    splatblur render scene.xml --frames 12 --mode still:4 --size 320x240
  Quickly, with an error that shows where one looks for it:
    splatblur render scene.xml --error draft
  Smooth long trails that fade, as PNG with alpha:
    splatblur render scene.xml --shutter -1,0 --weight ramp --samples 128 --transparent
  A movie and its pictures; a movie alone, with the shutter of a film camera:
    splatblur render scene.xml --movie out/scene.mp4
    splatblur render scene.xml --movie out/scene.gif --no-frames --shutter 180deg
  For compositing: float, linear, premultiplied, with layers; go on after an interruption:
    splatblur render scene.xml --format exr --aov depth,normal,velocity --resume

JSON (--json), one object: program, scene, directory, backend, frames: [{{frame, path, skipped, seconds (wall,
rendering), samples, surfels, splats, left_out (pixels with too many layers of see-through surfels), detail (error by
surfels that stand for finer ones), auto (error, way, samples, most_samples, interleave, blocks, refined, capped),
cpu_seconds or device_seconds: {{project, sort, bin, visibility, attribute, composite, resolve, total}}, gpu (on
a GPU alone; calls to it: submissions, waits, maps, dispatches, writes, bind_groups, bytes_up, bytes_down; passes over
lists: chain, walks, fill), waste (CPU alone; pixels within the bounds of splats over those that the splats cover):
{{visibility, attribute, composite}}, each {{bounded, covered, waste}}}}],
load_seconds, seconds (whole run), notes, objects (with --aov object: index to name), movie (its path), ffmpeg (a line
that makes one; null where frames do not follow one another or are not written), settings (as each file carries them,
with `frame`, in its header)."))]
pub(super) struct Render {
    #[command(flatten)]
    images: Images,
    /// Skip frames whose file was made with the same settings and is whole.
    #[arg(long, help_heading = "Output")]
    resume: bool,
    /// Make a movie of the frames, too, at the scene's frame rate: .mp4 (H.264) or .mov (`ProRes` 4444 with straight
    /// alpha), for which ffmpeg must be installed, .y4m (uncompressed) or .gif, for which it need not. With --resume,
    /// pictures that are there already are read back into it. A file of an earlier run is replaced when all frames are
    /// there.
    #[arg(
        long,
        value_name = "FILE",
        value_hint = ValueHint::FilePath,
        value_parser = values::movie(),
        help_heading = "Output"
    )]
    movie: Option<(PathBuf, MovieKind)>,
    /// Make the movie alone, and write no pictures.
    #[arg(long, requires = "movie", conflicts_with = "aov", help_heading = "Output")]
    no_frames: bool,
    #[command(flatten)]
    legend: LegendArgs,

    #[command(flatten)]
    blur: Blur,
    /// A filter on the finished image. along: a 1-2-1 filter along the mean motion, where that is longer than 4
    /// pixels, which evens out the pattern of interleaving.
    #[arg(
        long,
        value_name = "FILTER",
        action = ArgAction::Set,
        value_parser = PossibleValuesParser::new(["none", "along"]).map(|word| word == "along"),
        default_value = "none",
        help_heading = "Blur"
    )]
    reconstruct: bool,
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
    progress: progress::ProgressArgs,
}

impl Render {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        let start = Instant::now();
        self.check_movie()?;
        let mut options = self.options()?;
        let pool = self.running.pool()?;
        // Before the scene, which may take long to load.
        let mut renderer = Renderer::open(self.place.device()?)?;
        let Ready { scene, mut notes, frames, format, display, studio } =
            Ready::new(&self.images, self.movie.is_some(), &self.overrides, &self.running, &pool)?;
        if studio.is_some_and(|studio| studio.ground) && options.look.shadows {
            self.blur.spare(&mut options.quality);
        }
        let load_seconds = start.elapsed().as_secs_f64();
        let backend_name = renderer.backend_name();
        if self.images.json {
            renderer.count_waste();
        }
        options.memory = self.splatting.limit.memory(backend_name, self.running.quiet);
        let legends = self.legend.of(&scene)?;
        let provenance = Provenance::of(&scene, &self.images.scene)?.shown(display).with_legend(!legends.is_empty());
        let settings = provenance.splatted(&options, format, backend_name)?;

        let directory = self.images.out.clone().unwrap_or_else(|| Path::new("out").join(&scene.name));
        let film = self.film(&scene, &frames, format, &mut notes)?;
        if !self.no_frames {
            open_directory(&directory)?;
        }
        if !self.running.quiet {
            let place = renderer.describe_with(pool.current_num_threads());
            say(&headline(&scene, &frames, &options, &place));
        }
        let gate = Arc::new(Mutex::new(()));
        if self.no_frames {
            stop_with_a_line(&gate, "interrupted; there is no movie".to_owned(), self.running.quiet)?;
        } else {
            stop_on_interrupt(&gate, &directory, "--resume", self.running.quiet)?;
        }
        let sequence = FrameOutput {
            frames: &frames,
            directory: &directory,
            stem: &scene.name,
            format,
            display,
            bits: self.shown_bits(format),
            transparent: scene.image.transparent,
            legends: &legends,
            resume: self.resume,
            writes: !self.no_frames,
            gate: &gate,
        };
        let meter = Arc::new(Meter::default());
        renderer.watch(Arc::clone(&meter));
        let several_renderings =
            matches!(options.quality, Quality::Error(_)) || options.look.aovs.contains(&Aov::Object);
        let quiet = self.running.quiet;
        let progress = progress::Rendering::new(frames.count(), meter, several_renderings, quiet, &self.progress);
        let queue = FrameQueue::new(renderer.backend(), &scene, &options)?;
        let mut nothing = Nothing::new(&scene);
        let (finished, film) = sequence.run(
            film,
            |frame| Ok(settings.of_frame(frame)?),
            Rendering { queue, pool: &pool },
            |frame, rendered| nothing.look(frame, rendered),
            |done| progress.finished(done.frame, done.rendered.as_ref().map(|(seconds, _)| *seconds)),
        )?;
        drop(progress);
        if let (Some(mut film), Some((path, _))) = (film, &self.movie) {
            let _held = gate.lock().unwrap_or_else(PoisonError::into_inner);
            film.replace(path).with_context(|| format!("cannot write {}", path.display()))?;
        }
        if let Some(warning) = nothing.warning().filter(|_| finished.iter().all(|done| done.rendered.is_some())) {
            self.tell("warning", warning, &mut notes);
        }
        if let Some(note) = left_out(&finished) {
            self.tell("note", note, &mut notes);
        }

        let movie = Sources {
            directory: &directory,
            stem: &scene.name,
            format,
            frames: &frames,
            rate: scene.frames.rate,
            size: (scene.image.width, scene.image.height),
            transparent: scene.image.transparent,
        };
        let seconds = start.elapsed().as_secs_f64();
        if self.images.json {
            return print_json(&Report {
                program: PROGRAM,
                scene: &scene.name,
                directory: &directory,
                backend: backend_name,
                frames: finished.iter().map(|done| FrameReport::new(done, backend_name)).collect(),
                load_seconds,
                seconds,
                notes: &notes,
                objects: options.look.aovs.contains(&Aov::Object).then(|| names_of_objects(&scene)),
                movie: self.movie.as_ref().map(|(path, _)| &**path),
                ffmpeg: movie.ffmpeg().filter(|_| !self.no_frames),
                settings: &settings,
            });
        }
        if self.running.quiet { Ok(()) } else { print(&self.conclusion(&finished, &movie, seconds)) }
    }

    /// Says a line, and keeps it for the report.
    fn tell(&self, kind: &str, line: String, notes: &mut Vec<String>) {
        if !self.running.quiet {
            say(&format!("{kind}: {line}"));
        }
        notes.push(line);
    }

    /// Begins the movie, if there is to be one, and notes what it cannot hold.
    fn film(
        &self,
        scene: &Scene,
        frames: &FrameList,
        format: Format,
        notes: &mut Vec<String>,
    ) -> anyhow::Result<Option<Movie>> {
        let Some((path, kind)) = &self.movie else { return Ok(None) };
        let movie = begin(path, *kind, frames, scene, self.bits(format))?;
        if scene.image.transparent && !kind.has_alpha() {
            let note = format!("{} has no alpha: what is transparent is black; .mov has", path.display());
            if !self.running.quiet {
                say(&format!("note: {note}"));
            }
            notes.push(note);
        }
        Ok(Some(movie))
    }

    /// Whether there can be a movie, before anything is loaded.
    fn check_movie(&self) -> anyhow::Result<()> {
        let Some((path, kind)) = &self.movie else { return Ok(()) };
        kind.check()?;
        files::check_replaceable(path).with_context(|| format!("cannot write {}", path.display()))
    }

    /// Bits of what a movie is made of: those of the pictures, so that one of pictures that were read back is the same.
    fn bits(&self, format: Format) -> Bits {
        if self.is_of_files() && format.bits() == 8 { Bits::Eight } else { Bits::Sixteen }
    }

    /// Bits with which PNG files show light, else those that the movie keeps: noise of finer codes than these would not
    /// keep gradients from showing steps.
    fn shown_bits(&self, format: Format) -> Bits {
        match (format, &self.movie) {
            (Format::Png { bits, .. }, _) if self.is_of_files() => bits,
            (_, Some((_, MovieKind::Mov))) => Bits::Sixteen,
            _ => Bits::Eight,
        }
    }

    /// Is the movie one of pictures in files?
    fn is_of_files(&self) -> bool {
        !self.no_frames || self.resume
    }

    /// Where the images and the movie are, or how to make one.
    fn conclusion(&self, finished: &[Finished], movie: &Sources<'_>, seconds: f64) -> String {
        let skipped = finished.iter().filter(|f| f.rendered.is_none()).count();
        let also = if skipped > 0 { format!(" ({skipped} were there already)") } else { String::new() };
        let (count, reached) = (finished.len(), reached(finished));
        let movie_line = match &self.movie {
            Some((path, _)) => format!("movie: {}, {} frames a second\n", path.display(), Rate::of(movie.rate)),
            None => movie.ffmpeg().map_or_else(String::new, |line| format!("as a movie: {line}\n")),
        };
        if self.no_frames {
            return format!("{count} frames{also} in {seconds:.1} s\n{reached}{movie_line}");
        }
        let word = if count == 1 { "image" } else { "images" };
        format!("{count} {word}{also} in {seconds:.1} s: {}\n{reached}{movie_line}", movie.files())
    }

    fn options(&self) -> anyhow::Result<RenderOptions> {
        let aovs = self.images.aovs()?;
        let about_error = aovs.contains(&Aov::Error);
        let options = self.blur.options(&self.surfaces, &self.sampling, &self.splatting, aovs)?;
        if about_error && !matches!(options.quality, Quality::Error(_)) {
            anyhow::bail!("--aov error is for --mode auto, which estimates it");
        }
        Ok(RenderOptions { reconstruct: self.reconstruct, ..options })
    }
}

/// Begins a movie of frames.
fn begin(path: &Path, kind: MovieKind, frames: &FrameList, scene: &Scene, bits: Bits) -> anyhow::Result<Movie> {
    if !frames.ascend() {
        anyhow::bail!(
            "--movie needs --frames in ascending order: a movie shows them in the order in which they are made"
        );
    }
    // A link to one; all others were refused before.
    if path.is_dir() {
        anyhow::bail!("--movie names a file, and {} is a directory", path.display());
    }
    let directory = path.parent().filter(|directory| !directory.as_os_str().is_empty());
    open_directory(directory.unwrap_or(Path::new(".")))?;
    let (width, height, rate) = (scene.image.width, scene.image.height, Rate::of(scene.frames.rate));
    Ok(Movie::begin(path, kind, MovieShape { width, height, rate, bits })?)
}

/// Says where more layers of see-through surfels lie one behind the other than are drawn.
fn left_out(finished: &[Finished]) -> Option<String> {
    let left_out = |done: &Finished| done.rendered.as_ref().map_or(0, |(_, stats)| stats.left_out);
    let worst = finished.iter().max_by_key(|done| left_out(done)).filter(|done| left_out(done) > 0)?;
    Some(format!(
        "frame {}: {} pixels, over all instants, have more than {LAYERS} layers of see-through surfels; those behind \
         are left out",
        worst.frame,
        left_out(worst)
    ))
}

/// The names that the indices of the layer `object` stand for.
fn names_of_objects(scene: &Scene) -> BTreeMap<usize, &str> {
    (1..).zip(scene.objects.iter().map(|object| object.name.as_str())).collect()
}

/// Backend, size, mode, frames: one line.
fn headline(scene: &Scene, frames: &FrameList, options: &RenderOptions, place: &str) -> String {
    format!(
        "{}: {}, {} x {} pixels, mode {}, on {place}",
        scene.name,
        frames.in_words(),
        scene.image.width,
        scene.image.height,
        options.quality
    )
}

/// What mode auto reached, in the frame with the largest error if there are several.
fn reached(finished: &[Finished]) -> String {
    let of_frame = |done: &Finished| Some((done.frame, done.rendered?.1.achieved?));
    let all: Vec<(FrameNumber, Achieved)> = finished.iter().filter_map(of_frame).collect();
    let Some((frame, worst)) = all.iter().max_by(|a, b| a.1.error.total_cmp(&b.1.error)) else { return String::new() };
    let place = if all.len() == 1 { String::new() } else { format!(", largest in frame {frame}") };
    with_flags(&format!("estimated{place}: {worst}\n"))
}

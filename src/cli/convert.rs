//! `splatblur convert`: a model of any format to `.bin` or `.ply`, or a glTF file to a scene that plays it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::Args;
use glam::DVec3;
use splatblur::model::{self, LoadedModel, LoadedShape, ModelError};
use splatblur::scene::Pattern;
use splatblur::{files, scene_file};

use super::info::{self, InputKind};
use super::output::{print, say};
use super::progress::Loading;
use super::values;

/// Convert a model to splatblur's own .bin or to .ply.
///
/// Reads any model that a scene may name, estimates what is missing (normals, radii), and writes the result, so that
/// later runs need not estimate again. The ending of OUT decides: .bin loads fastest and keeps the normalisation of
/// overlapping kernels and the levels of detail, .ply opens in other programs. Points keep their order.
///
/// A glTF file and an OUT that has no ending make a folder: scene.xml with one object for each node that has a mesh,
/// moved as the file moves it, and a copy of the file.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  splatblur convert scan.ply scan.bin
  splatblur convert 'scan/*.laz' ground.bin --classes 2 --every 10
  splatblur convert pond.ply pond.bin --radius-scale 2.5
  splatblur convert statue.sfl statue.ply --force
  splatblur convert truck.glb truck
  splatblur convert 'frame.%04d.csv' 'fast.%04d.bin' --kind spheres
  splatblur convert a.csv b.npy c.laz fast/")]
pub(super) struct Convert {
    /// Model: .ply, .sfl, .obj, .xyz, .csv, .txt, .pts, .npy, .npz, .las, .laz, .e57, .bin; capture: .ply, .splat,
    /// .spz, .sog, .glb. Volumes' grids (.nrrd) have no surfels. Several clouds of points are one model: 'scan/*.laz',
    /// in quotes. Files of a sequence: 'frame.%04d.csv', if OUT has a number, too; several files, if OUT is a folder.
    #[arg(value_name = "IN", required = true)]
    inputs: Vec<PathBuf>,
    /// File to write, ending in .bin or .ply; with a number, as in fast.%04d.bin, one for each file of a sequence; of
    /// several files the folder of .bin files; of a glTF file also a folder.
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Factor on all splat radii.
    #[arg(long, value_name = "F", default_value = "1", allow_hyphen_values = true, value_parser = values::radius_scale)]
    radius_scale: f64,
    /// Colour space of the file's colours [default: srgb where they are integers, linear where they are floats].
    #[arg(long, alias = "color-space", value_name = "SPACE", value_parser = values::colour_space())]
    colour_space: Option<model::ColourSpace>,
    /// Cloud of points: take every n-th.
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
    /// LAS: take these classes alone, as 2,6.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    classes: Vec<u8>,
    /// Cloud of points: leave stray points out, those far from all others and those in the air.
    #[arg(long)]
    clean: bool,
    /// Cloud of points: where the scanner stood, in the coordinates of the file; estimated normals face it.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = values::place)]
    scanner_position: Option<DVec3>,
    /// Cloud of points: radius of all, model units, in place of those of the file and of estimates.
    #[arg(long, value_name = "R", allow_hyphen_values = true, value_parser = values::radius)]
    radius: Option<f64>,
    /// Surfels, or spheres in a .bin file, which need no normals [default: surfels].
    #[arg(long, value_name = "KIND", value_parser = values::point_kind())]
    kind: Option<model::Kind>,
    /// Replace OUT if it exists.
    #[arg(long)]
    force: bool,
    /// Say nothing but errors.
    #[arg(long)]
    quiet: bool,
}

impl Convert {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        let [input] = &self.inputs[..] else { return self.all(&self.in_folder()?) };
        if self.output.extension().is_none() && is_gltf(input) {
            return self.play(input);
        }
        if self.output.is_dir() || self.output.as_os_str().to_string_lossy().ends_with('/') {
            return self.all(&self.in_folder()?);
        }
        if let Some(outputs) = Pattern::parse(&self.output.to_string_lossy()) {
            return self.all(&of_sequence(input, &outputs)?);
        }
        self.check(input, &self.output)?;
        self.one(input, &self.output, "")
    }

    /// Several inputs, and their files in a folder.
    fn in_folder(&self) -> anyhow::Result<Vec<Job>> {
        if self.output.exists() && !self.output.is_dir() {
            bail!("several files go into a folder, and {} is a file", self.output.display());
        }
        let mut jobs: Vec<Job> = Vec::new();
        for input in &self.inputs {
            let Some(stem) = input.file_stem().filter(|_| !input.to_string_lossy().contains('*')) else {
                bail!("{} is no file", input.display());
            };
            let mut name = stem.to_owned();
            name.push(".bin");
            let output = self.output.join(name);
            if let Some((other, _)) = jobs.iter().find(|(_, there)| *there == output) {
                bail!("{} and {} would both be {}", other.display(), input.display(), output.display());
            }
            jobs.push((input.clone(), output));
        }
        Ok(jobs)
    }

    /// Does several jobs, after all were checked.
    fn all(&self, jobs: &[Job]) -> anyhow::Result<()> {
        for (input, output) in jobs {
            self.check(input, output)?;
        }
        for (input, output) in jobs {
            if let Some(folder) = output.parent() {
                std::fs::create_dir_all(folder).with_context(|| format!("cannot write into {}", folder.display()))?;
            }
            self.one(input, output, &format!("{}: ", input.display()))?;
        }
        Ok(())
    }

    /// Finds out before anything is read whether a job can be done.
    fn check(&self, input: &Path, output: &Path) -> anyhow::Result<()> {
        binary(output)?;
        let inputs = model::matching(input)?.unwrap_or_else(|| vec![input.to_owned()]);
        if let Some(input) = inputs.iter().find(|input| same_file(input, output)) {
            bail!("{} is both IN and OUT", input.display());
        }
        if !self.force && output.symlink_metadata().is_ok() {
            bail!("{} exists already (--force replaces it)", output.display());
        }
        if info::head(input).is_ok_and(|head| info::kind(&head, input) == InputKind::Scene) {
            bail!("{} is a scene; convert takes a model, such as one that it names", input.display());
        }
        Ok(())
    }

    /// Converts one model. `of`: what notes begin with.
    fn one(&self, input: &Path, output: &Path, of: &str) -> anyhow::Result<()> {
        let binary = binary(output)?;
        // What it writes holds surfels or spheres.
        let kind = self.kind.or(Some(model::Kind::Surfels));
        if !binary && kind == Some(model::Kind::Spheres) {
            bail!("PLY has no spheres: name a .bin file, or give the PLY of surfels `kind=\"spheres\"`");
        }
        let (radius_scale, colour_space) = (self.radius_scale, self.colour_space);
        let classes: BTreeSet<u8> = self.classes.iter().copied().collect();
        let points = model::PointOptions {
            every: self.every,
            classes: classes.into_iter().collect(),
            clean: self.clean,
            scanner: self.scanner_position,
            radius: self.radius,
            colour_by: None,
        };
        let options = model::LoadOptions { kind, radius_scale, colour_space, points, ..model::LoadOptions::default() };
        let progress = Loading::new(self.quiet);
        let loaded = model::load(input, &options, &|what, share| progress.step(what, share));
        drop(progress);
        let (surfels, notes) = match loaded {
            Ok(LoadedModel { shape: LoadedShape::Surfels(surfels, _), notes, .. }) => (surfels, notes),
            Ok(_) | Err(ModelError::NoSurfels { .. }) => {
                let input = input.display();
                bail!("{input} is a grid of a volume; convert writes surfels, and a volume has none")
            }
            Err(other) => return Err(other.into()),
        };
        if !self.quiet {
            for note in &notes {
                say(&format!("note: {of}{note}"));
            }
        }
        let write = if binary { model::write_bin } else { model::write_ply };
        write(output, &surfels)?;
        if self.quiet {
            return Ok(());
        }
        let what = if surfels.spheres { "spheres" } else { "surfels" };
        print(&format!("{} {what}: {}\n", surfels.len(), output.display()))
    }
}

impl Convert {
    /// Makes a folder with a scene that plays a glTF file.
    fn play(&self, input: &Path) -> anyhow::Result<()> {
        let folder = &self.output;
        let inside = |name: &Path| folder.join(name);
        // The copies are those that the scene was made of.
        let (play, copies) = files::steady(|| {
            let play = scene_file::play(input)?;
            // A file that is its own copy stays where it is.
            let others = play.files.iter().filter(|(from, to)| !same_file(from, &inside(to)));
            let bytes =
                |from: &Path| files::read(from, u64::MAX).with_context(|| format!("cannot read {}", from.display()));
            let copies = others.map(|(from, to)| Ok((inside(to), bytes(from)?))).collect::<anyhow::Result<Vec<_>>>()?;
            Ok::<_, anyhow::Error>((play, copies))
        })?;
        let scene = inside(Path::new("scene.xml"));
        let others = play.files.iter().map(|(_, to)| inside(to)).chain([scene.clone()]);
        if let Some(there) = others.into_iter().find(|to| to.symlink_metadata().is_ok() && !self.force) {
            bail!("{} exists already (--force replaces it)", there.display());
        }
        for (to, bytes) in &copies {
            let written = to.parent().map_or(Ok(()), std::fs::create_dir_all).and_then(|()| files::replace(to, bytes));
            written.with_context(|| format!("cannot write {}", to.display()))?;
        }
        let written = std::fs::create_dir_all(folder).and_then(|()| files::replace(&scene, play.xml.as_bytes()));
        written.with_context(|| format!("cannot write {}", scene.display()))?;
        if self.quiet {
            return Ok(());
        }
        play.notes.iter().for_each(|note| say(&format!("note: {note}")));
        print(&format!("{} objects: {}\n", play.objects, scene.display()))
    }
}

/// A file to read, and the one to write.
type Job = (PathBuf, PathBuf);

/// The files of a sequence that there are, and those to write.
fn of_sequence(input: &Path, outputs: &Pattern) -> anyhow::Result<Vec<Job>> {
    let Some(inputs) = Pattern::parse(&input.to_string_lossy()) else {
        bail!("{outputs} has a number, and {} has none, as in frame.%04d.ply", input.display());
    };
    let numbers = inputs.existing().with_context(|| format!("cannot read the folder of {inputs}"))?;
    if numbers.is_empty() {
        bail!("there is no file {inputs}");
    }
    Ok(numbers.into_iter().map(|number| (inputs.path(number), outputs.path(number))).collect())
}

/// True for a glTF file by its first bytes.
fn is_gltf(path: &Path) -> bool {
    let named = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gltf"));
    named || info::head(path).is_ok_and(|head| head.starts_with(b"glTF"))
}

/// True for `.bin`, false for `.ply`.
pub(super) fn binary(path: &Path) -> anyhow::Result<bool> {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    match ending.to_str() {
        Some("bin") => Ok(true),
        Some("ply") => Ok(false),
        _ => bail!("{} must end in .bin or .ply", path.display()),
    }
}

pub(super) fn same_file(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}

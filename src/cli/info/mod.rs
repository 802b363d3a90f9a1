//! `splatblur info`: reads any file that the program reads, whole, and reports what `render` would see.

mod describe;

use std::io::Read as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::Args;
use splatblur::model::{ModelError, ModelFormat, mesh};
use splatblur::{anim, files, image, model, scene_file};

use super::output::{self, print, print_json};
use super::progress::Loading;
use super::{adapters, values};

/// Report what a file holds: a scene, a model, an animation, or a rendered image.
///
/// Reads the file whole, with all that it names, and refuses what `render` would refuse. Scenes: every resolved value,
/// or canonical XML that loads back to the same scene. Models: counts, bounds, radii, properties. Animations: nodes,
/// attributes, range, or the evaluated channels. glTF files: triangles, nodes, and their animations. Images: size,
/// layers, and the settings that made them.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  splatblur info scenes/three_objects.xml
  splatblur info scenes/three_objects.xml --xml > resolved.xml
  splatblur info bunny.ply --json
  splatblur info thrown.anim --frames -5..40 --step 0.5 --csv
  splatblur info out/spin/spin.0001.exr
  splatblur info --adapters")]
#[allow(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
pub(super) struct Info {
    /// Scene (.xml), model (.ply, .sfl, .obj, .glb, .gltf, .xyz, .pts, .bin), scan (.las, .laz, .e57: the header
    /// alone), capture (.ply, .splat, .spz, .sog, .glb), volume (.nrrd, .ply), animation (.anim) or image (.png, .exr);
    /// told apart by content.
    #[arg(required_unless_present = "adapters")]
    file: Option<PathBuf>,

    /// List the graphics adapters that `render --backend gpu` can use, with their limits.
    #[arg(long, conflicts_with = "file")]
    adapters: bool,
    /// Print one JSON object.
    #[arg(long, conflicts_with_all = ["xml", "csv"])]
    json: bool,
    /// Scene: print it as canonical XML, with every default filled in. Paths are those from the folder of the file that
    /// it is sent to (`> copy.xml`), else from the working directory.
    #[arg(long, conflicts_with = "csv")]
    xml: bool,
    /// Animation: print the evaluated channels, one line a frame.
    #[arg(long)]
    csv: bool,
    /// Frames of --csv, inclusive, not necessarily whole [default: the animation's range].
    #[arg(long, value_name = "A..B", requires = "csv", allow_hyphen_values = true, value_parser = values::times)]
    frames: Option<(f64, f64)>,
    /// Distance of the frames of --csv.
    #[arg(
        long,
        value_name = "S",
        requires = "csv",
        default_value = "1",
        allow_hyphen_values = true,
        value_parser = values::positive
    )]
    step: f64,
    /// Model: factor on all splat radii.
    #[arg(long, value_name = "F", default_value = "1", allow_hyphen_values = true, value_parser = values::radius_scale)]
    radius_scale: f64,
    /// Model: colour space of the file's colours [default: srgb where they are integers, linear where they are floats].
    #[arg(long, alias = "color-space", value_name = "SPACE", value_parser = values::colour_space())]
    colour_space: Option<model::ColourSpace>,
    /// Scene: report unknown words instead of refusing them.
    #[arg(long)]
    lenient: bool,
    /// Scene: refuse paths outside DIR.
    #[arg(long, value_name = "DIR")]
    restrict: Option<PathBuf>,
}

/// Most lines of `--csv`.
const MAX_LINES: f64 = 1e7;

/// What a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InputKind {
    Scene,
    Animation,
    Image,
    Model,
}

impl Info {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        let Some(file) = self.file.as_deref() else { return adapters::list(self.json) };
        let head = head(file).with_context(|| format!("cannot read {}", file.display()))?;
        let kind = kind(&head, file);
        if self.xml && kind != InputKind::Scene {
            bail!("--xml is for scenes; {} is none", file.display());
        }
        if self.csv && kind != InputKind::Animation {
            bail!("--csv is for animations; {} is none", file.display());
        }
        match kind {
            InputKind::Scene => self.scene(file),
            InputKind::Animation => self.animation(file),
            InputKind::Image => self.image(file),
            InputKind::Model => self.model(file),
        }
    }

    fn scene(&self, file: &Path) -> anyhow::Result<()> {
        let progress = Loading::new(false);
        let step = |what: &str, share: f32| progress.step(what, share);
        let restrict = self.restrict.as_deref();
        let loaded = scene_file::load(
            file,
            &scene_file::SceneLoadOptions {
                lenient: self.lenient,
                restrict,
                progress: Some(&step),
                ..scene_file::SceneLoadOptions::default()
            },
        )?;
        drop(progress);
        if self.xml {
            return print(&scene_file::to_xml(&loaded.scene, &output::folder()));
        }
        self.show(&describe::scene(&loaded))
    }

    fn animation(&self, file: &Path) -> anyhow::Result<()> {
        let animation = anim::load(file)?;
        if !self.csv {
            return self.show(&describe::animation(&animation));
        }
        let (first, last) = self.frames.unwrap_or_else(|| describe::frame_range(&animation));
        if (last - first) / self.step > MAX_LINES {
            bail!("frames {first}..{last} in steps of {} are more than {MAX_LINES} lines", self.step);
        }
        // A millionth of a step forgives decimal steps that do not add up exactly.
        let rows = ((last - first) / self.step + 1e-6).floor() as u64;
        let frames = (0..=rows).map(|i| first + i as f64 * self.step);
        print(&animation.csv(frames, anim::Interpolation::Maya))
    }

    fn image(&self, file: &Path) -> anyhow::Result<()> {
        let (picture, settings) =
            files::steady(|| Ok::<_, anyhow::Error>((image::read(file)?, image::read_settings(file))))?;
        self.show(&describe::image(&picture, settings))
    }

    fn model(&self, file: &Path) -> anyhow::Result<()> {
        if let Some(report) = scans(file)? {
            return self.show(&report);
        }
        if let Some(report) = meshes(file)? {
            return self.show(&report);
        }
        let progress = Loading::new(false);
        let (radius_scale, colour_space) = (self.radius_scale, self.colour_space);
        let options = model::LoadOptions { radius_scale, colour_space, ..model::LoadOptions::default() };
        let loaded = model::load(file, &options, &|what, share| progress.step(what, share))?;
        drop(progress);
        self.show(&describe::model_file(&loaded))
    }

    fn show(&self, report: &serde_json::Value) -> anyhow::Result<()> {
        if self.json { print_json(report) } else { print(&describe::text(report)) }
    }
}

/// What the headers of files of laser scanners say, one or several; `None` for all other files.
#[cfg(feature = "formats")]
fn scans(file: &Path) -> anyhow::Result<Option<serde_json::Value>> {
    let files = model::matching(file)?.unwrap_or_else(|| vec![file.to_owned()]);
    let facts: Result<Option<Vec<_>>, _> = files.iter().map(|file| model::scan_facts(file)).collect();
    Ok(facts?.map(|facts| describe::scans(&files, &facts)))
}

/// No such file is read.
#[cfg(not(feature = "formats"))]
fn scans(_: &Path) -> anyhow::Result<Option<serde_json::Value>> {
    Ok(None)
}

/// What a glTF file with triangles holds; `None` for all other files.
fn meshes(file: &Path) -> anyhow::Result<Option<serde_json::Value>> {
    if model::matching(file)?.is_some() {
        return Ok(None);
    }
    // Files whose first bytes show another format are read once, by their loader: they may be large.
    let start = head(file).with_context(|| format!("cannot read {}", file.display()))?;
    if let Some(ModelFormat::Bin | ModelFormat::Ply | ModelFormat::Sfl | ModelFormat::Spz | ModelFormat::Sog) =
        ModelFormat::detect(&start, file)
    {
        return Ok(None);
    }
    files::steady(|| {
        let bytes = files::read(file, u64::MAX).with_context(|| format!("cannot read {}", file.display()))?;
        let Some(format @ (ModelFormat::Glb | ModelFormat::Gltf)) = ModelFormat::detect(&bytes, file) else {
            return Ok(None);
        };
        let invalid = |why| ModelError::Invalid { path: file.to_owned(), why };
        let Some(mesh) = mesh::read(&bytes, format, file, None).map_err(invalid)? else { return Ok(None) };
        let nodes = mesh::nodes(&bytes, file).map_err(invalid)?;
        Ok(Some(describe::mesh(&mesh, &nodes)))
    })
}

/// The first bytes of a regular file, or of the first of several.
pub(super) fn head(path: &Path) -> anyhow::Result<Vec<u8>> {
    if let Some([first, ..]) = model::matching(path)?.as_deref() {
        return head(first);
    }
    files::steady(|| {
        let mut head = Vec::new();
        files::open(path)?.take(512).read_to_end(&mut head)?;
        Ok(head)
    })
}

/// By content, then by the ending; whatever else is taken for a model, whose loader knows several formats.
pub(super) fn kind(head: &[u8], path: &Path) -> InputKind {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let utf16_xml = head.starts_with(b"\xff\xfe<\0") || head.starts_with(b"\xfe\xff\0<");
    if text.starts_with(b"<") || utf16_xml {
        InputKind::Scene
    } else if text.starts_with(b"animVersion") {
        InputKind::Animation
    } else if head.starts_with(b"\x89PNG") || head.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        InputKind::Image
    } else if text.starts_with(b"ply") {
        InputKind::Model
    } else {
        match path.extension().unwrap_or_default().to_ascii_lowercase().to_str() {
            Some("xml") => InputKind::Scene,
            Some("anim") => InputKind::Animation,
            Some("png" | "exr") => InputKind::Image,
            _ => InputKind::Model,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds() {
        let kind = |head: &[u8], name: &str| kind(head, Path::new(name));
        assert_eq!(kind(b"<?xml", "a.anim"), InputKind::Scene);
        assert_eq!(kind(b"\xef\xbb\xbf\r\n <scene>", "a"), InputKind::Scene);
        assert_eq!(kind(b"\nanimVersion 1.1;", "a.txt"), InputKind::Animation);
        assert_eq!(kind(b"// a comment", "a.ANIM"), InputKind::Animation);
        assert_eq!(kind(b"\x89PNG\r\n", "a.ply"), InputKind::Image);
        assert_eq!(kind(b"ply\n", "a.xml"), InputKind::Model);
        assert_eq!(kind(b"", "a.xml"), InputKind::Scene);
        assert_eq!(kind(b"v 0 0 0", "a.obj"), InputKind::Model);
        assert_eq!(kind(b"0 0 0\n", "a.xyz"), InputKind::Model);
    }
}

//! `splatblur sheet`: one frame in several modes, side by side in one labelled image.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::Args;
use splatblur::FrameNumber;
use splatblur::files;
use splatblur::film::Picture;
use splatblur::image::{Bits, Display};
use splatblur::study::sheet::{self, Crop, Layout};
use splatblur::study::{self, Entry, LineUp, Part, Shots};

use super::common::open_directory;
use super::frames;
use super::output::{print, say};
use super::progress::Steps;
use super::studio::{DisplayArgs, StudioArgs};
use super::study::{Common, MODES, ReadyScene};
use super::values;

/// Show one frame in several modes, side by side in one labelled image.
///
/// Each panel has the mode, its samples, the seconds that it took (wall time, after one rendering of the mode to warm
/// up), the picture and an enlarged crop, the same for all: where the modes differ most, unless --crop says where. With
/// --reference the ray-traced reference comes first, and each panel states its error against it.
#[derive(Debug, Args)]
#[command(after_long_help = format!("{}

Examples:
  Two modes and the reference:
    splatblur sheet scenes/spin.xml --frame 12 --modes supersample:8,bucket:8x4 --reference 256 --out sheet.png
  The same place at every size, and a flip-through for the browser:
    splatblur sheet scene.xml --frame 3 --modes still,supersample:4,supersample:4+interleave=2 --crop 200,120,64x48 \\
      --out sheet.png --flip flip.png

Errors: FLIP at 67.02 pixels per degree, RMSE in linear light (see `splatblur help compare`).", *MODES))]
pub(super) struct Sheet {
    /// Scene file (XML), or a model file, as in `splatblur render`.
    scene: PathBuf,

    /// Frame to show.
    #[arg(long, value_name = "F", allow_hyphen_values = true, value_parser = frames::frame, help_heading = "Sheet")]
    frame: FrameNumber,
    /// Modes, several with commas.
    #[arg(long, value_name = "MODES", value_parser = study::entries, help_heading = "Sheet")]
    modes: EntryList,
    /// Image to write (PNG).
    #[arg(long, value_name = "FILE.png", value_parser = png, help_heading = "Sheet")]
    out: PathBuf,
    /// Also write an animated PNG that shows the modes in turn, in one place, at full size.
    #[arg(long, value_name = "FILE.png", value_parser = png, help_heading = "Sheet")]
    flip: Option<PathBuf>,
    /// Compare with a reference of so many samples a pixel (a multiple of 16).
    #[arg(long, value_name = "SPP", value_parser = study::reference_samples, help_heading = "Sheet")]
    reference: Option<u64>,
    /// The part to enlarge: place and size, or a size for the place where modes differ most [default: 60x45].
    #[arg(long, value_name = "X,Y,WxH", value_parser = crop, help_heading = "Sheet")]
    crop: Option<Part>,
    /// Greatest width of a panel in pixels; wider pictures are shrunk.
    #[arg(
        long,
        value_name = "PIXELS",
        default_value_t = 480,
        value_parser = clap::value_parser!(u32).range(32..=8192),
        help_heading = "Sheet"
    )]
    panel: u32,
    /// Most panels in a row.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 4,
        value_parser = clap::value_parser!(u32).range(1..=64),
        help_heading = "Sheet"
    )]
    columns: u32,

    #[command(flatten)]
    alone: StudioArgs,
    #[command(flatten)]
    display: DisplayArgs,
    #[command(flatten)]
    common: Common,
}

/// For clap, which takes a bare vector for a repeated option.
type EntryList = std::vec::Vec<Entry>;

fn crop(text: &str) -> Result<Part, String> {
    let expected = || "expected X,Y,WxH or WxH, as in 200,120,64x48".to_owned();
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let number = |part: &str| part.parse::<u32>().map_err(|_| expected());
    match parts[..] {
        [size] => values::size(size).map(|(width, height)| Part::MostDifferent(width, height)).map_err(|_| expected()),
        [x, y, size] => {
            let (width, height) = values::size(size).map_err(|_| expected())?;
            Ok(Part::Here(Crop { x: number(x)?, y: number(y)?, width, height }))
        }
        _ => Err(expected()),
    }
}

/// The path of a PNG file to write.
fn png(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let is_png = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
    if is_png { Ok(path) } else { Err("expected the name of a PNG file, as in sheet.png".to_owned()) }
}

impl Sheet {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        if self.flip.as_ref() == Some(&self.out) {
            bail!("--flip and --out name the same file");
        }
        // Found out now, not after rendering.
        for path in [Some(&self.out), self.flip.as_ref()].into_iter().flatten() {
            open_directory(path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")))?;
        }
        let alone = self.alone.of(self.common.overrides.background, false)?;
        let ReadyScene { mut trial, pool, display, .. } = self.common.load(&self.scene, &alone)?;
        let part = self.crop.unwrap_or(Part::MostDifferent(60, 45));
        let line_up = LineUp { frame: self.frame, entries: self.modes.clone(), reference: self.reference, part };
        line_up.check(&trial).context("--crop")?;
        let progress = Steps::new(line_up.steps(&trial), self.common.quiet());
        let shots = pool.install(|| line_up.run(&mut trial, &|at| progress.tell(at)))?;
        drop(progress);
        let scene = trial.scene();
        let heading = format!(
            "{}, frame {}, {} x {}, shutter {} to {} frames, weight {}, crop {}",
            scene.name,
            self.frame,
            scene.image.width,
            scene.image.height,
            scene.shutter.open,
            scene.shutter.close,
            scene.shutter.weight,
            shots.crop
        );
        let display = self.display.or(display, scene)?;
        pool.install(|| self.show(&line_up, &shots, &heading, display))
    }

    /// Writes the images, and says what the panels say.
    fn show(&self, line_up: &LineUp, shots: &Shots, heading: &str, display: Display) -> anyhow::Result<()> {
        // Errors are those of the light; the pictures are as they are shown.
        let mut panels = line_up.panels(shots)?;
        let shown: Vec<Picture> =
            panels.iter().map(|panel| display.shown(panel.picture.clone(), Bits::Eight, false)).collect();
        for (panel, shown) in panels.iter_mut().zip(&shown) {
            panel.picture = shown;
        }
        let layout = Layout { panel: self.panel, columns: self.columns };
        write(&self.out, &sheet::sheet(heading, &panels, shots.crop, layout)?.png()?)?;
        if let Some(path) = &self.flip {
            write(path, &sheet::animation(&sheet::flip_through(&panels)?, 1000)?)?;
        }
        if self.common.quiet() {
            return Ok(());
        }
        for panel in &panels {
            say(&format!("{}: {}", panel.title, panel.lines.join("; ")));
        }
        let flip = self.flip.as_ref().map_or_else(String::new, |path| format!("{}\n", path.display()));
        print(&format!("{}\n{flip}", self.out.display()))
    }
}

fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    files::replace(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_and_frames_are_read() {
        assert_eq!(crop("200,120,64x48"), Ok(Part::Here(Crop { x: 200, y: 120, width: 64, height: 48 })));
        assert_eq!(crop("64x48"), Ok(Part::MostDifferent(64, 48)));
        for text in ["", "1,2", "1,2,3", "-1,2,3x4", "1,2,0x4", "1,2,3x4,5", "99999999999,0,1x1"] {
            assert!(crop(text).unwrap_err().contains("X,Y,WxH"), "{text}");
        }
        assert_eq!((frames::frame("12"), frames::frame("-5.5")), (Ok(12.into()), Ok((-5.5).into())));
        for text in ["", "1..2", "x", "9999999999999"] {
            assert!(frames::frame(text).is_err(), "{text}");
        }
        assert!(png("a.PNG").is_ok() && png("a.gif").is_err() && png("png").is_err());
    }
}

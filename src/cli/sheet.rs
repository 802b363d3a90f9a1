//! `splatblur sheet`: one frame in several modes, side by side in one labelled image.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::Args;
use splatblur::compare::{Comparison, Metric};
use splatblur::files;
use splatblur::study::sheet::{self, Crop, Layout, Panel};

use super::common::open_directory;
use super::grammar;
use super::limits::Shown;
use super::modes::{self, Machine, Method, Mode};
use super::output::{print, say};
use super::progress::Steps;
use super::settings;
use super::trial::{Common, Shot, samples_of};

/// Show one frame in several modes, side by side in one labelled image.
///
/// Each panel has the mode, its samples, the seconds that it took (wall time, after one rendering of the mode to warm up), the picture
/// and an enlarged crop, the same for all: where the modes differ most, unless --crop says where. With --reference the
/// ray-traced reference comes first, and each panel states its error against it.
#[derive(Debug, Args)]
#[command(after_long_help = format!("{}

Examples:
  Two modes and the reference:
    splatblur sheet scenes/spin.xml --frame 12 --modes supersample:8,bucket:8x4 --reference 256 --out sheet.png
  The same place at every size, and a flip-through for the browser:
    splatblur sheet scene.xml --frame 3 --modes still,supersample:4,supersample:4+interleave=2 --crop 200,120,64x48 \\
      --out sheet.png --flip flip.png

Errors: FLIP at 67.02 pixels per degree, RMSE in linear light (see `splatblur help compare`).", modes::HELP))]
pub(super) struct Sheet {
    /// Scene file (XML).
    scene: PathBuf,

    /// Frame to show.
    #[arg(long, value_name = "F", allow_hyphen_values = true, value_parser = frame, help_heading = "Sheet")]
    frame: i64,
    /// Modes, several with commas.
    #[arg(long, value_name = "MODES", value_parser = modes::list, help_heading = "Sheet")]
    modes: ModeList,
    /// Image to write (PNG).
    #[arg(long, value_name = "FILE.png", value_parser = png, help_heading = "Sheet")]
    out: PathBuf,
    /// Also write an animated PNG that shows the modes in turn, in one place, at full size.
    #[arg(long, value_name = "FILE.png", value_parser = png, help_heading = "Sheet")]
    flip: Option<PathBuf>,
    /// Compare with a reference of so many samples a pixel (a multiple of 16).
    #[arg(long, value_name = "SPP", value_parser = modes::reference_samples, help_heading = "Sheet")]
    reference: Option<u64>,
    /// The part to enlarge: place and size, or a size for the place where modes differ most [default: 60x45].
    #[arg(long, value_name = "X,Y,WxH", value_parser = crop, help_heading = "Sheet")]
    crop: Option<Where>,
    /// Greatest width of a panel in pixels; wider pictures are shrunk.
    #[arg(long, value_name = "PIXELS", default_value_t = 480, value_parser = clap::value_parser!(u32).range(32..=8192), help_heading = "Sheet")]
    panel: u32,
    /// Most panels in a row.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64), help_heading = "Sheet")]
    columns: u32,

    #[command(flatten)]
    common: Common,
}

/// For clap, which takes a bare vector for a repeated option.
type ModeList = std::vec::Vec<Mode>;

/// Which part to enlarge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Where {
    Here(Crop),
    Size(u32, u32),
}

/// One frame number.
fn frame(text: &str) -> Result<i64, String> {
    // A range would take a single negative frame only with dots.
    let number = text.trim();
    grammar::frames(&format!("{number}..{number}")).map(|frames| frames.first)
}

fn crop(text: &str) -> Result<Where, String> {
    let expected = || "expected X,Y,WxH or WxH, as in 200,120,64x48".to_owned();
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let number = |part: &str| part.parse::<u32>().map_err(|_| expected());
    match parts[..] {
        [size] => grammar::size(size).map(|(width, height)| Where::Size(width, height)).map_err(|_| expected()),
        [x, y, size] => {
            let (width, height) = grammar::size(size).map_err(|_| expected())?;
            Ok(Where::Here(Crop { x: number(x)?, y: number(y)?, width, height }))
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
        let mut trial = self.common.load(&self.scene)?;
        let (width, height) = (trial.scene.image.width, trial.scene.image.height);
        if let Some(Where::Here(crop)) = self.crop {
            let inside = |at: u32, size: u32, limit: u32| u64::from(at) + u64::from(size) <= u64::from(limit);
            if !inside(crop.x, crop.width, width) || !inside(crop.y, crop.height, height) {
                bail!("--crop: {crop} does not lie in a picture of {width} x {height}");
            }
        }
        // Once to warm up, once measured; references are slow and need no warming.
        let renderings = |mode: &Mode| if matches!(mode.method, Method::Reference(_)) { 1 } else { 2 };
        let steps = u64::from(self.reference.is_some()) + self.modes.iter().map(renderings).sum::<u64>();
        let progress = Steps::new(steps, self.common.quiet);
        let mut step = 0;
        let mut judge = None;
        if let Some(samples) = self.reference {
            judge = Some(trial.judge(samples, self.frame, &|share| progress.at(step, "reference", share))?);
            step += 1;
        }
        let mut shots = Vec::new();
        for mode in &self.modes {
            for turn in 1..=renderings(mode) {
                let share = |share: f32| progress.at(step, &mode.to_string(), share);
                share(0.0);
                let shot = trial
                    .shoot(mode.method, machine(mode), self.frame, &share)
                    .with_context(|| format!("mode {mode}"))?;
                step += 1;
                if turn == renderings(mode) {
                    shots.push(shot);
                }
            }
        }
        drop(progress);

        let crop = match self.crop {
            Some(Where::Here(crop)) => crop,
            other => {
                let (width, height) = if let Some(Where::Size(w, h)) = other { (w, h) } else { (60, 45) };
                // One mode alone differs from the reference only.
                let alone = judge.iter().filter(|_| shots.len() == 1);
                let pictures: Vec<_> = shots.iter().chain(alone).map(|shot| &shot.picture).collect();
                sheet::most_different(&pictures, width, height)?
            }
        };
        let shutter = &trial.scene.shutter;
        let heading = format!(
            "{}, frame {}, {width} x {height}, shutter {} to {} frames, weight {}, crop {crop}",
            trial.scene.name,
            self.frame,
            shutter.open,
            shutter.close,
            settings::weight(&shutter.weight)
        );
        let panels = self.panels(judge.as_ref(), &shots)?;
        let layout = Layout { panel: self.panel, columns: self.columns };
        write(&self.out, &sheet::sheet(&heading, &panels, crop, layout)?.png()?)?;
        if let Some(path) = &self.flip {
            write(path, &sheet::animation(&sheet::flip_through(&panels)?, 1000)?)?;
        }
        if self.common.quiet {
            return Ok(());
        }
        for panel in &panels {
            say(&format!("{}: {}", panel.title, panel.lines.join("; ")));
        }
        let flip = self.flip.as_ref().map_or_else(String::new, |path| format!("{}\n", path.display()));
        print(&format!("{}\n{flip}", self.out.display()))
    }

    /// Pictures with their labels, the reference first.
    fn panels<'a>(&self, judge: Option<&'a Shot>, shots: &'a [Shot]) -> anyhow::Result<Vec<Panel<'a>>> {
        let mut panels = Vec::new();
        let took = |samples: u64, seconds: f64| {
            let plural = if samples == 1 { "" } else { "s" };
            format!("{samples} sample{plural}, {seconds:.3} s")
        };
        if let (Some(shot), Some(samples)) = (judge, self.reference) {
            let lines = vec![took(samples, shot.seconds), "errors are against this".to_owned()];
            panels.push(Panel { title: "reference".to_owned(), lines, picture: &shot.picture });
        }
        for (mode, shot) in self.modes.iter().zip(shots) {
            let mut lines = vec![took(samples_of(mode.method, &shot.picture), shot.seconds)];
            if let Some(judge) = judge {
                let errors = Comparison::new(&shot.picture, &judge.picture, &[Metric::Flip])?;
                let value = |metric| Shown(errors.value(metric).unwrap_or(f64::NAN));
                lines.push(format!("FLIP {:.6}, RMSE {:.6}", value(Metric::Flip), value(Metric::Rmse)));
            }
            panels.push(Panel { title: mode.to_string(), lines, picture: &shot.picture });
        }
        Ok(panels)
    }
}

/// Where a mode that does not say renders.
fn machine(mode: &Mode) -> Machine {
    mode.machine.unwrap_or(Machine::Cpu)
}

fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    files::replace(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_and_frames_are_read() {
        assert_eq!(crop("200,120,64x48"), Ok(Where::Here(Crop { x: 200, y: 120, width: 64, height: 48 })));
        assert_eq!(crop("64x48"), Ok(Where::Size(64, 48)));
        for text in ["", "1,2", "1,2,3", "-1,2,3x4", "1,2,0x4", "1,2,3x4,5", "99999999999,0,1x1"] {
            assert!(crop(text).unwrap_err().contains("X,Y,WxH"), "{text}");
        }
        assert_eq!((frame("12"), frame("-5")), (Ok(12), Ok(-5)));
        for text in ["", "1..2", "x", "9999999999999"] {
            assert!(frame(text).is_err(), "{text}");
        }
        assert!(png("a.PNG").is_ok() && png("a.gif").is_err() && png("png").is_err());
    }
}

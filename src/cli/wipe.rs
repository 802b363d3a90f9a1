//! `splatblur wipe`: two sequences in one movie, on both sides of a border that sweeps.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context as _, bail};
use clap::{Args, ValueHint};
use splatblur::compare::{Pair, pairs};
use splatblur::files;
use splatblur::film::Picture;
use splatblur::image::{self, Bits};
use splatblur::movie::{Movie, MovieKind, MovieShape, Rate, wipe};

use super::common::{open_directory, stop_with_a_line};
use super::output::print;
use super::values;

/// Frames of a loop of two single pictures: two seconds of film.
const OF_ONE: u64 = 48;
/// Most frames of a movie.
const MOST: u64 = 100_000;

/// Show two image sequences in one movie: a border sweeps over them, to the right and back.
///
/// A shows to the left of the border, B to the right. Frames are paired by their numbers, as in `splatblur compare`.
/// The border makes one round in the whole movie, so that a loop has no seam.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  Sharp against blurred, as a GIF:
    splatblur render scene.xml --mode still --out out/still
    splatblur render scene.xml --out out/blurred
    splatblur wipe out/still out/blurred --out wipe.gif
  A short sequence three times in one round of the border:
    splatblur wipe out/still out/blurred --times 3 --out wipe.gif
  Two pictures, 30 frames a second:
    splatblur wipe a.png b.png --rate 30 --out wipe.mp4")]
pub(super) struct Wipe {
    /// To the left of the border: a picture (PNG, EXR), a folder with one numbered sequence, or a pattern, as in
    /// out/a.%04d.png.
    a: PathBuf,
    /// To the right of it: the same, with the same frames.
    b: PathBuf,
    /// Movie to write: .gif, .y4m, or, where ffmpeg is installed, .mp4 or .mov.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, value_parser = values::movie())]
    out: (PathBuf, MovieKind),
    /// Frames a second.
    #[arg(long, value_name = "RATE", default_value = "24", allow_hyphen_values = true, value_parser = values::rate)]
    rate: f64,
    /// How often the sequences play in one round of the border.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    times: u32,
    /// Say nothing but errors.
    #[arg(long)]
    quiet: bool,
}

impl Wipe {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        let (path, kind) = &self.out;
        kind.check()?;
        files::check_replaceable(path).with_context(|| format!("cannot write {}", path.display()))?;
        if path.is_dir() {
            bail!("--out names a file, and {} is a directory", path.display());
        }
        let pairs = pairs(&self.a, &self.b)?;
        let round = if pairs.len() == 1 { OF_ONE } else { pairs.len() as u64 };
        let frames = round * u64::from(self.times);
        if frames > MOST {
            bail!("{frames} frames are too many: a movie has at most {MOST}");
        }
        let first = read(&pairs[0])?;
        let [left, _] = &first;
        let shape = MovieShape { width: left.width, height: left.height, rate: Rate::of(self.rate), bits: Bits::Eight };
        let directory = path.parent().filter(|directory| !directory.as_os_str().is_empty());
        open_directory(directory.unwrap_or(Path::new(".")))?;
        let gate = Arc::new(Mutex::new(()));
        stop_with_a_line(&gate, "interrupted; there is no movie".to_owned(), self.quiet)?;
        let mut movie = Movie::begin(path, *kind, shape)?;
        let mut only = (pairs.len() == 1).then_some(first);
        for frame in 0..frames {
            let pair = &pairs[(frame % pairs.len() as u64) as usize];
            let both = match only.take() {
                Some(both) => both,
                None => read(pair)?,
            };
            let share = wipe::border(frame, frames);
            let [left, right] = &both;
            let wiped = wipe::wiped(left, right, share)
                .with_context(|| format!("cannot join {} and {}", pair.a.display(), pair.b.display()))?;
            movie.push(&wiped).with_context(|| format!("cannot add {}", pair.a.display()))?;
            // One pair is read once.
            only = (pairs.len() == 1).then_some(both);
        }
        let mut file = movie.finish()?;
        let held = gate.lock().unwrap_or_else(PoisonError::into_inner);
        file.replace(path).with_context(|| format!("cannot write {}", path.display()))?;
        drop(held);
        if self.quiet {
            return Ok(());
        }
        print(&format!("{}: {frames} frames, {} a second\n", path.display(), shape.rate))
    }
}

fn read(pair: &Pair) -> anyhow::Result<[Picture; 2]> {
    Ok([image::read(&pair.a)?, image::read(&pair.b)?])
}

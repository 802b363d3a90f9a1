//! `splatblur study`: studies with scenes of their own.

use std::path::PathBuf;

use anyhow::Context as _;
use clap::{Args, Subcommand};
use splatblur::files;
use splatblur::renderer::Renderer;
use splatblur::study;

use super::backend::{BackendArgs, in_full};
use super::common::open_directory;
use super::memory;
use super::output::{print, say};
use super::values;

/// Make the pictures and numbers of a paper again.
#[derive(Debug, Args)]
pub(super) struct Study {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    Thesis(Thesis),
}

/// Wolf (2008): figures 3.1, 5.1, 5.2 and 5.3, and the fifteen cells of table 5.1 beside the thesis' own; and the
/// prefilters beside each other: figures 4.9 and 4.10, figure 11 of Ren et al. (2002), and figure 13 of Zwicker et al.
/// (2002).
///
/// Writes a picture for each figure and DIR/thesis.md, and prints the tables. The models are made by formula; they have
/// as many surfels as the thesis' own, which are not public, and move as its captions say. Takes a few minutes on two
/// cores.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  splatblur study thesis --out out/thesis
  splatblur study thesis --out out/thesis --backend gpu --size 800x600
  splatblur study thesis --out out/quick --fewer 20 --repeats 1 --size 200x150")]
struct Thesis {
    /// Directory of the pictures and tables; made if missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Image size in pixels, at least 64x48, at most 4096x4096.
    #[arg(long, value_name = "WxH", default_value = "400x300", allow_hyphen_values = true, value_parser = size)]
    size: (u32, u32),
    /// Timed renderings of each cell of table 5.1, after one that is not timed; the least counts.
    #[arg(long, value_name = "R", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Models with one of so many of the thesis' surfels, for a quick look.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    fewer: u32,
    #[command(flatten)]
    place: BackendArgs,
    /// Say nothing but errors.
    #[arg(long, short)]
    quiet: bool,
}

/// The size of an image that a sheet can show.
fn size(text: &str) -> Result<(u32, u32), String> {
    let size = values::size(text)?;
    let fits = (64..=4096).contains(&size.0) && (48..=4096).contains(&size.1);
    if fits { Ok(size) } else { Err("expected a size from 64x48 to 4096x4096".to_owned()) }
}

impl Study {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        let What::Thesis(thesis) = &self.what;
        thesis.run()
    }
}

impl Thesis {
    fn run(&self) -> anyhow::Result<()> {
        let mut renderer = Renderer::open(self.place.device()?)?;
        open_directory(&self.out)?;
        let place = in_full(&renderer, rayon::current_num_threads());
        let tell = |what: &str| {
            if !self.quiet {
                say(what);
            }
        };
        tell(&place);
        let thesis = study::Thesis {
            size: [self.size.0, self.size.1],
            repeats: self.repeats,
            fewer: self.fewer,
            memory: memory::budget(None, renderer.backend_name() == "gpu", self.quiet),
        };
        let tables = thesis.run(&mut renderer, &self.out, &tell)?;
        let fewer = if self.fewer == 1 { String::new() } else { format!(", 1 of {} surfels", self.fewer) };
        let text = format!("{place}, {} x {}{fewer}\n{tables}", self.size.0, self.size.1);
        let path = self.out.join("thesis.md");
        files::replace(&path, text.as_bytes()).with_context(|| format!("cannot write {}", path.display()))?;
        if self.quiet { Ok(()) } else { print(&text) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_bounded() {
        assert_eq!(size("64x48"), Ok((64, 48)));
        for text in ["63x48", "64x47", "4097x100", "100x4097"] {
            assert!(size(text).unwrap_err().contains("from 64x48 to 4096x4096"), "{text}");
        }
    }
}

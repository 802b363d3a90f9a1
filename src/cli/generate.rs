//! `splatblur generate`: models made by formula.

use std::io::{BufWriter, Write as _};
use std::path::PathBuf;

use anyhow::{Context as _, bail};
use clap::{Args, ValueEnum};
use splatblur::files;
use splatblur::model::{Cloud, generate};

use super::memory;
use super::output::print;

/// Generate one of the demo scenes' models, or a sphere of any number of surfels, as binary .ply.
///
/// The same model is the same file, byte for byte, on every computer.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  splatblur generate ball ball.ply
  splatblur generate sphere sphere.ply --surfels 1000000")]
pub(super) struct Generate {
    /// What to generate.
    #[arg(value_enum)]
    model: Model,
    /// File to write, ending in .ply.
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Number of surfels of a sphere [default: 100000].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    surfels: Option<u32>,
    /// Replace OUT if it exists.
    #[arg(long)]
    force: bool,
}

/// Memory of a surfel while a model is made: position, normal, radius and colour, and some room for the rest.
const BYTES: u64 = 56;

/// The models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Model {
    /// Ball of radius 0.5, cream and red cells
    Ball,
    /// Square of side 8 with 32 x 32 cells
    #[value(name = "checker_plane")]
    CheckerPlane,
    /// Square of side 14 in quiet greys
    Floor,
    /// Seven upright slats
    Fence,
    /// Unit sphere of --surfels surfels
    Sphere,
}

impl Generate {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        if !self.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ply")) {
            bail!("{} must end in .ply", self.output.display());
        }
        if self.surfels.is_some() && self.model != Model::Sphere {
            bail!("--surfels is for `sphere` only: the other models have fixed numbers");
        }
        if !self.force && self.output.symlink_metadata().is_ok() {
            bail!("{} exists already (--force replaces it)", self.output.display());
        }
        let needed = BYTES * u64::from(self.surfels.unwrap_or_default());
        if let Some(available) = memory::available().filter(|&available| needed > available) {
            let surfels = self.surfels.unwrap_or_default();
            let (needed, available) = (memory::text(needed), memory::text(available));
            bail!("--surfels {surfels} takes {needed} of memory, but there is {available}");
        }
        let cloud = self.cloud();
        files::replace_with(&self.output, |temporary| {
            let mut out = BufWriter::new(std::fs::File::create(temporary)?);
            generate::write(&cloud, &mut out)?;
            out.flush()
        })
        .with_context(|| format!("cannot write {}", self.output.display()))?;
        print(&format!("{} surfels: {}\n", cloud.position.len(), self.output.display()))
    }

    fn cloud(&self) -> Cloud {
        match self.model {
            Model::Ball => generate::ball(),
            Model::CheckerPlane => generate::checker_plane(),
            Model::Floor => generate::floor(),
            Model::Fence => generate::fence(),
            Model::Sphere => generate::sphere(self.surfels.unwrap_or(100_000)),
        }
    }
}

//! `splatblur generate`: models made by formula.

use std::fs::File;
use std::io::{self, BufWriter, Write as _};
use std::path::PathBuf;

use anyhow::{Context as _, bail};
use clap::{Args, ValueEnum};
use splatblur::environment::studio;
use splatblur::files;
use splatblur::film::Picture;
use splatblur::image::{self, Exr, Format, Precision};
use splatblur::model::generate_volume::{self, FieldShape, Storage};
use splatblur::model::{Cloud, generate};

use super::memory;
use super::output::print;

/// Generate one of the demo scenes' models, or a sphere or a hall of any number of surfels, as binary .ply; a volume as
/// .nrrd; or an environment as .exr.
///
/// The same model is the same file, byte for byte, on every computer.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  splatblur generate ball ball.ply
  splatblur generate sphere sphere.ply --surfels 1000000
  splatblur generate volume smoke.nrrd --size 256 --type float")]
pub(super) struct Generate {
    /// What to generate.
    #[arg(value_enum)]
    model: Model,
    /// File to write, ending in .ply; .nrrd for a volume, .exr for the studio.
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Number of surfels of a sphere, about that of a hall [default: 100000].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    surfels: Option<u32>,
    /// Number of the swarm's file, 1 to 5 [default: 1].
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..=5))]
    number: Option<u32>,
    /// Cells of a volume along each axis [default: 128].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    size: Option<u32>,
    /// Shape of a volume [default: torus].
    #[arg(long, value_enum)]
    shape: Option<ShapeWord>,
    /// Type of a volume's values [default: uint8].
    #[arg(long = "type", value_enum)]
    storage: Option<StorageWord>,
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
    /// Hall of --surfels surfels, seen from within
    Hall,
    /// Splash of 20,000 drops with velocities and accelerations
    Splash,
    /// File --number of a swarm, a sequence of five with ids and velocities
    Swarm,
    /// Propeller of three blades that faces +z
    Propeller,
    /// Environment to mirror: sky, windows, a floor of squares
    Studio,
    /// Cube from -1 to 1 of --size cells along each axis
    Volume,
}

/// The shapes of volumes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ShapeWord {
    /// Ring of smoke about y
    Torus,
    /// Ball with a soft edge
    Sphere,
    /// Ball in layers
    Zebra,
}

/// The types of a volume's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum StorageWord {
    /// 0 to 255
    Uint8,
    /// 0 to 1
    Float,
}

impl Generate {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        let is_volume = self.model == Model::Volume;
        let needed = match self.model {
            Model::Volume => "nrrd",
            Model::Studio => "exr",
            _ => "ply",
        };
        if !self.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(needed)) {
            bail!("{} must end in .{needed}", self.output.display());
        }
        if !is_volume && (self.size.is_some() || self.shape.is_some() || self.storage.is_some()) {
            bail!("--size, --shape and --type are for `volume` only");
        }
        if self.surfels.is_some() && !matches!(self.model, Model::Sphere | Model::Hall) {
            bail!("--surfels is for `sphere` and `hall` only: the other models have fixed numbers");
        }
        if self.number.is_some() && self.model != Model::Swarm {
            bail!("--number is for `swarm` only: the other models have one file");
        }
        if !self.force && self.output.symlink_metadata().is_ok() {
            bail!("{} exists already (--force replaces it)", self.output.display());
        }
        if is_volume {
            return self.volume();
        }
        if self.model == Model::Studio {
            return self.studio();
        }
        let needed = BYTES * u64::from(self.surfels.unwrap_or_default());
        if let Some(available) = memory::available().filter(|&available| needed > available) {
            let surfels = self.surfels.unwrap_or_default();
            let (needed, available) = (memory::text(needed), memory::text(available));
            bail!("--surfels {surfels} takes {needed} of memory, but there is {available}");
        }
        let cloud = self.cloud();
        self.write(|out| generate::write(&cloud, out))?;
        print(&format!("{} surfels: {}\n", cloud.position.len(), self.output.display()))
    }

    fn volume(&self) -> anyhow::Result<()> {
        let size = self.size.unwrap_or(128);
        let shape = match self.shape {
            None | Some(ShapeWord::Torus) => FieldShape::Torus,
            Some(ShapeWord::Sphere) => FieldShape::Sphere,
            Some(ShapeWord::Zebra) => FieldShape::Zebra,
        };
        let storage = match self.storage {
            None | Some(StorageWord::Uint8) => Storage::Uint8,
            Some(StorageWord::Float) => Storage::Float,
        };
        self.write(|out| generate_volume::write(shape, size, storage, out))?;
        print(&format!("{size} x {size} x {size} samples: {}\n", self.output.display()))
    }

    fn studio(&self) -> anyhow::Result<()> {
        let map = studio();
        let (width, height) = (map.width(), map.height());
        let rgba = map.pixels().iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
        let picture = Picture { width: width as u32, height: height as u32, rgba, layers: Vec::new() };
        let exr = Exr { precision: Precision::Half, ..Exr::default() };
        image::write(&self.output, &picture, Format::Exr(exr), "")?;
        print(&format!("{width} x {height} pixels: {}\n", self.output.display()))
    }

    fn write(&self, content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> anyhow::Result<()> {
        files::replace_with(&self.output, |temporary| {
            let mut out = BufWriter::new(File::create(temporary)?);
            content(&mut out)?;
            out.flush()
        })
        .with_context(|| format!("cannot write {}", self.output.display()))
    }

    fn cloud(&self) -> Cloud {
        match self.model {
            Model::Ball => generate::ball(),
            Model::CheckerPlane => generate::checker_plane(),
            Model::Floor => generate::floor(),
            Model::Fence => generate::fence(),
            Model::Splash => generate::splash(),
            Model::Swarm => generate::swarm(self.number.unwrap_or(generate::SWARM[0])),
            Model::Propeller => generate::propeller(),
            // These are no clouds, and were written before.
            Model::Volume | Model::Studio => Cloud::default(),
            Model::Sphere => generate::sphere(self.surfels.unwrap_or(100_000)),
            Model::Hall => generate::hall(self.surfels.unwrap_or(100_000)),
        }
    }
}

//! `splatblur sample`: a mesh to surfels.

use std::io::{IsTerminal as _, stderr};
use std::path::PathBuf;
use std::time::Instant;

use anyhow::bail;
use clap::Args;
use serde_json::json;
use splatblur::model::{self, LoadedShape, MeshOptions, Spacing};

use super::convert::{binary, same_file};
use super::output::{print, print_json, say};
use super::progress::Loading;
use super::values;

/// Sample a mesh to surfels, and write them as .bin or .ply.
///
/// Parallel rays along x, y and z stand on a grid; each point where a ray meets a triangle becomes a surfel (a layered
/// depth cube; Pfister et al. 2000): an ellipse, one spacing wide and longer down the slope, so that the surface is
/// covered. A texture is filtered to each surfel. A scene may name a mesh as it is: it is then sampled by itself, as
/// finely as its pixels need. OUT.bin saves that time, and fixes the spacing.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  splatblur sample cube.obj cube.bin
  splatblur sample statue.ply statue.bin --surfels 1000000
  splatblur sample part.ply part.ply.bin --spacing 0.01 --all-rays")]
pub(super) struct Sample {
    /// Mesh: a .ply with faces, an .obj, a .glb or a .gltf.
    #[arg(value_name = "MESH")]
    input: PathBuf,
    /// File to write, ending in .bin or .ply.
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Distance of the rays, model units.
    #[arg(long, value_name = "H", allow_hyphen_values = true, value_parser = values::positive)]
    spacing: Option<f64>,
    /// About how many surfels to make [default: 200000].
    #[arg(long, value_name = "N", conflicts_with = "spacing")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=60_000_000))]
    surfels: Option<u32>,
    #[command(flatten)]
    rays: Rays,
    /// Factor on all splat radii.
    #[arg(long, value_name = "F", default_value = "1", allow_hyphen_values = true, value_parser = values::radius_scale)]
    radius_scale: f64,
    /// Replace OUT if it exists.
    #[arg(long)]
    force: bool,
    /// Print one JSON object.
    #[arg(long, conflicts_with = "quiet")]
    json: bool,
    /// Say nothing but errors.
    #[arg(long)]
    quiet: bool,
}

/// Which rays sample a triangle.
#[derive(Debug, Args)]
struct Rays {
    /// Sample each triangle along the axis that it faces most (the default; 3-to-1 reduction).
    #[arg(long, conflicts_with = "all_rays")]
    reduce: bool,
    /// Sample each triangle along all three axes: up to twice the surfels, and some lie close together.
    #[arg(long = "all-rays", id = "all_rays")]
    all: bool,
}

impl Sample {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        let binary = binary(&self.output)?;
        if same_file(&self.input, &self.output) {
            bail!("{} is both MESH and OUT", self.input.display());
        }
        if !self.force && self.output.symlink_metadata().is_ok() {
            bail!("{} exists already (--force replaces it)", self.output.display());
        }
        let spacing = match (self.spacing, self.surfels) {
            (Some(spacing), _) => Spacing::Of(spacing),
            (None, Some(surfels)) => Spacing::Surfels(surfels),
            (None, None) => Spacing::Auto,
        };
        let mesh = MeshOptions { spacing, reduce: !self.rays.all };
        let options = model::LoadOptions { mesh, radius_scale: self.radius_scale, ..model::LoadOptions::default() };
        let progress = Loading::new(self.quiet);
        let begin = Instant::now();
        let loaded = model::load(&self.input, &options, &|what, share| progress.step(what, share))?;
        let seconds = begin.elapsed().as_secs_f64();
        drop(progress);
        let LoadedShape::Surfels(surfels, Some(mesh)) = &loaded.shape else {
            bail!("{} is no mesh; sample takes a file with faces, and convert any other model", self.input.display());
        };
        let write = if binary { model::write_bin } else { model::write_ply };
        write(&self.output, surfels)?;
        if self.quiet {
            return Ok(());
        }
        loaded.notes.iter().for_each(|note| say(&format!("note: {note}")));
        // A time would make two runs differ.
        if stderr().is_terminal() {
            say(&format!("read and sampled in {seconds:.2} s"));
        }
        let (triangles, count, spacing) = (mesh.triangles(), surfels.len(), mesh.spacing());
        if self.json {
            let out = self.output.to_string_lossy();
            return print_json(&json!({
                "triangles": triangles, "surfels": count, "spacing": spacing, "reduced": !self.rays.all,
                "two_sided": surfels.two_sided, "out": out,
            }));
        }
        print(&format!("{count} surfels of {triangles} triangles, spacing {spacing:.4e}: {}\n", self.output.display()))
    }
}

//! `--legend`: what the colours of pictures stand for, drawn into them.

use anyhow::bail;
use clap::Args;
use splatblur::film::Picture;
use splatblur::image::draw_legends;
use splatblur::model::ColourBy;
use splatblur::scene::{ImageSettings, Scene};

/// Are legends drawn?
#[derive(Debug, Args)]
pub(super) struct LegendArgs {
    /// Draw what colours stand for into the pictures: a bar of the colours of --colour-by (in scenes: `colourBy`), with
    /// values beside it, in the lower left corner.
    #[arg(long, help_heading = "Output")]
    legend: bool,
}

impl LegendArgs {
    /// What the colours of the scene stand for, each once, where they are to be drawn.
    ///
    /// # Errors
    /// No colours stand for numbers, or there is no room for the legends of all.
    pub(super) fn of(&self, scene: &Scene) -> anyhow::Result<Vec<ColourBy>> {
        let mut legends: Vec<ColourBy> = Vec::new();
        if !self.legend {
            return Ok(legends);
        }
        for by in scene.objects.iter().filter_map(|object| object.source.options.points.colour_by.as_ref()) {
            if !legends.contains(by) {
                legends.push(by.clone());
            }
        }
        if legends.is_empty() {
            bail!(
                "--legend is for colours that stand for numbers: name a column with --colour-by, or in the scene with \
                 `colourBy`"
            );
        }
        let ImageSettings { width, height, .. } = scene.image;
        let rgba = vec![[0.0; 4]; width as usize * height as usize];
        if !draw_legends(&mut Picture { width, height, rgba, layers: Vec::new() }, &legends) {
            bail!("--legend has no room in an image of {width} x {height} pixels");
        }
        Ok(legends)
    }
}

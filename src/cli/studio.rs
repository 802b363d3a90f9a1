//! How a model alone is shown, and how PNG files show light.

use std::path::Path;

use anyhow::{Context, bail};
use clap::Args;
use glam::DVec3;
use splatblur::image::{Display, ViewTransform};
use splatblur::model::{ColourBy, ColourMap, Kind};
use splatblur::scene::{Scene, Studio, StudioLight, StudioOptions};
use splatblur::scene_file::Up;

use super::values;

/// How a model file is shown.
#[derive(Debug, Args)]
pub(super) struct StudioArgs {
    /// A model file: show the bare model, before black, lit from the upper right front, without shadow and ground.
    #[arg(long, conflicts_with = "unlit", help_heading = "Model alone")]
    no_studio: bool,
    /// A model file: show its colours as they are, without the light of lamps (--unlit), or with it (--unlit=off)
    /// [default: on for points with colours, as scans have them].
    #[arg(
        long,
        value_name = "on|off",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "on",
        value_parser = values::switch(),
        help_heading = "Model alone"
    )]
    unlit: Option<bool>,
    /// A model file: the axis that points up, y, z or -y. glTF says it itself [default: z of LAS and E57, else y].
    #[arg(
        long,
        value_name = "AXIS",
        allow_hyphen_values = true,
        value_parser = values::one_of::<Up>(Up::WORDS),
        help_heading = "Model alone"
    )]
    up: Option<Up>,
    /// What the points of a model file are drawn as: surfels, or spheres, which need no normals [default: as the file
    /// is].
    #[arg(long, value_name = "KIND", value_parser = values::point_kind(), help_heading = "Model alone")]
    kind: Option<Kind>,
    /// Radius of all points of a model file, model units [default: that of each point, else estimated].
    #[arg(
        long,
        value_name = "R",
        allow_hyphen_values = true,
        value_parser = values::radius,
        help_heading = "Model alone"
    )]
    radius: Option<f64>,
    #[command(flatten)]
    colours: ColourArgs,
}

/// Colours by a column of numbers.
#[derive(Debug, Args)]
struct ColourArgs {
    /// Colour the points of a model file by a column of numbers: a name in the file, x, y, z or speed. No light and no
    /// curve changes these colours (--legend says what they stand for).
    #[arg(long, alias = "color-by", value_name = "NAME", help_heading = "Model alone")]
    colour_by: Option<String>,
    /// Colours of --colour-by: viridis, turbo, plasma, grey, coolwarm, a list as '#000000,#ff0000', or a file with a
    /// line for each colour, as `0.5 0.2 1` [default: viridis].
    #[arg(long, alias = "color-map", value_name = "MAP", requires = "colour_by", help_heading = "Model alone")]
    colour_map: Option<String>,
    /// Values of the first and of the last colour of --colour-by, as -1..2.5 [default: the least and the greatest].
    #[arg(
        long,
        value_name = "A..B",
        allow_hyphen_values = true,
        requires = "colour_by",
        value_parser = values::range_of_colours,
        help_heading = "Model alone"
    )]
    range: Option<[f64; 2]>,
}

impl ColourArgs {
    fn of(&self) -> anyhow::Result<Option<ColourBy>> {
        let Some(column) = &self.colour_by else { return Ok(None) };
        if column.trim().is_empty() {
            bail!("--colour-by: expected the name of a column, x, y, z or speed");
        }
        let map = self.colour_map.as_deref().map(ColourMap::open).transpose().context("--colour-map")?;
        Ok(Some(ColourBy { column: column.clone(), map: map.unwrap_or_default(), range: self.range }))
    }
}

/// How a model alone is shown. By default it is bare.
#[derive(Clone, Debug, Default)]
pub(super) struct ModelAlone {
    pub(super) studio: Option<StudioOptions>,
    pub(super) up: Option<Up>,
    pub(super) kind: Option<Kind>,
    pub(super) radius: Option<f64>,
    pub(super) colour_by: Option<ColourBy>,
    /// An option that is for models alone and was given.
    given: Option<&'static str>,
}

impl ModelAlone {
    /// A scene file has lights and places of its own.
    pub(super) fn refuse_choices(&self, path: &Path) -> anyhow::Result<()> {
        match self.given {
            Some(option) => bail!("{option} is for a model file, and {} is a scene", path.display()),
            None => Ok(()),
        }
    }
}

impl StudioArgs {
    /// How a model alone is shown. `transparent`: without a background.
    pub(super) fn of(&self, background: Option<DVec3>, transparent: bool) -> anyhow::Result<ModelAlone> {
        let colour_by = self.colours.of()?;
        if colour_by.is_some() && self.unlit == Some(false) {
            bail!("--unlit=off: no light changes the colours of --colour-by");
        }
        let studio = StudioOptions { unlit: self.unlit, background, transparent };
        let given = self.unlit.map(|_| "--unlit").or(self.up.map(|_| "--up"));
        let given = given.or(self.kind.map(|_| "--kind")).or(self.radius.map(|_| "--radius"));
        let given = given.or(colour_by.as_ref().map(|_| "--colour-by"));
        let Self { up, kind, radius, .. } = *self;
        Ok(ModelAlone { studio: (!self.no_studio).then_some(studio), up, kind, radius, colour_by, given })
    }
}

/// How PNG files and movies show light.
#[derive(Debug, Args)]
pub(super) struct DisplayArgs {
    /// Exposure of PNG files and movies: light is multiplied by two to this power [default: 0].
    #[arg(
        long,
        value_name = "N",
        allow_hyphen_values = true,
        value_parser = values::stops,
        help_heading = "Display"
    )]
    stops: Option<f64>,
    /// Curve of PNG files and movies. standard: the light itself, clipped at white; agx: 16.5 stops, and what is bright
    /// turns pale [default: agx for a model in the light of the studio, else standard].
    #[arg(
        long,
        value_name = "CURVE",
        value_parser = values::one_of::<ViewTransform>(ViewTransform::WORDS),
        help_heading = "Display"
    )]
    view_transform: Option<ViewTransform>,
    /// Noise of half a code in PNG files and movies, which keeps slow gradients from showing steps (--dither), or none
    /// (--dither=off) [default: on in the studio, else off].
    #[arg(
        long,
        value_name = "on|off",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "on",
        value_parser = values::switch(),
        help_heading = "Display"
    )]
    dither: Option<bool>,
}

impl DisplayArgs {
    /// The choices of the command line, and for the rest `own`.
    ///
    /// # Errors
    /// They would change colours that stand for numbers.
    pub(super) fn or(&self, own: Display, scene: &Scene) -> anyhow::Result<Display> {
        let display = Display {
            stops: self.stops.unwrap_or(own.stops),
            view: self.view_transform.unwrap_or(own.view),
            dither: self.dither.unwrap_or(own.dither),
        };
        let option = if display.stops == 0.0 { "--view-transform" } else { "--stops" };
        let changes = display.stops != 0.0 || display.view != ViewTransform::Standard;
        match scene.objects.iter().find(|object| object.is_coloured_by()) {
            Some(object) if changes => bail!(
                "{option} would change the colours of object {:?}, which stand for numbers (colourBy)",
                object.name
            ),
            _ => Ok(display),
        }
    }

    /// Refuses choices that nothing would heed.
    pub(super) fn refuse(&self, format: &str) -> anyhow::Result<()> {
        let given = self.stops.map(|_| "--stops").or(self.view_transform.map(|_| "--view-transform"));
        match given.or(self.dither.filter(|on| *on).map(|_| "--dither")) {
            Some(option) => bail!("{option} is for {format}: EXR keeps the light as it is"),
            None => Ok(()),
        }
    }
}

/// What became of a model in a studio, and how to change it.
pub(super) fn in_words(studio: Studio) -> String {
    let light = match studio.light {
        StudioLight::Lit => "lit by three lamps (--unlit shows its colours as they are)",
        StudioLight::Unlit => "its colours as they are (--unlit=off lights it)",
        StudioLight::Own => "in its own light",
    };
    format!("in a studio, {light}; --no-studio shows the bare model")
}

//! Where panels, labels and crops go.

use super::canvas::Text;
use super::{Canvas, Colour, Crop, SheetError};
use crate::film::Picture;

const PAPER: Colour = [250, 250, 248];
const INK: Colour = [20, 20, 24];
const FAINT: Colour = [95, 95, 105];
/// Between panels, pixels.
const GAP: u32 = 12;
/// Between lines of text, pixels.
const LEADING: u32 = 4;

/// One picture and what to say about it.
#[derive(Clone, Debug)]
pub struct Panel<'a> {
    /// The mode.
    pub title: String,
    /// Samples, seconds, errors.
    pub lines: Vec<String>,
    /// The picture.
    pub picture: &'a Picture,
}

/// Sizes of a sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Greatest width of a panel, pixels; wider pictures are shrunk.
    pub panel: u32,
    /// Most panels in a row.
    pub columns: u32,
}

impl Default for Layout {
    fn default() -> Self {
        Self { panel: 480, columns: 4 }
    }
}

impl Layout {
    /// Width of a panel for pictures of this width: at least so wide that labels can be read.
    fn width(self, picture: u32) -> u32 {
        picture.min(self.panel).max(Text::Small.advance() * 34)
    }

    /// Columns and rows for so many panels, the rows about equally long.
    fn grid(self, panels: usize) -> (u32, u32) {
        let panels = panels as u32;
        let rows = panels.div_ceil(self.columns.max(1));
        (panels.div_ceil(rows.max(1)), rows)
    }
}

/// The panels side by side: title and lines, picture with the crop marked, the crop enlarged.
///
/// # Errors
/// There is no panel, sizes differ, the crop reaches outside, or the sheet would be too large.
pub fn sheet(heading: &str, panels: &[Panel<'_>], crop: Crop, layout: Layout) -> Result<Canvas, SheetError> {
    let (width, height) = one_size(panels)?;
    crop.check(width, height)?;
    let cell = layout.width(width);
    let small = Canvas::shrunk(panels[0].picture, cell)?;
    let factor = (cell / crop.width).max(1);
    let lines = panels.iter().map(|panel| panel.lines.len()).max().unwrap_or(0) as u32;
    let label = Text::Title.height() + LEADING + lines * (Text::Small.height() + LEADING);
    let crop_height = crop.height * factor;
    let cell_height = label + small.height() + GAP / 2 + crop_height + GAP;
    let (columns, rows) = layout.grid(panels.len());
    // A crop that is larger than a panel is shown pixel for pixel.
    let cell = cell.max(crop.width * factor);
    let top = GAP + Text::Title.height() + GAP;
    let total = [
        u64::from(GAP) + u64::from(columns) * u64::from(cell + GAP),
        u64::from(top) + u64::from(rows) * u64::from(cell_height + GAP),
    ];
    let mut canvas = Canvas::new(total[0], total[1], PAPER)?;
    canvas.text(heading, Text::Title, GAP, GAP, total[0] as u32 - 2 * GAP, INK);
    for (i, panel) in panels.iter().enumerate() {
        let x = GAP + (i as u32 % columns) * (cell + GAP);
        let y = top + (i as u32 / columns) * (cell_height + GAP);
        // Long names are set smaller rather than cut.
        let fits = panel.title.chars().count() as u32 * Text::Title.advance() <= cell;
        canvas.text(&panel.title, if fits { Text::Title } else { Text::Small }, x, y, cell, INK);
        for (row, line) in panel.lines.iter().enumerate() {
            let below = Text::Title.height() + LEADING + row as u32 * (Text::Small.height() + LEADING);
            canvas.text(line, Text::Small, x, y + below, cell, FAINT);
        }
        let mut picture = Canvas::shrunk(panel.picture, small.width())?;
        picture.mark(crop, width);
        canvas.put(&picture, x, y + label);
        canvas.put(&Canvas::of(panel.picture)?.enlarged(crop, factor)?, x, y + label + small.height() + GAP / 2);
    }
    Ok(canvas)
}

/// One image a panel, all of one size, to be shown in turn in the same place: the label below the picture.
///
/// # Errors
/// There is no panel, sizes differ, or the images would be too large.
pub fn flip_through(panels: &[Panel<'_>]) -> Result<Vec<Canvas>, SheetError> {
    let (width, height) = one_size(panels)?;
    let lines = panels.iter().map(|panel| panel.lines.len()).max().unwrap_or(0) as u32;
    let label = GAP + Text::Title.height() + LEADING + lines * (Text::Small.height() + LEADING) + GAP / 2;
    let wide = Layout { panel: u32::MAX, columns: 1 }.width(width);
    panels
        .iter()
        .map(|panel| {
            let mut canvas = Canvas::new(wide.into(), u64::from(height) + u64::from(label), PAPER)?;
            canvas.put(&Canvas::of(panel.picture)?, 0, 0);
            let room = wide - GAP;
            canvas.text(&panel.title, Text::Title, GAP / 2, height + GAP / 2, room, INK);
            for (row, line) in panel.lines.iter().enumerate() {
                let below = GAP / 2 + Text::Title.height() + LEADING + row as u32 * (Text::Small.height() + LEADING);
                canvas.text(line, Text::Small, GAP / 2, height + below, room, FAINT);
            }
            Ok(canvas)
        })
        .collect()
}

fn one_size(panels: &[Panel<'_>]) -> Result<(u32, u32), SheetError> {
    let first = panels.first().ok_or(SheetError::Nothing)?.picture;
    let (width, height) = (first.width, first.height);
    let expected = (width, height, width as usize * height as usize);
    if panels.iter().any(|p| (p.picture.width, p.picture.height, p.picture.rgba.len()) != expected) {
        return Err(SheetError::Sizes);
    }
    Ok((width, height))
}

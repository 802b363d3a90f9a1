//! A part of a picture, and the one in which pictures differ most.

use std::fmt;

use super::SheetError;
use crate::compare::encode;
use crate::film::Picture;

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl fmt::Display for Crop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{}x{}", self.x, self.y, self.width, self.height)
    }
}

impl Crop {
    /// Refuses crops that have no pixels or reach outside.
    pub(in crate::study) fn check(self, width: u32, height: u32) -> Result<(), SheetError> {
        let fits = |at: u32, size: u32, limit: u32| size > 0 && u64::from(at) + u64::from(size) <= u64::from(limit);
        if fits(self.x, self.width, width) && fits(self.y, self.height, height) {
            Ok(())
        } else {
            Err(SheetError::Crop { crop: self, width, height })
        }
    }
}

/// The crop of this size (or smaller, where the pictures are) in which the display values of the pictures differ most.
///
/// Each pair of pictures counts alike: the sum over pairs of d^2 / (mean of d^2 + one code of 8 bits squared), d^2 the
/// squared difference of r, g, b at a pixel. So one picture that is wrong all over does not hide where the others
/// differ, and rounding counts for nothing. The first in reading order where there are several.
///
/// # Errors
/// There are no pictures, or their sizes differ.
pub fn most_different(pictures: &[&Picture], width: u32, height: u32) -> Result<Crop, SheetError> {
    let first = pictures.first().ok_or(SheetError::Nothing)?;
    let (w, h) = (first.width, first.height);
    if pictures.iter().any(|p| (p.width, p.height, p.rgba.len()) != (w, h, w as usize * h as usize)) || w == 0 || h == 0
    {
        return Err(SheetError::Sizes);
    }
    let shown: Vec<_> = pictures.iter().map(|picture| encode(picture)).collect();
    let mut sums = vec![0.0; first.rgba.len()];
    for (k, a) in shown.iter().enumerate() {
        for b in &shown[k + 1..] {
            let square = |i: usize| (0..3).map(|c| f64::from(a[c][i] - b[c][i]).powi(2)).sum::<f64>();
            let squares: Vec<f64> = (0..sums.len()).map(square).map(|d| if d.is_finite() { d } else { 0.0 }).collect();
            let mean = squares.iter().sum::<f64>() / squares.len() as f64;
            let scale = 1.0 / (mean + (1.0_f64 / 255.0).powi(2));
            sums.iter_mut().zip(&squares).for_each(|(sum, d)| *sum += d * scale);
        }
    }
    Ok(densest(&sums, w, width, height))
}

/// The crop of this size (or smaller, where the map is) with the greatest sum of a row-major map of rows of `columns`
/// values; values that are not finite count as 0. The first in reading order where there are several.
pub fn densest(map: &[f64], columns: u32, width: u32, height: u32) -> Crop {
    let w = (columns as usize).max(1);
    let h = map.len() / w;
    // sums[y][x]: over the pixels above and to the left.
    let mut sums = vec![0.0; (w + 1) * (h + 1)];
    for y in 0..h {
        let mut row = 0.0;
        for x in 0..w {
            let value = map[y * w + x];
            row += if value.is_finite() { value } else { 0.0 };
            sums[(y + 1) * (w + 1) + x + 1] = sums[y * (w + 1) + x + 1] + row;
        }
    }
    let (cw, ch) = ((width as usize).clamp(1, w), (height as usize).clamp(1, h.max(1)));
    let at = |x: usize, y: usize| sums[y * (w + 1) + x];
    let mut best = (f64::NEG_INFINITY, 0, 0);
    for y in 0..=h.saturating_sub(ch) {
        for x in 0..=w - cw {
            let sum = at(x + cw, (y + ch).min(h)) - at(x, (y + ch).min(h)) - at(x + cw, y) + at(x, y);
            // Rounding must not choose among equals.
            if sum > best.0 + 1e-9 {
                best = (sum, x, y);
            }
        }
    }
    Crop { x: best.1 as u32, y: best.2 as u32, width: cw as u32, height: ch as u32 }
}

//! Errors as pictures.

use super::regions::Region;
use crate::compare::encode;
use crate::film::Picture;
use crate::study::sheet::{Canvas, Colour, SheetError};

/// Colour of values that are not finite.
const BAD: Colour = [255, 0, 255];

/// Display values of the picture minus those of the reference, mean of r, g, b: red where the picture is too bright,
/// blue where it is too dark, white where it is right. `range` (> 0) is the difference with the full colour.
///
/// # Errors
/// The sizes differ, or the picture is too large.
pub fn signed_error(picture: &Picture, reference: &Picture, range: f32) -> Result<Canvas, SheetError> {
    if (picture.width, picture.height) != (reference.width, reference.height) {
        return Err(SheetError::Sizes);
    }
    let (a, b) = (encode(picture), encode(reference));
    let pixels = (0..picture.rgba.len())
        .map(|i| {
            let difference = (0..3).map(|c| a[c][i] - b[c][i]).sum::<f32>() / 3.0 / range;
            if difference.is_nan() {
                return BAD;
            }
            let side = if difference > 0.0 { [178.0, 24.0, 43.0] } else { [33.0, 102.0, 172.0] };
            let strength = difference.abs().min(1.0);
            side.map(|end: f32| (255.0 + (end - 255.0) * strength).round() as u8)
        })
        .collect();
    Canvas::from_pixels(picture.width, picture.height, pixels)
}

/// The regions of a picture of `width` columns in their colours.
///
/// # Errors
/// The picture is too large, or the rows are not whole.
pub fn region_map(regions: &[Region], width: u32) -> Result<Canvas, SheetError> {
    let height = regions.len() / width.max(1) as usize;
    Canvas::from_pixels(width, height as u32, regions.iter().map(|region| region.colour()).collect())
}

/// A FLIP map in colours from black (0) over violet and orange to pale yellow (`range` and more).
///
/// # Errors
/// The map has not one value a pixel, or the picture is too large.
pub fn flip_map(map: &[f32], width: u32, height: u32, range: f32) -> Result<Canvas, SheetError> {
    Canvas::from_pixels(width, height, map.iter().map(|&v| flip_scale(v / range)).collect())
}

/// The colours of [`flip_map`] for 0..=1. Lightness rises evenly, so that the map reads in print.
pub fn flip_scale(value: f32) -> Colour {
    const STOPS: [[f32; 3]; 6] = [
        [0.0, 0.0, 4.0],
        [59.0, 15.0, 112.0],
        [140.0, 41.0, 129.0],
        [222.0, 73.0, 104.0],
        [254.0, 159.0, 109.0],
        [252.0, 253.0, 191.0],
    ];
    if value.is_nan() {
        return BAD;
    }
    let at = value.clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
    let low = (at as usize).min(STOPS.len() - 2);
    let t = at - low as f32;
    [0, 1, 2].map(|c| (STOPS[low][c] + (STOPS[low + 1][c] - STOPS[low][c]) * t).round() as u8)
}

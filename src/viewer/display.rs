//! Pictures and their layers as PNG for the page.
//!
//! PNG with the fastest deflate loses nothing, so that a zoomed pixel or a false colour is what was rendered, and needs
//! no crate that is not there already. Its times stand in docs/measurements/viewer.md.

use std::f32::consts::TAU;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _, ImageResult};
use rayon::prelude::*;

use crate::film::{Aov, Layer, Picture};
use crate::image::{Bits, Display};
use crate::math::srgb;
use crate::study::report::flip_scale;

/// A PNG file for the page.
pub(super) struct Shown {
    pub(super) png: Vec<u8>,
    /// Least and greatest value of a layer, where they have the ends of its colours.
    pub(super) range: Option<[f32; 2]>,
}

/// Shows the colours of a picture as `display` says, or one of its layers. A layer that the picture does not have gives
/// its colours.
pub(super) fn show(picture: &Picture, buffer: Option<Aov>, display: Display) -> ImageResult<Shown> {
    let layer = buffer.and_then(|aov| picture.layers.iter().find(|layer| layer.aov == aov));
    let (codes, range) = layer.map_or_else(|| (colours(picture, display), None), false_colours);
    Ok(Shown { png: encode(picture, &codes)?, range })
}

fn encode(picture: &Picture, codes: &[u8]) -> ImageResult<Vec<u8>> {
    let mut png = Vec::with_capacity(codes.len() / 4);
    let encoder = PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Up);
    encoder.write_image(codes, picture.width, picture.height, ExtendedColorType::Rgb8)?;
    Ok(png)
}

/// sRGB codes, row by row. Transparent pixels are shown before black.
fn colours(picture: &Picture, display: Display) -> Vec<u8> {
    if !display.is_plain() {
        let bare = Picture { rgba: picture.rgba.clone(), layers: Vec::new(), ..*picture };
        return colours(&display.shown(bare, Bits::Eight, false), Display::default());
    }
    let columns = picture.width.max(1) as usize;
    let mut codes = vec![0; 3 * picture.rgba.len()];
    codes.par_chunks_mut(3 * columns).zip(picture.rgba.par_chunks(columns)).for_each_init(
        Vec::new,
        |row, (out, pixels)| {
            row.clear();
            row.extend(pixels.iter().flat_map(|&[r, g, b, _]| [r, g, b]));
            srgb::encode(row, 255.0);
            out.iter_mut().zip(row.iter()).for_each(|(out, &code)| *out = code as u8);
        },
    );
    codes
}

/// A layer in colours, and the range of its values.
fn false_colours(layer: &Layer) -> (Vec<u8>, Option<[f32; 2]>) {
    let value = |plane: usize, i: usize| layer.planes.get(plane).and_then(|plane| plane.get(i)).copied().unwrap_or(0.0);
    let pixels = layer.planes.first().map_or(0, Vec::len);
    let paint = |colour: &(dyn Fn(usize) -> [f32; 3] + Sync)| {
        let mut codes = vec![0; 3 * pixels];
        codes.par_chunks_mut(3).enumerate().for_each(|(i, out)| {
            out.iter_mut().zip(colour(i)).for_each(|(out, v)| *out = (v.clamp(0.0, 1.0) * 255.0).round() as u8);
        });
        codes
    };
    let range = |value: &dyn Fn(usize) -> f32| {
        let finite = (0..pixels).map(value).filter(|v| v.is_finite());
        let [low, high] = finite.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]);
        if low <= high { [low, high] } else { [0.0, 0.0] }
    };
    match layer.aov {
        Aov::Alpha => (paint(&|i| [value(0, i); 3]), Some([0.0, 1.0])),
        Aov::Depth => {
            // Near is bright; where nothing is seen it is black.
            let [low, high] = range(&|i| value(0, i));
            let span = (high - low).max(f32::MIN_POSITIVE);
            let grey = |v: f32| if v.is_finite() { 1.0 - 0.9 * (v - low) / span } else { 0.0 };
            (paint(&|i| [grey(value(0, i)); 3]), Some([low, high]))
        }
        Aov::Normal => (paint(&|i| [0, 1, 2].map(|axis| 0.5 + 0.5 * value(axis, i))), None),
        Aov::Velocity => {
            let length = |i: usize| value(0, i).hypot(value(1, i));
            let [_, high] = range(&length);
            let scale = high.max(f32::MIN_POSITIVE);
            let colour = |i: usize| wheel(value(1, i).atan2(value(0, i)) / TAU, length(i) / scale);
            (paint(&colour), Some([0.0, high]))
        }
        Aov::Samples | Aov::Error | Aov::LodError | Aov::Object => {
            let [_, high] = range(&|i| value(0, i));
            let scale = high.max(f32::MIN_POSITIVE);
            (paint(&|i| flip_scale(value(0, i) / scale).map(|code| f32::from(code) / 255.0)), Some([0.0, high]))
        }
    }
}

/// A fully saturated hue (in turns, right is red), as bright as `value`.
fn wheel(hue: f32, value: f32) -> [f32; 3] {
    [0.0, 2.0 / 3.0, 1.0 / 3.0].map(|shift| {
        let distance = ((hue + shift).rem_euclid(1.0) - 0.5).abs();
        value * (6.0 * distance - 1.0).clamp(0.0, 1.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(layers: Vec<Layer>) -> Picture {
        Picture { width: 2, height: 1, rgba: vec![[0.0, 0.5, 1.0, 1.0], [2.0, -1.0, 0.2, 1.0]], layers }
    }

    fn decoded(png: &[u8]) -> Vec<u8> {
        image::load_from_memory(png).unwrap().into_rgb8().into_raw()
    }

    fn codes(picture: &Picture, buffer: Option<Aov>) -> (Vec<u8>, Option<[f32; 2]>) {
        let shown = show(picture, buffer, Display::default()).unwrap();
        (decoded(&shown.png), shown.range)
    }

    #[test]
    fn colours_are_those_of_files() {
        let picture = picture(Vec::new());
        let (shown, _) = codes(&picture, None);
        let file = crate::image::encode(
            &picture,
            crate::image::Format::Png { bits: crate::image::Bits::Eight, alpha: false },
            "",
        );
        assert_eq!(shown, decoded(&file.unwrap()));
    }

    #[test]
    fn layers_have_their_colours_and_ranges() {
        let layer = |aov, planes: &[[f32; 2]]| {
            let planes = planes.iter().map(|plane| plane.to_vec()).collect();
            picture(vec![Layer { aov, planes, names: Vec::new() }])
        };
        let depth = codes(&layer(Aov::Depth, &[[f32::INFINITY, 3.0]]), Some(Aov::Depth));
        assert_eq!(depth, (vec![0, 0, 0, 255, 255, 255], Some([3.0, 3.0])));
        let normal = codes(&layer(Aov::Normal, &[[0.0, 1.0], [0.0, -1.0], [0.0, 0.0]]), Some(Aov::Normal));
        assert_eq!(normal, (vec![128, 128, 128, 255, 0, 128], None));
        // Right is red, down (a quarter of a turn) is between yellow and green.
        let velocity = codes(&layer(Aov::Velocity, &[[4.0, 0.0], [0.0, 2.0]]), Some(Aov::Velocity));
        assert_eq!(velocity, (vec![255, 0, 0, 64, 128, 0], Some([0.0, 4.0])));
        let samples = codes(&layer(Aov::Samples, &[[0.0, 8.0]]), Some(Aov::Samples));
        assert_eq!(samples, (vec![0, 0, 4, 252, 253, 191], Some([0.0, 8.0])));
        // A layer that is not there.
        assert_eq!(codes(&picture(Vec::new()), Some(Aov::Error)), codes(&picture(Vec::new()), None));
    }
}

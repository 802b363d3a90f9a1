//! An 8-bit image to draw on: pictures, text, frames; written as PNG or animated PNG.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use rayon::prelude::*;

use super::{Crop, SheetError};
use crate::film::Picture;
use crate::math::srgb;

/// Most pixels of a canvas.
pub(super) const MAX_PIXELS: u64 = 1 << 27;

/// sRGB-encoded r, g, b.
pub type Colour = [u8; 3];

/// Outlines of crops.
const MARK: Colour = [255, 196, 0];

/// Rows from the top, sRGB-encoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Canvas {
    width: u32,
    height: u32,
    pixels: Vec<Colour>,
}

/// Heights of text in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Text {
    /// 16, for figures.
    Small,
    /// 20 and bold, for titles.
    Title,
}

impl Text {
    const fn face(self) -> (FontWeight, RasterHeight) {
        match self {
            Self::Small => (FontWeight::Regular, RasterHeight::Size16),
            Self::Title => (FontWeight::Bold, RasterHeight::Size20),
        }
    }

    /// Height of a line in pixels.
    pub(super) const fn height(self) -> u32 {
        self.face().1.val() as u32
    }

    /// Width of a character in pixels.
    pub(super) const fn advance(self) -> u32 {
        let (weight, height) = self.face();
        get_raster_width(weight, height) as u32
    }
}

impl Canvas {
    /// A canvas of one colour.
    ///
    /// # Errors
    /// It would be too large, or have no pixels.
    pub fn new(width: u64, height: u64, colour: Colour) -> Result<Self, SheetError> {
        if width == 0 || height == 0 || width.saturating_mul(height) > MAX_PIXELS {
            return Err(SheetError::Large { width, height });
        }
        Ok(Self { width: width as u32, height: height as u32, pixels: vec![colour; (width * height) as usize] })
    }

    /// A canvas from one colour a pixel.
    ///
    /// # Errors
    /// There are not as many pixels as the size says, or too many.
    pub fn from_pixels(width: u32, height: u32, pixels: Vec<Colour>) -> Result<Self, SheetError> {
        let (w, h) = (u64::from(width), u64::from(height));
        if pixels.len() as u64 != w * h || pixels.is_empty() || w * h > MAX_PIXELS {
            return Err(SheetError::Large { width: w, height: h });
        }
        Ok(Self { width, height, pixels })
    }

    /// What a screen shows of a picture, over black; what is not finite is magenta.
    ///
    /// # Errors
    /// It is too large.
    pub fn of(picture: &Picture) -> Result<Self, SheetError> {
        Self::from_pixels(picture.width, picture.height, picture.rgba.par_iter().map(shown).collect())
    }

    /// The picture made narrower: mean light over the square that each new pixel covers. Never wider than the picture.
    ///
    /// # Errors
    /// It is too large.
    pub fn shrunk(picture: &Picture, width: u32) -> Result<Self, SheetError> {
        let width = width.clamp(1, picture.width.max(1));
        if width == picture.width {
            return Self::of(picture);
        }
        let scale = f64::from(picture.width) / f64::from(width);
        let height = ((f64::from(picture.height) / scale).round() as u32).max(1);
        let columns = spans(picture.width, width);
        let rows = spans(picture.height, height);
        let pixels = rows
            .par_iter()
            .flat_map_iter(|row| columns.iter().map(move |column| mean_light(picture, column, row)))
            .map(|pixel| shown(&pixel))
            .collect();
        Self::from_pixels(width, height, pixels)
    }

    /// A part, each pixel a square of `factor` pixels.
    ///
    /// # Errors
    /// The part is not inside, or the result would be too large.
    pub fn enlarged(&self, crop: Crop, factor: u32) -> Result<Self, SheetError> {
        crop.check(self.width, self.height)?;
        let (w, h) = (u64::from(crop.width) * u64::from(factor), u64::from(crop.height) * u64::from(factor));
        let mut canvas = Self::new(w, h, [0; 3])?;
        let w = w as usize;
        for (i, pixel) in canvas.pixels.iter_mut().enumerate() {
            let (x, y) = ((i % w) as u32 / factor + crop.x, (i / w) as u32 / factor + crop.y);
            *pixel = self.pixels[y as usize * self.width as usize + x as usize];
        }
        Ok(canvas)
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Pixels, rows from the top.
    pub fn pixels(&self) -> &[Colour] {
        &self.pixels
    }

    fn pixel(&mut self, x: i64, y: i64) -> Option<&mut Colour> {
        let inside = (0..i64::from(self.width)).contains(&x) && (0..i64::from(self.height)).contains(&y);
        inside.then(|| &mut self.pixels[y as usize * self.width as usize + x as usize])
    }

    /// Puts another canvas here; what is outside is cut off.
    pub fn put(&mut self, other: &Self, x: u32, y: u32) {
        for (row, line) in other.pixels.chunks(other.width as usize).enumerate() {
            for (column, &colour) in line.iter().enumerate() {
                if let Some(pixel) = self.pixel(i64::from(x) + column as i64, i64::from(y) + row as i64) {
                    *pixel = colour;
                }
            }
        }
    }

    /// Outlines a crop of the picture of `width` columns that this shows, perhaps smaller.
    pub fn mark(&mut self, crop: Crop, width: u32) {
        let scaled = |v: u32| (f64::from(v) * f64::from(self.width) / f64::from(width.max(1))).round() as u32;
        self.outline(scaled(crop.x), scaled(crop.y), scaled(crop.width), scaled(crop.height), MARK);
    }

    /// The outline of a rectangle, one pixel wide, that goes around the pixels x..x+width, y..y+height.
    fn outline(&mut self, x: u32, y: u32, width: u32, height: u32, colour: Colour) {
        let (x, y, w, h) = (i64::from(x), i64::from(y), i64::from(width), i64::from(height));
        let level = (x - 1..=x + w).flat_map(|i| [(i, y - 1), (i, y + h)]);
        let upright = (y - 1..=y + h).flat_map(|j| [(x - 1, j), (x + w, j)]);
        for (i, j) in level.chain(upright) {
            if let Some(pixel) = self.pixel(i, j) {
                *pixel = colour;
            }
        }
    }

    /// One line of text; characters beyond ASCII become `?`. Cut with dots where it is wider than `width`.
    pub(super) fn text(&mut self, text: &str, face: Text, x: u32, y: u32, width: u32, colour: Colour) {
        let room = (width / face.advance()) as usize;
        let mut letters: Vec<char> = text.chars().collect();
        if letters.len() > room {
            letters.truncate(room.saturating_sub(2));
            letters.extend("..".chars().take(room));
        }
        let (weight, height) = face.face();
        for (i, &letter) in letters.iter().enumerate() {
            let Some(raster) = get_raster(letter, weight, height).or_else(|| get_raster('?', weight, height)) else {
                continue;
            };
            let left = i64::from(x) + i as i64 * i64::from(face.advance());
            for (row, line) in raster.rows().enumerate() {
                for (column, &cover) in line.iter().enumerate() {
                    if let Some(pixel) = self.pixel(left + column as i64, i64::from(y) + row as i64) {
                        let mix = |from: u8, to: u8| {
                            let cover = u32::from(cover);
                            ((u32::from(from) * (255 - cover) + u32::from(to) * cover + 127) / 255) as u8
                        };
                        *pixel = [0, 1, 2].map(|c| mix(pixel[c], colour[c]));
                    }
                }
            }
        }
    }

    /// The bytes of a PNG file. Equal canvases give equal bytes.
    ///
    /// # Errors
    /// The encoder fails.
    pub fn png(&self) -> Result<Vec<u8>, SheetError> {
        animation(std::slice::from_ref(self), 1)
    }
}

/// The bytes of an animated PNG that shows each canvas for `milliseconds`, for ever; of a plain one where there is one
/// canvas. All have one size.
///
/// # Errors
/// There is no canvas, sizes differ, or the encoder fails.
pub fn animation(frames: &[Canvas], milliseconds: u16) -> Result<Vec<u8>, SheetError> {
    let first = frames.first().ok_or(SheetError::Nothing)?;
    if frames.iter().any(|frame| (frame.width, frame.height) != (first.width, first.height)) {
        return Err(SheetError::Sizes);
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, first.width, first.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_compression(png::Compression::Balanced);
    if frames.len() > 1 {
        encoder.set_animated(frames.len() as u32, 0)?;
        encoder.set_frame_delay(milliseconds, 1000)?;
    }
    let mut writer = encoder.write_header()?;
    for frame in frames {
        writer.write_image_data(frame.pixels.as_flattened())?;
    }
    writer.finish()?;
    Ok(bytes)
}

fn shown(pixel: &[f32; 4]) -> Colour {
    if pixel[..3].iter().any(|v| !v.is_finite()) {
        return [255, 0, 255];
    }
    let mut codes = [pixel[0], pixel[1], pixel[2]];
    srgb::encode(&mut codes, 255.0);
    codes.map(|code| code as u8)
}

/// For each of `to` pixels the source pixels that it covers, with their shares, which sum to 1.
fn spans(from: u32, to: u32) -> Vec<Vec<(usize, f64)>> {
    let scale = f64::from(from) / f64::from(to);
    (0..to)
        .map(|i| {
            let (start, end) = (f64::from(i) * scale, (f64::from(i) + 1.0) * scale);
            let last = (end.ceil() as usize).min(from as usize);
            let share = |p: usize| (end.min(p as f64 + 1.0) - start.max(p as f64)).max(0.0) / scale;
            (start as usize..last).map(|p| (p, share(p))).collect()
        })
        .collect()
}

fn mean_light(picture: &Picture, columns: &[(usize, f64)], rows: &[(usize, f64)]) -> [f32; 4] {
    let mut sum = [0.0; 4];
    for &(y, down) in rows {
        for &(x, along) in columns {
            let pixel = picture.rgba[y * picture.width as usize + x];
            (0..4).for_each(|c| sum[c] += down * along * f64::from(pixel[c].clamp(-1e30, 1e30)));
        }
    }
    sum.map(|v| v as f32)
}

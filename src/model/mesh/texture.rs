//! Images of textures: PNG, JPEG and WebP to texels.
//!
//! JPEG is decoded by `zune-jpeg` and not by `image`, which wraps it: that one asks it to be lenient. A file that was
//! cut short would end in grey, and colours of a printer would become wrong ones.

use std::io::Cursor;

use image::codecs::png::PngDecoder;
use image::{DynamicImage, ImageDecoder, ImageError, ImageResult, Limits};

use super::{Texture, Wrap};
use crate::files;

/// Most bytes that stand beside the pixels of a PNG.
const MOST_BESIDE: u64 = 1 << 26;

/// Widest and highest image, texels.
const MOST_SIZE: u32 = 16_384;

/// Most texels of an image.
const MOST_TEXELS: u64 = 1 << 28;

/// Texels that the images of every model may have together, however small its files are.
const FREE_TEXELS: u64 = 1 << 26;

/// Most texels above [`FREE_TEXELS`] for each byte of the files. An image of one colour packs that well, a texture does
/// not.
const MOST_TEXELS_A_BYTE: u64 = 256;

/// The texels that the images of one model may still have.
#[derive(Debug)]
pub(super) struct Budget(u64);

impl Budget {
    /// For a model whose file has `bytes`.
    pub(super) fn new(bytes: usize) -> Self {
        Self(FREE_TEXELS + MOST_TEXELS_A_BYTE * bytes as u64)
    }

    /// More, for another file of the model.
    pub(super) fn add(&mut self, bytes: usize) {
        self.0 = self.0.saturating_add(MOST_TEXELS_A_BYTE * bytes as u64);
    }

    /// The number of texels that a header promises, refused before memory is taken for them if it is too large.
    fn check(&self, [width, height]: [u32; 2]) -> Result<u64, String> {
        let [width, height] = [width, height].map(u64::from);
        let most = u64::from(MOST_SIZE);
        if !(1..=most).contains(&width) || !(1..=most).contains(&height) {
            return Err(format!("{width} x {height} texels, expected 1 to {MOST_SIZE} each"));
        }
        let limit = MOST_TEXELS.min(self.0);
        if width * height > limit {
            return Err(format!("{width} x {height} texels, expected at most {limit} for files of this size"));
        }
        Ok(width * height)
    }

    /// Has less by the texels of an image.
    fn take(&mut self, size: [u32; 2]) -> Result<(), String> {
        self.0 -= self.check(size)?;
        Ok(())
    }
}

/// Why an image was not decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum NoTexture {
    /// It is of a kind that is not read. What was to be drawn with it can be drawn without.
    Unknown(String),
    /// It is damaged, or too large.
    Broken(String),
}

/// Decodes an image by its first bytes.
///
/// # Errors
/// The format is unknown, or the image is damaged or too large. The text says what was found.
pub(super) fn decode(bytes: &[u8], wrap: [Wrap; 2], budget: &mut Budget) -> Result<Texture, NoTexture> {
    let (size, texels) = if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        decode_png(bytes, budget).map_err(|why| NoTexture::Broken(format!("a PNG with {why}")))?
    } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        jpeg(bytes, budget)?
    } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        webp(bytes, budget)?
    } else {
        let known: [(&[u8], &str); 6] = [
            (b"\xabKTX 20", "a KTX2 image"),
            (b"BM", "a BMP image"),
            (b"GIF8", "a GIF image"),
            (b"II*\0", "a TIFF image"),
            (b"MM\0*", "a TIFF image"),
            (b"DDS ", "a DDS image"),
        ];
        let found = known.iter().find(|(magic, _)| bytes.starts_with(magic)).map_or("no image", |(_, name)| name);
        return Err(NoTexture::Unknown(format!("{found}, expected PNG, JPEG or WebP")));
    };
    Ok(Texture { size, texels, wrap })
}

type Texels = ([u32; 2], Vec<[u8; 4]>);

fn decode_png(bytes: &[u8], budget: &mut Budget) -> Result<Texels, String> {
    // The size has a fixed place. `image` reads on before it tells it.
    let side = |at: usize| Some(u32::from_be_bytes(*bytes.get(at..)?.first_chunk()?));
    if let (Some(width), Some(height)) = (side(16), side(20)) {
        budget.check([width, height])?;
    }
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MOST_BESIDE);
    decoded(PngDecoder::with_limits(Cursor::new(bytes), limits), budget)
}

/// The texels of an image, once there is room for what its header promises; 16 bits are rounded to 8.
fn decoded(decoder: ImageResult<impl ImageDecoder>, budget: &mut Budget) -> Result<Texels, String> {
    let damage = |e: ImageError| format!("damage: {}", files::cause(&e));
    let decoder = decoder.map_err(damage)?;
    let size = <[u32; 2]>::from(decoder.dimensions());
    budget.take(size)?;
    Ok((size, texels(DynamicImage::from_decoder(decoder).map_err(damage)?)))
}

fn texels(image: DynamicImage) -> Vec<[u8; 4]> {
    image.into_rgba8().pixels().map(|pixel| pixel.0).collect()
}

#[cfg(not(feature = "formats"))]
fn jpeg(_: &[u8], _: &mut Budget) -> Result<Texels, NoTexture> {
    Err(NoTexture::Unknown("a JPEG image, which needs a program built with the feature `formats`".to_owned()))
}

#[cfg(not(feature = "formats"))]
fn webp(_: &[u8], _: &mut Budget) -> Result<Texels, NoTexture> {
    Err(NoTexture::Unknown("a WebP image, which needs a program built with the feature `formats`".to_owned()))
}

#[cfg(feature = "formats")]
fn jpeg(bytes: &[u8], budget: &mut Budget) -> Result<Texels, NoTexture> {
    use image::{GrayImage, RgbImage};
    use zune_jpeg::JpegDecoder;
    use zune_jpeg::zune_core::bytestream::ZCursor;
    use zune_jpeg::zune_core::colorspace::ColorSpace;
    use zune_jpeg::zune_core::options::DecoderOptions;

    let broken = |why: String| NoTexture::Broken(format!("a JPEG with {why}"));
    let most = MOST_SIZE as usize;
    let options = DecoderOptions::new_safe().set_max_width(most).set_max_height(most).set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    // Its texts may have lines.
    let one_line = |text: String| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let damaged = |e: zune_jpeg::errors::DecodeErrors| broken(one_line(format!("damage: {e:?}")));
    decoder.decode_headers().map_err(damaged)?;
    let (width, height) = decoder.dimensions().ok_or_else(|| broken("no size".to_owned()))?;
    let size = [width as u32, height as u32];
    budget.take(size).map_err(broken)?;
    let is_grey = match decoder.input_colorspace() {
        Some(ColorSpace::CMYK | ColorSpace::YCCK) => {
            return Err(broken("the colours of a printer (CMYK), expected red, green and blue, or grey".to_owned()));
        }
        space => space == Some(ColorSpace::Luma),
    };
    let space = if is_grey { ColorSpace::Luma } else { ColorSpace::RGB };
    let options = (*decoder.options()).jpeg_set_out_colorspace(space);
    decoder.set_options(options);
    let data = decoder.decode().map_err(damaged)?;
    let length = data.len();
    let image = if is_grey {
        GrayImage::from_raw(size[0], size[1], data).map(DynamicImage::from)
    } else {
        RgbImage::from_raw(size[0], size[1], data).map(DynamicImage::from)
    };
    let image = image.ok_or_else(|| broken(format!("{length} values for {width} x {height} texels")))?;
    Ok((size, texels(image)))
}

#[cfg(feature = "formats")]
fn webp(bytes: &[u8], budget: &mut Budget) -> Result<Texels, NoTexture> {
    let decoder = image::codecs::webp::WebPDecoder::new(Cursor::new(bytes));
    decoded(decoder, budget).map_err(|why| NoTexture::Broken(format!("a WebP with {why}")))
}

//! Images of textures: PNG, JPEG and WebP to texels.
//!
//! The JPEG decoder is the crate `zune-jpeg`, without its vector features: it needs no other crate but its own core.

use std::io::Cursor;

use png::{BitDepth, Decoder, Limits, Transformations};

use super::{Texture, Wrap};

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

    /// Refuses what a header promises before memory is taken for it.
    fn take(&mut self, width: u64, height: u64) -> Result<[u32; 2], String> {
        let most = u64::from(MOST_SIZE);
        if !(1..=most).contains(&width) || !(1..=most).contains(&height) {
            return Err(format!("{width} x {height} texels, expected 1 to {MOST_SIZE} each"));
        }
        let limit = MOST_TEXELS.min(self.0);
        if width * height > limit {
            return Err(format!("{width} x {height} texels, expected at most {limit} for files of this size"));
        }
        self.0 -= width * height;
        Ok([width as u32, height as u32])
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
    let refused = |e: png::DecodingError| format!("damage: {e}");
    // The header is checked by us; the limit is for what stands beside the pixels.
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: 1 << 26 });
    // Palettes become colours, transparent colours alpha, and fewer bits than 8 become 8.
    decoder.set_transformations(Transformations::EXPAND);
    let (width, height) = decoder.read_header_info().map_err(refused)?.size();
    let size = budget.take(width.into(), height.into())?;
    let mut reader = decoder.read_info().map_err(refused)?;
    let (colour, depth) = reader.output_color_type();
    let channels = colour.samples();
    let length = reader.output_buffer_size().ok_or("too many pixels")?;
    let mut data = vec![0; length];
    reader.next_frame(&mut data).map_err(refused)?;
    if depth == BitDepth::Sixteen {
        // Rounded: 65535 = 257 x 255.
        let narrow = |v: &[u8]| ((u32::from(u16::from_be_bytes([v[0], v[1]])) + 128) / 257) as u8;
        data = data.chunks_exact(2).map(narrow).collect();
    }
    Ok((size, texels(&data, channels)))
}

/// Codes of 1 (grey), 2 (grey, alpha), 3 or 4 channels as texels.
fn texels(codes: &[u8], channels: usize) -> Vec<[u8; 4]> {
    let texel = |v: &[u8]| match *v {
        [l] => [l, l, l, 255],
        [l, a] => [l, l, l, a],
        [r, g, b] => [r, g, b, 255],
        [r, g, b, a, ..] => [r, g, b, a],
        [] => [0; 4],
    };
    codes.chunks_exact(channels.max(1)).map(texel).collect()
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
    let size = budget.take(width as u64, height as u64).map_err(broken)?;
    let channels = match decoder.input_colorspace() {
        Some(ColorSpace::CMYK | ColorSpace::YCCK) => {
            return Err(broken("the colours of a printer (CMYK), expected red, green and blue, or grey".to_owned()));
        }
        Some(ColorSpace::Luma) => 1,
        _ => 3,
    };
    let space = if channels == 1 { ColorSpace::Luma } else { ColorSpace::RGB };
    let options = (*decoder.options()).jpeg_set_out_colorspace(space);
    decoder.set_options(options);
    let data = decoder.decode().map_err(damaged)?;
    if data.len() != width * height * channels {
        return Err(broken(format!("{} of {} values", data.len(), width * height * channels)));
    }
    Ok((size, texels(&data, channels)))
}

#[cfg(feature = "formats")]
fn webp(bytes: &[u8], budget: &mut Budget) -> Result<Texels, NoTexture> {
    let broken = |why: String| NoTexture::Broken(format!("a WebP with {why}"));
    let damaged = |e: image_webp::DecodingError| broken(format!("damage: {e}"));
    let mut decoder = image_webp::WebPDecoder::new(Cursor::new(bytes)).map_err(damaged)?;
    decoder.set_memory_limit(1 << 30);
    let (width, height) = decoder.dimensions();
    let size = budget.take(width.into(), height.into()).map_err(broken)?;
    let length = decoder.output_buffer_size().ok_or_else(|| broken("too many pixels".to_owned()))?;
    let mut data = vec![0; length];
    decoder.read_image(&mut data).map_err(damaged)?;
    Ok((size, texels(&data, if decoder.has_alpha() { 4 } else { 3 })))
}

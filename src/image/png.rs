//! PNG: 8 or 16 bits, sRGB-encoded or by another response, straight alpha. Colour is un-premultiplied in linear
//! light, then encoded, then rounded to the nearest code; values outside [0, 1] are clipped. What
//! [`super::Display`] does comes before.

use std::io::{Cursor, Read, Seek, SeekFrom};

use ::image::codecs::png::{CompressionType, FilterType, PngDecoder, PngEncoder};
use ::image::{DynamicImage, ExtendedColorType, ImageDecoder as _, ImageEncoder as _, ImageResult, Limits};

use super::{Bits, DEFLATE_LIMIT, ImageError, Response, SETTINGS, plausible};
use crate::files;
use crate::film::Picture;
use crate::math::srgb;

pub(super) const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// The signature and the `IHDR` chunk, which comes first and has a fixed length.
const HEADER_LENGTH: usize = 8 + 12 + 13;

/// Longest settings that are read back, bytes.
const LONGEST_SETTINGS: u32 = 1 << 24;

pub(super) fn encode(
    picture: &Picture,
    bits: Bits,
    alpha: bool,
    response: Response,
    settings: &str,
) -> Result<Vec<u8>, ImageError> {
    if let Some(layer) = picture.layers.first() {
        return Err(ImageError::PngLayer { layer: layer.aov.name() });
    }
    let png = match bits {
        Bits::Eight => {
            let colour = if alpha { ExtendedColorType::Rgba8 } else { ExtendedColorType::Rgb8 };
            compressed(picture, colour, &codes(picture, alpha, response, 255.0, |code| code as u8))
        }
        Bits::Sixteen => {
            let colour = if alpha { ExtendedColorType::Rgba16 } else { ExtendedColorType::Rgb16 };
            let codes = codes(picture, alpha, response, 65_535.0, |code| code as u16);
            compressed(picture, colour, bytemuck::cast_slice(&codes))
        }
    };
    insert_chunks(png.map_err(|e| ImageError::Encode { what: files::cause(&e) })?, response, settings)
}

/// The bytes of a PNG file without further chunks. Codes of 16 bits are in the order of this computer.
fn compressed(picture: &Picture, colour: ExtendedColorType, codes: &[u8]) -> ImageResult<Vec<u8>> {
    let mut png = Vec::new();
    // Said in full: the encoder's defaults may change.
    let encoder = PngEncoder::new_with_quality(&mut png, CompressionType::Default, FilterType::Adaptive);
    encoder.write_image(codes, picture.width, picture.height, colour)?;
    Ok(png)
}

/// sRGB codes of 8 bits in file order.
pub(super) fn codes_8(picture: &Picture, alpha: bool) -> Vec<u8> {
    codes(picture, alpha, Response::Srgb, 255.0, |code| code as u8)
}

/// sRGB codes of 16 bits in file order.
pub(super) fn codes_16(picture: &Picture, alpha: bool) -> Vec<u16> {
    codes(picture, alpha, Response::Srgb, 65_535.0, |code| code as u16)
}

/// Codes 0..=`top` in file order: R G B, or R G B A.
fn codes<T>(picture: &Picture, alpha: bool, response: Response, top: f32, narrow: impl Fn(f32) -> T) -> Vec<T> {
    let channels = if alpha { 4 } else { 3 };
    let mut codes = Vec::with_capacity(picture.rgba.len() * channels);
    let mut row = Vec::new();
    for pixels in picture.rgba.chunks(picture.width.max(1) as usize) {
        row.clear();
        for &[r, g, b, a] in pixels {
            // Where nothing covers the pixel there is no colour to find.
            let divisor = if alpha && a > 0.0 { a } else { 1.0 };
            row.extend([r / divisor, g / divisor, b / divisor]);
        }
        response.encode(&mut row, top);
        for (colour, [_, _, _, a]) in row.chunks_exact(3).zip(pixels) {
            codes.extend(colour.iter().map(|&code| narrow(code)));
            if alpha {
                codes.push(narrow(srgb::nearest_code(*a, top) as f32));
            }
        }
    }
    codes
}

/// Puts the colour space and the settings right after `IHDR`, where a reader finds them first.
fn insert_chunks(mut png: Vec<u8>, response: Response, settings: &str) -> Result<Vec<u8>, ImageError> {
    if png.len() < HEADER_LENGTH {
        return Err(ImageError::Encode { what: "the PNG encoder wrote no header".to_owned() });
    }
    let rest = png.split_off(HEADER_LENGTH);
    match response.gamma() {
        None => push_chunk(&mut png, *b"sRGB", &[0])?, // rendering intent: perceptual
        Some(gamma) => push_chunk(&mut png, *b"gAMA", &((1e5 / gamma).round() as u32).to_be_bytes())?,
    }
    let mut text = SETTINGS.as_bytes().to_vec();
    // End of keyword; not compressed; no language, no translated keyword.
    text.extend([0, 0, 0, 0, 0]);
    text.extend(settings.as_bytes());
    push_chunk(&mut png, *b"iTXt", &text)?;
    png.extend(rest);
    Ok(png)
}

fn push_chunk(png: &mut Vec<u8>, kind: [u8; 4], data: &[u8]) -> Result<(), ImageError> {
    let length = u32::try_from(data.len())
        .ok()
        .filter(|&n| n <= LONGEST_SETTINGS)
        .ok_or_else(|| ImageError::Encode { what: format!("{} bytes of settings are too many", data.len()) })?;
    png.extend(length.to_be_bytes());
    png.extend(kind);
    png.extend(data);
    let mut crc = crc32fast::Hasher::new();
    crc.update(&kind);
    crc.update(data);
    png.extend(crc.finalize().to_be_bytes());
    Ok(())
}

/// The settings, found by walking the chunks before the first `IDAT`.
pub(super) fn settings(file: &mut (impl Read + Seek)) -> Option<String> {
    file.seek(SeekFrom::Start(SIGNATURE.len() as u64)).ok()?;
    loop {
        let mut head = [0; 8];
        file.read_exact(&mut head).ok()?;
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]);
        match &head[4..] {
            b"iTXt" if length <= LONGEST_SETTINGS => {
                let mut body = Vec::new();
                file.take(u64::from(length) + 4).read_to_end(&mut body).ok()?;
                if let Some(text) = settings_of(&body) {
                    return Some(text);
                }
            }
            b"IDAT" | b"IEND" => return None,
            _ => {
                file.seek(SeekFrom::Current(i64::from(length) + 4)).ok()?;
            }
        }
    }
}

/// True if all chunks up to `IEND` are there with their checksums, some pixels among them, and nothing follows.
pub(super) fn is_whole(bytes: &[u8]) -> bool {
    let mut rest = bytes.get(SIGNATURE.len()..).unwrap_or_default();
    let mut has_pixels = false;
    while let Some((head, after)) = rest.split_first_chunk::<8>() {
        let [a, b, c, d, kind @ ..] = *head;
        let length = u32::from_be_bytes([a, b, c, d]) as usize;
        let Some((data, after)) = after.split_at_checked(length) else { return false };
        let Some((crc, after)) = after.split_first_chunk::<4>() else { return false };
        let mut expected = crc32fast::Hasher::new();
        expected.update(&kind);
        expected.update(data);
        if expected.finalize() != u32::from_be_bytes(*crc) {
            return false;
        }
        has_pixels |= kind == *b"IDAT";
        if kind == *b"IEND" {
            return has_pixels && data.is_empty() && after.is_empty();
        }
        rest = after;
    }
    false
}

/// The text of an `iTXt` chunk, data and checksum, if it is ours and undamaged.
fn settings_of(body: &[u8]) -> Option<String> {
    let (data, crc) = body.split_last_chunk::<4>()?;
    let mut expected = crc32fast::Hasher::new();
    expected.update(b"iTXt");
    expected.update(data);
    if expected.finalize() != u32::from_be_bytes(*crc) {
        return None;
    }
    let text = data.strip_prefix(SETTINGS.as_bytes())?.strip_prefix(&[0, 0, 0, 0, 0])?;
    String::from_utf8(text.to_vec()).ok()
}

pub(super) fn decode(bytes: &[u8]) -> Result<Picture, String> {
    let refused = |e: ::image::ImageError| format!("not a readable PNG file: {}", files::cause(&e));
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(u32::MAX.into());
    // Palettes become colours, and fewer bits than 8 become 8.
    let decoder = PngDecoder::with_limits(Cursor::new(bytes), limits).map_err(refused)?;
    let (width, height) = decoder.dimensions();
    let colour = decoder.color_type();
    plausible(width.into(), height.into(), colour.bytes_per_pixel().into(), DEFLATE_LIMIT, bytes.len())?;
    let codes = DynamicImage::from_decoder(decoder).map_err(refused)?;
    let rgba = if colour.bytes_per_pixel() > colour.channel_count() {
        linear(codes.into_rgba16().pixels().map(|pixel| pixel.0), 65_535.0)
    } else {
        linear(codes.into_rgba8().pixels().map(|pixel| pixel.0), 255.0)
    };
    Ok(Picture { width, height, rgba, layers: Vec::new() })
}

/// Pixels of codes 0..=`top` to linear premultiplied ones.
fn linear<T: Into<u16>>(pixels: impl Iterator<Item = [T; 4]>, top: f32) -> Vec<[f32; 4]> {
    // Each code is decoded once: there are far fewer codes than pixels.
    let table: Vec<f32> = (0..=top as u16).map(|code| srgb::to_linear(f32::from(code) / top)).collect();
    let premultiplied = |pixel: [T; 4]| {
        let [r, g, b, a] = pixel.map(Into::into);
        let alpha = f32::from(a) / top;
        let [r, g, b] = [r, g, b].map(|code| table[usize::from(code)] * alpha);
        [r, g, b, alpha]
    };
    pixels.map(premultiplied).collect()
}

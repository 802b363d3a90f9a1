//! PNG: 8 or 16 bits, sRGB-encoded, straight alpha. Colour is un-premultiplied in linear light, then encoded, then rounded
//! to the nearest code; there is no dither, values outside [0, 1] are clipped.

use std::io::{Cursor, Read, Seek, SeekFrom};

use ::image::codecs::png::{CompressionType, FilterType, PngDecoder, PngEncoder};
use ::image::{ColorType, ExtendedColorType, ImageDecoder, ImageEncoder, Limits};

use super::{Bits, ImageError, SETTINGS, plausible};
use crate::film::Picture;
use crate::math::srgb;

pub(super) const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// The signature and the `IHDR` chunk, which comes first and has a fixed length.
const HEADER_LENGTH: usize = 8 + 12 + 13;

/// Longest settings that are read back, bytes.
const LONGEST_SETTINGS: u32 = 1 << 24;

pub(super) fn encode(picture: &Picture, bits: Bits, alpha: bool, settings: &str) -> Result<Vec<u8>, ImageError> {
    if let Some(layer) = picture.layers.first() {
        return Err(ImageError::PngLayer { layer: layer.aov.name() });
    }
    let mut png = Vec::new();
    // Said in full: the encoder's defaults may change.
    let encoder = PngEncoder::new_with_quality(&mut png, CompressionType::Default, FilterType::Adaptive);
    let (w, h) = (picture.width, picture.height);
    match bits {
        Bits::Eight => {
            let codes = codes(picture, alpha, 255.0, |code| code as u8);
            let colour = if alpha { ExtendedColorType::Rgba8 } else { ExtendedColorType::Rgb8 };
            encoder.write_image(&codes, w, h, colour)
        }
        Bits::Sixteen => {
            let codes = codes(picture, alpha, 65_535.0, |code| code as u16);
            let colour = if alpha { ExtendedColorType::Rgba16 } else { ExtendedColorType::Rgb16 };
            encoder.write_image(bytemuck::cast_slice(&codes), w, h, colour)
        }
    }
    .map_err(|e| ImageError::Encode { what: e.to_string() })?;
    insert_chunks(png, settings)
}

/// Codes 0..=`top` in file order: R G B, or R G B A.
fn codes<T>(picture: &Picture, alpha: bool, top: f32, narrow: impl Fn(f32) -> T) -> Vec<T> {
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
        srgb::encode(&mut row, top);
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
fn insert_chunks(mut png: Vec<u8>, settings: &str) -> Result<Vec<u8>, ImageError> {
    if png.len() < HEADER_LENGTH {
        return Err(ImageError::Encode { what: "the PNG encoder wrote no header".to_owned() });
    }
    let rest = png.split_off(HEADER_LENGTH);
    push_chunk(&mut png, *b"sRGB", &[0])?; // rendering intent: perceptual
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
    let refused = |e: ::image::ImageError| format!("not a readable PNG file: {e}");
    let mut limits = Limits::default();
    limits.max_alloc = Some(u64::from(u32::MAX));
    let decoder = PngDecoder::with_limits(Cursor::new(bytes), limits).map_err(refused)?;
    let (width, height) = decoder.dimensions();
    let colour = decoder.color_type();
    plausible(u64::from(width), u64::from(height), u64::from(colour.bytes_per_pixel()), bytes.len())?;
    let length = usize::try_from(decoder.total_bytes()).map_err(|e| e.to_string())?;
    let mut data = vec![0; length];
    decoder.read_image(&mut data).map_err(refused)?;
    let channels = usize::from(colour.channel_count());
    let rgba = match colour {
        ColorType::Rgb8 | ColorType::Rgba8 | ColorType::L8 | ColorType::La8 => linear(&data, channels, 255.0),
        ColorType::Rgb16 | ColorType::Rgba16 | ColorType::L16 | ColorType::La16 => {
            let codes: Vec<u16> = data.chunks_exact(2).map(|v| u16::from_ne_bytes([v[0], v[1]])).collect();
            linear(&codes, channels, 65_535.0)
        }
        other => return Err(format!("pixels of type {other:?}, expected grey or RGB, with or without alpha")),
    };
    Ok(Picture { width, height, rgba, layers: Vec::new() })
}

/// Codes 0..=`top` in file order to linear premultiplied pixels.
fn linear<T: Copy + Into<u16>>(codes: &[T], channels: usize, top: f32) -> Vec<[f32; 4]> {
    // Each code is decoded once: there are far fewer codes than pixels.
    let table: Vec<f32> = (0..=top as u16).map(|code| srgb::to_linear(f32::from(code) / top)).collect();
    let light = |code: T| table[usize::from(code.into())];
    let share = |code: T| f32::from(code.into()) / top;
    codes
        .chunks_exact(channels)
        .map(|v| {
            let (colour, a) = match *v {
                [l] => ([l; 3], 1.0),
                [l, a] => ([l; 3], share(a)),
                [r, g, b] => ([r, g, b], 1.0),
                [r, g, b, a] => ([r, g, b], share(a)),
                // No PNG has another number of channels.
                _ => return [0.0; 4],
            };
            let [r, g, b] = colour.map(|c| light(c) * a);
            [r, g, b, a]
        })
        .collect()
}

//! PNG: 8 or 16 bits, sRGB-encoded or by another response, straight alpha. Colour is un-premultiplied in linear light,
//! then encoded, then rounded to the nearest code; there is no dither, values outside [0, 1] are clipped.

use std::io::{Cursor, Read, Seek, SeekFrom};

use ::png::{BitDepth, ColorType, Compression, Decoder, Encoder, EncodingError, Filter, Limits, Transformations};

use super::{Bits, DEFLATE_LIMIT, ImageError, Response, SETTINGS, plausible};
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
    let (depth, data) = match bits {
        Bits::Eight => (BitDepth::Eight, codes(picture, alpha, response, 255.0, |code| code as u8)),
        Bits::Sixteen => {
            let codes = codes(picture, alpha, response, 65_535.0, |code| code as u16);
            (BitDepth::Sixteen, codes.into_iter().flat_map(u16::to_be_bytes).collect())
        }
    };
    let colour = if alpha { ColorType::Rgba } else { ColorType::Rgb };
    let png = compressed(picture, colour, depth, &data);
    insert_chunks(png.map_err(|e| ImageError::Encode { what: e.to_string() })?, response, settings)
}

/// The bytes of a PNG file without further chunks.
fn compressed(picture: &Picture, colour: ColorType, depth: BitDepth, data: &[u8]) -> Result<Vec<u8>, EncodingError> {
    let mut png = Vec::new();
    let mut encoder = Encoder::new(&mut png, picture.width, picture.height);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    // Said in full: the encoder's defaults may change.
    encoder.set_compression(Compression::Balanced);
    encoder.set_filter(Filter::Adaptive);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(data)?;
    writer.finish()?;
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
    let refused = |e: ::png::DecodingError| format!("not a readable PNG file: {e}");
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: u32::MAX as usize });
    // Palettes become colours, and fewer bits than 8 become 8.
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(refused)?;
    let (width, height) = reader.info().size();
    let (colour, depth) = reader.output_color_type();
    let channels = colour.samples();
    let bytes_a_pixel = channels * if depth == BitDepth::Sixteen { 2 } else { 1 };
    plausible(u64::from(width), u64::from(height), bytes_a_pixel as u64, DEFLATE_LIMIT, bytes.len())?;
    let length = reader.output_buffer_size().ok_or("too many pixels")?;
    let mut data = vec![0; length];
    reader.next_frame(&mut data).map_err(refused)?;
    let rgba = match depth {
        BitDepth::Eight => linear(&data, channels, 255.0),
        BitDepth::Sixteen => {
            let codes: Vec<u16> = data.chunks_exact(2).map(|v| u16::from_be_bytes([v[0], v[1]])).collect();
            linear(&codes, channels, 65_535.0)
        }
        other => return Err(format!("{other:?} bits a channel, expected 8 or 16")),
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

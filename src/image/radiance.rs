//! Radiance pictures (`.hdr`, `.pic`; Ward 1991, *Real Pixels*): three mantissas with one exponent, in runs. They are
//! read, not written.

use std::borrow::Cow;

use super::plausible;
use crate::film::Picture;

pub(super) const SIGNATURE: &[u8] = b"#?";

/// Pixels that four bytes of a file become, at the most: a run of the older kind.
const RUN_LIMIT: u64 = 256;

/// Bytes of a header line, at the most.
const LONGEST_LINE: usize = 1 << 16;

/// Lengths of rows that are stored channel by channel.
const BY_CHANNEL: std::ops::RangeInclusive<usize> = 8..=0x7fff;

/// What the header says.
struct Header {
    /// Factors on the channels, so that they are radiances.
    scale: [f32; 3],
    /// Rows of the file, or columns where `by_columns`.
    lines: usize,
    /// Pixels of one.
    length: usize,
    by_columns: bool,
    /// The first pixel is the last one along x and along y.
    mirrored: [bool; 2],
}

/// Decodes a picture whose bytes end with its last pixel.
pub(super) fn is_whole(bytes: &[u8]) -> bool {
    pixels(bytes).is_ok_and(|(_, rest)| rest.is_empty())
}

/// Decodes a picture.
pub(super) fn decode(bytes: &[u8]) -> Result<Picture, String> {
    pixels(bytes).map(|(picture, _)| picture)
}

fn pixels(bytes: &[u8]) -> Result<(Picture, &[u8]), String> {
    let (header, mut rest) = header(bytes)?;
    let Header { scale, lines, length, by_columns, mirrored } = header;
    let [width, height] = if by_columns { [lines, length] } else { [length, lines] };
    plausible(width as u64, height as u64, 4, RUN_LIMIT, rest.len())?;
    let mut rgba = vec![[0.0; 4]; width * height];
    let mut line = vec![[0; 4]; length];
    for i in 0..lines {
        let what = if by_columns { "column" } else { "row" };
        rest = fill(&mut line, rest).ok_or_else(|| format!("{what} {i} of the pixels is broken or cut short"))?;
        for (j, &[r, g, b, exponent]) in line.iter().enumerate() {
            let [x, y] = if by_columns { [i, j] } else { [j, i] };
            let x = if mirrored[0] { width - 1 - x } else { x };
            let y = if mirrored[1] { height - 1 - y } else { y };
            let unit = if exponent == 0 { 0.0 } else { libm::ldexpf(1.0, i32::from(exponent) - 136) };
            let channel = |c: usize, mantissa: u8| f32::from(mantissa) * unit * scale[c];
            rgba[y * width + x] = [channel(0, r), channel(1, g), channel(2, b), 1.0];
        }
    }
    Ok((Picture { width: width as u32, height: height as u32, rgba, layers: Vec::new() }, rest))
}

/// The header, and the bytes after it.
fn header(bytes: &[u8]) -> Result<(Header, &[u8]), String> {
    let mut scale = [1.0_f32; 3];
    let (_, mut rest) = line(bytes)?;
    loop {
        let (text, after) = line(rest)?;
        rest = after;
        if text.is_empty() {
            break;
        }
        let Some((name, value)) = text.split_once('=') else { continue };
        let value = value.trim();
        match name.trim() {
            "FORMAT" if value != "32-bit_rle_rgbe" => {
                return Err(format!("FORMAT is {value:.40?}, expected 32-bit_rle_rgbe"));
            }
            name @ ("EXPOSURE" | "COLORCORR") => {
                let numbers: Option<Vec<f32>> = value.split_whitespace().map(|word| word.parse().ok()).collect();
                let by = match numbers.as_deref() {
                    Some(&[all]) if name == "EXPOSURE" => [all; 3],
                    Some(&[r, g, b]) if name == "COLORCORR" => [r, g, b],
                    _ => [0.0; 3],
                };
                for (scale, by) in scale.iter_mut().zip(by) {
                    // Several in a row are one factor, their product.
                    *scale /= by;
                    if ![by, *scale].iter().all(|factor| (1e-30..=1e30).contains(factor)) {
                        return Err(format!("{name} is {value:.40?}, expected a factor from 1e-30 to 1e30"));
                    }
                }
            }
            _ => {}
        }
    }
    let (text, rest) = line(rest)?;
    let wrong = || format!("the size is {text:.40?}, expected for example -Y 512 +X 1024");
    let &[first, lines, second, length] = text.split_whitespace().collect::<Vec<_>>().as_slice() else {
        return Err(wrong());
    };
    let [Ok(lines), Ok(length)] = [lines, length].map(str::parse::<u32>) else { return Err(wrong()) };
    let (by_columns, across, down) = match (first.as_bytes(), second.as_bytes()) {
        ([down, b'Y'], [across, b'X']) => (false, *across, *down),
        ([across, b'X'], [down, b'Y']) => (true, *across, *down),
        _ => return Err(wrong()),
    };
    if ![across, down].iter().all(|sign| b"+-".contains(sign)) {
        return Err(wrong());
    }
    // +Y is up.
    let mirrored = [across == b'-', down == b'+'];
    Ok((Header { scale, lines: lines as usize, length: length as usize, by_columns, mirrored }, rest))
}

/// The text up to the end of a line, and the bytes after it. Comments are in any encoding.
fn line(bytes: &[u8]) -> Result<(Cow<'_, str>, &[u8]), String> {
    let end = bytes.iter().take(LONGEST_LINE).position(|&byte| byte == b'\n');
    let end = end.ok_or("the header does not end")?;
    let text = bytes[..end].strip_suffix(b"\r").unwrap_or(&bytes[..end]);
    Ok((String::from_utf8_lossy(text), &bytes[end + 1..]))
}

/// Fills a row of pixels from the start of `bytes`, and gives the bytes after it; `None` where they are broken.
fn fill<'a>(row: &mut [[u8; 4]], bytes: &'a [u8]) -> Option<&'a [u8]> {
    match bytes {
        [2, 2, high, low, rest @ ..] if *high < 128 && BY_CHANNEL.contains(&row.len()) => {
            (usize::from(u16::from_be_bytes([*high, *low])) == row.len()).then_some(())?;
            by_channel(row, rest)
        }
        _ => by_pixel(row, bytes),
    }
}

/// Channel by channel: runs of one value, and values as they are.
fn by_channel<'a>(row: &mut [[u8; 4]], mut bytes: &'a [u8]) -> Option<&'a [u8]> {
    for channel in 0..4 {
        let mut x = 0;
        while x < row.len() {
            let (&code, rest) = bytes.split_first()?;
            let is_run = code > 128;
            let count = usize::from(if is_run { code - 128 } else { code });
            let (values, rest) = rest.split_at_checked(if is_run { 1 } else { count })?;
            let pixels = row.get_mut(x..x + count).filter(|_| count > 0)?;
            for (i, pixel) in pixels.iter_mut().enumerate() {
                pixel[channel] = values[if is_run { 0 } else { i }];
            }
            x += count;
            bytes = rest;
        }
    }
    Some(bytes)
}

/// Pixel by pixel; the mantissas 1 1 1 repeat the pixel before as often as the exponent says. Several such in a row are
/// the digits of a larger number, the last one first.
fn by_pixel<'a>(row: &mut [[u8; 4]], mut bytes: &'a [u8]) -> Option<&'a [u8]> {
    let (mut x, mut digit) = (0, 0);
    while x < row.len() {
        let (&pixel, rest) = bytes.split_first_chunk::<4>()?;
        bytes = rest;
        if let [1, 1, 1, count] = pixel {
            let count = usize::from(count).checked_shl(digit)?;
            let before = *row.get(x.checked_sub(1)?)?;
            row.get_mut(x..x.checked_add(count)?)?.fill(before);
            x += count;
            digit += 8;
            if digit > 24 {
                return None;
            }
        } else {
            row[x] = pixel;
            (x, digit) = (x + 1, 0);
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use ::image::Rgb;
    use ::image::codecs::hdr::HdrEncoder;

    use super::*;

    /// Some pixels of a smooth and a noisy picture.
    fn pixel(i: u32) -> [f32; 3] {
        let noise = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 24) as f32;
        if i % 50 < 20 { [3.0, 0.25, 0.0] } else { [noise(3 * i) * 1e3, noise(3 * i + 1), noise(3 * i + 2) * 1e-3] }
    }

    /// What another program writes.
    fn encoded(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        let pixels: Vec<_> = (0..width * height).map(|i| Rgb(pixel(i))).collect();
        HdrEncoder::new(&mut bytes).encode(&pixels, width as usize, height as usize).unwrap();
        bytes
    }

    #[test]
    fn pictures_of_another_program_are_read() {
        // Rows of 7 pixels are stored pixel by pixel, those of 130 channel by channel.
        for (width, height) in [(130, 65), (7, 3), (1, 1)] {
            let bytes = encoded(width, height);
            let picture = decode(&bytes).unwrap();
            assert_eq!((picture.width, picture.height), (width, height));
            for (i, got) in (0..).zip(&picture.rgba) {
                let want = pixel(i);
                // 8 bits of the largest channel.
                let step = want.iter().copied().fold(0.0, f32::max) / 127.0;
                assert!((0..3).all(|c| (got[c] - want[c]).abs() <= step), "pixel {i}: {got:?}, not {want:?}");
                assert_eq!(got[3], 1.0);
            }
            assert!(is_whole(&bytes) && !is_whole(&[&bytes[..], b"x"].concat()));
            for length in 0..bytes.len() {
                assert!(decode(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
            }
        }
    }

    fn file(header: &str, pixels: &[u8]) -> Vec<u8> {
        [b"#?RADIANCE\n", header.as_bytes(), b"\n", pixels].concat()
    }

    /// Three pixels in a row of 3 x 1 or a column: 1, 2 and 4.
    const THREE: [u8; 12] = [128, 128, 128, 129, 128, 128, 128, 130, 128, 128, 128, 131];

    #[test]
    fn all_orders_of_rows_and_columns() {
        let red = |size: &str| {
            let picture = decode(&file(&format!("FORMAT=32-bit_rle_rgbe\n\n{size}"), &THREE)).unwrap();
            (picture.width, picture.height, picture.rgba.iter().map(|pixel| pixel[0]).collect::<Vec<_>>())
        };
        assert_eq!(red("-Y 1 +X 3"), (3, 1, vec![1.0, 2.0, 4.0]));
        assert_eq!(red("+Y 1 -X 3"), (3, 1, vec![4.0, 2.0, 1.0]));
        assert_eq!(red("-Y 3 +X 1"), (1, 3, vec![1.0, 2.0, 4.0]));
        assert_eq!(red("+Y 3 +X 1"), (1, 3, vec![4.0, 2.0, 1.0]));
        assert_eq!(red("+X 3 -Y 1"), (3, 1, vec![1.0, 2.0, 4.0]));
        assert_eq!(red("-X 3 +Y 1"), (3, 1, vec![4.0, 2.0, 1.0]));
        assert_eq!(red("+X 1 +Y 3"), (1, 3, vec![4.0, 2.0, 1.0]));
    }

    #[test]
    fn exposures_are_taken_back() {
        let of = |lines: &str| decode(&file(&format!("{lines}\n\n-Y 1 +X 3"), &THREE)).map(|p| p.rgba[1]);
        assert_eq!(of("EXPOSURE=4\nEXPOSURE= 0.5\n# a remark"), Ok([1.0, 1.0, 1.0, 1.0]));
        assert_eq!(of("COLORCORR=1 2 4"), Ok([2.0, 1.0, 0.5, 1.0]));
        // A comment in Latin-1.
        let latin = [b"#?RADIANCE\n# caf\xe9\n\n-Y 1 +X 3\n", &THREE[..]].concat();
        assert_eq!(decode(&latin).map(|picture| picture.rgba[1]), Ok([2.0, 2.0, 2.0, 1.0]));
        for wrong in [
            "EXPOSURE=1e-30\nEXPOSURE=1e-30",
            "EXPOSURE=0",
            "EXPOSURE=-1",
            "EXPOSURE=nan",
            "EXPOSURE=inf",
            "EXPOSURE=1 2",
            "COLORCORR=1 1",
        ] {
            assert!(of(wrong).unwrap_err().contains("expected a factor from"), "{wrong}");
        }
        assert!(of("FORMAT=32-bit_rle_xyze").unwrap_err().starts_with("FORMAT is \"32-bit_rle_xyze\""));
    }

    #[test]
    fn older_runs_are_read_and_broken_ones_refused() {
        let of = |size: &str, pixels: &[u8]| decode(&file(&format!("\n{size}"), pixels));
        let run = [128, 128, 128, 129, 1, 1, 1, 3, 1, 1, 1, 1];
        // One pixel, and 3 + 256 like it.
        let picture = of("-Y 1 +X 260", &run).unwrap();
        assert!(picture.rgba.iter().all(|pixel| pixel[0] == 1.0));
        let broken = "row 0 of the pixels is broken or cut short";
        // A run before any pixel, one that is too long, and one that never advances.
        assert_eq!(of("-Y 1 +X 4", &[1, 1, 1, 4]).unwrap_err(), broken);
        assert_eq!(of("-Y 1 +X 3", &run).unwrap_err(), broken);
        assert_eq!(of("-Y 1 +X 4", &[[128, 128, 128, 129], [1, 1, 1, 0]].concat()).unwrap_err(), broken);
        assert_eq!(of("-Y 1 +X 4", &[&[9, 9, 9, 9][..], &[1, 1, 1, 0].repeat(9)].concat()).unwrap_err(), broken);
        // Channel by channel: a length that is not the row's, a count of 0, and a run over its end.
        assert_eq!(of("-Y 1 +X 8", &[2, 2, 0, 9, 136, 1, 136, 1, 136, 1, 136, 1]).unwrap_err(), broken);
        assert_eq!(of("-Y 1 +X 8", &[2, 2, 0, 8, 0, 1, 136, 1, 136, 1, 136, 1]).unwrap_err(), broken);
        assert_eq!(of("-Y 1 +X 8", &[2, 2, 0, 8, 137, 1, 136, 1, 136, 1, 136, 1]).unwrap_err(), broken);
        for size in ["-Y 0 +X 0", "-Y 4000000000 +X 4000000000", "-Y 4096 +X 8192"] {
            let error = of(size, &THREE).unwrap_err();
            assert!(error.contains("the header"), "{size}: {error}");
        }
        for size in ["", "Y 1 +X 3", "-Y 1 +Y 3", "-Y x +X 3", "-Y 1 +X", "*Y 1 +X 3", "-Y -1 +X 3"] {
            assert!(of(size, &THREE).unwrap_err().starts_with("the size is"), "{size}");
        }
        assert_eq!(decode(b"#?").unwrap_err(), "the header does not end");
    }
}

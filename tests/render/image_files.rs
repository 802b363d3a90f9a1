//! Picture files: what they hold, that it comes back, that it repeats, and that damaged files are refused.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::path::{Path, PathBuf};

use proptest::prelude::*;
use splatblur::film::{Aov, Layer, Picture};
use splatblur::image::{self, Bits, Compression, Exr, Format, ImageError, Precision};

const RGB8: Format = Format::Png { bits: Bits::Eight, alpha: false };
const RGBA8: Format = Format::Png { bits: Bits::Eight, alpha: true };
const RGBA16: Format = Format::Png { bits: Bits::Sixteen, alpha: true };

fn picture(width: u32, height: u32, rgba: Vec<[f32; 4]>) -> Picture {
    Picture { width, height, rgba, layers: Vec::new() }
}

/// Every value a different one, with the odd ones that an exact format must keep.
fn rich() -> Picture {
    let (width, height) = (19_u32, 37_u32); // three ZIP blocks, the last one short
    let n = (width * height) as usize;
    let value = |i: usize| ((i * 2_654_435_761) % 10_007) as f32 / 997.0 - 1.0;
    let rgba = (0..n).map(|i| [value(4 * i), value(4 * i + 1), value(4 * i + 2), value(4 * i + 3)]).collect();
    let layers = Aov::ALL
        .into_iter()
        .map(|aov| {
            let planes = (0..aov.channels().len())
                .map(|c| (0..n).map(|i| value(i + 7919 * (c + 3 * aov.name().len()))).collect());
            Layer { aov, planes: planes.collect(), names: Vec::new() }
        })
        .collect();
    let mut picture = Picture { width, height, rgba, layers };
    picture.rgba[5] = [-0.0, f32::MIN_POSITIVE / 8.0, f32::MAX, 1e-30];
    picture.layers[1].planes[0][3] = f32::INFINITY;
    picture
}

/// The pixels of a PNG file, by the `image` crate's own reader.
fn pixels16(bytes: &[u8]) -> (::image::ColorType, Vec<u16>) {
    let decoded = ::image::load_from_memory_with_format(bytes, ::image::ImageFormat::Png).unwrap();
    (decoded.color(), decoded.to_rgba16().into_raw())
}

fn pixels8(bytes: &[u8]) -> (::image::ColorType, Vec<u8>) {
    let decoded = ::image::load_from_memory_with_format(bytes, ::image::ImageFormat::Png).unwrap();
    (decoded.color(), decoded.to_rgba8().into_raw())
}

/// The nearest sRGB code of linear light, by searching all codes with the decoding formula of IEC 61966-2-1.
fn nearest_code(linear: f64, top: u32) -> u32 {
    let decode = |code: f64| {
        let e = code / f64::from(top);
        if e <= 0.04045 { e / 12.92 } else { ((e + 0.055) / 1.055).powf(2.4) }
    };
    // The boundary between two codes lies half way between them, in the encoded value.
    (0..top).find(|&code| linear < decode(f64::from(code) + 0.5)).unwrap_or(top)
}

#[test]
fn png_holds_the_nearest_srgb_codes() {
    let values: Vec<f32> = (0..300).map(|i| i as f32 / 280.0 - 0.02).collect();
    let bytes = image::encode(&picture(300, 1, values.iter().map(|&v| [v, v, v, 1.0]).collect()), RGB8, "").unwrap();
    let (colour, codes) = pixels8(&bytes);
    assert_eq!(colour, ::image::ColorType::Rgb8);
    for (v, code) in values.iter().zip(codes.chunks(4)) {
        assert_eq!(u32::from(code[1]), nearest_code(f64::from(*v), 255), "linear {v}");
    }
    // By hand: half of the light is code 188, a fifth is 124.
    let bytes = image::encode(&picture(2, 1, vec![[0.5, 0.2, 0.0, 1.0], [1.0, 7.0, -3.0, 1.0]]), RGB8, "").unwrap();
    assert_eq!(pixels8(&bytes).1, [188, 124, 0, 255, 255, 255, 0, 255]);
}

#[test]
fn png_of_16_bits_holds_the_nearest_codes() {
    let linear = [0.001_f32, 0.003_130_8, 0.25, 0.731];
    let bytes = image::encode(&picture(4, 1, linear.map(|v| [v, v, v, 1.0]).to_vec()), RGBA16, "").unwrap();
    let (colour, codes) = pixels16(&bytes);
    assert_eq!(colour, ::image::ColorType::Rgba16);
    for (v, code) in linear.iter().zip(codes.chunks(4)) {
        let want = nearest_code(f64::from(*v), 65_535);
        assert!(u32::from(code[0]).abs_diff(want) <= 1, "linear {v}: {} or {want}", code[0]);
        assert_eq!(code[3], 65_535);
    }
}

#[test]
fn png_alpha_is_straight_and_divided_out_in_linear_light() {
    // Premultiplied 0.25 under alpha 0.5 is light 0.5, code 188; dividing the encoded value would give 255 or 137.
    let source = picture(3, 1, vec![[0.25, 0.1, 0.0, 0.5], [0.0; 4], [0.5, 0.5, 0.5, 1.0]]);
    let (colour, codes) = pixels8(&image::encode(&source, RGBA8, "").unwrap());
    assert_eq!(colour, ::image::ColorType::Rgba8);
    assert_eq!(codes, [188, 124, 0, 128, 0, 0, 0, 0, 188, 188, 188, 255]);
    let (_, codes) = pixels16(&image::encode(&source, RGBA16, "").unwrap());
    assert_eq!(codes[..4], [48_192_u16, 31_754, 0, 32_768]);
    assert_eq!(u32::from(codes[0]), nearest_code(0.5, 65_535));
    assert_eq!(u32::from(codes[1]), nearest_code(f64::from(0.1_f32 / 0.5), 65_535));
}

#[test]
fn png_comes_back_as_linear_premultiplied() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.png");
    let source = picture(2, 2, vec![[0.25, 0.1, 0.0, 0.5], [0.0; 4], [0.5, 0.2, 0.9, 1.0], [0.1; 4]]);
    image::write(&path, &source, RGBA16, "{}").unwrap();
    let back = image::read(&path).unwrap();
    assert_eq!((back.width, back.height), (2, 2));
    for (a, b) in source.rgba.iter().flatten().zip(back.rgba.iter().flatten()) {
        assert!((a - b).abs() < 3e-5, "{a} came back as {b}");
    }
}

#[test]
fn exr_comes_back_bit_for_bit_with_layers() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let source = rich();
    image::write(&path, &source, Format::EXR, "{}").unwrap();
    let back = image::read(&path).unwrap();
    let bits = |p: &Picture| {
        let colour = p.rgba.iter().flatten().map(|v| v.to_bits());
        let planes = p.layers.iter().flat_map(|l| l.planes.iter().flatten()).map(|v| v.to_bits());
        colour.chain(planes).collect::<Vec<_>>()
    };
    assert_eq!((back.width, back.height), (19, 37));
    assert_eq!(back.layers.iter().map(|l| l.aov).collect::<Vec<_>>(), Aov::ALL);
    assert_eq!(bits(&back), bits(&source));
}

#[test]
fn exr_is_what_other_programs_expect() {
    use ::exr::prelude::*;
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let source = rich();
    image::write(&path, &source, Format::EXR, "the settings").unwrap();
    let meta = MetaData::read_from_file(&path, true).unwrap();
    assert_eq!(meta.headers.len(), 1, "one part");
    let header = &meta.headers[0];
    assert_eq!(header.compression, Compression::ZIP16);
    let names: Vec<_> = header.channels.list.iter().map(|c| c.name.to_string()).collect();
    let want = "A B G R alpha.A depth.Z normal.X normal.Y normal.Z samples.N velocity.X velocity.Y";
    assert_eq!(names.join(" "), want);
    assert!(header.channels.list.iter().all(|c| c.sample_type == SampleType::F32));
    assert!(header.shared_attributes.chromaticities.is_some());
    assert!(header.own_attributes.capture_date.is_none());
    // Plain RGBA readers see the colours.
    let read = read_first_rgba_layer_from_file(
        &path,
        |size, _| vec![[0.0_f32; 4]; size.area()],
        |pixels: &mut Vec<[f32; 4]>, at, (r, g, b, a): (f32, f32, f32, f32)| {
            pixels[at.y() * 19 + at.x()] = [r, g, b, a];
        },
    )
    .unwrap();
    assert_eq!(read.layer_data.channel_data.pixels, source.rgba);
}

/// Every compression gives the same numbers back, in either precision, and so it is for a picture of one colour, which
/// takes least space.
#[test]
fn exr_keeps_values_in_all_compressions() {
    use ::exr::prelude::f16;
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let mut rich = rich();
    rich.rgba[5][2] = 65504.0;
    let flat = picture(2048, 256, vec![[0.25, 0.5, 1.0, 1.0]; 2048 * 256]);
    for source in [&rich, &flat] {
        for (name, compression) in Compression::ALL {
            let options = Exr { precision: Precision::Float, compression };
            image::write(&path, source, Format::Exr(options), "").unwrap();
            assert_eq!(&image::read(&path).unwrap(), source, "{name}");
            assert!(image::encode(source, Format::Exr(options), "").unwrap() == std::fs::read(&path).unwrap());
            image::write(&path, source, Format::Exr(Exr { precision: Precision::Half, compression }), "").unwrap();
            let back = image::read(&path).unwrap();
            let rounded = |v: f32| f16::from_f32(v).to_f32();
            assert!(back.rgba.iter().zip(&source.rgba).all(|(a, b)| *a == b.map(rounded)), "{name}");
            for (a, b) in back.layers.iter().zip(&source.layers) {
                let kept = |v: f32| if matches!(a.aov, Aov::Depth | Aov::Samples) { v } else { rounded(v) };
                assert!(
                    a.planes.iter().flatten().zip(b.planes.iter().flatten()).all(|(a, b)| *a == kept(*b)),
                    "{name}"
                );
            }
        }
    }
    let mut bright = picture(3, 2, vec![[0.5; 4]; 6]);
    bright.rgba[4][1] = 65520.0;
    let half = Format::Exr(Exr { precision: Precision::Half, ..Exr::default() });
    let error = image::encode(&bright, half, "").unwrap_err().to_string();
    assert!(error.contains("`G` is 65520 at pixel (1, 1)") && error.contains("65504"), "{error}");
    bright.rgba[4][1] = 65519.0;
    assert!(image::encode(&bright, half, "").is_ok());
}

#[test]
fn exr_headers_say_what_layers_hold() {
    use ::exr::prelude::*;
    let bytes = image::encode(&rich(), Format::EXR, "").unwrap();
    let meta = MetaData::read_from_buffered(&bytes[..], true).unwrap();
    let header = &meta.headers[0];
    let attributes = header.own_attributes.other.iter().chain(&header.shared_attributes.other);
    let layers: Vec<_> = attributes.filter(|(name, _)| (*name).eq("layers")).map(|(_, value)| value).collect();
    let [AttributeValue::Text(text)] = layers[..] else { panic!("{layers:?}") };
    let said: serde_json::Value = serde_json::from_str(&text.to_string()).unwrap();
    assert_eq!(said.as_object().unwrap().len(), Aov::ALL.len());
    for aov in Aov::ALL {
        assert_eq!(said[aov.name()], aov.meaning());
    }
    assert!(said["velocity"].as_str().unwrap().contains("pixels a shutter, x right, y down"));
}

#[test]
fn settings_come_back() {
    let dir = tempfile::tempdir().unwrap();
    let text = "{\"scene\":\"Würfel → 3\",\"long\":\"".to_owned() + &"x".repeat(5000) + "\"}";
    for (name, format) in [("a.png", RGB8), ("b.png", RGBA16), ("c.exr", Format::EXR)] {
        let path = dir.path().join(name);
        image::write(&path, &picture(2, 1, vec![[0.5; 4]; 2]), format, &text).unwrap();
        assert_eq!(image::read_settings(&path).as_deref(), Some(text.as_str()), "{name}");
        assert_eq!(image::read(&path).unwrap().rgba.len(), 2, "{name}");
    }
    let plain = dir.path().join("plain.png");
    ::image::RgbImage::new(2, 2).save(&plain).unwrap();
    assert_eq!(image::read_settings(&plain), None);
    assert_eq!(image::read_settings(&dir.path().join("none.png")), None);
    assert_eq!(image::read_settings(dir.path()), None);
}

#[test]
fn damaged_settings_are_not_believed() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.png");
    let mut bytes = image::encode(&picture(2, 1, vec![[0.5; 4]; 2]), RGB8, "frame 7").unwrap();
    let at = bytes.windows(7).position(|w| w == b"frame 7").unwrap();
    bytes[at + 6] = b'8';
    std::fs::write(&path, bytes).unwrap();
    assert_eq!(image::read_settings(&path), None);
}

#[test]
fn bytes_repeat() {
    let mut colour_only = rich();
    colour_only.layers.clear();
    for (source, format) in [(&colour_only, RGB8), (&colour_only, RGBA16), (&rich(), Format::EXR)] {
        let first = image::encode(source, format, "{\"a\":1}").unwrap();
        for _ in 0..5 {
            assert!(image::encode(source, format, "{\"a\":1}").unwrap() == first, "{format:?}");
        }
    }
}

#[test]
fn invalid_pictures_are_refused_by_type() {
    let good = || picture(2, 1, vec![[0.5; 4]; 2]);
    let error = |p: &Picture, format| image::encode(p, format, "").unwrap_err();
    assert!(matches!(error(&picture(0, 1, vec![]), RGB8), ImageError::Size { width: 0, .. }));
    assert!(matches!(error(&picture(70_000, 1, vec![]), RGB8), ImageError::Size { .. }));
    assert!(matches!(error(&picture(2, 1, vec![[0.0; 4]]), RGB8), ImageError::Length { found: 1, expected: 2, .. }));
    let mut p = good();
    p.rgba[1][2] = f32::NAN;
    assert_eq!(error(&p, Format::EXR).to_string(), "picture channel `B` is NaN at pixel (1, 0)");
    p.rgba[1][2] = f32::INFINITY;
    assert!(matches!(error(&p, RGB8), ImageError::NotFinite { .. }));
    let layer = |planes| Layer { aov: Aov::Velocity, planes, names: Vec::new() };
    p = good();
    p.layers = vec![layer(vec![vec![0.0; 2]; 2])];
    assert!(matches!(error(&p, RGB8), ImageError::PngLayer { layer: "velocity" }));
    p.layers = vec![layer(vec![vec![0.0; 2]])];
    assert!(matches!(error(&p, Format::EXR), ImageError::Layer { .. }));
    p.layers = vec![layer(vec![vec![0.0; 2]; 2]); 2];
    assert!(matches!(error(&p, Format::EXR), ImageError::Layer { .. }));
    p.layers = vec![layer(vec![vec![0.0; 3]; 2])];
    assert!(matches!(error(&p, Format::EXR), ImageError::Length { .. }));
    p.layers = vec![layer(vec![vec![f32::NAN; 2]; 2])];
    assert!(matches!(error(&p, Format::EXR), ImageError::NotFinite { .. }));
}

#[test]
fn nothing_is_left_where_nothing_could_be_written() {
    let dir = tempfile::tempdir().unwrap();
    let target = dir.path().join("a.png");
    std::fs::create_dir(&target).unwrap();
    let error = image::write(&target, &picture(1, 1, vec![[0.5; 4]]), RGB8, "").unwrap_err();
    assert!(matches!(error, ImageError::Write { .. }), "{error}");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
fn what_is_not_a_picture_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |path: &Path| image::read(path).unwrap_err().to_string();
    assert!(refused(&dir.path().join("none.png")).starts_with("cannot read"));
    assert!(refused(dir.path()).starts_with("cannot read"));
    let text = dir.path().join("text.png");
    std::fs::write(&text, "not a picture").unwrap();
    assert!(refused(&text).ends_with("neither a PNG, an EXR nor a Radiance HDR file"));
    // A small file that promises 65535 x 65535 pixels: refused before memory is taken.
    let mut bytes = image::encode(&picture(1, 1, vec![[0.5; 4]]), RGBA16, "").unwrap();
    bytes[16..24].copy_from_slice(&[0, 0, 255, 255, 0, 0, 255, 255]);
    let crc = crc32fast::hash(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&crc.to_be_bytes());
    let huge = dir.path().join("huge.png");
    std::fs::write(&huge, bytes).unwrap();
    assert!(refused(&huge).contains("the header promises"), "{}", refused(&huge));
}

/// A black PNG whose pixels shrink a thousandfold must not take a thousand times its own size.
#[test]
fn a_small_file_of_very_many_pixels_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("bomb.png");
    let side = 8000_u32;
    let file = std::fs::File::create(&path).unwrap();
    let black = vec![0; side as usize * side as usize * 3];
    let encoder = ::image::codecs::png::PngEncoder::new(file);
    ::image::ImageEncoder::write_image(encoder, &black, side, side, ::image::ExtendedColorType::Rgb8).unwrap();
    // The pixels are dropped first: a failure would print them all.
    let error = image::read(&path).map(drop).unwrap_err().to_string();
    assert!(error.contains("1024000000 bytes of pixels from a file of"), "{error}");
    assert!(error.contains("expected at most 536870912"), "{error}");
}

/// Files to damage.
fn specimens() -> Vec<Vec<u8>> {
    let mut small = rich();
    small.layers.clear();
    vec![
        image::encode(&small, RGB8, "{\"frame\":1}").unwrap(),
        image::encode(&small, RGBA16, "").unwrap(),
        image::encode(&rich(), Format::EXR, "{\"frame\":1}").unwrap(),
    ]
}

/// All are written before one is read: a file is opened when it has been at rest for a while.
fn read_all(files: &[Vec<u8>]) -> Vec<Result<Picture, ImageError>> {
    let dir = tempfile::tempdir().unwrap();
    let paths: Vec<PathBuf> = (0..files.len()).map(|number| dir.path().join(format!("damaged-{number}"))).collect();
    for (path, bytes) in paths.iter().zip(files) {
        std::fs::write(path, bytes).unwrap();
    }
    let read = |path: &PathBuf| {
        let _ = image::read_settings(path);
        image::read(path)
    };
    paths.iter().map(read).collect()
}

/// Files of a case: 400 in all.
const TOGETHER: usize = 20;

proptest! {
    #![proptest_config(ProptestConfig { cases: 20, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn truncated_files_are_errors(cuts in prop::collection::vec((0..3_usize, 0.0..1.0_f64), TOGETHER)) {
        let specimens = specimens();
        let cut = |&(which, share): &(usize, f64)| {
            let bytes = &specimens[which];
            bytes[..(bytes.len() as f64 * share) as usize].to_vec()
        };
        let files: Vec<Vec<u8>> = cuts.iter().map(cut).collect();
        for (read, (bytes, &(which, _))) in read_all(&files).iter().zip(files.iter().zip(&cuts)) {
            // A PNG whose last chunk alone is cut may still be whole as a picture.
            if which == 2 || bytes.len() + 16 < specimens[which].len() {
                prop_assert!(read.is_err(), "specimen {}, {} bytes", which, bytes.len());
            }
        }
    }

    #[test]
    fn changed_files_never_panic(
        all in prop::collection::vec((0..3_usize, prop::collection::vec((any::<u32>(), any::<u8>()), 1..6)), TOGETHER),
    ) {
        let specimens = specimens();
        let changed = |(which, changes): (usize, Vec<(u32, u8)>)| {
            let mut bytes = specimens[which].clone();
            let length = bytes.len();
            for (at, value) in changes {
                // Half of the changes hit the header, where lengths and counts are.
                let at = if at & 1 == 0 { at as usize % length } else { at as usize % 400 };
                bytes[at] = value;
            }
            bytes
        };
        let files: Vec<Vec<u8>> = all.into_iter().map(changed).collect();
        for picture in read_all(&files).into_iter().flatten() {
            prop_assert_eq!(picture.rgba.len(), picture.width as usize * picture.height as usize);
        }
    }

    #[test]
    fn noise_after_a_signature_never_panics(
        all in prop::collection::vec((any::<bool>(), prop::collection::vec(any::<u8>(), 0..300)), TOGETHER),
    ) {
        let noisy = |(exr, noise): (bool, Vec<u8>)| {
            let mut bytes = if exr { vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0] } else { b"\x89PNG\r\n\x1a\n".to_vec() };
            bytes.extend(noise);
            bytes
        };
        let files: Vec<Vec<u8>> = all.into_iter().map(noisy).collect();
        prop_assert!(read_all(&files).iter().all(Result::is_err));
    }
}

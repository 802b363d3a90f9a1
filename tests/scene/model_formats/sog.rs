//! SOG: every field against values computed by hand, archives and pictures that lie.

use std::collections::BTreeMap;
use std::io::{Cursor, Write as _};
use std::time::{Duration, Instant};

use glam::{Quat, Vec3};
use image::ExtendedColorType;
use image::codecs::webp::WebPEncoder;
use serde_json::{Value, json};
use splatblur::model::{Gaussians, ModelFormat, parse_capture};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::support::{load_as, refused};
use crate::support::gaussians;

fn webp(width: u32, height: u32, pixels: &[[u8; 4]]) -> Vec<u8> {
    let mut data: Vec<u8> = pixels.as_flattened().to_vec();
    data.resize((4 * width * height) as usize, 77);
    let mut bytes = Vec::new();
    WebPEncoder::new_lossless(&mut bytes).encode(&data, width, height, ExtendedColorType::Rgba8).unwrap();
    bytes
}

/// A file in the making: its metadata and its other entries.
#[derive(Clone)]
struct Sog {
    meta: Value,
    files: BTreeMap<String, Vec<u8>>,
}

impl Sog {
    /// Three Gaussians in pictures of 2 by 2.
    fn new() -> Self {
        let mut codes = vec![0.0; 256];
        (codes[0], codes[1], codes[9], codes[255]) = (-1.0, 0.5, 2.0, 4.0);
        let meta = json!({
            "version": 2,
            "asset": { "generator": "by hand" },
            "count": 3,
            "means": { "mins": [-1.0, 0.0, 2.0], "maxs": [1.0, 0.5, 2.0], "files": ["low.webp", "high.webp"] },
            "scales": { "codebook": codes, "files": ["scales.webp"] },
            "quats": { "files": ["quats.webp"] },
            "sh0": { "codebook": codes, "files": ["sh0.webp"] },
        });
        // Shares 0, 65535 and 13107 (a fifth); 13107 = 51 + 256 51.
        let means = webp(2, 2, &[[0, 255, 51, 255], [255, 0, 51, 255], [51, 51, 51, 255]]);
        let files = [
            ("low.webp", means.clone()),
            ("high.webp", means),
            ("scales.webp", webp(2, 2, &[[0, 1, 9, 255], [255, 3, 3, 255], [1, 1, 1, 255]])),
            ("quats.webp", webp(2, 2, &[[255, 0, 51, 252], [204, 102, 51, 253], [204, 102, 51, 255]])),
            ("sh0.webp", webp(2, 2, &[[0, 1, 9, 255], [255, 3, 3, 51], [1, 1, 1, 0]])),
        ];
        Self { meta, files: files.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect() }
    }

    /// With harmonics of this degree: 70 sets, of which the Gaussians have the first, the last, and the last again.
    fn with_harmonics(degree: u32) -> Self {
        let mut sog = Self::new();
        let each = ((degree + 1) * (degree + 1) - 1) as usize;
        let codes: Vec<f64> = (0..256).map(|k| f64::from(k) / 100.0).collect();
        sog.meta["shN"] =
            json!({ "count": 70, "bands": degree, "codebook": codes, "files": ["sets.webp", "labels.webp"] });
        let set = |number: usize| (0..each).map(move |k| [number as u8, k as u8, (100 + k) as u8, 255]);
        // The second row begins with set 64; what lies right of set 69 means nothing.
        let sets: Vec<_> = (0..70).flat_map(set).collect();
        sog.files.insert("sets.webp".to_owned(), webp(64 * each as u32, 2, &sets));
        sog.files.insert("labels.webp".to_owned(), webp(2, 2, &[[0, 0, 0, 255], [69, 0, 0, 255], [69, 0, 9, 255]]));
        sog
    }

    fn bytes_with(&self, method: CompressionMethod) -> Vec<u8> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        let options = SimpleFileOptions::default().compression_method(method);
        zip.start_file("meta.json", options).unwrap();
        zip.write_all(self.meta.to_string().as_bytes()).unwrap();
        for (name, bytes) in &self.files {
            zip.start_file(name.as_str(), options).unwrap();
            zip.write_all(bytes).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }

    fn bytes(&self) -> Vec<u8> {
        self.bytes_with(CompressionMethod::Stored)
    }

    fn set(mut self, pointer: &str, value: Value) -> Self {
        *self.meta.pointer_mut(pointer).unwrap() = value;
        self
    }

    fn file(mut self, name: &str, bytes: Vec<u8>) -> Self {
        self.files.insert(name.to_owned(), bytes);
        self
    }
}

fn capture(bytes: &[u8]) -> Gaussians {
    parse_capture(bytes, ModelFormat::Sog).unwrap().unwrap()
}

#[test]
fn each_field() {
    let c = capture(&Sog::new().bytes());
    assert_eq!((c.len(), c.degree, c.dropped, c.harmonics.len()), (3, 0, 0, 0));
    let unlog = |v: f64| ((v.abs().exp() - 1.0) * v.signum()) as f32;
    let z = unlog(2.0);
    let expected =
        [Vec3::new(unlog(-1.0), unlog(0.5), z), Vec3::new(unlog(1.0), 0.0, z), Vec3::new(unlog(-0.6), unlog(0.1), z)];
    for (found, expected) in c.position.iter().zip(expected) {
        assert!(found.abs_diff_eq(expected, 1e-6), "{found} instead of {expected}");
    }
    let e = |v: f32| v.exp();
    assert!(c.sigma[0].abs_diff_eq(Vec3::new(e(-1.0), e(0.5), e(2.0)), 1e-5), "{}", c.sigma[0]);
    assert!(c.sigma[1].abs_diff_eq(Vec3::new(e(4.0), 1.0, 1.0), 1e-5), "{}", c.sigma[1]);
    assert_eq!(c.base, [Vec3::new(-1.0, 0.5, 2.0), Vec3::new(4.0, 0.0, 0.0), Vec3::splat(0.5)]);
    assert_eq!(c.opacity, [1.0, 0.2, 0.0]);
    // Bytes 204, 102 and 51 are 0.6, -0.2 and -0.6 of the root of a half; 0.62 is left for the other one.
    let root = 0.5_f32.sqrt();
    let [a, b, d, rest] = [0.6 * root, -0.2 * root, -0.6 * root, 0.62_f32.sqrt()];
    // 1, -1 and -0.6 are longer than one: the component that is left out is 0.
    let long = Quat::from_xyzw(root, -root, -0.6 * root, 0.0).normalize();
    let expected = [long, Quat::from_xyzw(rest, b, d, a), Quat::from_xyzw(b, d, rest, a)];
    for (found, expected) in c.rotation.iter().zip(expected) {
        assert!(found.abs_diff_eq(expected, 1e-6), "{found} instead of {expected}");
    }
}

#[test]
fn stored_and_deflated_entries_are_the_same() {
    let sog = Sog::with_harmonics(2);
    assert_eq!(capture(&sog.bytes()), capture(&sog.bytes_with(CompressionMethod::Deflated)));
}

#[test]
fn harmonics_from_the_palette() {
    for (degree, each) in [(1, 3), (2, 8), (3, 15)] {
        let c = capture(&Sog::with_harmonics(degree).bytes());
        assert_eq!((u32::from(c.degree), c.harmonics_each()), (degree, each));
        for (index, set) in [0.0_f32, 69.0, 69.0].into_iter().enumerate() {
            for k in 0..each {
                let expected = Vec3::new(set, k as f32, (100 + k) as f32) / 100.0;
                let found = c.harmonics[index * each + k];
                assert!(found.abs_diff_eq(expected, 1e-6), "{degree} {index} {k}: {found} instead of {expected}");
            }
        }
    }
    // A label beyond the sets, in its second byte.
    let labels = webp(2, 2, &[[0, 1, 0, 255], [70, 0, 0, 255], [1, 0, 0, 255]]);
    let c = capture(&Sog::with_harmonics(1).file("labels.webp", labels).bytes());
    assert_eq!(c.notes, ["2 Gaussians name harmonics that the file does not have (taken as none)"]);
    assert_eq!(c.harmonics[..6], [Vec3::ZERO; 6]);
    assert!(c.harmonics[6].abs_diff_eq(Vec3::new(0.01, 0.0, 1.0), 1e-6));
}

#[test]
fn pictures_without_alpha() {
    let mut rgb = Vec::new();
    let pixels = [0_u8, 255, 51, 255, 0, 51, 51, 51, 51, 0, 0, 0];
    WebPEncoder::new_lossless(&mut rgb).encode(&pixels, 2, 2, ExtendedColorType::Rgb8).unwrap();
    let sog = Sog::new().file("low.webp", rgb.clone()).file("high.webp", rgb);
    assert_eq!(capture(&sog.bytes()), capture(&Sog::new().bytes()));
}

#[test]
fn what_cannot_be_drawn_is_dropped_and_counted() {
    // Alpha 251 names no component.
    let quats = webp(2, 2, &[[1, 2, 3, 252], [1, 2, 3, 251], [1, 2, 3, 0]]);
    let c = capture(&Sog::new().file("quats.webp", quats).bytes());
    assert_eq!((c.len(), c.dropped), (1, 2));
    let c = capture(&Sog::new().set("/means/maxs", json!([1e300, 1.0, 2.0])).bytes());
    assert_eq!((c.len(), c.dropped), (1, 2));
}

#[test]
fn what_is_refused() {
    let mut older = Sog::new();
    older.meta.as_object_mut().unwrap().remove("version");
    let mut missing = Sog::new();
    missing.files.remove("quats.webp");
    let mut without = Sog::new();
    without.meta.as_object_mut().unwrap().remove("sh0");
    // The head of a lossy picture, 2 by 2.
    let lossy = b"RIFF\x16\0\0\0WEBPVP8 \x0a\0\0\0\x10\0\0\x9d\x01\x2a\x02\0\x02\0".to_vec();
    // The head of one with transparency, 2 by 2, whose chunk of alpha has an odd length.
    let extended = b"RIFF\x34\0\0\0WEBPVP8X\x0a\0\0\0\x10\0\0\0\x01\0\0\x01\0\0ALPH\x03\0\0\0\0\0\0\0\
        VP8 \x0a\0\0\0\x10\0\0\x9d\x01\x2a\x02\0\x02\0"
        .to_vec();
    let sh = |pointer: &str, value: Value| Sog::with_harmonics(1).set(pointer, value);
    for (sog, expected) in [
        (Sog::new().file("low.webp", lossy), "found lossy or animated WebP in `low.webp`, expected a lossless WebP"),
        (Sog::new().file("low.webp", extended), "found lossy or animated WebP in `low.webp`, expected a lossless WebP"),
        (older, "found an older SOG, whose meta.json has no version, expected version 2: convert it first"),
        (Sog::new().set("/version", json!(3)), "found SOG version `3`, expected 2 (in meta.json)"),
        (Sog::new().set("/version", json!("2")), "found SOG version `\\\"2\\\"`"),
        (Sog::new().set("/count", json!(-1)), "meta.json: invalid value: integer `-1`"),
        (Sog::new().set("/count", json!(4_000_000_000_u64)), "found 4000000000 Gaussians in "),
        (Sog::new().set("/count", json!(5)), "found 2 x 2 pixels in `low.webp`, expected at least 5 and at most "),
        (without, "meta.json: missing field `sh0`"),
        (missing, "no readable entry `quats.webp`"),
        (
            Sog::new().set("/scales/codebook", json!([1.0])),
            "found a codebook of 1 in scales of meta.json, expected 256",
        ),
        (Sog::new().set("/means/files/0", json!("../low.webp")), "found a file name `../low.webp` in meta.json"),
        (Sog::new().set("/means/files/0", json!("a\\low.webp")), "in meta.json, expected a plain name"),
        (Sog::new().set("/means/files/0", json!("a/low.webp")), "in meta.json, expected a plain name"),
        (Sog::new().set("/means/files/0", json!("")), "found a file name `` in meta.json, expected a plain name"),
        (Sog::new().file("low.webp", b"RIFF\x04\0\0\0WEBP".to_vec()), "found damaged WebP ("),
        (
            Sog::new().file("low.webp", webp(400, 400, &[])),
            "found 400 x 400 pixels in `low.webp`, expected at most 65542",
        ),
        (sh("/shN/bands", json!(4)), "found 4 bands of harmonics in meta.json, expected 1, 2 or 3"),
        (sh("/shN/bands", json!(2)), "found 192 x 2 pixels in `sets.webp`, expected 512 x 2 for the harmonics"),
        (sh("/shN/count", json!(129)), "found 192 x 2 pixels in `sets.webp`, expected 192 x 3 for the harmonics"),
        (sh("/shN/count", json!(65537)), "found 65537 sets of harmonics in meta.json, expected at most 65536"),
        (sh("/shN/codebook", json!([])), "found a codebook of 0 in shN of meta.json"),
    ] {
        let e = refused(&sog.bytes(), ModelFormat::Sog).to_string();
        assert!(e.contains(expected), "{e}\n  expected {expected}");
    }
}

#[test]
fn other_archives_are_refused_by_name() {
    let archive = |name: &str| {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        zip.start_file(name, SimpleFileOptions::default().compression_method(CompressionMethod::Stored)).unwrap();
        zip.write_all(b"{}").unwrap();
        zip.finish().unwrap().into_inner()
    };
    for (name, expected) in [
        ("lod-meta.json", "found a streamed SOG (lod-meta.json), expected a SOG capture with meta.json"),
        ("word.xml", "found a zip archive without meta.json, expected a SOG capture with meta.json"),
        ("meta.json", "found an older SOG"),
    ] {
        let e = refused(&archive(name), ModelFormat::Sog).to_string();
        assert!(e.contains(expected), "{e}");
    }
}

#[test]
fn every_truncation_is_refused() {
    let bytes = Sog::with_harmonics(1).bytes();
    capture(&bytes);
    for length in 0..bytes.len() {
        refused(&bytes[..length], ModelFormat::Sog);
    }
}

/// The checksums of an archive hide damage from its readers, so it is done before they are made.
#[test]
fn damaged_pictures_never_panic() {
    let sog = Sog::with_harmonics(1);
    for (name, picture) in &sog.files {
        for at in 12..picture.len().min(120) {
            for bit in 0..8 {
                let mut damaged = picture.clone();
                damaged[at] ^= 1 << bit;
                let _ = parse_capture(&sog.clone().file(name, damaged).bytes(), ModelFormat::Sog);
            }
        }
    }
}

#[test]
fn bombs_are_refused_before_they_are_inflated() {
    let start = Instant::now();
    // Zeros that deflate a thousandfold, as metadata and as a picture.
    let zeros = vec![0; 40 << 20];
    let sog = Sog::new().file("low.webp", zeros);
    let e = refused(&sog.bytes_with(CompressionMethod::Deflated), ModelFormat::Sog).to_string();
    assert!(e.contains("found an entry `low.webp` of 41943040 bytes, expected at most "), "{e}");
    let sog = Sog::new().set("/asset", json!("x".repeat(2 << 20)));
    let e = refused(&sog.bytes_with(CompressionMethod::Deflated), ModelFormat::Sog).to_string();
    assert!(e.contains("found an entry `meta.json` of "), "{e}");
    // One colour, 16383 by 16383: the sides less 1 stand in the 28 bits after the signature.
    let mut picture = webp(2, 2, &[[1, 2, 3, 4]; 4]);
    let at = picture.windows(5).position(|w| &w[..4] == b"VP8L").unwrap() + 9;
    picture[at..at + 4].copy_from_slice(&(1_u32 << 28 | 0x3ffe << 14 | 0x3ffe).to_le_bytes());
    let e = refused(&Sog::new().file("low.webp", picture).bytes(), ModelFormat::Sog).to_string();
    assert!(e.contains("found 16383 x 16383 pixels in `low.webp`, expected at most 65542 pixels"), "{e}");
    assert!(start.elapsed() < Duration::from_secs(2));
}

#[test]
fn content_and_extension_show_the_format() {
    let sog = Sog::new().set("/means/mins", json!([0.0, 0.0, 2.0]));
    for name in ["a.sog", "a.dat"] {
        assert!(!gaussians(load_as(name, &sog.bytes()).unwrap()).is_empty());
    }
    let e = load_as("b.SOG", b"no archive").unwrap_err().to_string();
    assert!(e.contains("b.SOG: byte 0: found a damaged zip archive"), "{e}");
}

/// For the tests of hostile files.
pub(super) fn seed() -> Vec<u8> {
    Sog::with_harmonics(1).bytes()
}

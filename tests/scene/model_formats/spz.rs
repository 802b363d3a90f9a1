//! SPZ captures: planes of bytes, compressed by gzip or Zstandard.

use std::io::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

use glam::Vec3;
use splatblur::model::{Cloud, ColourStorage, Gaussians, ModelFormat, parse_capture};

use super::support::{cloud, refused};

/// A file in the making: what the header says, and the planes.
#[derive(Clone)]
struct Spz {
    version: u32,
    count: u32,
    degree: u8,
    fraction: u8,
    flags: u8,
    planes: Vec<Vec<u8>>,
    records: Vec<u8>,
}

impl Spz {
    /// Two Gaussians without harmonics, of version 4.
    fn pair() -> Self {
        let positions = [[0x00_1000, -0x00_0800, 0x00_0400], [-0x80_0000, 0x7f_ffff, 1]];
        let mut planes = vec![
            positions.concat().iter().flat_map(|v: &i32| v.to_le_bytes()[..3].to_vec()).collect(),
            vec![255, 51],
            vec![255, 0, 51, 128, 128, 128],
            vec![160, 144, 176, 0, 255, 160],
            [largest(3, [0, 0, 0]), largest(0, [511, -511, 0])].concat(),
        ];
        planes.push(Vec::new());
        Self { version: 4, count: 2, degree: 0, fraction: 12, flags: 0, planes, records: Vec::new() }
    }

    fn header(&self, streams: usize) -> Vec<u8> {
        let mut bytes = b"NGSP".to_vec();
        bytes.extend(self.version.to_le_bytes());
        bytes.extend(self.count.to_le_bytes());
        bytes.extend([self.degree, self.fraction, self.flags, streams as u8]);
        bytes
    }

    /// Versions 1 to 3.
    fn gzip(&self) -> Vec<u8> {
        gzip(&[self.header(0), self.planes.concat()].concat())
    }

    /// Version 4.
    fn streams(&self) -> Vec<u8> {
        let planes: Vec<&Vec<u8>> = self.planes.iter().filter(|plane| !plane.is_empty()).collect();
        let mut bytes = self.header(planes.len());
        bytes.extend((32 + self.records.len() as u32).to_le_bytes());
        bytes.extend([0; 12]);
        bytes.extend(&self.records);
        let frames: Vec<Vec<u8>> = planes.iter().map(|plane| zstd(plane)).collect();
        for (frame, plane) in frames.iter().zip(planes) {
            bytes.extend((frame.len() as u64).to_le_bytes());
            bytes.extend((plane.len() as u64).to_le_bytes());
        }
        bytes.extend(frames.concat());
        bytes
    }
}

fn gzip(plain: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(plain).unwrap();
    encoder.finish().unwrap()
}

/// A Zstandard frame of a raw block for each 64 KiB.
fn zstd(plain: &[u8]) -> Vec<u8> {
    // One segment, whose size stands in four bytes.
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0xa0];
    frame.extend((plain.len() as u32).to_le_bytes());
    let blocks = plain.chunks(1 << 16);
    let last = blocks.len() - 1;
    for (index, block) in blocks.enumerate() {
        let head = (block.len() as u32) << 3 | u32::from(index == last);
        frame.extend(&head.to_le_bytes()[..3]);
        frame.extend(block);
    }
    frame
}

/// A rotation of version 3: index of the largest in x, y, z, w, and the others in that order, in 511ths.
fn largest(index: u32, others: [i32; 3]) -> [u8; 4] {
    let raw = others.into_iter().fold(index, |raw, v| raw << 10 | if v < 0 { 512 } else { 0 } | v.unsigned_abs());
    raw.to_le_bytes()
}

fn capture(bytes: &[u8]) -> Gaussians {
    parse_capture(bytes, ModelFormat::Spz).unwrap().unwrap()
}

fn says(bytes: &[u8], part: &str) {
    let e = refused(bytes, ModelFormat::Spz).to_string();
    assert!(e.contains(part), "{e}\n  expected {part}");
}

fn near(a: f32, b: f64) {
    assert!((f64::from(a) - b).abs() <= 1e-6 * b.abs().max(1e-3), "{a} is not {b}");
}

#[test]
fn each_field_of_version_4() {
    let g = capture(&Spz::pair().streams());
    assert_eq!((g.len(), g.degree, g.dropped, g.antialiased, g.linear), (2, 0, 0, false, false));
    // 4096 steps are 1; y and z change sign.
    assert_eq!(g.position[0], Vec3::new(1.0, 0.5, -0.25));
    assert_eq!(g.position[1], Vec3::new(-2048.0, -(8_388_607.0 / 4096.0), -1.0 / 4096.0));
    assert_eq!(g.opacity, [1.0, 0.2]);
    // (b/255 - 0.5) / 0.15
    for (found, expected) in g.base[0].to_array().into_iter().zip([0.5 / 0.15, -0.5 / 0.15, -0.3 / 0.15]) {
        near(found, expected);
    }
    // e^(b/16 - 10)
    for (found, power) in g.sigma[0].to_array().into_iter().zip([0.0, -1.0, 1.0]) {
        near(found, f64::exp(power));
    }
    for (found, power) in g.sigma[1].to_array().into_iter().zip([-10.0, 5.9375, 0.0]) {
        near(found, f64::exp(power));
    }
    assert_eq!(g.rotation[0].to_array(), [0.0, 0.0, 0.0, 1.0]);
    // x largest, y = sqrt(1/2), z = -sqrt(1/2), w = 0; y and z change sign. x is what is left: 0.
    let h = 0.5_f32.sqrt();
    assert!(g.rotation[1].abs_diff_eq(glam::Quat::from_xyzw(0.0, -h, h, 0.0), 1e-6), "{}", g.rotation[1]);
    assert!(g.notes.is_empty(), "{:?}", g.notes);
}

#[test]
fn the_largest_component_at_each_place() {
    // 256/511 sqrt(1/2), 128/511 sqrt(1/2) with a minus, 64/511 sqrt(1/2), and the largest.
    let [a, b, c] = [256.0, -128.0, 64.0].map(|v: f64| v / 511.0 * 0.5_f64.sqrt());
    let d = (1.0 - a * a - b * b - c * c).sqrt();
    // As the file has them, x y z w.
    for (index, xyzw) in [[d, a, b, c], [a, d, b, c], [a, b, d, c], [a, b, c, d]].into_iter().enumerate() {
        let mut spz = Spz::pair();
        spz.planes[4] = [largest(index as u32, [256, -128, 64]); 2].concat();
        for bytes in [spz.streams(), Spz { version: 3, ..spz }.gzip()] {
            let [x, y, z, w] = capture(&bytes).rotation[0].to_array();
            for (found, expected) in [x, -y, -z, w].into_iter().zip(xyzw) {
                near(found, expected);
            }
        }
    }
}

#[test]
fn older_versions() {
    let newest = capture(&Spz::pair().streams());
    assert_eq!(capture(&Spz { version: 3, ..Spz::pair() }.gzip()), newest);

    let mut second = Spz { version: 2, ..Spz::pair() };
    // 0 is -1, 255 is 1, 153 is 0.2, 204 is 0.6. A sum above 1 leaves nothing for w.
    second.planes[4] = vec![153, 204, 102, 255, 255, 0];
    let g = capture(&second.gzip());
    assert_eq!((&g.position, &g.sigma), (&newest.position, &newest.sigma));
    let w = (1.0 - 0.04 - 0.36 - 0.04_f32).sqrt();
    assert!(g.rotation[0].abs_diff_eq(glam::Quat::from_xyzw(0.2, -0.6, 0.2, w), 1e-6), "{}", g.rotation[0]);
    let third = 3.0_f32.sqrt().recip();
    assert!(g.rotation[1].abs_diff_eq(glam::Quat::from_xyzw(third, -third, third, 0.0), 1e-6), "{}", g.rotation[1]);

    let mut first = Spz { version: 1, ..second };
    // 1, -2, the smallest number of 16 bits; 65504, 0.1, and one that is not finite.
    let halves = [0x3c00, 0xc000, 0x0001, 0x7bff, 0x2e66, 0x7c00_u16];
    first.planes[0] = halves.iter().flat_map(|h| h.to_le_bytes()).collect();
    let g = capture(&first.gzip());
    assert_eq!((g.position.as_slice(), g.dropped), ([Vec3::new(1.0, 2.0, -(2.0_f32.powi(-24)))].as_slice(), 1));
    first.planes[0].truncate(10);
    first.planes[0].extend([0, 0]);
    let g = capture(&first.gzip());
    assert_eq!(g.position[1], Vec3::new(65504.0, -0.099_975_586, 0.0));
}

/// Harmonics that name their channel and place: byte 129 + 3 k + channel.
fn with_harmonics(degree: u8) -> Spz {
    let each = 3 * ((usize::from(degree) + 1).pow(2) - 1);
    let one: Vec<u8> = (0..each).map(|k| 129 + k as u8).collect();
    let other: Vec<u8> = (0..each).map(|k| 127 - k as u8).collect();
    let mut spz = Spz { degree, ..Spz::pair() };
    spz.planes[5] = [one, other].concat();
    spz
}

#[test]
fn harmonics_with_the_signs_of_the_turn() {
    let signs = "--+-++-+-+--+-+".chars().map(|c| if c == '-' { -1.0 } else { 1.0 });
    let signs: Vec<f32> = signs.collect();
    for (degree, each) in [(1, 3), (2, 8), (3, 15), (4, 15)] {
        let spz = with_harmonics(degree);
        let g = capture(&spz.streams());
        assert_eq!(capture(&Spz { version: 3, ..spz }.gzip()), g);
        assert_eq!((g.degree, g.harmonics_each(), g.harmonics.len()), (degree.min(3), each, 2 * each));
        for k in 0..each {
            let own = Vec3::new(1.0, 2.0, 3.0) + 3.0 * k as f32;
            assert_eq!(g.harmonics[k], signs[k] * own / 128.0, "{k}");
            assert_eq!(g.harmonics[each + k], -signs[k] * own / 128.0, "{k}");
        }
        let note = "Gaussian splats: harmonics of degree 4 ignored";
        assert_eq!(g.notes, vec![note.to_owned(); usize::from(degree == 4)]);
    }
}

#[test]
fn flags_and_records() {
    let antialiased = Spz { flags: 1, ..Spz::pair() };
    assert!(capture(&antialiased.streams()).antialiased);
    assert!(capture(&Spz { version: 3, ..antialiased }.gzip()).antialiased);

    let record =
        |kind: u32, payload: &[u8]| [&kind.to_le_bytes(), &(payload.len() as u32).to_le_bytes(), payload].concat();
    let with = |records: &[Vec<u8>]| Spz { flags: 2, records: records.concat(), ..Spz::pair() }.streams();
    let axes = |axes: u32| record(0xADBE_0003, &axes.to_le_bytes());
    let expected = capture(&Spz::pair().streams());
    for records in [&[record(7, b"unknown"), axes(4)][..], &[axes(0)], &[]] {
        assert_eq!(capture(&with(records)), expected);
    }
    says(&with(&[record(7, b""), axes(6)]), "byte 48: found axes 6 (RDF), expected 0 (not said) or 4 (RUB)");
    says(&with(&[axes(16)]), "found axes 16, expected");
    says(&with(&[record(0xADBE_0003, &[4])]), "byte 36: found 1 bytes, expected 4");
    let mut long = record(7, b"abc");
    long[4] = 4;
    says(&with(&[long]), "byte 36: found 4 bytes of a record, expected at most 3");
    says(&with(&[vec![0; 5]]), "the end of the file");
}

#[test]
fn cut_short_at_every_byte() {
    let mut spz = with_harmonics(1);
    spz.records = [&[7, 0, 0, 0, 1, 0, 0, 0], &b"x"[..]].concat();
    spz.flags = 2;
    for bytes in [spz.streams(), Spz { version: 3, ..spz }.gzip()] {
        assert_eq!(capture(&bytes).len(), 2);
        for length in 0..bytes.len() {
            refused(&bytes[..length], ModelFormat::Spz);
        }
        let more = capture(&[&bytes[..], b"more"].concat());
        assert_eq!(more.notes, ["4 bytes after the last stream ignored"]);
    }
}

#[test]
fn damage_at_every_byte_is_no_panic() {
    let spz = with_harmonics(1);
    for bytes in [spz.streams(), Spz { version: 3, ..spz }.gzip()] {
        for at in 0..bytes.len() {
            for value in [0, 1, 0x80, 0xff, bytes[at] ^ 4] {
                let mut damaged = bytes.clone();
                damaged[at] = value;
                let _ = parse_capture(&damaged, ModelFormat::Spz);
            }
        }
    }
}

#[test]
fn sizes_that_lie() {
    let good = Spz::pair().streams();
    let with = |at: usize, values: &[u8]| {
        let mut bytes = good.clone();
        bytes[at..at + values.len()].copy_from_slice(values);
        bytes
    };
    says(&with(4, &[5]), "byte 4: found SPZ version 5, expected 1 to 4");
    says(&with(4, &[3]), "byte 4: found SPZ version 3 that is not gzip, expected version 4");
    says(&Spz::pair().gzip(), "byte 4: found SPZ version 4 inside gzip, expected 1 to 3");
    says(&gzip(&[b'x'; 16]), "byte 0: found `xxxx`, expected `NGSP`");
    says(&with(8, &[3]), "byte 40: found 18 plain bytes, expected 27 (position)");
    says(&with(8, &[0, 0, 1]), "byte 40: found 18 plain bytes, expected");
    says(&with(8, &[255; 4]), "byte 8: found 4294967295 Gaussians of degree 0, expected at most");
    says(&with(12, &[5]), "byte 12: found harmonics of degree 5, expected 0 to 4");
    says(&with(12, &[1]), "byte 15: found 5 streams, expected 6 for 2 Gaussians of degree 1");
    says(&with(13, &[32]), "byte 13: found 32 fractional bits, expected 0 to 31");
    says(&with(16, &[31]), "byte 16: found the table of streams at 31");
    says(&with(16, &[255; 4]), "byte 16: found the table of streams at 4294967295");
    says(&with(32, &[255; 8]), "byte 32: found 18446744073709551615 packed bytes, expected at most");
    // A frame that says another size than it has, and one that says another than the table.
    says(&with(112 + 5, &[17]), "(position)");
    says(&with(32, &[31]), "byte 112: found 1 bytes after the frame, expected one frame of 18 bytes (position)");
    let mut other = Spz { version: 3, ..Spz::pair() };
    other.planes[4].pop();
    says(&other.gzip(), "byte 0: found 39 bytes of planes, expected 40 for 2 Gaussians");
    other.planes[4].extend([0; 3]);
    assert_eq!(capture(&other.gzip()).notes, ["bytes after the last plane ignored"]);
    assert!(capture(&Spz { count: 0, planes: vec![], ..Spz::pair() }.streams()).is_empty());
}

#[test]
fn bombs_are_refused_at_once() {
    let start = Instant::now();
    // 160 MB of zeros in 160 kB, behind a header that says two Gaussians, and behind one that says eight million.
    let zeros = vec![0; 160 << 20];
    let header = |count: u32| Spz { version: 3, count, ..Spz::pair() }.header(0);
    let small = gzip(&[header(2), zeros.clone()].concat());
    assert_eq!(capture(&small).notes, ["bytes after the last plane ignored"]);
    says(&gzip(&[header(8 << 20), zeros.clone()].concat()), "found 8388608 Gaussians of degree 0, expected at most");
    // 64 MB of planes in 64 kB, of which the header tells the truth.
    let honest = gzip(&[header(3 << 20), zeros[..60 << 20].to_vec()].concat());
    assert!(honest.len() < 70_000);
    says(&honest, "byte 8: found 3145728 Gaussians of degree 0, expected at most 7");
    // Blocks of one repeated byte, 128 KiB in 4 bytes, in a frame without a size; the window is the largest.
    for window in [0x68, 0xf8] {
        let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0, window];
        let block = (128_u32 << 13 | 2).to_le_bytes();
        (0..10_000).for_each(|_| frame.extend([block[0], block[1], block[2], 7]));
        let mut bytes = Spz::pair().header(5);
        bytes.extend(32_u32.to_le_bytes().into_iter().chain([0; 12]));
        for plain in [18, 2, 6, 6, 8_u64] {
            bytes.extend((frame.len() as u64).to_le_bytes().into_iter().chain(plain.to_le_bytes()));
        }
        bytes.extend(frame.repeat(5));
        says(&bytes, "(position)");
    }
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}

#[test]
fn known_by_its_first_bytes_and_drawn_as_surfels() {
    let spz = Spz::pair();
    for (bytes, name) in [(spz.streams(), "a.spz"), (Spz { version: 3, ..spz }.gzip(), "a.dat")] {
        assert_eq!(ModelFormat::detect(&bytes, Path::new(name)), Some(ModelFormat::Spz));
        let Cloud { position, colour_storage, two_sided, .. } = cloud(&bytes, ModelFormat::Spz);
        // The other is fainter than what is drawn.
        assert_eq!((position.len(), colour_storage, two_sided), (1, ColourStorage::Integer, true));
    }
}

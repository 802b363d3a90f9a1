//! Compressed Gaussian-splat PLY: every field against values computed by hand.

use std::time::{Duration, Instant};

use glam::{Quat, Vec3};
use splatblur::model::{Gaussians, ModelFormat, parse_capture};

use super::support::{ENCODINGS, Encoding, Ply, cloud, refused};

const PACKED: [(&str, &str); 4] =
    [("uint", "packed_position"), ("uint", "packed_rotation"), ("uint", "packed_scale"), ("uint", "packed_color")];

const RANGES: [&str; 18] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
    "min_r",
    "min_g",
    "min_b",
    "max_r",
    "max_g",
    "max_b",
];

fn ranges(columns: usize) -> Vec<(&'static str, &'static str)> {
    RANGES[..columns].iter().map(|name| ("float", *name)).collect()
}

/// Positions in a box from (-1, 0, 10) to (1, 4, 10), ln sigma from -2 to 0 in x, -3 to 1 in y and 5 in z, colours from
/// 0 to 2 in red, -1 to 1 in green and 0.25 in blue.
const CHUNK: [f64; 18] =
    [-1.0, 0.0, 10.0, 1.0, 4.0, 10.0, -2.0, -3.0, 5.0, 0.0, 1.0, 5.0, 0.0, -1.0, 0.25, 2.0, 1.0, 0.25];

fn bits(fields: &[(u32, u32)]) -> f64 {
    f64::from(fields.iter().fold(0_u32, |packed, (bits, value)| (packed << bits) | value))
}

/// At the largest corner of all ranges, with no rotation and full opacity.
fn largest() -> Vec<f64> {
    let all = bits(&[(11, 2047), (10, 1023), (11, 2047)]);
    vec![all, identity(), all, bits(&[(8, 255), (8, 255), (8, 255), (8, 255)])]
}

/// Three components of nearly 0: no value of 10 bits is 0 itself.
fn identity() -> f64 {
    bits(&[(2, 0), (10, 512), (10, 512), (10, 512)])
}

fn capture(bytes: &[u8]) -> Gaussians {
    parse_capture(bytes, ModelFormat::Ply).unwrap().unwrap()
}

fn file(columns: usize, rows: &[Vec<f64>]) -> Ply {
    Ply::new(Encoding::Little)
        .element("chunk", &ranges(columns), &[CHUNK[..columns].to_vec()])
        .element("vertex", &PACKED, rows)
}

/// For the tests of hostile files.
pub(super) fn seed() -> Vec<u8> {
    file(18, &[largest(), largest()]).bytes()
}

#[test]
fn each_field_in_every_encoding() {
    let middle = vec![
        bits(&[(11, 614), (10, 341), (11, 999)]),
        bits(&[(2, 0), (10, 512), (10, 512), (10, 512)]),
        bits(&[(11, 0), (10, 1023), (11, 7)]),
        bits(&[(8, 51), (8, 102), (8, 200), (8, 51)]),
    ];
    for encoding in ENCODINGS {
        let mut ply = Ply::new(encoding).element("chunk", &ranges(18), &[CHUNK.to_vec()]);
        ply = ply.element("vertex", &PACKED, &[largest(), middle.clone()]);
        let c = capture(&ply.bytes());
        assert_eq!((c.len(), c.degree, c.dropped), (2, 0, 0));
        assert_eq!(c.position[0], Vec3::new(1.0, 4.0, 10.0));
        // 614/2047 of 2 above -1; 341/1023 of 4.
        assert!((c.position[1] - Vec3::new(-0.400_097_7, 4.0 / 3.0, 10.0)).length() < 1e-6, "{}", c.position[1]);
        let e = std::f32::consts::E;
        assert!((c.sigma[0] - Vec3::new(1.0, e, e.powi(5))).abs().max_element() < 1e-4, "{}", c.sigma[0]);
        assert!((c.sigma[1] - Vec3::new(e.powi(-2), e, e.powi(5))).abs().max_element() < 1e-4, "{}", c.sigma[1]);
        assert_eq!(c.opacity, [1.0, 0.2]);
        assert!((c.colour(0) - Vec3::new(2.0, 1.0, 0.25)).length() < 1e-6, "{}", c.colour(0));
        assert!((c.colour(1) - Vec3::new(0.4, -0.2, 0.25)).length() < 1e-6, "{}", c.colour(1));
        assert!((c.rotation[0].w - 1.0).abs() < 1e-5 && c.rotation[0].is_normalized());
    }
}

#[test]
fn the_component_left_out_is_positive_and_the_others_keep_their_order() {
    // 868, 728 and 301 of 1023 are 0.492781, 0.299251 and -0.290997 of sqrt 2 above its half.
    let three = [868_u32, 728, 301].map(|v| (f64::from(v) / 1023.0 - 0.5) * 2_f64.sqrt());
    let [a, b, c] = three.map(|v| v as f32);
    let rest = (1.0 - three.iter().map(|v| v * v).sum::<f64>()).sqrt() as f32;
    assert!(rest > 0.7);
    let expected = [
        Quat::from_xyzw(a, b, c, rest),
        Quat::from_xyzw(rest, b, c, a),
        Quat::from_xyzw(b, rest, c, a),
        Quat::from_xyzw(b, c, rest, a),
    ];
    for (left_out, expected) in expected.into_iter().enumerate() {
        let mut row = largest();
        row[1] = bits(&[(2, left_out as u32), (10, 868), (10, 728), (10, 301)]);
        let found = capture(&file(18, &[row]).bytes()).rotation[0];
        assert!(found.abs_diff_eq(expected, 1e-6), "{left_out}: {found} instead of {expected}");
    }
    // Three that are longer than 1 by themselves: of length 1 all the same.
    let mut row = largest();
    row[1] = bits(&[(2, 3), (10, 1023), (10, 1023), (10, 1023)]);
    let found = capture(&file(18, &[row]).bytes()).rotation[0];
    assert!(found.abs_diff_eq(Quat::from_xyzw(1.0, 1.0, 0.0, 1.0).normalize(), 1e-6), "{found}");
}

#[test]
fn older_chunks_have_no_range_of_colours() {
    let mut row = largest();
    row[3] = bits(&[(8, 255), (8, 51), (8, 0), (8, 255)]);
    let c = capture(&file(12, &[row]).bytes());
    assert!((c.colour(0) - Vec3::new(1.0, 0.2, 0.0)).length() < 1e-6, "{}", c.colour(0));
}

#[test]
fn columns_are_found_by_name() {
    let mut chunk: Vec<_> = ranges(18).into_iter().zip(CHUNK).collect();
    chunk.reverse();
    let (names, values): (Vec<_>, Vec<_>) = chunk.into_iter().unzip();
    let mut vertex: Vec<_> = PACKED.into_iter().zip(largest()).collect();
    vertex.reverse();
    let (packed, row): (Vec<_>, Vec<_>) = vertex.into_iter().unzip();
    let ply = Ply::new(Encoding::Big)
        .element("camera", &[("double", "view")], &[vec![1.0]])
        .element("chunk", &names, &[values])
        .element("vertex", &packed, &[row])
        .element("more", &[("uchar", "x")], &[vec![1.0]]);
    assert_eq!(capture(&ply.bytes()), capture(&file(18, &[largest()]).bytes()));
}

#[test]
fn chunks_have_256_gaussians_each() {
    let second: Vec<f64> = CHUNK.iter().map(|v| v + 100.0).collect();
    let mut second_no_scale = second.clone();
    second_no_scale[6..12].copy_from_slice(&CHUNK[6..12]);
    let ply = |chunks: &[Vec<f64>], count: usize| {
        Ply::new(Encoding::Little).element("chunk", &ranges(18), chunks).element(
            "vertex",
            &PACKED,
            &vec![largest(); count],
        )
    };
    let both = [CHUNK.to_vec(), second_no_scale];
    let c = capture(&ply(&both, 257).bytes());
    assert_eq!(c.position[255], Vec3::new(1.0, 4.0, 10.0));
    assert_eq!(c.position[256], Vec3::new(101.0, 104.0, 110.0));
    let e = refused(&ply(&both[..1], 257).bytes(), ModelFormat::Ply).to_string();
    assert_eq!(e, "line 3: found 1 chunks for 257 Gaussians, expected 2: one for 256 Gaussians each");
    let c = capture(&ply(&both, 256).bytes());
    assert_eq!(c.notes, ["1 chunks without Gaussians ignored"]);
}

fn rest(count: usize) -> Vec<(&'static str, String)> {
    (0..count).map(|k| ("uchar", format!("f_rest_{k}"))).collect()
}

#[test]
fn harmonics_by_channel_with_both_ends_exact() {
    for (degree, each) in [(1, 3), (2, 8), (3, 15_usize)] {
        for encoding in ENCODINGS {
            let names = rest(3 * each);
            let names: Vec<_> = names.iter().map(|(kind, name)| (*kind, name.as_str())).collect();
            let mut first: Vec<f64> = (0..3 * each).map(|k| 100.0 + k as f64).collect();
            first[0] = 0.0;
            first[each + 1] = 255.0;
            let ply = Ply::new(encoding)
                .element("chunk", &ranges(18), &[CHUNK.to_vec()])
                .element("vertex", &PACKED, &[largest(), largest()])
                .element("sh", &names, &[first, vec![127.0; 3 * each]]);
            let c = capture(&ply.bytes());
            assert_eq!((c.degree, c.harmonics_each(), c.harmonics.len()), (degree, each, 2 * each));
            let of = |k: usize| 8.0 * ((100.5 + k as f32) / 256.0 - 0.5);
            assert_eq!(c.harmonics[0], Vec3::new(-4.0, of(each), of(2 * each)));
            assert_eq!(c.harmonics[1], Vec3::new(of(1), 4.0, of(2 * each + 1)));
            assert_eq!(c.harmonics[each - 1], Vec3::new(of(each - 1), of(2 * each - 1), of(3 * each - 1)));
            assert_eq!(c.harmonics[each], Vec3::splat(-0.015_625));
        }
    }
}

#[test]
fn what_cannot_be_drawn_is_dropped_and_counted() {
    let mut chunk = CHUNK.to_vec();
    chunk[9] = 1000.0;
    let small = vec![0.0, identity(), 0.0, 255.0];
    let ply = Ply::new(Encoding::Little).element("chunk", &ranges(18), &[chunk.clone()]).element(
        "vertex",
        &PACKED,
        &[largest(), small],
    );
    let c = capture(&ply.bytes());
    assert_eq!((c.len(), c.dropped), (1, 1));
    // As a model, it says so.
    let notes = cloud(&ply.bytes(), ModelFormat::Ply).notes;
    assert!(notes[0].contains("1 of 2 kept"), "{notes:?}");
    chunk[0] = f64::NAN;
    let ply =
        Ply::new(Encoding::Little).element("chunk", &ranges(18), &[chunk]).element("vertex", &PACKED, &[largest()]);
    assert_eq!(capture(&ply.bytes()).dropped, 1);
}

#[test]
fn every_truncation_is_refused() {
    let names = rest(9);
    let names: Vec<_> = names.iter().map(|(kind, name)| (*kind, name.as_str())).collect();
    for encoding in [Encoding::Little, Encoding::Big] {
        let ply = Ply::new(encoding)
            .element("chunk", &ranges(18), &[CHUNK.to_vec()])
            .element("vertex", &PACKED, &[largest(), largest()])
            .element("sh", &names, &[vec![1.0; 9], vec![2.0; 9]]);
        let bytes = ply.bytes();
        assert_eq!(capture(&bytes).len(), 2);
        for length in 0..bytes.len() {
            refused(&bytes[..length], ModelFormat::Ply);
        }
        let notes = capture(&[&bytes[..], b"xyz"].concat()).notes;
        assert_eq!(notes, ["3 bytes after the last element ignored"]);
    }
}

#[test]
fn headers_that_are_refused() {
    let chunk = lines(&ranges(18));
    let vertex = lines(&PACKED);
    let text = |lines: &str| format!("ply\nformat binary_little_endian 1.0\n{lines}end_header\n{}", "0".repeat(999));
    let after = |sh: &str| text(&format!("element chunk 1\n{chunk}element vertex 2\n{vertex}element sh {sh}"));
    for (file, expected) in [
        (text("element vertex 1\nproperty uint packed_position\n"), "line 3: found element `vertex` without packed_ro"),
        (text(&format!("element vertex 1\n{vertex}")), "line 3: found packed Gaussians without an element `chunk`"),
        (
            text(&format!("element vertex 1\n{vertex}element chunk 1\n{chunk}")),
            "line 8: found element `chunk` in another place, expected the elements in the order chunk, vertex, sh",
        ),
        (
            text(&format!("element sh 1\nproperty uchar f_rest_0\nelement vertex 1\n{vertex}")),
            "line 3: found element `sh` in another place",
        ),
        (
            text(&format!(
                "element chunk 1\n{}element vertex 1\n{vertex}",
                chunk.replace("float min_y", "double min_y")
            )),
            "line 3: found min_y of type double, expected `property float min_y`",
        ),
        (
            text(&format!(
                "element chunk 1\n{}element vertex 1\n{vertex}",
                chunk.replace("property float max_b\n", "")
            )),
            "line 3: found element `chunk` without max_b",
        ),
        (
            text(&format!("element chunk 1\n{chunk}element vertex 1\n{}", vertex.replace("uint", "list uchar uint"))),
            "found a list packed_position, expected `property uint packed_position`",
        ),
        (after("2\nproperty uchar f_rest_0\n"), "found element `sh` with 1 columns f_rest_0, f_rest_1, .., expected 9"),
        (after(&format!("1\n{}", sh_lines("uchar"))), "found 1 of element `sh`, expected 2, as many as of `vertex`"),
        (after(&format!("2\n{}", sh_lines("char"))), "found f_rest_0 of type char"),
    ] {
        let e = refused(file.as_bytes(), ModelFormat::Ply).to_string();
        assert!(e.contains(expected), "{e}\n  expected {expected}");
    }
}

fn sh_lines(kind: &str) -> String {
    (0..9).map(|k| format!("property {kind} f_rest_{k}\n")).collect::<Vec<_>>().concat()
}

/// Properties as the header has them.
fn lines(properties: &[(&str, &str)]) -> String {
    properties.iter().map(|(kind, name)| format!("property {kind} {name}\n")).collect::<Vec<_>>().concat()
}

#[test]
fn absurd_counts_are_refused_at_once() {
    let chunk = lines(&ranges(18));
    let vertex = lines(&PACKED);
    let start = Instant::now();
    for encoding in ["ascii", "binary_little_endian"] {
        for [chunks, count, sh] in
            [["18446744073709551615", "1", "1"], ["1", "4000000000", "1"], ["1", "1", "99999999999"]]
        {
            let text = format!(
                "ply\nformat {encoding} 1.0\nelement chunk {chunks}\n{chunk}element vertex {count}\n{vertex}element sh \
                 {sh}\n{}end_header\n{}",
                sh_lines("uchar"),
                "1 ".repeat(64)
            );
            let e = refused(text.as_bytes(), ModelFormat::Ply).to_string();
            assert!(e.contains("is the file cut short?"), "{e}");
        }
    }
    assert!(start.elapsed() < Duration::from_secs(1));
}

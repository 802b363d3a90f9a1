//! Files that lie, are cut short, or are noise: one clear error, no panic, no memory for what is not there.

use proptest::prelude::*;
use splatblur::model::{ModelFormat, Parsed, parse};

use super::bin::{encode, encode_first_version, seal};
use super::support::{ENCODINGS, Encoding, Ply, be, read, refused, sfl_file, sfl_set};
use super::write::sample;

const FORMATS: [ModelFormat; 15] = [
    ModelFormat::Ply,
    ModelFormat::Sfl,
    ModelFormat::Obj,
    ModelFormat::Bin,
    ModelFormat::Xyz,
    ModelFormat::Pts,
    ModelFormat::Splat,
    ModelFormat::Sog,
    ModelFormat::Spz,
    ModelFormat::Glb,
    ModelFormat::Nrrd,
    ModelFormat::Las,
    ModelFormat::E57,
    ModelFormat::Npy,
    ModelFormat::Npz,
];

/// Small valid files of every format.
fn seeds() -> Vec<(ModelFormat, Vec<u8>)> {
    let properties =
        [("float", "x"), ("double", "y"), ("short", "z"), ("uchar", "red"), ("uchar", "green"), ("uchar", "blue")];
    let rows = [vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0], vec![7.0; 6], vec![0.0, 9.0, 8.0, 1.0, 2.0, 3.0]];
    let mut files: Vec<_> = ENCODINGS
        .into_iter()
        .map(|encoding| {
            let ply = Ply::new(encoding).line("comment seed").element("vertex", &properties, &rows).lists(
                "face",
                "vertex_indices",
                "uchar",
                "int",
                &[vec![0.0, 1.0, 2.0]],
            );
            (ModelFormat::Ply, ply.bytes())
        })
        .collect();
    let splat = [
        "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1",
        "rot_2", "rot_3",
    ];
    let splat = splat.map(|n| ("float", n));
    files.push((
        ModelFormat::Ply,
        Ply::new(Encoding::Little).element("vertex", &splat, &[vec![1.0; 14], vec![0.5; 14]]).bytes(),
    ));
    files.push((ModelFormat::Ply, super::compressed_ply::seed()));
    #[cfg(feature = "formats")]
    files.push((ModelFormat::Sog, super::sog::seed()));
    #[cfg(feature = "formats")]
    files.push((ModelFormat::Npz, super::tables::read("packed.npz")));
    files.push((ModelFormat::Npy, super::tables::read("nested.npy")));
    files.push((ModelFormat::Sfl, read("tiny_full.sfl")));
    let record = be(&[1.0, 2.0, 3.0, 2.0, 0.0, 0.0, 0.0, 0.5, 0.0]);
    let [set, resolution] = sfl_set(1 << 24, &[(0, 0), (24, 12)], 36, &record, &[]);
    files.push((ModelFormat::Sfl, sfl_file(&[vec![], set, resolution])));
    let obj = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nvn 0 0 1\nf 1/1/1 2//1 -1\n";
    files.push((ModelFormat::Obj, obj.as_bytes().to_vec()));
    files.push((ModelFormat::Bin, encode(&sample(3, true))));
    files.push((ModelFormat::Bin, encode_first_version(&sample(3, true))));
    files.push((ModelFormat::Xyz, b"# x y z, normal, colour\n1 2 3 0 0 1 255 0 0\n4 5 6 0 1 0 0 9 0\n".to_vec()));
    let nrrd = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nspacings: 1 2 3\nencoding: raw\n\n01234567";
    files.push((ModelFormat::Nrrd, nrrd.as_bytes().to_vec()));
    files.push((ModelFormat::Pts, b"2\n1 2 3 -20 255 0 0\n4 5 6 30 1 2 3\n".to_vec()));
    files
}

#[test]
fn cut_short_at_every_byte() {
    for (format, bytes) in seeds() {
        assert!(parse(&bytes, format).is_ok());
        // Text ends at a word: a shorter last number is still a number.
        let whole = bytes.trim_ascii_end().len() - usize::from(bytes.starts_with(b"ply\nformat ascii")) * 2;
        for length in 0..bytes.len() {
            let read = parse(&bytes[..length], format);
            if !matches!(format, ModelFormat::Obj | ModelFormat::Xyz) && length < whole {
                // In .sfl only what is used must be there. The last number of a text may be shorter. The points of a
                // text can be used without its faces.
                let all_points = matches!(&read, Ok(Parsed::Cloud(cloud)) if cloud.position.len() == 3
                    && cloud.notes.iter().any(|note| note.starts_with("faces ignored")));
                let faces = bytes.starts_with(b"ply\nformat ascii") && all_points;
                let spare = format == ModelFormat::Sfl || faces || format == ModelFormat::Pts && length + 2 > whole;
                assert!(read.is_err() || spare, "{format:?} cut to {length} of {} was accepted", bytes.len());
            }
        }
    }
}

#[test]
fn headers_that_are_refused() {
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    let vertex = format!("element vertex 1\n{xyz}");
    let header = |lines: &str| format!("ply\nformat ascii 1.0\n{lines}end_header\n0 0 0\n");
    for (text, expected) in [
        (
            header(&format!("{vertex}property bool ok\n")),
            "line 7: found property type `bool`, expected one of char, uchar,",
        ),
        (
            header(&format!("{vertex}property float X\n")),
            "line 7: found a second property `x`, expected different names",
        ),
        (header(&format!("{vertex}element Vertex 1\n")), "line 7: found a second element `vertex`"),
        (
            header(&format!("Created by a program\n{vertex}")),
            "line 3: found `Created by a program`, expected `comment ...`",
        ),
        (header("property float x\n"), "line 3: found a property before the first element"),
        (header(&format!("element vertex -1\n{xyz}")), "line 3: found element count `-1`"),
        (header(&format!("element vertex 1e3\n{xyz}")), "line 3: found element count `1e3`"),
        (header("element vertex\n"), "line 3: found `element vertex`"),
        (header(&format!("{vertex}property list float int a\n")), "line 7: found list count type `float`"),
        (header(&format!("{vertex}property float\n")), "line 7: found property `float`"),
        (header(&format!("format ascii 1.0\n{vertex}")), "line 3: found a second `format` line"),
        (header(""), "line 1: found no element `vertex`"),
        (header("element vertex 1\nproperty float x\n"), "line 3: found an element `vertex` without x, y and z"),
        ("ply\nend_header\n".to_owned(), "line 2: found no `format` line"),
        ("ply\nformat utf8 1.0\n".to_owned(), "line 2: found encoding `utf8`"),
        ("ply\nformat ascii\n".to_owned(), "line 2: found format `ascii`"),
        ("ply\nformat ascii 1.0\nelement".to_owned(), "line 3: found the end of the file"),
        ("plywood\n".to_owned(), "line 1: found `plywood`, expected `ply`"),
        (format!("ply\nformat ascii 1.0\ncomment {}", "x".repeat(4 << 20)), "line 3: found a header longer than 1 MiB"),
        (format!("ply\nformat ascii 1.0\n{}", "comment x\n".repeat(200_000)), "found a header longer than 1 MiB"),
    ] {
        let e = refused(text.as_bytes(), ModelFormat::Ply).to_string();
        assert!(e.contains(expected), "{e}\n  expected {expected}");
        assert!(e.len() < 400, "{e}");
    }
}

#[test]
fn faces_that_are_ignored() {
    let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n";
    for (body, expected) in [
        (
            "3 0 1 3\n",
            "line 13: found vertex index 3, expected the index of a vertex of this file, from 0 (`vertex_indices` of \
             face 0 of 1)",
        ),
        ("3 0 1 -1\n", "line 13: found vertex index -1"),
        ("3 0 1 1.5\n", "line 13: found `1.5`, expected a number of type int"),
        ("-1\n", "line 13: found a list of -1 items"),
        ("2147483647 0 1 2\n", "line 13: found a list of 2147483647 items, expected 0 to"),
        ("3 0 1\n", "line 14: found the end of the file, expected int (`vertex_indices` of face 0 of 1)"),
        ("3 0 one 2\n", "line 13: found `one`, expected a number of type int"),
    ] {
        // The points of a text are used.
        let Parsed::Cloud(cloud) = parse(format!("{head}{body}").as_bytes(), ModelFormat::Ply).unwrap() else {
            panic!()
        };
        assert_eq!((cloud.position.len(), cloud.normal.len()), (3, 0));
        let [note] = &cloud.notes[..] else { panic!("{:?}", cloud.notes) };
        assert!(note.starts_with("faces ignored, points used (line") && note.contains(expected), "{note}");
    }
    // Not so where the same is said in bytes, which may be out of step.
    let bytes = Ply::new(Encoding::Little)
        .element("vertex", &["x", "y", "z"].map(|n| ("float", n)), &[vec![0.0; 3], vec![1.0; 3]])
        .lists("face", "vertex_indices", "uchar", "int", &[vec![0.0, 1.0, 7.0]])
        .bytes();
    assert!(refused(&bytes, ModelFormat::Ply).to_string().contains("found vertex index 7"));
}

#[test]
fn bodies_that_are_refused() {
    let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n";
    let text = format!("{}1 0 x\n", &head[..head.len() - 6]);
    let e = refused(text.as_bytes(), ModelFormat::Ply).to_string();
    assert!(e.starts_with("line 12: found `x`, expected a number of type float (`z` of vertex 2 of 3)"), "{e}");
    let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty uchar x\nproperty uchar y\nproperty char z\n\
                end_header\n0 256 0\n";
    assert!(
        refused(text.as_bytes(), ModelFormat::Ply)
            .to_string()
            .contains("line 8: found `256`, expected a number of type uchar")
    );
}

#[test]
fn counts_beyond_the_file() {
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for count in [4, 1_u64 << 32, 1 << 60, u64::MAX / 12, u64::MAX] {
            for element in ["vertex", "face", "other"] {
                let first = if element == "vertex" {
                    String::new()
                } else {
                    "element vertex 0\nproperty float x\nproperty float y\nproperty float z\n".to_owned()
                };
                let names = ["x", "y", "z"].map(|n| format!("property float {n}\n")).concat();
                let text =
                    format!("ply\nformat {encoding} 1.0\n{first}element {element} {count}\n{names}end_header\n1 2 3\n");
                let e = refused(text.as_bytes(), ModelFormat::Ply).to_string();
                assert!(e.contains(&format!("found {count} of element `{element}` (6 bytes are left)")), "{e}");
            }
        }
    }
    // 2^32 - 1 list items in binary, and a count of records that hold nothing.
    let text =
        b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty list uint double a\nproperty char x\n\
        property char y\nproperty char z\nend_header\n\xff\xff\xff\xff\0\0\0";
    let e = refused(text, ModelFormat::Ply).to_string();
    assert!(e.contains("found a list of 4294967295 items, expected 0 to 0"), "{e}");
    let text = "ply\nformat ascii 1.0\nelement nothing 18446744073709551615\nelement vertex 1\nproperty char x\n\
                property char y\nproperty char z\nend_header\n1 2 3";
    assert!(parse(text.as_bytes(), ModelFormat::Ply).is_ok());
}

/// Time must not grow with the square of the number of elements: that took 5 s here.
#[test]
fn sixty_thousand_elements() {
    use std::fmt::Write as _;
    let mut header = "ply\nformat ascii 1.0\n".to_owned();
    (0..60_000).for_each(|i| writeln!(header, "element {i} 1").unwrap());
    let start = std::time::Instant::now();
    let found = refused((header + "element 7 1\nend_header\n").as_bytes(), ModelFormat::Ply).to_string();
    assert!(found.contains("a second element `7`"), "{found}");
    assert!(start.elapsed().as_secs_f64() < 1.0, "{:?}", start.elapsed());
}

#[test]
fn twenty_thousand_properties() {
    use std::fmt::Write as _;
    let mut text =
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty char x\nproperty char y\nproperty char z\n".to_owned();
    (0..20_000).for_each(|i| writeln!(text, "property char p{i}").unwrap());
    text += "end_header\n";
    text += &"1 ".repeat(20_003);
    assert!(parse(text.as_bytes(), ModelFormat::Ply).is_ok());
}

#[test]
fn sfl_directories_that_lie() {
    let good = read("tiny_full.sfl");
    let message = |at: usize, with: &[u8]| {
        let mut bad = good.clone();
        bad[at..at + with.len()].copy_from_slice(with);
        refused(&bad, ModelFormat::Sfl).to_string()
    };
    let has = |message: String, part: &str| assert!(message.contains(part), "{message}");
    // The root directory begins at 0x14; its link stands at 0x74, the link's value at 0x7c.
    has(message(16, &[0, 0, 0, 0]), "byte 16: found directory offset 0, expected 20 to 763");
    has(message(16, &[0xff; 4]), "directory offset 4294967295");
    has(message(0x7c, &[0, 0, 0, 0x14]), "found directory 20 a second time, expected a tree without cycles");
    // Half-way into the root itself: the same link again.
    has(message(0x7c, &[0, 0, 0, 0x20]), "found directory 32 a second time");
    has(message(4, &[0, 0, 0, 1]), "byte 4: found container version 1, expected 0");
    has(message(8, b"TIFF"), "byte 8: found `TIFF`, expected `SFLF`");
    // Number of surfels, block length, block offset.
    has(message(0x218, &[0, 0, 0, 4]), "found 4 surfels of 50 bytes in a block of 150 bytes");
    has(message(0x218, &[0xff; 4]), "found 4294967295 surfels");
    // Fewer than there are: one of the two numbers is wrong.
    has(
        message(0x218, &[0, 0, 0, 2]),
        "found 2 surfels of 50 bytes in a block of 150 bytes, expected a block that holds",
    );
    has(message(0x220, &[0xff; 4]), "tag 0171");
    has(message(0x224, &[0xff; 4]), "4294967295, expected bytes inside the file of 764 bytes (tag 0171)");
}

#[test]
fn one_block_for_many_sets_does_not_multiply() {
    let [set, resolution] = sfl_set(0, &[(0, 0)], 12, &be(&[0.0; 300]), &[]);
    let mut directories = vec![vec![]];
    (0..40).for_each(|_| directories.extend([set.clone(), resolution.clone()]));
    let mut bytes = sfl_file(&directories);
    assert!(parse(&bytes, ModelFormat::Sfl).is_ok());
    // Every set names the last one's block, made larger.
    let block = bytes.len() as u32 - 1200;
    let entries: Vec<usize> =
        bytes.windows(4).enumerate().filter(|(_, w)| *w == [1, 0x71, 0, 10]).map(|(i, _)| i).collect();
    assert_eq!(entries.len(), 40);
    let at = 20_000;
    for i in entries {
        bytes[i - 4..i].copy_from_slice(&1500_u32.to_be_bytes());
        bytes[i + 4..i + 8].copy_from_slice(&18_000_u32.to_be_bytes());
        bytes[i + 8..i + 12].copy_from_slice(&(block - at).to_be_bytes());
    }
    assert!(refused(&bytes, ModelFormat::Sfl).to_string().contains("shared with another set"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn noise_never_panics(bytes in proptest::collection::vec(any::<u8>(), 0..600), which in 0..FORMATS.len()) {
        let sfl = b"GFLF\0\0\0\0SFLF\0\0\0\0\0\0\0\x14";
        let bin = b"\x89SPLAT\r\n\x01\0\0\0";
        // No flags, surfels or origin, a number of columns from the noise, and the noise as directory.
        let columns = &bytes[..bytes.len().min(1)];
        let second = [&b"\x89SPLAT\r\n\x02\0\0\0"[..], &[0; 40], columns, &[0; 11], &bytes].concat();
        let _ = parse(&second, ModelFormat::Bin);
        let spz = b"NGSP\x04\0\0\0\x02\0\0\0\0\x0c\0\x05\x20\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0";
        let glb = b"glTF\x02\0\0\0\x14\0\0\0";
        let nrrd = b"NRRD0004\ntype: float\ndimension: 3\nendian: big\nencoding: gzip\nsizes: 1 2 ";
        let las = b"LASF\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x01\x04";
        let e57 = b"ASTM-E57\x01\0\0\0\0\0\0\0";
        let npy = b"\x93NUMPY\x01\x00\x40\0{'descr': '<f4', 'fortran_order': False, 'shape': (9, 3)}";
        let marks: [&[u8]; 15] = [
            b"ply\n", sfl, b"v 1 2 3\nf ", bin, b"1 2 3\n", b"2\n1 2 3 ", b"", b"PK\x03\x04", spz, glb, nrrd, las, e57,
            npy, b"PK\x03\x04",
        ];
        let _ = parse(&bytes, FORMATS[which]);
        let _ = parse(&[marks[which], &bytes].concat(), FORMATS[which]);
    }

    #[test]
    fn damaged_files_never_panic(
        seed in any::<prop::sample::Index>(),
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..5_u8), 1..6),
    ) {
        use std::sync::OnceLock;
        static SEEDS: OnceLock<Vec<(ModelFormat, Vec<u8>)>> = OnceLock::new();
        let (format, mut bytes) = seed.get(SEEDS.get_or_init(seeds)).clone();
        for (place, value, how) in changes {
            let at = place.index(bytes.len());
            match how {
                0 => bytes[at] = value,
                1 => bytes[at] ^= 1 << (value % 8),
                2 => bytes.insert(at, value),
                3 => bytes.truncate(at.max(1)),
                _ => bytes[at..].iter_mut().take(4).for_each(|b| *b = 0xff),
            }
        }
        if format == ModelFormat::Bin && bytes.len() > 64 {
            seal(&mut bytes);
        }
        let _ = parse(&bytes, format);
    }
}

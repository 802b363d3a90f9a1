//! NRRD: grids of values.

use std::fmt::Write as _;
use std::path::Path;

use glam::{DMat3, DVec3};
use proptest::prelude::*;
use splatblur::model::generate_volume::{self, FieldShape, Storage};
use splatblur::model::{Grid, ModelFormat, Parsed, parse};

use super::support::refused;

fn grid(bytes: &[u8]) -> Grid {
    match parse(bytes, ModelFormat::Nrrd) {
        Ok(Parsed::Grid(grid)) => grid,
        Ok(other) => panic!("no grid: {other:?}"),
        Err(error) => panic!("{error}\n{}", String::from_utf8_lossy(bytes.get(..300).unwrap_or(bytes))),
    }
}

fn says(bytes: &[u8], part: &str) {
    let e = refused(bytes, ModelFormat::Nrrd).to_string();
    assert!(e.contains(part) && e.len() < 400 && !e.contains('\n'), "{e}\n  expected {part}");
}

/// A file of bytes: its fields but for type, dimension and encoding, and the values.
fn bytes(fields: &str, values: &[u8]) -> Vec<u8> {
    let head =
        format!("NRRD0005\n# a comment\ntype: unsigned char\ndimension: 3\n{fields}encoding: raw\nkey:=value\n\n");
    [head.as_bytes(), values].concat()
}

/// 2 x 3 x 4 values from 0 to 23.
fn small(fields: &str) -> Vec<u8> {
    bytes(&format!("sizes: 2 3 4\n{fields}"), &(0..24).collect::<Vec<u8>>())
}

#[cfg(feature = "formats")]
fn gzip(bytes: &[u8]) -> Vec<u8> {
    use std::io::Write as _;
    let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::new(6));
    out.write_all(bytes).unwrap();
    out.finish().unwrap()
}

const TYPES: [(&str, usize); 10] = [
    ("signed char", 1),
    ("uint8_t", 1),
    ("short", 2),
    ("unsigned short int", 2),
    ("INT32", 4),
    ("uint", 4),
    ("long long", 8),
    ("uint64", 8),
    ("float", 4),
    ("double", 8),
];

/// The bytes of whole numbers from 0 to 127 in a type.
fn encoded(values: &[i8], kind: &str, size: usize, little: bool) -> Vec<u8> {
    let one = |value: i8| {
        let mut raw = match kind {
            "float" => f32::from(value).to_be_bytes().to_vec(),
            "double" => f64::from(value).to_be_bytes().to_vec(),
            _ => i64::from(value).to_be_bytes()[8 - size..].to_vec(),
        };
        if little {
            raw.reverse();
        }
        raw
    };
    values.iter().flat_map(|value| one(*value)).collect()
}

/// All types, both orders of bytes, all encodings.
fn of_type(values: &[i8], sizes: [usize; 3], (kind, size): (&str, usize), little: bool, encoding: &str) -> Vec<u8> {
    let [x, y, z] = sizes;
    let endian = if little { "little" } else { "BIG" };
    let mut out =
        format!("NRRD0001\r\nType: {kind}\r\nDimension: 3\r\nsizes: {x} {y} {z}\r\nendian: {endian}\r\n").into_bytes();
    out.extend(format!("encoding: {encoding}\r\n\r\n").bytes());
    let raw = encoded(values, kind, size, little);
    match encoding {
        "raw" => out.extend(raw),
        #[cfg(feature = "formats")]
        "gzip" => out.extend(gzip(&raw)),
        _ => {
            let mut text = String::new();
            for value in values {
                writeln!(text, "{value}.0").unwrap();
            }
            out.extend(text.bytes());
        }
    }
    out
}

#[cfg(feature = "formats")]
const ENCODINGS: [&str; 3] = ["raw", "gzip", "text"];
#[cfg(not(feature = "formats"))]
const ENCODINGS: [&str; 2] = ["raw", "text"];

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_is_read(
        values in prop::collection::vec(0..=127_i8, 24),
        sizes in prop::sample::select(vec![[1, 1, 24], [2, 3, 4], [24, 1, 1], [4, 3, 2]]),
        kind in prop::sample::select(TYPES.to_vec()),
        little in any::<bool>(),
        encoding in prop::sample::select(ENCODINGS.to_vec()),
    ) {
        let read = grid(&of_type(&values, sizes, kind, little, encoding));
        prop_assert_eq!(read.sizes, sizes);
        prop_assert_eq!(read.values, values.into_iter().map(f32::from).collect::<Vec<_>>());
        prop_assert_eq!((read.origin, read.steps), (DVec3::ZERO, DMat3::IDENTITY));
        prop_assert!(read.notes.is_empty());
    }

    #[test]
    fn damaged_headers_are_no_panic(
        edits in prop::collection::vec((0..400_usize, 0..12_usize, prop_oneof![
            prop::collection::vec(any::<u8>(), 0..4),
            prop::sample::select(vec!["-1", "0", "1e308", "NaN", "none", "(", ")", "\n", "\n\n", ":", "9999999999"])
                .prop_map(|s| s.as_bytes().to_vec()),
        ]), 1..4),
        oblique in any::<bool>(),
    ) {
        let places = if oblique {
            "space dimension: 3\nspace directions: (1,0,0) (0,2,0) (0,0,3)\nspace origin: (1,2,3)\n\
             kinds: domain domain domain\n"
        } else {
            "spacings: 1 2 NaN\naxis mins: 1 2 3\naxis maxs: NaN NaN 4\ncenterings: cell node none\n\
             line skip: 0\nbyte skip: 0\n"
        };
        let mut file = small(places);
        for (at, cut, insert) in edits {
            let at = at.min(file.len());
            file.splice(at..(at + cut).min(file.len()), insert);
        }
        if let Ok(Parsed::Grid(read)) = parse(&file, ModelFormat::Nrrd) {
            prop_assert_eq!(read.values.len(), read.sizes.iter().product::<usize>());
            prop_assert!(read.values.iter().all(|value| value.is_finite()));
            prop_assert!(read.steps.is_finite() && read.origin.is_finite());
        }
    }
}

#[test]
fn signed_numbers_keep_their_sign() {
    for (kind, raw, expected) in [
        ("int8", vec![0xff], -1.0),
        ("uchar", vec![0xff], 255.0),
        ("int16", vec![0xfe, 0xff], -2.0),
        ("ushort", vec![0xfe, 0xff], 65534.0),
        ("int", vec![0xfd, 0xff, 0xff, 0xff], -3.0),
        ("uint32", vec![0, 0, 0, 0x80], 2_147_483_648.0),
        ("int64", vec![0xfc, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff], -4.0),
        ("ulonglong", vec![0, 0, 0, 0, 0, 0, 0, 0x80], 9_223_372_036_854_775_808.0),
        ("float", 0.1_f32.to_le_bytes().to_vec(), 0.1),
        ("double", (-1.5e10_f64).to_le_bytes().to_vec(), -1.5e10),
    ] {
        let head = format!("NRRD0004\ntype: {kind}\ndimension: 3\nsizes: 1 1 1\nendian: little\nencoding: raw\n\n");
        assert_eq!(grid(&[head.as_bytes(), &raw].concat()).values, [expected], "{kind}");
    }
}

#[test]
fn places_of_the_file() {
    let placed = |fields: &str| {
        let read = grid(&small(fields));
        (read.origin, read.steps)
    };
    let straight = |x, y, z| DMat3::from_diagonal(DVec3::new(x, y, z));
    assert_eq!(placed(""), (DVec3::ZERO, DMat3::IDENTITY));
    assert_eq!(placed("spacings: 0.5 2 nan\n"), (DVec3::ZERO, straight(0.5, 2.0, 1.0)));
    assert_eq!(placed("spacings: 1 2 3\nspace origin: (4,-5,6.5)\n").0, DVec3::new(4.0, -5.0, 6.5));
    // Cells: ends are half a step beyond the samples. Nodes: samples stand at the ends.
    let ends = "axis mins: -1 -1 -1\naxis maxs: 1 1 1\n";
    let (origin, steps) = placed(ends);
    // Rounding of f64 in thirds.
    assert!((origin - DVec3::new(-0.5, -2.0 / 3.0, -0.75)).length() < 1e-15, "{origin}");
    assert_eq!(steps, straight(1.0, 2.0 / 3.0, 0.5));
    let nodes = format!("{ends}centers: node node node\n");
    assert_eq!(placed(&nodes), (DVec3::splat(-1.0), straight(2.0, 1.0, 2.0 / 3.0)));
    let mixed = "axismins: 1 NaN NaN\naxis maxs: NaN 5 NaN\nspacings: 2 2 2\ncenterings: cell node ???\n";
    assert_eq!(placed(mixed), (DVec3::new(2.0, 1.0, 0.0), straight(2.0, 2.0, 2.0)));
    assert_eq!(placed("axis mins: 1 1 1\naxis maxs: -1 2 3\n").1.x_axis, DVec3::new(-1.0, 0.0, 0.0));
    // Directions, turned and mirrored.
    let (origin, steps) = placed("space: left-posterior-superior\nspace directions: (0, 2, 0) (-1,0,0) (0,0,0.5)\n");
    let expected = DMat3::from_cols(2.0 * DVec3::Y, -DVec3::X, 0.5 * DVec3::Z);
    assert_eq!((origin, steps), (DVec3::ZERO, expected));
    let notes = grid(&small("space: left-posterior-superior\n")).notes;
    assert!(notes[0].contains("`left-posterior-superior`: its axes are taken as x, y, z"), "{notes:?}");
}

#[test]
fn axes_that_say_nothing_are_passed_over() {
    let values: Vec<u8> = (0..24).collect();
    let file = |dimension: u32, fields: &str| {
        let head = format!("NRRD0004\ntype: uchar\ndimension: {dimension}\n{fields}encoding: raw\n\n");
        [head.as_bytes(), &values].concat()
    };
    let read = grid(&file(4, "sizes: 1 2 3 4\nspacings: 9 1 2 3\nkinds: vector domain domain domain\n"));
    assert_eq!((read.sizes, read.spacings()), ([2, 3, 4], DVec3::new(1.0, 2.0, 3.0)));
    let read = grid(&file(4, "sizes: 2 3 4 1\nspace directions: (1,0,0) (0,2,0) (0,0,3) none\n"));
    assert_eq!((read.sizes, read.spacings()), ([2, 3, 4], DVec3::new(1.0, 2.0, 3.0)));
    assert_eq!(grid(&file(5, "sizes: 1 24 1 1 1\n")).sizes, [24, 1, 1]);
    says(&file(4, "sizes: 3 2 2 2\n"), "line 4: found 4 axes of more than one sample, expected three axes of space");
    let of_colours = "sizes: 3 2 2 2\nkinds: RGB-color domain domain domain\n";
    says(&file(4, of_colours), "line 4: found 3 values at each place, along axis 0 (`rgb-color`), expected three axes");
    says(&file(3, "sizes: 4 2 3\nkinds: 4-vector domain domain\n"), "4 values at each place, along axis 0");
    says(&file(4, "sizes: 3 2 2 2\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\n"), "3 values at each place");
    says(&file(2, "sizes: 4 6\n"), "found 2 axes of space, expected three");
}

#[test]
fn lines_and_bytes_before_the_values() {
    let with = |fields: &str, before: &[u8], after: &[u8]| {
        let values: Vec<u8> = (0..24).collect();
        bytes(&format!("sizes: 2 3 4\n{fields}"), &[before, &values, after].concat())
    };
    for file in [
        with("line skip: 2\n", b"one\ntwo\n", b""),
        with("byte skip: 5\n", b"12345", b""),
        with("lineskip: 1\nbyteskip: 2\n", b"one\n12", b""),
        with("byte skip: -1\n", b"whatever", b""),
    ] {
        let read = grid(&file);
        assert_eq!((read.values[0], read.values[23]), (0.0, 23.0));
        assert!(read.notes.is_empty());
    }
    assert_eq!(grid(&with("", b"", b"more")).notes, ["4 bytes after the last value ignored"]);
    says(&with("byte skip: 1\n", b"", b""), "found 23 bytes of values, expected 24 for 2 x 3 x 4 of type uint8");
    says(&with("byte skip: 99999999999999\n", b"", b""), "found 0 bytes of values");
    says(&with("line skip: 9\n", b"", b""), "expected 9 lines before the data (line skip)");
    says(&with("line skip: -1\n", b"", b""), "line skip of `-1`, expected a whole number from 0");
    says(&with("byte skip: -2\n", b"", b""), "byte skip of `-2`");
}

#[test]
fn values_that_are_not_finite_become_the_least() {
    let head = "NRRD0004\ntype: double\ndimension: 3\nsizes: 5 1 1\nencoding: ascii\n\n";
    let read = grid(format!("{head}2 nan -1 inf 1e300\n").as_bytes());
    assert_eq!(read.values, [2.0, -1.0, -1.0, -1.0, -1.0]);
    assert_eq!(read.notes, ["3 values that are not finite are taken as the least, -1"]);
    assert_eq!(grid(format!("{head}nan nan nan nan nan").as_bytes()).values, [0.0; 5]);
    says(format!("{head}1 2 3 4").as_bytes(), "found 7 bytes of values, expected 9 for 5 x 1 x 1");
    says(format!("{head}1 2 333 4").as_bytes(), "line 7: found the end of the file after 4 values, expected 5");
    says(format!("{head}1 2\n3 x 5").as_bytes(), "line 8: found `x`, expected a number");
    says(format!("{head}1 2 3 4 5 6").as_bytes(), "line 7: found `6` after the last value, expected 5 values");
}

#[test]
fn headers_that_are_refused() {
    let head = |lines: &str| format!("NRRD0004\n{lines}\n0123456789").into_bytes();
    let good = ["type: uchar\n", "dimension: 3\n", "sizes: 2 2 2\n", "encoding: raw\n"];
    let with = |line: &str| {
        let name = line.split(':').next().unwrap();
        let kept: String = good.iter().filter(|l| !l.starts_with(&format!("{name}:"))).copied().collect();
        head(&format!("{line}\n{kept}"))
    };
    assert_eq!(grid(&head(&good.concat())).values.len(), 8);
    for name in ["type", "dimension", "sizes", "encoding"] {
        let rest: String = good.iter().filter(|l| !l.starts_with(name)).copied().collect();
        says(&head(&rest), &format!("line 5: found no field `{name}`, expected fields `type`"));
    }
    for (line, part) in [
        ("type: block", "line 2: found type `block`, expected whole numbers"),
        ("type: ", "found type ``"),
        ("dimension: 0", "line 2: found dimension `0`, expected 3 (from 1 to 16)"),
        ("dimension: 17", "dimension `17`"),
        ("dimension: -3", "dimension `-3`"),
        ("sizes: 2 2", "line 2: found sizes `2 2`, expected 3 whole numbers from 1, one for each axis"),
        ("sizes: 2 0 2", "sizes `2 0 2`"),
        ("sizes: 2 -2 2", "sizes `2 -2 2`"),
        ("sizes: 2 2 2.5", "sizes `2 2 2.5`"),
        ("sizes: 4294967296 4294967296 2", "expected fewer than 2^64 bytes of values"),
        ("sizes: 99999999999999999999 1 1", "sizes `99999999999999999999 1 1`"),
        ("sizes: 4096 4096 4096", "line 2: found 68719476736 values, expected at most 134219"),
        ("sizes: 3 3 3", "found 10 bytes of values, expected 27 for 3 x 3 x 3 of type uint8: is the file cut short?"),
        ("encoding: hex", "line 2: found encoding `hex`, expected `raw`, `gzip` or `text`"),
        ("encoding: bzip2", "encoding `bzip2`"),
        ("endian: middle", "line 2: found endian `middle`, expected `little` or `big`"),
        ("type: short", "found no field `endian` for values of type int16"),
        (
            "data file: a.raw",
            "line 2: found a detached header (`data file: a.raw`), expected the data in the same file",
        ),
        ("datafile: LIST", "a detached header"),
        ("spacings: 1 2", "line 2: found spacings `1 2`, expected 3 numbers"),
        ("spacings: 1 2 x", "spacings `1 2 x`"),
        ("spacings: 1 inf 1", "spacings `1 inf 1`"),
        ("spacings: 1 0 1", "line 2: found neighbours at a distance of 0, expected from 1e-9 to 1e9"),
        ("spacings: 1 1 1e10", "found neighbours at a distance of 10000000000"),
        ("axis mins: 2e18 0 0", "found samples at"),
        ("space directions: (1,0,0) (0,1,0)", "expected 3 times `(x,y,z)` or `none`"),
        ("space directions: (1,0,0) (0,1,0) (0,0)", "expected 3 times"),
        ("space directions: (1,0,0) (0,1,0) (0,0,nan)", "expected 3 times"),
        ("space directions: (1,0,0) (0,1,0) 0,0,1", "expected 3 times"),
        ("space directions: (1,0,0) (0,1,0) (0,0,1", "expected 3 times"),
        ("space directions: (1,0,0) (0,1,0) none", "2 values at each place, along axis 2"),
        (
            "space directions: (1,0,0) (0.5,1,0) (0,0,1)",
            "space directions 0 and 1 at an angle of 63.435 degrees (a shear)",
        ),
        ("space directions: (1,0,0) (0,1,0) (0,0,0)", "at a distance of 0"),
        ("space origin: (1,2)", "expected 1 times `(x,y,z)`"),
        ("space origin: none", "space origin"),
        ("no colon", "line 2: found `no colon`, expected `field: text`, `key:=value`, `# comment` or an empty line"),
    ] {
        // What is not refused for its words has an origin of none, which is no place.
        if line == "space origin: none" {
            assert_eq!(grid(&with(line)).origin, DVec3::ZERO);
            continue;
        }
        says(&with(line), part);
    }
    says(&head(&format!("{}Sizes: 2 2 2\n", good.concat())), "line 6: found a second field `sizes`");
    says(b"NRRD0006\n\n", "line 1: found `NRRD0006`, expected `NRRD0001` to `NRRD0005`");
    says(b"NRRD\n\n", "line 1: found `NRRD`");
    says(b"", "line 1: found the end of the file, expected an empty line");
    says(b"NRRD0001\ntype: uchar\n", "line 3: found the end of the file");
    says(&[&b"NRRD0001\n#"[..], &vec![b'x'; 2 << 20]].concat(), "line 2: found a header longer than 1 MiB");
}

#[test]
fn cut_short_at_every_byte() {
    let values: Vec<i8> = (0..24).collect();
    for encoding in ENCODINGS {
        let whole = of_type(&values, [2, 3, 4], ("short", 2), true, encoding);
        assert_eq!(grid(&whole).values.len(), 24);
        // The last number of a text may be shorter.
        let spare = if encoding == "text" { 4 } else { 0 };
        for length in 0..whole.len() - spare {
            let e = refused(&whole[..length], ModelFormat::Nrrd).to_string();
            assert!(!e.contains('\n'), "{e}");
        }
    }
}

#[cfg(feature = "formats")]
#[test]
fn gzip_holds_what_the_sizes_say() {
    let file = |sizes: &str, packed: &[u8], fields: &str| {
        let head = format!("NRRD0004\ntype: uchar\ndimension: 3\nsizes: {sizes}\n{fields}encoding: gz\n\n");
        [head.as_bytes(), packed].concat()
    };
    let values: Vec<u8> = (0..24).collect();
    let packed = gzip(&values);
    assert_eq!(grid(&file("2 3 4", &packed, "")).values[23], 23.0);
    let skipped = gzip(&[b"12345", values.as_slice()].concat());
    assert_eq!(grid(&file("2 3 4", &skipped, "byte skip: 5\n")).values[23], 23.0);
    assert_eq!(grid(&file("2 3 4", &[&b"a line\n"[..], &packed].concat(), "line skip: 1\n")).values[23], 23.0);
    assert_eq!(
        grid(&file("2 3 4", &[&packed[..], b"abc"].concat(), "")).notes,
        ["3 bytes after the gzip stream ignored"]
    );
    says(&file("2 3 5", &packed, ""), "found 24 bytes of values, expected 30 for 2 x 3 x 5 of type uint8");
    says(&file("2 3 3", &packed, ""), "found more than 18 bytes of values when inflated, expected 18 for 18 values");
    says(&file("2 3 4", &packed, "byte skip: 1\n"), "found 23 bytes of values");
    says(&file("2 3 4", &packed, "byte skip: 25\n"), "found 24 inflated bytes, expected 25 to skip");
    says(&file("2 3 4", &packed, "byte skip: -1\n"), "a byte skip of -1 in gzip");
    says(&file("2 3 4", b"not gzip at all, but long enough", ""), "a gzip stream that fails");
    let mut bad_sum = packed.clone();
    let at = bad_sum.len() - 6;
    bad_sum[at] ^= 1;
    says(&file("2 3 4", &bad_sum, ""), "a gzip stream that fails");
    for at in 0..packed.len() {
        let mut damaged = packed.clone();
        damaged[at] ^= 0x55;
        let _ = parse(&file("2 3 4", &damaged, ""), ModelFormat::Nrrd);
    }
}

#[cfg(feature = "formats")]
#[test]
fn bombs_are_refused_at_once() {
    use std::time::{Duration, Instant};
    let start = Instant::now();
    let head = |sizes: &str| format!("NRRD0004\ntype: uchar\ndimension: 3\nsizes: {sizes}\nencoding: gzip\n\n");
    // 64 MB of zeros in 64 kB, behind sizes that are smaller, larger, and larger than any stream of this length.
    let packed = gzip(&vec![0; 64 << 20]);
    for (sizes, part) in [
        ("4 4 4", "more than 64 bytes of values when inflated"),
        ("404 408 408", "bytes of values, expected 67251456"),
        ("512 512 511", "no gzip stream holds as much"),
        ("512 512 700", "line 4: found 183500800 values, expected at most"),
    ] {
        says(&[head(sizes).as_bytes(), &packed].concat(), part);
    }
    // Smoke is mostly zeros: as many as this are read.
    assert_eq!(grid(&[head("256 512 512").as_bytes(), &packed].concat()).values.len(), 64 << 20);
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}

#[test]
fn known_by_its_first_bytes() {
    assert_eq!(ModelFormat::detect(&small(""), Path::new("a.dat")), Some(ModelFormat::Nrrd));
}

/// The generator writes what the guide says, and the reader finds it there.
#[test]
fn generated_volumes_are_their_formulas() {
    for (shape, storage, tolerance) in [
        // Half a step of a byte, and half a step of a float below 1.
        (FieldShape::Torus, Storage::Uint8, 0.5 / 255.0 + 1e-7),
        (FieldShape::Sphere, Storage::Float, 3e-8),
        (FieldShape::Zebra, Storage::Float, 3e-8),
    ] {
        let mut file = Vec::new();
        generate_volume::write(shape, 20, storage, &mut file).unwrap();
        let read = grid(&file);
        assert_eq!((read.sizes, read.storage.len()), ([20; 3], 5));
        assert!((read.extent() - DVec3::splat(2.0)).length() < 1e-14);
        let scale = if storage == Storage::Uint8 { 255.0 } else { 1.0 };
        for (i, value) in read.values.iter().enumerate() {
            let p = read.origin + read.steps * DVec3::new((i % 20) as f64, (i / 20 % 20) as f64, (i / 400) as f64);
            assert!(p.abs().max_element() < 0.951);
            let expected = match shape {
                FieldShape::Torus => {
                    let d = ((p.x.hypot(p.z) - 0.6).powi(2) + p.y * p.y).sqrt();
                    (-(d / 0.2).powi(2)).exp()
                }
                FieldShape::Sphere => (0.5 + (0.7 - p.length()) / 0.1).clamp(0.0, 1.0),
                FieldShape::Zebra => {
                    (0.5 + (0.7 - p.length()) / 0.1).clamp(0.0, 1.0)
                        * (0.5 + 0.5 * (10.0 * std::f64::consts::PI * p.y).cos())
                }
            };
            assert!((f64::from(*value) / scale - expected).abs() <= tolerance, "{shape:?} {p}: {value} {expected}");
        }
    }
}

//! Files of laser scanners: made by the libraries that people use for them, read to the same numbers.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use proptest::prelude::*;
use splatblur::model::{
    Cloud, ColourBy, ColourMap, ColourStorage, LoadOptions, LoadedModel, LoadedShape, ModelFormat, Parsed,
    PointOptions, load, parse, scan_facts,
};

use super::support::{cloud, refused};

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/scans").join(name)
}

fn read(name: &str) -> Vec<u8> {
    std::fs::read(data(name)).unwrap()
}

/// A line of `points.csv`.
struct Point {
    place: DVec3,
    colour: [u16; 3],
    intensity: u16,
    class: u8,
    station: u16,
}

fn points() -> Vec<Point> {
    let text = String::from_utf8(read("points.csv")).unwrap();
    let of_line = |line: &str| {
        let n: Vec<f64> = line.split(',').map(|word| word.parse().unwrap()).collect();
        let colour = [n[3], n[4], n[5]].map(|c| c as u16);
        let place = DVec3::new(n[0], n[1], n[2]);
        Point { place, colour, intensity: n[6] as u16, class: n[7] as u8, station: n[8] as u16 }
    };
    text.lines().skip(1).map(of_line).collect()
}

/// A colour as files of 16 and of 8 bits have it.
fn colour(point: &Point, bits: u32) -> Vec3 {
    let wide = Vec3::from(point.colour.map(f32::from));
    if bits == 16 { wide / 65535.0 } else { (wide / 257.0).floor() / 255.0 }
}

/// Whole thousandths; E57 has floats relative to the scanner.
fn is_near(found: &Cloud, i: usize, place: DVec3) {
    assert!(found.position[i].distance(place) < 2e-6, "point {i}: {} for {place}", found.position[i]);
}

const LAS: [(&str, Option<u32>); 9] = [
    ("0.laz", None),
    ("1.las", None),
    ("2.laz", Some(8)),
    ("3.laz", Some(16)),
    ("6.laz", None),
    ("7.las", Some(16)),
    ("7.laz", Some(16)),
    ("8.laz", Some(8)),
    ("copc.laz", Some(16)),
];

#[test]
fn las_and_laz_of_every_format_have_the_numbers_that_were_written() {
    let points = points();
    for (name, bits) in LAS {
        let found = cloud(&read(name), ModelFormat::Las);
        let withheld = usize::from(name == "6.laz");
        assert_eq!(found.position.len(), points.len() - withheld, "{name}: {:?}", found.notes);
        assert_eq!(found.colour_storage, ColourStorage::Integer);
        let white = {
            let mut all: Vec<u16> = points.iter().map(|point| point.intensity).collect();
            all.sort_unstable();
            f32::from(all[all.len() - 1])
        };
        for (i, point) in points.iter().enumerate().take(found.position.len()) {
            is_near(&found, i, point.place);
            let expected = bits.map_or(Vec3::splat(f32::from(point.intensity) / white), |bits| colour(point, bits));
            let difference = (found.colour[i] - expected).abs().max_element();
            assert!(difference < 2e-3, "{name}, point {i}: {} for {expected}", found.colour[i]);
        }
        let notes = found.notes.join("; ");
        assert!(notes.contains("2 (ground)") && notes.contains("7 (noise)"), "{name}: {notes}");
        assert_eq!(notes.contains("1 points dropped: the file withholds them"), withheld > 0, "{name}: {notes}");
    }
}

#[test]
fn e57_has_the_scans_where_they_stood() {
    let points = points();
    let found = cloud(&read("two.e57"), ModelFormat::E57);
    // The fourth point of each scan is not valid.
    let valid = |i: &usize| ![3, 73].contains(i);
    let kept: Vec<&Point> = (0..points.len()).filter(valid).map(|i| &points[i]).collect();
    assert_eq!(found.position.len(), kept.len(), "{:?}", found.notes);
    for (i, point) in kept.into_iter().enumerate() {
        is_near(&found, i, point.place);
        assert!((found.colour[i] - colour(point, 8)).abs().max_element() < 1e-6, "point {i}");
        assert_eq!(found.station[i], point.station, "point {i}");
    }
    assert_eq!(found.stations, [[500_001.0, 4_649_002.0, 121.0], [500_005.0, 4_649_000.0, 122.0]].map(DVec3::from));
    assert_eq!(found.notes, ["2 points dropped: the file says that they are not valid"]);
}

fn loaded(path: &Path, points: PointOptions) -> LoadedModel {
    load(path, &LoadOptions { points, ..LoadOptions::default() }, &|_, _| {}).unwrap()
}

fn places(model: &LoadedModel) -> Vec<DVec3> {
    let LoadedShape::Surfels(surfels, _) = &model.shape else { panic!("no surfels") };
    surfels.position.iter().map(|p| surfels.origin + p.as_dvec3()).collect()
}

#[test]
fn classes_and_every_nth_point_are_chosen() {
    let points = points();
    for name in ["1.las", "7.laz", "copc.laz"] {
        let options = PointOptions { every: 3, classes: vec![2, 6], ..PointOptions::default() };
        let found = places(&loaded(&data(name), options));
        let wanted = points.iter().filter(|point| [2, 6].contains(&point.class)).step_by(3);
        let wanted: Vec<DVec3> = wanted.map(|point| point.place).collect();
        assert_eq!(found.len(), wanted.len());
        assert!(found.iter().zip(&wanted).all(|(a, b)| a.distance(*b) < 1e-4), "{name}");
    }
    let folder = tempfile::tempdir().unwrap();
    let text = folder.path().join("a.xyz");
    std::fs::write(&text, "0 0 0\n1 0 0\n2 0 0\n3 1 0\n4 0 0\n").unwrap();
    let found = places(&loaded(&text, PointOptions { every: 2, ..PointOptions::default() }));
    assert_eq!(found.iter().map(|p| p.x).collect::<Vec<_>>(), [0.0, 2.0, 4.0]);
    let refused = |path: &Path, points| {
        load(path, &LoadOptions { points, ..LoadOptions::default() }, &|_, _| {}).unwrap_err().to_string()
    };
    let why = refused(&text, PointOptions { classes: vec![2], ..PointOptions::default() });
    assert!(why.ends_with("found points without classes, expected LAS or LAZ, as `classes` are named"), "{why}");
    let why = refused(&data("../models/BoxTextured.glb"), PointOptions { every: 2, ..PointOptions::default() });
    assert!(why.contains("expected a cloud of points"), "{why}");
}

#[test]
fn several_files_are_one_model() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["7.las", "7.laz"] {
        std::fs::copy(data(name), folder.path().join(name)).unwrap();
    }
    let found = loaded(&folder.path().join("7.*"), PointOptions::default());
    let points = points();
    let wanted: Vec<DVec3> = points.iter().chain(&points).map(|point| point.place).collect();
    let places = places(&found);
    assert_eq!(places.len(), wanted.len());
    assert!(places.iter().zip(&wanted).all(|(a, b)| a.distance(*b) < 1e-4));
    assert!(found.notes.contains(&"2 files".to_owned()), "{:?}", found.notes);
}

/// A room that is seen from inside: all walls face the scanner, and both of their sides show.
#[test]
fn normals_face_the_scanner() {
    let mut text = String::new();
    for i in 0..2000_u32 {
        let part = |factor: f64| f64::from(i).mul_add(factor, 0.3).fract() * 2.0 - 1.0;
        let [a, b] = [part(0.754_877_666), part(0.569_840_291)];
        let [x, y, z] = match i % 6 {
            0 => [1.0, a, b],
            1 => [-1.0, a, b],
            2 => [a, 1.0, b],
            3 => [a, -1.0, b],
            4 => [a, b, 1.0],
            _ => [a, b, -1.0],
        };
        writeln!(text, "{} {y} {z}", x + 1000.0).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.xyz");
    std::fs::write(&path, text).unwrap();
    let scanner = DVec3::new(1000.2, 0.1, -0.3);
    let found = loaded(&path, PointOptions { scanner: Some(scanner), ..PointOptions::default() });
    let LoadedShape::Surfels(surfels, _) = &found.shape else { panic!("no surfels") };
    let to = (scanner - surfels.origin).as_vec3();
    let away = (0..surfels.len()).filter(|&i| surfels.normal[i].dot(to - surfels.position[i]) < 0.0).count();
    assert_eq!(away, 0);
    assert!(surfels.two_sided);
    assert!(found.notes.iter().any(|note| note.ends_with("turned to the scanners: both sides show")));
    // Without it the same room is a closed body, whose walls face outward.
    let found = loaded(&path, PointOptions::default());
    let LoadedShape::Surfels(surfels, _) = &found.shape else { panic!("no surfels") };
    let away = (0..surfels.len()).filter(|&i| surfels.normal[i].dot(to - surfels.position[i]) < 0.0).count();
    assert!(away > 1900, "{away}");
}

#[test]
fn headers_say_what_is_inside() {
    let facts = |name: &str| scan_facts(&data(name)).unwrap().unwrap();
    let las = facts("7.las");
    assert_eq!((las.format.as_str(), las.points), ("LAS 1.4, points of format 7", 120));
    let bounds = las.bounds.unwrap();
    let points = points();
    let least = points.iter().fold(DVec3::INFINITY, |least, point| least.min(point.place));
    let greatest = points.iter().fold(DVec3::NEG_INFINITY, |greatest, point| greatest.max(point.place));
    assert!(bounds.min.distance(least) < 1e-6 && bounds.max.distance(greatest) < 1e-6, "{bounds:?}");
    assert!(las.columns.contains(&"colour".to_owned()), "{:?}", las.columns);
    assert_eq!(facts("7.laz").format, "LAZ 1.4, points of format 7");
    assert!(facts("copc.laz").format.starts_with("COPC 1.4"));
    let e57 = facts("two.e57");
    assert_eq!((e57.points, e57.scans.len()), (120, 2));
    assert_eq!(e57.scans[1].name, "station 1");
    assert_eq!(e57.scans[1].station, Some(DVec3::new(500_005.0, 4_649_000.0, 122.0)));
    assert_eq!(scan_facts(&data("points.csv")).unwrap(), None);
}

/// Bytes of a file, with a change.
fn changed(name: &str, at: usize, to: &[u8]) -> Vec<u8> {
    let mut bytes = read(name);
    bytes[at..at + to.len()].copy_from_slice(to);
    bytes
}

#[test]
fn lying_headers_are_refused_in_one_line() {
    let las = |at: usize, to: &[u8]| refused(&changed("7.las", at, to), ModelFormat::Las).to_string();
    // Billions of points: the large count, and the small one of a packed file.
    assert!(las(247, &(1_u64 << 40).to_le_bytes()).starts_with("byte 247: found 1099511627776 points in"));
    assert!(las(247, &1_000_u64.to_le_bytes()).contains("expected at most 120, which the file has room for"));
    assert!(las(24, &[9, 9]).starts_with("byte 24: found LAS 9.9"));
    assert!(las(104, &[11]).starts_with("byte 104: found points of format 11"));
    assert!(las(105, &[3, 0]).starts_with("byte 105: found points of 3 bytes"));
    assert!(las(131, &0_f64.to_le_bytes()).starts_with("byte 131: found a scale of 0"));
    assert!(las(139, &f64::NAN.to_le_bytes()).starts_with("byte 139: found a scale of NaN"));
    assert!(las(96, &u32::MAX.to_le_bytes()).starts_with("byte 96: found points from byte 4294967295"));
    assert!(las(96, &374_u32.to_le_bytes()).contains("found points from byte 374, expected a place from byte 375"));
    // What a packed file says of its chunks and layers.
    let bytes = read("7.laz");
    let begin = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
    let table = i64::from_le_bytes(bytes[begin..begin + 8].try_into().unwrap()) as usize;
    let laz = |at: usize, to: &[u8]| refused(&changed("7.laz", at, to), ModelFormat::Las).to_string();
    let chunks = laz(table + 4, &u32::MAX.to_le_bytes());
    assert!(chunks.contains("found 4294967295 chunks in"), "{chunks}");
    let place = laz(begin, &i64::MAX.to_le_bytes());
    assert!(place.contains("expected a table of chunks"), "{place}");
    let size = u16::from_le_bytes(bytes[105..107].try_into().unwrap()) as usize;
    let layers = laz(begin + 8 + size + 4, &u32::MAX.to_le_bytes());
    assert!(layers.contains("found layers that are larger than their chunk"), "{layers}");
    let points = laz(247, &100_000_u64.to_le_bytes());
    assert!(points.contains("a damaged chunk") || points.contains("chunks of"), "{points}");
    let format = laz(104, &[128 + 6]);
    assert!(format.contains("found packed points of"), "{format}");
    // E57: the text and the number of points.
    let e57 = refused(&changed("two.e57", 32, &u64::MAX.to_le_bytes()), ModelFormat::E57).to_string();
    assert!(e57.starts_with("byte 32: found a text of 18446744073709551615 bytes, expected at most 10240"), "{e57}");
}

#[test]
fn files_that_are_cut_short_are_refused() {
    for (name, format) in [("1.las", ModelFormat::Las), ("7.laz", ModelFormat::Las), ("two.e57", ModelFormat::E57)] {
        let bytes = read(name);
        for length in (0..bytes.len()).step_by(7) {
            let Ok(Parsed::Cloud(cloud)) = parse(&bytes[..length], format) else { continue };
            panic!("{name} cut to {length} of {} was accepted: {} points", bytes.len(), cloud.position.len());
        }
    }
}

/// Eight bits in sixteen, but for one point: a slip, not a cloud of sixteen bits that is nearly black.
#[test]
fn one_bright_point_makes_no_cloud_black() {
    let mut bytes = read("7.las");
    let begin = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
    let record = bytes[begin..begin + 36].to_vec();
    let points: Vec<Vec<u8>> = (0..2000_u16)
        .map(|i| {
            let mut point = record.clone();
            let colour = if i == 7 { 300_u16 } else { 200 };
            point[30..32].copy_from_slice(&colour.to_le_bytes());
            point[32..36].copy_from_slice(&[100, 0, 50, 0]);
            point
        })
        .collect();
    bytes.truncate(begin);
    bytes.extend(points.concat());
    bytes[247..255].copy_from_slice(&2000_u64.to_le_bytes());
    let found = cloud(&bytes, ModelFormat::Las);
    assert_eq!(found.colour[0], Vec3::new(200.0, 100.0, 50.0) / 255.0);
    assert_eq!(found.colour[7], Vec3::new(255.0, 100.0, 50.0) / 255.0);
    assert!(found.notes.contains(&"colours from 0 to 255".to_owned()), "{:?}", found.notes);
}

proptest! {
    /// Nothing panics, and nothing takes memory for what is not there.
    #[test]
    fn damaged_scans_are_read_or_refused(
        file in 0_usize..10,
        places in prop::collection::vec((0.0..1.0_f64, 0_u8..), 1..6),
    ) {
        let names = LAS.map(|(name, _)| name);
        let (name, format) = names.get(file).map_or(("two.e57", ModelFormat::E57), |name| (*name, ModelFormat::Las));
        let mut bytes = read(name);
        for (at, to) in places {
            let at = (at * bytes.len() as f64) as usize;
            bytes[at] = to;
        }
        if format == ModelFormat::E57 {
            seal(&mut bytes);
        }
        let _ = parse(&bytes, format);
    }
}

/// Makes the sums of the pages of an E57 file right (CRC-32C).
fn seal(bytes: &mut [u8]) {
    let bit = |crc: u32| if crc & 1 == 1 { crc >> 1 ^ 0x82f6_3b78 } else { crc >> 1 };
    for page in bytes.chunks_exact_mut(1024) {
        let (data, at) = page.split_at_mut(1020);
        let sum = !data.iter().fold(!0_u32, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), |crc, _| bit(crc)));
        at.copy_from_slice(&sum.to_be_bytes());
    }
}

/// What the test above changes gets past the sums.
#[test]
fn pages_are_sealed_as_the_library_does() {
    let mut bytes = read("two.e57");
    seal(&mut bytes);
    assert_eq!(bytes, read("two.e57"));
}

/// Points of LAS are coloured by what the file says of each.
#[test]
fn columns_colour_points() {
    let points = points();
    for name in ["7.las", "7.laz"] {
        for (column, values) in [
            ("Intensity", points.iter().map(|point| f64::from(point.intensity)).collect::<Vec<_>>()),
            ("classification", points.iter().map(|point| f64::from(point.class)).collect()),
            ("red", points.iter().map(|point| f64::from(point.colour[0])).collect()),
        ] {
            let map = ColourMap::parse("grey").unwrap();
            let by = ColourBy { column: column.to_owned(), map: map.clone(), range: None };
            let found = loaded(&data(name), PointOptions { colour_by: Some(by), ..PointOptions::default() });
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            let most = values.iter().copied().fold(0.0, f64::max);
            assert_eq!(found.colour_range, Some([least, most]), "{name} {column}");
            let LoadedShape::Surfels(surfels, _) = found.shape else { panic!("{name}") };
            for (value, colour) in values.iter().zip(&surfels.colour) {
                assert_eq!(map.linear((value - least) / (most - least)), Some(*colour), "{name} {column}");
            }
        }
    }
    let by = ColourBy { column: "gps_time".to_owned(), ..ColourBy::default() };
    let options = LoadOptions {
        points: PointOptions { colour_by: Some(by), ..PointOptions::default() },
        ..LoadOptions::default()
    };
    let why = load(&data("two.e57"), &options, &|_, _| {}).unwrap_err().to_string();
    assert!(why.contains("found no column \"gps_time\" to colour by, expected intensity, x, y, z, speed"), "{why}");
}

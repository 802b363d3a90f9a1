//! Tables and arrays of points: files of numpy and pandas (tests/data/tables/make.py), read to the same numbers.

use std::fs;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use splatblur::model::{
    Cloud, ColourBy, ColourMap, Kind, LoadOptions, LoadedModel, LoadedShape, ModelError, ModelFormat, PointOptions,
    Surfels, load,
};

use super::support::{cloud, load_as, refused};

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/tables").join(name)
}

pub(super) fn read(name: &str) -> Vec<u8> {
    fs::read(data(name)).unwrap()
}

/// Lines of truth.csv: x y z vx vy vz red green blue radius pressure id.
fn truth() -> Vec<[f64; 12]> {
    let text = String::from_utf8(read("truth.csv")).unwrap();
    let line = |line: &str| {
        let numbers: Vec<f64> = line.split(',').map(|word| word.parse().unwrap()).collect();
        numbers.try_into().unwrap()
    };
    text.lines().map(line).collect()
}

/// Texts have the shortest digits that give a float of 32 bits back.
fn same(name: &str, found: &Cloud) {
    let truth = truth();
    assert_eq!(found.position.len(), truth.len(), "{name}");
    for (i, row) in truth.iter().enumerate() {
        assert_eq!(found.position[i], DVec3::new(row[0], row[1], row[2]), "{name}, point {i}");
        let velocity = Vec3::new(row[3] as f32, row[4] as f32, row[5] as f32);
        assert_eq!(found.velocity[i], velocity, "{name}, point {i}");
        let colour = found.colour[i] * 255.0;
        let want = Vec3::new(row[6] as f32, row[7] as f32, row[8] as f32);
        // Divided by 255 and multiplied again.
        assert!((colour - want).abs().max_element() < 2e-5, "{name}, point {i}: {colour} for {want}");
        assert_eq!(found.radius[i], row[9] as f32, "{name}, point {i}");
        assert_eq!(found.id[i], row[11] as i64, "{name}, point {i}");
    }
}

#[test]
fn texts_have_the_numbers_that_were_written() {
    for name in [
        "pandas.csv",
        "pandas_index.csv",
        "semicolons.csv",
        "tabs.txt",
        "bars.txt",
        "blanks.txt",
        "savetxt.txt",
        "paraview.csv",
    ] {
        let bytes = read(name);
        assert_eq!(ModelFormat::detect(&bytes, &data(name)), Some(ModelFormat::Xyz), "{name}");
        same(name, &cloud(&bytes, ModelFormat::Xyz));
    }
}

#[test]
fn arrays_have_the_numbers_that_were_written() {
    for name in ["records.npy", "nested.npy"] {
        let bytes = read(name);
        assert_eq!(ModelFormat::detect(&bytes, &data(name)), Some(ModelFormat::Npy), "{name}");
        same(name, &cloud(&bytes, ModelFormat::Npy));
    }
    let places: Vec<DVec3> = truth().iter().map(|row| DVec3::new(row[0], row[1], row[2])).collect();
    for name in ["places.npy", "places_fortran.npy"] {
        assert_eq!(cloud(&read(name), ModelFormat::Npy).position, places, "{name}");
    }
}

#[cfg(feature = "formats")]
#[test]
fn archives_have_the_numbers_that_were_written() {
    for name in ["arrays.npz", "packed.npz"] {
        let bytes = read(name);
        assert_eq!(ModelFormat::detect(&bytes, &data(name)), Some(ModelFormat::Npz), "{name}");
        let found = cloud(&bytes, ModelFormat::Npz);
        same(name, &found);
        let told = found.notes.iter().any(|note| note == "arrays ignored: faces [3, 3] (not 7 rows)");
        assert_eq!(told, name == "arrays.npz", "{:?}", found.notes);
    }
    assert_eq!(cloud(&read("single.npz"), ModelFormat::Npz).position.len(), 7);
}

#[test]
fn empty_cells_are_no_numbers() {
    let found = cloud(b"x,y,z,radius\n1,2,3,\n,2,3,1\n4,5,6,0.5,\n", ModelFormat::Xyz);
    assert_eq!(found.position, [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)]);
    assert_eq!(found.radius, [0.0, 0.5]);
    assert!(found.notes.iter().any(|note| note.starts_with("1 points dropped")), "{:?}", found.notes);
}

#[test]
fn wrong_tables_are_refused() {
    let line = |text: &str| refused(text.as_bytes(), ModelFormat::Xyz).to_string();
    assert_eq!(line("x,y,z\n1,2,3\n1,2\n"), "line 3: found 2 words, expected 3, as line 1 names them");
    assert_eq!(line("x,y,z\n1,2,a\n"), "line 2: found `a`, expected a number (`z`)");
    assert_eq!(line("x,y,z,id\n1,2,3,\n"), "line 2: found NaN, expected a whole number up to 2^53 (`id`)");
    let whole = read("records.npy");
    for length in 0..whole.len() {
        refused(&whole[..length], ModelFormat::Npy);
    }
    // What is called a table is told what is wrong with it.
    let named = |text: &str| load_as("a.csv", text.as_bytes()).unwrap_err().to_string();
    assert!(named("x;y;z\n1,5;2,0;3\n").ends_with("a.csv: line 2: found `1,5`, expected a number (`x`)"));
    assert!(named("a,b,c\n1,2,3\n").ends_with("names of columns without x (a, b, c), expected x, y and z among them"));
    assert!(named("x,y,z\n").contains("a.csv: line 1: found no point after the names of the columns"));
    assert!(
        cloud(&read("pandas_index.csv"), ModelFormat::Xyz).notes[1].starts_with("columns ignored: (no name), name,")
    );
}

/// A damaged archive is refused wherever its damage is, or read to what it holds.
#[cfg(feature = "formats")]
#[test]
fn wrong_archives_are_refused() {
    let whole = read("packed.npz");
    for length in 0..whole.len() {
        refused(&whole[..length], ModelFormat::Npz);
    }
    for at in 0..whole.len() {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x55;
        let _ = splatblur::model::parse(&damaged, ModelFormat::Npz);
    }
}

fn coloured(path: &Path, column: &str, range: Option<[f64; 2]>) -> Result<(Surfels, [f64; 2]), ModelError> {
    let by = ColourBy { column: column.to_owned(), map: ColourMap::parse("grey").unwrap(), range };
    let points = PointOptions { colour_by: Some(by), ..PointOptions::default() };
    let options = LoadOptions { points, ..LoadOptions::default() };
    load(path, &options, &|_, _| {}).map(|LoadedModel { shape, colour_range, .. }| match shape {
        LoadedShape::Surfels(surfels, None) => (surfels, colour_range.unwrap()),
        other => panic!("{other:?}"),
    })
}

/// sRGB by its definition (IEC 61966-2-1).
fn linear(code: f64) -> f32 {
    if code <= 0.04045 { (code / 12.92) as f32 } else { ((code + 0.055) / 1.055).powf(2.4) as f32 }
}

#[test]
fn every_format_is_coloured_by_its_columns() {
    let truth = truth();
    let mut names = vec!["pandas_index.csv", "blanks.txt", "records.npy", "nested.npy", "paraview.csv"];
    if cfg!(feature = "formats") {
        names.extend(["arrays.npz", "packed.npz"]);
    }
    for name in names {
        for (column, of) in [
            ("Pressure", Box::new(|row: &[f64; 12]| row[10]) as Box<dyn Fn(&[f64; 12]) -> f64>),
            ("id", Box::new(|row| row[11])),
            ("radius", Box::new(|row| row[9])),
            ("z", Box::new(|row| row[2])),
            ("speed", Box::new(|row| row[3..6].iter().map(|v| v * v).sum::<f64>().sqrt())),
        ] {
            let values: Vec<f64> = truth.iter().map(of).collect();
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let (surfels, range) = coloured(&data(name), column, None).unwrap();
            // Speeds are sums of floats of 32 bits.
            assert!(
                (range[0] - least).abs() + (range[1] - most).abs() < 1e-6 * most.abs(),
                "{name} {column} {range:?}"
            );
            for (i, value) in values.iter().enumerate() {
                let want = linear((value - least) / (most - least));
                let got = surfels.colour[i].x;
                // Codes are floats of 32 bits: measured 3e-7.
                assert!((got - want).abs() < 1e-6, "{name} {column}, point {i}: {got} for {want}");
            }
        }
    }
    let why = coloured(&data("pandas.csv"), "presure", None).unwrap_err().to_string();
    assert!(why.contains("found no column \"presure\" to colour by, expected x, y, z, name, vx,"), "{why}");
    let why = coloured(&data("places.npy"), "speed", None).unwrap_err().to_string();
    assert!(why.ends_with("expected one of this name, or velocities (vx, vy and vz)"), "{why}");
}

/// Points that would be a volume are drawn as points where a column colours them.
#[test]
fn a_medium_has_no_colours_of_columns() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.csv");
    fs::write(&path, "x,y,z,radius,density\n0,0,0,1,1\n1,0,0,1,3\n0,1,0,1,2\n").unwrap();
    let (surfels, range) = coloured(&path, "density", None).unwrap();
    assert_eq!((surfels.len(), range), (3, [1.0, 3.0]));
    assert_eq!(surfels.colour[1], Vec3::ONE);
    let points = PointOptions {
        colour_by: Some(ColourBy { column: "z".to_owned(), ..ColourBy::default() }),
        ..PointOptions::default()
    };
    let options = LoadOptions { kind: Some(Kind::Volume), points, ..LoadOptions::default() };
    let why = load(&path, &options, &|_, _| {}).unwrap_err().to_string();
    assert!(why.ends_with("found points as a volume, expected surfels or spheres, as `colourBy` is given"), "{why}");
}

#[test]
fn our_own_files_are_coloured_by_what_they_keep() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.bin");
    let (surfels, _) = coloured(&data("records.npy"), "z", None).unwrap();
    splatblur::model::write_bin(&path, &surfels).unwrap();
    let (again, range) = coloured(&path, "z", Some([-10.0, 10.0])).unwrap();
    assert_eq!(range, [-10.0, 10.0]);
    for (row, colour) in truth().iter().zip(&again.colour) {
        // Places are kept relative to the middle, as floats.
        assert!((colour.x - linear((row[2] + 10.0) / 20.0)).abs() < 1e-6, "{colour} at {}", row[2]);
    }
    assert!(coloured(&path, "pressure", None).unwrap_err().to_string().contains("no column \"pressure\""));
}

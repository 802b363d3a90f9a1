//! `.anim` files against reference values: tables recorded from Maya or from an evaluator that agrees with it, and the
//! vertices of a cube that Maya itself exported.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use splatblur::anim::{self, Interpolation};

type Outcome = Result<(), Box<dyn Error>>;

/// The tables have six decimals; Maya's own values were met to 5e-6.
const TOLERANCE: f64 = 1e-5;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn data() -> PathBuf {
    root().join("tests/data/anim")
}

/// Column names and rows.
type Table<'a> = (Vec<&'a str>, Vec<Vec<f64>>);

fn parse_table(text: &str) -> Result<Table<'_>, Box<dyn Error>> {
    let mut lines = text.lines();
    let header = lines.next().ok_or("empty table")?.split(',').collect();
    let rows = lines.map(|line| line.split(',').map(str::parse).collect::<Result<_, _>>()).collect::<Result<_, _>>()?;
    Ok((header, rows))
}

/// The file's table has the reference's columns and frames, and its values; the csv text repeats both. Returns the
/// worst error.
fn worst_error(name: &str) -> Result<f64, Box<dyn Error>> {
    let here = data().join(format!("{name}.anim"));
    let path = if here.exists() { here } else { root().join(format!("animations/{name}.anim")) };
    let animation = anim::load(&path)?;
    let reference = fs::read_to_string(data().join(format!("{name}.ref.csv")))?;
    let (header, rows) = parse_table(&reference)?;
    assert!(rows.len() > 10, "{name}: a table of {} rows proves little", rows.len());
    let csv = animation.csv(rows.iter().map(|row| row[0]), Interpolation::Maya);
    let (own_header, own_rows) = parse_table(&csv)?;
    assert_eq!(own_header, header, "{name}");
    assert_eq!(own_rows.len(), rows.len(), "{name}");
    assert!(csv.ends_with('\n') && csv.lines().all(|line| line.split(',').count() == header.len()));
    let mut worst = 0.0_f64;
    for (own, row) in own_rows.iter().zip(&rows) {
        assert_eq!(own[0], row[0], "{name}: frame");
        let exact: Vec<f64> =
            animation.nodes.iter().flat_map(|n| n.values(row[0], Interpolation::Maya).collect::<Vec<_>>()).collect();
        for (column, value) in row.iter().enumerate().skip(1) {
            let error = (exact[column - 1] - value).abs();
            assert!(error <= TOLERANCE, "{name} frame {} {}: {} != {value}", row[0], header[column], exact[column - 1]);
            assert!((own[column] - value).abs() <= TOLERANCE, "{name} frame {}: csv {}", row[0], own[column]);
            worst = worst.max(error);
        }
    }
    Ok(worst)
}

#[test]
fn every_reference_table_is_met() -> Outcome {
    let mut names: Vec<String> = fs::read_dir(data())?
        .filter_map(|entry| entry.ok()?.file_name().to_str()?.strip_suffix(".ref.csv").map(str::to_owned))
        .collect();
    names.sort();
    assert_eq!(names.len(), 12, "{names:?}");
    for name in names {
        let worst = worst_error(&name)?;
        println!("{name}: worst error {worst:.2e}");
    }
    Ok(())
}

#[test]
fn tables_are_repeated_to_the_letter_where_the_reference_is_exact() -> Outcome {
    // All values of this one are exact in six decimals, so the whole text must agree: number format, frames, line ends.
    let reference = fs::read_to_string(data().join("diagonal.ref.csv"))?;
    let animation = anim::load(&root().join("animations/diagonal.anim"))?;
    let (_, rows) = parse_table(&reference)?;
    let csv = animation.csv(rows.iter().map(|row| row[0]), Interpolation::Maya);
    assert_eq!(csv, reference.replace("\r\n", "\n"));
    Ok(())
}

#[test]
fn vertices_of_mayas_cube() -> Outcome {
    const CORNERS: [[f64; 3]; 8] = [
        [-1.0, -1.0, 1.0],
        [1.0, -1.0, 1.0],
        [-1.0, 1.0, 1.0],
        [1.0, 1.0, 1.0],
        [-1.0, 1.0, -1.0],
        [1.0, 1.0, -1.0],
        [-1.0, -1.0, -1.0],
        [1.0, -1.0, -1.0],
    ];
    let animation = anim::load(&data().join("extrapolate_cube.anim"))?;
    let node = animation.node(None)?;
    assert_eq!(node.name, "pCube1");
    let mut worst = 0.0_f64;
    for frame in [26_u32, 60, 80, 100] {
        let text = fs::read_to_string(data().join(format!("extrapolate_cube.frame{frame:03}.vertices.txt")))?;
        let state = node.at(f64::from(frame) / animation.rate, Interpolation::Maya);
        assert!(state.visible);
        let matrix = state.transform.matrix();
        assert_eq!(text.lines().count(), CORNERS.len());
        for (line, corner) in text.lines().zip(CORNERS) {
            let v = line.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
            let own = matrix.transform_point3(DVec3::from_array(corner) * 0.5);
            let error = (own - DVec3::from_slice(&v)).abs().max_element();
            assert!(error <= TOLERANCE, "frame {frame}: {own} != {line}");
            worst = worst.max(error);
        }
    }
    println!("vertices: worst error {worst:.2e}");
    Ok(())
}

#[test]
fn the_demo_animations_load_without_notes() -> Outcome {
    let mut count = 0;
    for entry in fs::read_dir(root().join("animations"))? {
        let path = entry?.path();
        if path.extension().is_some_and(|e| e == "anim") {
            let animation = anim::load(&path)?;
            assert!(animation.notes.is_empty(), "{}: {:?}", path.display(), animation.notes);
            assert_eq!(animation.rate, 24.0);
            assert!(animation.node(None)?.has_transform());
            count += 1;
        }
    }
    assert_eq!(count, 8);
    Ok(())
}

/// The guide shows this file whole. Its table is worked out by hand: between level keys the curve is 3 u^2 - 2 u^3.
#[test]
fn the_example_of_the_guide_is_what_the_guide_says() -> Outcome {
    let path = data().join("by_hand.anim");
    let guide = fs::read_to_string(root().join("docs/anim-files.md"))?;
    assert!(guide.contains(&format!("```text\n{}```\n", fs::read_to_string(&path)?)));
    let animation = anim::load(&path)?;
    assert!(animation.notes.is_empty(), "{:?}", animation.notes);
    let node = animation.node(None)?;
    assert_eq!((node.name.as_str(), animation.rate), ("lift", 24.0));
    let mut rows = 0;
    for line in guide.lines() {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [frame, y, angle, visible] = cells[..] else { continue };
        let Ok(frame) = frame.parse::<f64>() else { continue };
        let state = node.at(frame / animation.rate, Interpolation::Maya);
        assert!((state.transform.translate.y - y.parse::<f64>()?).abs() < 1e-12, "{line}");
        assert!((state.transform.rotate.y.to_degrees() - angle.parse::<f64>()?).abs() < 1e-9, "{line}");
        assert_eq!(state.visible, visible == "yes", "{line}");
        rows += 1;
    }
    assert_eq!(rows, 8);
    Ok(())
}

//! Scans on the command line: described by their headers, converted, rendered.

#![allow(clippy::unwrap_used, reason = "tests may stop and report")]

use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::run;

/// A folder with scans of tests/data.
fn folder() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    for name in ["7.las", "7.laz", "two.e57"] {
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/scans").join(name);
        fs::copy(from, dir.path().join(name)).unwrap();
    }
    dir
}

fn report(dir: &Path, line: &str) -> Value {
    let (status, said, errors) = run(dir, line);
    assert_eq!(status, Some(0), "{errors}");
    serde_json::from_str(&said).unwrap()
}

#[test]
fn headers_are_described() {
    let dir = folder();
    let las = report(dir.path(), "info 7.las --json");
    assert_eq!((&las["kind"], &las["scan"]["points"]), (&json!("scan"), &json!(120)));
    assert_eq!(las["scan"]["format"], json!("LAS 1.4, points of format 7"));
    let e57 = report(dir.path(), "info two.e57 --json");
    assert_eq!(e57["scan"]["scans"][0]["scanner"], json!([500_001.0, 4_649_002.0, 121.0]));
    let several = report(dir.path(), "info 7.* --json");
    assert_eq!(several["files"][1]["path"], json!("7.laz"));
    assert_eq!((&several["points"], several["files"].as_array().unwrap().len()), (&json!(240), 2));
    // The header alone: of a file that is cut behind it, all is said as before.
    let bytes = fs::read(dir.path().join("7.las")).unwrap();
    fs::write(dir.path().join("cut.las"), &bytes[..500]).unwrap();
    assert_eq!(report(dir.path(), "info cut.las --json"), las);
}

#[test]
fn points_are_chosen_in_conversion_and_in_scenes() {
    let dir = folder();
    let (status, said, errors) = run(dir.path(), "convert 7.laz a.ply --classes 2,6 --every 2");
    assert_eq!(status, Some(0), "{errors}");
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/scans/points.csv")).unwrap();
    let class = |line: &str| line.split(',').nth(7).map(str::to_owned);
    let chosen = text.lines().skip(1).filter(|line| matches!(class(line).as_deref(), Some("2" | "6"))).count();
    assert!(said.starts_with(&format!("{} surfels", chosen.div_ceil(2))), "{said}");
    let scene = "<scene><object><pointModel every='2' classes='2, 6' clean='true' scannerPosition='500000 4649000 120'>\
                 7.las</pointModel></object></scene>";
    fs::write(dir.path().join("s.xml"), scene).unwrap();
    let found = report(dir.path(), "info s.xml --json");
    let count = found["objects"][0]["model"]["surfels"].as_u64().unwrap();
    assert!(count > 20 && count <= chosen.div_ceil(2) as u64, "{count}");
    let (_, xml, _) = run(dir.path(), "info s.xml --xml");
    let wanted = r#"every="2" classes="2,6" clean="true" scannerPosition="500000 4649000 120""#;
    assert!(xml.contains(wanted), "{xml}");
    let (status, _, errors) = run(dir.path(), "render 7.laz --size 32x24 --mode supersample:1 --backend cpu --out o");
    assert_eq!(status, Some(0), "{errors}");
    assert!(errors.contains("note: 7.laz: z is taken as up, as scans have it"), "{errors}");
    // Several files, and the hash of what was read.
    for line in ["render 7.* --out p", "render several.xml --out q"] {
        let scene = "<scene><object><pointModel>7.*</pointModel></object></scene>";
        fs::write(dir.path().join("several.xml"), scene).unwrap();
        let said = report(dir.path(), &format!("{line} --size 32x24 --mode supersample:1 --backend cpu --json"));
        assert_eq!(said["frames"].as_array().map(Vec::len), Some(1), "{said}");
        assert!(!said["scene"].as_str().unwrap().contains('*'), "{said}");
    }
}

#[test]
fn wrong_choices_are_one_line() {
    let dir = folder();
    fs::write(dir.path().join("a.xyz"), "0 0 0\n1 0 0\n0 1 0\n").unwrap();
    fs::write(dir.path().join("7.ply"), "").unwrap();
    for (line, expected) in [
        ("convert a.xyz a.ply --classes 2", "expected LAS or LAZ, as `classes` are named"),
        ("convert 7.las a.ply --classes 2,300", "300"),
        ("convert 7.las a.ply --every 0", "0 is not in 1.."),
        ("convert no*.las a.ply", "no*.las, expected one at least that the stars fit"),
        ("info no*.las", "no*.las, expected one at least that the stars fit"),
        ("convert 7.las a.ply --scanner-position 1,2", "expected X,Y,Z"),
        ("convert 7.* 7.ply --force", "7.ply is both IN and OUT"),
        ("convert 7.las a.ply --classes 99", "points of each class of the file: 1 (unclassified)"),
    ] {
        let (status, _, errors) = run(dir.path(), line);
        assert_eq!(status, Some(2), "{line}: {errors}");
        assert!(errors.contains(expected), "{line}: {errors}");
    }
    let scene = "<scene><object><pointModel classes='ground'>7.las</pointModel></object></scene>";
    fs::write(dir.path().join("s.xml"), scene).unwrap();
    let (status, _, errors) = run(dir.path(), "info s.xml");
    assert_eq!(status, Some(2));
    assert!(errors.contains("`classes` is `ground`, expected whole numbers from 0 to 255, as 2,6"), "{errors}");
}

//! Volumes on the command line: made, described, and not converted.

#![allow(clippy::unwrap_used, reason = "tests may stop and report")]

use std::fs;

use crate::run;

#[test]
fn a_volume_is_made_and_described() {
    let dir = tempfile::tempdir().unwrap();
    let (status, said, errors) = run(dir.path(), "generate volume smoke.nrrd --size 16");
    assert_eq!((status, said.as_str(), errors.as_str()), (Some(0), "16 x 16 x 16 samples: smoke.nrrd\n", ""));
    let bytes = fs::read(dir.path().join("smoke.nrrd")).unwrap();
    let header = bytes.windows(2).position(|pair| pair == b"\n\n").unwrap() + 2;
    assert_eq!(bytes.len(), header + 4096);
    let (status, said, _) = run(dir.path(), "info smoke.nrrd --json");
    assert_eq!(status, Some(0));
    let report: serde_json::Value = serde_json::from_str(&said).unwrap();
    let model = &report["model"];
    assert_eq!(model["size"], serde_json::json!([16, 16, 16]));
    assert_eq!(model["spacing"], serde_json::json!([0.125, 0.125, 0.125]));
    assert_eq!((&model["type"], &model["samples"]), (&"uint8".into(), &4096.into()));
    assert_eq!(model["values"]["min"], serde_json::json!(0.0));
    // Cells without smoke have no kernel.
    let shown = bytes[header..].iter().filter(|value| **value > 0).count();
    assert_eq!(model["kernels"], serde_json::json!(shown));
    assert!(shown > 100 && shown < 4096, "{shown}");
    assert!(report["notes"][0].as_str().unwrap().starts_with("no transfer function"), "{report}");
    let (_, said, _) = run(dir.path(), "info smoke.nrrd");
    assert!(said.contains(&format!("  kernels: {shown}\n  size: 16 16 16\n")), "{said}");

    fs::write(
        dir.path().join("s.xml"),
        "<scene><object><pointModel lit='true'>smoke.nrrd</pointModel></object></scene>",
    )
    .unwrap();
    let (status, said, _) = run(dir.path(), "info s.xml --json");
    assert_eq!(status, Some(0));
    let report: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(report["objects"][0]["model"]["kernels"], serde_json::json!(shown));
    assert_eq!(report["objects"][0]["model"]["lit"], serde_json::json!(true));

    for (options, size) in [("--shape sphere --type float", 4 * 4096), ("--shape zebra", 4096)] {
        let (status, _, errors) = run(dir.path(), &format!("generate volume a.nrrd --size 16 --force {options}"));
        assert_eq!(status, Some(0), "{errors}");
        let bytes = fs::read(dir.path().join("a.nrrd")).unwrap();
        let header = bytes.windows(2).position(|pair| pair == b"\n\n").unwrap() + 2;
        assert_eq!(bytes.len(), header + size, "{options}");
    }
}

#[test]
fn what_makes_no_sense_is_one_line() {
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(run(dir.path(), "generate volume a.nrrd --size 4").0, Some(0));
    for (line, expected) in [
        ("generate volume a.ply", "a.ply must end in .nrrd"),
        ("generate ball a.nrrd", "a.nrrd must end in .ply"),
        ("generate ball a.ply --size 3", "--size, --shape and --type are for `volume` only"),
        ("generate volume b.nrrd --surfels 3", "--surfels is for `sphere` and `hall` only"),
        ("generate volume a.nrrd", "a.nrrd exists already (--force replaces it)"),
        ("convert a.nrrd a.ply", "a.nrrd is a grid of a volume; convert writes surfels, and a volume has none"),
    ] {
        let (status, _, said) = run(dir.path(), line);
        assert_eq!(status, Some(2), "{line}: {said}");
        assert!(said.contains(expected) && said.lines().count() == 1, "{line}: {said}");
        assert!(!dir.path().join("a.ply").exists() && !dir.path().join("b.nrrd").exists());
    }
    assert_eq!(run(dir.path(), "generate volume b.nrrd --size 0").0, Some(2));
    assert_eq!(run(dir.path(), "generate volume b.nrrd --size 1025").0, Some(2));
}

/// Ten sheets of glass, one behind the other: two are left out, and the program says so.
#[test]
fn layers_that_are_left_out_are_counted() {
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(run(dir.path(), "generate checker_plane plane.ply").0, Some(0));
    let sheet = |i: i32| {
        format!(
            "<object epsilon='0.01'><pointModel>plane.ply</pointModel><transform rotate='90 0 0' translate='0 0 {}'/>\
             <material opacity='0.2'/></object>",
            -i
        )
    };
    let scene = |count: i32| {
        let sheets: String = (0..count).map(sheet).collect();
        format!("<scene><image width='16' height='16'/><camera eye='0 0 5' at='0 0 0'/>{sheets}</scene>")
    };
    for (count, said) in [(8, false), (10, true)] {
        fs::write(dir.path().join("s.xml"), scene(count)).unwrap();
        let line = "render s.xml --frames 0 --mode still --pixel-samples 1 --backend cpu --json --out out";
        let (status, report, errors) = run(dir.path(), line);
        assert_eq!(status, Some(0), "{errors}");
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        assert_eq!(report["frames"][0]["left_out"].as_u64().unwrap() > 0, said, "{report}");
        assert_eq!(errors.contains("more than 8 layers of see-through surfels"), said, "{errors}");
    }
}

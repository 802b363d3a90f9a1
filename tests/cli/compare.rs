//! `splatblur compare`.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may stop")]

use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use splatblur::compare::{Comparison, Metric};
use splatblur::film::Picture;
use splatblur::image::{self, Bits, Format};

use crate::support::pairs::{PAIRS, data, pair};

fn compare(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_splatblur"));
    command.arg("compare").args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Exit status and JSON.
fn json(arguments: &[&str]) -> (i32, Value) {
    let output = compare(&[arguments, &["--json"]].concat());
    (output.status.code().unwrap(), serde_json::from_slice(&output.stdout).unwrap())
}

fn refused(arguments: &[&str]) -> String {
    let output = compare(arguments);
    let line = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {line}");
    assert_eq!(text(&output.stdout), "", "{arguments:?}");
    assert!(line.starts_with("error: ") && line.matches('\n').count() == 1, "{arguments:?}: {line:?}");
    line
}

fn path(name: &str) -> String {
    data(name).to_str().unwrap().to_owned()
}

#[test]
fn prints_what_the_library_finds() {
    let (a, b) = (path("render_a.png"), path("render_b.png"));
    let (status, document) = json(&[&a, &b]);
    assert_eq!(status, 0);
    let [pa, pb] = pair(PAIRS[0]);
    let errors = Comparison::new(&pa, &pb, &Metric::ALL).unwrap();
    for metric in Metric::ALL {
        let value = &document["metrics"][metric.name()];
        // Reading JSON may be off by the last bit.
        let (found, wanted) = (value.as_f64().unwrap(), errors.value(metric).unwrap());
        assert!((found - wanted).abs() <= 1e-15 * wanted.abs(), "{}: {found}, {wanted}", metric.name());
        assert_eq!(value, &document["frames"][0]["metrics"][metric.name()]);
    }
    assert_eq!((&document["worst"]["x"], &document["worst"]["y"]), (&0.into(), &100.into()));
    assert_eq!(document["frames"][0]["width"], 160);
    let shown = text(&compare(&[&a, &b]).stdout);
    for words in
        ["160 x 128 pixels", "  flip           0.05851", "bias of r, g, b: -0.000848789, ", "worst pixel: (0, 100)"]
    {
        assert!(shown.contains(words), "{words}: {shown}");
    }
    let few = text(&compare(&[&a, &b, "--metric", "flip,rmse"]).stdout);
    assert!(few.contains("  flip ") && few.contains("  rmse ") && !few.contains("ssim"), "{few}");
}

#[test]
fn limits_decide_the_status() {
    let (a, b) = (path("render_a.png"), path("render_b.png"));
    let status = |limits: &[&str]| {
        let arguments: Vec<&str> =
            [&a as &str, &b].into_iter().chain(limits.iter().flat_map(|l| ["--limit", l])).collect();
        let output = compare(&arguments);
        (output.status.code().unwrap(), text(&output.stdout))
    };
    assert_eq!(status(&["flip=0.0586", "psnr=35.2", "ssim=0.98", "alpha-worst=0", "non-finite=0"]).0, 0);
    for limit in ["flip=0.0585", "psnr=35.3", "ssim=0.986", "mae=0.006"] {
        let (code, shown) = status(&["worst=1", limit]);
        assert_eq!(code, 1, "{limit}");
        let name = limit.split_once('=').unwrap().0;
        assert!(shown.contains(&format!("over the limit: {a}: {name} is ")), "{shown}");
    }
    // Equal pictures: PSNR is infinite, which is above every limit.
    let (status, document) = json(&[&a, &a, "--limit", "psnr=100,flip=0"]);
    assert_eq!((status, &document["metrics"]["psnr"]), (0, &Value::from("inf")));
}

fn solid(width: u32, height: u32, value: f32) -> Picture {
    Picture { width, height, rgba: vec![[value, value, value, 1.0]; (width * height) as usize], layers: Vec::new() }
}

fn png(dir: &Path, name: &str, picture: &Picture) -> String {
    let path = dir.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::write(&path, picture, Format::Png { bits: Bits::Sixteen, alpha: false }, "").unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn sequences_pool_and_each_frame_must_pass() {
    let dir = tempfile::tempdir().unwrap();
    for (frame, value) in [("0001", 0.5), ("0002", 0.75), ("0010", 0.5)] {
        png(dir.path(), &format!("a/x.{frame}.png"), &solid(16, 12, value));
        png(dir.path(), &format!("b/y.{frame}.png"), &solid(16, 12, 0.5));
    }
    let (a, b) = (dir.path().join("a"), dir.path().join("b"));
    let (a, b) = (a.to_str().unwrap(), b.to_str().unwrap());
    // Pooled: sqrt(0.0625 / 3) = 0.1443; frame 2 alone: 0.25.
    let (status, document) = json(&[a, b, "--limit", "rmse=0.2"]);
    assert_eq!(status, 1);
    assert!((document["metrics"]["rmse"].as_f64().unwrap() - 0.144_337).abs() < 1e-4);
    assert_eq!(document["over"].as_array().unwrap().len(), 1);
    assert_eq!(document["over"][0]["of"], "frame 2");
    assert_eq!(document["worst"]["frame"], 2);
    let pattern = format!("{a}/x.%04d.png");
    let shown = compare(&[&pattern, b]);
    assert_eq!(shown.status.code(), Some(0));
    assert!(
        text(&shown.stdout).contains("3 frames") && text(&shown.stdout).contains("\n      10  "),
        "{}",
        text(&shown.stdout)
    );
    std::fs::remove_file(dir.path().join("b/y.0010.png")).unwrap();
    assert!(refused(&[a, b]).contains("has no frame 10"));
    assert!(refused(&[b, a]).contains("has no frame 10"));
}

#[test]
fn not_finite_is_never_within() {
    let dir = tempfile::tempdir().unwrap();
    let good = dir.path().join("good.exr");
    image::write(&good, &solid(16, 16, 0.5), Format::EXR, "").unwrap();
    // Our own writer refuses NaN.
    let bad = dir.path().join("bad.exr");
    exr::prelude::write_rgba_file(&bad, 16, 16, |x, y| {
        (if (x, y) == (3, 4) { f32::NAN } else { 0.5_f32 }, 0.5_f32, 0.5_f32, 1.0_f32)
    })
    .unwrap();
    let (good, bad) = (good.to_str().unwrap(), bad.to_str().unwrap());
    let (status, document) = json(&[bad, good, "--limit", "flip=1", "--limit", "alpha-rmse=0"]);
    assert_eq!((status, &document["metrics"]["rmse"]), (1, &Value::from("NaN")));
    assert_eq!(document["non_finite"], serde_json::json!([1, 0]));
    assert_eq!((&document["worst"]["x"], &document["worst"]["y"]), (&3.into(), &4.into()));
    assert_eq!(document["over"].as_array().unwrap().len(), 1, "alpha is finite");
    assert!(text(&compare(&[bad, good]).stdout).contains("pixels that are not finite: 1 in A, 0 in B"));
}

#[test]
fn what_cannot_be_compared() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (path("render_a.png"), path("patches_b.png"));
    assert!(refused(&[&a, &b]).contains("160 x 128 and 101 x 75"));
    assert!(refused(&[&a, "no/such.png"]).contains("no/such.png"));
    assert!(refused(&[&a, &path("make.py")]).contains("neither a PNG, an EXR nor a Radiance"));
    assert!(refused(&[&a, dir.path().to_str().unwrap()]).contains("no numbered"));
    assert!(refused(&[&a, &a, "--metric", "flop"]).contains("there are: mse"));
    assert!(refused(&[&a, &a, "--limit", "flip"]).contains("METRIC=VALUE"));
    assert!(refused(&[&a, &a, "--limit", "flip=1", "--limit", "flip=2"]).contains("two limits"));
    assert!(refused(&[&a]).contains("<B>"));
    let small = png(dir.path(), "small.png", &solid(8, 40, 0.5));
    assert!(refused(&[&small, &small, "--metric", "ssim"]).contains("at least 11 x 11"));
    assert!(refused(&[&small, &small, "--limit", "ssim=0"]).contains("at least 11 x 11"));
    // Not asked for, it is left out.
    assert_eq!(json(&[&small, &small]).1["metrics"]["ssim"], Value::Null);
}

#[test]
fn help_teaches() {
    let help = text(&compare(&["--help"]).stdout);
    for metric in Metric::ALL {
        assert!(help.contains(metric.name()), "{}", metric.name());
    }
    for words in ["67.02 pixels per degree", "(a - b)^2 / (b^2 + 0.01)", "Exit status: 0 within", "Examples:"] {
        assert!(help.contains(words), "{words}");
    }
}

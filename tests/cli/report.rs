//! `sheet` and `report` as a user meets them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use splatblur::image::{self, Format};

fn splatblur(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_splatblur")).args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn refused(arguments: &[&str]) -> String {
    let output = splatblur(arguments);
    let line = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {line}");
    assert_eq!(text(&output.stdout), "", "{arguments:?}");
    assert!(line.starts_with("error: ") && line.matches('\n').count() == 1, "{arguments:?}: {line:?}");
    line
}

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/spin.xml");

/// `command` for a small picture, with its own arguments.
fn small<'a>(command: &'a str, arguments: &[&'a str]) -> Vec<&'a str> {
    [&[command, SCENE, "--size", "80x60", "--quiet"], arguments].concat()
}

fn path(dir: &Path, name: &str) -> String {
    dir.join(name).to_str().unwrap().to_owned()
}

#[test]
fn a_sheet_and_its_flip_through() {
    let dir = tempfile::tempdir().unwrap();
    let (out, flip) = (path(dir.path(), "new/sheet.png"), path(dir.path(), "flip.png"));
    let modes = "still:1,supersample:4+interleave=2,bucket:2x2,volumetric:2";
    let sheet = |more: &[&str]| {
        splatblur(&small("sheet", &[&["--frame", "3", "--modes", modes, "--out", &out], more].concat()))
    };
    let done = sheet(&["--flip", &flip, "--reference", "16"]);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let read = |path: &str| {
        png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap())).read_info().unwrap()
    };
    let info = read(&flip);
    assert_eq!(info.info().animation_control().map(|a| a.num_frames), Some(5), "the reference and four modes");
    let with_reference = read(&out).info().size();
    // Without the reference there are four panels in one row, not three and two.
    assert_eq!(sheet(&["--crop", "10,10,20x15"]).status.code(), Some(0));
    let without = read(&out).info().size();
    assert!(without.0 > with_reference.0 && without.1 < with_reference.1, "{without:?} {with_reference:?}");

    let bad = |arguments: &[&str]| refused(&small("sheet", arguments));
    let base = ["--frame", "3", "--out", &out, "--modes"];
    assert!(bad(&[&base[..], &["superb:3"]].concat()).contains("there is no mode `superb`"));
    assert!(
        bad(&[&base[..], &["still", "--crop", "70,0,20x10"]].concat()).contains("does not lie in a picture of 80 x 60")
    );
    assert!(bad(&[&base[..], &["still", "--crop", "4294967295,0,2x2"]].concat()).contains("does not lie"));
    assert!(bad(&[&base[..], &["still", "--reference", "17"]].concat()).contains("multiple of 16"));
    assert!(bad(&[&base[..], &["still", "--flip", &out]].concat()).contains("same file"));
    assert!(bad(&["--frame", "3", "--modes", "still", "--out", "sheet.gif"]).contains("a PNG file"));
    assert!(bad(&["--frame", "1..3", "--modes", "still", "--out", &out]).contains("not a frame number"));
}

#[test]
fn a_report_goes_on_where_it_was_and_is_a_gate() {
    let dir = tempfile::tempdir().unwrap();
    let out = path(dir.path(), "report");
    let report = |modes: &str, more: &[&str]| {
        let own = [
            "--prefilter",
            "none",
            "--frames",
            "2..3",
            "--reference",
            "64",
            "--out",
            &out,
            "--repeats",
            "2",
            "--modes",
            modes,
        ];
        let output = splatblur(&small("report", &[&own, more].concat()));
        (output.status.code().unwrap(), text(&output.stderr))
    };
    let modes = "supersample:8,supersample:2,reference:16";
    assert_eq!(report(modes, &[]), (0, String::new()));
    let read = |name: &str| std::fs::read_to_string(dir.path().join("report").join(name)).unwrap();
    let json: Value = serde_json::from_str(&read("report.json")).unwrap();
    assert_eq!(json["frames"].as_array().unwrap().len(), 2);
    let flip = |mode: usize| json["sequence"][mode]["metrics"]["flip"].as_f64().unwrap();
    assert!(flip(0) < flip(1), "more samples, less error: {} {}", flip(0), flip(1));
    let pixels =
        json["frames"][0]["modes"][0]["regions"].as_array().unwrap().iter().map(|r| r["pixels"].as_f64().unwrap());
    assert!((pixels.sum::<f64>() - 1.0).abs() < 1e-12);
    assert_eq!(json["sequence"][2]["mode"], "reference:16");
    assert!(json["frames"][0]["standard_error"].as_f64().unwrap() > 0.0);
    assert_eq!(read("report.csv").lines().count(), 1 + 2 * 3 + 3);
    assert!(read("index.html").contains("supersample:8@cpu") && read("index.html").contains("the CPU ("));

    // A finished report is made again from what is there: the times are those of the first run, to the last digit.
    assert_eq!(report(modes, &[]), (0, String::new()));
    assert_eq!(serde_json::from_str::<Value>(&read("report.json")).unwrap(), json);
    // What is missing or damaged is rendered again, and only that.
    let folder = dir.path().join("report/renderings/3");
    std::fs::remove_file(folder.join("supersample-2.cpu.exr")).unwrap();
    std::fs::write(folder.join("supersample-8.cpu.json"), "{}").unwrap();
    assert_eq!(report(modes, &[]), (0, String::new()));
    let again: Value = serde_json::from_str(&read("report.json")).unwrap();
    assert_eq!(again["frames"][0], json["frames"][0]);
    for mode in 0..2 {
        let (a, b) = (&again["frames"][1]["modes"][mode], &json["frames"][1]["modes"][mode]);
        assert_eq!(a["metrics"], b["metrics"]);
        assert_ne!(a["seconds"], b["seconds"]);
    }
    assert_eq!(again["frames"][1]["reference_seconds"], json["frames"][1]["reference_seconds"]);

    // The gate: good modes pass; a tiny depth tolerance tears surfaces of many surfels and does not.
    let limit = format!("gamma-rmse={}", 1.5 * json["sequence"][0]["metrics"]["gamma-rmse"].as_f64().unwrap());
    assert_eq!(report("supersample:8", &["--limit", &limit]).0, 0);
    let (code, said) = report("supersample:8", &["--limit", &limit, "--epsilon", "1e-6", "--detail", "full"]);
    assert_eq!(code, 1, "{said}");
    assert!(said.contains("over the limit: frame 2, supersample:8@cpu: gamma-rmse is "), "{said}");
    assert!(read("index.html").contains("Over the limit"));
}

/// A ball that is at `x` = -0.3 + 0.6 f in frame f, and moves there by `velocity` a frame.
fn ball(dir: &Path, frame: f64, velocity: f64) -> String {
    let scene = path(dir, &format!("ball_{velocity}_{frame}.xml"));
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/models/ball.ply");
    // Motion starts at frame 0.
    let start = -0.3 + 0.6 * frame - velocity * frame;
    let text = format!(
        r#"<scene><image width="96" height="54"/><shutter open="-0.5" close="0.5"/>
        <camera eye="0 0 4" at="0 0 0" fovy="34"/>
        <object><pointModel>{model}</pointModel><transform translate="{start} 0 0"/>
        <motion type="linear" velocity="{velocity} 0 0"/></object></scene>"#
    );
    std::fs::write(&scene, text).unwrap();
    scene
}

#[test]
fn a_gate_rejects_backward_motion_and_weights_that_are_not_normalised() {
    let dir = tempfile::tempdir().unwrap();
    let exposed = ["--weight", "ramp", "--transparent", "--quiet"];
    let make = |command: &str, to: &str, velocity: f64, more: &[&str]| {
        for frame in [0_u8, 1] {
            let scene = ball(dir.path(), frame.into(), velocity);
            let (out, frame) = (path(dir.path(), &format!("{to}_{frame}")), frame.to_string());
            let own = [command, &scene, "--frames", &frame, "--out", &out];
            let done = splatblur(&[&own[..], &exposed, more].concat());
            assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
            let made = std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path());
            let picture = made.into_iter().find(|file| file.extension().is_some_and(|e| e == "exr")).unwrap();
            std::fs::create_dir_all(dir.path().join(to)).unwrap();
            std::fs::rename(picture, dir.path().join(to).join(format!("x.000{frame}.exr"))).unwrap();
        }
    };
    let splatted = ["--format", "exr", "--mode", "volumetric", "--samples", "4", "--prefilter", "none"];
    make("render", "good", 0.6, &splatted);
    make("render", "backward", -0.6, &splatted);
    make("reference", "judge", 0.6, &["--samples", "64"]);
    // The integral of the ramp 1 - |t - 1| is 1/2: a film whose time weights are not divided by it.
    std::fs::create_dir_all(dir.path().join("raw")).unwrap();
    for name in ["raw/x.0000.exr", "raw/x.0001.exr"] {
        let mut picture = image::read(&dir.path().join(name.replace("raw", "good"))).unwrap();
        picture.rgba.iter_mut().flatten().for_each(|value| *value *= 0.5);
        image::write(&dir.path().join(name), &picture, Format::EXR, "").unwrap();
    }
    let [good, backward, raw, judge] = ["good", "backward", "raw", "judge"].map(|name| path(dir.path(), name));
    let gate = |pictures: &str, limit: &str| {
        let output = splatblur(&["compare", pictures, &judge, "--json", "--limit", limit]);
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        (output.status.code().unwrap(), found["metrics"]["gamma-rmse"].as_f64().unwrap())
    };
    let limit = format!("gamma-rmse={}", 1.5 * gate(&good, "gamma-rmse=1").1);
    let found = [&good, &backward, &raw].map(|pictures| gate(pictures, &limit));
    println!("{limit}: {found:?}");
    assert_eq!(found.map(|(status, _)| status), [0, 1, 1], "{limit}: {found:?}");
}

#[cfg(unix)]
#[test]
fn an_interrupted_report_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let out = path(dir.path(), "r");
    let common = ["--modes", "supersample:2", "--reference", "16", "--repeats", "1", "--out", &out];
    let mut arguments = small("report", &[&common[..], &["--frames", "0..9999"]].concat());
    arguments.retain(|argument| *argument != "--quiet");
    let child = Command::new(env!("CARGO_BIN_EXE_splatblur")).args(&arguments).stderr(Stdio::piped()).spawn().unwrap();
    let second = dir.path().join("r/renderings/1/supersample-2.cpu.exr");
    while !second.exists() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("interrupted"), "{}", text(&output.stderr));
    assert!(!dir.path().join("r/index.html").exists());
    let made = |file: &Path| std::fs::metadata(file).unwrap().modified().unwrap();
    let before = made(&second);
    let done = splatblur(&small("report", &[&common[..], &["--frames", "0..1"]].concat()));
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    assert_eq!(made(&second), before, "what was finished is not rendered again");
    assert!(dir.path().join("r/index.html").exists());
}

#[test]
fn what_a_report_refuses() {
    let bad = |arguments: &[&str]| refused(&small("report", arguments));
    assert!(bad(&["--modes", "still", "--out", "/proc/none"]).contains("cannot write into"));
    let dir = tempfile::tempdir().unwrap();
    let out = path(dir.path(), "r");
    assert!(bad(&["--out", &out, "--modes", "still,still:16"]).contains("twice"));
    assert!(bad(&["--out", &out, "--modes", "still,still@cpu"]).contains("twice"));
    assert!(bad(&["--out", &out, "--modes", "still", "--backends", "tpu"]).contains("no backend"));
    assert!(bad(&["--out", &out, "--modes", "still", "--limit", "flip=1,flip=2"]).contains("two limits"));
    assert!(bad(&["--out", &out, "--modes", "still", "--reference", "0"]).contains("multiple of 16"));
    assert!(bad(&["--out", &out]).contains("--modes"));
    let tiny = ["report", SCENE, "--size", "8x8", "--quiet", "--modes", "still", "--out", &out];
    assert!(refused(&tiny).contains("at least 11 x 11"));
    assert!(!dir.path().join("r").exists(), "nothing is made before all is checked");
}

#[test]
fn help_teaches() {
    for (command, words) in [
        ("sheet", &["--crop", "--flip", "--reference", "supersample:8+interleave=2", "Examples:"][..]),
        (
            "report",
            &["--backends", "--limit", "--repeats", "--fresh", "bucket:8x4", "Examples:", "Exit status: 0 within"],
        ),
    ] {
        let help = text(&splatblur(&[command, "--help"]).stdout);
        for word in words {
            assert!(help.contains(word), "{command}: {word}");
        }
    }
}

/// All tables and pictures of the thesis, small: fifteen cells, and each figure's picture.
// Not deep: the only test of that command.
#[test]
fn the_thesis_is_made_again() {
    let directory = tempfile::tempdir().unwrap();
    let out = path(directory.path(), "thesis");
    let small = ["--fewer", "200", "--repeats", "1", "--size", "64x48", "--backend", "cpu"];
    let output = splatblur(&[&["study", "thesis", "--out", &out], &small[..]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let tables = text(&output.stdout);
    assert_eq!(std::fs::read_to_string(directory.path().join("thesis/thesis.md")).unwrap(), tables);
    let cells: Vec<&str> = tables.lines().filter(|line| line.starts_with("| 5.") && line.contains("| (")).collect();
    assert_eq!(cells.len(), 15, "{tables}");
    for (surfels, figure) in [("| 248 |", "5.1"), ("| 2329 |", "5.2"), ("| 2226 |", "5.3")] {
        assert_eq!(cells.iter().filter(|cell| cell.contains(surfels) && cell.contains(figure)).count(), 5, "{tables}");
    }
    assert!(!tables.contains("NaN") && !tables.contains("inf"), "{tables}");
    let rows = |start: &str| tables.lines().filter(|line| line.starts_with(start)).count();
    let starts = ["| Wolf 4.9 |", "| Ren et al. 11 |", "| Zwicker et al. 13 |", "| thin |"];
    assert_eq!(starts.map(rows), [1, 2, 3, 1], "{tables}");
    let prefilters = ["4.9", "4.10", "ren-11", "ren-11-random", "zwicker-13"];
    for name in ["3.1", "5.1", "5.2", "5.2e", "5.3"].into_iter().chain(prefilters) {
        let picture = image::read(&directory.path().join(format!("thesis/figure-{name}.png"))).unwrap();
        assert!(picture.rgba.iter().any(|p| p[0] > 0.2 && p[0] < 0.9), "{name}");
    }
    assert!(refused(&["study", "thesis", "--out", &out, "--size", "10x10"]).contains("from 64x48 to 4096x4096"));
    assert!(refused(&["study", "thesis", "--out", &out, "--fewer", "0"]).contains("--fewer"));
    assert!(refused(&["study", "thesis"]).contains("--out"));
}

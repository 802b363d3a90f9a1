//! `splatblur reference` as a program: its files, what it prints, going on, looking at a pixel, and what it refuses.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may stop")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use splatblur::film::{Aov, Picture};
use splatblur::image;

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn names(directory: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(directory).unwrap();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Three overlapping surfels that move before a grey background, in a directory of their own.
struct Fixture(tempfile::TempDir);

impl Fixture {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                   property float nx\nproperty float ny\nproperty float nz\nproperty float radius\nend_header\n\
                   0 0 0 0 0 1 1\n1 0 0 0 0 1 1\n0 1 0 0 0 1 1\n";
        let xml = "<scene><image width=\"12\" height=\"9\" background=\"0.5 0.25 0.125\"/><frames first=\"1\" \
                   last=\"2\"/>\
                   <camera eye=\"0 0 5\" at=\"0 0 0\"/><object name=\"three\"><pointModel>three.ply</pointModel>\
                   <motion type=\"linear\" velocity=\"0.8 0.3 0\"/></object></scene>\n";
        std::fs::write(dir.path().join("three.ply"), ply).unwrap();
        std::fs::write(dir.path().join("tiny.xml"), xml).unwrap();
        Self(dir)
    }

    fn run(&self, options: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_splatblur"));
        command.current_dir(self.0.path()).args(["reference", "tiny.xml"]).args(options).stdin(Stdio::null());
        command.output().unwrap()
    }

    /// Status 0; what was printed.
    fn done(&self, options: &[&str]) -> String {
        let output = self.run(options);
        assert_eq!(output.status.code(), Some(0), "{options:?}: {}", stderr(&output));
        stdout(&output)
    }

    /// What `--json` says of its only frame.
    fn frame(&self, options: &[&str]) -> serde_json::Value {
        let text = self.done(&[options, &["--frames", "1", "--json"]].concat());
        let report: serde_json::Value = serde_json::from_str(&text).unwrap();
        let frames = report["frames"].as_array().unwrap();
        assert_eq!(frames.len(), 1);
        frames[0].clone()
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Image and sums of frame 1 in a directory.
    fn bytes(&self, out: &str) -> [Vec<u8>; 2] {
        ["exr", "ref"].map(|ext| std::fs::read(self.path(&format!("{out}/tiny.0001.{ext}"))).unwrap())
    }
}

fn errors(picture: &Picture) -> &[Vec<f32>] {
    let layer = picture.layers.last().expect("a layer");
    assert_eq!(layer.aov, Aov::Error);
    &layer.planes
}

#[test]
fn writes_images_and_sums_and_prints_the_error() {
    let fixture = Fixture::new();
    let text = fixture.done(&["--samples", "64"]);
    let out = fixture.path("out/tiny.reference");
    assert_eq!(names(&out), ["tiny.0001.exr", "tiny.0001.ref", "tiny.0002.exr", "tiny.0002.ref"]);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 2, "{text}");
    for (frame, line) in (1..).zip(lines) {
        let path = out.join(format!("tiny.{frame:04}.exr"));
        let picture = image::read(&path).unwrap();
        let planes = errors(&picture);
        let values = || planes.iter().flatten().map(|&e| f64::from(e));
        let mean = values().sum::<f64>() / values().count() as f64;
        assert!(mean > 1e-3, "{mean}");
        assert!(line.contains(&format!("tiny.{frame:04}.exr: 64 samples a pixel, mean standard error {mean:.2e}, ")));
        let settings: serde_json::Value = serde_json::from_str(&image::read_settings(&path).unwrap()).unwrap();
        assert_eq!((&settings["samples"], &settings["sampler"]), (&64.into(), &"sobol".into()));
        assert_eq!((&settings["backend"], &settings["frame"]), (&"reference".into(), &frame.into()));
    }
    // Other layers, no sums, no words.
    let quiet = fixture.run(&["--samples", "16", "--out", "b", "--aov", "depth,velocity", "--no-sums", "--quiet"]);
    assert_eq!((stdout(&quiet), stderr(&quiet)), (String::new(), String::new()));
    assert_eq!(names(&fixture.path("b")), ["tiny.0001.exr", "tiny.0002.exr"]);
    let layers = image::read(&fixture.path("b/tiny.0001.exr")).unwrap().layers;
    assert_eq!(layers.iter().map(|layer| layer.aov).collect::<Vec<_>>(), [Aov::Depth, Aov::Velocity, Aov::Error]);
    // PNG has no layers; the sums stay.
    fixture.done(&["--samples", "16", "--out", "c", "--format", "png", "--frames", "1"]);
    assert_eq!(names(&fixture.path("c")), ["tiny.0001.png", "tiny.0001.ref"]);
}

#[test]
fn json_says_what_it_took() {
    let fixture = Fixture::new();
    let frame = fixture.frame(&["--samples", "32"]);
    assert_eq!((&frame["frame"], &frame["samples"], &frame["surfels"]), (&1.into(), &32.into(), &3.into()));
    assert_eq!(frame["traced"], 32 * 12 * 9);
    let picture = image::read(&fixture.path("out/tiny.reference/tiny.0001.exr")).unwrap();
    let values = || errors(&picture).iter().flatten().map(|&e| f64::from(e));
    let mean = values().sum::<f64>() / values().count() as f64;
    assert!((frame["mean_error"].as_f64().unwrap() / mean - 1.0).abs() < 1e-6);
    assert_eq!(frame["path"], "out/tiny.reference/tiny.0001.exr");
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    let fixture = Fixture::new();
    for (sampler, sums) in [("sobol", true), ("random", true), ("jittered", false)] {
        let run = |out: &str, threads: &str| {
            let options =
                ["--frames", "1", "--samples", "32", "--sampler", sampler, "--threads", threads, "--out", out];
            fixture.done(&options);
            assert_eq!(names(&fixture.path(out)).len(), 1 + usize::from(sums), "{sampler}");
            std::fs::read(fixture.path(out).join("tiny.0001.exr")).unwrap()
        };
        assert!(run(&format!("{sampler}1"), "1") == run(&format!("{sampler}3"), "3"), "{sampler}");
    }
}

#[test]
fn going_on_is_the_run_in_one_piece() {
    let fixture = Fixture::new();
    let run = |out, samples, more: &[&str]| {
        fixture.frame(&[&["--out", out, "--samples", samples, "--aov", "depth"], more].concat())
    };
    run("a", "32", &[]);
    let first = fixture.bytes("a");
    assert_eq!(run("a", "96", &["--resume"])["traced"], 64 * 12 * 9);
    run("b", "96", &[]);
    assert!(fixture.bytes("a") == fixture.bytes("b") && fixture.bytes("a") != first);
    // There is enough already.
    assert_eq!(run("a", "32", &["--resume"])["samples"], 96);
    assert!(fixture.bytes("a") == fixture.bytes("b"));
    // Without --resume it starts from nothing; so it does with other settings, and says so.
    run("a", "32", &[]);
    assert!(fixture.bytes("a") == first);
    let frames = ["--out", "a", "--frames", "1", "--samples", "64", "--seed", "7", "--resume", "--aov", "depth"];
    let other = fixture.run(&frames);
    assert!(stderr(&other).contains("ref was made with other settings; starting from nothing"), "{}", stderr(&other));
    fixture.done(&["--out", "c", "--frames", "1", "--samples", "64", "--seed", "7", "--aov", "depth"]);
    assert!(fixture.bytes("a") == fixture.bytes("c"));
    // Damaged sums are an error, and nothing is touched.
    let path = fixture.path("c/tiny.0001.ref");
    let mut damaged = std::fs::read(&path).unwrap();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    std::fs::write(&path, &damaged).unwrap();
    let before = fixture.bytes("c");
    let refused =
        fixture.run(&["--out", "c", "--frames", "1", "--samples", "96", "--seed", "7", "--aov", "depth", "--resume"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("cannot go on from c/tiny.0001.ref") && stderr(&refused).contains("damaged"));
    assert!(fixture.bytes("c") == before);
}

#[test]
fn stops_at_the_error() {
    let fixture = Fixture::new();
    let enough = fixture.frame(&["--samples", "256", "--no-sums"])["mean_error"].as_f64().unwrap();
    let limit = format!("{}", enough / 4.0);
    let frame = fixture.frame(&["--error", &limit, "--samples", "65536", "--no-sums"]);
    let samples = frame["samples"].as_u64().unwrap();
    assert!(samples.is_multiple_of(256) && samples > 256 && samples < 16384, "{samples}");
    // The even scramblings decide, all report.
    assert!(frame["mean_error"].as_f64().unwrap() < 1.2 * enough / 4.0, "{frame}");
    // It comes to its end where the error is out of reach.
    assert_eq!(fixture.frame(&["--error", "1e-9", "--samples", "784", "--no-sums"])["samples"], 784);
}

/// The numbers after a word of a text.
fn numbers(text: &str, word: &str) -> Vec<f64> {
    let line = text.lines().find(|line| line.contains(word)).unwrap_or_else(|| panic!("no `{word}` in {text}"));
    let after = &line[line.find(word).unwrap() + word.len()..];
    after.split([' ', ',']).filter_map(|part| part.parse().ok()).collect()
}

#[test]
fn a_pixel_tells_what_the_image_has() {
    let fixture = Fixture::new();
    fixture.done(&["--frames", "2", "--samples", "64"]);
    let picture = image::read(&fixture.path("out/tiny.reference/tiny.0002.exr")).unwrap();
    let before = names(fixture.0.path());
    let at = |x: usize, y: usize| y * 12 + x;
    let mut covered = None;
    for (x, y) in (0..9).step_by(2).flat_map(|y| (1..12).step_by(2).map(move |x| (x, y))).chain([(0, 0), (11, 8)]) {
        let text = fixture.done(&["--frames", "2", "--samples", "64", "--pixel", &format!("{x},{y}"), "--out", "new"]);
        let (mean, error) = (numbers(&text, "coverage: "), numbers(&text, "standard error: "));
        assert!(text.starts_with(&format!("pixel {x}, {y}: ")), "{text}");
        assert_eq!((mean.len(), error.len(), text.matches("  scrambling ").count()), (4, 4, 16), "{text}");
        if mean[3] == 1.0 {
            covered = Some(format!("{x},{y}"));
        }
        for c in 0..4 {
            let (want, sigma) = (f64::from(picture.rgba[at(x, y)][c]), f64::from(errors(&picture)[c][at(x, y)]));
            assert!(c == 3 || (mean[c] - want).abs() < 2e-7, "{x},{y} channel {c}: {want}\n{text}");
            assert!((error[c] - sigma).abs() < 1e-8 + 1e-6 * sigma, "{x},{y} channel {c}: {sigma}\n{text}");
        }
    }
    assert!(errors(&picture).iter().flatten().any(|e| *e > 0.01));
    let text = fixture.done(&["--frames", "2", "--pixel", &covered.unwrap(), "--sample", "17"]);
    assert!(
        text.contains("sample 17 (scrambling 1):\n  film point ") && text.contains("direction of depth 1"),
        "{text}"
    );
    assert!(text.contains("  takes  `three` surfel ") && text.contains("weight ") && text.contains("  T "), "{text}");
    assert!((1.75..2.25).contains(&numbers(&text, "scene time ")[0]), "{text}");
    assert_eq!(names(fixture.0.path()), before);
}

#[test]
fn refuses_in_one_line_and_leaves_nothing() {
    let fixture = Fixture::new();
    let table: &[(&[&str], &str)] = &[
        (&["--samples", "0"], "a multiple of 16"),
        (&["--samples", "17"], "a multiple of 16"),
        (&["--samples", "-16"], "-16"),
        (&["--samples", "99999999999999999999"], "99999999999999999999"),
        (&["--samples", "1000000000000000"], "at most 68719476736"),
        (&["--error", "0"], "greater than 0"),
        (&["--error", "-1"], "greater than 0"),
        (&["--error", "nan"], "finite"),
        (&["--error", "small"], "small"),
        (&["--sampler", "halton"], "sobol, jittered, random"),
        (&["--jitter-density", "4"], "--sampler jittered"),
        (&["--sampler", "jittered", "--jitter-density", "0"], "1..=1024"),
        (&["--sampler", "jittered", "--jitter-density", "-1"], "1..=1024"),
        (&["--sampler", "jittered", "--error", "0.1"], "fixed number of samples"),
        (&["--sampler", "jittered", "--resume"], "fixed number of samples"),
        (&["--resume", "--no-sums"], "cannot be used with"),
        (&["--pixel", "12,0"], "outside the image of 12 x 9"),
        (&["--pixel", "0,9"], "outside the image of 12 x 9"),
        (&["--pixel", "-1,0"], "as in 320,200"),
        (&["--pixel", "3"], "as in 320,200"),
        (&["--pixel", "0,0", "--sample", "1024"], "the last of 1024 samples, 1023"),
        (&["--pixel", "0,0", "--sample", "-1"], "-1"),
        (&["--pixel", "0,0", "--error", "0.1"], "cannot be used with"),
        (&["--pixel", "0,0", "--json"], "cannot be used with"),
        (&["--sample", "3"], "--pixel"),
        (&["--seed", "-1"], "-1"),
        (&["--size", "-5x5"], "1920x1080"),
        (&["--threads", "0"], "1..=1024"),
        (&["--format", "png", "--aov", "depth"], "--format exr"),
        (&["--bits", "8"], "EXR has 16 or 32 bits"),
        (&["--aov", "error"], "alpha, depth, normal, velocity"),
        (&["--weight", "hat"], "tent"),
        (&["--mode", "still"], "--mode"),
        (&["--prefilter", "none"], "--prefilter"),
        (&["--out", "three.ply"], "cannot write into the output directory three.ply"),
        (&["--restrict", "/no/such/directory"], "not a directory"),
    ];
    let before = names(fixture.0.path());
    for (options, expected) in table {
        let output = fixture.run(options);
        let line = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{options:?}: {line}");
        assert_eq!(stdout(&output), "", "{options:?}");
        let said = line.lines().last().unwrap_or_default();
        assert!(said.starts_with("error: ") && said.contains(expected), "{options:?}: {line}");
        assert_eq!(line.lines().filter(|line| line.contains("error")).count(), 1, "{options:?}: {line}");
        assert_eq!(names(fixture.0.path()), before, "{options:?}");
    }
}

#[test]
fn help_lists_every_option() {
    let options = "--out --frames --size --format --bits --aov --background --transparent --resume --no-sums --pixel \
                   --sample --samples --error --sampler --jitter-density --shutter --weight --filter --seed --shading \
                   --two-sided --epsilon --threads --lenient --restrict --json --quiet";
    for help in [["reference", "--help"], ["help", "reference"], ["reference", "-h"]] {
        let output = Command::new(env!("CARGO_BIN_EXE_splatblur")).args(help).output().unwrap();
        let text = stdout(&output);
        for option in options.split_whitespace() {
            assert!(
                text.contains(&format!("{option} ")) || text.contains(&format!("{option}\n")),
                "{help:?}: {option}"
            );
        }
        assert!(text.contains("[default: exr]") && text.contains("out/<scene>.reference"), "{text}");
    }
}

//! The command line as a user meets it: `render`, and what all commands share. One file, because the tests share a
//! scene that they make, and what they read of an output.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::path::Path;
use std::process::{Command, Output, Stdio};

use splatblur::film::{Aov, Layer, Picture};
use splatblur::image::{self, Bits, Format};
use splatblur::options::RenderOptions;

fn splatblur(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_splatblur")).args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Exit status 2, nothing on stdout, one line on stderr; returns the line.
fn refused(arguments: &[&str]) -> String {
    let output = splatblur(arguments);
    let line = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {line}");
    assert_eq!(stdout(&output), "", "{arguments:?}");
    assert!(line.starts_with("error: ") && line.ends_with('\n'), "{arguments:?}: {line:?}");
    assert_eq!(line.matches('\n').count(), 1, "{arguments:?}: {line:?}");
    line
}

fn names(directory: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(directory).unwrap();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn help_lists_every_option() {
    let render = "--out --frames --mode --error --samples-max --samples --pixel-samples --size --shutter --weight \
                  --filter --prefilter --shading --two-sided --epsilon --background --transparent --backend --format \
                  --bits --compression --aov --threads --seed --memory --resume --json --lenient --restrict --quiet \
                  --movie --no-frames";
    for (command, options) in [
        ("render", render),
        ("info", "--json --xml --csv --frames --step --lenient --restrict"),
        ("convert", "--radius-scale --colour-space --force"),
    ] {
        for help in [vec![command, "--help"], vec!["help", command], vec![command, "-h"]] {
            let output = splatblur(&help);
            assert_eq!(output.status.code(), Some(0));
            let text = stdout(&output);
            for option in options.split_whitespace() {
                assert!(
                    text.contains(&format!("{option} ")) || text.contains(&format!("{option}\n")),
                    "{help:?}: {option}"
                );
            }
        }
        let long = stdout(&splatblur(&[command, "--help"]));
        assert!(long.contains("Examples:") && long.contains(&format!("splatblur {command} ")), "{long}");
    }
    let version = splatblur(&["--version"]);
    assert_eq!(stdout(&version), concat!("splatblur ", env!("CARGO_PKG_VERSION"), "\n"));
    let nothing = splatblur(&[]);
    assert_eq!(nothing.status.code(), Some(2));
    assert!(stderr(&nothing).contains("Usage: splatblur"));
}

#[test]
fn bad_values_are_refused_in_one_line() {
    let table: &[(&[&str], &str)] = &[
        (&["--frames", "7..3"], "did you mean 3..7?"),
        (&["--frames", "-5"], "-5..-5"),
        (&["--frames", "x"], "not a frame number"),
        (&["--size", "0x0"], "1920x1080"),
        (&["--size", "-5x5"], "1920x1080"),
        (&["--size", "99999999x99999999"], "65535"),
        (&["--samples", "0"], "1 to 65536"),
        (&["--samples", "-3"], "1 to 65536"),
        (&["--samples", "4", "--pixel-samples", "0"], "1 to 65536"),
        (&["--mode", "auto", "--samples", "8"], "--samples-max"),
        (&["--mode", "still", "--interleave", "2"], "--interleave is for modes with time samples"),
        (&["--samples", "8", "--error", "good"], "--error is for --mode auto"),
        (&["--mode", "bucket", "--samples-max", "8"], "--samples-max is for --mode auto"),
        (&["--error", "0"], "draft, good, final"),
        (&["--error", "-1"], "draft, good, final"),
        (&["--error", "nan"], "draft, good, final"),
        (&["--error", "best"], "draft, good, final"),
        (&["--samples-max", "3"], "4 to 65536"),
        (&["--format", "exr", "--samples", "4", "--aov", "error"], "--aov error is for --mode auto"),
        (&["--buckets", "4"], "--mode bucket"),
        (&["--interleave", "3"], "none, auto, 2 or 4"),
        (&["--mode", "still", "--interleave", "2"], "not for --mode still"),
        (&["--mode", "bucket", "--buckets", "6000", "--samples", "6000"], "at most 65536"),
        (&["--kernel", "tube"], "--mode volumetric"),
        (&["--published"], "--mode volumetric"),
        (&["--mode", "volumetric", "--kernel-weight", "chord"], "--kernel ellipsoid"),
        (&["--mode", "volumetric", "--published", "--alpha", "union"], "--published"),
        (&["--mode", "volumetric", "--source-samples", "0"], "1 to 64"),
        (&["--mode", "volumetric", "--interleave", "2"], "--interleave"),
        (&["--mode", "still", "--samples", "4"], "--pixel-samples"),
        (&["--mode", "swept"], "auto, still, supersample"),
        (&["--shutter", "1,0"], "closes at 0"),
        (&["--shutter", "nan,nan"], "finite"),
        (&["--weight", "ramp:centre=7"], "0 to 1"),
        (&["--weight", "hat"], "tent"),
        (&["--filter", "sinc"], "box, point"),
        (&["--prefilter", "blur"], "approx, ewa, none, auto"),
        (&["--shading", "flat"], "phong, gouraud"),
        (&["--epsilon", "-1"], "0 to 1e30"),
        (&["--epsilon", "1e40"], "0 to 1e30"),
        (&["--weight", "gaussian:width=1e-4"], "0.001 to 1000"),
        (&["--epsilon", "inf"], "finite"),
        (&["--background", "1,1"], "R,G,B"),
        (&["--background", "-1,0,0"], "0 to 1e6"),
        (&["--background", "1,1,1", "--transparent"], "cannot be used with"),
        (&["--backend", "tpu"], "auto, gpu, cpu"),
        (&["--format", "jpg"], "png, exr"),
        (&["--bits", "10"], "8, 16, 32"),
        (&["--bits", "8", "--format", "exr"], "EXR has 16 or 32 bits"),
        (&["--bits", "32"], "PNG has 8 or 16 bits"),
        (&["--compression", "zip"], "--format exr"),
        (&["--compression", "dwaa", "--format", "exr"], "none, rle, zips, zip, piz"),
        (&["--aov", "depth"], "--format exr"),
        (&["--aov", "colour", "--format", "exr"], "alpha, depth, normal, velocity"),
        (&["--aov", "depth,depth", "--format", "exr"], "twice"),
        (&["--threads", "0"], "1..=1024"),
        (&["--threads", "-1"], "1..=1024"),
        (&["--threads", "99999999999"], "1024"),
        (&["--memory", "64X"], "64M"),
        (&["--memory", "0"], "0 is too little: at least 1M"),
        (&["--memory", "-1"], "at least 1M"),
        (&["--memory", "9999999999T"], "at most 900000T"),
        (&["--frames", "3.."], "lacks an end: write both, as in 3..48"),
        (&["--frames", "0..1000000000x0.0001"], "too many for one run"),
        (&["--seed", "-1"], "-1"),
        (&["--restrict", "/no/such/directory"], "not a directory"),
        (&["--sampels", "3"], "--samples"),
        (&["another.xml"], "unexpected argument"),
    ];
    for (options, expected) in table {
        let line = refused(&[&["render", "no_such_scene.xml"], *options].concat());
        assert!(line.contains(expected), "{options:?}: {line}");
    }
}

#[test]
fn bad_files_are_refused_in_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    for file in [path("none.xml"), path("none.ply"), dir.path().to_str().unwrap().to_owned(), "/dev/null".to_owned()] {
        for arguments in [vec!["info", &file], vec!["render", &file]] {
            assert!(refused(&arguments).contains(&file), "{arguments:?}");
        }
    }
    std::fs::write(path("a.ply"), "ply\n").unwrap();
    std::fs::write(path("b.ply"), "ply\n").unwrap();
    assert!(refused(&["info", &path("a.ply"), "--xml"]).contains("--xml is for scenes"));
    assert!(refused(&["info", &path("a.ply"), "--csv"]).contains("--csv is for animations"));
    assert!(refused(&["info", &path("a.ply"), "--frames", "1..2"]).contains("--csv"));
    assert!(refused(&["info", &path("a.ply"), "--csv", "--step", "0"]).contains("greater than 0"));
    assert!(refused(&["convert", &path("a.ply"), &path("a.obj")]).contains(".bin or .ply"));
    assert!(refused(&["convert", &path("a.ply"), &path("a.ply")]).contains("both IN and OUT"));
    assert!(refused(&["convert", &path("a.ply"), &path("b.ply")]).contains("--force"));
    assert!(refused(&["convert", &path("a.ply"), &path("c.bin"), "--radius-scale", "-1"]).contains("1e-6 to 1e6"));
    // American spellings are taken, too.
    assert!(refused(&["convert", &path("a.ply"), &path("c.bin"), "--color-space", "x"]).contains("srgb"));
    assert!(refused(&["info", &path("a.ply"), "--radius-scale", "1e300"]).contains("1e-6 to 1e6"));
    assert_eq!(names(dir.path()), ["a.ply", "b.ply"]);
}

#[test]
fn info_shows_images_and_their_settings() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let layers = vec![Layer { aov: Aov::Depth, planes: vec![vec![1.0, 2.0]], names: Vec::new() }];
    let picture = Picture { width: 2, height: 1, rgba: vec![[0.5; 4]; 2], layers };
    image::write(&path, &picture, Format::EXR, "{\"frame\":7,\"seed\":1}").unwrap();
    let output = splatblur(&["info", path.to_str().unwrap(), "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["kind"], "image");
    assert_eq!(report["layers"], serde_json::json!(["depth"]));
    assert_eq!(report["settings"]["frame"], 7);
    let text = stdout(&splatblur(&["info", path.to_str().unwrap()]));
    assert!(text.starts_with("kind: image\nwidth: 2\nheight: 1\n"), "{text}");
    assert!(text.contains("settings: frame 7, seed 1"), "{text}");
    // Damaged: an error, no panic.
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    assert!(refused(&["info", path.to_str().unwrap()]).contains("not a readable EXR file"));
}

#[test]
fn a_closed_pipe_is_no_error() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.png");
    let picture = Picture { width: 1, height: 1, rgba: vec![[0.5; 4]], layers: Vec::new() };
    // Longer than a pipe holds.
    let settings = format!("\"{}\"", "x".repeat(1 << 20));
    image::write(&path, &picture, Format::Png { bits: Bits::Eight, alpha: true }, &settings).unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_splatblur"))
        .args(["info", path.to_str().unwrap()])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), stderr(&output).as_str()), (Some(0), ""));
}

/// A scene of one triangle of surfels that moves, in a directory of its own.
struct Fixture(tempfile::TempDir);

impl Fixture {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                   property float nx\nproperty float ny\nproperty float nz\nproperty float radius\nend_header\n\
                   0 0 0 0 0 1 1\n1 0 0 0 0 1 1\n0 1 0 0 0 1 1\n";
        let xml = "<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>\n<scene><image width=\"12\" height=\"9\"/>\
                   <frames first=\"1\" last=\"3\" rate=\"24\"/><camera eye=\"0 0 5\" at=\"0 0 0\"/>\
                   <object><pointModel>three.ply</pointModel><motion type=\"linear\" velocity=\"0.1 0 0\"/></object>\
                   </scene>\n";
        std::fs::write(dir.path().join("three.ply"), ply).unwrap();
        std::fs::write(dir.path().join("tiny.xml"), xml).unwrap();
        Self(dir)
    }

    fn command(&self, options: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_splatblur"));
        command
            .current_dir(self.0.path())
            .args(["render", "tiny.xml", "--backend", "cpu"])
            .args(options)
            .stdin(Stdio::null());
        command
    }

    fn render(&self, options: &[&str]) -> Output {
        let output = self.command(options).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{options:?}: {}", stderr(&output));
        output
    }

    fn json(&self, options: &[&str]) -> serde_json::Value {
        serde_json::from_slice(&self.render(&[options, &["--json"]].concat()).stdout).unwrap()
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.0.path().join(name)
    }
}

/// Which frames a report says were rendered, not skipped.
fn rendered(report: &serde_json::Value) -> Vec<i64> {
    let frames = report["frames"].as_array().unwrap().iter();
    frames.filter(|f| f["skipped"] == false).map(|f| f["frame"].as_i64().unwrap()).collect()
}

#[test]
fn render_names_its_files_and_says_where_they_are() {
    let fixture = Fixture::new();
    let output = fixture.render(&[]);
    assert_eq!(names(&fixture.path("out/tiny")), ["tiny.0001.png", "tiny.0002.png", "tiny.0003.png"]);
    let text = stdout(&output);
    assert!(text.contains("out/tiny/tiny.0001.png .. tiny.0003.png"), "{text}");
    assert!(text.contains("ffmpeg -framerate 24 -start_number 1 -i out/tiny/tiny.%04d.png"), "{text}");
    assert!(stderr(&output).contains("tiny: frames 1..3, 12 x 9 pixels, mode auto:0.025, on the CPU"));
    // No progress in a pipe.
    assert!(!stderr(&output).contains(['\r', '\u{1b}']), "{:?}", stderr(&output));
    fixture.render(&["--frames", "-2..-1", "--out", "b", "--format", "exr", "--aov", "depth,normal,alpha,velocity"]);
    assert_eq!(names(&fixture.path("b")), ["tiny.-0001.exr", "tiny.-0002.exr"]);
    assert_eq!(image::read(&fixture.path("b/tiny.-0001.exr")).unwrap().layers.len(), 4);
    let quiet = fixture.render(&["--quiet"]);
    assert_eq!((stdout(&quiet).as_str(), stderr(&quiet).as_str()), ("", ""));
}

#[test]
fn render_takes_options_over_the_scene() {
    let fixture = Fixture::new();
    let report = fixture.json(&["--frames", "5", "--size", "7x3", "--transparent", "--weight", "ramp", "--seed", "9"]);
    assert_eq!(rendered(&report), [5]);
    assert_eq!(report["settings"]["weight"], "ramp:centre=1");
    assert_eq!(report["settings"]["seed"], 9);
    let (whole, frame) = (&report["seconds"], &report["frames"][0]["seconds"]);
    assert!((1e-6..whole.as_f64().unwrap()).contains(&frame.as_f64().unwrap()), "{frame} of {whole} seconds");
    assert_eq!(report["ffmpeg"], serde_json::Value::Null);
    let picture = image::read(&fixture.path("out/tiny/tiny.0005.png")).unwrap();
    assert_eq!((picture.width, picture.height), (7, 3));
    let carried = image::read_settings(&fixture.path("out/tiny/tiny.0005.png")).unwrap();
    let carried: serde_json::Value = serde_json::from_str(&carried).unwrap();
    assert_eq!((&carried["hash"], &carried["frame"]), (&report["settings"]["hash"], &serde_json::json!(5)));
}

#[test]
fn generate_replaces_a_file_only_if_told() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("ball.ply");
    let arguments = ["generate", "sphere", path.to_str().unwrap(), "--surfels", "100"];
    assert_eq!(splatblur(&arguments).status.code(), Some(0));
    let first = std::fs::read(&path).unwrap();
    assert!(first.starts_with(b"ply\n"));
    std::fs::write(&path, "mine").unwrap();
    assert!(refused(&arguments).contains("ball.ply exists already (--force replaces it)"));
    assert_eq!(std::fs::read(&path).unwrap(), b"mine");
    assert_eq!(splatblur(&[&arguments[..], &["--force"]].concat()).status.code(), Some(0));
    assert_eq!(std::fs::read(&path).unwrap(), first);
}

/// A frame between two others is the frame before it with the shutter half a frame later, whatever the backend.
#[test]
fn frames_may_be_lists_and_fractions() {
    let fixture = Fixture::new();
    let options = ["--samples", "4", "--format", "exr", "--aov", "velocity", "--size", "48x36"];
    let report = fixture.json(&[&options[..], &["--frames", "3,1..2x0.5,1"]].concat());
    let numbers: Vec<_> = report["frames"].as_array().unwrap().iter().map(|f| f["frame"].as_f64().unwrap()).collect();
    assert_eq!(numbers, [3.0, 1.0, 1.5, 2.0]);
    assert_eq!(report["ffmpeg"], serde_json::Value::Null);
    let of = |directory: &str, name: &str| image::read(&fixture.path(directory).join(name)).unwrap();
    assert_eq!(
        names(&fixture.path("out/tiny")),
        ["tiny.0001.exr", "tiny.0001_5000.exr", "tiny.0002.exr", "tiny.0003.exr"]
    );
    fixture.render(&[&options[..], &["--frames", "1", "--shutter", "0.25,0.75", "--out", "later"]].concat());
    let (between, later) = (of("out/tiny", "tiny.0001_5000.exr"), of("later", "tiny.0001.exr"));
    assert_eq!(between, later);
    assert_ne!(between, of("out/tiny", "tiny.0001.exr"));
    // Each has its own header, so that --resume finds them again, in the order of another list.
    assert_eq!(rendered(&fixture.json(&[&options[..], &["--frames", "1..3", "--resume"]].concat())), [0; 0]);
    fixture.render(&[&options[..], &["--frames", "1.5", "--out", "alone"]].concat());
    assert_eq!(between, of("alone", "tiny.0001_5000.exr"));
}

/// The layer of objects is part of the settings. The report and the file name the objects. PNG and references lack it.
#[test]
fn the_layer_of_objects_comes_with_its_names() {
    let fixture = Fixture::new();
    let options = ["--samples", "4", "--format", "exr", "--frames", "1..2", "--resume"];
    let plain = fixture.json(&options);
    assert_eq!((rendered(&plain), plain.get("objects")), (vec![1, 2], None));
    let with = [&options[..], &["--aov", "object"]].concat();
    let report = fixture.json(&with);
    assert_eq!(rendered(&report), [1, 2]);
    assert_eq!(report["settings"]["aovs"], serde_json::json!(["object"]));
    let names = report["objects"].as_object().unwrap();
    assert_eq!(names.keys().collect::<Vec<_>>(), ["1"]);
    let picture = image::read(&fixture.path("out/tiny/tiny.0001.exr")).unwrap();
    assert_eq!(picture.layers[0].aov, Aov::Object);
    assert_eq!(names["1"], *picture.layers[0].names[0]);
    assert!(picture.layers[0].planes[0].iter().all(|&index| index == 0.0 || index == 1.0));
    assert!(picture.layers[0].planes[0].contains(&1.0));
    assert_eq!(rendered(&fixture.json(&with)), [0; 0]);
    let scene = fixture.path("tiny.xml");
    let scene = scene.to_str().unwrap();
    assert!(refused(&["render", scene, "--aov", "object", "--format", "png"]).contains("--format exr"));
    assert!(refused(&["reference", scene, "--aov", "object"]).contains("is for `splatblur render`"));
}

/// Units of layers have one place; help texts quote it.
#[test]
fn help_says_what_layers_hold() {
    for (command, aovs) in [("render", &Aov::LAYERS[..]), ("reference", &Aov::LAYERS[..6])] {
        let long = stdout(&splatblur(&["help", command]));
        let text = long.split_whitespace().collect::<Vec<_>>().join(" ");
        for aov in aovs {
            assert!(text.contains(aov.meaning()), "{command}: {}", aov.name());
        }
    }
    assert!(stdout(&splatblur(&["reference", "-h"])).contains("always has the layer `error`"));
}

/// `--resume` tells files of another precision or compression from those that it is to make.
#[test]
fn exr_files_may_be_half_and_compressed_in_several_ways() {
    let fixture = Fixture::new();
    let options = ["--frames", "1..2", "--samples", "4", "--format", "exr", "--aov", "depth,normal"];
    let whole = fixture.json(&options);
    assert_eq!((&whole["settings"]["bits"], &whole["settings"]["compression"]), (&32.into(), &"zip".into()));
    let all = |more: &[&str]| rendered(&fixture.json(&[&options[..], &["--resume"], more].concat()));
    let read = || image::read(&fixture.path("out/tiny/tiny.0001.exr")).unwrap();
    let float = read();
    assert_eq!(all(&[]), [0; 0]);
    assert_eq!(all(&["--compression", "piz"]), [1, 2]);
    assert_eq!(read(), float);
    assert_eq!(all(&["--bits", "16", "--compression", "piz"]), [1, 2]);
    let half = read();
    assert_ne!(half.rgba, float.rgba);
    assert_eq!(half.layers[0], float.layers[0], "depth stays float");
    for (a, b) in half.rgba.iter().flatten().zip(float.rgba.iter().flatten()) {
        // Half of the last bit of a small number, or of the smallest.
        assert!((a - b).abs() <= b.abs() / 2048.0 + 3e-8, "{a} {b}");
    }
    assert_eq!(all(&["--bits", "16", "--compression", "piz"]), [0; 0]);
}

/// What the filter needs is rendered, and not left in the file.
#[test]
fn render_filters_along_the_motion() {
    let fixture = Fixture::new();
    let options = ["--frames", "2", "--samples", "4", "--format", "exr"];
    let plain = fixture.json(&options);
    let smooth = fixture.json(&[&options[..], &["--reconstruct", "along", "--out", "along"]].concat());
    assert_eq!(smooth["settings"]["reconstruct"], "along");
    assert!(plain["settings"].get("reconstruct").is_none() && plain["settings"]["hash"] != smooth["settings"]["hash"]);
    assert_eq!(image::read(&fixture.path("along/tiny.0002.exr")).unwrap().layers.len(), 0);
}

#[test]
fn auto_says_what_it_reached() {
    let fixture = Fixture::new();
    let report = fixture.json(&[
        "--frames",
        "2",
        "--error",
        "draft",
        "--samples-max",
        "16",
        "--format",
        "exr",
        "--aov",
        "error",
    ]);
    assert_eq!(report["settings"]["mode"], "auto:0.05+samples-max=16");
    let auto = &report["frames"][0]["auto"];
    assert!(auto["error"].as_f64().unwrap() <= 0.05 && auto["most_samples"].as_u64().unwrap() <= 16, "{auto}");
    assert_eq!(image::read(&fixture.path("out/tiny/tiny.0002.exr")).unwrap().layers.len(), 1);
    let header = std::fs::read(fixture.path("out/tiny/tiny.0002.exr")).unwrap();
    let said = format!("error {:.4} with", auto["error"].as_f64().unwrap());
    assert!(header.windows(said.len()).any(|part| part == said.as_bytes()), "{said}");
    assert!(stdout(&fixture.render(&["--frames", "2"])).contains("\nestimated: error 0."));
}

#[test]
fn render_repeats_and_resumes() {
    let fixture = Fixture::new();
    let bytes = || std::fs::read(fixture.path("out/tiny/tiny.0002.png")).unwrap();
    assert_eq!(rendered(&fixture.json(&["--threads", "1"])), [1, 2, 3]);
    let first = bytes();
    assert_eq!(rendered(&fixture.json(&["--threads", "2", "--memory", "64M"])), [1, 2, 3]);
    assert!(bytes() == first, "other bytes with other threads and memory");
    assert_eq!(rendered(&fixture.json(&["--resume", "--threads", "2"])), [0; 0]);
    assert_eq!(rendered(&fixture.json(&["--resume", "--frames", "2..4"])), [4]);
    assert_eq!(rendered(&fixture.json(&["--resume", "--epsilon", "0.5"])), [1, 2, 3]);
    // A model with other bytes is another picture.
    let ply = std::fs::read_to_string(fixture.path("three.ply")).unwrap().replace("0 1 0 0 0 1 1", "0 2 0 0 0 1 1");
    std::fs::write(fixture.path("three.ply"), ply).unwrap();
    assert_eq!(rendered(&fixture.json(&["--resume", "--epsilon", "0.5"])), [1, 2, 3]);
}

#[test]
fn render_refuses_an_output_directory_before_rendering() {
    let fixture = Fixture::new();
    std::fs::write(fixture.path("file"), "").unwrap();
    for out in ["file", "file/below", "/proc/splatblur"] {
        let output = fixture.command(&["--out", out]).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        let said = stderr(&output);
        let last = said.lines().last().unwrap();
        assert!(last.starts_with("error: cannot write into the output directory"), "{said}");
    }
    assert_eq!(names(fixture.0.path()), ["file", "three.ply", "tiny.xml"]);
}

#[cfg(unix)]
#[test]
fn an_interrupt_leaves_finished_frames_only() {
    let fixture = Fixture::new();
    let child =
        fixture.command(&["--frames", "0..999999"]).stderr(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let out = fixture.path("out/tiny");
    while !out.join("tiny.0003.png").exists() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert!(stderr(&output).contains("interrupted"), "{}", stderr(&output));
    let left = names(&out);
    assert!(left.len() >= 4 && left.iter().all(|name| name.starts_with("tiny.")), "{left:?}");
    for name in &left {
        assert_eq!(image::read(&out.join(name)).unwrap().width, 12);
    }
}

/// The pixels of frame 2, and the settings of the run.
fn second_frame(fixture: &Fixture, options: &[&str]) -> (Vec<[u32; 4]>, serde_json::Value) {
    let report = fixture.json(&[&["--frames", "2", "--format", "exr"], options].concat());
    let picture = image::read(&fixture.path("out/tiny/tiny.0002.exr")).unwrap();
    (picture.rgba.iter().map(|pixel| pixel.map(f32::to_bits)).collect(), report["settings"].clone())
}

#[test]
fn a_whole_mode_and_its_parts_give_the_same_picture() {
    let fixture = Fixture::new();
    let whole = second_frame(&fixture, &["--mode", "supersample:8+interleave=2"]);
    let parts = second_frame(&fixture, &["--mode", "supersample", "--samples", "8", "--interleave", "2"]);
    assert_eq!(whole.1["mode"], "supersample:8+interleave=2");
    assert_eq!(whole, parts);
    assert!(whole.0 != second_frame(&fixture, &["--mode", "supersample:8"]).0, "a lattice changes the picture");
}

#[test]
fn a_mode_takes_its_options_behind_plus_signs() {
    let fixture = Fixture::new();
    let (pixels, settings) = second_frame(&fixture, &["--mode", "auto:0.05+samples-max=64"]);
    assert_eq!(settings["mode"], "auto:0.05+samples-max=64");
    let options = ["--mode", "auto", "--error", "0.05", "--samples-max", "64"];
    assert_eq!(second_frame(&fixture, &options), (pixels, settings));
}

#[test]
fn modes_that_contradict_themselves_are_refused() {
    let table: &[(&[&str], &[&str])] = &[
        (&["--mode", "supersample:8", "--samples", "4"], &["--samples 4", "--mode supersample:8"]),
        (&["--mode", "supersample:8+colour=red"], &["colour", "interleave, times, pixel-samples"]),
        (&["--mode", "auto:0.05+times=random"], &["times", "samples-max, pixel-samples, interleave"]),
        (&["--mode", "supersample:8+interleave=2+interleave=4"], &["`interleave` is there twice"]),
    ];
    for (options, expected) in table {
        let line = refused(&[&["render", "no_such_scene.xml"], *options].concat());
        assert!(expected.iter().all(|words| line.contains(words)), "{options:?}: {line}");
    }
}

/// The program and the library have the same defaults.
#[test]
fn a_bare_render_has_the_defaults_of_the_library() {
    let options = RenderOptions::default();
    let report = Fixture::new().json(&["--frames", "2"]);
    let settings = &report["settings"];
    assert_eq!(settings["mode"], options.quality.to_string());
    assert_eq!(settings["filter"], options.look.filter.to_string());
    assert_eq!(settings["prefilter"], options.prefilter.to_string());
    assert_eq!(settings["shading"], options.look.shading.to_string());
    assert_eq!(settings["seed"], options.look.seed);
}

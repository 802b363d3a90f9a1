//! What the program says: models in place of scenes, mistakes with files, and nothing that others print.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::path::Path;
use std::process::{Command, Output, Stdio};

use splatblur::image;

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_splatblur"));
    command.args(arguments).stdin(Stdio::null());
    command
}

fn run(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// The one line of a refusal.
fn refused(arguments: &[&str]) -> String {
    let output = run(arguments);
    let line = stderr(&output);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{arguments:?}: {line}");
    assert_eq!(line.matches('\n').count(), 1, "{arguments:?}: {line:?}");
    line
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                   property float nx\nproperty float ny\nproperty float nz\nproperty float radius\nend_header\n\
                   0 0 0 0 0 1 1\n1 0 0 0 0 1 1\n0 1 0 0 0 1 1\n";

/// A model alone is what a scene file with this model alone is, up to the settings in the header.
#[test]
fn a_model_is_rendered_without_a_scene() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    std::fs::write(path("three.ply"), PLY).unwrap();
    let scene = "<scene><object><pointModel>three.ply</pointModel></object></scene>";
    std::fs::write(path("scene.xml"), scene).unwrap();
    let options = ["--quiet", "--no-studio", "--samples", "2", "--format", "exr", "--out"];
    for (input, out) in [("three.ply", "a"), ("scene.xml", "b")] {
        let (input, out) = (path(input), path(out));
        let output = run(&[&["render", text(&input)], &options[..], &[text(&out)]].concat());
        assert_eq!((output.status.code(), stderr(&output)), (Some(0), String::new()));
    }
    let alone = image::read(&path("a/three.0000.exr")).unwrap();
    assert_eq!((alone.width, alone.height), (1024, 768));
    assert!(alone.rgba.iter().filter(|pixel| pixel[0] > 0.1).count() > 10_000);
    assert_eq!(alone, image::read(&path("b/scene.0000.exr")).unwrap());
    // On another shape of image the camera stands elsewhere, so that all is in view.
    let (model, out) = (path("three.ply"), path("c"));
    let output =
        run(&["render", text(&model), "--samples", "2", "--size", "40x200", "--transparent", "--out", text(&out)]);
    assert!(stderr(&output).contains("three.ply is a model: took a scene of it alone, seen by <camera eye="));
    let tall = image::read(&path("c/three.0000.png")).unwrap();
    let covers = |x: usize| (0..200).any(|y| tall.rgba[y * 40 + x][3] > 0.0);
    assert!(!covers(0) && !covers(39) && covers(20));
    // The reference takes models too.
    let out = path("d");
    let reference = ["reference", text(&model), "--samples", "16", "--size", "20x16", "--quiet", "--out", text(&out)];
    assert_eq!(run(&reference).status.code(), Some(0));
    assert!(path("d/three.0000.exr").exists());
}

#[test]
fn other_files_than_scenes_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let write = |name: &str, content: &str| {
        std::fs::write(path(name), content).unwrap();
        path(name)
    };
    let notes = write("notes.txt", "hello\n");
    let line = refused(&["render", text(&notes)]);
    assert!(line.contains("notes.txt is neither a scene (XML) nor a model of a known format"), "{line}");
    let line = refused(&["render", "animations/spin_y.anim"]);
    assert!(line.contains("is an animation: name it in the <animation> of a scene"), "{line}");
    let line = refused(&["render", "docs/images/three_objects.png"]);
    assert!(line.contains("is a picture, neither a scene nor a model"), "{line}");
    let out = path("a.bin");
    let line = refused(&["convert", "scenes/spin.xml", text(&out)]);
    assert!(line.contains("spin.xml is a scene; convert takes a model"), "{line}");
    let line = refused(&["render", "scenes/spin.xml", "--out", text(&notes)]);
    assert!(
        line.contains("the output directory") && line.contains("notes.txt: it is a file; name a directory"),
        "{line}"
    );
}

/// Full EWA is for kernels whose weights add up to 1.
#[test]
fn full_ewa_of_published_kernels_is_refused() {
    let options = ["render", "scenes/spin.xml", "--backend", "cpu", "--frames", "1", "--quiet", "--prefilter", "ewa"];
    for kernel in ["chord", "line"] {
        let mode = format!("volumetric:2+kernel=ellipsoid+kernel-weight={kernel}");
        let dir = tempfile::tempdir().unwrap();
        let line = refused(&[&options[..], &["--mode", &mode, "--out", text(&dir.path().join("out"))]].concat());
        let expected = format!("the weight `{kernel}`: take `--kernel-weight integral`");
        assert!(line.contains(&expected), "{line}");
    }
}

#[test]
fn samples_of_references_are_explained() {
    let samples = |count: &str| refused(&["reference", "scenes/spin.xml", "--samples", count]);
    assert!(samples("999999999999984").contains("too many (at most 68719476736)"));
    assert!(samples("100").contains(
        "100 samples of a pixel cannot be shared by 16 scramblings: a multiple of 16 is needed, such as 112"
    ));
    assert!(samples("0").contains("such as 16"));
    assert!(samples("99999999999999999999").contains("expected a multiple of 16 of at most 68719476736"));
}

/// Mesa's layer that chooses devices would print an error of the Wayland library.
#[cfg(all(feature = "gpu", target_os = "linux"))]
#[test]
fn no_library_prints_where_there_is_no_display() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("a");
    let options = ["--size", "16x12", "--samples", "1", "--frames", "1", "--quiet", "--out"];
    let render = |backend| {
        let arguments = [&["render", "scenes/spin.xml", "--backend", backend][..], &options, &[text(&out)]].concat();
        command(&arguments).env_remove("XDG_RUNTIME_DIR").env_remove("NODEVICE_SELECT").output().unwrap()
    };
    let output = render("gpu");
    if output.status.code() == Some(2) && std::env::var_os("REQUIRE_GPU").is_none() {
        return println!("SKIPPED no_library_prints_where_there_is_no_display: {}", stderr(&output));
    }
    for output in
        [output, render("auto"), command(&["info", "--adapters"]).env_remove("XDG_RUNTIME_DIR").output().unwrap()]
    {
        assert_eq!((output.status.code(), stderr(&output)), (Some(0), String::new()));
    }
}

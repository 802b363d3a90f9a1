//! A model alone, in its studio; and how PNG files show light.
#![allow(clippy::unwrap_used, reason = "tests may stop")]

use std::fs;
use std::path::Path;

use splatblur::image;

use super::run;

/// A cube whose eight corners are its vertices.
const CUBE: &str = "\
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// Points with two colours.
const SCAN: &str = "\
ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty float nx
property float ny\nproperty float nz\nproperty float radius\nproperty uchar red\nproperty uchar green
property uchar blue\nend_header
-1 0 0 0 0 1 1 200 100 0\n1 0 0 0 0 1 1 200 100 0\n-1 2 0 0 0 1 1 200 100 0\n1 2 0 0 0 1 1 0 100 200\n";

const SMALL: &str = "--size 64x48 --backend cpu --mode supersample:4";

fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("cube.obj"), CUBE).unwrap();
    fs::write(dir.path().join("scan.ply"), SCAN).unwrap();
    dir
}

/// Runs a line that must work; what it says on stderr.
fn fine(dir: &Path, line: &str) -> String {
    let (status, _, errors) = run(dir, line);
    assert_eq!(status, Some(0), "{line}: {errors}");
    errors
}

/// Runs a line that must be refused, in one line; that line.
fn refused(dir: &Path, line: &str) -> String {
    let (status, _, errors) = run(dir, line);
    assert_eq!((status, errors.lines().count()), (Some(2), 1), "{line}: {errors}");
    errors
}

fn settings(path: &Path) -> serde_json::Value {
    serde_json::from_str(&image::read_settings(path).unwrap()).unwrap()
}

#[test]
fn a_mesh_is_lit_and_has_a_shadow() {
    let dir = folder();
    let said = fine(dir.path(), &format!("render cube.obj --out lit {SMALL}"));
    assert!(said.contains("in a studio, lit by three lamps (--unlit shows"), "{said}");
    fine(dir.path(), &format!("render cube.obj --out bright --no-shadows {SMALL}"));
    fine(dir.path(), &format!("render cube.obj --out linear --format exr {SMALL}"));
    let path = |name: &str| dir.path().join(name);
    let lit = image::read(&path("lit/cube.0000.png")).unwrap();
    let bright = image::read(&path("bright/cube.0000.png")).unwrap();
    let darker = lit.rgba.iter().zip(&bright.rgba).filter(|(a, b)| a[0] < b[0] - 0.1).count();
    assert!(darker > 20 && darker < 64 * 48 / 2, "{darker} pixels in the shadow");
    // Corners show the background; the light of the film is in EXR files as it is.
    let linear = image::read(&path("linear/cube.0000.exr")).unwrap();
    assert!((linear.rgba[0][0] - 0.6).abs() < 1e-5, "{:?}", linear.rgba[0]);
    assert!(linear.rgba.iter().all(|pixel| pixel[..3].iter().all(|&v| v <= 1.0)));
    let (lit, linear) = (settings(&path("lit/cube.0000.png")), settings(&path("linear/cube.0000.exr")));
    assert_eq!((&lit["view_transform"], &lit["dither"]), (&"agx".into(), &true.into()));
    assert!(linear.get("view_transform").is_none() && linear.get("dither").is_none(), "{linear}");
    assert_eq!(lit["inputs"].as_array().map(Vec::len), Some(1));
}

#[test]
fn one_frame_alone_is_that_of_a_sequence_and_runs_agree() {
    let dir = folder();
    fine(dir.path(), &format!("render cube.obj --frames 0..2 --out a {SMALL}"));
    fine(dir.path(), &format!("render cube.obj --frames 2 --out b --threads 1 {SMALL}"));
    let bytes = |name: &str| fs::read(dir.path().join(name)).unwrap();
    assert_eq!(bytes("a/cube.0002.png"), bytes("b/cube.0002.png"));
}

#[test]
fn a_scan_shows_its_colours() {
    let dir = folder();
    let said = fine(dir.path(), &format!("render scan.ply --out own --dither=off {SMALL}"));
    assert!(said.contains("its colours as they are (--unlit=off lights it)"), "{said}");
    let own = image::read(&dir.path().join("own/scan.0000.png")).unwrap();
    let wanted = [200.0_f32, 100.0, 0.0].map(|code| splatblur::math::srgb::to_linear(code / 255.0));
    let is_wanted = |pixel: &&[f32; 4]| (0..3).all(|c| (pixel[c] - wanted[c]).abs() < 2e-3);
    assert!(own.rgba.iter().filter(is_wanted).count() > 100);
    let said = fine(dir.path(), &format!("render scan.ply --out lit --unlit=off {SMALL}"));
    assert!(said.contains("lit by three lamps"), "{said}");
}

/// A movie of EXR files, one of PNG files and one alone are the same, at transparent edges too.
#[test]
fn movies_show_light_as_png_files_do() {
    let dir = folder();
    let movie = |name: &str, more: &str| {
        let line = format!("render cube.obj --transparent --out {name} --movie {name}.y4m {SMALL}{more}");
        fine(dir.path(), &line);
        fs::read(dir.path().join(format!("{name}.y4m"))).unwrap()
    };
    let png = movie("png", "");
    assert!(movie("exr", " --format exr") == png, "of EXR files");
    assert!(movie("alone", " --no-frames") == png, "alone");
}

#[test]
fn the_bare_model_is_not_dithered_and_turns() {
    let dir = folder();
    fine(dir.path(), &format!("render cube.obj --out bare --no-studio {SMALL}"));
    let bare = settings(&dir.path().join("bare/cube.0000.png"));
    assert!(bare.get("dither").is_none() && bare["background"] == serde_json::json!([0.0, 0.0, 0.0]), "{bare}");
    fine(dir.path(), &format!("render scan.ply --out z --up z --no-studio {SMALL}"));
    fine(dir.path(), &format!("render scan.ply --out y --no-studio {SMALL}"));
    let [z, y] = ["z", "y"].map(|name| fs::read(dir.path().join(name).join("scan.0000.png")).unwrap());
    assert_ne!(z, y);
    // Upside down.
    fine(dir.path(), &format!("render scan.ply --out down --up -y --no-studio {SMALL}"));
    assert_ne!(fs::read(dir.path().join("down/scan.0000.png")).unwrap(), y);
}

/// Two points that fly to the right, ten units a frame.
fn flying(dir: &Path) {
    let scan = SCAN.replace("element vertex 4", "element vertex 2");
    let head = scan.split("end_header").next().unwrap();
    let velocity = "property float vx\nproperty float vy\nproperty float vz\nend_header";
    let points = "-1 0 0 0 0 1 1 200 100 0 240 0 0\n1 0 0 0 0 1 1 200 100 0 240 0 0\n";
    fs::write(dir.join("flying.ply"), format!("{head}{velocity}\n{points}")).unwrap();
}

#[test]
fn all_of_a_long_exposure_is_framed() {
    let dir = folder();
    flying(dir.path());
    let still = fine(dir.path(), &format!("render flying.ply --out a {SMALL}"));
    let long = fine(dir.path(), &format!("render flying.ply --out b --shutter 0,4 {SMALL}"));
    let eye = |said: &str| {
        let [_, numbers] = said.split("eye=\"").collect::<Vec<_>>()[..] else { panic!("{said}") };
        numbers.split(' ').next().unwrap().parse::<f64>().unwrap()
    };
    assert!(eye(&long) > eye(&still) + 20.0, "{long}{still}");
}

#[test]
fn choices_that_nothing_heeds_are_refused() {
    let dir = folder();
    fs::write(dir.path().join("s.xml"), "<scene><object><pointModel>scan.ply</pointModel></object></scene>").unwrap();
    for (line, why) in [
        ("render s.xml --up z", "--up is for a model file, and s.xml is a scene"),
        ("render s.xml --unlit", "--unlit is for a model file, and s.xml is a scene"),
        ("render cube.obj --unlit --no-studio", "cannot be used with"),
        ("render cube.obj --format exr --stops 1", "--stops is for PNG: EXR keeps the light as it is"),
        ("render cube.obj --format exr --dither", "--dither is for PNG"),
        ("reference cube.obj --view-transform agx", "--view-transform is for PNG"),
        ("render cube.obj --stops 33", "33 is not from -32 to 32"),
        ("render cube.obj --up x", "possible values: y, z"),
        ("dataset cube.obj --dither", "unexpected argument '--dither'"),
    ] {
        let errors = refused(dir.path(), line);
        assert!(errors.contains(why), "{line}: {errors}");
    }
}

#[test]
fn stops_and_curves_are_for_scenes_too() {
    let dir = folder();
    fs::write(dir.path().join("s.xml"), "<scene><object><pointModel>scan.ply</pointModel></object></scene>").unwrap();
    let picture = |out: &str, more: &str| {
        fine(dir.path(), &format!("render s.xml --out {out} --background 0.1,0.1,0.1 {SMALL}{more}"));
        image::read(&dir.path().join(out).join("s.0000.png")).unwrap().rgba[0][0]
    };
    let (plain, stop) = (picture("a", ""), picture("b", " --stops 1"));
    assert!((plain - 0.1).abs() < 1e-3 && (stop - 0.2).abs() < 2e-3, "{plain} {stop}");
    // A tenth is .85 stops below middle grey: 1/2 - 2 (.85 / 16.5) and a little more, to the power of 2.2.
    let agx = picture("c", " --view-transform agx");
    assert!((agx - 0.397_f32.powf(2.2)).abs() < 5e-3, "{agx}");
}

#[test]
fn wipe_joins_two_sequences() {
    let dir = folder();
    for (out, more) in [("a", ""), ("b", " --no-shadows")] {
        fine(dir.path(), &format!("render cube.obj --frames 0..3 --out {out} {SMALL}{more}"));
    }
    let (status, said, errors) = run(dir.path(), "wipe a b --out w.gif --times 2");
    assert_eq!((status, &*said, &*errors), (Some(0), "w.gif: 8 frames, 24 a second\n", ""));
    let first = fs::read(dir.path().join("w.gif")).unwrap();
    assert!(first.starts_with(b"GIF89a") && first.ends_with(b";"));
    fine(dir.path(), "wipe a b --out w.gif --times 2 --quiet");
    assert_eq!(fs::read(dir.path().join("w.gif")).unwrap(), first);
    fine(dir.path(), "wipe a/cube.0000.png b/cube.0000.png --out one.y4m --rate 30 --quiet");
    fine(
        dir.path(),
        &format!("render cube.obj --frames 0..3 --out c --no-shadows {} --quiet", SMALL.replace("64", "32")),
    );
    fs::create_dir(dir.path().join("empty")).unwrap();
    for (line, why) in [
        ("wipe a c --out x.gif", "cannot join"),
        ("wipe a empty --out x.gif", "holds no numbered PNG or EXR files"),
        ("wipe a b/cube.0000.png --out x.gif", "nothing to pair"),
        ("wipe a b --out x.gif --rate 100", "GIF has 0.01 to 50 frames a second"),
        ("wipe a b --out x.gif --rate 0", "0 is not from 0.001 to 1e6"),
        ("wipe a b --out x.gif --times 0", "0 is not in 1..=1000"),
        ("wipe a b --out x.avi", "expected a file .mp4 or .mov"),
        ("wipe a none --out x.gif", "none"),
    ] {
        let errors = refused(dir.path(), line);
        assert!(errors.contains(why), "{line}: {errors}");
        assert!(!dir.path().join("x.gif").exists());
    }
    fs::remove_file(dir.path().join("b/cube.0002.png")).unwrap();
    assert!(refused(dir.path(), "wipe a b --out x.gif").contains("b has no frame 2, which the other has"));
}

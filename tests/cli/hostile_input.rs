//! Hostile input to `compare`, `sheet` and `report`: whatever is asked for and whatever lies on the disk, the program
//! ends by itself, and where it refuses it says so in one line, with exit status 2.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use proptest::prelude::*;
use proptest::sample::{Index, select};
use serde_json::Value;
use splatblur::film::Picture;
use splatblur::image::{self, Bits, Format};

/// Runs the program in the fixture's folder; its exit status, which a refusal (2) has explained in one line.
fn status(arguments: &[&str]) -> i32 {
    let output = Command::new(env!("CARGO_BIN_EXE_splatblur"))
        .args(arguments)
        .current_dir(fixture())
        // Without it Mesa prints a line.
        .env("XDG_RUNTIME_DIR", fixture())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let (out, said) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let code = output.status.code().unwrap_or_else(|| panic!("{arguments:?} was killed: {said}"));
    assert!((0..=2).contains(&code), "{arguments:?}: {code}: {said}");
    if code == 2 {
        assert!(said.starts_with("error: ") && said.matches('\n').count() == 1, "{arguments:?}: {said:?}");
        assert_eq!(out, "", "{arguments:?}");
    }
    code
}

const PLY: &str = "ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
property float nx
property float ny
property float nz
property float radius
end_header
0 0 0 0 0 1 0.3
0.4 0.1 0 0 0 1 0.3
-0.3 0.2 0.1 0 0 1 0.3
";

/// Options of `sheet` and `report`.
const OPTIONS: &[&str] =
    &["--modes", "--frames", "--crop", "--limit", "--backends", "--reference", "--size", "--weight", "--epsilon"];

const SCENE: &str = r#"<scene><image width="16" height="12"/><frames first="0" last="1"/>
<camera eye="0 0 3" at="0 0 0"/><object><pointModel>three.ply</pointModel>
<motion type="linear" velocity="0.5 0 0"/></object></scene>"#;

/// A folder with a scene of three surfels, pictures `a.png`, `b.exr`, and a finished report in `report`.
fn fixture() -> &'static Path {
    static DIRECTORY: OnceLock<tempfile::TempDir> = OnceLock::new();
    let make = || {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("three.ply"), PLY).unwrap();
        std::fs::write(dir.path().join("tiny.xml"), SCENE).unwrap();
        let rgba = (0..192_u8).map(|i| [f32::from(i) / 200.0, 0.25, 0.5, 1.0]).collect();
        let picture = Picture { width: 16, height: 12, rgba, layers: Vec::new() };
        let png = Format::Png { bits: Bits::Eight, alpha: true };
        image::write(&dir.path().join("a.png"), &picture, png, "settings").unwrap();
        image::write(&dir.path().join("b.exr"), &picture, Format::EXR, "settings").unwrap();
        dir
    };
    DIRECTORY.get_or_init(make).path()
}

const REPORT: [&str; 8] = [
    "report",
    "tiny.xml",
    "--modes=still:1,supersample:2",
    "--reference=16",
    "--repeats=1",
    "--quiet",
    "--frames=0..1",
    "--out",
];

/// The finished report, and its JSON without times.
fn report() -> &'static (std::path::PathBuf, Value) {
    static REPORTED: OnceLock<(std::path::PathBuf, Value)> = OnceLock::new();
    REPORTED.get_or_init(|| {
        let out = fixture().join("report");
        assert_eq!(status(&[&REPORT[..], &[out.to_str().unwrap()]].concat()), 0);
        let found = figures(&out);
        (out, found)
    })
}

/// The JSON of a report without its times.
fn figures(out: &Path) -> Value {
    let mut json: Value = serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap();
    let timeless = |mode: &mut Value| mode.as_object_mut().unwrap().remove("seconds").map(drop);
    json["sequence"].as_array_mut().unwrap().iter_mut().for_each(|mode| timeless(mode).unwrap());
    for frame in json["frames"].as_array_mut().unwrap() {
        frame["reference_seconds"] = Value::Null;
        frame["modes"].as_array_mut().unwrap().iter_mut().for_each(|mode| timeless(mode).unwrap());
    }
    json
}

/// Words and signs of the grammars, in any order, and what belongs to none.
fn words() -> impl Strategy<Value = String> {
    const WORDS: [&str; 40] = [
        "still",
        "supersample",
        "bucket",
        "volumetric",
        "reference",
        "interleave",
        "published",
        "kernel",
        "ellipsoid",
        "alpha",
        "sum",
        "once",
        "flip",
        "psnr",
        "ssim",
        "non-finite",
        "gamma-rmse",
        "@cpu",
        "@gpu",
        ":",
        "x",
        "+",
        "=",
        ",",
        "..",
        "-",
        "#",
        "%",
        "0",
        "1",
        "2",
        "8",
        "99999999999999999999",
        "1e309",
        "nan",
        "-0",
        " ",
        "\u{e9}\u{202e}",
        "\n",
        "",
    ];
    prop_oneof![prop::collection::vec(select(&WORDS[..]), 0..8).prop_map(|words| words.concat()), "\\PC{0,12}"]
}

#[derive(Clone, Debug)]
enum Damage {
    Truncate(Index),
    Change(Index, u8),
    Noise(Vec<u8>),
    Remove,
}

fn damage() -> impl Strategy<Value = Damage> {
    prop_oneof![
        any::<Index>().prop_map(Damage::Truncate),
        (any::<Index>(), 1..=255_u8).prop_map(|(at, bits)| Damage::Change(at, bits)),
        prop::collection::vec(any::<u8>(), 0..64).prop_map(Damage::Noise),
        Just(Damage::Remove),
    ]
}

fn harm(path: &Path, damage: &Damage) {
    let mut bytes = std::fs::read(path).unwrap();
    match damage {
        Damage::Truncate(at) => bytes.truncate(at.index(bytes.len())),
        Damage::Change(at, bits) => {
            let at = at.index(bytes.len());
            bytes[at] ^= bits;
        }
        Damage::Noise(noise) => bytes.clone_from(noise),
        Damage::Remove => return std::fs::remove_file(path).unwrap(),
    }
    std::fs::write(path, bytes).unwrap();
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(cases(150))]

    /// There is no such scene, so that nothing is rendered and all is refused, be the option good or not.
    #[test]
    fn any_option_of_sheet_and_report(
        sheet in any::<bool>(),
        option in select(OPTIONS),
        text in words(),
    ) {
        let given = format!("{}={text}", if sheet && option == "--frames" { "--frame" } else { option });
        let command: &[&str] =
            if sheet { &["sheet", "none.xml", "--out=s.png"] } else { &["report", "none.xml", "--out=r"] };
        let modes: &[&str] = if option == "--modes" { &[] } else { &["--modes=still"] };
        let frame: &[&str] = if sheet && option != "--frames" { &["--frame=0"] } else { &[] };
        prop_assert_eq!(status(&[command, modes, frame, &[&given]].concat()), 2);
    }

    #[test]
    fn any_option_of_compare(option in select(&["--metric", "--limit"][..]), text in words(), json in any::<bool>()) {
        let given = format!("{option}={text}");
        status(&[&["compare", "a.png", "b.exr", &given][..], if json { &["--json"] } else { &[] }].concat());
    }

    #[test]
    fn any_name_of_a_picture(name in words()) {
        // A name that starts with a dash is an option.
        status(&["compare", "a.png", "--", &name]);
    }

    #[test]
    fn damaged_pictures(exr in any::<bool>(), damage in damage(), first in any::<bool>()) {
        let dir = tempfile::tempdir().unwrap();
        let name = if exr { "b.exr" } else { "a.png" };
        let path = dir.path().join(name);
        std::fs::copy(fixture().join(name), &path).unwrap();
        harm(&path, &damage);
        let path = path.to_str().unwrap();
        let pair = if first { [path, "a.png"] } else { ["a.png", path] };
        status(&["compare", pair[0], pair[1], "--limit", "flip=0.5"]);
    }
}

proptest! {
    #![proptest_config(cases(40))]

    /// Crops and limits that pass the grammar meet a scene.
    #[test]
    fn crops_and_limits_of_a_scene(
        crop in prop::collection::vec(select(&[0_u64, 1, 5, 12, 16, 4_294_967_295, 4_294_967_296][..]), 4),
        limit in prop_oneof![(-1.0..1.0_f64).prop_map(|v| v.to_string()), words()],
        metric in select(&["flip", "psnr", "alpha-worst", "non-finite", "none"][..]),
    ) {
        let crop = format!("--crop={},{},{}x{}", crop[0], crop[1], crop[2], crop[3]);
        let out = tempfile::tempdir().unwrap();
        let folder = format!("--out={}", out.path().display());
        let sheet = format!("{folder}/s.png");
        status(&["sheet", "tiny.xml", "--frame=0", "--modes=still:1", &crop, &sheet, "--quiet"]);
        let limit = format!("--limit={metric}={limit}");
        let report =
            ["report", "tiny.xml", "--frames=0", "--modes=still:1", "--reference=16", "--repeats=1", "--quiet"];
        status(&[&report[..], &[&limit, &folder]].concat());
    }

    /// Damaged parts of the store are rendered again: the figures are those of the first run.
    // Not deep: the only test of damage to that store.
    #[test]
    fn a_damaged_store(which in any::<Index>(), damage in damage()) {
        let (finished, figures_of_first) = report();
        let dir = tempfile::tempdir().unwrap();
        copy(finished, dir.path());
        let mut files = Vec::new();
        for frame in ["0", "1"] {
            let folder = dir.path().join("renderings").join(frame);
            files.extend(std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()));
        }
        files.sort();
        prop_assert_eq!(files.len(), 2 * 2 * 3);
        harm(&files[which.index(files.len())], &damage);
        prop_assert_eq!(status(&[&REPORT[..], &[dir.path().to_str().unwrap()]].concat()), 0);
        prop_assert_eq!(&figures(dir.path()), figures_of_first);
    }
}

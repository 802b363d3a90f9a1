//! The package that `cargo publish` would send: small, and whole enough for its own tests.

use std::fs;
use std::process::Command;

use crate::sources;
use crate::text::{FOLDERS, root, walk};

/// Most bytes of its files: a third of that is packed, of which crates.io takes 10 MB.
const MOST: u64 = 5_950_000;

/// What someone who has the crate alone wants to find, and what the tests beside the code read.
const WANTED: [&str; 9] = [
    "CHANGELOG.md",
    "Cargo.lock",
    "LICENSE-APACHE",
    "LICENSE-MIT",
    "README.md",
    "docs/scene-format.md",
    "scenes/swarm.xml",
    "tests/data/anim/interpolation_modes.anim",
    "tests/support/gpu.rs",
];

/// Files that are for the repository alone, or large.
const UNWANTED: [&str; 6] = [".ci/", ".github/", "docs/images/", "docs/measurements/", "fuzz/", "tests/render/"];

/// The files of the package, by their paths below its root.
fn packed() -> Vec<String> {
    let list = ["package", "--list", "--allow-dirty", "--offline", "--quiet"];
    let output = Command::new(env!("CARGO")).args(list).current_dir(root()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let listed = String::from_utf8(output.stdout).unwrap();
    // Windows has other separators.
    listed.lines().map(|line| line.replace('\\', "/")).collect()
}

#[test]
fn the_package_is_small_and_whole() {
    let files = packed();
    for wanted in WANTED {
        assert!(files.iter().any(|file| file == wanted), "{wanted} is missing");
    }
    for unwanted in UNWANTED {
        assert!(!files.iter().any(|file| file.starts_with(unwanted)), "{unwanted} is in the package");
    }
    let cited = fs::read_to_string(root().join("CITATION.cff")).unwrap();
    assert!(
        cited.contains(concat!("\nversion: ", env!("CARGO_PKG_VERSION"), "\n")),
        "CITATION.cff has another version"
    );
    // What cargo adds by itself is in no folder of ours.
    let bytes: u64 = files.iter().filter_map(|file| root().join(file).metadata().ok()).map(|about| about.len()).sum();
    assert!(bytes <= MOST, "the files of the package have {bytes} bytes, expected at most {MOST}");
}

/// The path that a literal in `file` stands for, from the root: with `..` it begins at the file, as in `include_str!`,
/// else at the root, where tests run, also after `CARGO_MANIFEST_DIR`.
fn from_root(file: &str, literal: &str) -> String {
    let mut parts: Vec<&str> = Vec::new();
    if literal.starts_with("../") {
        parts.extend(file.split('/'));
        parts.pop();
    }
    for part in literal.split('/') {
        match part {
            "" | "." => {}
            ".." => _ = parts.pop(),
            part => parts.push(part),
        }
    }
    parts.join("/")
}

/// Is a path in the package, or a folder that is there with all of its files?
fn is_packed(path: &str, packed: &[String]) -> bool {
    let mut below = Vec::new();
    walk(&root().join(path), &mut below);
    let all = below.iter().all(|file| {
        let name = file.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
        packed.contains(&name)
    });
    packed.iter().any(|file| file == path) || (all && !below.is_empty())
}

/// Files of the repository that a file of `src` names in quotes, in its code, its tests or its examples, and that the
/// package lacks: a line each. A name that is put together (`scenes/{name}.xml`) is none that the package has.
fn unpacked(file: &str, text: &str, packed: &[String]) -> Vec<String> {
    let mut found = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        // What follows a closing quote is no path, so that it need not be told from an opening one.
        for literal in line.split('"').skip(1) {
            let path = from_root(file, literal);
            let first = path.split('/').next().unwrap_or("");
            // All of `src` is packed; much in it that looks like a path is a name that a test gave.
            // `out` holds what somebody rendered.
            let is_ours =
                (first != "src" && FOLDERS.contains(&first)) || (first != "out" && root().join(&path).is_file());
            if is_ours && !is_packed(&path, packed) {
                found.push(format!("{file}:{number}: {path}"));
            }
        }
    }
    found
}

/// Whoever has the package alone can run the tests beside the code and the examples of the documentation:
/// `tests/package` does.
#[test]
fn the_package_has_what_its_tests_open() {
    let packed = packed();
    let mut files = Vec::new();
    sources(&root().join("src"), &mut files);
    files.sort();
    let mut found = Vec::new();
    for file in files {
        let name = file.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
        found.extend(unpacked(&name, &fs::read_to_string(&file).unwrap(), &packed));
    }
    assert!(found.is_empty(), "named in src, and not in `include` of Cargo.toml:\n{}", found.join("\n"));
}

#[test]
fn files_that_the_package_lacks_are_seen() {
    let packed: Vec<String> = packed();
    for (line, path) in [
        (r#"/// let scene = Scene::open("scenes/spin.xml").load()?;"#, "scenes/spin.xml"),
        (r#"let scene = Scene::load(format!("scenes/{name}.xml"));"#, "scenes/{name}.xml"),
        (r#"let all = [include_str!("../../tests/data/scenes/everything.xml")];"#, "tests/data/scenes/everything.xml"),
        (r#"#[path = "../../tests/support/saved.rs"]"#, "tests/support/saved.rs"),
        (r#"fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/deny.toml"))"#, "deny.toml"),
        (r#"Path::new("scenes").join("models")"#, "scenes"),
        (r#"(&b"x"[..], root.join("fuzz/corpus/"))"#, "fuzz/corpus"),
    ] {
        assert_eq!(unpacked("src/image/a.rs", line, &packed), [format!("src/image/a.rs:1: {path}")], "{line}");
    }
    for line in [
        r#"Scene::open("scenes/swarm.xml")"#,
        r#"include_str!("../../LICENSE-MIT")"#,
        r#"concat!("../../shaders/", $file)"#,
        r#"include_str!("page.css")"#,
        r#"for name in ["../Cargo.toml", "x", "%2e%2e"] {"#,
        r#"dir.path().join("fence.ply")"#,
        "splatblur view scenes/three_objects.xml",
    ] {
        assert_eq!(unpacked("src/image/a.rs", line, &packed), Vec::<String>::new(), "{line}");
    }
}

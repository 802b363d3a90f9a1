//! The package that `cargo publish` would send: small, and whole enough for its own tests.

use std::path::Path;
use std::process::Command;

/// Most bytes of its files: a third of that is packed, of which crates.io takes 10 MB.
const MOST: u64 = 5_000_000;

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

#[test]
fn the_package_is_small_and_whole() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let list = ["package", "--list", "--allow-dirty", "--offline", "--quiet"];
    let output = Command::new(env!("CARGO")).args(list).current_dir(root).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let listed = String::from_utf8(output.stdout).unwrap();
    // Windows has other separators.
    let files: Vec<String> = listed.lines().map(|line| line.replace('\\', "/")).collect();
    for wanted in WANTED {
        assert!(files.iter().any(|file| file == wanted), "{wanted} is missing");
    }
    for unwanted in UNWANTED {
        assert!(!files.iter().any(|file| file.starts_with(unwanted)), "{unwanted} is in the package");
    }
    let cited = std::fs::read_to_string(root.join("CITATION.cff")).unwrap();
    assert!(
        cited.contains(concat!("\nversion: ", env!("CARGO_PKG_VERSION"), "\n")),
        "CITATION.cff has another version"
    );
    // What cargo adds by itself is in no folder of ours.
    let bytes: u64 = files.iter().filter_map(|file| root.join(file).metadata().ok()).map(|about| about.len()).sum();
    assert!(bytes <= MOST, "the files of the package have {bytes} bytes, expected at most {MOST}");
}

//! The package that `cargo publish` would send: small, and whole enough for its own tests.

use std::path::Path;
use std::process::Command;

/// Most bytes of the packed crate. crates.io takes 10 MB.
const MOST: u64 = 2_000_000;

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

/// What is for the repository alone, or large.
const UNWANTED: [&str; 6] = [".ci/", ".github/", "docs/images/", "docs/measurements/", "fuzz/", "tests/render/"];

fn package(target: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO"))
        .args(["package", "--allow-dirty", "--no-verify", "--offline", "--quiet", "--target-dir"])
        .arg(target)
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_package_is_small_and_whole() {
    let target = tempfile::tempdir().unwrap();
    let listed = package(target.path(), &["--list"]);
    // Windows has other separators.
    let files: Vec<String> = listed.lines().map(|line| line.replace('\\', "/")).collect();
    for wanted in WANTED {
        assert!(files.iter().any(|file| file == wanted), "{wanted} is missing");
    }
    for unwanted in UNWANTED {
        assert!(!files.iter().any(|file| file.starts_with(unwanted)), "{unwanted} is in the package");
    }
    package(target.path(), &[]);
    let packed = target.path().join(concat!("package/splatblur-", env!("CARGO_PKG_VERSION"), ".crate"));
    let bytes = packed.metadata().unwrap().len();
    assert!(bytes <= MOST, "the package has {bytes} bytes, expected at most {MOST}");
}

//! Tiers of the tests. What `tests/run --deep` alone runs says so: `#[ignore = "deep: ..."]`.

use std::fs;
use std::path::Path;

use crate::sources;

/// Reasons of tests that no tier runs.
const OTHERS: [&str; 2] = ["a measurement", "the other tests start it"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Names of the tests in a text, with the reasons why they are ignored.
fn tests(text: &str) -> Vec<(&str, Option<&str>)> {
    let mut found = Vec::new();
    for part in text.split("#[test]\n").skip(1) {
        let (attributes, rest) = part.split_once("fn ").unwrap_or((part, ""));
        let name = rest.split('(').next().unwrap_or("");
        let reason = attributes.split_once("#[ignore").map(|(_, rest)| rest.split('"').nth(1).unwrap_or(""));
        found.push((name, reason));
    }
    found
}

/// Does a test take long by what it does? Programs that are broken in tens of ways, whole pictures on both backends,
/// every picture in buffers of several sizes.
fn is_long(name: &str) -> bool {
    (name.starts_with("broken_") && name.ends_with("_are_noticed"))
        || name.contains("look_the_same")
        || name.starts_with("small_buffers_")
}

#[test]
fn long_tests_are_deep() {
    let mut files = Vec::new();
    for folder in ["src", "tests"] {
        sources(&root().join(folder), &mut files);
    }
    files.sort();
    let (mut found, mut deep) = (Vec::new(), 0);
    for file in files.iter().filter(|file| !file.ends_with("repository/tiers.rs")) {
        for (name, reason) in tests(&fs::read_to_string(file).unwrap()) {
            let is_deep = reason.is_some_and(|reason| reason.strip_prefix("deep: ").is_some_and(|why| !why.is_empty()));
            deep += usize::from(is_deep);
            if let Some(reason) = reason.filter(|reason| !is_deep && !OTHERS.contains(reason)) {
                found.push(format!("{}: {name}: `{reason}` does not begin with `deep: `", file.display()));
            }
            if is_long(name) && !is_deep {
                found.push(format!("{}: {name} is not deep", file.display()));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
    assert!(deep > 10, "{deep}");
}

/// The machine that judges a change runs what a reader is told, and all of it.
#[test]
fn the_integration_machine_runs_all_tiers() {
    let read = |name: &str| fs::read_to_string(root().join(name)).unwrap();
    assert!(read(".ci/run").contains("tests/run\" --deep"));
    assert!(read(".github/workflows/ci.yml").contains("tests/run --deep"));
    let [readme, run] = ["README.md", "tests/run"].map(read);
    for tier in ["--quick", "--deep"] {
        assert!(readme.contains(&format!("tests/run {tier}")), "README.md: {tier}");
        assert!(run.contains(&format!("tests/run {tier} ")), "tests/run: {tier}");
    }
}

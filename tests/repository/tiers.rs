//! Tiers of the tests. What `tests/run --deep` alone runs says so: `#[ignore = "deep: ..."]`.

use std::collections::BTreeSet;
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

/// Why tests are deep, as CONTRIBUTING.md lists it.
fn reasons(text: &str) -> BTreeSet<String> {
    let list = text.split_once("WHY is one of ").and_then(|(_, rest)| rest.split_once('.'));
    list.map_or("", |(list, _)| list).split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn long_tests_are_deep() {
    let mut files = Vec::new();
    for folder in ["src", "tests"] {
        sources(&root().join(folder), &mut files);
    }
    files.sort();
    let known = reasons(&fs::read_to_string(root().join("CONTRIBUTING.md")).unwrap());
    let (mut found, mut used) = (Vec::new(), BTreeSet::new());
    for file in files.iter().filter(|file| !file.ends_with("repository/tiers.rs")) {
        for (name, reason) in tests(&fs::read_to_string(file).unwrap()) {
            let why = reason.and_then(|reason| reason.strip_prefix("deep: "));
            let is_known = why.is_some_and(|why| known.contains(why));
            used.extend(why.map(str::to_owned));
            if let Some(reason) = reason.filter(|reason| !is_known && !OTHERS.contains(reason)) {
                found.push(format!("{}: {name}: `{reason}` is none of CONTRIBUTING.md's reasons", file.display()));
            }
            if is_long(name) && why.is_none() {
                found.push(format!("{}: {name} is not deep", file.display()));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
    assert_eq!(used, known, "CONTRIBUTING.md lists a reason that no test has");
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

//! The list of licences that `splatblur licences` shows: it holds the crates that the program is linked from.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Stands in the list without being a crate: letters inside one.
const FONT: &str = "Noto Sans Mono (font)";

/// Crates and versions of the list, and the crates under whose licences' texts stand.
fn listed() -> (BTreeSet<[String; 2]>, BTreeSet<String>) {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/cli/licences.txt")).unwrap();
    let mut parts = text.split("\n====\n");
    let rows = parts.next().unwrap().lines().filter(|row| !row.is_empty()).map(|row| {
        let words: Vec<&str> = row.split("  ").map(str::trim).filter(|word| !word.is_empty()).collect();
        let [name, version, _licence] = words[..] else { panic!("{row}") };
        [name.to_owned(), version.to_owned()]
    });
    let rows = rows.collect();
    let mut with_text = BTreeSet::new();
    for part in parts {
        let (head, body) = part.split_once('\n').unwrap();
        assert!(body.trim().len() > 400, "{head}: this is no text of a licence: {body}");
        let (_, crates) = head.split_once(": ").unwrap();
        with_text.extend(crates.split(", ").map(str::to_owned));
    }
    (rows, with_text)
}

/// What this computer would link. Other systems have crates more, which are in the lock file as well.
#[test]
fn every_crate_of_the_program_is_listed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let tree = "tree --locked --offline --edges normal,no-proc-macro --all-features --prefix none --format {p}";
    let output = Command::new(env!("CARGO")).args(tree.split(' ')).current_dir(root).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let (listed, with_text) = listed();
    let linked: BTreeSet<[String; 2]> = String::from_utf8(output.stdout)
        .unwrap()
        .lines()
        .filter_map(|line| line.split_once(" v"))
        .map(|(name, rest)| [name.to_owned(), rest.split(' ').next().unwrap().to_owned()])
        .filter(|[name, _]| name != "splatblur")
        .collect();
    assert!(linked.len() > 100, "{linked:?}");

    let lock = fs::read_to_string(root.join("Cargo.lock")).unwrap();
    let is_locked = |[name, version]: &[String; 2]| {
        name == FONT || lock.contains(&format!("name = \"{name}\"\nversion = \"{version}\"\n"))
    };
    let missing: Vec<_> = linked.difference(&listed).collect();
    let gone: Vec<_> = listed.iter().filter(|row| !is_locked(row)).collect();
    assert!(missing.is_empty() && gone.is_empty(), "run tests/licences: missing {missing:?}, gone {gone:?}");
    let without: Vec<_> = listed.iter().filter(|[name, _]| !with_text.contains(name)).collect();
    assert!(without.is_empty(), "no text for {without:?}");
}

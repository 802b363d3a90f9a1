//! One place opens files to read them (`src/files/`), so that none is forgotten: it refuses pipes, and sees changes.

use std::fs;
use std::path::Path;

use crate::sources;

use crate::source::{paths, tokens};

/// Ends of paths that open a file, or give its bytes.
const READS: [[&str; 2]; 6] = [
    ["File", "open"],
    ["fs", "read"],
    ["fs", "read_to_string"],
    ["fs", "copy"],
    ["image", "open"],
    ["ImageReader", "open"],
];

/// Crates and words that do it in their own way.
const WORDS: [&str; 4] = ["Mmap", "MmapOptions", "memmap2", "from_file"];

/// The faults of a file, a line each.
fn faults(name: &str, source: &str) -> Vec<String> {
    let tokens = tokens(source);
    let mut found = Vec::new();
    for path in paths(&tokens) {
        if let [.., a, b] = &path.path[..]
            && READS.iter().any(|read| read == &[a.as_str(), b.as_str()])
        {
            found.push(format!("{name}:{}: {a}::{b}", path.line));
        }
    }
    for (at, token) in tokens.iter().enumerate() {
        let follows =
            |words: &[&str]| words.iter().enumerate().all(|(i, w)| tokens.get(at + i).is_some_and(|t| t.text == *w));
        if WORDS.contains(&token.text.as_str()) || follows(&[".", "read", "(", "true", ")"]) {
            found.push(format!("{name}:{}: {}", token.line, token.text));
        }
    }
    found
}

#[test]
fn one_place_opens_input() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&src, &mut files);
    files.sort();
    let mut found = Vec::new();
    for file in files {
        let name = file.strip_prefix(&src).unwrap().to_string_lossy().replace('\\', "/");
        // Tests in files of their own.
        let is_test = name.ends_with("/tests.rs") || name.contains("/tests/");
        if !is_test && name != "files.rs" && !name.starts_with("files/") {
            found.extend(faults(&name, &fs::read_to_string(&file).unwrap()));
        }
    }
    assert!(found.is_empty(), "files::open and files::read open files:\n{}", found.join("\n"));
}

#[test]
fn all_ways_to_read_are_seen() {
    for line in [
        "fn a() { std::fs::read(p); }",
        "use std::fs::{self, read_to_string};",
        "fn a() { File::open(p) }",
        "use std::fs; fn a() { fs::copy(a, b) }",
        "fn a() { OpenOptions::new().read(true).open(p) }",
        "fn a() { image::open(p) }",
        "use image::ImageReader; fn a() { ImageReader::open(p) }",
        "use memmap2::Mmap;",
        "fn a() { exr::read().from_file(p) }",
    ] {
        assert!(!faults("a.rs", line).is_empty(), "{line}");
    }
    for line in ["#[cfg(test)] mod tests { fn a() { fs::read(p) } }", "fn a() { File::create(p); files::read(p) }"] {
        assert!(faults("a.rs", line).is_empty(), "{line}");
    }
}

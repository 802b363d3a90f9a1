//! Text: widths of lines, lengths of guides, words that must not be in the repository, and names of types.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Columns of a line of code.
const WIDTH: usize = 120;

/// Most words of a guide: about two pages. Bars and rules of tables do not count. Measurements (`docs/measurements/`)
/// are exempt.
const GUIDE: usize = 1150;

/// Documents in `docs/` that are manuals, which may be longer.
fn is_manual(name: &str) -> bool {
    name == "math.md" || name.ends_with("format.md")
}

/// Folders at the root whose files are ours; build folders are not among them.
pub(super) const FOLDERS: [&str; 12] = [
    ".ci",
    ".github",
    "animations",
    "benches",
    "docs",
    "examples",
    "fuzz",
    "python",
    "scenes",
    "shaders",
    "src",
    "tests",
];

pub(super) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All text files of the repository, by their path below its root.
fn files() -> Vec<(String, String)> {
    let mut paths: Vec<PathBuf> = fs::read_dir(root()).unwrap().map(|entry| entry.unwrap().path()).collect();
    // `.git` is a file in a second work tree.
    paths.retain(|path| path.is_file() && !path.ends_with(".git"));
    for folder in FOLDERS {
        walk(&root().join(folder), &mut paths);
    }
    paths.sort();
    let text = |path: PathBuf| {
        let name = path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
        // Whatever is no UTF-8 is no text.
        fs::read_to_string(path).ok().map(|text| (name, text))
    };
    paths.into_iter().filter_map(text).collect()
}

/// Adds the files below a folder.
pub(super) fn walk(folder: &Path, paths: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            // Build folders of the fuzz targets.
            if !path.ends_with("fuzz/target") && !path.ends_with("fuzz/artifacts") {
                walk(&path, paths);
            }
        } else {
            paths.push(path);
        }
    }
}

/// Fails with the lines that were found.
fn judge(found: &[String], what: &str) {
    assert!(found.is_empty(), "{what}:\n{}", found.join("\n"));
}

#[test]
fn lines_of_code_fit_their_width() {
    let mut found = Vec::new();
    for (name, text) in files() {
        if ["rs", "wgsl"].iter().any(|code| Path::new(&name).extension().is_some_and(|e| e == *code)) {
            for (number, line) in (1..).zip(text.lines()) {
                let columns = line.chars().count();
                if columns > WIDTH {
                    found.push(format!("{name}:{number}: {columns} columns"));
                }
            }
        }
    }
    judge(&found, "lines wider than 120 columns");
}

#[test]
fn guides_are_short() {
    let mut found = Vec::new();
    for (path, text) in files() {
        let Some(name) = path.strip_prefix("docs/").filter(|name| !name.contains('/') && name.contains(".md")) else {
            continue;
        };
        let words = text.split_whitespace().filter(|word| word.contains(|c| !"|-:".contains(c))).count();
        if words > GUIDE && !is_manual(name) {
            found.push(format!("{path}: {words} words"));
        }
    }
    judge(&found, "guides of more than 1150 words");
}

/// A reader has only what the repository holds: not the notes that it was planned with, and not the folders of the
/// computer on which it was written.
#[test]
fn nothing_outside_the_repository_is_cited() {
    // In two halves, so that this file does not contain them.
    let citations = [["design ", "section"], ["Design ", "section"], ["design's ", "section"], ["design ", "page"]];
    let citations: Vec<String> = citations.iter().map(|halves| halves.concat()).collect();
    let folders: Vec<String> = [["/ho", "me/"], ["/ro", "ot/"], ["/wo", "rk/"], ["/Us", "ers/"]]
        .iter()
        .map(|halves| halves.concat())
        .collect();
    let mut found = Vec::new();
    for (name, text) in files() {
        // Lists of what may be asked of a registry, not prose.
        if name.ends_with("Cargo.lock") {
            continue;
        }
        for (number, line) in (1..).zip(text.lines()) {
            let cited = citations.iter().find(|citation| line.contains(citation.as_str()));
            let folder = folders.iter().find(|folder| absolute(line, folder));
            if let Some(what) = cited.or(folder) {
                found.push(format!("{name}:{number}: `{what}`"));
            }
        }
    }
    judge(&found, "citations of what is not in the repository");
}

/// Files that are no text have headers, in which programs like to write where they ran.
#[test]
fn no_data_names_a_folder_of_the_computer_that_made_it() {
    let folders: Vec<Vec<u8>> = [["/ho", "me/"], ["/ro", "ot/"], ["/wo", "rk/"], ["/Us", "ers/"], ["/tm", "p/"]]
        .iter()
        .map(|halves| halves.concat().into_bytes())
        .collect();
    let mut paths = Vec::new();
    for folder in ["tests/data", "scenes", "animations", "docs/images"] {
        walk(&root().join(folder), &mut paths);
    }
    paths.sort();
    assert!(paths.len() > 50, "{}", paths.len());
    let mut found = Vec::new();
    for path in paths {
        let bytes = fs::read(&path).unwrap();
        let named = folders.iter().find(|folder| bytes.windows(folder.len()).any(|part| part == folder.as_slice()));
        // Text is judged above; what programs take as input may name any folder.
        if let Some(folder) = named.filter(|_| std::str::from_utf8(&bytes).is_err()) {
            found.push(format!("{}: `{}`", path.display(), String::from_utf8_lossy(folder)));
        }
    }
    judge(&found, "data files that name a folder of the computer that made them");
}

/// Does a path begin with this folder, and not merely contain it?
fn absolute(line: &str, folder: &str) -> bool {
    line.match_indices(folder).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        before.is_none_or(|c| !(c.is_alphanumeric() || "._-/*}~$)".contains(c)))
    })
}

/// A doc comment, or any comment of a shader, names its noun: these words open none.
const WITHOUT_A_NOUN: [&str; 4] = ["Of ", "That of ", "Those of ", "What is "];

#[test]
fn a_doc_comment_names_its_noun() {
    let mut found = Vec::new();
    for (name, text) in files() {
        let marks: &[&str] = match Path::new(&name).extension().and_then(|e| e.to_str()) {
            Some("rs") => &["///", "//!"],
            // WGSL has no doc comments.
            Some("wgsl") => &["//"],
            _ => continue,
        };
        let mut inside = false;
        for (line, number) in text.lines().zip(1..) {
            let comment = marks.iter().find_map(|mark| line.trim_start().strip_prefix(mark));
            let opens = comment.filter(|_| !inside).map_or("", str::trim_start);
            if WITHOUT_A_NOUN.iter().any(|words| opens.starts_with(words)) {
                found.push(format!("{name}:{number}: {opens}"));
            }
            inside = comment.is_some();
        }
    }
    judge(&found, "doc comments without a noun");
}

/// The name that a line declares with `pub`, if it declares a type.
fn public_type(line: &str) -> Option<&str> {
    let item = line.trim_start().strip_prefix("pub ")?;
    let name = ["struct ", "enum ", "trait ", "type "].into_iter().find_map(|word| item.strip_prefix(word))?;
    name.split(|c: char| !c.is_alphanumeric() && c != '_').next()
}

/// A name has one meaning: whoever looks for a public type finds one.
#[test]
fn a_public_type_has_a_name_of_its_own() {
    let mut declared: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let is_rust = |name: &str| Path::new(name).extension().is_some_and(|e| e == "rs");
    let is_product = |name: &str| name.starts_with("src/") && is_rust(name) && !name.contains("tests");
    for (name, text) in files().into_iter().filter(|(name, _)| is_product(name)) {
        for (line, number) in text.lines().zip(1..) {
            if let Some(found) = public_type(line) {
                declared.entry(found.to_owned()).or_default().push(format!("{name}:{number}"));
            }
        }
    }
    assert!(declared.len() > 200, "{} public types are not all", declared.len());
    let twice = declared.into_iter().filter(|(_, places)| places.len() > 1);
    let found: Vec<_> = twice.map(|(name, places)| format!("{name}: {}", places.join(", "))).collect();
    judge(&found, "names that several public types have");
}

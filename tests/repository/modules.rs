//! The order of modules, and the absence of import circles.
//!
//! `src/lib.rs` lists the top-level modules in the order in which data flows. What this test demands:
//!
//! 1. **Order.** A file imports only from top-level modules that `lib.rs` lists above its own.
//! 2. **No circles.** Draw an arrow from each file to each file that it imports from. There is no path along arrows
//!    from a file back to itself, anywhere in the crate.
//!
//! What counts as an import: every path through `crate::`, `super::`, `self::` or a child module, in a `use` as well as
//! in an expression or a type. The arrow leads to the file that *defines* the name: a `use` or `pub use` in between is
//! followed to its end. So a child that takes a name from its parent depends on the parent only where the parent's file
//! defines it.
//!
//! What does not count: the arrow from a module's file to files below it. `mod.rs` is the face of its folder: it
//! defines what the files of the folder share, and calls them. That is how Rust's modules are meant, and no circle that
//! one would break.
//!
//! Exempt are code under `#[cfg(test)]`, and from the order the command line (`src/cli`), which stands above
//! everything.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use crate::source::{self, Written};

/// A module: `["backend", "cpu"]` is `crate::backend::cpu`.
type Name = Vec<String>;

struct Module {
    file: String,
    children: Vec<String>,
    paths: Vec<Written>,
}

/// Which file defines what.
struct Crate {
    modules: BTreeMap<Name, Module>,
}

/// One import: from a file to another, at a line; `written` is the path as it stands there, from the crate's root.
struct Import {
    from: Name,
    line: usize,
    written: Name,
    to: Name,
}

fn src() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

impl Crate {
    fn read() -> Self {
        let mut read = Self { modules: BTreeMap::new() };
        read.add(&[], "lib.rs", Path::new(""));
        // The program's own crate declares the command line, unless the library does.
        if !read.modules.contains_key(&vec!["cli".to_owned()]) {
            read.add(&["cli".into()], "cli/mod.rs", Path::new("cli"));
        }
        read
    }

    /// Reads a module's file, and its children, which lie in `folder`.
    fn add(&mut self, name: &[String], file: &str, folder: &Path) {
        let text = fs::read_to_string(src().join(file)).unwrap_or_else(|why| panic!("src/{file}: {why}"));
        let tokens = source::tokens(&text);
        let children = source::modules(&tokens);
        self.modules.insert(
            name.to_vec(),
            Module { file: file.into(), children: children.clone(), paths: source::paths(&tokens) },
        );
        for child in children {
            let (below, own) = (folder.join(&child), folder.join(format!("{child}.rs")));
            let file = if src().join(&own).exists() { own } else { below.join("mod.rs") };
            let name = [name, &[child]].concat();
            self.add(&name, &file.to_string_lossy(), &below);
        }
    }

    /// What a path of module `at` means from the crate's root; none where it leads to another crate.
    fn absolute(&self, at: &Name, path: &[String]) -> Option<Name> {
        let (first, rest) = path.split_first()?;
        let mut base = match first.as_str() {
            "crate" | "splatblur" => Vec::new(),
            "self" => at.clone(),
            "super" => at[..at.len().checked_sub(1)?].to_vec(),
            child if self.modules[at].children.iter().any(|c| c == child) => [at.clone(), vec![child.into()]].concat(),
            _ => return None,
        };
        for word in rest {
            if word == "super" {
                base.pop()?;
            } else {
                base.push(word.clone());
            }
        }
        Some(base)
    }

    /// The module that defines what a path from the root names: re-exports are followed.
    fn home(&self, path: &Name) -> Name {
        let mut path = path.clone();
        // As many steps as any sane chain of re-exports has.
        for _ in 0..16 {
            let depth = (0..=path.len()).rev().find(|&n| self.modules.contains_key(&path[..n])).unwrap_or(0);
            let module = path[..depth].to_vec();
            let Some(item) = path.get(depth) else { return module };
            let named = self.modules[&module].paths.iter().find(|w| w.name.as_ref() == Some(item));
            match named.and_then(|w| self.absolute(&module, &w.path)) {
                Some(target) => path = [&target[..], &path[depth + 1..]].concat(),
                None => return module,
            }
        }
        panic!("re-exports in a circle: {}", path.join("::"))
    }

    fn imports(&self) -> Vec<Import> {
        let mut imports = Vec::new();
        for (from, module) in &self.modules {
            for written in &module.paths {
                let Some(path) = self.absolute(from, &written.path) else { continue };
                let to = self.home(&path);
                // Includes the file itself.
                let below = to.starts_with(from);
                if !below {
                    imports.push(Import { from: from.clone(), line: written.line, written: path, to });
                }
            }
        }
        imports
    }

    fn file(&self, module: &Name) -> &str {
        &self.modules[module].file
    }
}

#[test]
fn files_import_only_from_modules_above_their_own() {
    let read = Crate::read();
    let order = &read.modules[&Vec::new()].children;
    let place = |name: &Name| order.iter().position(|module| Some(module) == name.first());
    let mut found = BTreeMap::new();
    for import in read.imports() {
        // A name may be taken from a module that only passes it on: both that one and the one that defines it are held
        // against the order. The command line is not listed, so it has no place.
        for to in [&import.written, &import.to] {
            let (Some(own), Some(other)) = (place(&import.from), place(to)) else { continue };
            if other > own {
                found.entry((read.file(&import.from).to_owned(), to[0].clone())).or_insert(import.line);
            }
        }
    }
    let lines = found.iter().map(|((file, module), line)| {
        format!("src/{file}:{line}: imports from `{module}`, which src/lib.rs lists below `{}`\n", own(file))
    });
    assert!(found.is_empty(), "imports against the order of src/lib.rs:\n{}", lines.collect::<String>());
}

/// The top-level module of a file below `src`.
fn own(file: &str) -> &str {
    file.split(['/', '.']).next().unwrap_or(file)
}

#[test]
fn no_file_imports_from_itself_in_a_circle() {
    let read = Crate::read();
    let imports = read.imports();
    let mut arrows: BTreeMap<&str, BTreeMap<&str, usize>> = BTreeMap::new();
    for import in &imports {
        let (from, to) = (read.file(&import.from), read.file(&import.to));
        arrows.entry(from).or_default().entry(to).or_insert(import.line);
    }
    let mut found = String::new();
    let mut told: BTreeSet<BTreeSet<&str>> = BTreeSet::new();
    for from in arrows.keys() {
        let Some(circle) = circle(&arrows, from) else { continue };
        if told.insert(circle.iter().copied().collect()) {
            let steps = circle.iter().zip(circle.iter().cycle().skip(1));
            let steps: Vec<String> = steps.map(|(a, b)| format!("  src/{a}:{} imports {b}", arrows[a][b])).collect();
            let _ = writeln!(found, "circle:\n{}", steps.join("\n"));
        }
    }
    assert!(found.is_empty(), "files that import from themselves through others:\n{found}");
}

/// The shortest circle through a file.
fn circle<'a>(arrows: &BTreeMap<&'a str, BTreeMap<&'a str, usize>>, from: &'a str) -> Option<Vec<&'a str>> {
    let paths = arrows[from].keys().filter_map(|next| path(arrows, next, from));
    paths.min_by_key(Vec::len).map(|path| [&[from], &path[..path.len() - 1]].concat())
}

/// The shortest path along arrows, with both ends.
fn path<'a>(arrows: &BTreeMap<&'a str, BTreeMap<&'a str, usize>>, from: &'a str, to: &'a str) -> Option<Vec<&'a str>> {
    let mut before: BTreeMap<&str, &str> = BTreeMap::new();
    let mut queue = std::collections::VecDeque::from([from]);
    while let Some(file) = queue.pop_front() {
        if file == to {
            let mut path = vec![to];
            while path[path.len() - 1] != from {
                path.push(before[path[path.len() - 1]]);
            }
            path.reverse();
            return Some(path);
        }
        for &next in arrows.get(file).into_iter().flat_map(BTreeMap::keys) {
            if next != from && !before.contains_key(next) {
                before.insert(next, file);
                queue.push_back(next);
            }
        }
    }
    None
}

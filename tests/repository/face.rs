//! The library's face: the names at the root of the crate, and that nothing in it has a type without a name.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The names that `src/lib.rs` re-exports at the root. A new name here is a promise to users of the library: add one
/// only on purpose. Types that few programs name stand in `fields`.
const NAMES: [&str; 61] = [
    // What is rendered.
    "Anchor",
    "AnimationBinding",
    "Bounds",
    "Camera",
    "Capture",
    "Direction",
    "Environment",
    "FrameNumber",
    "FrameRange",
    "GaussianModel",
    "Gaussians",
    "ImageSettings",
    "LatLong",
    "Light",
    "Material",
    "Motion",
    "Object",
    "Opening",
    "Optics",
    "PointMotion",
    "Readout",
    "Scene",
    "Shape",
    "Shutter",
    "Source",
    "Sphere",
    "Surface",
    "SurfelModel",
    "Surfels",
    "SurfelsBuilder",
    "Transform",
    "VelocityUnit",
    "Weight",
    "glam",
    // How, and on what.
    "Aov",
    "BlurMode",
    "Detail",
    "Device",
    "Done",
    "ErrorTarget",
    "Interleave",
    "Lattice",
    "Look",
    "PixelFilter",
    "Prefilter",
    "Progress",
    "Quality",
    "RenderOptions",
    "Renderer",
    "Shading",
    "Stop",
    "SweptKernel",
    // What comes out.
    "Layer",
    "Picture",
    "Rendered",
    "Stats",
    // What may go wrong.
    "BackendError",
    "ImageError",
    "Invalid",
    "ModelError",
    "SceneError",
];

/// The modules that users of the library see.
const MODULES: [&str; 3] = ["compare", "reference", "study"];

/// Types of the standard library, of glam and of other crates that signatures may have.
const FOREIGN: [&str; 45] = [
    "Arc",
    "AsRef",
    "BTreeMap",
    "Box",
    "Cow",
    "DMat3",
    "DMat4",
    "DQuat",
    "DVec2",
    "DVec3",
    "DVec4",
    "Default",
    "Display",
    "Duration",
    "EncodingError",
    "Error",
    "ExactSizeIterator",
    "Fn",
    "FnMut",
    "Instant",
    "Into",
    "IntoIter",
    "IntoIterator",
    "Item",
    "Iterator",
    "Mat4",
    "Mutex",
    "OnceLock",
    "Option",
    "Path",
    "PathBuf",
    "Quat",
    "Range",
    "RangeInclusive",
    "Result",
    "Self",
    "Send",
    "String",
    "Sync",
    "Value",
    "Vec",
    "Vec2",
    "Vec3",
    "Vec4",
    "Write",
];

/// The text of a source file, without lines of comments.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let code: Vec<&str> = text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    code.join("\n") + "\n"
}

fn source(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(path)
}

/// `src/lib.rs` without its module `fields`, and the inside of that module.
fn root() -> (String, String) {
    let text = code(&source("lib.rs"));
    let (before, rest) = text.split_once("pub mod fields {").unwrap();
    let (fields, after) = rest.split_once("\n}\n").unwrap();
    (format!("{before}{after}"), fields.to_owned())
}

/// The names of all `pub use` of a text, each with the first module of its path and the name that it has there.
fn exports(code: &str) -> BTreeMap<String, (String, String)> {
    let mut names = BTreeMap::new();
    for item in code.split("pub use ").skip(1) {
        let (item, _) = item.split_once(';').unwrap();
        let (path, list) = item.split_once('{').unwrap_or((item, item));
        let path = path.trim_start_matches("crate::").trim_start_matches("self::");
        let module = path.split("::").next().unwrap().to_owned();
        for name in list.trim_end_matches('}').split(',').map(str::trim).filter(|name| !name.is_empty()) {
            let (own, shown) = name.rsplit_once(" as ").unwrap_or((name, name));
            let last = |name: &str| name.rsplit("::").next().unwrap().trim().to_owned();
            names.insert(last(shown), (module.clone(), last(own)));
        }
    }
    names
}

#[test]
fn the_root_exports_what_is_listed() {
    let listed: BTreeSet<String> = NAMES.iter().map(|&name| name.to_owned()).collect();
    let found: BTreeSet<String> = exports(&root().0).into_keys().collect();
    let new: Vec<_> = found.difference(&listed).collect();
    let gone: Vec<_> = listed.difference(&found).collect();
    assert!(new.is_empty() && gone.is_empty(), "names at the root of the crate: new {new:?}, gone {gone:?}");
}

#[test]
fn the_documentation_has_the_modules_that_are_listed() {
    let text = fs::read_to_string(source("lib.rs")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let shown = lines.windows(2).filter(|pair| pair[0] != "#[doc(hidden)]");
    let shown: Vec<_> = shown.filter_map(|pair| pair[1].strip_prefix("pub mod ")?.strip_suffix(';')).collect();
    assert_eq!(shown.into_iter().collect::<BTreeSet<_>>(), BTreeSet::from(MODULES));
}

/// The source files of a module of the root.
fn files(module: &str) -> Vec<PathBuf> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, found);
            } else if path.extension().is_some_and(|ext| ext == "rs") && path.file_stem().is_some_and(|s| s != "tests")
            {
                found.push(path);
            }
        }
    }
    let alone = source(&format!("{module}.rs"));
    let mut found: Vec<PathBuf> = alone.exists().then_some(alone).into_iter().collect();
    walk(&source(module), &mut found);
    found
}

/// The types that users can name, each with the modules of the root that have one of this name.
fn named() -> BTreeMap<String, BTreeSet<String>> {
    let (root, fields) = root();
    let mut named: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut add = |own: String, module: &str| named.entry(own).or_default().insert(module.to_owned());
    for (module, own) in exports(&root).into_values().chain(exports(&fields).into_values()) {
        add(own, &module);
    }
    for module in MODULES {
        let face = code(&source(module).join("mod.rs"));
        let inner = face.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
        let mut texts = vec![face.clone()];
        for name in inner {
            let (alone, folder) = (source(module).join(format!("{name}.rs")), source(module).join(name).join("mod.rs"));
            texts.push(code(if alone.exists() { &alone } else { &folder }));
        }
        for text in texts {
            for (_, own) in exports(&text).into_values() {
                add(own, module);
            }
            let own =
                text.lines().filter_map(|line| line.strip_prefix("pub struct ").or(line.strip_prefix("pub enum ")));
            for line in own {
                add(words(line)[0].to_owned(), module);
            }
        }
    }
    named
}

/// The words of a text outside quotes.
fn words(text: &str) -> Vec<&str> {
    let outside = text.split('"').step_by(2);
    outside.flat_map(|part| part.split(|c: char| !c.is_alphanumeric() && c != '_')).filter(|w| !w.is_empty()).collect()
}

/// The words that may be types: in camel case, and longer than a type parameter.
fn types(text: &str) -> impl Iterator<Item = &str> {
    let is_type = |word: &&str| word.starts_with(char::is_uppercase) && word.contains(char::is_lowercase);
    words(text).into_iter().filter(is_type)
}

/// What of an item users see: fields and signatures of functions that are public, variants with their fields, and what
/// an alias stands for. `lines` begin with the item's first.
fn seen(item: &str, lines: &[&str]) -> Vec<String> {
    let head = lines[0];
    if head.ends_with(';') {
        let public = head.contains('=') || head.contains("(pub ");
        return public.then(|| head.replacen(item, "", 1)).into_iter().collect();
    }
    let body = lines.iter().skip(1).take_while(|line| **line != "}");
    let (mut found, mut hidden, mut attribute, mut function) = (Vec::new(), false, false, String::new());
    for line in body {
        let text = line.trim();
        if attribute || text.starts_with("#[") {
            attribute = !text.ends_with(']');
            hidden |= text == "#[doc(hidden)]";
            continue;
        }
        if !function.is_empty() || line.starts_with("    pub fn ") || line.starts_with("    pub const fn ") {
            function.push_str(text);
            function.push(' ');
            if text.ends_with('{') || text.ends_with("{}") || text.contains(" { ") {
                let signature = std::mem::take(&mut function);
                found.extend((!hidden).then_some(signature));
                hidden = false;
            }
            continue;
        }
        if head.starts_with("pub enum") {
            // The name of a variant is no type.
            let inner = line.starts_with("     ") || text.starts_with('}');
            let at = if inner { 0 } else { text.find(['(', '{', ',']).unwrap_or(text.len()) };
            found.push(text[at..].to_owned());
        } else if head.starts_with("pub struct") && line.starts_with("    pub ") && !hidden {
            found.push(text.to_owned());
        }
        hidden = false;
    }
    found
}

/// Whoever sees a value can name its type.
#[test]
fn every_type_of_the_face_has_a_name() {
    let named = named();
    let mut nameless = Vec::new();
    let mut looked_at = 0;
    for module in named.values().flatten().collect::<BTreeSet<_>>() {
        for text in files(module).iter().map(|path| code(path)) {
            let lines: Vec<&str> = text.lines().collect();
            for (at, line) in lines.iter().enumerate() {
                let declares = ["pub struct ", "pub enum ", "pub type "].iter().any(|word| line.starts_with(word));
                let is_impl = line.starts_with("impl") && !line.contains(" for ") && line.ends_with('{');
                let Some(item) = types(line).next().filter(|_| declares || is_impl) else { continue };
                if !named.get(item).is_some_and(|modules| modules.contains(module)) {
                    continue;
                }
                for part in seen(item, &lines[at..]) {
                    looked_at += 1;
                    for name in types(&part).filter(|name| !named.contains_key(*name) && !FOREIGN.contains(name)) {
                        nameless.push(format!("{name}, in {module}::{item}: {part}"));
                    }
                }
            }
        }
    }
    assert!(looked_at > 500, "{looked_at} fields and functions are not the whole face");
    assert!(nameless.is_empty(), "types that users cannot name:\n{}", nameless.join("\n"));
}

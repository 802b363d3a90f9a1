//! The library's face: the names at the root of the crate.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// The names that `src/lib.rs` re-exports at the root. A new name here is a promise to users of the library: add one
/// only on purpose.
const NAMES: [&str; 45] = [
    // What is rendered.
    "Anchor",
    "Camera",
    "Cloud",
    "Direction",
    "Environment",
    "FrameNumber",
    "FrameRange",
    "ImageSettings",
    "LatLong",
    "Light",
    "Material",
    "Model",
    "Motion",
    "Object",
    "PointMotion",
    "Readout",
    "Scene",
    "Shutter",
    "Surfels",
    "Transform",
    "VelocityUnit",
    "Weight",
    "glam",
    // How, and on what.
    "Aov",
    "BlurMode",
    "Device",
    "ErrorTarget",
    "Interleave",
    "Lattice",
    "PixelFilter",
    "Prefilter",
    "Quality",
    "RenderOptions",
    "Renderer",
    "Shading",
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

/// The names of all `pub use` of a file; all of them stand at its root.
fn exported(text: &str) -> BTreeSet<String> {
    let code: Vec<&str> = text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    let code = code.join("\n");
    let mut names = BTreeSet::new();
    for item in code.split("pub use ").skip(1) {
        let (item, _) = item.split_once(';').unwrap();
        let list = item.split_once('{').map_or(item, |(_, list)| list.trim_end_matches('}'));
        for name in list.split(',').map(str::trim).filter(|name| !name.is_empty()) {
            let name = name.rsplit_once(" as ").map_or(name, |(_, name)| name);
            names.insert(name.rsplit("::").next().unwrap().trim().to_owned());
        }
    }
    names
}

#[test]
fn the_root_exports_what_is_listed() {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")).unwrap();
    let listed: BTreeSet<String> = NAMES.iter().map(|&name| name.to_owned()).collect();
    let found = exported(&text);
    let new: Vec<_> = found.difference(&listed).collect();
    let gone: Vec<_> = listed.difference(&found).collect();
    assert!(new.is_empty() && gone.is_empty(), "names at the root of the crate: new {new:?}, gone {gone:?}");
}

#[test]
fn every_module_of_the_root_is_hidden_from_the_documentation() {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    for pair in lines.windows(2) {
        assert!(!pair[1].starts_with("pub mod ") || pair[0] == "#[doc(hidden)]", "{}", pair[1]);
    }
}

//! The pairs of pictures in tests/data/compare.

use std::path::{Path, PathBuf};

use splatblur::film::Picture;
use splatblur::image;

/// A file of tests/data/compare.
pub fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/compare").join(name)
}

/// Names of the pairs, and the extension of their files.
pub const PAIRS: [(&str, &str); 4] = [("render", "png"), ("patches", "png"), ("stripes", "png"), ("linear", "exr")];

/// Both pictures of a pair.
pub fn pair((name, extension): (&str, &str)) -> [Picture; 2] {
    ["a", "b"]
        .map(|side| image::read(&data(&format!("{name}_{side}.{extension}"))).expect("a picture of tests/data/compare"))
}

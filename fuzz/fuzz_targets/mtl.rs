#![no_main]
//! Any bytes as the material library of an OBJ: read or refused, never a panic. Libraries are read from files only, so
//! through one.

use std::fs;
use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;
use splatblur::model::{ModelFormat, mesh};

/// It uses a name with blanks and one without.
const OBJ: &[u8] = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b c\nf 1 2 3\n";

static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();

fuzz_target!(|bytes: &[u8]| {
    let folder = FOLDER.get_or_init(|| tempfile::tempdir().expect("a folder"));
    if fs::write(folder.path().join("m.mtl"), bytes).is_ok() {
        let _ = mesh::read(OBJ, ModelFormat::Obj, &folder.path().join("m.obj"), None);
    }
});

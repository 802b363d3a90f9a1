#![no_main]
//! Any bytes as an OBJ with faces: read or refused, never a panic.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use splatblur::model::{Format, mesh};

fuzz_target!(|bytes: &[u8]| {
    let _ = mesh::read(bytes, Format::Obj, Path::new("nowhere/file.obj"), None);
});

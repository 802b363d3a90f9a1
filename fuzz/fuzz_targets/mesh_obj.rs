#![no_main]
//! Any bytes as an OBJ with faces: read and sampled, or refused, never a panic.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use splatblur::model::{LoadOptions, MeshOptions, ModelFormat, Spacing, mesh, sample_mesh};

fuzz_target!(|bytes: &[u8]| {
    let path = Path::new("nowhere/file.obj");
    let sampling = MeshOptions { spacing: Spacing::Surfels(100), reduce: true };
    let options = LoadOptions { mesh: sampling, ..LoadOptions::default() };
    if let Ok(Some(mesh)) = mesh::read(bytes, ModelFormat::Obj, path, None) {
        let _ = sample_mesh(mesh, &options, path, &|_, _| {});
    }
});

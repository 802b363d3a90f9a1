#![no_main]
//! Any bytes as a model file: read or refused, never a panic. A mesh is sampled, too.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use splatblur::model::{LoadOptions, MeshOptions, ModelFormat, Spacing, parse, parse_mesh, sample_mesh};

fuzz_target!(|bytes: &[u8]| {
    let _ = parse(bytes, ModelFormat::Ply);
    let sampling = MeshOptions { spacing: Spacing::Surfels(100), reduce: true };
    let options = LoadOptions { mesh: sampling, ..LoadOptions::default() };
    if let Ok(Some(mesh)) = parse_mesh(bytes, ModelFormat::Ply) {
        let _ = sample_mesh(mesh, &options, Path::new("nowhere/file.ply"), &|_, _| {});
    }
});

#![no_main]
//! Any bytes as a glTF file with triangles and animations: read and sampled, or refused, never a panic.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use splatblur::anim::GltfAnimation;
use splatblur::model::{LoadOptions, MeshOptions, ModelFormat, Spacing, mesh, sample_mesh};

fuzz_target!(|bytes: &[u8]| {
    // A path in a folder that is not there: no other file is read.
    let path = Path::new("nowhere/file.glb");
    let sampling = MeshOptions { spacing: Spacing::Surfels(100), reduce: true };
    let options = LoadOptions { mesh: sampling, ..LoadOptions::default() };
    for node in [None, Some("#0")] {
        if let Ok(Some(mesh)) = mesh::read(bytes, ModelFormat::Glb, path, node) {
            let _ = sample_mesh(mesh, &options, path, &|_, _| {});
        }
    }
    if let Ok(animation) = GltfAnimation::parse(bytes, path)
        && let Ok(chain) = animation.bind(None, 24.0, true)
    {
        let _ = (chain.at(0.3), chain.breaks(-1.0, 1.0));
    }
});

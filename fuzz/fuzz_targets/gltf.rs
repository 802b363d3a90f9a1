#![no_main]
//! Any bytes as a glTF file with triangles and animations: read or refused, never a panic.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use splatblur::anim::GltfAnimation;
use splatblur::model::{Format, mesh};

fuzz_target!(|bytes: &[u8]| {
    // A path in a folder that is not there: no other file is read.
    let path = Path::new("nowhere/file.glb");
    let _ = mesh::read(bytes, Format::Glb, path, None);
    let _ = mesh::read(bytes, Format::Glb, path, Some("#0"));
    if let Ok(animation) = GltfAnimation::parse(bytes, path)
        && let Ok(chain) = animation.bind(None, 24.0, true)
    {
        let _ = (chain.at(0.3), chain.breaks(-1.0, 1.0));
    }
});

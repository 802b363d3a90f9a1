#![no_main]
//! Any bytes as a PNG or EXR picture: read or refused, never a panic. Pictures are read from files only, so through
//! one.

use std::io::Write as _;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(mut file) = tempfile::NamedTempFile::new() else { return };
    if file.write_all(bytes).is_ok() {
        let _ = splatblur::image::read(file.path());
    }
});

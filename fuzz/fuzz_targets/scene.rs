#![no_main]
//! Any bytes as a scene file, strict and lenient, without the files that it names: valid or refused, never a panic.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use splatblur::scene_file::validate;

fuzz_target!(|bytes: &[u8]| {
    for lenient in [false, true] {
        let _ = validate(Path::new("fuzz.xml"), bytes, lenient);
    }
});

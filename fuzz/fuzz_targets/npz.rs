#![no_main]
//! Any bytes as a model file: read or refused, never a panic.

use libfuzzer_sys::fuzz_target;
use splatblur::model::{ModelFormat, parse};

fuzz_target!(|bytes: &[u8]| {
    let _ = parse(bytes, ModelFormat::Npz);
});

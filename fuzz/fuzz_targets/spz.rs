#![no_main]
//! Any bytes as a capture: read or refused, never a panic.

use libfuzzer_sys::fuzz_target;
use splatblur::model::{Format, parse};

fuzz_target!(|bytes: &[u8]| {
    let _ = parse(bytes, Format::Spz);
});

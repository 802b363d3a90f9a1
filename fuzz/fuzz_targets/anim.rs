#![no_main]
//! Any bytes as a `.anim` file: read or refused, never a panic; what is read can be evaluated anywhere.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use splatblur::anim::{Interpolation, parse};

fuzz_target!(|bytes: &[u8]| {
    let Ok(animation) = parse(bytes, Path::new("fuzz.anim")) else { return };
    for node in &animation.nodes {
        for seconds in [-1e8, -1.0, 0.0, 0.51, 1e8] {
            for interpolation in [Interpolation::Maya, Interpolation::Linear, Interpolation::Spline] {
                let _ = node.at(seconds, interpolation);
            }
        }
        let _ = node.breaks(-1.0, 1.0, Interpolation::Maya);
    }
});

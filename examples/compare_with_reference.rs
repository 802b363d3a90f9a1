//! How far a picture is from the ray-traced reference: `cargo run --release --example compare_with_reference`.

use std::error::Error;

use splatblur::compare::{Metric, compare};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::{BlurMode, Device, RenderOptions, Renderer, Scene};

/// FLIP and PSNR of a frame in a blur mode, against a reference of the same look.
pub(crate) fn error_of(mode: &str, samples: u64, width: u32, height: u32) -> Result<[f64; 2], Box<dyn Error>> {
    let scene = Scene::open("scenes/blinker_fence.xml").size(width, height).load()?;
    let options = RenderOptions { quality: mode.parse::<BlurMode>()?.into(), ..RenderOptions::default() };
    let picture = Renderer::open(Device::Auto)?.render(&scene, 4, &options)?.picture;
    let truth = reference::picture(&scene, 4, &ReferenceOptions::like(&options, samples))?;
    Ok(compare(&picture, &truth, &[Metric::Flip, Metric::Psnr])?)
}

#[allow(clippy::print_stdout, dead_code, reason = "the example says what it does; a test calls the function above")]
fn main() -> Result<(), Box<dyn Error>> {
    for mode in ["supersample:2", "supersample:16"] {
        let [flip, psnr] = error_of(mode, 256, 320, 180)?;
        println!("{mode}: FLIP {flip:.4}, PSNR {psnr:.1} dB");
    }
    Ok(())
}

//! A frame of a scene file as an array of 8-bit colours: `cargo run --release --example frame_to_array`.

use std::error::Error;

use splatblur::{Device, Picture, RenderOptions, Renderer, Scene};

/// Frame 4, with linear colours, and the same as 8-bit sRGB; both row by row from the top.
pub(crate) fn frame(width: u32, height: u32) -> Result<(Picture, Vec<u8>), Box<dyn Error>> {
    let scene = Scene::open("scenes/blinker_fence.xml").size(width, height).load()?;
    let mut renderer = Renderer::open(Device::Auto)?;
    let picture = renderer.render(&scene, 4, &RenderOptions::default())?.picture;
    let bytes = picture.to_srgb8()?;
    Ok((picture, bytes))
}

#[allow(clippy::print_stdout, dead_code, reason = "the example says what it does; a test calls the function above")]
fn main() -> Result<(), Box<dyn Error>> {
    let (picture, bytes) = frame(640, 360)?;
    let linear: &[[f32; 4]] = &picture.rgba;
    println!("{} pixels, {} bytes; the first is {:?}, or {:?}", linear.len(), bytes.len(), linear[0], &bytes[..4]);
    Ok(())
}

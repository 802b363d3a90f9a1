//! A scene file to a picture: `cargo run --release --example minimal -- scenes/crossing.xml 12 out/crossing.png`.

#![allow(clippy::print_stdout, reason = "the example says what it does")]

use std::error::Error;

use splatblur::{Device, RenderOptions, Renderer, Scene};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, frame, picture] = arguments.as_slice() else {
        return Err("expected a scene file, a frame number and a picture to write".into());
    };
    let scene = Scene::load(scene)?;
    let mut renderer = Renderer::open(Device::Auto)?;
    println!("{}, frame {frame}, on {}", scene.name, renderer.describe());
    let rendered = renderer.render(&scene, frame.parse::<f64>()?, &RenderOptions::default())?;
    rendered.picture.write(picture)?;
    Ok(())
}

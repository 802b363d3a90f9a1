//! An object and a camera that go through poses of a program: `cargo run --release --example poses_from_arrays`.

use std::error::Error;

use splatblur::glam::{DMat4, DVec3};
use splatblur::{AnimationBinding, Device, Object, RenderOptions, Renderer, Scene, Surfels};

/// Frames 0 to `last` of a plate that turns, seen by a camera that backs away; the share of each that it covers.
pub(crate) fn coverage(last: u8, width: u32, height: u32) -> Result<Vec<f32>, Box<dyn Error>> {
    let frames: Vec<f64> = (0..=last).map(f64::from).collect();
    let turned: Vec<DMat4> = frames.iter().map(|f| DMat4::from_rotation_z(0.1 * f)).collect();
    let backing: Vec<DMat4> = frames.iter().map(|f| DMat4::from_translation(DVec3::Z * (4.0 + 0.2 * f))).collect();

    let plate = (0..400).map(|i| DVec3::new(f64::from(i % 20) - 9.5, f64::from(i / 20) - 9.5, 0.0) * 0.1);
    let (surfels, _) = Surfels::builder(plate).normals(vec![splatblur::glam::Vec3::Z; 400]).build()?;
    let mut scene = Scene::new([Object::new(surfels)]);
    (scene.image.width, scene.image.height, scene.image.transparent) = (width, height, true);
    scene.objects[0].animation = Some(AnimationBinding::from_poses(scene.frames.rate, &frames, &turned)?);
    scene.camera.animation = Some(AnimationBinding::from_poses(scene.frames.rate, &frames, &backing)?);

    let mut renderer = Renderer::open(Device::Auto)?;
    let mut shares = Vec::new();
    for rendered in renderer.render_sequence(&scene, frames, &RenderOptions::default()) {
        let picture = rendered?.1.picture;
        shares.push(picture.rgba.iter().map(|pixel| pixel[3]).sum::<f32>() / picture.rgba.len() as f32);
    }
    Ok(shares)
}

#[allow(clippy::print_stdout, dead_code, reason = "the example says what it does; a test calls the function above")]
fn main() -> Result<(), Box<dyn Error>> {
    println!("{:.3?}", coverage(10, 320, 240)?);
    Ok(())
}

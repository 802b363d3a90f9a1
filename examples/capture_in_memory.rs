//! Gaussians made in code: `cargo run --release --example capture_in_memory`.

use std::error::Error;

use splatblur::glam::{DVec3, Quat, Vec3};
use splatblur::{Camera, Device, Gaussians, Motion, Object, Picture, RenderOptions, Renderer, Scene};

/// A row of soft blobs that moves to the right.
pub(crate) fn blobs(count: u16, width: u32, height: u32) -> Result<Picture, Box<dyn Error>> {
    let n = usize::from(count);
    let share = |i: u16| f32::from(i) / f32::from(count.max(2) - 1);
    let gaussians = Gaussians {
        position: (0..count).map(|i| Vec3::new(4.0 * share(i) - 2.0, 0.0, 0.0)).collect(),
        sigma: vec![Vec3::new(0.12, 0.3, 0.12); n],
        rotation: (0..count).map(|i| Quat::from_rotation_z(3.0 * share(i))).collect(),
        opacity: vec![0.8; n],
        base: (0..count).map(|i| Gaussians::base_of(Vec3::new(share(i), 0.3, 1.0 - share(i)))).collect(),
        linear: true,
        ..Gaussians::default()
    };
    let mut object = Object::from_gaussians(gaussians)?;
    object.motions.push(Motion::Linear { velocity: DVec3::X * 0.5 });
    let mut scene = Scene::new([object]);
    (scene.image.width, scene.image.height) = (width, height);
    scene.camera = Camera::new(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    Ok(Renderer::open(Device::Auto)?.render(&scene, 0, &RenderOptions::default())?.picture)
}

#[allow(dead_code, reason = "a test calls the function above")]
fn main() -> Result<(), Box<dyn Error>> {
    blobs(9, 640, 360)?.write("blobs.png")?;
    Ok(())
}

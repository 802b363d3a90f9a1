//! Points of a simulation, with velocities, as a picture: `cargo run --release --example points_in_memory`.

use std::error::Error;

use splatblur::glam::{DVec3, Vec3};
use splatblur::{Camera, Device, Object, Picture, RenderOptions, Renderer, Scene, Surfels, VelocityUnit};

/// A ball of points that bursts: each flies away from the centre, by 0.4 units a frame.
pub(crate) fn burst(points: u32, width: u32, height: u32) -> Result<(Picture, Vec<String>), Box<dyn Error>> {
    let turn = std::f64::consts::PI * (3.0 - 5_f64.sqrt());
    let ball: Vec<DVec3> = (0..points)
        .map(|i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(points);
            let (sin, cos) = (turn * f64::from(i)).sin_cos();
            DVec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z)
        })
        .collect();
    let outward = ball.iter().map(|p| p.as_vec3());
    let (surfels, notes) = Surfels::builder(ball.iter().copied())
        .normals(outward.clone())
        .velocities(outward.map(|p| 0.4 * p), VelocityUnit::Frame)
        .colours(ball.iter().map(|p| if p.y > 0.0 { Vec3::new(0.8, 0.3, 0.1) } else { Vec3::splat(0.2) }))
        .build()?;
    let mut scene = Scene::new([Object::new(surfels)]);
    (scene.image.width, scene.image.height) = (width, height);
    scene.camera = Camera::new(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO);
    (scene.shutter.open, scene.shutter.close) = (-0.5, 0.5);
    let mut renderer = Renderer::open(Device::Auto)?;
    Ok((renderer.render(&scene, 0, &RenderOptions::default())?.picture, notes))
}

#[allow(clippy::print_stdout, dead_code, reason = "the example says what it does; a test calls the function above")]
fn main() -> Result<(), Box<dyn Error>> {
    let (picture, notes) = burst(20_000, 640, 480)?;
    println!("{}", notes.join("\n"));
    picture.write("burst.png")?;
    Ok(())
}

//! A scene without a file: a ball flies past another. `cargo run --release --example scene_in_code` writes
//! `out/two_balls.png`.

use std::error::Error;
use std::f64::consts::PI;

use splatblur::glam::{DVec3, Vec3};
use splatblur::{Camera, Device, Motion, Object, RenderOptions, Renderer, Scene, Surfels};

/// Points all over the unit sphere, on a spiral, in bands of two linear colours. The library estimates their radii.
fn ball(points: u32, colours: [Vec3; 2]) -> Result<Object, Box<dyn Error>> {
    let sphere: Vec<DVec3> = (0..points)
        .map(|i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(points);
            let (sin, cos) = (f64::from(i) * PI * (3.0 - 5_f64.sqrt())).sin_cos();
            DVec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z)
        })
        .collect();
    let (surfels, _) = Surfels::builder(sphere.iter().copied())
        .normals(sphere.iter().map(|p| p.as_vec3()))
        .colours(sphere.iter().map(|p| colours[usize::from((8.0 * p.y).rem_euclid(2.0) < 1.0)]))
        .build()?;
    Ok(Object::new(surfels))
}

fn main() -> Result<(), Box<dyn Error>> {
    let at_rest = ball(30_000, [Vec3::new(0.8, 0.6, 0.4), Vec3::new(0.6, 0.01, 0.01)])?;
    let mut moving = ball(30_000, [Vec3::new(0.03, 0.13, 0.8), Vec3::splat(0.8)])?;
    moving.transform.scale = DVec3::splat(0.6);
    moving.place.translate = DVec3::new(0.0, -0.2, 1.5);
    moving.motions.push(Motion::Linear { velocity: DVec3::new(1.5, 0.6, 0.0) });

    let mut scene = Scene::new([at_rest, moving]);
    (scene.image.width, scene.image.height) = (640, 480);
    scene.image.background = DVec3::splat(0.05);
    scene.camera = Camera::new(DVec3::new(0.0, 0.5, 5.0), DVec3::ZERO);
    (scene.shutter.open, scene.shutter.close) = (-0.5, 0.5);

    let mut renderer = Renderer::open(Device::Auto)?;
    let picture = renderer.render(&scene, 0, &RenderOptions::default())?.picture;
    std::fs::create_dir_all("out")?;
    picture.write("out/two_balls.png")?;
    Ok(())
}

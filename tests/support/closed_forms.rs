//! The scenes of tests/data/truth, and their images, which no renderer made.

use std::path::Path;

use exr::prelude::{ReadChannels, ReadLayers};
use glam::{DVec3, Vec3};
use splatblur::model::Surfels;
use splatblur::scene::{Motion, Scene};

use super::{UNLIT, object, round_surfels, scene};

/// Pixels a side.
pub const SIZE: usize = 64;
/// Depth of everything.
pub const DEPTH: f64 = 4.0;
/// 32 / tan(20 degrees), pixels.
pub const FOCAL: f64 = 87.919_277_422_547_94;

/// Row-major RGB.
pub fn truth(name: &str) -> Vec<[f32; 3]> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/truth").join(format!("{name}.exr"));
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| vec![[f32::NAN; 3]; size.area()],
            |pixels: &mut Vec<[f32; 3]>, at, (r, g, b): (f32, f32, f32)| pixels[at.y() * SIZE + at.x()] = [r, g, b],
        )
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .expect("a truth image");
    image.layer_data.channel_data.pixels
}

/// World position at depth `DEPTH` of a pixel position.
pub fn world(x_px: f64, y_px: f64) -> DVec3 {
    DVec3::new((x_px - 32.0) * DEPTH / FOCAL, (32.0 - y_px) * DEPTH / FOCAL, -DEPTH)
}

/// A model whose surfels sit at the origin of its motion.
pub fn moving(model: Surfels, at: DVec3, motion: Motion) -> Scene {
    let mut object = object(model);
    object.transform.translate = at;
    object.motions = vec![motion];
    object.shape.surface_mut().expect("a surface").material = Some(UNLIT);
    scene(vec![object], [SIZE as u32; 2], DVec3::ZERO, 40.0)
}

/// One disc, moving in a straight line.
pub fn disc() -> Scene {
    let from = DVec3::new(-0.623_299_026_180_871_4, -0.395_817_629_764_495_1, -DEPTH);
    let to = DVec3::new(0.632_398_282_037_526_3, 0.450_413_164_904_425_23, -DEPTH);
    let model = round_surfels([(DVec3::ZERO, DVec3::Z, 0.426_300_136_884_289_36, Vec3::new(0.9, 0.5, 0.2))]);
    moving(model, from, Motion::Linear { velocity: to - from })
}

/// A half-plane, as one huge surfel whose rim runs through the line.
pub fn edge() -> Scene {
    const RADIUS: f64 = 2500.0;
    let (s, c) = 23_f64.to_radians().sin_cos();
    let radius_px = RADIUS * FOCAL / DEPTH;
    let centre = |k: f64| {
        let along = k - (c + s) * 32.0 - radius_px;
        world(32.0 + along * c, 32.0 + along * s)
    };
    let (from, to) = (centre(14.2), centre(52.6));
    let model = round_surfels([(DVec3::ZERO, DVec3::Z, RADIUS, Vec3::new(0.3, 0.7, 0.95))]);
    moving(model, from, Motion::Linear { velocity: to - from })
}

/// A turning disc in two colours, as a lattice of surfels of radius 0.28 px, symmetric about the seam: within half a
/// pixel of the truth's, and to be compared away from centre and rim.
pub fn spin() -> Scene {
    spin_of(0.2)
}

/// [`spin`] with surfels `spacing` pixels apart, of 1.4 times that radius.
pub fn spin_of(spacing: f64) -> Scene {
    let px = DEPTH / FOCAL;
    let (s, c) = 12_f64.to_radians().sin_cos();
    let n = (21.3 / spacing) as i32;
    let mut points = Vec::new();
    for j in -n..n {
        for i in -n..=n {
            // The seam runs along v = 0; A is where v > 0 (angle minus 12 degrees in [0, 180)).
            let (u, v) = (f64::from(i) * spacing, (f64::from(j) + 0.5) * spacing);
            if u.hypot(v) > 21.3 {
                continue;
            }
            let colour = if v > 0.0 { Vec3::new(0.95, 0.2, 0.1) } else { Vec3::new(0.1, 0.35, 0.9) };
            points.push((DVec3::new(u * c - v * s, u * s + v * c, 0.0) * px, DVec3::Z, 1.4 * spacing * px, colour));
        }
    }
    let at = world(31.4, 33.2);
    moving(round_surfels(points), at, Motion::Rotation { axis: DVec3::Z, per_frame: 200_f64.to_radians(), centre: at })
}

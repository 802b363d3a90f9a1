//! Closed forms of small motion-blur cases (tests/data/truth/README.md), which no renderer made: they fix the camera, the
//! shutter, its weights and the kernel's cut-off.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

mod support;

use std::path::Path;

use exr::prelude::{ReadChannels, ReadLayers};
use glam::{DVec3, Vec3};
use splatblur::model::Surfels;
use splatblur::plan::{BlurMode, PixelFilter, Prefilter, RenderOptions};
use splatblur::scene::{Motion, Scene};
use splatblur::time::Weight;
use support::{UNLIT, object, render, round_surfels, scene};

const SIZE: usize = 64;
const DEPTH: f64 = 4.0;
/// 32 / tan(20 degrees), pixels.
const FOCAL: f64 = 87.919_277_422_547_94;
const SAMPLES: u32 = 1024;

/// Row-major RGB.
fn truth(name: &str) -> Vec<[f32; 3]> {
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
fn world(x_px: f64, y_px: f64) -> DVec3 {
    DVec3::new((x_px - 32.0) * DEPTH / FOCAL, (32.0 - y_px) * DEPTH / FOCAL, -DEPTH)
}

/// A model whose surfels sit at the origin of its motion.
fn moving(model: Surfels, at: DVec3, motion: Motion) -> Scene {
    let mut object = object(model);
    object.transform.translate = at;
    object.motions = vec![motion];
    object.material = Some(UNLIT);
    scene(vec![object], [SIZE as u32; 2], DVec3::ZERO, 40.0)
}

fn disc() -> Scene {
    let from = DVec3::new(-0.623_299_026_180_871_4, -0.395_817_629_764_495_1, -DEPTH);
    let to = DVec3::new(0.632_398_282_037_526_3, 0.450_413_164_904_425_23, -DEPTH);
    let model = round_surfels([(DVec3::ZERO, DVec3::Z, 0.426_300_136_884_289_36, Vec3::new(0.9, 0.5, 0.2))]);
    moving(model, from, Motion::Linear { velocity: to - from })
}

/// A half-plane, as one huge surfel whose rim runs through the line.
fn edge() -> Scene {
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

/// A turning disc in two colours, as a lattice of surfels of radius 0.28 px, symmetric about the seam.
fn spin() -> Scene {
    const SPACING: f64 = 0.2;
    const RADIUS: f64 = 0.28;
    let px = DEPTH / FOCAL;
    let (s, c) = 12_f64.to_radians().sin_cos();
    let n = (21.3 / SPACING) as i32;
    let mut points = Vec::new();
    for j in -n..n {
        for i in -n..=n {
            // The seam runs along v = 0; A is where v > 0 (angle minus 12 degrees in [0, 180)).
            let (u, v) = (f64::from(i) * SPACING, (f64::from(j) + 0.5) * SPACING);
            if u.hypot(v) > 21.3 {
                continue;
            }
            let colour = if v > 0.0 { Vec3::new(0.95, 0.2, 0.1) } else { Vec3::new(0.1, 0.35, 0.9) };
            points.push((DVec3::new(u * c - v * s, u * s + v * c, 0.0) * px, DVec3::Z, RADIUS * px, colour));
        }
    }
    let at = world(31.4, 33.2);
    moving(round_surfels(points), at, Motion::Rotation { axis: DVec3::Z, per_frame: 200_f64.to_radians(), centre: at })
}

struct Error {
    rmse: f64,
    max: f64,
}

/// Error of `scene` over all channels of the pixels for which `counts(x, y)`.
fn error(mut scene: Scene, name: &str, weight: &str, filter: &str, counts: impl Fn(f64, f64) -> bool) -> Error {
    scene.shutter.weight = match weight {
        "box" => Weight::Box,
        _ => Weight::Ramp { centre: 1.0 },
    };
    let options = RenderOptions {
        mode: BlurMode::Supersample { samples: SAMPLES },
        filter: if filter == "box" { PixelFilter::Box } else { PixelFilter::Point },
        prefilter: Prefilter::None,
        ..RenderOptions::default()
    };
    let picture = render(&scene, &options);
    let truth = truth(&format!("{name}_{weight}_{filter}"));
    let (mut sum, mut count, mut max) = (0.0, 0, 0.0_f64);
    for (i, (got, want)) in picture.rgba.iter().zip(&truth).enumerate() {
        if !counts((i % SIZE) as f64 + 0.5, (i / SIZE) as f64 + 0.5) {
            continue;
        }
        for channel in 0..3 {
            let difference = f64::from(got[channel]) - f64::from(want[channel]);
            assert!(difference.is_finite());
            sum += difference * difference;
            max = max.max(difference.abs());
            count += 1;
        }
    }
    let error = Error { rmse: (sum / f64::from(count)).sqrt(), max };
    println!("{name} {weight} {filter}: rmse {:.2e}, max {:.2e}", error.rmse, error.max);
    error
}

#[test]
fn disc_and_edge_at_pixel_centres() {
    for weight in ["box", "ramp"] {
        for (name, scene) in [("disc", disc()), ("edge", edge())] {
            let error = error(scene, name, weight, "point", |_, _| true);
            assert!(error.max <= 2.0 / 1024.0, "{name} {weight}: {:.2e}", error.max);
        }
    }
}

#[test]
fn disc_and_edge_over_pixel_squares() {
    for weight in ["box", "ramp"] {
        for (name, scene) in [("disc", disc()), ("edge", edge())] {
            let error = error(scene, name, weight, "box", |_, _| true);
            assert!(error.rmse <= 1e-3, "{name} {weight}: {:.2e}", error.rmse);
            assert!(error.max <= 0.01, "{name} {weight}: {:.2e}", error.max);
        }
    }
}

#[test]
fn spin_away_from_centre_and_rim() {
    let ring = |x: f64, y: f64| (4.0..=20.0).contains(&(x - 31.4).hypot(y - 33.2));
    for weight in ["box", "ramp"] {
        for filter in ["point", "box"] {
            let error = error(spin(), "spin", weight, filter, ring);
            assert!(error.rmse <= 0.003, "{weight} {filter}: {:.2e}", error.rmse);
            assert!(error.max <= 0.02, "{weight} {filter}: {:.2e}", error.max);
        }
    }
}

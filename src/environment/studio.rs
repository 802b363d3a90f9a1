//! An environment made by formula, for the demo scenes.
//!
//! The pixels are the same on every computer: sines, cosines and angles come from `libm`.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::lat_long::LatLong;

/// Columns of the picture.
const WIDTH: usize = 1024;
/// Rays through a pixel, along each axis.
const RAYS: usize = 4;

/// A pale blue sky, a floor of squares that fades into the distance, six tall windows of light around, and a small sun
/// behind the camera's right shoulder.
pub fn studio() -> LatLong {
    let pixel = |i: usize| {
        let mut sum = DVec3::ZERO;
        for ray in 0..RAYS * RAYS {
            let within = |k: usize| (k as f64 + 0.5) / RAYS as f64;
            let x = ((i % WIDTH) as f64 + within(ray % RAYS)) / WIDTH as f64;
            let y = ((i / WIDTH) as f64 + within(ray / RAYS)) / (WIDTH / 2) as f64;
            sum += radiance((x - 0.5) * TAU, y * PI);
        }
        (sum / (RAYS * RAYS) as f64).as_vec3().to_array()
    };
    LatLong::of_formula(WIDTH, (0..WIDTH * WIDTH / 2).map(pixel).collect())
}

/// The light from a longitude, right of -z, and a polar angle from +y.
fn radiance(longitude: f64, polar: f64) -> DVec3 {
    let (flat, height) = libm::sincos(polar);
    let (sin, cos) = libm::sincos(longitude);
    let towards = DVec3::new(flat * sin, height, -flat * cos);
    let haze = DVec3::new(0.55, 0.6, 0.66);
    if height < 0.0 {
        let at = towards / -height;
        let is_light = (at.x.floor() + at.z.floor()).rem_euclid(2.0) < 0.5;
        let square = if is_light { DVec3::new(0.62, 0.55, 0.46) } else { DVec3::new(0.1, 0.1, 0.12) };
        return haze.lerp(square, (-height * 5.0).min(1.0));
    }
    if towards.dot(DVec3::new(0.5, 0.6, 0.6).normalize()) > libm::cos(0.09) {
        return DVec3::new(24.0, 22.0, 18.0);
    }
    let from_window = (longitude + TAU / 12.0).rem_euclid(TAU / 6.0) - TAU / 12.0;
    if from_window.abs() < 0.17 && (0.12..0.55).contains(&height) {
        return DVec3::new(2.6, 2.5, 2.3);
    }
    let sky = DVec3::new(0.2, 0.36, 0.72);
    haze.lerp(sky, libm::sqrt(height))
}

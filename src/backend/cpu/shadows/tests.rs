//! Surfels that are drawn on maps. Whether it is enough, tests/render/shadows.rs judges by the pictures.

use glam::DVec3;

use super::Shadows;
use crate::backend::clusters::ClusterStore;
use crate::frame::Frame;
use crate::model::Surfels;
use crate::options::{BlurMode, RenderOptions};
use crate::scene::{Camera, Light, Object, Scene};

/// Discs at places, with these normals, of one radius.
fn discs(of: impl Iterator<Item = (DVec3, DVec3)>, radius: f32) -> Object {
    let (places, normals): (Vec<_>, Vec<_>) = of.map(|(place, normal)| (place, normal.as_vec3())).unzip();
    let radii = vec![radius; places.len()];
    let surfels = Surfels::builder(places).normals(normals).radii(radii);
    let (surfels, _) = surfels.build().unwrap();
    Object::new(surfels.spatially_ordered())
}

/// A floor of 8 x 8 with 6,400 surfels, about along `up`.
fn floor(up: DVec3) -> Object {
    let (right, far) = up.any_orthonormal_pair();
    let at = |i: usize| 0.1 * (i as f64 - 39.5);
    let places = (0..6400).map(|i| right * at(i % 80) + far * at(i / 80));
    discs(places.map(|place| (place, up)), 0.1)
}

/// A ball of 3,000 surfels, one above the middle of the floor.
fn ball(up: DVec3) -> Object {
    let place = |i: usize| {
        let z = 1.0 - (2 * i + 1) as f64 / 3000.0;
        let angle = 2.399_963_229_728_653 * i as f64;
        (1.0 - z * z).sqrt() * DVec3::new(angle.cos(), angle.sin(), 0.0) + DVec3::Z * z
    };
    discs((0..3000).map(|i| (up + 0.5 * place(i), place(i))), 0.03)
}

/// Surfels on all maps of a light, each as often as it is on one.
fn casters(objects: Vec<Object>, light: Light, up: DVec3) -> usize {
    let mut scene = Scene::new(objects);
    (scene.image.width, scene.image.height) = (160, 120);
    scene.camera = Camera { up, ..Camera::new(up * 2.5 + up.any_orthonormal_vector() * 5.0, DVec3::ZERO) };
    scene.lights = vec![light];
    let frame = Frame::new(&scene, 0, BlurMode::supersample(1), &RenderOptions::default());
    let clusters = ClusterStore::default().of_frame(&frame);
    let sample = frame.all_samples().next().unwrap();
    let mut shadows = Shadows::default();
    shadows.draw(&frame, sample, &frame.rasters[0].positions[0].raster, &clusters);
    shadows.lights.iter().flatten().flat_map(|light| &light.maps).map(super::ShadowMap::casters).sum()
}

#[test]
fn a_floor_is_not_drawn() {
    for up in [DVec3::Y, DVec3::new(0.3, 0.9, -0.2).normalize()] {
        let right = up.any_orthonormal_vector();
        let lights = [Light::directional(-(up + right), DVec3::ONE), Light::point(up * 3.0 + right, DVec3::ONE)];
        for light in lights {
            let of = |objects| casters(objects, light, up);
            assert_eq!(of(vec![floor(up)]), 0, "{light:?}");
            let [with, alone] = [of(vec![floor(up), ball(up)]), of(vec![ball(up)])];
            // The ball alone casts shadows on itself.
            assert!(with >= 1000, "{light:?}: {with}");
            assert!(alone <= with, "{light:?}: {alone} for {with}");
        }
    }
}

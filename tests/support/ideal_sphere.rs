//! Spheres of surfels against the ideal sphere, both ray-traced.

use glam::{DVec3, Vec3};
use splatblur::film::Picture;
use splatblur::model::Surfels;
use splatblur::reference::{ReferenceOptions, render};
use splatblur::scene::{Scene, Sphere};

use super::{rms, sphere_scene};

/// RMS differences of spheres of so many surfels from the ideal one. All are squashed, move and turn.
///
/// Each difference must be less than 0.6 of the one before. The same samples see both: what differs is the surface.
pub fn approaches_the_ideal_sphere<const N: usize>(counts: [usize; N], size: u32) -> [f64; N] {
    let base = |n: usize| {
        let mut scene = sphere_scene(n, size, true);
        scene.objects[0].transform.scale = DVec3::new(1.0, 0.8, 1.1);
        scene.image.transparent = true;
        scene
    };
    let colour = Vec3::new(0.8, 0.6, 0.4);
    let mut ideal = base(1);
    ideal.objects[0].shape = Sphere { radius: 1.0, colour }.into();
    let options = ReferenceOptions { samples: 256, ..ReferenceOptions::default() };
    let traced =
        |scene: &Scene| -> Picture { render(scene, 0, &options, None, &|_| ()).expect("valid options").picture };
    let ideal = traced(&ideal);
    assert!(ideal.rgba.iter().filter(|p| p[3] > 0.99).count() > ideal.rgba.len() / 8);
    let mut before = f64::INFINITY;
    counts.map(|n| {
        let mut scene = base(n);
        let surfels = scene.objects[0].shape.surfels().expect("a sphere of surfels").surfels();
        let mut model = Surfels::clone(surfels);
        model.colour.fill(colour);
        scene.objects[0].shape = model.into();
        let difference = rms(&traced(&scene), &ideal);
        println!("{n} surfels: rms difference {difference:.2e}");
        assert!(difference < 0.6 * before, "{n}: {difference:.2e} after {before:.2e}");
        before = difference;
        difference
    })
}

//! A principal point off the middle: the picture is a part of a larger one whose principal point is in its middle.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use glam::DVec2;
use splatblur::backend::cpu::Cpu;
use splatblur::environment::{Environment, LatLong};
use splatblur::film::Picture;
use splatblur::options::{BlurMode, Look, Prefilter, RenderOptions, Shading};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::Scene;

use crate::support::{rms, sphere_scene};

const LARGE: u32 = 160;
const SMALL: [u32; 2] = [96, 72];
/// First column and row of the small picture in the large one.
const CORNER: [u32; 2] = [20, 58];

fn large() -> Scene {
    let mut scene = sphere_scene(8000, LARGE, true);
    let pixels = (0..32 * 16).map(|i| [0.2 + (i % 5) as f32 * 0.1, 0.3, 0.4 + (i % 3) as f32 * 0.2]).collect();
    let mut environment = Environment::new(LatLong::new(32, pixels).unwrap());
    environment.background = true;
    scene.environment = Some(environment);
    scene
}

/// The same camera, with a window of its image.
fn small() -> Scene {
    let mut scene = large();
    let focal = 0.5 * f64::from(LARGE) / (0.5 * scene.camera.fovy).tan();
    [scene.image.width, scene.image.height] = SMALL;
    scene.camera.fovy = 2.0 * (0.5 * f64::from(SMALL[1]) / focal).atan();
    let shift = |i: usize| (0.5 * f64::from(LARGE) - f64::from(CORNER[i])) / f64::from(SMALL[i]) - 0.5;
    scene.camera.shift = DVec2::new(shift(0), shift(1));
    scene
}

fn window(picture: &Picture) -> Picture {
    let row = |y: u32| {
        let first = ((y + CORNER[1]) * LARGE + CORNER[0]) as usize;
        picture.rgba[first..first + SMALL[0] as usize].iter().copied()
    };
    Picture { width: SMALL[0], height: SMALL[1], rgba: (0..SMALL[1]).flat_map(row).collect(), layers: Vec::new() }
}

// Not deep: the only test of a shifted camera in pictures.
#[test]
fn a_shifted_camera_sees_a_window_of_a_larger_picture() {
    for (mode, prefilter, shading) in [
        ("supersample:4", Prefilter::None, Shading::Phong),
        ("supersample:4", Prefilter::Ewa, Shading::Phong),
        ("bucket:2x2", Prefilter::Approx, Shading::Gouraud),
        ("volumetric:3", Prefilter::Approx, Shading::Gouraud),
    ] {
        let options = RenderOptions {
            quality: mode.parse::<BlurMode>().unwrap().into(),
            prefilter,
            look: Look { shading, ..Look::default() },
            ..RenderOptions::default()
        };
        let of = |scene: &Scene| render_frame(&mut Cpu::default(), scene, 0, &options).unwrap().picture;
        let (part, whole) = (of(&small()), window(&of(&large())));
        let error = rms(&part, &whole);
        println!("{mode} {prefilter:?}: {error:.2e}");
        assert!(error < 1e-4, "{mode} {prefilter:?}: {error}");
        #[cfg(feature = "gpu")]
        if let Some(mut gpu) = crate::support::gpu::gpu_or_skip("a_shifted_camera_sees_a_window_of_a_larger_picture") {
            let device = render_frame(&mut gpu, &small(), 0, &options).unwrap().picture;
            assert!(rms(&device, &part) < 1e-4, "{mode} {prefilter:?}");
        }
    }
    let auto = |scene: &Scene| render_frame(&mut Cpu::default(), scene, 0, &RenderOptions::default()).unwrap().picture;
    assert!(rms(&auto(&small()), &window(&auto(&large()))) < 0.02);
    let options = ReferenceOptions { samples: 256, ..ReferenceOptions::default() };
    let traced = |scene: &Scene| reference::render(scene, 0, &options, None, &|_| ()).unwrap().picture;
    let error = rms(&traced(&small()), &window(&traced(&large())));
    println!("reference: {error:.2e}");
    assert!(error < 6e-3, "{error}");
    // The window is not in the middle.
    assert!(small().camera.shift.length() > 0.1);
}

//! Volumes against the definition marched along rays in f64, and closed forms. None shares mathematics with the
//! renderer.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use glam::{DVec3, Quat, Vec3};
use splatblur::compare::flip;
use splatblur::film::Picture;
use splatblur::model::{Gaussians, Optics};
use splatblur::options::{BlurMode, PixelFilter, Prefilter, RenderOptions};
use splatblur::scene::{Camera, Object, Scene};

use crate::support::volumes::{View, picture};
use crate::support::{render, scene};

const FOVY: f64 = 40.0;

fn unfiltered() -> RenderOptions {
    RenderOptions {
        quality: BlurMode::Still { pixel_samples: 1 }.into(),
        filter: PixelFilter::Point,
        prefilter: Prefilter::None,
        ..RenderOptions::default()
    }
}

fn seen(objects: Vec<Object>, view: &View) -> Scene {
    let mut scene = scene(objects, view.size, view.eye, view.fovy);
    scene.camera = Camera { fovy: view.fovy.to_radians(), ..Camera::new(view.eye, view.at) };
    scene.image.transparent = true;
    scene
}

/// Kernels with these positions, masses and colours, of standard deviation `sigma`.
fn kernels(sigma: f32, layer: f32, each: impl Iterator<Item = (Vec3, f32, Vec3)>) -> Gaussians {
    let mut out = Gaussians { optics: Optics::Extinction { layer }, linear: true, ..Gaussians::default() };
    for (position, mass, colour) in each {
        out.position.push(position);
        out.sigma.push(Vec3::splat(sigma));
        out.rotation.push(Quat::IDENTITY);
        out.opacity.push(mass);
        out.base.push((colour - 0.5) / 0.282_094_8);
    }
    out
}

/// A field on a grid of `n`^3 cells in [-1, 1]^3: extinction and colour at a point. `kernel`: in spacings.
fn grid(n: usize, kernel: f32, layer: f32, field: impl Fn(Vec3) -> (f32, Vec3)) -> Gaussians {
    let spacing = 2.0 / n as f32;
    let at = |i: usize| (i as f32 + 0.5) * spacing - 1.0;
    let places = (0..n).flat_map(|z| (0..n).flat_map(move |y| (0..n).map(move |x| Vec3::new(at(x), at(y), at(z)))));
    let each = places.map(|p| {
        let (extinction, colour) = field(p);
        (p, extinction * spacing.powi(3), colour)
    });
    kernels(kernel * spacing, layer * spacing, each.filter(|(_, mass, _)| *mass > 0.0))
}

fn torus(p: Vec3) -> (f32, Vec3) {
    let ring = (p.x * p.x + p.z * p.z).sqrt() - 0.6;
    let d2 = (ring * ring + p.y * p.y) / (0.22 * 0.22);
    let density = 10.0 * (-2.0 * d2).exp();
    (if density > 0.02 { density } else { 0.0 }, Vec3::new(0.9, 0.5 + 0.4 * p.x, 0.3 - 0.3 * p.y))
}

fn ball(p: Vec3) -> (f32, Vec3) {
    let r = p.length();
    let edge = ((0.8 - r) / 0.1).clamp(0.0, 1.0);
    (6.0 * edge * edge * (3.0 - 2.0 * edge), if r < 0.5 { Vec3::new(0.9, 0.2, 0.1) } else { Vec3::new(0.2, 0.4, 0.9) })
}

fn worst(found: &Picture, want: &[[f64; 4]]) -> f64 {
    let each = found.rgba.iter().flatten().zip(want.iter().flatten());
    each.map(|(&found, want)| (f64::from(found) - want).abs()).fold(0.0, f64::max)
}

fn truth(found: &Picture, want: &[[f64; 4]]) -> Picture {
    Picture { rgba: want.iter().map(|pixel| pixel.map(|v| v as f32)).collect(), ..found.clone() }
}

#[test]
fn explore() {
    for (name, field) in [("torus", torus as fn(Vec3) -> (f32, Vec3)), ("ball", ball)] {
        for kernel in [0.6] {
            for layer in [0.01, 1.0, 1.5] {
                let volume = grid(24, kernel, layer, field);
                for eye in [DVec3::new(0.0, 0.0, 5.0), DVec3::new(1.0, 1.5, 2.0)] {
                    let view = View { eye, at: DVec3::ZERO, fovy: FOVY, size: [64, 48] };
                    let want = picture(&volume, &view);
                    let scene = seen(vec![Object::new(volume.clone())], &view);
                    let found = render(&scene, &unfiltered());
                    println!(
                        "{name} kernel {kernel} layer {layer} eye {eye}: worst {:.5}, flip {:.5}",
                        worst(&found, &want),
                        flip::mean(&found, &truth(&found, &want)).unwrap()
                    );
                }
            }
        }
    }
}

//! The scenes of the figures about the prefilter: checkerboards, single discs, and many surfels in one pixel.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::figures::{octopus_at_rest, scene};
use super::models::DISCS;
use crate::math::Trs;
use crate::model::{Cloud, ModelError};
use crate::sampling::uniform;
use crate::scene::{Camera, Light, Object, Scene};

/// A scene that is rendered with each prefilter.
pub(super) struct Plate {
    /// Paper and figure.
    pub(super) source: &'static str,
    /// Name of its picture.
    pub(super) name: &'static str,
    /// What it shows.
    pub(super) about: &'static str,
    /// Names of the parts of equal width that errors are measured over, from left to right.
    pub(super) parts: &'static [&'static str],
    pub(super) scene: Scene,
}

/// Light colours of a cell, as a file stores them.
const PALE: f32 = 0.92;
const DARK: f32 = 0.16;

/// Surfels of the checkerboard: "64k" (Ren et al. 2002, section 8).
const BOARD: usize = 65_536;

/// The scenes, with 1 of `fewer` of their surfels.
pub(super) fn plates(size: [u32; 2], fewer: usize) -> Result<Vec<Plate>, ModelError> {
    let fewer = fewer.max(1);
    let boards: &[&str] = &["minified", "magnified", "stretched"];
    let three = three_boards([size[0], size[1] / 2], fewer)?;
    let plate = |source, name, about, parts, scene| Plate { source, name, about, parts, scene };
    let (octopus, far) = ("many surfels in a pixel", "a checkerboard up to the horizon");
    Ok(vec![
        plate("Wolf 4.9", "4.9", octopus, &["octopus"], octopus_at_rest(size, fewer)?),
        plate("Ren et al. 11", "ren-11", far, &["lattice"], horizon(size, fewer, false)?),
        plate("Ren et al. 11", "ren-11-random", far, &["random points"], horizon(size, fewer, true)?),
        plate("Zwicker et al. 13", "zwicker-13", "three checkerboards", boards, three),
    ])
}

/// `columns` x `rows` surfels about the origin in z = 0, the normal +z, `spacing` apart, x varying fastest: a
/// checkerboard of cells of `cell` surfels. At random each surfel lies anywhere in its own square of the lattice, and
/// radii are half as large again, so that no holes are left.
fn board([columns, rows]: [usize; 2], spacing: f64, cell: usize, random: bool) -> Cloud {
    let count = columns * rows;
    let places = if random { uniform(2 * count as u32, 1, 0.0) } else { vec![0.5; 2 * count] };
    let radius = spacing * libm::sqrt(DISCS / PI) * if random { 1.5 } else { 1.0 };
    let mut cloud = Cloud::default();
    for i in 0..count {
        let (column, row) = (i % columns, i / columns);
        let x = column as f64 + places[2 * i] - 0.5 * columns as f64;
        let y = row as f64 + places[2 * i + 1] - 0.5 * rows as f64;
        let pale = (column / cell + row / cell).is_multiple_of(2);
        cloud.position.push(DVec3::new(x, y, 0.0) * spacing);
        cloud.normal.push(Vec3::Z);
        cloud.radius.push(radius as f32);
        cloud.colour.push(Vec3::splat(if pale { PALE } else { DARK }));
    }
    cloud
}

fn object(name: &str, cloud: Cloud, transform: Trs) -> Result<Object, ModelError> {
    Ok(Object { name: name.to_owned(), transform, ..Object::from_cloud(cloud)? })
}

/// Colours as they are.
fn unlit(objects: Vec<Object>, size: [u32; 2]) -> Scene {
    let mut scene = scene(objects, size);
    scene.lights = vec![Light::Ambient { colour: DVec3::ONE }];
    scene
}

/// A board of side 16 seen from .5 above its front edge: surfels shrink from 15 pixels to one in width (at 240 x 180),
/// and to a twentieth of a pixel in height.
pub(super) fn horizon(size: [u32; 2], fewer: usize, random: bool) -> Result<Scene, ModelError> {
    let side = libm::sqrt(BOARD as f64 / fewer as f64) as usize;
    let lying = Trs { rotate: DVec3::new(-0.5 * PI, 0.0, 0.0), ..Trs::default() };
    let board = object("board", board([side; 2], 16.0 / side as f64, 4, random), lying)?;
    let mut scene = unlit(vec![board], size);
    scene.camera = Camera::new(DVec3::new(0.0, 0.5, 8.0), DVec3::new(0.0, -0.2, 5.0));
    scene.image.background = DVec3::new(0.03, 0.035, 0.05);
    Ok(scene)
}

/// Scene units of a pixel in z = 0, seen as [`scene`] sees it.
fn pixel(scene: &Scene) -> f64 {
    8.0 * libm::tan(0.5 * scene.camera.fovy) / f64::from(scene.image.height)
}

/// Three boards side by side, turned by 10 degrees: surfels .3 pixels apart; five pixels apart; and five along by .25
/// across.
fn three_boards(size: [u32; 2], fewer: usize) -> Result<Scene, ModelError> {
    let mut scene = unlit(Vec::new(), size);
    let pixel = pixel(&scene);
    let (third, side) = (f64::from(size[0]) / 3.0, 0.8 * f64::from(size[1]));
    let small = 0.3 * libm::sqrt(fewer as f64);
    let count = |spacing: f64| (side / spacing).max(1.0) as usize;
    let boards = [
        ("minified", board([count(small); 2], small * pixel, 4, false), 1.0),
        ("magnified", board([count(5.0); 2], 5.0 * pixel, 3, false), 1.0),
        ("stretched", board([count(5.0), count(0.25)], 5.0 * pixel, 3, false), 0.05),
    ];
    for (i, (name, cloud, squeezed)) in boards.into_iter().enumerate() {
        let place = Trs {
            translate: DVec3::X * (i as f64 - 1.0) * third * pixel,
            rotate: DVec3::Z * 10_f64.to_radians(),
            scale: DVec3::new(1.0, squeezed, 1.0),
            ..Trs::default()
        };
        scene.objects.push(object(name, cloud, place)?);
    }
    Ok(scene)
}

/// Half-axes in pixels of the discs of figure 4.10: what shapes them is the kernel, both, the prefilter.
pub(super) const HALF_AXES: [(&str, [f64; 2]); 3] =
    [("magnified", [4.0, 4.0]), ("thin", [4.0, 0.35]), ("minified", [0.35, 0.35])];
/// Places of each disc below the pixel, of a row.
const PLACES: usize = 20;
/// Size of figure 4.10 in pixels, and of the space of a disc.
pub(super) const DISCS_SIZE: [u32; 2] = [240, 36];
pub(super) const DISC_SPACE: u32 = 12;

/// Single white discs, far apart: a row of each of [`HALF_AXES`], turned by 30 degrees, at places that differ below
/// the pixel.
pub(super) fn discs() -> Result<Scene, ModelError> {
    let mut scene = unlit(Vec::new(), DISCS_SIZE);
    let pixel = pixel(&scene);
    let mut cloud = Cloud::default();
    for (row, (_, half)) in HALF_AXES.iter().enumerate() {
        for column in 0..PLACES {
            // Places below the pixel that are spread evenly (multiples of 1/p and 1/p^2 with p^3 = p + 1).
            let k = (row * PLACES + column) as f64;
            let below = [0.754_878, 0.569_840].map(|step: f64| (k * step).fract() - 0.5);
            let middle = |i: usize| (i as f64 + 0.5) * f64::from(DISC_SPACE);
            let x = middle(column) + below[0] - 0.5 * f64::from(DISCS_SIZE[0]);
            let y = 0.5 * f64::from(DISCS_SIZE[1]) - middle(row) + below[1];
            let (sin, cos) = libm::sincos(PI / 6.0);
            cloud.position.push(DVec3::new(x, y, 0.0) * pixel);
            cloud.normal.push(Vec3::Z);
            cloud.colour.push(Vec3::ONE);
            let axes = [DVec3::new(cos, sin, 0.0) * half[0], DVec3::new(-sin, cos, 0.0) * half[1]];
            cloud.axes.push(axes.map(|axis| (axis * pixel).as_vec3()));
        }
    }
    scene.objects.push(object("discs", cloud, Trs::default())?);
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_has_its_surfels_and_cells() {
        let lattice = board([8, 6], 0.5, 2, false);
        assert_eq!([lattice.position.len(), lattice.radius.len(), lattice.colour.len()], [48; 3]);
        assert_eq!(lattice.position[0], DVec3::new(-1.75, -1.25, 0.0));
        let colour = |column: usize, row: usize| lattice.colour[row * 8 + column].x;
        assert_eq!(colour(0, 0), colour(2, 2));
        assert_ne!(colour(1, 1), colour(2, 1));
        assert!((DISCS * 0.25 - PI * f64::from(lattice.radius[0]).powi(2)).abs() < 1e-6);
        // At random each stays within its square.
        let random = board([8, 6], 0.5, 2, true);
        assert!(random.position.iter().zip(&lattice.position).all(|(p, q)| (*p - *q).abs().max_element() <= 0.25));
        assert!(random.position.iter().zip(&lattice.position).any(|(p, q)| p.distance(*q) > 0.2));
    }

    #[test]
    fn surfels_of_the_horizon_are_as_the_paper_says() {
        let scene = horizon([300, 225], 1, false).unwrap();
        assert_eq!(scene.objects[0].shape.elements(), 65_536);
        assert_eq!(horizon([64, 48], 200, true).unwrap().objects[0].shape.elements(), 18 * 18);
    }
}

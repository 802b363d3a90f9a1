//! Models made by formula: those that the demo scenes ship, and the sphere of the speed tests.
//!
//! The bytes are the same on every computer: sines, cosines and angles come from `libm`, everything else is plain `f64`
//! arithmetic that is rounded to `f32` once.

use std::f64::consts::PI;
use std::io::{self, Write};

use glam::{DVec3, Vec3};

use super::cloud::Cloud;
use crate::sampling::hash;

/// A colour as the file stores it: sRGB bytes.
type Rgb = [u8; 3];

/// Number of surfels of the [`ball`] that ships.
pub const BALL_SURFELS: u32 = 30_000;

/// A ball of radius 0.5 about the origin. Its [`BALL_SURFELS`] surfels lie on a [`sphere`] lattice of half the size, so
/// each has the radius 4 * 0.5/sqrt(n). Cells of 45 by 30 degrees are cream and red; the poles lie on z.
///
/// `animations/rolling.anim` rolls a ball of this radius without slipping.
pub fn ball() -> Cloud {
    lattice(BALL_SURFELS, 0.5, 4.0, 6.0)
}

/// The unit sphere: `n` surfels on a Fibonacci lattice, each of radius 4/sqrt(n), so that every point of the sphere
/// lies under about four of them. The cells of a 16 by 8 checkerboard are cream and red; the poles lie on z.
///
/// With i = 0..n-1: z = 1 - 2 (i + 1/2)/n, phi = (i + 1/2) pi (3 - sqrt 5), normal = position = (sqrt(1 - z^2) cos phi,
/// sqrt(1 - z^2) sin phi, z).
pub fn sphere(n: u32) -> Cloud {
    lattice(n, 1.0, 8.0, 8.0)
}

/// A square of side 8 in y = 0 with the normal +y: 256 x 256 surfels of radius 0.0375, 32 x 32 cells of 0.25, ivory and
/// slate.
///
/// It is fine enough to test antialiasing: at a slant the far cells are smaller than a pixel.
pub fn checker_plane() -> Cloud {
    square(256, 8.0, 0.0375, 8, [[235, 230, 220], [40, 44, 52]])
}

/// A square of side 14 in y = 0 with the normal +y: 224 x 224 surfels of radius 0.075, 14 x 14 cells of 1 in two quiet
/// greys.
pub fn floor() -> Cloud {
    square(224, 14.0, 0.075, 16, [[120, 116, 110], [70, 72, 78]])
}

/// Inner size of a [`hall`].
const HALL: DVec3 = DVec3::new(20.0, 6.0, 30.0);

/// The inside of a hall about the y axis, from y = 0 to 6: 20 wide along x, 30 long along z. Floor, ceiling and walls
/// have about `n` surfels together, on square lattices, each of radius 1.2 spacings. Cells of 1 are in two greys, those
/// of the walls ochre.
///
/// A camera within looks along its floor: many surfels reach the camera plane, which no ball before a camera shows.
pub fn hall(n: u32) -> Cloud {
    let area = 2.0 * (HALL.x * HALL.z + HALL.x * HALL.y + HALL.y * HALL.z);
    let spacing = (area / f64::from(n.max(1))).sqrt();
    let mut cloud = Cloud::default();
    for axis in 0..3 {
        let (along, across) = ((axis + 1) % 3, (axis + 2) % 3);
        let counts = [along, across].map(|i| (HALL[i] / spacing).round().max(1.0) as u32);
        for (side, row) in (0..2).flat_map(|side| (0..counts[1]).map(move |row| (side, row))) {
            for column in 0..counts[0] {
                let mut at = DVec3::ZERO;
                at[axis] = f64::from(side) * HALL[axis];
                at[along] = HALL[along] * (f64::from(column) + 0.5) / f64::from(counts[0]);
                at[across] = HALL[across] * (f64::from(row) + 0.5) / f64::from(counts[1]);
                let even = (at[along].floor() + at[across].floor()).rem_euclid(2.0) < 1.0;
                let colours =
                    if axis == 1 { [[150, 148, 142], [84, 86, 92]] } else { [[190, 150, 90], [150, 112, 60]] };
                let mut inwards = DVec3::ZERO;
                inwards[axis] = 1.0 - 2.0 * f64::from(side);
                let middle = DVec3::new(0.5 * HALL.x, 0.0, 0.5 * HALL.z);
                push(&mut cloud, at - middle, inwards, (1.2 * spacing) as f32, colours[usize::from(!even)]);
            }
        }
    }
    cloud
}

/// Seven upright slats in z = 0 with the normal +z, centred at x = -2.1, -1.4 .. 2.1. Each is 0.2 wide and 3.2 high
/// about y = 0, with 20 x 320 surfels 0.01 apart of radius 0.012, ochre. The gaps are 0.5 wide.
pub fn fence() -> Cloud {
    const SPACING: f64 = 0.01;
    let mut cloud = Cloud::default();
    for slat in 0..7 {
        let centre = (f64::from(slat) - 3.0) * 0.7;
        for row in 0..320 {
            for column in 0..20 {
                let x = centre + (f64::from(column) + 0.5 - 10.0) * SPACING;
                let y = (f64::from(row) + 0.5 - 160.0) * SPACING;
                push(&mut cloud, DVec3::new(x, y, 0.0), DVec3::Z, 0.012, [232, 176, 64]);
            }
        }
    }
    cloud
}

/// A splash of 20,000 drops, a fifth of a second after something fell into y = 0 (metres and seconds, +y up): a crown
/// of twelve tines, a jet in its middle, and drops that were thrown farther. Each flies under gravity alone:
/// velocities are metres per second, accelerations metres per second squared.
///
/// With the random numbers r of a drop, v its velocity at the start and g = -9.81 y: p(t) = p0 + v t + g t^2/2.
pub fn splash() -> Cloud {
    const DROPS: u32 = 20_000;
    const GRAVITY: DVec3 = DVec3::new(0.0, -9.81, 0.0);
    let mut cloud = Cloud::default();
    for drop in 0..DROPS {
        let random = |k: u64| f64::from(hash(u64::from(drop), k)) / 4_294_967_296.0;
        let (sin, cos) = libm::sincos(2.0 * PI * random(0));
        let out = DVec3::new(cos, 0.0, sin);
        // Tines: where the crown is thrown highest.
        let tine = 0.5 + 0.5 * libm::cos(12.0 * libm::atan2(sin, cos));
        let (start, velocity, age) = match drop % 20 {
            0..14 => {
                let height = random(1);
                let speed = 1.5 + 1.3 * height * (0.55 + 0.45 * tine);
                (out * 0.3, out * (0.9 + 0.5 * random(2) * height) + DVec3::Y * speed, 0.2)
            }
            14..17 => (out * (0.06 * random(1)), out * 0.15 * random(2) + DVec3::Y * (1.2 + 2.8 * random(3)), 0.2),
            _ => (out * 0.3, out * (0.6 + 2.2 * random(1)) + DVec3::Y * (0.8 + 3.0 * random(2)), 0.2),
        };
        // Drops left the water one after the other.
        let t = age * (0.7 + 0.3 * random(4));
        let position = start + velocity * t + GRAVITY * (0.5 * t * t);
        let normal = DVec3::new(random(5) - 0.5, random(6) - 0.2, random(7) - 0.5).normalize_or(DVec3::Y);
        let foam = random(8);
        let radius = (0.006 + 0.012 * foam * foam) as f32;
        push(&mut cloud, position, normal, radius, if foam > 0.6 { [235, 244, 250] } else { [96, 160, 200] });
        cloud.velocity.push((velocity + GRAVITY * t).as_vec3());
        cloud.acceleration.push(GRAVITY.as_vec3());
    }
    cloud
}

/// Numbers of the files of [`swarm`].
pub const SWARM: [u32; 2] = [1, 5];

/// A swarm of 1,200 points along a knotted path, as file `number` of a sequence, one for each frame: at the path's
/// front points join, at its end they leave. Points have an `id`, and velocities per second at 24 frames per second.
///
/// The path is the trefoil C(s) = (sin s + 2 sin 2s, cos s - 2 cos 2s, -sin 3s)/3.
pub fn swarm(number: u32) -> Cloud {
    const POINTS: u32 = 1200;
    const JOIN: u32 = 40;
    const APART: f64 = 0.004;
    /// Along the path in a frame.
    const SPEED: f64 = 0.09;
    const RATE: f64 = 24.0;
    let mut cloud = Cloud::default();
    for row in 0..POINTS {
        // The order of a file says nothing: 7 and 1200 have no common divisor.
        let id = JOIN * number + row * 7 % POINTS;
        let random = |k: u64| f64::from(hash(u64::from(id), k)) / 4_294_967_296.0;
        let s = f64::from(number) * SPEED - f64::from(id) * APART;
        let ([sin, cos], [sin2, cos2], [sin3, cos3]) = (sin_cos(s), sin_cos(2.0 * s), sin_cos(3.0 * s));
        let place = DVec3::new(sin + 2.0 * sin2, cos - 2.0 * cos2, -sin3) / 3.0;
        let along = DVec3::new(cos + 4.0 * cos2, -sin + 4.0 * sin2, -3.0 * cos3) / 3.0;
        let beside = DVec3::new(random(0) - 0.5, random(1) - 0.5, random(2) - 0.5);
        let normal = beside.normalize_or(DVec3::Z);
        push(
            &mut cloud,
            place + beside * 0.2,
            normal,
            0.03,
            if id.is_multiple_of(3) { [244, 190, 72] } else { [64, 132, 150] },
        );
        cloud.velocity.push((along * (SPEED * RATE)).as_vec3());
        cloud.id.push(i64::from(id));
    }
    cloud
}

/// A propeller of radius 1 about z, which faces +z: three twisted blades, dark with yellow tips, and a red spinner.
///
/// With a from 0 to 1 across a blade and s from 0.12 to 1 along it, the blade that lies on x has the point (s, c (a -
/// 1/2) cos w, c (a - 1/2) sin w): the chord c = 0.16 + 0.12 s - 0.2 s^2 is turned by w = 0.9 - 0.65 s radians.
pub fn propeller() -> Cloud {
    const ALONG: u32 = 220;
    const ACROSS: u32 = 32;
    const SPINNER: u32 = 2400;
    let mut cloud = Cloud::default();
    for blade in 0..3 {
        let [sin, cos] = sin_cos(2.0 * PI / 3.0 * f64::from(blade));
        let turned = |v: DVec3| DVec3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z);
        for i in 0..ALONG {
            let s = 0.12 + 0.88 * (f64::from(i) + 0.5) / f64::from(ALONG);
            let chord = 0.16 + 0.12 * s - 0.2 * s * s;
            let [rise, run] = sin_cos(0.9 - 0.65 * s);
            let colour = if s > 0.88 { [240, 196, 40] } else { [58, 60, 66] };
            for j in 0..ACROSS {
                let a = chord * ((f64::from(j) + 0.5) / f64::from(ACROSS) - 0.5);
                let place = DVec3::new(s, a * run, a * rise);
                push(&mut cloud, turned(place), turned(DVec3::new(0.0, -rise, run)), 0.0065, colour);
            }
        }
    }
    // A half ball, three quarters as wide as it is long.
    let lattice = sphere(2 * SPINNER);
    for (&place, &normal) in lattice.position.iter().zip(&lattice.normal).filter(|(place, _)| place.z > -0.1) {
        let stretched = (normal.as_dvec3() / DVec3::new(0.15, 0.15, 0.2)).normalize_or(DVec3::Z);
        push(&mut cloud, place * DVec3::new(0.15, 0.15, 0.2), stretched, 0.0115, [190, 44, 36]);
    }
    cloud
}

fn sin_cos(x: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(x);
    [sin, cos]
}

/// Writes a generated cloud as binary little-endian PLY: position, normal and radius as floats, colour as sRGB bytes,
/// then velocity, acceleration and id where there are any. A surfel without these takes 31 bytes.
///
/// # Errors
/// The writer fails, or an array is missing because the cloud is not a generated one.
pub fn write(cloud: &Cloud, out: &mut impl Write) -> io::Result<()> {
    let n = cloud.position.len();
    if [cloud.normal.len(), cloud.radius.len(), cloud.colour.len()] != [n; 3] {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "each point needs a normal, a radius and a colour"));
    }
    write!(out, "ply\nformat binary_little_endian 1.0\ncomment generated by splatblur, CC0 1.0\nelement vertex {n}\n")?;
    for name in ["x", "y", "z", "nx", "ny", "nz", "radius"] {
        writeln!(out, "property float {name}")?;
    }
    for name in ["red", "green", "blue"] {
        writeln!(out, "property uchar {name}")?;
    }
    let rates = [(&cloud.velocity, ["vx", "vy", "vz"]), (&cloud.acceleration, ["ax", "ay", "az"])];
    for (_, names) in rates.iter().filter(|(column, _)| !column.is_empty()) {
        names.iter().try_for_each(|name| writeln!(out, "property float {name}"))?;
    }
    if !cloud.id.is_empty() {
        writeln!(out, "property int id")?;
    }
    out.write_all(b"end_header\n")?;
    for i in 0..n {
        out.write_all(cloud.position[i].as_vec3().to_array().map(f32::to_le_bytes).as_flattened())?;
        out.write_all(cloud.normal[i].to_array().map(f32::to_le_bytes).as_flattened())?;
        out.write_all(&cloud.radius[i].to_le_bytes())?;
        out.write_all(&cloud.colour[i].to_array().map(|c| (c * 255.0).round() as u8))?;
        for rate in rates.iter().filter_map(|(column, _)| column.get(i)) {
            out.write_all(rate.to_array().map(f32::to_le_bytes).as_flattened())?;
        }
        if let Some(&id) = cloud.id.get(i) {
            out.write_all(&(id as i32).to_le_bytes())?;
        }
    }
    Ok(())
}

/// A sphere of radius `size` with `n` surfels. Its checkerboard has 2 `turn` cells around the poles and `rise` cells
/// from pole to pole.
fn lattice(n: u32, size: f64, turn: f64, rise: f64) -> Cloud {
    let count = f64::from(n);
    let golden = PI * (3.0 - libm::sqrt(5.0));
    let radius = (4.0 * size / libm::sqrt(count)) as f32;
    let mut cloud = Cloud::default();
    // Columns that grow by doubling would take up to three times the memory.
    cloud.position.reserve_exact(n as usize);
    cloud.normal.reserve_exact(n as usize);
    cloud.radius.reserve_exact(n as usize);
    cloud.colour.reserve_exact(n as usize);
    for i in 0..n {
        let k = f64::from(i) + 0.5;
        let z = 1.0 - 2.0 * k / count;
        let (sin, cos) = libm::sincos(k * golden);
        let ring = libm::sqrt(1.0 - z * z);
        let normal = DVec3::new(ring * cos, ring * sin, z);
        let column = (libm::atan2(normal.y, normal.x) / (PI / turn)).floor();
        let row = (libm::asin(z) / (PI / rise)).floor();
        let even = (column + row).rem_euclid(2.0) < 1.0;
        push(&mut cloud, normal * size, normal, radius, if even { [240, 232, 214] } else { [214, 62, 40] });
    }
    cloud
}

/// A checkered square in y = 0: `n` x `n` surfels, `per_cell` along the side of a cell. x varies fastest.
fn square(n: u32, side: f64, radius: f32, per_cell: u32, colours: [Rgb; 2]) -> Cloud {
    let at = |k: u32| ((f64::from(k) + 0.5) / f64::from(n) - 0.5) * side;
    let mut cloud = Cloud::default();
    for row in 0..n {
        for column in 0..n {
            let even = (row / per_cell + column / per_cell).is_multiple_of(2);
            let colour = if even { colours[0] } else { colours[1] };
            push(&mut cloud, DVec3::new(at(column), 0.0, at(row)), DVec3::Y, radius, colour);
        }
    }
    cloud
}

fn push(cloud: &mut Cloud, position: DVec3, normal: DVec3, radius: f32, colour: Rgb) {
    cloud.position.push(position);
    cloud.normal.push(normal.as_vec3());
    cloud.radius.push(radius);
    cloud.colour.push(Vec3::from_array(colour.map(|c| f32::from(c) / 255.0)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Bounds;

    fn extent(cloud: &Cloud) -> (DVec3, DVec3) {
        let bounds: Bounds = cloud.position.iter().copied().collect();
        (bounds.min, bounds.max)
    }

    fn near(a: DVec3, b: DVec3, tolerance: f64) {
        assert!((a - b).abs().max_element() < tolerance, "{a} is not {b}");
    }

    #[test]
    fn models_have_the_sizes_that_the_scenes_count_on() {
        let (min, max) = extent(&ball());
        near(min, DVec3::splat(-0.5), 2e-4);
        near(max, DVec3::splat(0.5), 2e-4);
        let (min, max) = extent(&checker_plane());
        near(max - min, DVec3::new(8.0 - 8.0 / 256.0, 0.0, 8.0 - 8.0 / 256.0), 1e-12);
        let (min, max) = extent(&floor());
        near(max - min, DVec3::new(14.0 - 14.0 / 224.0, 0.0, 14.0 - 14.0 / 224.0), 1e-12);
        let (min, max) = extent(&fence());
        near(max, DVec3::new(2.195, 1.595, 0.0), 1e-12);
        near(min, -max, 1e-12);
    }

    #[test]
    fn counts_and_radii() {
        let counts = [ball(), checker_plane(), floor(), fence(), sphere(1000)].map(|c| c.position.len());
        assert_eq!(counts, [30_000, 65_536, 50_176, 44_800, 1000]);
        assert!((ball().radius[7] - 0.011_547).abs() < 1e-6);
        assert!((sphere(10_000).radius[7] - 0.04).abs() < 1e-7);
    }

    #[test]
    fn a_hall_is_seen_from_within() {
        let hall = hall(20_000);
        assert!(hall.position.len().abs_diff(20_000) < 400, "{}", hall.position.len());
        let (low, high) = extent(&hall);
        near(low, DVec3::new(-10.0, 0.0, -15.0), 0.2);
        near(high, DVec3::new(10.0, 6.0, 15.0), 0.2);
        let eye = DVec3::new(0.0, 1.7, 0.0);
        let towards = |(at, normal): (&DVec3, &Vec3)| normal.as_dvec3().dot(eye - *at) > 0.0;
        assert!(hall.position.iter().zip(&hall.normal).all(towards));
    }

    #[test]
    fn overlap_is_four() {
        // There are n discs of area pi r^2 on a sphere of area 4 pi.
        let n = 5000;
        let area: f64 = sphere(n).radius.iter().map(|&r| PI * f64::from(r) * f64::from(r)).sum();
        assert!((area / (4.0 * PI) - 4.0).abs() < 1e-5);
    }

    #[test]
    fn cells_alternate() {
        // Four cells meet in a corner: opposite cells have the same colour, neighbours differ.
        let plane = checker_plane();
        let colour = |column: usize, row: usize| plane.colour[row * 256 + column];
        assert_eq!(colour(7, 7), colour(8, 8));
        assert_eq!(colour(7, 8), colour(8, 7));
        assert_ne!(colour(7, 7), colour(8, 7));
        // Each colour covers half of a ball.
        let ball = ball();
        let red = ball.colour.iter().filter(|c| c.y < 0.5).count();
        assert!(red.abs_diff(15_000) < 300, "{red}");
    }

    #[test]
    fn a_surfel_takes_31_bytes() {
        let size = |n| {
            let mut bytes = Vec::new();
            write(&sphere(n), &mut bytes).unwrap();
            bytes.len()
        };
        assert_eq!(size(20) - size(10), 310);
    }

    #[test]
    fn a_cloud_without_radii_is_refused() {
        let mut cloud = sphere(3);
        cloud.radius.clear();
        assert!(write(&cloud, &mut Vec::new()).is_err());
    }

    #[test]
    fn no_surfels_is_an_empty_model() {
        assert!(sphere(0).position.is_empty());
    }
}

//! Models of the thesis' sizes and motions, made by formula: its own (a wasp, an octopus, an ammonite and a shell from
//! scans) are not public.
//!
//! All are tubes around curves, with surfels spread evenly over the tubes' surface. The bytes are the same on every
//! computer: sines and powers come from `libm`.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use glam::{DVec3, Vec3};

use crate::model::Cloud;

/// Discs over each point of a surface, in the mean.
pub(super) const DISCS: f64 = 4.0;
/// Rings that a tube's area is summed over.
const RINGS: usize = 2000;

/// A colour as a file stores it: sRGB bytes.
type Rgb = [u8; 3];

/// A tube: centre and radius along s in [0, 1], and two colours in bands along it.
struct Tube {
    line: Box<dyn Fn(f64) -> (DVec3, f64)>,
    colours: [Rgb; 2],
    bands: f64,
}

impl Tube {
    fn new(colours: [Rgb; 2], bands: f64, line: impl Fn(f64) -> (DVec3, f64) + 'static) -> Self {
        Self { line: Box::new(line), colours, bands }
    }

    /// A spheroid from one point to another, `radius` thick in the middle.
    fn spheroid(from: DVec3, to: DVec3, radius: f64, colours: [Rgb; 2], bands: f64) -> Self {
        Self::new(colours, bands, move |s| (from.lerp(to, s), radius * 2.0 * libm::sqrt(s * (1.0 - s))))
    }

    /// Changes of centre and radius with s.
    fn slope(&self, s: f64) -> (DVec3, f64) {
        const STEP: f64 = 1e-5;
        let (low, high) = ((s - STEP).max(0.0), (s + STEP).min(1.0));
        let ((from, thin), (to, thick)) = ((self.line)(low), (self.line)(high));
        ((to - from) / (high - low), (thick - thin) / (high - low))
    }

    /// Area of the part before the end of each ring.
    fn areas(&self) -> Vec<f64> {
        let mut sum = 0.0;
        let ring = |i: usize| {
            let s = (i as f64 + 0.5) / RINGS as f64;
            let (along, out) = self.slope(s);
            sum += TAU * (self.line)(s).1 * libm::sqrt(along.length_squared() + out * out) / RINGS as f64;
            sum
        };
        (0..RINGS).map(ring).collect()
    }

    /// Appends `n` surfels of `radius`, on a spiral that turns by the golden angle.
    fn spread(&self, n: usize, radius: f64, cloud: &mut Cloud) {
        let areas = self.areas();
        let golden = PI * (3.0 - libm::sqrt(5.0));
        for i in 0..n {
            let before = (i as f64 + 0.5) / n as f64 * areas[RINGS - 1];
            let ring = areas.partition_point(|&area| area < before).min(RINGS - 1);
            let start = if ring == 0 { 0.0 } else { areas[ring - 1] };
            let s = (ring as f64 + (before - start) / (areas[ring] - start)) / RINGS as f64;
            let (centre, thick) = (self.line)(s);
            let (along, out) = self.slope(s);
            let ahead = along.normalize();
            let aside = ahead.cross(if ahead.z.abs() < 0.9 { DVec3::Z } else { DVec3::X }).normalize();
            let (sin, cos) = libm::sincos(i as f64 * golden);
            let outwards = aside * cos + ahead.cross(aside) * sin;
            let colour = self.colours[(s * self.bands) as usize % 2];
            cloud.position.push(centre + outwards * thick);
            cloud.normal.push((outwards * along.length() - ahead * out).normalize().as_vec3());
            cloud.radius.push(radius as f32);
            cloud.colour.push(Vec3::from_array(colour.map(|c| f32::from(c) / 255.0)));
        }
    }
}

/// A model, and where the surfels of its parts lie in it.
pub(super) struct Parts {
    pub(super) cloud: Cloud,
    pub(super) ranges: Vec<Range<usize>>,
}

/// `n` surfels over all tubes, by area.
fn model(n: usize, tubes: &[Tube]) -> Parts {
    let areas: Vec<f64> = tubes.iter().map(|tube| tube.areas()[RINGS - 1]).collect();
    let whole: f64 = areas.iter().sum();
    let radius = libm::sqrt(DISCS * whole / (n as f64 * PI));
    let mut parts = Parts { cloud: Cloud::default(), ranges: Vec::new() };
    let mut area = 0.0;
    for (tube, own) in tubes.iter().zip(areas) {
        area += own;
        let from = parts.cloud.position.len();
        let to = ((area / whole * n as f64).round() as usize).min(n);
        tube.spread(to - from, radius, &mut parts.cloud);
        parts.ranges.push(from..to);
    }
    parts
}

/// The surfels of a part alone.
pub(super) fn part(cloud: &Cloud, range: Range<usize>) -> Cloud {
    Cloud {
        position: cloud.position[range.clone()].to_vec(),
        normal: cloud.normal[range.clone()].to_vec(),
        radius: cloud.radius[range.clone()].to_vec(),
        colour: cloud.colour[range].to_vec(),
        ..Cloud::default()
    }
}

/// The model with other radii: so many discs over each point of its surface.
pub(super) fn with_discs(mut cloud: Cloud, discs: f64) -> Cloud {
    let factor = libm::sqrt(discs / DISCS) as f32;
    cloud.radius.iter_mut().for_each(|radius| *radius *= factor);
    cloud
}

/// An insect of spheroids with six thin legs and two feelers, 1.2 long, along x.
pub(super) fn wasp(n: usize) -> Cloud {
    const YELLOW: Rgb = [236, 188, 40];
    const BLACK: Rgb = [36, 30, 28];
    let at = DVec3::new;
    let mut tubes = vec![
        Tube::spheroid(at(-0.62, 0.0, 0.0), at(-0.04, 0.02, 0.0), 0.17, [YELLOW, BLACK], 9.0),
        Tube::spheroid(at(-0.1, 0.02, 0.0), at(0.1, 0.02, 0.0), 0.03, [BLACK, BLACK], 1.0),
        Tube::spheroid(at(0.02, 0.02, 0.0), at(0.36, 0.04, 0.0), 0.14, [BLACK, YELLOW], 3.0),
        Tube::spheroid(at(0.34, 0.04, 0.0), at(0.58, 0.02, 0.0), 0.11, [YELLOW, BLACK], 2.0),
    ];
    for i in 0..6 {
        let (side, place) = (if i % 2 == 0 { 1.0 } else { -1.0 }, f64::from(i / 2));
        tubes.push(Tube::new([BLACK, YELLOW], 6.0, move |s| {
            let out = at(0.08 + 0.1 * place + 0.16 * (place - 1.0) * s, -0.5 * s, side * (0.1 + 0.32 * s));
            (out + at(0.0, 0.35 * s * (1.0 - s), 0.0), 0.014)
        }));
    }
    for side in [1.0, -1.0] {
        tubes.push(Tube::new([BLACK, BLACK], 1.0, move |s| {
            (at(0.52 + 0.25 * s, 0.06 + 0.3 * s * (1.0 - 0.4 * s), side * (0.04 + 0.15 * s)), 0.009)
        }));
    }
    model(n, &tubes).cloud
}

/// A body with eight tentacles in the plane of x and y that become thin; the parts after the first are the tentacles.
pub(super) fn octopus(n: usize) -> Parts {
    const RED: Rgb = [196, 70, 52];
    const PALE: Rgb = [232, 190, 168];
    let mut tubes =
        vec![Tube::spheroid(DVec3::new(0.0, 0.0, -0.3), DVec3::new(0.0, 0.0, 0.45), 0.33, [RED, PALE], 5.0)];
    for i in 0..8 {
        let angle = TAU * (f64::from(i) + 0.5) / 8.0;
        tubes.push(Tube::new([RED, PALE], 12.0, move |s| {
            let turn = angle + 0.35 * libm::sin(5.0 * s + f64::from(i));
            let reach = 0.25 + 0.95 * s;
            let place = DVec3::new(reach * libm::cos(turn), reach * libm::sin(turn), -0.2 + 0.25 * s * s);
            (place, (0.11 * (1.0 - s) + 0.008) * libm::sqrt(((1.0 - s) / 0.01).min(1.0)))
        }));
    }
    model(n, &tubes)
}

/// A flat spiral of two and a half turns, with ribs, about 1.2 across.
pub(super) fn ammonite(n: usize) -> Cloud {
    let spiral = Tube::new([[206, 160, 104], [150, 104, 62]], 40.0, |s| {
        let turn = 2.5 * TAU * s;
        let reach = 0.07 * libm::exp(0.125 * turn);
        let place = DVec3::new(reach * libm::cos(turn), reach * libm::sin(turn), 0.0);
        (place, reach * 0.42 * (1.0 + 0.05 * libm::cos(24.0 * turn)))
    });
    model(n, &[spiral]).cloud
}

/// A spire of seven turns about the axis x, 1.1 long.
pub(super) fn shell(n: usize) -> Cloud {
    let spire = Tube::new([[238, 224, 200], [176, 122, 96]], 56.0, |s| {
        let turn = 7.0 * TAU * s;
        let size = 0.03 + 0.97 * s;
        let place =
            DVec3::new(0.5 - 1.1 * s * (0.4 + 0.6 * s), 0.14 * size * libm::cos(turn), 0.14 * size * libm::sin(turn));
        (place, 0.15 * size)
    });
    model(n, &[spire]).cloud
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_have_the_surfels_that_are_asked_for() {
        for n in [100, 4_961] {
            let Parts { cloud, ranges } = octopus(n);
            assert_eq!(ranges.len(), 9);
            assert_eq!((ranges[0].start, ranges[8].end), (0, n));
            for cloud in [wasp(n), cloud, ammonite(n), shell(n)] {
                assert_eq!([cloud.position.len(), cloud.normal.len(), cloud.radius.len(), cloud.colour.len()], [n; 4]);
                assert!(cloud.position.iter().all(|p| p.is_finite() && p.length() < 2.0));
                assert!(cloud.normal.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
            }
        }
    }

    /// A spheroid of revolution: area by the closed form, surfels by area, normals by the gradient.
    #[test]
    fn surfels_lie_evenly_on_a_tube() {
        let (half, radius) = (1.0_f64, 0.5_f64);
        let tube = Tube::spheroid(DVec3::X * -half, DVec3::X * half, radius, [[0; 3]; 2], 1.0);
        let e = (1.0 - radius * radius / (half * half)).sqrt();
        let area = TAU * radius * radius * (1.0 + half / (radius * e) * e.asin());
        let got = tube.areas()[RINGS - 1];
        assert!((got / area - 1.0).abs() < 1e-3, "{got}, not {area}");
        let cloud = model(20_000, &[tube]).cloud;
        assert!((f64::from(cloud.radius[0]) / (DISCS * area / (20_000.0 * PI)).sqrt() - 1.0).abs() < 1e-3);
        for (p, n) in cloud.position.iter().zip(&cloud.normal) {
            let gradient = DVec3::new(p.x / (half * half), p.y / (radius * radius), p.z / (radius * radius));
            assert!(gradient.normalize().dot(n.as_dvec3()) > 0.999, "{p}: {n}");
        }
        // Half of the surfels are in the half with x > 0, and a quarter has y and z > 0.
        let count = |inside: fn(&DVec3) -> bool| cloud.position.iter().filter(|p| inside(p)).count();
        assert!(count(|p| p.x > 0.0).abs_diff(10_000) < 5);
        assert!(count(|p| p.y > 0.0 && p.z > 0.0).abs_diff(5_000) < 50);
    }

    #[test]
    fn parts_and_radii() {
        let Parts { cloud, ranges } = octopus(1000);
        let alone = part(&cloud, ranges[3].clone());
        assert_eq!(alone.position[0], cloud.position[ranges[3].start]);
        assert_eq!(alone.radius.len(), ranges[3].len());
        assert!((with_discs(alone.clone(), 16.0).radius[0] / alone.radius[0] - 2.0).abs() < 1e-6);
    }
}

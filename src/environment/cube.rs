//! An environment as six pictures, filtered to several widths (docs/math.md, section 14).
//!
//! Twin of the look-up: shaders/common/environment.wgsl.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::lat_long::LatLong;
use crate::math::fast;

/// A map on the faces of a cube, in levels. Level 0 is the map itself. Level k has 2^k times fewer pixels along an
/// edge, and is the map under a kernel whose standard deviation is 1.6 * 2^k / face radians, interpolation included.
#[derive(Clone, Debug, PartialEq)]
pub struct Cube {
    face: usize,
    texels: Vec<f32>,
}

/// Total standard deviation of level 1 and of all after it, in edges of a pixel in the middle of a face: `2 / face`
/// radians, doubled from level to level.
pub(crate) const DEVIATION: f32 = 0.8;
/// Variance of the interpolation between pixels, squares of an edge of a pixel.
const OF_INTERPOLATION: f64 = 1.0 / 6.0;
/// Least and greatest number of pixels along an edge of level 0.
const LEAST: usize = 16;
const MOST: usize = 1024;
/// Pixels along an edge of the last level.
pub(crate) const LAST_FACE: usize = 4;
/// Reach of the kernel, standard deviations.
const REACH: f64 = 3.5;

impl Cube {
    /// Pixels along an edge of level 0, a power of two.
    pub const fn face(&self) -> usize {
        self.face
    }

    /// For each level, for each face (+x, -x, +y, -y, +z, -z), its rows: red, green and blue. A border of one pixel
    /// around a face continues it.
    pub fn texels(&self) -> &[f32] {
        &self.texels
    }

    /// Number of levels of a cube whose faces have `face` pixels along an edge.
    const fn levels(face: usize) -> usize {
        (face / LAST_FACE).trailing_zeros() as usize + 1
    }

    /// Pixels of the map are 2 pi / width wide, those in the middle of a face 2 / face.
    fn face_of(map: &LatLong) -> usize {
        (map.width() * 5 / 16).next_power_of_two().clamp(LEAST, MOST)
    }

    /// Memory of the cube of `map`.
    pub(super) fn bytes_of(map: &LatLong) -> u64 {
        let face = Self::face_of(map);
        (0..Self::levels(face)).map(|level| 72 * ((face >> level) as u64 + 2).pow(2)).sum()
    }

    pub(super) fn new(map: &LatLong) -> Self {
        let face = Self::face_of(map);
        let mut pyramid = vec![map.clone()];
        while let Some(half) = pyramid.last().and_then(LatLong::halved) {
            pyramid.push(half);
        }
        // Pixels of the map that are smaller than those of the cube are averaged.
        let finest = pyramid.iter().position(|map| map.width() <= 4 * face).unwrap_or(0);
        let mut texels = Vec::new();
        for level in 0..Self::levels(face) {
            let edge = face >> level;
            let texel = 2.0 / edge as f64;
            let total = f64::from(DEVIATION * DEVIATION);
            let deviation = texel * (total - OF_INTERPOLATION).sqrt();
            let fits = |map: &LatLong| TAU / map.width() as f64 > deviation / 1.5;
            let coarse = pyramid.iter().position(fits).unwrap_or(pyramid.len()).saturating_sub(1);
            let filter = Filter::new(&pyramid[coarse.max(finest)], deviation);
            let side = edge + 2;
            let rows: Vec<Vec<f32>> = (0..6 * side)
                .into_par_iter()
                .map(|row| {
                    let (face, y) = (row / side, row % side);
                    (0..side)
                        .flat_map(|x| {
                            let [u, v] = [x, y].map(|i| (i as f64 - 0.5) * texel - 1.0);
                            let towards = direction(face, u, v);
                            let seen = if level == 0 { pyramid[finest].radiance(towards) } else { filter.at(towards) };
                            seen.as_vec3().to_array()
                        })
                        .collect()
                })
                .collect();
            texels.extend(rows.into_iter().flatten());
        }
        Self { face, texels }
    }

    /// The mean radiance around the direction `towards`, of any length, under a kernel with `variance` radians^2.
    #[inline]
    pub fn radiance(&self, towards: Vec3, variance: f32) -> Vec3 {
        let edge = 2.0 * DEVIATION * 2.0 / self.face as f32;
        let ratio = variance * (1.0 / (edge * edge));
        let last = Self::levels(self.face) - 1;
        let mut level = 0;
        let mut share = ratio;
        if ratio >= 1.0 {
            let doublings = 0.5 * fast::log2(ratio);
            let doublings = if doublings < last as f32 { doublings as usize } else { last };
            level = 1 + doublings;
            share = (ratio * (1.0 / (1_u32 << (2 * doublings)) as f32) - 1.0) * (1.0 / 3.0);
        }
        if level >= last {
            level = last;
            share = 0.0;
        }
        let sharp = self.of_level(level, towards);
        if share == 0.0 {
            return sharp;
        }
        let wide = self.of_level(level + 1, towards);
        sharp + (wide - sharp) * share
    }

    fn of_level(&self, level: usize, towards: Vec3) -> Vec3 {
        let edge = self.face >> level;
        let side = edge + 2;
        let size = towards.abs();
        let [axis, first, second] = if size.x >= size.y && size.x >= size.z {
            [0, 1, 2]
        } else if size.y >= size.z {
            [1, 2, 0]
        } else {
            [2, 0, 1]
        };
        let over = 1.0 / size[axis];
        let half = 0.5 * edge as f32;
        let x = (towards[first] * over + 1.0) * half + 0.5;
        let y = (towards[second] * over + 1.0) * half + 0.5;
        // A direction without length has no place: it gets the first pixel.
        let place = |v: f32| if v >= 0.0 { (v as usize).min(edge) } else { 0 };
        let (column, row) = (place(x), place(y));
        let (right, lower) = (x - column as f32, y - row as f32);
        let face = 2 * axis + usize::from(towards[axis] < 0.0);
        let before: usize = (0..level).map(|level| 6 * ((self.face >> level) + 2).pow(2)).sum();
        let at = 3 * (before + (face * side + row) * side + column);
        let texel = |at: usize| Vec3::from_slice(&self.texels[at..]);
        let upper = texel(at) + (texel(at + 3) - texel(at)) * right;
        let below = at + 3 * side;
        let under = texel(below) + (texel(below + 3) - texel(below)) * right;
        upper + (under - upper) * lower
    }
}

/// The direction of a point of face `face`, with coordinates in [-1, 1] along the next two axes; of length 1.
fn direction(face: usize, u: f64, v: f64) -> DVec3 {
    let mut out = DVec3::ZERO;
    let axis = face / 2;
    out[axis] = if face.is_multiple_of(2) { 1.0 } else { -1.0 };
    out[(axis + 1) % 3] = u;
    out[(axis + 2) % 3] = v;
    out.normalize()
}

/// The kernel exp((cos(angle) - 1) / deviation^2) on the sphere, over the pixels of a map.
struct Filter<'a> {
    map: &'a LatLong,
    deviation: f64,
    /// Sine and cosine of the longitude of each column.
    columns: Vec<(f64, f64)>,
    /// Sine and cosine of the polar angle of each row.
    rows: Vec<(f64, f64)>,
}

impl<'a> Filter<'a> {
    fn new(map: &'a LatLong, deviation: f64) -> Self {
        let (w, h) = (map.width(), map.height());
        let longitude = |x: usize| libm::sincos(((x as f64 + 0.5) / w as f64 - 0.5) * TAU);
        let polar = |y: usize| libm::sincos((y as f64 + 0.5) / h as f64 * PI);
        Self { map, deviation, columns: (0..w).map(longitude).collect(), rows: (0..h).map(polar).collect() }
    }

    /// The mean of the map around the unit direction `towards`.
    fn at(&self, towards: DVec3) -> DVec3 {
        let (w, h) = (self.map.width(), self.map.height());
        let reach = (REACH * self.deviation).min(PI);
        let least = libm::cos(reach);
        let polar = libm::acos(towards.y.clamp(-1.0, 1.0));
        let middle = (0.5 + libm::atan2(towards.x, -towards.z) / TAU) * w as f64;
        let sine = libm::sin(polar);
        let row_of = |angle: f64| (angle / PI * h as f64).floor().clamp(0.0, (h - 1) as f64) as usize;
        let over = std::f64::consts::LOG2_E / (self.deviation * self.deviation);
        let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
        for y in row_of(polar - reach)..=row_of(polar + reach) {
            let (of_row, height) = self.rows[y];
            // Longitudes within reach: cos(reach) <= cos(difference) sin sin + cos cos.
            let limit = (least - height * towards.y) / (of_row * sine);
            let half = if limit > -1.0 { libm::acos(limit.min(1.0)) } else { PI };
            let half = (half / TAU * w as f64).ceil() + 1.0;
            let (first, count) = if 2.0 * half >= w as f64 {
                (0, w)
            } else {
                ((middle - half).floor().rem_euclid(w as f64) as usize % w, 2 * half as usize + 1)
            };
            let row = &self.map.pixels()[y * w..][..w];
            // Around the seam the columns begin again.
            let columns = (first..w.min(first + count)).chain(0..(first + count).saturating_sub(w));
            for x in columns {
                let (sin, cos) = self.columns[x];
                let cosine = of_row * (sin * towards.x - cos * towards.z) + height * towards.y;
                if cosine >= least {
                    let share = of_row * f64::from(fast::exp2(((cosine - 1.0) * over) as f32));
                    sum += Vec3::from(row[x]).as_dvec3() * share;
                    weight += share;
                }
            }
        }
        if weight > 0.0 { sum / weight } else { self.map.radiance(towards) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(width: usize, of: impl Fn(DVec3) -> DVec3) -> LatLong {
        let pixel = |i: usize| {
            let longitude = ((i % width) as f64 + 0.5 - 0.5 * width as f64) / width as f64 * TAU;
            let polar = ((i / width) as f64 + 0.5) / (width / 2) as f64 * PI;
            let flat = polar.sin();
            of(DVec3::new(flat * longitude.sin(), polar.cos(), -flat * longitude.cos())).as_vec3().to_array()
        };
        LatLong::new(width, (0..width * width / 2).map(pixel).collect()).unwrap()
    }

    /// Directions that lie evenly.
    fn directions() -> impl Iterator<Item = DVec3> {
        (0..400).map(|i| {
            let y = 1.0 - (2.0 * f64::from(i) + 1.0) / 400.0;
            let turn = f64::from(i) * 2.399_963;
            DVec3::new((1.0 - y * y).sqrt() * turn.cos(), y, (1.0 - y * y).sqrt() * turn.sin())
        })
    }

    /// On the sphere a kernel of variance v shrinks the harmonics of degree n by exp(-n (n + 1) v / 2) if it is narrow.
    #[test]
    fn levels_are_as_wide_as_asked_for() {
        let linear = |d: DVec3| DVec3::ONE + d;
        let second = |d: DVec3| DVec3::splat(1.0) + DVec3::new(d.x * d.y, d.y * d.z, 1.5 * d.z * d.z - 0.5);
        let cubes = [Cube::new(&map(128, linear)), Cube::new(&map(128, second))];
        assert_eq!(cubes[0].face(), 64);
        for deviation in [0.0_f64, 0.02, 0.05, 0.07, 0.1, 0.16, 0.25] {
            let variance = deviation * deviation;
            let kept = [(-variance).exp(), (-3.0 * variance).exp()];
            for d in directions() {
                let want = [DVec3::ONE + d * kept[0], DVec3::ONE + (second(d) - 1.0) * kept[1]];
                for (cube, want) in cubes.iter().zip(want) {
                    let got = cube.radiance(2.5 * d.as_vec3(), variance as f32).as_dvec3();
                    // A mixture of two kernels is linear in the variance where one kernel is exponential.
                    let most = 0.01 + 0.2 * variance;
                    assert!((got - want).abs().max_element() < most, "{deviation} at {d}: {got}, not {want}");
                }
            }
        }
    }

    /// Anything farther than the last level is the last level, and no direction is outside.
    #[test]
    fn there_is_radiance_in_every_direction() {
        let cube = Cube::new(&map(64, |d| DVec3::new(1.0, 2.0, 3.0) + 0.0 * d));
        for d in directions().chain([DVec3::X, DVec3::NEG_Y, DVec3::Z, DVec3::ONE, DVec3::new(1.0, -1.0, 0.0)]) {
            for variance in [0.0, 0.3, 1e6, f32::INFINITY] {
                let got = cube.radiance(d.as_vec3(), variance);
                assert!(got.abs_diff_eq(Vec3::new(1.0, 2.0, 3.0), 1e-5), "{d}, {variance}: {got}");
            }
        }
        // No direction has no value, and no panic.
        let _ = [cube.radiance(Vec3::ZERO, 0.0), cube.radiance(Vec3::NAN, f32::NAN)];
        assert_eq!(4 * cube.texels().len() as u64, Cube::bytes_of(&map(64, DVec3::abs)));
    }

    /// The filter does not see the edges of faces or the poles.
    #[test]
    fn neighbouring_directions_show_the_same() {
        let waves = |d: DVec3| DVec3::splat(0.5 + 0.5 * (9.0 * d.x).sin() * (7.0 * d.y + 2.0 * d.z).cos());
        let cube = Cube::new(&map(256, waves));
        let edges = [DVec3::new(1.0, 1.0, 0.3), DVec3::new(-0.2, 1.0, -1.0), DVec3::new(1.0, -1.0, 1.0), DVec3::Y];
        for edge in edges {
            for step in [DVec3::new(1e-4, 0.0, 0.0), DVec3::new(0.0, -1e-4, 0.0), DVec3::new(0.0, 0.0, 1e-4)] {
                for variance in [0.0, 1e-4, 1e-2] {
                    let [a, b] = [edge - step, edge + step].map(|d| cube.radiance(d.as_vec3(), variance).x);
                    assert!((a - b).abs() < 0.01, "{edge} along {step}, variance {variance}: {a} and {b}");
                }
            }
        }
    }
}

//! An environment as a light: directions drawn by brightness, and the light that surfaces receive without shadows as
//! nine harmonics (docs/math.md, section 18).
//!
//! As a light each pixel is even over its part of the sphere. Interpolation would give dark pixels beside a bright one
//! a share of its light, and directions that are drawn seldom would then bring much.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use super::lat_long::LatLong;

/// The brightness of a map, row by row, and its harmonics.
#[derive(Debug)]
pub(super) struct Brightness {
    /// Running sums over the rows of brightness times solid angle.
    rows: Vec<f64>,
    /// Light of a white surface, as `ShadingLight::Harmonics` has it.
    terms: [DVec3; 9],
}

/// The mean of the channels: the light of a direction over its brightness is at most 3 in each.
fn brightness(pixel: [f32; 3]) -> f64 {
    Vec3::from(pixel).as_dvec3().element_sum() / 3.0
}

/// The polar angle where row `y` of `map` begins.
fn polar(map: &LatLong, y: usize) -> f64 {
    PI * y as f64 / map.height() as f64
}

impl Brightness {
    pub(super) fn new(map: &LatLong) -> Self {
        let columns = Columns::of(map.width());
        let (mut rows, mut total) = (Vec::with_capacity(map.height()), 0.0);
        let mut moments = [DVec3::ZERO; 9];
        for (y, row) in map.pixels().chunks_exact(map.width()).enumerate() {
            let (upper, lower) = (polar(map, y), polar(map, y + 1));
            let height = libm::cos(upper) - libm::cos(lower);
            total += row.iter().map(|&pixel| brightness(pixel)).sum::<f64>() * height * columns.width;
            rows.push(total);
            columns.add(row, &Row::of(upper, lower), &mut moments);
        }
        let [one, x, y, z, xy, yz, xz, difference, pole] = moments;
        let (first, second) = (1.0 / TAU, 15.0 / (16.0 * PI));
        let terms = [
            one * (0.25 / PI),
            x * first,
            y * first,
            z * first,
            xy * second,
            yz * second,
            xz * (0.25 * second),
            difference * (0.25 * second),
            pole * (second / 12.0),
        ];
        Self { rows, terms }
    }

    /// Is there no light at all?
    pub(super) fn is_dark(&self) -> bool {
        self.total() == 0.0
    }

    fn total(&self) -> f64 {
        self.rows.last().copied().unwrap_or_default()
    }

    pub(super) const fn terms(&self) -> &[DVec3; 9] {
        &self.terms
    }

    /// A direction of `map`, which it was made of, and the light from there over its density, of a white surface that
    /// faces it. Equal areas of the unit square become equal parts of the whole brightness.
    pub(super) fn draw(&self, map: &LatLong, [down, across]: [f64; 2]) -> (DVec3, DVec3) {
        let (w, h) = (map.width(), map.height());
        let wanted = down * self.total();
        let y = self.rows.partition_point(|&sum| sum <= wanted).min(h - 1);
        let before = y.checked_sub(1).map_or(0.0, |above| self.rows[above]);
        let share = ((wanted - before) / (self.rows[y] - before)).clamp(0.0, 1.0);
        let (upper, lower) = (libm::cos(polar(map, y)), libm::cos(polar(map, y + 1)));
        let height = upper + (lower - upper) * share;

        let row = &map.pixels()[y * w..][..w];
        let of_row: f64 = row.iter().map(|&pixel| brightness(pixel)).sum();
        let (mut left, mut column) = (across * of_row, 0);
        for (x, &pixel) in row.iter().enumerate() {
            let own = brightness(pixel);
            if own > 0.0 {
                // The last bright one takes what rounding leaves.
                column = x;
                if left < own {
                    break;
                }
                left -= own;
            }
        }
        let own = brightness(row[column]);
        let x = column as f64 + (left / own).clamp(0.0, 1.0);
        let (sin, cos) = libm::sincos((x / w as f64 - 0.5) * TAU);
        let flat = (1.0 - height * height).max(0.0).sqrt();
        let light = Vec3::from(row[column]).as_dvec3() * (self.total() / (PI * own));
        (DVec3::new(flat * sin, height, -flat * cos), light)
    }
}

/// Integrals over the polar angle of a row, with the sine of the solid angle.
struct Row {
    one: f64,
    /// The integral of the height.
    height: f64,
    /// The same of the distance from the axis, of that times the height, and of its square.
    flat: f64,
    flat_height: f64,
    flat_flat: f64,
    /// The integral of 3 height^2 - 1.
    pole: f64,
}

impl Row {
    fn of(upper: f64, lower: f64) -> Self {
        let ([s0, c0], [s1, c1]) = (sincos(upper), sincos(lower));
        let turn = |sin: f64, cos: f64, angle: f64| 0.5 * (angle - sin * cos);
        Self {
            one: c0 - c1,
            height: 0.5 * (s1 * s1 - s0 * s0),
            flat: turn(s1, c1, lower) - turn(s0, c0, upper),
            flat_height: (s1.powi(3) - s0.powi(3)) / 3.0,
            flat_flat: (c0 - c1) - (c0.powi(3) - c1.powi(3)) / 3.0,
            pole: (c1 - c1.powi(3)) - (c0 - c0.powi(3)),
        }
    }
}

fn sincos(angle: f64) -> [f64; 2] {
    libm::sincos(angle).into()
}

/// Integrals over the longitude of each column of the direction's parts on the equator.
struct Columns {
    width: f64,
    /// The integrals of x, z, 2 x z and x^2 - z^2.
    parts: Vec<[f64; 4]>,
}

impl Columns {
    fn of(count: usize) -> Self {
        let at = |x: usize| {
            let longitude = (x as f64 / count as f64 - 0.5) * TAU;
            (sincos(longitude), sincos(2.0 * longitude))
        };
        let part = |x: usize| {
            let (([s0, c0], [ss0, cc0]), ([s1, c1], [ss1, cc1])) = (at(x), at(x + 1));
            [c0 - c1, s0 - s1, 0.5 * (cc1 - cc0), 0.5 * (ss0 - ss1)]
        };
        Self { width: TAU / count as f64, parts: (0..count).map(part).collect() }
    }

    /// Adds the integrals of a row's radiance times 1, x, y, z, x y, y z, 2 x z, x^2 - z^2 and 3 y^2 - 1.
    fn add(&self, row: &[[f32; 3]], of: &Row, moments: &mut [DVec3; 9]) {
        let (mut even, mut sums) = (DVec3::ZERO, [DVec3::ZERO; 4]);
        for (&pixel, parts) in row.iter().zip(&self.parts) {
            let radiance = Vec3::from(pixel).as_dvec3();
            even += radiance * self.width;
            for (sum, part) in sums.iter_mut().zip(parts) {
                *sum += radiance * *part;
            }
        }
        let [x, z, xz, difference] = sums;
        let added = [
            even * of.one,
            x * of.flat,
            even * of.height,
            z * of.flat,
            x * of.flat_height,
            z * of.flat_height,
            xz * of.flat_flat,
            difference * of.flat_flat,
            even * of.pole,
        ];
        for (sum, more) in moments.iter_mut().zip(added) {
            *sum += more;
        }
    }
}

/// The harmonics of a map that is turned about +y by the angle with this sine and cosine.
pub(super) fn turned(terms: &[DVec3; 9], (sin, cos): (f64, f64)) -> [DVec3; 9] {
    // x + i z turns by the angle, (x + i z)^2 by twice of it.
    let pair = |a: DVec3, b: DVec3, sin: f64, cos: f64| [a * cos + b * sin, b * cos - a * sin];
    let (sin_2, cos_2) = (2.0 * sin * cos, cos * cos - sin * sin);
    let [one, x, y, z, xy, yz, xz, difference, pole] = *terms;
    let [x, z] = pair(x, z, sin, cos);
    let [xy, yz] = pair(xy, yz, sin, cos);
    let [difference, xz] = pair(difference, xz, sin_2, cos_2);
    [one, x, y, z, xy, yz, xz, difference, pole]
}

#[cfg(test)]
mod tests;

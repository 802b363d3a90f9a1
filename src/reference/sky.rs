//! The environment as a light: a point of it for a sample, and its smooth light where there are no shadows.
//!
//! Each pixel of its picture is even over its part of the sphere. This is code of its own beside that of the passes:
//! columns are chosen before rows, from tables, and the smooth light follows from sums over a lattice of directions.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3, Vec3};

use crate::environment::{Environment, LatLong};
use crate::shading::ShadingLight;

/// The environment of a scene that lights it.
#[derive(Debug)]
pub(super) struct Sky<'a> {
    map: &'a LatLong,
    /// The world's axes from the picture's.
    turn: DMat3,
    intensity: f64,
    /// Power of all columns up to each, each by its colours' sum.
    columns: Vec<f64>,
    /// Column by column, power of all rows up to each.
    rows: Vec<f64>,
}

impl<'a> Sky<'a> {
    pub(super) fn new(environment: &'a Environment) -> Self {
        let map = environment.map();
        let [width, height] = [map.width(), map.height()];
        let (mut columns, mut rows) = (Vec::with_capacity(width), Vec::with_capacity(width * height));
        let solid: Vec<f64> = (0..height).map(|y| solid_angle(map, y)).collect();
        let mut all = 0.0;
        for x in 0..width {
            let mut column = 0.0;
            for (y, solid) in solid.iter().enumerate() {
                column += power(map.pixels()[y * width + x]) * solid;
                rows.push(column);
            }
            all += column;
            columns.push(all);
        }
        let turn = DMat3::from_rotation_y(environment.rotation);
        Self { map, turn, intensity: environment.intensity, columns, rows }
    }

    /// A light of the directions that are drawn in proportion to brightness, for a point of the unit square; and the
    /// direction.
    pub(super) fn light(&self, [across, down]: [f64; 2]) -> (ShadingLight, DVec3) {
        let (x, right) = choose(&self.columns, across);
        let height = self.map.height();
        let (y, below) = choose(&self.rows[x * height..][..height], down);
        let longitude = TAU * ((x as f64 + right) / self.map.width() as f64 - 0.5);
        // Equal heights are equal areas of the sphere (Archimedes).
        let [top, bottom] = [y, y + 1].map(|row| libm::cos(PI * row as f64 / height as f64));
        let rise = top * (1.0 - below) + bottom * below;
        let ring = ((1.0 - rise) * (1.0 + rise)).sqrt();
        let towards = self.turn * DVec3::new(ring * libm::sin(longitude), rise, -ring * libm::cos(longitude));
        let pixel = self.map.pixels()[y * self.map.width() + x];
        let all = self.columns[self.columns.len() - 1];
        // A Lambert surface shows the mean of radiance times cosine over pi.
        let colour = Vec3::from(pixel).as_dvec3() * (self.intensity * all / (PI * power(pixel)));
        (ShadingLight::Directional { towards: towards.as_vec3(), colour: colour.as_vec3(), shadows: true }, towards)
    }

    /// Its light without shadows: the sum of L (1/4 + n.d/2 + 5/32 (3 (n.d)^2 - 1)) over all directions d, over pi.
    pub(super) fn smooth(environment: &Environment) -> ShadingLight {
        /// Rows of the lattice, at the least.
        const LEAST: usize = 360;
        let map = environment.map();
        let parts = LEAST.div_ceil(map.height());
        let [columns, rows] = [map.width(), map.height()].map(|pixels| parts * pixels);
        let turn = DMat3::from_rotation_y(environment.rotation);
        // Of the channels: the sum, and the sums with d and with the columns of d d^T.
        let (mut all, mut first, mut second) = (DVec3::ZERO, [DVec3::ZERO; 3], [DMat3::ZERO; 3]);
        for row in 0..rows {
            let (ring, rise) = libm::sincos(PI * (row as f64 + 0.5) / rows as f64);
            let [top, bottom] = [row, row + 1].map(|row| libm::cos(PI * row as f64 / rows as f64));
            let solid = (top - bottom) * TAU / columns as f64;
            let pixels = &map.pixels()[row / parts * map.width()..][..map.width()];
            for column in 0..columns {
                let pixel = pixels[column / parts];
                if pixel == [0.0; 3] {
                    continue;
                }
                let (sin, cos) = libm::sincos(TAU * ((column as f64 + 0.5) / columns as f64 - 0.5));
                let towards = turn * DVec3::new(ring * sin, rise, -ring * cos);
                let light = pixel.map(|channel| f64::from(channel) * solid);
                all += DVec3::from(light);
                for c in 0..3 {
                    let weighted = towards * light[c];
                    first[c] += weighted;
                    second[c] += DMat3::from_cols(weighted * towards.x, weighted * towards.y, weighted * towards.z);
                }
            }
        }
        let scale = environment.intensity / PI;
        let linear = |axis: usize| DVec3::from([0, 1, 2].map(|c: usize| first[c][axis])) * (scale / 2.0);
        let product = |a: usize, b: usize| DVec3::from([0, 1, 2].map(|c: usize| second[c].col(a)[b]));
        let quadratic = scale * 15.0 / 32.0;
        let terms = [
            all * (scale / 4.0),
            linear(0),
            linear(1),
            linear(2),
            product(0, 1) * (2.0 * quadratic),
            product(1, 2) * (2.0 * quadratic),
            product(2, 0) * quadratic,
            (product(0, 0) - product(2, 2)) * (quadratic / 2.0),
            (product(1, 1) - all / 3.0) * (quadratic / 2.0),
        ];
        ShadingLight::Harmonics { terms: terms.map(DVec3::as_vec3) }
    }
}

fn power(pixel: [f32; 3]) -> f64 {
    pixel.map(f64::from).iter().sum()
}

/// Solid angle of a pixel in row `y`.
fn solid_angle(map: &LatLong, y: usize) -> f64 {
    let [top, bottom] = [y, y + 1].map(|row| libm::cos(PI * row as f64 / map.height() as f64));
    (top - bottom) * TAU / map.width() as f64
}

/// The entry of running sums that holds the share `share` of all, and the share of the entry that is before.
fn choose(sums: &[f64], share: f64) -> (usize, f64) {
    let wanted = share * sums[sums.len() - 1];
    let entry = sums.partition_point(|&sum| sum <= wanted).min(sums.len() - 1);
    let before = if entry == 0 { 0.0 } else { sums[entry - 1] };
    (entry, ((wanted - before) / (sums[entry] - before)).clamp(0.0, 1.0))
}

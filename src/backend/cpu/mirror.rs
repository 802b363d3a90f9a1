//! What pixels mirror of the surroundings (docs/math.md, section 14), as part of pass `resolve`.
//!
//! In: a tile's sums. Out: a colour that is added to that of lights. Order-free.

use glam::Mat3;

use super::tiles::{LANES, Lanes, STRIDE, TileRect};
use super::values::unit;
use crate::environment::Surroundings;
use crate::frame::Raster;
use crate::shading::mirrored;

/// The sums of a pixel's row, channel by channel, and of the row that makes a pair with it.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend::cpu) struct Rows<'a> {
    pub own: &'a [f32],
    /// Empty where the tile has no such row.
    beside: &'a [f32],
    /// False where the sums of other pixels are not of the same layer.
    has_neighbours: bool,
}

impl<'a> Rows<'a> {
    /// Row `y` of `sums`, whose rows have `length` floats.
    #[inline(always)]
    pub(in crate::backend::cpu) fn new(sums: &'a [f32], length: usize, y: usize, tile: &TileRect) -> Self {
        let row = |y: usize| &sums[y * length..][..length];
        let beside = if y ^ 1 < tile.height { row(y ^ 1) } else { &[] };
        Self { own: row(y), beside, has_neighbours: true }
    }

    /// The same for a layer of full EWA. In other layers than the band, pixels that are solid have no sums.
    #[inline(always)]
    pub(in crate::backend::cpu) fn of_layer(self, is_band: bool) -> Self {
        Self { has_neighbours: is_band, ..self }
    }

    /// The mean of one channel from pixel `x` of the row on.
    #[inline(always)]
    pub(in crate::backend::cpu) fn mean(&self, channel: usize, x: usize, inverse: &Lanes) -> Lanes {
        mean(self.own, channel, x, inverse)
    }
}

#[inline(always)]
fn mean(row: &[f32], channel: usize, x: usize, inverse: &Lanes) -> Lanes {
    let mut out = [0.0; LANES];
    out.copy_from_slice(&row[channel * STRIDE + x..][..LANES]);
    for l in 0..LANES {
        out[l] *= inverse[l];
    }
    out
}

/// The rays through the sample positions of `LANES` pixels from `pixel` on, world axes, with depth 1; and the unit
/// directions to the eye.
#[inline(always)]
pub(in crate::backend::cpu) fn rays(camera: &Mat3, raster: &Raster, pixel: [f32; 2]) -> [[Lanes; 3]; 2] {
    let over = 1.0 / raster.focal;
    let ray_y = (raster.axis[1] - (pixel[1] + 0.5 + raster.offset[1])) * over;
    let first = camera.y_axis * ray_y - camera.z_axis;
    let mut ray = [[0.0; LANES]; 3];
    let mut view = [[0.0; LANES]; 3];
    for l in 0..LANES {
        let ray_x = (pixel[0] + l as f32 + 0.5 + raster.offset[0] - raster.axis[0]) * over;
        let r =
            [first.x + camera.x_axis.x * ray_x, first.y + camera.x_axis.y * ray_x, first.z + camera.x_axis.z * ray_x];
        let s = -1.0 / (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]).sqrt();
        for c in 0..3 {
            ray[c][l] = r[c];
            view[c][l] = r[c] * s;
        }
    }
    [ray, view]
}

/// `LANES` pixels whose surfaces mirror the surroundings.
pub(in crate::backend::cpu) struct Mirror<'a> {
    pub surroundings: &'a Surroundings,
    pub camera: &'a Mat3,
    pub raster: &'a Raster,
    pub tile: &'a TileRect,
    pub rows: Rows<'a>,
    /// First channel of the normal.
    pub channel: usize,
    /// First pixel of the tile.
    pub at: [usize; 2],
    /// 1 / sum of weights.
    pub inverse: &'a Lanes,
    /// Unit normals.
    pub normal: &'a [Lanes; 3],
}

impl Mirror<'_> {
    /// Adds the share `reflection` of what the pixels mirror to `colour`.
    #[inline(always)]
    pub(in crate::backend::cpu) fn add(&self, reflection: &Lanes, colour: &mut [Lanes; 3]) {
        if reflection.iter().all(|&share| share == 0.0) {
            return;
        }
        let towards = self.towards(self.at[1], self.normal);
        let (beside, below) = (self.beside(), self.below());
        let pixel = self.raster.pixel;
        let half = 0.5 * (pixel * pixel);
        for l in 0..LANES {
            let x = [0, 1, 2].map(|c| beside[c][l] - towards[c][l]);
            let y = [0, 1, 2].map(|c| below[c][l] - towards[c][l]);
            let steps = (x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) + (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]);
            let seen = self.surroundings.radiance([towards[0][l], towards[1][l], towards[2][l]], half * steps);
            for c in 0..3 {
                colour[c][l] += seen[c] * reflection[l];
            }
        }
    }

    /// What surfaces with these normals mirror in row `y` of the tile.
    #[inline(always)]
    fn towards(&self, y: usize, normal: &[Lanes; 3]) -> [Lanes; 3] {
        let pixel = [(self.tile.origin[0] + self.at[0]) as f32, (self.tile.origin[1] + y) as f32];
        let [_, view] = rays(self.camera, self.raster, pixel);
        mirrored_lanes(normal, &view)
    }

    /// What the other pixels of pairs in the row mirror. Pixels without a normal of their own lend one.
    #[inline(always)]
    fn beside(&self) -> [Lanes; 3] {
        let mut normal = [[0.0; LANES]; 3];
        for l in 0..LANES {
            let has_own = self.rows.has_neighbours && self.inverse[l ^ 1] > 0.0;
            for c in 0..3 {
                normal[c][l ^ 1] = self.normal[c][if has_own { l ^ 1 } else { l }];
            }
        }
        let there = self.towards(self.at[1], &normal);
        let mut out = there;
        for l in 0..LANES {
            for c in 0..3 {
                out[c][l] = there[c][l ^ 1];
            }
        }
        out
    }

    /// What the other pixels of pairs in the columns mirror.
    #[inline(always)]
    fn below(&self) -> [Lanes; 3] {
        let mut normal = *self.normal;
        if self.rows.has_neighbours && !self.rows.beside.is_empty() {
            let row = self.rows.beside;
            let weights = mean(row, 0, self.at[0], &[1.0; LANES]);
            let inverse = weights.map(|weight| if weight > 0.0 { 1.0 / weight } else { 0.0 });
            let its = unit([0, 1, 2].map(|c| mean(row, self.channel + c, self.at[0], &inverse)));
            for l in 0..LANES {
                for c in 0..3 {
                    normal[c][l] = if weights[l] > 0.0 { its[c][l] } else { normal[c][l] };
                }
            }
        }
        self.towards(self.at[1] ^ 1, &normal)
    }
}

#[inline(always)]
fn mirrored_lanes(normal: &[Lanes; 3], view: &[Lanes; 3]) -> [Lanes; 3] {
    let mut out = [[0.0; LANES]; 3];
    for l in 0..LANES {
        let towards = mirrored([normal[0][l], normal[1][l], normal[2][l]], [view[0][l], view[1][l], view[2][l]]);
        for c in 0..3 {
            out[c][l] = towards[c];
        }
    }
    out
}

//! A texture under a Gaussian: the EWA filter in texture space (Heckbert 1989, chapter 3; Pfister et al. 2000, section
//! 5.3), in linear light with premultiplied opacity.
//!
//! Small ellipses sum over texels. Large ones sum over means of 2^l x 2^l texels, so that the standard deviation across
//! the ellipse is 2 to 4 of these cells. The variance that means have of their own is taken from that of the Gaussian.
//! Means across a clamped edge are those of the texels at the edge, repeated without end. An ellipse more than 16 times
//! as long as wide is widened. The error against the sum over all texels under the whole Gaussian is below 0.02 of the
//! texture's contrast where no ellipse is widened (tests/scene/sampling.rs).

use glam::{DVec2, Vec4};
use rayon::prelude::*;

use super::{Texture, Wrap};
use crate::math::{fast, srgb};

/// Least standard deviation of a filter across its ellipse, in cells of the level that it sums over, for levels above
/// 0.
const FINE: f64 = 2.0;
/// Standard deviations at which the Gaussian is cut. What is cut off weighs exp(-4.5) = 1.1 %.
const REACH: f64 = 3.0;
/// Greatest ratio of the standard deviations along and across an ellipse. A longer one is widened.
const LONGEST: f64 = 16.0;
/// Variance of the tent between texels, texels^2: a texture is what lies between its texels too.
const TENT: f64 = 1.0 / 6.0;
/// Greatest variance of a filter, texels^2.
const WIDEST: f64 = 1e15;
/// Levels of a texture with a clamped edge, which does not end: enough for the widest filter.
const LEVELS_CLAMPED: usize = 24;

/// A texture, and its means over squares of 2, 4, 8... texels.
pub(super) struct Pyramid<'a> {
    texture: &'a Texture,
    /// The opacity of the texture means nothing.
    opaque: bool,
    /// Linear light of the 256 values of a byte.
    linear: [f32; 256],
    /// Level 1 and up; the texture is a single cell of the last one.
    levels: Vec<Level>,
}

/// Means over the cells of a level. Along an axis with clamped edges, one more cell at each end stands for all that lie
/// wholly beyond the edge.
struct Level {
    /// Cells that lie at least in part within the texture.
    size: [usize; 2],
    /// Cells at each end beyond the edge, 0 or 1.
    pad: [usize; 2],
    cells: Vec<Vec4>,
}

/// The shape of a filter, ready to be moved over a texture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Footprint {
    level: usize,
    /// True along u or v where a cell of the level is as wide as the texture.
    flat: [bool; 2],
    /// Of the exponent 1/2 (A dx^2 + 2 B dx dy + C dy^2), in cells.
    conic: [f64; 3],
    /// Half the sides of the ellipse's box, cells.
    reach: DVec2,
}

impl<'a> Pyramid<'a> {
    pub(super) fn new(texture: &'a Texture, opaque: bool) -> Self {
        let linear = std::array::from_fn(|byte| srgb::to_linear(byte as f32 / 255.0));
        let mut pyramid = Self { texture, opaque, linear, levels: Vec::new() };
        let mut size = pyramid.size(0);
        let pad = texture.wrap.map(|wrap| usize::from(wrap == Wrap::Clamp));
        let least = if pad == [0, 0] { 0 } else { LEVELS_CLAMPED };
        while size != [1, 1] || pyramid.levels.len() < least {
            let below = pyramid.levels.len();
            size = size.map(|n| n.div_ceil(2));
            let [width, height] = [0, 1].map(|axis| size[axis] + 2 * pad[axis]);
            let at = |i: usize| [(i % width) as i64 - pad[0] as i64, (i / width) as i64 - pad[1] as i64];
            let cells = (0..width * height).into_par_iter().map(|i| pyramid.mean(below, at(i))).collect();
            pyramid.levels.push(Level { size, pad, cells });
        }
        pyramid
    }

    /// Width and height, texels.
    pub(super) fn texels(&self) -> DVec2 {
        let [width, height] = self.texture.size;
        DVec2::new(width.into(), height.into())
    }

    /// Mean of the 2 x 2 cells of `level` below a cell, by their areas.
    fn mean(&self, level: usize, at: [i64; 2]) -> Vec4 {
        let parts = [0, 1].map(|axis| {
            let edges = self.edges(level, axis);
            [0, 1].map(|side| {
                let index = 2 * at[axis] + side;
                let inside = index.clamp(edges[0], edges[1]);
                let there = index == inside || self.texture.wrap[axis] == Wrap::Clamp;
                (inside, if there { self.share(level, axis, inside) } else { 0.0 })
            })
        });
        let (mut sum, mut weight) = (Vec4::ZERO, 0.0);
        for (y, height) in parts[1] {
            for (x, width) in parts[0] {
                let area = (width * height) as f32;
                sum += area * self.cell(level, x, y);
                weight += area;
            }
        }
        sum / weight
    }

    /// The first and the last cell along an axis. Beyond a clamped edge, all are like these.
    fn edges(&self, level: usize, axis: usize) -> [i64; 2] {
        let pad =
            level.checked_sub(1).and_then(|above| self.levels.get(above)).map_or(0, |level| level.pad[axis] as i64);
        [-pad, self.size(level)[axis] as i64 - 1 + pad]
    }

    fn size(&self, level: usize) -> [usize; 2] {
        match level.checked_sub(1).and_then(|above| self.levels.get(above)) {
            Some(level) => level.size,
            None => self.texture.size.map(|n| n as usize),
        }
    }

    /// The part of a cell along an axis that lies within the texture. A clamped one has no end.
    fn share(&self, level: usize, axis: usize, index: i64) -> f64 {
        if self.texture.wrap[axis] == Wrap::Clamp {
            return 1.0;
        }
        let width = 1_u64 << level;
        let left = u64::from(self.texture.size[axis]) - (index as u64 * width);
        left.min(width) as f64 / width as f64
    }

    /// A cell within [`Self::edges`].
    #[inline]
    fn cell(&self, level: usize, x: i64, y: i64) -> Vec4 {
        if let Some(above) = level.checked_sub(1) {
            let Level { size, pad, cells } = &self.levels[above];
            let [x, y] = [x + pad[0] as i64, y + pad[1] as i64];
            return cells[y as usize * (size[0] + 2 * pad[0]) + x as usize];
        }
        let [r, g, b, a] = self.texture.texels[y as usize * self.texture.size[0] as usize + x as usize];
        let [r, g, b] = [r, g, b].map(|byte| self.linear[usize::from(byte)]);
        let colour = Vec4::new(r, g, b, 1.0);
        if self.opaque { colour } else { colour * (f32::from(a) / 255.0) }
    }

    /// The footprint of a Gaussian with the covariance [uu, uv, vv], texels^2.
    pub(super) fn footprint(&self, covariance: [f64; 3]) -> Footprint {
        let top = self.levels.len();
        let [mut uu, mut uv, mut vv] = covariance;
        if uu + vv >= WIDEST || (uu + vv).is_nan() {
            [uu, uv, vv] = [0.5 * WIDEST, 0.0, 0.5 * WIDEST];
        }
        (uu, vv) = (uu + TENT, vv + TENT);
        let (middle, half) = (0.5 * (uu + vv), DVec2::new(0.5 * (uu - vv), uv).length());
        let (long, short) = (middle + half, (middle - half).max(TENT));
        let wide = long / (LONGEST * LONGEST);
        if short < wide {
            // The variance across is raised, that along stays: covariance + (wide - short) (1 - d d^T).
            let keep = (long - wide) / (long - short);
            (uu, uv, vv) = (long + keep * (uu - long), keep * uv, long + keep * (vv - long));
        }
        let short = short.max(wide).sqrt();
        let mut level = 0;
        while level < top && short >= FINE * (2_u64 << level) as f64 {
            level += 1;
        }
        let cell = (1_u64 << level) as f64;
        let of_means = (cell * cell - 1.0) / 12.0;
        let [uu, uv, vv] = [uu - of_means, uv, vv - of_means].map(|x| x / cell / cell);
        let flat =
            [0, 1].map(|axis| f64::from(self.texture.size[axis]) <= cell && self.texture.wrap[axis] != Wrap::Clamp);
        let conic = match flat {
            [false, false] => {
                let determinant = uu * vv - uv * uv;
                [vv / determinant, -uv / determinant, uu / determinant]
            }
            [true, _] => [0.0, 0.0, 1.0 / vv],
            [_, true] => [1.0 / uu, 0.0, 0.0],
        };
        Footprint { level, flat, conic, reach: DVec2::new(uu.sqrt(), vv.sqrt()) * REACH }
    }

    /// The premultiplied colour of the texture under a footprint about `centre`, texels from the upper left corner.
    pub(super) fn filter(&self, footprint: &Footprint, centre: DVec2) -> Vec4 {
        let level = footprint.level;
        if footprint.flat == [true, true] || !centre.is_finite() {
            return self.cell(self.levels.len(), 0, 0);
        }
        let width = (1_u64 << level) as f64;
        let lines = [0, 1].map(|axis| self.line(footprint, axis));
        let at = [0, 1].map(|axis| lines[axis].folded(centre[axis] / width, footprint.reach[axis]));
        let [a, b, c] = footprint.conic;
        let determinant = (a * c - b * b).max(0.0);
        let (mut sum, mut weights) = (Vec4::ZERO, 0.0);
        let reach = footprint.reach.y;
        lines[1].runs(at[1] - reach, at[1] + reach, |rows| {
            for row in 0..rows.count {
                let y = rows.index + row * rows.step;
                let dy = if footprint.flat[1] { 0.0 } else { rows.at + row as f64 - at[1] };
                let share = lines[1].share(y);
                let (middle, half) = if a > 0.0 {
                    (-b * dy / a, ((REACH * REACH - dy * dy * determinant / a) / a).max(0.0).sqrt())
                } else {
                    (0.0, 0.0)
                };
                lines[0].runs(at[0] + middle - half, at[0] + middle + half, |run| {
                    let dx = if footprint.flat[0] { 0.0 } else { run.at - at[0] };
                    let (of_run, weight) = self.run(footprint, &run, &lines[0], y, dx, dy);
                    sum += share * of_run;
                    weights += share * weight;
                });
            }
        });
        // A slim ellipse may pass between all cells; a cell at its middle is its value then.
        if weights > 0.0 { sum / weights } else { self.cell(level, lines[0].nearest(at[0]), lines[1].nearest(at[1])) }
    }

    /// Sum of the cells of a run in row `y`, weighted, and of their weights. The weight exp(-q) is a product: that of
    /// the next cell is the last one times a ratio, which shrinks by a constant factor.
    fn run(&self, footprint: &Footprint, run: &Run, line: &Line, y: i64, dx: f64, dy: f64) -> (Vec4, f32) {
        let [a, b, c] = footprint.conic;
        let mut weight = exp(-(0.5 * a * dx * dx + b * dx * dy + 0.5 * c * dy * dy));
        let mut ratio = exp(-(a * (dx + 0.5) + b * dy));
        let shrink = exp(-a);
        let (mut sum, mut weights) = (Vec4::ZERO, 0.0);
        let mut x = run.index;
        for _ in 0..run.count {
            let here = weight * line.share(x);
            sum += here * self.cell(footprint.level, x, y);
            weights += here;
            weight *= ratio;
            ratio *= shrink;
            x += run.step;
        }
        (sum, weights)
    }

    fn line(&self, footprint: &Footprint, axis: usize) -> Line {
        let cells = self.size(footprint.level)[axis] as i64;
        Line {
            cells,
            period: f64::from(self.texture.size[axis]) / (1_u64 << footprint.level) as f64,
            edges: self.edges(footprint.level, axis),
            last: self.share(footprint.level, axis, cells - 1) as f32,
            wrap: self.texture.wrap[axis],
            flat: footprint.flat[axis],
        }
    }
}

/// e^x by the polynomial of all renderers.
fn exp(x: f64) -> f32 {
    fast::exp2((x * std::f64::consts::LOG2_E) as f32)
}

/// The cells of a level along one axis.
struct Line {
    cells: i64,
    /// The first and the last cell there is.
    edges: [i64; 2],
    /// Width of the texture, cells.
    period: f64,
    /// The part of the last cell that lies within the texture.
    last: f32,
    wrap: Wrap,
    flat: bool,
}

/// Cells at `at`, `at` + 1, ...
struct Run {
    at: f64,
    index: i64,
    /// 1, -1 in a mirror image, 0 beyond a clamped edge.
    step: i64,
    count: i64,
}

impl Line {
    fn share(&self, index: i64) -> f32 {
        if index + 1 == self.cells { self.last } else { 1.0 }
    }

    fn nearest(&self, at: f64) -> i64 {
        (at.floor() as i64).clamp(self.edges[0], self.edges[1])
    }

    /// A place near the origin at which the line looks the same.
    fn folded(&self, at: f64, reach: f64) -> f64 {
        match self.wrap {
            Wrap::Repeat => at - (at / self.period).floor() * self.period,
            Wrap::Mirror => at - (0.5 * at / self.period).floor() * (2.0 * self.period),
            // Beyond this all cells are like that of the edge.
            Wrap::Clamp => at.clamp(-2.0 * reach - 1.0, self.period + 2.0 * reach + 1.0),
        }
    }

    /// The cells whose middles lie from `low` to `high`.
    fn runs(&self, low: f64, high: f64, mut each: impl FnMut(Run)) {
        if self.flat {
            return each(Run { at: 0.0, index: 0, step: 1, count: 1 });
        }
        // Middles are at offset + i + 1/2 for i in the range.
        let mut part = |offset: f64, from: i64, to: i64, index: &dyn Fn(i64) -> i64, step: i64| {
            let first = ((low - offset - 0.5).ceil() as i64).max(from);
            let last = ((high - offset - 0.5).floor() as i64).min(to);
            if first <= last {
                each(Run { at: offset + first as f64 + 0.5, index: index(first), step, count: last - first + 1 });
            }
        };
        let end = self.cells - 1;
        if self.wrap == Wrap::Clamp {
            part(0.0, i64::MIN, -1, &|_| self.edges[0], 0);
            part(0.0, 0, end, &|i| i, 1);
            part(0.0, self.cells, i64::MAX, &|_| self.edges[1], 0);
            return;
        }
        // The last cell may reach into the next image.
        let (first, last) = (((low - 1.0) / self.period).floor() as i64, (high / self.period).floor() as i64);
        for image in first..=last {
            let offset = image as f64 * self.period;
            if self.wrap == Wrap::Mirror && image % 2 != 0 {
                part(offset + self.period - self.cells as f64, 0, end, &|i| end - i, -1);
            } else {
                part(offset, 0, end, &|i| i, 1);
            }
        }
    }
}

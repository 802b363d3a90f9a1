//! A texture under a Gaussian: the EWA filter in texture space (Heckbert 1989, chapter 3; Pfister et al. 2000, section
//! 5.3), in linear light with premultiplied opacity.
//!
//! Small ellipses sum over texels. Large ones sum over means of 2^l x 2^l texels, so that the standard deviation across
//! the ellipse is 2 to 4 of these cells. The variance that means have of their own is taken from that of the Gaussian.
//! An ellipse more than 16 times as long as wide is widened. The error against the sum over all texels under the whole
//! Gaussian is below 0.02 of the texture's contrast where no ellipse is widened,
//! but up to 0.28 near the edge of a clamped one, where the mean of the cell at the edge stands for its outermost texels
//! (tests/scene/sampling.rs).

use glam::{DVec2, Vec4};
use rayon::prelude::*;

use super::{Texture, Wrap};
use crate::math::{fast, srgb};

/// Least standard deviation of a filter across its ellipse, in cells of the level that it sums over, for levels above 0.
const FINE: f64 = 2.0;
/// Standard deviations at which the Gaussian is cut. What is cut off weighs exp(-4.5) = 1.1 %.
const REACH: f64 = 3.0;
/// Greatest ratio of the standard deviations along and across an ellipse. A longer one is widened.
const LONGEST: f64 = 16.0;
/// Variance of the tent between texels, texels^2: a texture is what lies between its texels too.
const TENT: f64 = 1.0 / 6.0;

/// A texture, and its means over squares of 2, 4, 8... texels.
pub(super) struct Pyramid<'a> {
    texture: &'a Texture,
    /// The opacity of the texture means nothing.
    opaque: bool,
    /// Linear light of the 256 values of a byte.
    linear: [f32; 256],
    /// Level 1 and up; the last one is a single cell.
    levels: Vec<Level>,
}

struct Level {
    size: [usize; 2],
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
        while size != [1, 1] {
            let below = pyramid.levels.len();
            let of_below = size;
            size = size.map(|n| n.div_ceil(2));
            let cells = (0..size[0] * size[1])
                .into_par_iter()
                .map(|i| pyramid.mean(below, of_below, [i % size[0], i / size[0]]))
                .collect();
            pyramid.levels.push(Level { size, cells });
        }
        pyramid
    }

    /// Width and height, texels.
    pub(super) fn texels(&self) -> DVec2 {
        let [width, height] = self.texture.size;
        DVec2::new(width.into(), height.into())
    }

    /// Mean of the up to 2 x 2 cells of `level` below a cell, by their areas.
    fn mean(&self, level: usize, size: [usize; 2], [x, y]: [usize; 2]) -> Vec4 {
        let (mut sum, mut weight) = (Vec4::ZERO, 0.0);
        for v in 2 * y..(2 * y + 2).min(size[1]) {
            for u in 2 * x..(2 * x + 2).min(size[0]) {
                let area = (self.share(level, 0, u) * self.share(level, 1, v)) as f32;
                sum += area * self.cell(level, u, v);
                weight += area;
            }
        }
        sum / weight
    }

    fn size(&self, level: usize) -> [usize; 2] {
        match level.checked_sub(1).and_then(|above| self.levels.get(above)) {
            Some(level) => level.size,
            None => self.texture.size.map(|n| n as usize),
        }
    }

    /// The part of a cell along an axis that lies within the texture.
    fn share(&self, level: usize, axis: usize, index: usize) -> f64 {
        let width = 1_u64 << level;
        let left = u64::from(self.texture.size[axis]) - (index as u64 * width);
        left.min(width) as f64 / width as f64
    }

    #[inline]
    fn cell(&self, level: usize, x: usize, y: usize) -> Vec4 {
        match level.checked_sub(1) {
            Some(above) => self.levels[above].cells[y * self.levels[above].size[0] + x],
            None => {
                let [r, g, b, a] = self.texture.texels[y * self.texture.size[0] as usize + x];
                let colour = Vec4::new(
                    self.linear[usize::from(r)],
                    self.linear[usize::from(g)],
                    self.linear[usize::from(b)],
                    1.0,
                );
                if self.opaque { colour } else { colour * (f32::from(a) / 255.0) }
            }
        }
    }

    /// The footprint of a Gaussian with the covariance [uu, uv, vv], texels^2.
    pub(super) fn footprint(&self, covariance: [f64; 3]) -> Footprint {
        let top = self.levels.len();
        let [mut uu, mut uv, mut vv] = covariance;
        // NaN fails the comparison; beyond it is any texture.
        if !(uu + vv < 1e15) {
            return Footprint { level: top, flat: [true; 2], conic: [0.0; 3], reach: DVec2::ZERO };
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
        let flat = self.texture.size.map(|n| level > 0 && f64::from(n) <= cell);
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
                    let (of_run, weight) = self.run(footprint, &run, &lines[0], y as usize, dx, dy);
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
    fn run(&self, footprint: &Footprint, run: &Run, line: &Line, y: usize, dx: f64, dy: f64) -> (Vec4, f32) {
        let [a, b, c] = footprint.conic;
        let mut weight = exp(-(0.5 * a * dx * dx + b * dx * dy + 0.5 * c * dy * dy));
        let mut ratio = exp(-(a * (dx + 0.5) + b * dy));
        let shrink = exp(-a);
        let (mut sum, mut weights) = (Vec4::ZERO, 0.0);
        let mut x = run.index;
        for _ in 0..run.count {
            let here = weight * line.share(x);
            sum += here * self.cell(footprint.level, x as usize, y);
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
            last: self.share(footprint.level, axis, cells as usize - 1) as f32,
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

    fn nearest(&self, at: f64) -> usize {
        (at.floor().max(0.0) as usize).min(self.cells as usize - 1)
    }

    /// A place near the origin at which the line looks the same.
    fn folded(&self, at: f64, reach: f64) -> f64 {
        match self.wrap {
            Wrap::Repeat => at - (at / self.period).floor() * self.period,
            Wrap::Mirror => at - (0.5 * at / self.period).floor() * (2.0 * self.period),
            // Beyond this all cells are those of the edge.
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
            part(0.0, i64::MIN, -1, &|_| 0, 0);
            part(0.0, 0, end, &|i| i, 1);
            part(0.0, self.cells, i64::MAX, &|_| end, 0);
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

//! A texture under a Gaussian: the EWA filter in texture space (Heckbert 1989, chapter 3; Pfister et al. 2000, section
//! 5.3), in linear light with premultiplied opacity.
//!
//! Small ellipses sum over texels. Large ones sum over the cells of a coarser level, which is the texture under a
//! quadratic B-spline three cells wide. Its variance, 1/4 of a cell's width squared, is taken from the Gaussian's.
//! A level has a power of two of cells along each side of the texture, so that a texture that repeats does so in whole
//! cells. An ellipse more than 16 times as long as wide is widened. The error against the sum over all texels under the
//! whole Gaussian is below 0.02 of the texture's contrast where no ellipse is widened (tests/scene/sampling.rs).

use glam::{DVec2, Vec4};
use rayon::prelude::*;

use super::{Texture, Wrap};
use crate::math::{fast, srgb};

/// Least standard deviation of a filter across its ellipse, cells. Level 0 takes all that no other level may have.
const FINE: f64 = 1.0;
/// Standard deviations at which the Gaussian is cut. The rest weighs exp(-4.5) = 1.1 % of the whole.
const REACH: f64 = 3.0;
/// Greatest ratio of the standard deviations along and across an ellipse. A longer one is widened.
const LONGEST: f64 = 16.0;
/// Variance of the tent between texels, texels^2: a texture is what lies between its texels too.
const TENT: f64 = 1.0 / 6.0;
/// Variance of a quadratic B-spline, cells^2.
const SPLINE: f64 = 0.25;
/// Greatest variance of a filter, texels^2.
const WIDEST: f64 = 1e15;
/// Levels of a texture with a clamped edge, which does not end: enough for the widest filter.
const LEVELS_CLAMPED: usize = 25;
/// Cells beyond a clamped edge that a level holds. The splines of the outermost touch nothing but the edge's texel.
const PAD: usize = 2;

/// A texture, and coarser levels of it.
pub(super) struct Pyramid<'a> {
    texture: &'a Texture,
    /// The opacity of the texture means nothing.
    opaque: bool,
    /// Linear light of the 256 values of a byte.
    linear: [f32; 256],
    /// Sides of all levels. Level 0 is the texture.
    sides: Vec<[Side; 2]>,
    /// The cells of level 1 and up.
    cells: Vec<Vec<Vec4>>,
}

/// One axis of a level.
#[derive(Clone, Copy, Debug)]
struct Side {
    /// Cells along the texture. They may reach beyond a clamped edge.
    count: usize,
    /// Cells held at each end beyond them. All beyond those are like the outermost.
    pad: usize,
    /// Texels that a cell is wide.
    width: f64,
    wrap: Wrap,
}

/// The shape of a filter, ready to be moved over a texture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Footprint {
    level: usize,
    /// A, B and C of the exponent 1/2 (A dx^2 + 2 B dx dy + C dy^2), in cells; 0 along a side of one cell that repeats.
    conic: [f64; 3],
    /// Half the sides of the ellipse's box, cells.
    reach: DVec2,
}

impl<'a> Pyramid<'a> {
    pub(super) fn new(texture: &'a Texture, opaque: bool) -> Self {
        let linear = std::array::from_fn(|byte| srgb::to_linear(byte as f32 / 255.0));
        let side =
            |axis: usize| Side { count: texture.size[axis] as usize, pad: 0, width: 1.0, wrap: texture.wrap[axis] };
        let sides = vec![[0, 1].map(side)];
        let mut pyramid = Self { texture, opaque, linear, sides, cells: Vec::new() };
        let least = if texture.wrap.contains(&Wrap::Clamp) { LEVELS_CLAMPED } else { 0 };
        loop {
            let below = pyramid.sides.len() - 1;
            if pyramid.sides[below].map(|side| side.count) == [1, 1] && below >= least {
                return pyramid;
            }
            let sides = pyramid.sides[below].map(|side| side.above());
            let taps = [0, 1].map(|axis| sides[axis].taps(&pyramid.sides[below][axis], below == 0));
            let cell = |row: &[(i64, f32)], column: &[(i64, f32)]| -> Vec4 {
                let of_row = |y| row.iter().map(|&(x, weight)| weight * pyramid.cell(below, x, y)).sum::<Vec4>();
                column.iter().map(|&(y, weight)| weight * of_row(y)).sum()
            };
            let cells = taps[1].par_iter().flat_map_iter(|column| taps[0].iter().map(|row| cell(row, column)));
            let cells = cells.collect();
            pyramid.cells.push(cells);
            pyramid.sides.push(sides);
        }
    }

    /// Width and height, texels.
    pub(super) fn texels(&self) -> DVec2 {
        let [width, height] = self.texture.size;
        DVec2::new(width.into(), height.into())
    }

    /// A cell that the level holds.
    #[inline]
    fn cell(&self, level: usize, x: i64, y: i64) -> Vec4 {
        let row = self.row(level, y);
        let x = (x + self.sides[level][0].pad as i64) as usize;
        match level.checked_sub(1) {
            Some(above) => self.cells[above][row + x],
            None => self.decoded(self.texture.texels[row + x]),
        }
    }

    /// Where row `y` of a level begins.
    fn row(&self, level: usize, y: i64) -> usize {
        let [u, v] = &self.sides[level];
        (y + v.pad as i64) as usize * (u.count + 2 * u.pad)
    }

    #[inline]
    fn decoded(&self, [r, g, b, a]: [u8; 4]) -> Vec4 {
        let [r, g, b] = [r, g, b].map(|byte| self.linear[usize::from(byte)]);
        let colour = Vec4::new(r, g, b, 1.0);
        if self.opaque { colour } else { colour * (f32::from(a) / 255.0) }
    }

    /// The footprint of a Gaussian with the covariance [uu, uv, vv], texels^2.
    pub(super) fn footprint(&self, covariance: [f64; 3]) -> Footprint {
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
        let fits = |level: &usize| {
            let wide_enough = |axis: usize| short >= FINE * self.sides[*level][axis].width;
            // A texture of one texel is the same under every filter.
            [0, 1].iter().all(|axis| self.sides[0][*axis].is_flat() || wide_enough(*axis))
        };
        let level = (1..self.sides.len()).take_while(fits).count();
        let [u, v] = &self.sides[level];
        let spline = if level > 0 { SPLINE } else { 0.0 };
        (uu, uv, vv) = (uu / u.width / u.width - spline, uv / u.width / v.width, vv / v.width / v.width - spline);
        let conic = match [u.is_flat(), v.is_flat()] {
            [false, false] => {
                let determinant = uu * vv - uv * uv;
                [vv / determinant, -uv / determinant, uu / determinant]
            }
            [true, true] => [0.0; 3],
            [true, false] => [0.0, 0.0, 1.0 / vv],
            [false, true] => [1.0 / uu, 0.0, 0.0],
        };
        Footprint { level, conic, reach: DVec2::new(uu.sqrt(), vv.sqrt()) * REACH }
    }

    /// The premultiplied colour of the texture under a footprint about `centre`, texels from the upper left corner.
    pub(super) fn filter(&self, footprint: &Footprint, centre: DVec2) -> Vec4 {
        let level = footprint.level;
        let [u, v] = &self.sides[level];
        if !centre.is_finite() {
            return self.cell(self.sides.len() - 1, 0, 0);
        }
        let reach = footprint.reach;
        let at = [u.folded(centre.x / u.width, reach.x), v.folded(centre.y / v.width, reach.y)];
        let [a, b, c] = footprint.conic;
        // The row through dy spans REACH^2 = a dx^2 + 2 b dx dy + c dy^2: from its middle, -slope dy, to either side.
        let slope = if a > 0.0 { b / a } else { 0.0 };
        let [of_a, across] = if a > 0.0 { [1.0 / a, (c - b * slope).max(0.0)] } else { [0.0; 2] };
        let shrink = exp(-a);
        let (mut sum, mut weights) = (Vec4::ZERO, 0.0);
        v.runs(at[1] - reach.y, at[1] + reach.y, |rows| {
            for row in 0..rows.count {
                let y = self.row(level, rows.index + row * rows.step);
                let dy = if v.is_flat() { 0.0 } else { rows.at + row as f64 - at[1] };
                let half = ((REACH * REACH - across * dy * dy) * of_a).max(0.0).sqrt();
                let middle = at[0] - slope * dy;
                u.runs(middle - half, middle + half, |run| {
                    // The weight exp(-q) is a product: that of the next cell is the last one times a ratio, which
                    // shrinks by a constant factor.
                    let dx = if u.is_flat() { 0.0 } else { run.at - at[0] };
                    let weight = exp(-(0.5 * a * dx * dx + b * dx * dy + 0.5 * c * dy * dy));
                    let ratio = exp(-(a * (dx + 0.5) + b * dy));
                    let mut gauss = Gauss { sum: Vec4::ZERO, weights: 0.0, weight, ratio, shrink };
                    self.add(&mut gauss, level, y, &run);
                    sum += gauss.sum;
                    weights += gauss.weights;
                });
            }
        });
        // A slim ellipse may pass between all cells; a cell at its middle is its value then.
        if weights > 0.0 { sum / weights } else { self.cell(level, u.nearest(at[0]), v.nearest(at[1])) }
    }

    /// Adds the cells of a run in the row that begins at `row`.
    #[inline]
    fn add(&self, gauss: &mut Gauss, level: usize, row: usize, run: &Run) {
        let first = row + (run.index + self.sides[level][0].pad as i64) as usize;
        let count = run.count as usize;
        if let Some(above) = level.checked_sub(1) {
            let cells = &self.cells[above];
            match run.step {
                1 => cells[first..first + count].iter().for_each(|cell| gauss.add(*cell)),
                0 => (0..count).for_each(|_| gauss.add(cells[first])),
                _ => cells[first + 1 - count..=first].iter().rev().for_each(|cell| gauss.add(*cell)),
            }
        } else {
            let texels = &self.texture.texels;
            match run.step {
                1 => texels[first..first + count].iter().for_each(|texel| gauss.add(self.decoded(*texel))),
                0 => (0..count).for_each(|_| gauss.add(self.decoded(texels[first]))),
                _ => texels[first + 1 - count..=first].iter().rev().for_each(|t| gauss.add(self.decoded(*t))),
            }
        }
    }
}

/// A sum over neighbours in a row under a Gaussian.
struct Gauss {
    sum: Vec4,
    weights: f32,
    /// Weight of the next cell.
    weight: f32,
    /// Ratio of the weight of the cell after it to its own.
    ratio: f32,
    /// Ratio of the next ratio to this one.
    shrink: f32,
}

impl Gauss {
    #[inline]
    fn add(&mut self, cell: Vec4) {
        self.sum += self.weight * cell;
        self.weights += self.weight;
        self.weight *= self.ratio;
        self.ratio *= self.shrink;
    }
}

/// e^x by the polynomial of all renderers.
fn exp(x: f64) -> f32 {
    fast::exp2((x * std::f64::consts::LOG2_E) as f32)
}

/// Cells at `at`, `at` + 1, ...
struct Run {
    at: f64,
    index: i64,
    /// 1, -1 in a mirror image, 0 beyond a clamped edge.
    step: i64,
    count: i64,
}

impl Side {
    /// True where one cell repeats without end.
    fn is_flat(&self) -> bool {
        self.count == 1 && self.wrap != Wrap::Clamp
    }

    /// The side of the next coarser level: half as many cells, or the greatest power of two below the texels.
    fn above(&self) -> Self {
        let count = (self.count.next_power_of_two() / 2).max(1);
        let grown = if self.count > 1 { self.count as f64 / count as f64 } else { 2.0 };
        let width = if self.is_flat() { self.width } else { self.width * grown };
        Self { count, pad: if self.wrap == Wrap::Clamp { PAD } else { 0 }, width, wrap: self.wrap }
    }

    /// For each cell held, those of the side below that its spline weighs, and the weights.
    ///
    /// Texels are weighed by the spline at their centres. Cells are splines, of which four with the weights 1, 3, 3 and
    /// 1 make one of twice their width.
    fn taps(&self, below: &Self, texels: bool) -> Vec<Vec<(i64, f32)>> {
        let ratio = self.width / below.width;
        let pad = self.pad as i64;
        (-pad..self.count as i64 + pad)
            .map(|index| {
                let centre = (index as f64 + 0.5) * ratio;
                let (low, high) = ((centre - 1.5 * ratio - 0.5).ceil(), (centre + 1.5 * ratio - 0.5).floor());
                let weigh = |i: i64| {
                    let x = (i as f64 + 0.5 - centre).abs() / ratio;
                    match (texels, x < 0.5) {
                        (true, true) => 0.75 - x * x,
                        (true, false) => 0.5 * (1.5 - x) * (1.5 - x),
                        (false, true) => 3.0,
                        (false, false) => f64::from(u8::from(x < 1.0)),
                    }
                };
                let taps: Vec<(i64, f64)> = (low as i64..=high as i64).map(|i| (below.wrapped(i), weigh(i))).collect();
                let sum: f64 = taps.iter().map(|tap| tap.1).sum();
                taps.into_iter().map(|(i, weight)| (i, (weight / sum) as f32)).collect()
            })
            .collect()
    }

    /// The cell held that is like this one.
    fn wrapped(&self, index: i64) -> i64 {
        self.wrap.cell(index, self.count as i64, self.pad as i64)
    }

    fn nearest(&self, at: f64) -> i64 {
        self.wrapped(at.floor() as i64)
    }

    /// A place near the origin at which the line looks the same.
    fn folded(&self, at: f64, reach: f64) -> f64 {
        let period = self.count as f64;
        match self.wrap {
            Wrap::Repeat => at.rem_euclid(period),
            Wrap::Mirror => at.rem_euclid(2.0 * period),
            // Beyond this all cells are like those at the end.
            Wrap::Clamp => {
                let beyond = 2.0 * reach + (PAD + 1) as f64;
                at.clamp(-beyond, period + beyond)
            }
        }
    }

    /// The cells whose middles lie from `low` to `high`.
    #[inline]
    fn runs(&self, low: f64, high: f64, mut each: impl FnMut(Run)) {
        if self.is_flat() {
            return each(Run { at: 0.0, index: 0, step: 1, count: 1 });
        }
        // Indices without wrapping.
        let (first, last) = ((low - 0.5).ceil() as i64, (high - 0.5).floor() as i64);
        let (count, pad) = (self.count as i64, self.pad as i64);
        let mut part = |from: i64, to: i64, index: i64, step: i64| {
            let (from, to) = (from.max(first), to.min(last));
            if from <= to {
                each(Run { at: from as f64 + 0.5, index: index + step * from, step, count: to - from + 1 });
            }
        };
        if self.wrap == Wrap::Clamp {
            part(i64::MIN, -pad - 1, -pad, 0);
            part(-pad, count - 1 + pad, 0, 1);
            part(count + pad, i64::MAX, count - 1 + pad, 0);
            return;
        }
        for image in first.div_euclid(count)..=last.div_euclid(count) {
            let start = image * count;
            if self.wrap == Wrap::Mirror && image % 2 != 0 {
                part(start, start + count - 1, start + count - 1, -1);
            } else {
                part(start, start + count - 1, -start, 1);
            }
        }
    }
}

//! One shadow map: surfels are drawn onto it, and places ask it.

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::cells::{Cells, Ground};
use super::fit::{MapArea, on_view};
use super::run::{RUN, Run, SeenRun};
use super::view::LightView;
use super::{GRAZING, ROUNDING};
use crate::backend::cpu::tiles::LANES;
use crate::math::simd::dispatch;

/// Rows of a map that are drawn together.
const ROWS: usize = 32;

/// A surfel as a view of a light shows it. Places (x, y) are in texels, whole at their middles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Caster {
    /// (a, b) on the disc, in units of its axes, times c: each as (x, y, 1) times a row.
    disc: [Vec3; 3],
    /// The distance of its plane at (x, y, 1), as [`LightView::on_plane`] has it.
    plane: Vec3,
    /// Added to it.
    tolerance: f32,
    /// First and last column, then row.
    bounds: [[u16; 2]; 2],
}

/// A map.
#[derive(Debug, Default)]
pub(super) struct ShadowMap {
    area: MapArea,
    /// Texels to a unit of length.
    scale: f32,
    /// Run by run.
    casters: Vec<Vec<Caster>>,
    /// Row by row: the least distance, tolerance included, at which light ends; infinite where nothing stops it.
    end: Vec<f32>,
    /// The caster that stops it: the number of its run times [`RUN`], and its place in it.
    caster: Vec<u32>,
    /// Texels from one row to the next.
    stride: usize,
}

impl ShadowMap {
    pub(super) const BYTES_OF_TEXEL: u64 = 8;

    pub(super) const fn is_empty(&self) -> bool {
        self.area.size[0] == 0
    }

    /// Surfels that are drawn on it.
    #[cfg(test)]
    pub(super) fn casters(&self) -> usize {
        self.casters.iter().map(Vec::len).sum()
    }

    /// Draws the surfels of `runs` that may cast a shadow onto what receives one in an area that is not empty. The
    /// memory of an earlier map is used again.
    pub(super) fn draw(&mut self, on: &Onto<'_>, runs: &[Run<'_>]) {
        self.area = *on.area;
        self.scale = 1.0 / self.area.texel;
        let [columns, rows] = self.area.size;
        let runs: Vec<_> = runs.par_iter().filter(|run| on.may_show(run)).collect();
        self.casters.resize_with(runs.len().max(self.casters.len()), Vec::new);
        self.casters.par_iter_mut().skip(runs.len()).for_each(Vec::clear);
        self.casters.par_iter_mut().zip(&runs).for_each(|(casters, run)| {
            casters.clear();
            let seen = run.seen_by(on.view);
            casters.extend((0..run.len).filter_map(|i| Caster::of(&seen, i, on)));
        });
        // A row has room for the lanes that begin at its last texel.
        self.stride = columns + LANES;
        self.end.clear();
        self.end.resize(self.stride * rows, f32::INFINITY);
        self.caster.resize(self.stride * rows, 0);
        let lists = lists(&self.casters, rows.div_ceil(ROWS));
        let (casters, stride) = (&self.casters, self.stride);
        let bands = self.end.par_chunks_mut(stride * ROWS).zip(self.caster.par_chunks_mut(stride * ROWS));
        bands.zip(&lists).enumerate().for_each(|(band, ((end, caster), list))| {
            draw_band(casters, list, band * ROWS, stride, end, caster);
        });
    }

    /// Does light reach `place`, relative to the eye in world axes, which lies there on the plane of the view? It does
    /// outside the map.
    #[inline(always)]
    pub(super) fn lights(&self, [x, y, distance]: [f32; 3], place: Vec3, is_point: bool) -> bool {
        let MapArea { first, size, .. } = self.area;
        let [x, y] = [(x - first[0]) * self.scale, (y - first[1]) * self.scale];
        if !(x >= 0.0 && y >= 0.0) {
            return true;
        }
        let (column, row) = (x as usize, y as usize);
        if column >= size[0] || row >= size[1] {
            return true;
        }
        let at = row * self.stride + column;
        if self.end[at] == f32::INFINITY {
            return true;
        }
        let caster = of(&self.casters, self.caster[at]);
        let end = caster.plane.dot(Vec3::new(x - 0.5, y - 0.5, 1.0)) + caster.tolerance;
        // Of -1 / distance that of the distance, over its square.
        let (size, scale) = (place.length(), distance.abs());
        let rounding = ROUNDING * if is_point { scale * (1.0 + size * scale) } else { size + scale };
        distance <= end + rounding
    }
}

/// What a map is drawn onto.
pub(super) struct Onto<'a> {
    pub area: &'a MapArea,
    pub view: &'a LightView,
    pub cells: &'a Cells,
    pub ground: &'a Ground,
}

impl Onto<'_> {
    /// May a run cast a shadow onto anything that receives one?
    fn may_show(&self, run: &Run<'_>) -> bool {
        let (place, extent) = (self.view.place(run.middle), self.view.extent(run.half));
        let bounds = if self.view.is_point {
            on_view(self.view, place, run.reach)
        } else {
            Some([0, 1].map(|c: usize| [place[c] - extent[c], place[c] + extent[c]]))
        };
        let tolerance = self.ground.moved(run.object.epsilon, place.length() + run.reach, place.z + run.reach);
        let behind = || self.ground.behind(place, run.reach, self.ground.of_box(run.half))[0] + tolerance;
        bounds.is_some_and(|bounds| self.area.touches(bounds) && !self.hides(bounds, behind()))
    }

    /// Is what receives shadows within a rectangle before what lies so far behind the ground at the least? A texel
    /// shows its middle alone: it counts as reaching beyond the rectangle.
    fn hides(&self, bounds: [[f32; 2]; 2], behind: f32) -> bool {
        let texel = self.area.texel;
        self.cells.hides(bounds.map(|[low, high]| [low - texel, high + texel]), behind)
    }
}

impl Caster {
    /// Surfel `i` of a run; `None` where no shadow of it is seen. It casts with both sides, whichever of them
    /// shows: each sheet has a shadow, and the backs of a closed model lie behind its fronts.
    fn of(run: &SeenRun<'_>, i: usize, on: &Onto<'_>) -> Option<Self> {
        let Onto { area, view, ground, .. } = on;
        let c = run.centre(i);
        let [u, v] = run.axes(i);
        // What is beside a face of the cube is on another.
        let radius = (u.length_squared() + v.length_squared()).sqrt();
        if view.is_beside(c, radius) {
            return None;
        }
        let covered = covered(c, [u, v], view);
        if !area.touches(covered) {
            return None;
        }
        let normal = u.cross(v);
        let along = if view.is_point { normal.dot(c) / c.length() } else { normal.z };
        let cosine = (along / normal.length()).abs().max(GRAZING);
        let rounding = ROUNDING * (run.run.centre(i).length() + c.length());
        let tolerance = run.run.object.epsilon.max(rounding) / cosine;
        let moved = ground.moved(tolerance, c.length(), c.z + radius);
        if on.hides(covered, ground.behind(c, radius, ground.of_disc([u, v]))[0] + moved) {
            return None;
        }
        let bounds = texels(covered, area)?;
        let (disc, plane) =
            if view.is_point { seen_from_point(c, [u, v], area) } else { seen_parallel(c, [u, v], area) };
        // Of a point light the plane itself is moved away.
        let plane = if view.is_point { plane / (1.0 + tolerance / c.length()) } else { plane };
        let tolerance = if view.is_point { 0.0 } else { tolerance };
        (plane.is_finite() && disc[0].is_finite() && disc[1].is_finite() && tolerance.is_finite()).then_some(Self {
            disc,
            plane,
            tolerance,
            bounds,
        })
    }
}

/// Rows of a disc and of its plane, as [`Caster`] has them, where rays are parallel.
fn seen_parallel(c: Vec3, [u, v]: [Vec3; 2], area: &MapArea) -> ([Vec3; 3], Vec3) {
    let over = area.texel / (u.x * v.y - v.x * u.y);
    // The centre, in texels.
    let [x, y] = [0, 1].map(|n: usize| (c[n] - area.first[n]) / area.texel - 0.5);
    let row = |dx: f32, dy: f32| Vec3::new(dx * over, dy * over, -(dx * x + dy * y) * over);
    let (a, b) = (row(v.y, -v.x), row(-u.y, u.x));
    ([a, b, Vec3::Z], a * u.z + b * v.z + Vec3::Z * c.z)
}

/// The same where rays start at a point.
fn seen_from_point(c: Vec3, [u, v]: [Vec3; 2], area: &MapArea) -> ([Vec3; 3], Vec3) {
    // The third row is what places are divided by.
    let third = Vec3::new(u.z, v.z, c.z);
    let row = |n: usize| (Vec3::new(u[n], v[n], c[n]) - third * area.first[n]) / area.texel - third * 0.5;
    let disc = Mat3::from_cols(row(0), row(1), third).inverse();
    // The columns of the inverse of the transposed matrix are the rows of the inverse.
    ([disc.x_axis, disc.y_axis, disc.z_axis], -disc.z_axis)
}

/// The caster of a number.
#[inline(always)]
fn of(casters: &[Vec<Caster>], number: u32) -> &Caster {
    &casters[number as usize / RUN][number as usize % RUN]
}

/// The numbers of the casters that reach into each band of rows, rising.
fn lists(casters: &[Vec<Caster>], bands: usize) -> Vec<Vec<u32>> {
    let mut lists = vec![Vec::new(); bands];
    for (run, casters) in casters.iter().enumerate() {
        for (number, caster) in (run * RUN..).zip(casters) {
            let [first, last] = caster.bounds[1].map(|row| usize::from(row) / ROWS);
            lists[first..=last].iter_mut().for_each(|list| list.push(number as u32));
        }
    }
    lists
}

dispatch! {
    /// Draws the casters of a list onto a band that begins at row `first`.
    fn draw_band(
        casters: &[Vec<Caster>], list: &[u32], first: usize, stride: usize, end: &mut [f32], caster: &mut [u32],
    ) = draw_band_body
}

#[inline(always)]
fn draw_band_body(
    casters: &[Vec<Caster>],
    list: &[u32],
    first: usize,
    stride: usize,
    end: &mut [f32],
    caster: &mut [u32],
) {
    let rows = end.len() / stride;
    for &number in list {
        let of = of(casters, number);
        let [[left, right], [top, bottom]] = of.bounds.map(|ends| ends.map(usize::from));
        for y in top.max(first)..=bottom.min(first + rows - 1) {
            let at = |row: Vec3| row.y * y as f32 + row.z;
            let [a0, b0, c0] = of.disc.map(at);
            let plane = at(of.plane) + of.tolerance;
            for x in (left..=right).step_by(LANES) {
                let begin = (y - first) * stride + x;
                let Some(end) = end[begin..].first_chunk_mut::<LANES>() else { continue };
                let Some(caster) = caster[begin..].first_chunk_mut::<LANES>() else { continue };
                // Masks of bits keep the loops in vectors; branches would not.
                let mut distance = [0.0_f32; LANES];
                for l in 0..LANES {
                    let x = (x + l) as f32;
                    let (a, b, c) = (a0 + of.disc[0].x * x, b0 + of.disc[1].x * x, c0 + of.disc[2].x * x);
                    let covers = (a * a + b * b <= c * c) & (c > 0.0);
                    let on_plane = plane + of.plane.x * x;
                    distance[l] = f32::from_bits(on_plane.to_bits() | u32::from(covers).wrapping_sub(1));
                }
                // What it does not cover is not a number here.
                let before = *end;
                for l in 0..LANES {
                    let stops = 0_u32.wrapping_sub(u32::from(distance[l] < before[l]));
                    caster[l] = number & stops | caster[l] & !stops;
                }
                // In this form it is a minimum, and stored whole. What is stored under a mask is slow to read again.
                for l in 0..LANES {
                    end[l] = if distance[l] < before[l] { distance[l] } else { before[l] };
                }
            }
        }
    }
}

/// Least and greatest x, then y, of a disc on the plane of a view: of one that reaches behind a point light, all.
fn covered(c: Vec3, [u, v]: [Vec3; 2], view: &LightView) -> [[f32; 2]; 2] {
    let corners = [c + u + v, c + u - v, c - u + v, c - u - v];
    let reaches_light = view.is_point && corners.iter().any(|corner| corner.z <= 1e-3 * c.z.abs());
    [0, 1].map(|n: usize| {
        if reaches_light {
            [f32::NEG_INFINITY, f32::INFINITY]
        } else if view.is_point {
            let places = corners.map(|corner| corner[n] / corner.z);
            [places.into_iter().fold(f32::INFINITY, f32::min), places.into_iter().fold(f32::NEG_INFINITY, f32::max)]
        } else {
            let extent = (u[n] * u[n] + v[n] * v[n]).sqrt();
            [c[n] - extent, c[n] + extent]
        }
    })
}

/// First and last column and row of the texels whose middles lie within a rectangle.
fn texels(covered: [[f32; 2]; 2], area: &MapArea) -> Option<[[u16; 2]; 2]> {
    let mut out = [[0; 2]; 2];
    for n in 0..2 {
        let [low, high] = covered[n].map(|place| (place - area.first[n]) / area.texel - 0.5);
        let last = (area.size[n] - 1) as f32;
        if !(low <= last && high >= 0.0) {
            return None;
        }
        // Not `ceil`, which is a call without SSE4.
        let first = low.max(0.0) as u16;
        out[n] = [first + u16::from(f32::from(first) < low), high.min(last) as u16];
        if out[n][0] > out[n][1] {
            return None;
        }
    }
    Some(out)
}

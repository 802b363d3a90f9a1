//! Casters of a shadow map: surfels and discs of Gaussians, as a view of a light shows them.

use glam::{Mat3, Vec3};

use super::cells::{Cells, Ground};
use super::discs::Discs;
use super::fit::{MapArea, on_view};
use super::view::LightView;
use super::{GRAZING, ROUNDING};
use crate::backend::cpu::columns::{RUN, lengths, point};
use crate::backend::cpu::tiles::{LANES, Lanes};

/// A surfel as a view of a light shows it. Places (x, y) are in texels, whole at their middles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Caster {
    /// (a, b) on the disc, in units of its axes, times c: each as (x, y, 1) times a row.
    disc: [Vec3; 3],
    /// First and last column, then row.
    pub bounds: [[u16; 2]; 2],
}

/// Where a caster stops light. Apart from it, as this alone is looked up.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Plane {
    /// The distance of its plane at (x, y, 1), as [`LightView::on_plane`] has it.
    pub distance: [f32; 3],
    /// Added to it.
    pub tolerance: f32,
}

/// The casters of a map: the number of each is that of its run times [`RUN`], and its place in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Casters<'a> {
    pub of_runs: &'a [Vec<Caster>],
    pub planes: &'a [Plane],
}

impl<'a> Casters<'a> {
    #[inline(always)]
    pub(super) fn of(self, number: u32) -> (&'a Caster, &'a Plane) {
        let number = number as usize;
        (&self.of_runs[number / RUN][number % RUN], &self.planes[number])
    }
}

/// How an end of light lies behind the surfel that stops it: its distance is that of the surfel over a factor, plus a
/// length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moved {
    pub factor: f32,
    pub by: f32,
}

/// What a map is drawn onto.
pub(super) struct Onto<'a> {
    pub area: &'a MapArea,
    pub view: &'a LightView,
    pub cells: &'a Cells,
    pub ground: &'a Ground,
    /// A layer stops light where its opacity is above its chance.
    pub chances: &'a [f32],
}

impl Onto<'_> {
    /// May what is in a box with this middle and half size cast a shadow onto anything that receives one? `epsilon`:
    /// its depth tolerance.
    pub(super) fn may_show(&self, middle: Vec3, half: Vec3, epsilon: f32) -> bool {
        let (place, extent, reach) = (self.view.place(middle), self.view.extent(half), half.length());
        let bounds = if self.view.is_point {
            on_view(self.view, place, reach)
        } else {
            Some([0, 1].map(|c: usize| [place[c] - extent[c], place[c] + extent[c]]))
        };
        let tolerance = self.ground.moved(epsilon, place.length() + reach, place.z + reach);
        let behind = || self.ground.behind(place, reach, self.ground.of_box(half))[0] + tolerance;
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
    /// Hands on those of `count` discs that may cast a shadow that is seen: number of the disc, caster, its plane, and
    /// how its end of light is moved. `epsilon`: their depth tolerance. A disc casts with both sides, whichever of them
    /// shows: each sheet has a shadow, and the backs of a closed model lie behind its fronts.
    #[inline(always)]
    pub(super) fn of(
        discs: &Discs,
        count: usize,
        epsilon: f32,
        on: &Onto<'_>,
        mut take: impl FnMut(usize, Self, Plane, Moved),
    ) {
        let half = on.ground.of_discs(&discs.axes);
        if on.view.is_point {
            for l in 0..count {
                if let Some((caster, plane, moved)) = Self::before_point(discs.at(l), half[l], epsilon, on) {
                    take(l, caster, plane, moved);
                }
            }
            return;
        }
        let shown = Shown::of(discs, &half, epsilon, on);
        for l in 0..count {
            // In this order: many discs of fine models have no middle of a texel.
            if shown.is_on_map[l] == 0 || on.hides(shown.covered(l), shown.behind[l]) {
                continue;
            }
            let bounds = shown.texels.map(|ends| ends.map(|end| end[l] as u16));
            let [a, b, distance] = [0, 1, 2].map(|row: usize| point(&shown.rows[row], l));
            let tolerance = shown.tolerance[l];
            let plane = Plane { distance: distance.into(), tolerance };
            take(l, Self { disc: [a, b, Vec3::Z], bounds }, plane, Moved { factor: 1.0, by: tolerance });
        }
    }

    /// A disc before the light of a point: its centre relative to the eye in world axes, and in those of the view; and
    /// its axes there. `half`: as [`Ground::of_discs`].
    fn before_point(
        (centre, c, [u, v]): (Vec3, Vec3, [Vec3; 2]),
        half: f32,
        epsilon: f32,
        on: &Onto<'_>,
    ) -> Option<(Self, Plane, Moved)> {
        let Onto { area, view, ground, .. } = on;
        // What is beside a face of the cube is on another.
        let radius = (u.length_squared() + v.length_squared()).sqrt();
        if view.is_beside(c, radius) {
            return None;
        }
        let covered = covered(c, [u, v]);
        if !area.touches(covered) {
            return None;
        }
        let normal = u.cross(v);
        let cosine = (normal.dot(c) / c.length() / normal.length()).abs().max(GRAZING);
        let rounding = ROUNDING * (centre.length() + c.length());
        let tolerance = epsilon.max(rounding) / cosine;
        let moved = ground.moved(tolerance, c.length(), c.z + radius);
        if on.hides(covered, ground.behind(c, radius, half)[0] + moved) {
            return None;
        }
        let bounds = texels(covered, area)?;
        let (disc, plane) = seen_from_point(c, [u, v], area);
        // The plane itself is moved away.
        let factor = 1.0 + tolerance / c.length();
        let distance = plane / factor;
        let plane = Plane { distance: distance.into(), tolerance: 0.0 };
        let is_finite = distance.is_finite() && disc[0].is_finite() && disc[1].is_finite();
        is_finite.then_some((Self { disc, bounds }, plane, Moved { factor, by: 0.0 }))
    }

    /// The values of its rows at row `y` of the map: those of the disc, then the end of light.
    #[inline(always)]
    pub(super) fn on_row(&self, plane: &Plane, y: usize) -> [f32; 4] {
        let at = |row: Vec3| row.y * y as f32 + row.z;
        let [a, b, c] = self.disc.map(at);
        [a, b, c, at(plane.distance.into()) + plane.tolerance]
    }

    /// The distances at which light ends at `LANES` texels from column `x` on, of a row with these values; not numbers
    /// where it does not cover them.
    #[inline(always)]
    pub(super) fn ends(&self, plane: &Plane, [a0, b0, c0, distance0]: [f32; 4], x: usize) -> Lanes {
        // Masks of bits keep the loop in vectors; branches would not.
        let mut distance = [0.0_f32; LANES];
        for l in 0..LANES {
            let x = (x + l) as f32;
            let (a, b, c) = (a0 + self.disc[0].x * x, b0 + self.disc[1].x * x, c0 + self.disc[2].x * x);
            let covers = (a * a + b * b <= c * c) & (c > 0.0);
            let on_plane = distance0 + plane.distance[0] * x;
            distance[l] = f32::from_bits(on_plane.to_bits() | u32::from(covers).wrapping_sub(1));
        }
        distance
    }
}

/// What parallel rays show of `LANES` discs.
struct Shown {
    /// Least and greatest x, then y, on the plane of the view.
    bounds: [[Lanes; 2]; 2],
    tolerance: Lanes,
    /// How far behind the ground their ends of light are at the least.
    behind: Lanes,
    /// First and last column, then row, of the texels whose middles lie within their bounds.
    texels: [[[i32; LANES]; 2]; 2],
    /// Rows (x, y, 1) of their axes, and of their planes.
    rows: [[Lanes; 3]; 3],
    /// 1 where there are such texels and all is finite, else 0.
    is_on_map: [u32; LANES],
}

impl Shown {
    #[inline(always)]
    fn of(discs: &Discs, half: &Lanes, epsilon: f32, on: &Onto<'_>) -> Self {
        let Onto { area, ground, .. } = on;
        let (c, [u, v]) = (&discs.seen, &discs.axes);
        let zero = [[[0.0; LANES]; 2]; 2];
        let (mut bounds, mut texels, mut is_on_map) = (zero, [[[0; LANES]; 2]; 2], [1; LANES]);
        for n in 0..2 {
            let (first, texel, last) = (area.first[n], area.texel, (area.size[n] - 1) as f32);
            for l in 0..LANES {
                let extent = (u[n][l] * u[n][l] + v[n][l] * v[n][l]).sqrt();
                let (low, high) = (c[n][l] - extent, c[n][l] + extent);
                (bounds[n][0][l], bounds[n][1][l]) = (low, high);
                let [low, high] = [low, high].map(|place| (place - first) / texel - 0.5);
                // Not `ceil`, which is a call without SSE4.
                let before = low.max(0.0).min(last) as i32;
                let begin = before + i32::from((before as f32) < low);
                let end = high.min(last) as i32;
                (texels[n][0][l], texels[n][1][l]) = (begin, end);
                is_on_map[l] &= u32::from((low <= last) & (high >= 0.0) & (begin <= end));
            }
        }
        let [of_centre, of_seen] = [lengths(&discs.centre), lengths(c)];
        let middle = ground.middles(c);
        let (mut tolerance, mut behind) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            let normal = [
                u[1][l] * v[2][l] - v[1][l] * u[2][l],
                u[2][l] * v[0][l] - v[2][l] * u[0][l],
                u[0][l] * v[1][l] - v[0][l] * u[1][l],
            ];
            let length = (normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]).sqrt();
            let cosine = (normal[2] / length).abs().max(GRAZING);
            let rounding = ROUNDING * (of_centre[l] + of_seen[l]);
            tolerance[l] = epsilon.max(rounding) / cosine;
            behind[l] = middle[l] - half[l] + tolerance[l];
        }
        let rows = Self::rows(discs, area);
        for l in 0..LANES {
            // What is not finite in any of them is not in their sum.
            let sum: f32 = rows.iter().map(|row| row[0][l].abs() + row[1][l].abs() + row[2][l].abs()).sum();
            is_on_map[l] &= u32::from((sum + tolerance[l]).is_finite());
        }
        Self { bounds, tolerance, behind, texels, rows, is_on_map }
    }

    #[inline(always)]
    fn rows(discs: &Discs, area: &MapArea) -> [[Lanes; 3]; 3] {
        let (c, [u, v]) = (&discs.seen, &discs.axes);
        let mut rows = [[[0.0; LANES]; 3]; 3];
        for l in 0..LANES {
            let over = area.texel / (u[0][l] * v[1][l] - v[0][l] * u[1][l]);
            // The centre, in texels.
            let [x, y] = [0, 1].map(|n: usize| (c[n][l] - area.first[n]) / area.texel - 0.5);
            let row = |dx: f32, dy: f32| [dx * over, dy * over, -(dx * x + dy * y) * over];
            let (a, b) = (row(v[1][l], -v[0][l]), row(-u[1][l], u[0][l]));
            let distance = |n: usize| a[n] * u[2][l] + b[n] * v[2][l];
            for n in 0..3 {
                (rows[0][n][l], rows[1][n][l], rows[2][n][l]) = (a[n], b[n], distance(n));
            }
            rows[2][2][l] += c[2][l];
        }
        rows
    }

    fn covered(&self, l: usize) -> [[f32; 2]; 2] {
        self.bounds.map(|ends| ends.map(|end| end[l]))
    }
}

/// Rows of a disc and of its plane, as [`Caster`] and [`Plane`] have them, where rays start at a point.
fn seen_from_point(c: Vec3, [u, v]: [Vec3; 2], area: &MapArea) -> ([Vec3; 3], Vec3) {
    // The third row is what places are divided by.
    let third = Vec3::new(u.z, v.z, c.z);
    let row = |n: usize| (Vec3::new(u[n], v[n], c[n]) - third * area.first[n]) / area.texel - third * 0.5;
    let disc = Mat3::from_cols(row(0), row(1), third).inverse();
    // The columns of the inverse of the transposed matrix are the rows of the inverse.
    ([disc.x_axis, disc.y_axis, disc.z_axis], -disc.z_axis)
}

/// Least and greatest x, then y, of a disc on the plane of a point light's view: of one that reaches behind the light,
/// all.
fn covered(c: Vec3, [u, v]: [Vec3; 2]) -> [[f32; 2]; 2] {
    let corners = [c + u + v, c + u - v, c - u + v, c - u - v];
    if corners.iter().any(|corner| corner.z <= 1e-3 * c.z.abs()) {
        return [[f32::NEG_INFINITY, f32::INFINITY]; 2];
    }
    [0, 1].map(|n: usize| {
        let places = corners.map(|corner| corner[n] / corner.z);
        [places.into_iter().fold(f32::INFINITY, f32::min), places.into_iter().fold(f32::NEG_INFINITY, f32::max)]
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

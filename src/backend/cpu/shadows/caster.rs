//! Casters of a shadow map: surfels and discs of Gaussians, as a view of a light shows them.

use glam::{Mat3, Vec3};

use super::cells::{Cells, Ground};
use super::fit::{MapArea, on_view};
use super::run::{RUN, SeenRun};
use super::splats::Disc;
use super::view::LightView;
use super::{GRAZING, ROUNDING};
use crate::backend::cpu::tiles::{LANES, Lanes};

/// A surfel as a view of a light shows it. Places (x, y) are in texels, whole at their middles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Caster {
    /// (a, b) on the disc, in units of its axes, times c: each as (x, y, 1) times a row.
    disc: [Vec3; 3],
    /// The distance of its plane at (x, y, 1), as [`LightView::on_plane`] has it.
    pub plane: Vec3,
    /// Added to it.
    pub tolerance: f32,
    /// First and last column, then row.
    pub bounds: [[u16; 2]; 2],
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
    /// Surfel `i` of a run, and how its end of light is moved; `None` where no shadow of it is seen. It casts with both
    /// sides, whichever of them shows: each sheet has a shadow, and the backs of a closed model lie behind its fronts.
    pub(super) fn of(run: &SeenRun<'_>, i: usize, on: &Onto<'_>) -> Option<(Self, Moved)> {
        Self::of_disc(run.run.centre(i), run.centre(i), run.axes(i), run.run.object.epsilon, on)
    }

    /// The same of a Gaussian, which only rounding moves away.
    pub(super) fn of_splat(disc: &Disc, on: &Onto<'_>) -> Option<Self> {
        let axes = disc.axes.map(|axis| on.view.turned(axis));
        Self::of_disc(disc.centre, on.view.place(disc.centre), axes, 0.0, on).map(|(caster, _)| caster)
    }

    /// The same of a disc: its centre relative to the eye in world axes, and in those of the view; and its axes there.
    fn of_disc(centre: Vec3, c: Vec3, [u, v]: [Vec3; 2], epsilon: f32, on: &Onto<'_>) -> Option<(Self, Moved)> {
        let Onto { area, view, ground, .. } = on;
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
        let rounding = ROUNDING * (centre.length() + c.length());
        let tolerance = epsilon.max(rounding) / cosine;
        let moved = ground.moved(tolerance, c.length(), c.z + radius);
        if on.hides(covered, ground.behind(c, radius, ground.of_disc([u, v]))[0] + moved) {
            return None;
        }
        let bounds = texels(covered, area)?;
        let (disc, plane) =
            if view.is_point { seen_from_point(c, [u, v], area) } else { seen_parallel(c, [u, v], area) };
        // Of a point light the plane itself is moved away.
        let factor = if view.is_point { 1.0 + tolerance / c.length() } else { 1.0 };
        let plane = if view.is_point { plane / factor } else { plane };
        let tolerance = if view.is_point { 0.0 } else { tolerance };
        let is_finite = plane.is_finite() && disc[0].is_finite() && disc[1].is_finite() && tolerance.is_finite();
        is_finite.then_some((Self { disc, plane, tolerance, bounds }, Moved { factor, by: tolerance }))
    }

    /// The values of its rows at row `y` of the map: those of the disc, then the end of light.
    #[inline(always)]
    pub(super) fn on_row(&self, y: usize) -> [f32; 4] {
        let at = |row: Vec3| row.y * y as f32 + row.z;
        let [a, b, c] = self.disc.map(at);
        [a, b, c, at(self.plane) + self.tolerance]
    }

    /// The distances at which light ends at `LANES` texels from column `x` on, of a row with these values; not numbers
    /// where it does not cover them.
    #[inline(always)]
    pub(super) fn ends(&self, [a0, b0, c0, plane]: [f32; 4], x: usize) -> Lanes {
        // Masks of bits keep the loop in vectors; branches would not.
        let mut distance = [0.0_f32; LANES];
        for l in 0..LANES {
            let x = (x + l) as f32;
            let (a, b, c) = (a0 + self.disc[0].x * x, b0 + self.disc[1].x * x, c0 + self.disc[2].x * x);
            let covers = (a * a + b * b <= c * c) & (c > 0.0);
            let on_plane = plane + self.plane.x * x;
            distance[l] = f32::from_bits(on_plane.to_bits() | u32::from(covers).wrapping_sub(1));
        }
        distance
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
pub(super) fn of(casters: &[Vec<Caster>], number: u32) -> &Caster {
    &casters[number as usize / RUN][number as usize % RUN]
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

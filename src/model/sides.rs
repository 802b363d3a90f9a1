//! Whether estimated signs of normals can be relied on: does the cloud show only fronts, from wherever one looks at it?

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Cells along an edge of the picture of one view.
const CELLS: usize = 192;
/// Fewest points that a shape can be told from: those that one normal is estimated from, and the point itself.
pub(super) const FEWEST: usize = 17;
/// Least cosine between a disc and the view at which it is drawn: edge-on it covers nothing.
const EDGE_ON: f64 = 0.05;
/// Greatest share of a view that may show backs where the signs are relied on.
///
/// Measured (docs/measurements/sides.md): closed clouds of 200 points and more show up to 0.032, a sphere without 2.5 %
/// of its area shows 0.075, and sheets, rooms and scans from one side show 0.2 to 1.
const MOST: f64 = 0.05;

/// Directions from which a cloud is looked at, and extreme points are sought: the faces and corners of a cube.
pub(super) fn directions() -> impl Iterator<Item = Vec3> {
    let faces = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|d| [d, -d]);
    let corners = (0..8).map(|i| {
        let sign = |bit: u32| if i >> bit & 1 == 0 { 1.0 } else { -1.0 };
        Vec3::new(sign(0), sign(1), sign(2)).normalize()
    });
    faces.chain(corners)
}

/// A cloud of discs whose fronts are where their normals point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Discs<'a> {
    pub(super) position: &'a [Vec3],
    pub(super) normal: &'a [Vec3],
    pub(super) radius: &'a [f32],
    /// True where the sign follows from normals that the file gives: such a disc shows no back, whatever it shows.
    pub(super) guided: &'a [bool],
}

impl Discs<'_> {
    /// Share of the view that shows backs, 0..=1, in the worst of 14 parallel views from outside.
    ///
    /// A closed surface with its normals outward has none. A sheet has nothing else in the views from behind, and an
    /// opening shows the backs of what lies behind it. So the share is what a picture from outside would lose if backs
    /// were left out.
    pub(super) fn most_backs(&self) -> f64 {
        let directions: Vec<Vec3> = directions().collect();
        directions.par_iter().map(|&to_viewer| self.backs(to_viewer.as_dvec3())).reduce(|| 0.0, f64::max)
    }

    /// True if no view from outside loses more than [`MOST`] where backs are left out, as known from
    /// [`most_backs`](Self::most_backs).
    pub(super) fn reliable(&self, most_backs: f64) -> bool {
        let told = self.position.len() >= FEWEST || !self.guided.contains(&false);
        told && most_backs <= MOST
    }

    /// About the most cells of the picture of one view that all discs fill.
    pub(super) fn cells(&self) -> f64 {
        let least = self.position.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let greatest = self.position.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        let cell = f64::from((greatest - least).max_element()) / CELLS as f64;
        let across = |radius: &f32| (2.0 * f64::from(*radius) / cell + 1.0).min(CELLS as f64);
        self.radius.iter().map(|radius| across(radius) * across(radius)).sum()
    }

    /// Share of what is seen along -`to_viewer` that shows its back.
    pub(super) fn backs(&self, to_viewer: DVec3) -> f64 {
        let (right, up) = to_viewer.any_orthonormal_pair();
        let across = |p: &Vec3| [p.as_dvec3().dot(right), p.as_dvec3().dot(up)];
        let (low, high) = self
            .position
            .iter()
            .map(across)
            .fold(([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]), |(low, high), [x, y]| {
                ([low[0].min(x), low[1].min(y)], [high[0].max(x), high[1].max(y)])
            });
        let cell = (high[0] - low[0]).max(high[1] - low[1]) / CELLS as f64;
        if cell.is_nan() || cell <= 0.0 {
            return 0.0;
        }
        // Depth of the nearest disc, and whether its back shows.
        let mut seen = vec![(f64::NEG_INFINITY, false); CELLS * CELLS];
        for (i, p) in self.position.iter().enumerate() {
            let [x, y] = across(p);
            // In cells; the depth grows towards the viewer.
            let (x, y, z) = ((x - low[0]) / cell, (y - low[1]) / cell, p.as_dvec3().dot(to_viewer) / cell);
            let n = self.normal[i].as_dvec3();
            let facing = n.dot(to_viewer);
            if facing.abs() < EDGE_ON {
                continue;
            }
            let back = facing < 0.0 && !self.guided[i];
            let slope = [-n.dot(right) / facing, -n.dot(up) / facing];
            let radius = f64::from(self.radius[i]) / cell;
            let mut show = |column: usize, row: usize, depth: f64| {
                let at = &mut seen[row * CELLS + column];
                if depth > at.0 {
                    *at = (depth, back);
                }
            };
            let inside = |c: f64| c.clamp(0.0, (CELLS - 1) as f64) as usize;
            // A disc that is smaller than a cell shows in the cell of its centre.
            show(inside(x), inside(y), z);
            for row in inside(y - radius)..=inside(y + radius) {
                for column in inside(x - radius)..=inside(x + radius) {
                    let (dx, dy) = (column as f64 + 0.5 - x, row as f64 + 0.5 - y);
                    let dz = slope[0] * dx + slope[1] * dy;
                    if dx * dx + dy * dy + dz * dz <= radius * radius {
                        show(column, row, z + dz);
                    }
                }
            }
        }
        let covered = seen.iter().filter(|(depth, _)| *depth > f64::NEG_INFINITY).count();
        let backs = seen.iter().filter(|(_, back)| *back).count();
        backs as f64 / covered.max(1) as f64
    }
}

#[cfg(test)]
mod tests;

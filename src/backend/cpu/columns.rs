//! Surfels of a model coordinate by coordinate, as loops over lanes take them, and sums over such lanes.

use std::ops::Range;

use glam::{Mat3, Vec3};

use crate::backend::clusters::CLUSTER_SURFELS;
use crate::model::Surfels;
use crate::model::paths::{Elapsed, Paths};

/// Surfels that are turned from points into coordinates at once.
pub(in crate::backend) const RUN: usize = CLUSTER_SURFELS;
/// So many points.
pub(in crate::backend) type Points = [[f32; RUN]; 3];

/// Surfels of a run, in model space.
pub(in crate::backend) struct Columns {
    pub position: Points,
    pub axis_u: Points,
    pub axis_v: Points,
}

impl Default for Columns {
    fn default() -> Self {
        let zero = [[0.0; RUN]; 3];
        Self { position: zero, axis_u: zero, axis_v: zero }
    }
}

impl Columns {
    /// Takes at most [`RUN`] surfels. What is beyond them stays what it was.
    #[inline(always)]
    pub(in crate::backend) fn load(&mut self, surfels: &Surfels, range: Range<usize>) {
        split(&surfels.position[range.clone()], &mut self.position);
        split(&surfels.axis_u[range.clone()], &mut self.axis_u);
        split(&surfels.axis_v[range], &mut self.axis_v);
    }

    /// Position, axis u and axis v of `N` surfels from surfel `first` of the run on.
    #[inline(always)]
    pub(in crate::backend) fn lanes<const N: usize>(&self, first: usize) -> [[[f32; N]; 3]; 3] {
        [lanes(&self.position, first), lanes(&self.axis_u, first), lanes(&self.axis_v, first)]
    }
}

/// Adds to points what surfels travel by themselves: the columns of their paths times `factors`.
#[inline(always)]
pub(in crate::backend) fn add_rates(
    points: &mut Points,
    paths: &Paths<'_>,
    range: Range<usize>,
    factors: Elapsed<f32>,
) {
    for (column, factor) in paths.columns.iter().zip(factors) {
        let Some(rates) = column.get(range.clone()) else { continue };
        for (l, rate) in rates.iter().enumerate() {
            let shift = *rate * factor;
            points[0][l] += shift.x;
            points[1][l] += shift.y;
            points[2][l] += shift.z;
        }
    }
}

/// Points to coordinates. The loop is long, as compilers turn a short one into single moves.
#[inline(always)]
fn split(points: &[Vec3], [x, y, z]: &mut Points) {
    let flat: &[[f32; 3]] = bytemuck::cast_slice(points);
    for (((point, x), y), z) in flat.iter().zip(x).zip(y).zip(z) {
        [*x, *y, *z] = *point;
    }
}

/// `N` points from point `first` on.
#[inline(always)]
pub(in crate::backend) fn lanes<const N: usize>(points: &Points, first: usize) -> [[f32; N]; 3] {
    let mut out = [[0.0; N]; 3];
    for c in 0..3 {
        out[c].copy_from_slice(&points[c][first..][..N]);
    }
    out
}

/// m p + origin, for `N` points coordinate by coordinate.
#[inline(always)]
pub(in crate::backend) fn transform<const N: usize>(m: &Mat3, origin: Vec3, p: &[[f32; N]; 3]) -> [[f32; N]; 3] {
    let m = m.to_cols_array_2d();
    let origin = origin.to_array();
    let mut out = [[0.0; N]; 3];
    for row in 0..3 {
        for l in 0..N {
            out[row][l] = m[0][row] * p[0][l] + m[1][row] * p[1][l] + m[2][row] * p[2][l] + origin[row];
        }
    }
    out
}

/// Point `l` of several.
#[inline(always)]
pub(in crate::backend) fn point<const N: usize>(points: &[[f32; N]; 3], l: usize) -> Vec3 {
    Vec3::new(points[0][l], points[1][l], points[2][l])
}

/// Directions under a map, in the order of sums that [`Mat3`] has.
#[inline(always)]
pub(in crate::backend) fn turn<const N: usize>(map: &Mat3, v: &[[f32; N]; 3]) -> [[f32; N]; 3] {
    let map = map.to_cols_array_2d();
    let mut out = [[0.0; N]; 3];
    for row in 0..3 {
        for l in 0..N {
            out[row][l] = map[0][row] * v[0][l] + map[1][row] * v[1][l] + map[2][row] * v[2][l];
        }
    }
    out
}

/// The dot product of a vector with several.
#[inline(always)]
pub(in crate::backend) fn dot<const N: usize>(a: Vec3, v: &[[f32; N]; 3]) -> [f32; N] {
    let mut out = [0.0; N];
    for l in 0..N {
        out[l] = a.x * v[0][l] + a.y * v[1][l] + a.z * v[2][l];
    }
    out
}

/// Lengths of several vectors.
#[inline(always)]
pub(in crate::backend) fn lengths<const N: usize>(v: &[[f32; N]; 3]) -> [f32; N] {
    let mut out = [0.0; N];
    for l in 0..N {
        out[l] = (v[0][l] * v[0][l] + v[1][l] * v[1][l] + v[2][l] * v[2][l]).sqrt();
    }
    out
}

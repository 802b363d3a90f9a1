//! `LANES` discs at once, coordinate by coordinate, as a view of a light shows them.

use glam::{Mat3, Vec3};

use super::splats::Disc;
use super::view::LightView;
use crate::backend::cpu::tiles::{LANES, Lanes};

/// Surfels, or discs of Gaussians.
pub(super) struct Discs {
    /// Centres relative to the eye, world axes.
    pub centre: [Lanes; 3],
    /// The same in the view's axes, relative to where its rays start.
    pub seen: [Lanes; 3],
    /// Axes u and v, in those of the view.
    pub axes: [[Lanes; 3]; 2],
}

impl Discs {
    /// At most `LANES` discs of Gaussians. Other lanes are 0.
    pub(super) fn of(discs: &[Disc], view: &LightView) -> Self {
        let zero = [[0.0; LANES]; 3];
        let mut out = Self { centre: zero, seen: zero, axes: [zero; 2] };
        for (l, disc) in discs.iter().enumerate() {
            let seen = view.place(disc.centre);
            let [u, v] = disc.axes.map(|axis| view.turned(axis));
            for c in 0..3 {
                (out.centre[c][l], out.seen[c][l]) = (disc.centre[c], seen[c]);
                (out.axes[0][c][l], out.axes[1][c][l]) = (u[c], v[c]);
            }
        }
        out
    }

    /// Centre, and then as the view shows it: centre, and axes.
    pub(super) fn at(&self, l: usize) -> (Vec3, Vec3, [Vec3; 2]) {
        (point(&self.centre, l), point(&self.seen, l), self.axes.map(|axis| point(&axis, l)))
    }
}

/// Point `l` of several.
#[inline(always)]
pub(super) fn point(points: &[Lanes; 3], l: usize) -> Vec3 {
    Vec3::new(points[0][l], points[1][l], points[2][l])
}

/// Directions under a map, in the order of sums that [`Mat3`] has.
#[inline(always)]
pub(super) fn turn<const N: usize>(map: &Mat3, v: &[[f32; N]; 3]) -> [[f32; N]; 3] {
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
pub(super) fn dot(a: Vec3, v: &[Lanes; 3]) -> Lanes {
    let mut out = [0.0; LANES];
    for l in 0..LANES {
        out[l] = a.x * v[0][l] + a.y * v[1][l] + a.z * v[2][l];
    }
    out
}

/// Lengths of several vectors.
#[inline(always)]
pub(super) fn lengths<const N: usize>(v: &[[f32; N]; 3]) -> [f32; N] {
    let mut out = [0.0; N];
    for l in 0..N {
        out[l] = (v[0][l] * v[0][l] + v[1][l] * v[1][l] + v[2][l] * v[2][l]).sqrt();
    }
    out
}

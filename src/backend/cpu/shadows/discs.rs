//! `LANES` discs at once, coordinate by coordinate, as a view of a light shows them.

use glam::Vec3;

use super::splats::Disc;
use super::view::LightView;
use crate::backend::cpu::columns::point;
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

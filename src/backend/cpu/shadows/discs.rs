//! `LANES` discs at once, coordinate by coordinate, as a view of a light shows them.

use glam::Vec3;

use super::splats::Disc;
use super::view::LightView;
use crate::backend::cpu::columns::point;
use crate::backend::cpu::tiles::{LANES, Lanes};
use crate::math::sphere;

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

    /// Turns a disc into that of a sphere, as the light shows it: behind it is what the sphere hides.
    #[inline(always)]
    pub(super) fn face_light(&mut self, l: usize, radius: f32, is_point: bool) {
        let mut scale = radius;
        let mut across = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        if is_point {
            let disc = sphere::outline([self.seen[0][l], self.seen[1][l], self.seen[2][l]], radius);
            self.seen.iter_mut().for_each(|seen| seen[l] *= disc.nearer);
            (scale, across) = (disc.radius, disc.across);
        }
        for (axis, across) in self.axes.iter_mut().zip(across) {
            axis.iter_mut().zip(across).for_each(|(axis, across)| axis[l] = across * scale);
        }
    }

    /// Centre, and then as the view shows it: centre, and axes.
    pub(super) fn at(&self, l: usize) -> (Vec3, Vec3, [Vec3; 2]) {
        (point(&self.centre, l), point(&self.seen, l), self.axes.map(|axis| point(&axis, l)))
    }
}

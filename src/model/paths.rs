//! How points move by themselves.

use glam::{DVec3, Vec3};

use super::surfels::Surfels;
use crate::math::Bounds;

/// The paths of points around the places that a model gives them: p(t) = p + v t + a t^2/2 + j t^3/6. Each column has
/// an entry for each point, or none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Paths<'a> {
    /// Velocities v, accelerations a, and their rates of change j.
    pub columns: [&'a [Vec3]; 3],
}

/// t, t^2/2 and t^3/6: the factors on the columns of [`Paths`].
pub type Elapsed<T> = [T; 3];

/// The factors after the time `t`.
pub fn elapsed(t: f64) -> Elapsed<f64> {
    [t, t * t / 2.0, t * t * t / 6.0]
}

impl Paths<'_> {
    /// True if no point moves by itself.
    pub fn is_empty(&self) -> bool {
        self.columns.iter().all(|column| column.is_empty())
    }

    /// Number of columns up to the last one that is not empty.
    pub fn order(&self) -> usize {
        self.columns.iter().rposition(|column| !column.is_empty()).map_or(0, |last| last + 1)
    }

    /// The sum of the columns of point `i`, with these factors.
    pub fn sum(&self, i: usize, factors: Elapsed<f32>) -> Vec3 {
        let terms = self.columns.iter().zip(factors).filter_map(|(column, factor)| Some(*column.get(i)? * factor));
        terms.fold(Vec3::ZERO, |sum, term| sum + term)
    }

    /// Where point `i` is that a model has at `position`.
    #[inline(always)]
    pub fn place(&self, position: Vec3, i: usize, elapsed: Elapsed<f32>) -> Vec3 {
        // In this order, as programs of the GPU do.
        let mut place = position;
        for (column, factor) in self.columns.iter().zip(elapsed) {
            if let Some(rate) = column.get(i) {
                place += *rate * factor;
            }
        }
        place
    }

    /// The velocity of point `i`, per unit of time of the paths.
    #[inline(always)]
    pub fn velocity(&self, i: usize, elapsed: Elapsed<f32>) -> Vec3 {
        let at = |order: usize| self.columns[order].get(i).copied().unwrap_or(Vec3::ZERO);
        at(0) + at(1) * elapsed[0] + at(2) * elapsed[1]
    }

    /// Where point `i` is that a model has at `position`, in `f64`.
    pub fn exact_place(&self, position: Vec3, i: usize, elapsed: Elapsed<f64>) -> DVec3 {
        let terms = self.columns.iter().zip(elapsed).filter_map(|(column, factor)| Some((column.get(i)?, factor)));
        terms.fold(position.as_dvec3(), |place, (rate, factor)| place + rate.as_dvec3() * factor)
    }

    /// How far point `i` is at most from the chord of its path between two times, along each axis: h^2 / 8 times the
    /// greatest second derivative, which a cubic has at an end of the interval, of length h.
    pub fn bend(&self, i: usize, [from, to]: [f64; 2]) -> DVec3 {
        let at = |order: usize| self.columns[order].get(i).map_or(DVec3::ZERO, |rate| rate.as_dvec3());
        let [start, end] = [from, to].map(|time| (at(1) + at(2) * time).abs());
        start.max(end) * ((to - from) * (to - from) / 8.0)
    }

    /// Boxes around the entries of each column; empty for an empty column.
    pub fn bounds(&self) -> [Bounds; 3] {
        self.columns.map(|column| column.iter().map(|rate| rate.as_dvec3()).collect())
    }
}

impl Surfels {
    /// How the surfels move by themselves.
    #[doc(hidden)]
    pub fn paths(&self) -> Paths<'_> {
        Paths { columns: [&self.velocity, &self.acceleration, &[]] }
    }
}

/// Columns of [`Paths`] beside a model's own.
#[derive(Clone, Debug, Default)]
pub struct OwnPaths {
    /// As those of [`Paths`].
    pub columns: [Vec<Vec3>; 3],
}

impl OwnPaths {
    /// The paths.
    pub fn paths(&self) -> Paths<'_> {
        Paths { columns: self.columns.each_ref().map(Vec::as_slice) }
    }

    /// Memory of the columns, bytes.
    pub fn bytes(&self) -> u64 {
        self.columns.iter().map(|column| size_of_val(column.as_slice()) as u64).sum()
    }
}

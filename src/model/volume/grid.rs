//! A regular grid of values.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Values at the corners of a lattice whose axes are at right angles.
///
/// Sample (i, j, k) stands at `origin` + `steps` (i, j, k), model units. Its value is number
/// i + sizes\[0\] (j + sizes\[1\] k).
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Samples along each axis, >= 1.
    pub sizes: [usize; 3],
    /// Place of the first sample, model units.
    pub origin: DVec3,
    /// Columns: the way from a sample to the next along each axis, model units; at right angles to each other.
    pub steps: DMat3,
    /// The values, finite; the first axis varies fastest.
    pub values: Vec<f32>,
    /// Type of the numbers in the file.
    pub storage: &'static str,
    /// What a user should know.
    pub notes: Vec<String>,
}

impl Grid {
    /// Distances of neighbours along the axes, model units.
    pub fn spacings(&self) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|axis| self.steps.col(axis).length()))
    }

    /// Lengths of the grid along its axes, a cell for each sample, model units.
    pub fn extent(&self) -> DVec3 {
        self.spacings() * DVec3::from_array(self.sizes.map(|size| size as f64))
    }

    /// Least and greatest value; infinite the other way round for a grid without values.
    pub fn range(&self) -> [f32; 2] {
        let none = || [f32::INFINITY, f32::NEG_INFINITY];
        let join = |[a, b]: [f32; 2], [c, d]: [f32; 2]| [a.min(c), b.max(d)];
        let of = |values: &[f32]| values.iter().fold(none(), |range, value| join(range, [*value; 2]));
        self.values.par_chunks(1 << 16).map(of).reduce(none, join)
    }

    /// Place of a sample, model units.
    pub(super) fn place(&self, index: [usize; 3]) -> DVec3 {
        self.origin + self.steps * DVec3::from_array(index.map(|i| i as f64))
    }

    /// Values of one layer of the third axis.
    pub(super) fn layer(&self, k: usize) -> &[f32] {
        let size = self.sizes[0] * self.sizes[1];
        self.values.get(k * size..(k + 1) * size).unwrap_or_default()
    }

    /// Gradient of the values at a sample, per model unit: central differences, one-sided at the borders, 0 along an
    /// axis with one sample.
    pub(super) fn gradient(&self, index: [usize; 3]) -> DVec3 {
        let stride = [1, self.sizes[0], self.sizes[0] * self.sizes[1]];
        let here: usize = index.iter().zip(stride).map(|(i, stride)| i * stride).sum();
        let mut gradient = DVec3::ZERO;
        for axis in 0..3 {
            let below = usize::from(index[axis] > 0);
            let above = usize::from(index[axis] + 1 < self.sizes[axis]);
            if below + above == 0 {
                continue;
            }
            let value = |at: usize| self.values.get(at).copied().map_or(0.0, f64::from);
            let rise = value(here + above * stride[axis]) - value(here - below * stride[axis]);
            let step = self.steps.col(axis);
            // The axes are at right angles, so each adds its own part.
            gradient += step * (rise / ((below + above) as f64 * step.length_squared()));
        }
        gradient
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A linear field has the same gradient everywhere, at the borders and in a turned, uneven grid too.
    #[test]
    fn the_gradient_of_a_linear_field_is_its_slope() {
        let slope = DVec3::new(0.5, -2.0, 3.0);
        let turn = DMat3::from_rotation_z(0.7) * DMat3::from_rotation_x(-1.1);
        let sizes = [4, 3, 5];
        let steps = turn * DMat3::from_diagonal(DVec3::new(0.5, -1.0, 2.0));
        let mut grid =
            Grid { sizes, origin: DVec3::new(1.0, 2.0, 3.0), steps, values: vec![], storage: "", notes: vec![] };
        let all: Vec<[usize; 3]> = (0..60).map(|i| [i % 4, i / 4 % 3, i / 12]).collect();
        grid.values = all.iter().map(|index| slope.dot(grid.place(*index)) as f32).collect();
        for index in all {
            // Values of about 30 in single precision are rounded by 2e-6, over a step of 0.5.
            let found = grid.gradient(index);
            assert!((found - slope).length() < 2e-5, "{found} at {index:?}");
        }
        assert!((grid.spacings() - DVec3::new(0.5, 1.0, 2.0)).length() < 1e-15);
        assert!((grid.extent() - DVec3::new(2.0, 3.0, 10.0)).length() < 1e-14);
        let flat = Grid { sizes: [1, 1, 60], ..grid };
        // Rounding of f64 alone: the other axes have one sample.
        assert!(flat.gradient([0, 0, 0]).cross(flat.steps.col(2)).length() < 1e-15);
    }

    #[test]
    fn the_range_is_that_of_all_values() {
        let mut values = vec![0.5; 200_000];
        (values[3], values[150_000]) = (-2.0, 9.0);
        let (sizes, steps) = ([200, 100, 10], DMat3::IDENTITY);
        let grid = Grid { sizes, origin: DVec3::ZERO, steps, values, storage: "", notes: vec![] };
        assert_eq!(grid.range(), [-2.0, 9.0]);
    }
}

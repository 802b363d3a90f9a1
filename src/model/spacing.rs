//! How far the points of a cloud are from their nearest.

use glam::Vec3;
use rayon::prelude::*;

use super::neighbours::Neighbours;

/// Neighbours that a spacing, and a radius, is estimated from.
pub(super) const NEAREST: usize = 6;

/// Distances of a point to its nearest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spacing {
    pub(super) mean: f64,
    /// The lower median.
    pub(super) median: f64,
}

/// The distances of each point to its nearest.
pub(super) fn spacing(position: &[Vec3], neighbours: &Neighbours) -> Vec<Spacing> {
    (0..position.len()).into_par_iter().map(|i| mean_and_median(position, neighbours, i)).collect()
}

/// The nearest neighbours of distinct point `i`.
pub(super) fn nearest(neighbours: &Neighbours, i: usize) -> &[u32] {
    let near = neighbours.of(i);
    &near[..near.len().min(NEAREST)]
}

/// Mean and lower median of the distances from a distinct point to its six nearest.
fn mean_and_median(position: &[Vec3], neighbours: &Neighbours, i: usize) -> Spacing {
    let near = nearest(neighbours, i);
    let p = position[i].as_dvec3();
    let mut distances = [0.0; NEAREST];
    distances.iter_mut().zip(near).for_each(|(d, &j)| *d = p.distance(position[j as usize].as_dvec3()));
    let distances = &mut distances[..near.len()];
    Spacing { mean: distances.iter().sum::<f64>() / near.len() as f64, median: lower_median(distances) }
}

/// The middle value; of an even number of values the lower of the two.
pub(super) fn lower_median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[(values.len() - 1) / 2]
}

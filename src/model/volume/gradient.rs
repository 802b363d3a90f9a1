//! Gradients of samples in no order.

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::samples::Samples;
use crate::model::neighbours::{Distinct, Neighbours};
use crate::model::options::LoadProgress;

/// Neighbours that a gradient is fitted to: about two shells of a cubic lattice.
const NEAREST: usize = 16;

/// The number that is added to the fit's matrix, as a share of its trace. Where all neighbours lie in a plane, the
/// gradient then lies in it too.
const DAMPING: f64 = 1e-9;

/// Gradients of the densities, per model unit: the plane through a sample that fits its nearest neighbours best, by
/// least squares with the weights 1/distance^2. Samples in one place count as one, with their mean. 0 where nothing is
/// known.
pub(super) fn of_samples(samples: &Samples, progress: LoadProgress<'_>) -> Vec<DVec3> {
    // Neighbours are sought around the middle, where single precision is finest.
    let middle = samples.position.iter().fold(DVec3::ZERO, |sum, p| sum + *p / samples.position.len() as f64);
    let near: Vec<Vec3> = samples.position.iter().map(|p| (*p - middle).as_vec3()).collect();
    let distinct = Distinct::new(&near);
    let mut means = vec![(0.0, 0.0); distinct.position.len()];
    for (place, density) in distinct.of.iter().zip(&samples.density) {
        let (sum, count) = &mut means[*place as usize];
        *sum += f64::from(*density);
        *count += 1.0;
    }
    let means: Vec<f64> = means.into_iter().map(|(sum, count)| sum / count).collect();
    let neighbours = Neighbours::new(&distinct.position, NEAREST, progress);
    let fit = |i: usize| {
        let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for &j in neighbours.of(i) {
            let way = (distinct.position[j as usize].as_dvec3()) - distinct.position[i].as_dvec3();
            let distance = way.length();
            let unit = way / distance;
            // The weight makes both sides free of the unit of length, up to one factor.
            matrix += DMat3::from_cols(unit * unit.x, unit * unit.y, unit * unit.z);
            right += unit * ((means[j as usize] - means[i]) / distance);
        }
        let trace = matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z;
        if trace == 0.0 {
            return DVec3::ZERO;
        }
        let damped = matrix + DMat3::from_diagonal(DVec3::splat(DAMPING * trace));
        let gradient = damped.inverse() * right;
        if gradient.is_finite() { gradient } else { DVec3::ZERO }
    };
    let fitted: Vec<DVec3> = (0..means.len()).into_par_iter().map(fit).collect();
    distinct.of.iter().map(|place| fitted[*place as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(position: Vec<DVec3>, field: impl Fn(DVec3) -> f64) -> Samples {
        let density = position.iter().map(|p| field(*p) as f32).collect();
        let radius = vec![0.1; position.len()];
        Samples { position, radius, density, ..Samples::default() }
    }

    /// Places of no order by a low-discrepancy sequence (Roberts 2018).
    fn cloud(n: usize) -> Vec<DVec3> {
        let steps = DVec3::new(0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3);
        (0..n).map(|i| (steps * i as f64).fract()).collect()
    }

    #[test]
    fn the_gradient_of_a_linear_field_is_its_slope() {
        let slope = DVec3::new(0.5, -2.0, 3.0);
        let far = DVec3::new(100.0, -50.0, 7.0);
        let given = samples(cloud(500).into_iter().map(|p| p + far).collect(), |p| slope.dot(p - far));
        for gradient in of_samples(&given, &|_, _| {}) {
            // Densities and places are rounded to single precision, over distances of about 0.1: 1e-6 of the slope.
            assert!((gradient - slope).length() < 2e-5, "{gradient}");
        }
    }

    #[test]
    fn a_plane_of_samples_has_a_gradient_within_it() {
        let given = samples(cloud(200).into_iter().map(|p| DVec3::new(p.x, p.y, 0.0)).collect(), |p| 2.0 * p.x);
        for gradient in of_samples(&given, &|_, _| {}) {
            assert!((gradient - DVec3::new(2.0, 0.0, 0.0)).length() < 2e-5, "{gradient}");
        }
    }

    #[test]
    fn lone_samples_and_copies_have_none() {
        for places in [vec![], vec![DVec3::ONE], vec![DVec3::ONE; 5]] {
            let given = samples(places, |p| p.x);
            assert!(of_samples(&given, &|_, _| {}).iter().all(|gradient| *gradient == DVec3::ZERO));
        }
        // Two of one place count as their mean.
        let mut given = samples(vec![DVec3::ZERO, DVec3::ZERO, DVec3::X], |p| p.x);
        given.density = vec![1.0, 3.0, 4.0];
        let gradients = of_samples(&given, &|_, _| {});
        assert!(gradients.iter().all(|gradient| (*gradient - 2.0 * DVec3::X).length() < 1e-6), "{gradients:?}");
    }
}

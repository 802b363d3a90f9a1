//! Points as spheres: they need a radius, and nothing else is estimated.

use glam::Vec3;
use rayon::prelude::*;

use super::order::morton_codes;
use super::spacing::{self, lower_median};
use super::variance::{self, flatness};

/// Radius of a point that has none, over the median distance to its nearest: spheres of a dense packing overlap a
/// little, so that a fluid has no gaps.
const FACTOR: f64 = 0.65;
/// Radius where there is no distance to estimate one from, model units.
const SINGLE: f32 = 1.0;
/// Points whose neighbours are looked at, for the radius and for the shape of a cloud.
const SEEDS: usize = 128;
/// Points before and behind a seed, along a curve through space, that bound how far its nearest can be.
const WINDOW: usize = 48;
/// Share of the least variance in all of the variance of a neighbourhood, the median of all, from which points fill a
/// volume. Particles have .16 to .18, surfaces .021 at most (docs/measurements/spheres.md).
const FILLS: f64 = 0.1;
/// Fewest seeds that tell it.
const FEWEST: usize = 32;

/// Axes of spheres with these radii, and their normals, which mean nothing.
pub(crate) fn axes(radius: f32) -> [Vec3; 2] {
    [Vec3::X * radius, Vec3::Y * radius]
}

/// Gives points without a radius that of all, and returns it; `None` where each has one.
pub(super) fn complete_radii(position: &[Vec3], radius: &mut [f32]) -> Option<f32> {
    if !radius.contains(&0.0) {
        return None;
    }
    let of_all = usual_radius(position);
    radius.par_iter_mut().filter(|radius| **radius == 0.0).for_each(|radius| *radius = of_all);
    Some(of_all)
}

/// The radius of points that have none: it is one for all.
fn usual_radius(position: &[Vec3]) -> f32 {
    let medians = seeds(position).into_iter().filter_map(|seed| {
        let near = &seed[1..seed.len().min(spacing::NEAREST + 1)];
        let mut distances: Vec<f64> = near.iter().map(|p| p.as_dvec3().distance(seed[0].as_dvec3())).collect();
        (!distances.is_empty()).then(|| lower_median(&mut distances))
    });
    let mut medians: Vec<f64> = medians.collect();
    if medians.is_empty() { SINGLE } else { (FACTOR * lower_median(&mut medians)) as f32 }
}

/// Do points fill a volume, so that they have no surface but that of all together?
pub(super) fn fills_volume(position: &[Vec3]) -> bool {
    let shares = seeds(position).into_iter().filter(|seed| seed.len() > variance::NEAREST).map(|seed| {
        let near: Vec<u32> = (1..=variance::NEAREST as u32).collect();
        flatness(&seed, 0, &near)
    });
    let mut shares: Vec<f64> = shares.collect();
    shares.len() >= FEWEST && lower_median(&mut shares) >= FILLS
}

/// Some points, spread over all, each with those nearest to it that are elsewhere: nearest first. Equal distances go by
/// the order of the cloud.
fn seeds(position: &[Vec3]) -> Vec<Vec<Vec3>> {
    let mut along = morton_codes(position);
    along.par_sort_unstable();
    let count = along.len().min(SEEDS);
    let seeds: Vec<(Vec3, f32)> = (0..count)
        .map(|k| {
            let at = (2 * k + 1) * along.len() / (2 * count);
            let seed = position[along[at].1 as usize];
            let window = &along[at.saturating_sub(WINDOW)..(at + WINDOW + 1).min(along.len())];
            let squares = window.iter().map(|(_, i)| position[*i as usize].distance_squared(seed));
            let mut squares: Vec<f32> = squares.filter(|square| *square > 0.0).collect();
            squares.sort_unstable_by(f32::total_cmp);
            (seed, squares.get(variance::NEAREST - 1).or(squares.last()).copied().unwrap_or(f32::INFINITY))
        })
        .collect();
    let reaches = |(k, (seed, most)): (usize, &(Vec3, f32)), p: Vec3| {
        let square = p.distance_squared(*seed);
        (square > 0.0 && square <= *most).then_some((k, square))
    };
    let mut found: Vec<(usize, f32, usize)> = position
        .par_iter()
        .enumerate()
        .flat_map_iter(|(i, p)| {
            seeds.iter().enumerate().filter_map(move |seed| reaches(seed, *p)).map(move |(k, square)| (k, square, i))
        })
        .collect();
    found.par_sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    let mut out: Vec<Vec<Vec3>> = seeds.iter().map(|(seed, _)| vec![*seed]).collect();
    for (k, _, i) in found {
        if out[k].len() <= variance::NEAREST {
            out[k].push(position[i]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use crate::model::normals::tests::sphere;

    /// Points in a cube.
    fn cube(n: usize) -> Vec<Vec3> {
        let mut random = Random(7);
        (0..n).map(|_| random.vector()).collect()
    }

    #[test]
    fn seeds_have_their_nearest() {
        let points = cube(3000);
        for seed in seeds(&points) {
            let mut all: Vec<f32> = points.iter().map(|p| p.distance_squared(seed[0])).filter(|d| *d > 0.0).collect();
            all.sort_unstable_by(f32::total_cmp);
            let found: Vec<f32> = seed[1..].iter().map(|p| p.distance_squared(seed[0])).collect();
            assert_eq!(found, all[..variance::NEAREST]);
        }
    }

    #[test]
    fn a_cube_is_filled_and_a_sphere_is_not() {
        assert!(fills_volume(&cube(20_000)));
        assert!(!fills_volume(&sphere(20_000)));
        assert!(!fills_volume(&[]));
        assert!(!fills_volume(&[Vec3::ONE; 1000]));
    }

    #[test]
    fn a_lattice_has_spheres_that_overlap_a_little() {
        let lattice: Vec<Vec3> =
            (0..8000).map(|i| Vec3::new((i % 20) as f32, (i / 20 % 20) as f32, (i / 400) as f32)).collect();
        let mut radius = vec![0.0; lattice.len()];
        radius[5] = 2.0;
        assert_eq!(complete_radii(&lattice, &mut radius), Some(0.65));
        assert_eq!((radius[4], radius[5]), (0.65, 2.0));
        assert_eq!(complete_radii(&lattice, &mut radius), None);
        assert_eq!(usual_radius(&[Vec3::ONE]), SINGLE);
    }
}

//! Cut-off radii for points that have none, estimated from the distances to their neighbours.

use glam::Vec3;
use rayon::prelude::*;

use super::neighbours::{Distinct, Neighbours};
use super::spacing::{NEAREST, Spacing, lower_median, nearest, spacing};
use super::strays;

/// Cut-off radius over the mean distance to the six nearest distinct points.
///
/// Measured: how many discs lie over a point, for a Fibonacci sphere of 50 000 points and for guanyin.ply; and holes,
/// the pixels of 10 000 of guanyin from the front (parallel projection, 800 pixels a unit) through which something 0.03
/// deeper shows:
///
/// | factor | sphere | guanyin | holes |
/// | --- | --- | --- | --- |
/// | 0.8 | 1.0 | 2.5 | 130 |
/// | 1 | 4.3 | 3.9 | 12 |
/// | 1.25 | 7.0 | 6.2 | 0.5 |
/// | 1.5 | 8.3 | 9.0 | 0.3 |
/// | 2 | 16.4 | 16.1 | 0.3 |
///
/// The holes that are left from 1.25 on are single pixels, most of them in deep folds. Larger discs hardly close them.
const FACTOR: f64 = 1.25;
/// Greatest radius, in local medians. In a Poisson cloud, less than one point in a thousand is that lonely.
const LONE: f64 = 4.0;
/// Cut-off radius of a point without any distance to estimate it from, model units.
const SINGLE: f32 = 1.0;

/// The result of [`estimate`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Estimated {
    /// Number of radii that were estimated.
    pub(super) count: usize,
    /// Number of radii that were limited to a few local medians.
    pub(super) lone: usize,
    /// Number of radii of points in the air that were limited to the median of the cloud.
    pub(super) fog: usize,
}

/// Replaces the radii that are 0 by the mean distance to the six nearest distinct points times [`FACTOR`].
///
/// A lone point would get a huge disc. So a radius is at most [`LONE`] times the lower median of the point's own six
/// distances, and of the radii of its six neighbours. This handles one stray point, and strays in groups of up to five.
/// If all points are in one place, the radius is the median of the radii that the file gives, or [`SINGLE`] if it gives
/// none. `radius` has an entry for each point of the cloud. `neighbours` has one for each distinct point, with at least
/// six neighbours where possible.
pub(super) fn estimate(radius: &mut [f32], cloud: &Distinct, neighbours: &Neighbours) -> Estimated {
    if cloud.position.len() < 2 {
        return same_place(radius);
    }
    let spacing = spacing(&cloud.position, neighbours);
    let fog = strays::fog(&cloud.position, neighbours, &spacing);
    radius
        .par_iter_mut()
        .zip(&cloud.of)
        .filter(|(r, _)| **r == 0.0)
        .map(|(r, &i)| {
            let (estimate, is_lone) = limited(&spacing, neighbours, i as usize);
            *r = estimate;
            let fog = fog.as_ref().filter(|fog| fog.is_fog[i as usize]);
            if let Some(fog) = fog {
                *r = r.min((FACTOR * fog.median) as f32);
            }
            Estimated { count: 1, lone: usize::from(is_lone && fog.is_none()), fog: usize::from(fog.is_some()) }
        })
        .reduce(Estimated::default, |a, b| Estimated {
            count: a.count + b.count,
            lone: a.lone + b.lone,
            fog: a.fog + b.fog,
        })
}

/// The radii that [`estimate`] gives to distinct points, at least two.
pub(super) fn of_distinct(position: &[Vec3], neighbours: &Neighbours) -> Vec<f32> {
    let spacing = spacing(position, neighbours);
    (0..position.len()).into_par_iter().map(|i| limited(&spacing, neighbours, i).0).collect()
}

/// Radius of distinct point `i`, and whether it was limited.
fn limited(spacing: &[Spacing], neighbours: &Neighbours, i: usize) -> (f32, bool) {
    let Spacing { mean, median: own_median } = spacing[i];
    let mut around = [0.0; NEAREST];
    let near = nearest(neighbours, i);
    around.iter_mut().zip(near).for_each(|(to, &j)| *to = spacing[j as usize].mean);
    let limit = LONE * own_median.min(lower_median(&mut around[..near.len()]));
    ((FACTOR * mean.min(limit)) as f32, mean > limit)
}

/// Estimates the radii of a cloud whose points are all in one place.
fn same_place(radius: &mut [f32]) -> Estimated {
    let mut given: Vec<f32> = radius.iter().copied().filter(|&r| r > 0.0).collect();
    given.sort_unstable_by(f32::total_cmp);
    let fill = given.get(given.len() / 2).copied().unwrap_or(SINGLE);
    let count = radius.len() - given.len();
    radius.iter_mut().filter(|r| **r == 0.0).for_each(|r| *r = fill);
    Estimated { count, lone: 0, fog: 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimated(points: &[Vec3], radius: &mut [f32]) -> Estimated {
        let cloud = Distinct::new(points);
        let neighbours = Neighbours::new(&cloud.position, NEAREST, &|_, _| {});
        estimate(radius, &cloud, &neighbours)
    }

    fn hexagonal(n: usize) -> Vec<Vec3> {
        (0..n * n)
            .map(|i| {
                let (column, row) = ((i % n) as f32, i / n);
                Vec3::new(column + if row % 2 == 0 { 0.0 } else { 0.5 }, 0.0, row as f32 * 0.75_f32.sqrt())
            })
            .collect()
    }

    #[test]
    fn hexagonal_spacing_is_the_radius() {
        let points = hexagonal(9);
        let mut radius = vec![0.0; 81];
        assert_eq!(estimated(&points, &mut radius), Estimated { count: 81, lone: 0, fog: 0 });
        assert!((f64::from(radius[40]) - FACTOR).abs() < 1e-5, "{}", radius[40]);
    }

    #[test]
    fn copies_do_not_shrink_the_radius() {
        let mut points = hexagonal(9);
        points.extend(vec![points[40]; 20]);
        let mut radius = vec![0.0; points.len()];
        estimated(&points, &mut radius);
        assert!((f64::from(radius[40]) - FACTOR).abs() < 1e-5);
        assert_eq!(radius[100], radius[40]);
    }

    #[test]
    fn given_radii_stay() {
        let points = hexagonal(9);
        let mut radius = vec![7.0; 81];
        radius[40] = 0.0;
        assert_eq!(estimated(&points, &mut radius), Estimated { count: 1, lone: 0, fog: 0 });
        assert!((f64::from(radius[40]) - FACTOR).abs() < 1e-5);
        assert!(radius.iter().enumerate().all(|(i, &r)| i == 40 || r == 7.0));
    }

    #[test]
    fn strays_are_limited_and_counted() {
        for group in 1..=5 {
            let mut points = hexagonal(20);
            points.extend((0..group).map(|i| Vec3::new(1000.0, i as f32, 1000.0)));
            let mut radius = vec![0.0; points.len()];
            let report = estimated(&points, &mut radius);
            assert_eq!(report.lone, group, "group of {group}");
            assert!(radius.iter().all(|&r| r > 0.0 && r < 20.0), "group of {group}");
            // An eighth of the cloud has an eighth of each radius, limited or not.
            for p in &mut points {
                *p /= 8.0;
            }
            let mut small = vec![0.0; points.len()];
            estimated(&points, &mut small);
            assert!(radius.iter().zip(&small).all(|(r, small)| r / 8.0 == *small), "group of {group}");
        }
    }

    #[test]
    fn one_place_two_places() {
        let mut radius = [0.0];
        estimated(&[Vec3::ONE], &mut radius);
        assert_eq!(radius, [SINGLE]);
        let mut radius = [0.0, 5.0, 0.0];
        assert_eq!(estimated(&[Vec3::ONE; 3], &mut radius).count, 2);
        assert_eq!(radius, [5.0; 3]);
        let mut radius = [0.0; 2];
        estimated(&[Vec3::ZERO, Vec3::new(3.0, 0.0, 4.0)], &mut radius);
        assert_eq!(radius, [(5.0 * FACTOR) as f32; 2]);
    }
}

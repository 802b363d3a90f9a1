//! Normals for points that have none: the direction in which a point's neighbourhood is thinnest.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::neighbours::{Distinct, Neighbours};
use super::options::LoadProgress;
use super::orient::orient;
use super::radii;
use super::sides::Discs;
use super::variance::principal;

/// Points that one task handles.
const CHUNK: usize = 4096;
/// A neighbourhood is a line if its second variance is below this share of the first. (Positions are rounded to 2^-24
/// of the model, and variances are squares: the noise of a neighbourhood a hundredth of the model wide is 4e-11.)
const LINE: f64 = 1e-10;

/// The result of [`estimate`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Estimated {
    /// Number of normals that were estimated.
    pub(super) count: usize,
    /// Greatest share of a view from outside that shows backs ([`Discs::most_backs`]).
    pub(super) most_backs: f64,
    /// True if the signs can be relied on ([`Discs::reliable`]).
    pub(super) reliable: bool,
}

/// From where scanners saw the points of a cloud.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Seen<'a> {
    /// Places of scanners.
    pub(super) stations: &'a [Vec3],
    /// The scanner of each point of the cloud; empty where nobody knows.
    pub(super) of: &'a [u16],
}

impl Seen<'_> {
    /// Is there a scanner for each point?
    pub(super) fn is_known(&self) -> bool {
        !self.of.is_empty() && !self.stations.is_empty()
    }

    /// The scanners of distinct points: of equal points that of the first; `None` where nobody knows.
    fn of_distinct(&self, cloud: &Distinct) -> Option<Vec<u16>> {
        let mut stations = self.is_known().then(|| vec![0; cloud.position.len()])?;
        for (&station, &i) in self.of.iter().zip(&cloud.of).rev() {
            stations[i as usize] = station;
        }
        Some(stations)
    }
}

/// Replaces the normals that are zero by estimates.
///
/// The direction comes from the principal components of the point and its 16 nearest distinct points. The sign comes
/// from the scanner that saw the point, which saw its front; where there is none, from [`orient`]: given normals are
/// kept, and their neighbours follow them. In a straight neighbourhood the normal is
/// the perpendicular nearest to +z (+y for a line along z). If all points are in one place, the normal is +z, towards
/// the default camera. `normal` has an entry for each point of the cloud, `neighbours` has one for each distinct point.
pub(super) fn estimate(
    normal: &mut [Vec3],
    cloud: &Distinct,
    seen: &Seen<'_>,
    neighbours: &Neighbours,
    progress: LoadProgress<'_>,
) -> Estimated {
    // If several points are in one place, the first that has a normal decides.
    let mut place = vec![Vec3::ZERO; cloud.position.len()];
    for (&n, &i) in normal.iter().zip(&cloud.of) {
        let at = &mut place[i as usize];
        if *at == Vec3::ZERO {
            *at = n;
        }
    }
    let mut given: Vec<bool> = place.iter().map(|&n| n != Vec3::ZERO).collect();
    let stations = seen.of_distinct(cloud);
    let total = place.len();
    let done = AtomicUsize::new(0);
    place.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, normals)| {
        for (i, n) in (chunk * CHUNK..).zip(normals.iter_mut()) {
            if !given[i] {
                *n = thinnest(&cloud.position, i, neighbours.of(i));
                let station = stations.as_ref().and_then(|of| seen.stations.get(usize::from(of[i])));
                if station.is_some_and(|station| n.dot(*station - cloud.position[i]) < 0.0) {
                    *n = -*n;
                }
            }
        }
        let share = done.fetch_add(normals.len(), Ordering::Relaxed) + normals.len();
        progress("estimating normals", share as f32 / total as f32);
    });
    if stations.is_some() {
        given.fill(true);
    }
    let guided = orient(&cloud.position, &mut place, given, neighbours, progress);
    let radius = if total > 1 { radii::of_distinct(&cloud.position, neighbours) } else { vec![0.0; total] };
    let discs = Discs { position: &cloud.position, normal: &place, radius: &radius, guided: &guided };
    let most_backs = discs.most_backs();
    let reliable = discs.reliable(most_backs);
    let mut count = 0;
    for (n, &i) in normal.iter_mut().zip(&cloud.of) {
        if *n == Vec3::ZERO {
            *n = place[i as usize];
            count += 1;
        }
    }
    Estimated { count, most_backs, reliable }
}

/// Unit direction of the least variance of a point and its neighbours.
fn thinnest(position: &[Vec3], i: usize, near: &[u32]) -> Vec3 {
    let Some((variance, direction)) = principal(position, i, near) else { return Vec3::Z };
    let along = direction[2];
    let normal = if variance[1] <= LINE * variance[2] {
        let reject = |from: DVec3| from - along * along.dot(from);
        let z = reject(DVec3::Z);
        if z.length_squared() > 1e-6 { z } else { reject(DVec3::Y) }
    } else {
        direction[0]
    };
    normal.normalize_or(DVec3::Z).as_vec3()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::model::variance::NEAREST;
    use proptest::prelude::*;

    /// A Fibonacci sphere of radius 1.
    pub(crate) fn sphere(n: usize) -> Vec<Vec3> {
        (0..n)
            .map(|i| {
                let z = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
                let (s, c) = libm::sincos((i as f64 + 0.5) * std::f64::consts::PI * (3.0 - 5.0_f64.sqrt()));
                let r = (1.0 - z * z).sqrt();
                DVec3::new(r * c, r * s, z).as_vec3()
            })
            .collect()
    }

    /// Numbers uniform in -1..1, the same on every run.
    pub(crate) fn noise(seed: u32) -> Vec3 {
        let hash = |k: u32| {
            let mut x = seed.wrapping_mul(3).wrapping_add(k).wrapping_mul(0x9e37_79b9) ^ 0x5bd1_e995;
            x = (x ^ (x >> 15)).wrapping_mul(0x2c1b_3c6d);
            x = (x ^ (x >> 12)).wrapping_mul(0x297a_2d39);
            (x ^ (x >> 15)) as f32 / u32::MAX as f32 * 2.0 - 1.0
        };
        Vec3::new(hash(0), hash(1), hash(2))
    }

    pub(crate) fn completed(points: &[Vec3], mut normal: Vec<Vec3>) -> Vec<Vec3> {
        let cloud = Distinct::new(points);
        let neighbours = Neighbours::new(&cloud.position, NEAREST, &|_, _| {});
        estimate(&mut normal, &cloud, &Seen::default(), &neighbours, &|_, _| {});
        normal
    }

    pub(crate) fn estimated(points: &[Vec3]) -> Vec<Vec3> {
        completed(points, vec![Vec3::ZERO; points.len()])
    }

    #[test]
    fn a_sphere_looks_outward() {
        for n in [30, 300, 30_000] {
            let points = sphere(n);
            let worst = estimated(&points).iter().zip(&points).map(|(n, p)| n.dot(*p)).fold(1.0, f32::min);
            assert!(worst > if n < 100 { 0.9 } else { 0.99 }, "{n} points: {worst}");
        }
    }

    #[test]
    fn a_plane_is_flat_and_faces_up_or_forward() {
        let grid =
            |at: fn(f32, f32) -> Vec3| (0..400).map(|i| at((i % 20) as f32, (i / 20) as f32)).collect::<Vec<_>>();
        assert!(estimated(&grid(|x, y| Vec3::new(x, 0.0, y))).iter().all(|n| n.distance(Vec3::Y) < 1e-6));
        assert!(estimated(&grid(|x, y| Vec3::new(x, y, 3.0))).iter().all(|n| n.distance(Vec3::Z) < 1e-6));
    }

    #[test]
    fn few_points_and_lines() {
        assert_eq!(estimated(&[Vec3::ONE]), [Vec3::Z]);
        assert_eq!(estimated(&[Vec3::ONE; 40]), [Vec3::Z; 40]);
        assert_eq!(estimated(&[Vec3::ZERO, Vec3::X]), [Vec3::Z; 2]);
        assert_eq!(estimated(&[Vec3::ZERO, Vec3::Z]), [Vec3::Y; 2]);
        assert_eq!(estimated(&[Vec3::ZERO, Vec3::X, Vec3::Y]), [Vec3::Z; 3]);
        let line: Vec<Vec3> = (0..100).map(|i| Vec3::new(0.1, 0.7, -0.3) * i as f32).collect();
        let normals = estimated(&line);
        assert!(normals.iter().all(|n| n.is_normalized() && n.dot(line[1]).abs() < 1e-3 && n.z > 0.9), "{normals:?}");
    }

    #[test]
    fn given_normals_are_kept_and_followed() {
        // The given normals point inward on purpose. Three of them turn the whole sphere.
        let points = sphere(3000);
        let mut given = vec![Vec3::ZERO; 3000];
        for i in [10, 1500, 2900] {
            given[i] = -points[i];
        }
        let normals = completed(&points, given);
        assert!(normals.iter().zip(&points).all(|(n, p)| n.dot(*p) < -0.99));
        assert_eq!(normals[10], -points[10]);
    }

    #[test]
    fn copies_share_the_normal_of_the_first_that_has_one() {
        let mut points = sphere(300);
        points.extend([points[7]; 5]);
        let mut given: Vec<Vec3> = vec![Vec3::ZERO; 305];
        given[302] = points[7];
        let normals = completed(&points, given);
        assert_eq!(normals[7], points[7]);
        assert_eq!(normals[304], points[7]);
    }

    #[test]
    fn tiny_and_huge_clouds_have_the_same_normals() {
        let points = sphere(500);
        let normal = estimated(&points);
        for size in [2.0_f32.powi(-60), 2.0_f32.powi(58)] {
            let scaled: Vec<Vec3> = points.iter().map(|&p| p * size).collect();
            assert_eq!(estimated(&scaled), normal);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn always_unit(points in prop::collection::vec(prop::array::uniform3(-3_i8..3), 1..120)) {
            let points: Vec<Vec3> = points.into_iter().map(|p| Vec3::from(p.map(f32::from)) * 0.1).collect();
            prop_assert!(estimated(&points).iter().all(|n| n.is_normalized()));
        }
    }
}

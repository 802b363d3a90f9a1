//! Nearest neighbours among the distinct points of a cloud.
//!
//! Equal points are merged first, so that many copies cost nothing and a neighbour is always another place.
//! Ties in distance are broken by index, so the result depends neither on threads nor on the computer.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use rstar::primitives::GeomWithData;
use rstar::{RStarInsertionStrategy, RTree, RTreeParams};

use super::options::LoadProgress;
use super::order::morton_codes;
use crate::math::Bounds;

/// Points whose neighbours one task finds.
const CHUNK: usize = 4096;
/// Points that are next to each other in the order and whose neighbours are sought together.
const GROUP: usize = 32;
/// How much farther away than the farthest neighbour in the group before those of a group are sought.
const WIDER: f64 = 1.2;
/// Most points around a group: with more, the guess was bad, and a search for each point takes less.
const MOST_NEAR: usize = 2048;
/// Factor on a distance that no rounding makes too short.
const ROUNDED_UP: f64 = 1.0 + 1e-9;

/// A cloud with equal positions merged.
#[derive(Debug)]
pub(super) struct Distinct {
    /// The distinct positions, along a Morton curve.
    pub(super) position: Vec<Vec3>,
    /// Distinct position of each point of the cloud.
    pub(super) of: Vec<u32>,
}

impl Distinct {
    /// Merges equal positions, which must be finite (-0 equals 0).
    pub(super) fn new(points: &[Vec3]) -> Self {
        let mut keys = morton_codes(points);
        keys.par_sort_unstable_by(|a, b| {
            let lexicographic = || points[a.1 as usize].to_array().partial_cmp(&points[b.1 as usize].to_array());
            a.0.cmp(&b.0).then_with(|| lexicographic().unwrap_or(a.1.cmp(&b.1))).then(a.1.cmp(&b.1))
        });
        let mut position: Vec<Vec3> = Vec::new();
        let mut of = vec![0; points.len()];
        for (_, i) in keys {
            let p = points[i as usize];
            if position.last() != Some(&p) {
                position.push(p);
            }
            of[i as usize] = (position.len() - 1) as u32;
        }
        Self { position, of }
    }
}

/// A point with its index. The library measures in the type of the coordinates, and squares of `f32` are too coarse.
type Point = GeomWithData<[f64; 3], u32>;

/// Nodes of up to 12 children. The 6 of the library take half as much memory again: 120 bytes a point.
struct Wide;

impl RTreeParams for Wide {
    const MIN_SIZE: usize = 4;
    const MAX_SIZE: usize = 12;
    // Nothing is inserted later.
    const REINSERTION_COUNT: usize = 1;
    type DefaultInsertionStrategy = RStarInsertionStrategy;
}

/// A tree of points (an R*-tree, crate `rstar`).
pub(crate) struct Tree(RTree<Point, Wide>);

impl Tree {
    /// Builds the tree of (position, index) pairs. Positions must be finite.
    ///
    /// Points that are near each other should be near in the order too, as along a Morton curve. If points of one line
    /// or plane come in any order, searches take about twenty times as long.
    pub(crate) fn new(points: impl Iterator<Item = (Vec3, u32)>) -> Self {
        let points = points.map(|(p, index)| Point::new(p.as_dvec3().to_array(), index));
        Self(RTree::bulk_load_with_params(points.collect()))
    }

    /// Fills `found` with the squared distances and indices of the (at most) `count` points nearest to `p`. The nearest
    /// is first; among equals the lower index is first. A point of index `except` does not count.
    pub(crate) fn nearest(&self, p: Vec3, except: u32, count: usize, found: &mut Vec<(f64, u32)>) {
        found.clear();
        for (point, square) in self.0.nearest_neighbor_iter_with_distance_2(p.as_dvec3().to_array()) {
            // All that are as far as the last one are found, and then the lowest indices are kept.
            if found.len() >= count && found.last().is_some_and(|last| square > last.0) {
                break;
            }
            if point.data != except {
                found.push((square, point.data));
            }
        }
        sort(found, count);
    }

    /// Fills `near` with all points within a distance of a place. False if there are far too many.
    fn around(&self, place: DVec3, distance: f64, near: &mut Near) -> bool {
        near.clear();
        for point in self.0.locate_within_distance(place.to_array(), distance * distance) {
            let [x, y, z] = *point.geom();
            near.x.push(x);
            near.y.push(y);
            near.z.push(z);
            near.index.push(point.data);
            if near.index.len() > MOST_NEAR {
                return false;
            }
        }
        true
    }
}

/// Points near each other, in columns.
#[derive(Default)]
struct Near {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    index: Vec<u32>,
    /// Squared distances of all to one place.
    square: Vec<f64>,
}

impl Near {
    fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.index.clear();
    }

    /// As [`Tree::nearest`] among these points, those that are farther away than `most` left out.
    fn nearest(&mut self, p: Vec3, except: u32, count: usize, most: f64, found: &mut Vec<(f64, u32)>) {
        let place = p.as_dvec3();
        self.square.clear();
        let columns = self.x.iter().zip(&self.y).zip(&self.z);
        self.square.extend(columns.map(|((x, y), z)| {
            let [dx, dy, dz] = [x - place.x, y - place.y, z - place.z];
            dx * dx + dy * dy + dz * dz
        }));
        found.clear();
        let squares = self.square.iter().zip(&self.index);
        found.extend(squares.filter(|(square, i)| **square <= most && **i != except).map(|(square, i)| (*square, *i)));
        sort(found, count);
    }
}

/// Keeps the `count` nearest, the nearest first.
fn sort(found: &mut Vec<(f64, u32)>, count: usize) {
    let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    if found.len() > count && count > 0 {
        found.select_nth_unstable_by(count - 1, order);
        found.truncate(count);
    }
    found.sort_unstable_by(order);
}

/// The nearest neighbours of every point, the same number for each.
pub(super) struct Neighbours {
    row: usize,
    index: Vec<u32>,
}

impl Neighbours {
    /// Finds the `count` nearest other points of each of some distinct points, or all others where there are fewer.
    ///
    /// It needs 4 bytes for each neighbour, and 80 for each point while it searches.
    pub(super) fn new(points: &[Vec3], count: usize, progress: LoadProgress<'_>) -> Self {
        let row = count.min(points.len().saturating_sub(1));
        if row == 0 {
            return Self { row, index: Vec::new() };
        }
        let tree = Tree::new(points.iter().zip(0..).map(|(&p, i)| (p, i)));
        let mut index = vec![0; points.len() * row];
        let done = AtomicUsize::new(0);
        index.par_chunks_mut(CHUNK * row).enumerate().for_each(|(chunk, rows)| {
            let (mut found, mut near) = (Vec::with_capacity(row + 1), Near::default());
            // Points are in an order in which the next ones are near, and have their neighbours about as far away.
            let mut guess = 0.0;
            for (group, rows) in rows.chunks_mut(GROUP * row).enumerate() {
                let first = chunk * CHUNK + group * GROUP;
                let group = &points[first..first + rows.len() / row];
                let reach = WIDER * guess;
                let known = guess > 0.0 && {
                    let bounds: Bounds = group.iter().map(|p| p.as_dvec3()).collect();
                    let radius = group.iter().map(|p| p.as_dvec3().distance(bounds.centre())).fold(0.0, f64::max);
                    // Rounding loses no point.
                    tree.around(bounds.centre(), (radius + reach) * ROUNDED_UP, &mut near)
                };
                let mut farthest = 0.0_f64;
                for ((i, p), row_of_i) in (first..).zip(group).zip(rows.chunks_exact_mut(row)) {
                    if known {
                        near.nearest(*p, i as u32, row, reach * reach, &mut found);
                    }
                    if !known || found.len() < row {
                        tree.nearest(*p, i as u32, row, &mut found);
                    }
                    row_of_i.iter_mut().zip(&found).for_each(|(to, &(_, from))| *to = from);
                    farthest = found.last().map_or(0.0, |last| last.0.sqrt()).max(farthest);
                }
                guess = farthest;
            }
            let share = done.fetch_add(rows.len(), Ordering::Relaxed) + rows.len();
            progress("finding neighbours", share as f32 / (points.len() * row) as f32);
        });
        Self { row, index }
    }

    /// Neighbours of each point.
    pub(super) fn count(&self) -> usize {
        self.row
    }

    /// Neighbours of point `i`, nearest first.
    pub(super) fn of(&self, i: usize) -> &[u32] {
        &self.index[i * self.row..(i + 1) * self.row]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn quiet(_: &str, _: f32) {}

    /// The neighbours by their definition: all other points, sorted by distance, then by index.
    fn brute_force(points: &[Vec3], i: usize, count: usize) -> Vec<u32> {
        let mut others: Vec<(f64, u32)> = (0..points.len())
            .filter(|&j| j != i)
            .map(|j| ((points[i].as_dvec3() - points[j].as_dvec3()).length_squared(), j as u32))
            .collect();
        others.sort_by(|a, b| a.partial_cmp(b).unwrap());
        others.iter().take(count).map(|o| o.1).collect()
    }

    fn check(points: &[Vec3], count: usize) {
        let distinct = Distinct::new(points);
        let neighbours = Neighbours::new(&distinct.position, count, &quiet);
        for i in 0..distinct.position.len() {
            assert_eq!(neighbours.of(i), brute_force(&distinct.position, i, count), "point {i}");
        }
    }

    #[test]
    fn grids_lines_and_planes_with_their_ties() {
        let at = |x: usize, y: usize, z: usize| Vec3::new(x as f32, y as f32, z as f32);
        check(&(0..343).map(|i| at(i % 7, i / 7 % 7, i / 49)).collect::<Vec<_>>(), 16);
        check(&(0..300).map(|i| at(i, 2 * i, 3)).collect::<Vec<_>>(), 6);
        check(&(0..400).map(|i| at(i % 20, 5, i / 20)).collect::<Vec<_>>(), 16);
    }

    #[test]
    fn few_points_have_few_neighbours() {
        for n in 0..5 {
            check(&(0..n).map(|i| Vec3::splat(i as f32)).collect::<Vec<_>>(), 16);
        }
    }

    #[test]
    fn copies_are_merged_and_cost_nothing() {
        let mut points = vec![Vec3::ONE; 100_000];
        points.push(Vec3::ZERO);
        points.push(-Vec3::ZERO);
        let distinct = Distinct::new(&points);
        assert_eq!(distinct.position.len(), 2);
        assert!(distinct.of[..100_000].iter().all(|&d| distinct.position[d as usize] == Vec3::ONE));
        assert_eq!(distinct.of[100_000], distinct.of[100_001]);
        assert_ne!(distinct.of[0], distinct.of[100_000]);
    }

    #[test]
    fn the_number_of_threads_does_not_matter() {
        let points: Vec<Vec3> =
            (0..20_000_u32).map(|i| Vec3::new((i * 37 % 101) as f32, (i * 53 % 97) as f32, (i % 89) as f32)).collect();
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let distinct = Distinct::new(&points);
                (Neighbours::new(&distinct.position, 6, &quiet).index, distinct.of)
            })
        };
        assert_eq!(with(1), with(4));
    }

    #[test]
    fn points_too_close_for_single_precision_squares() {
        check(&(0..50).map(|i| Vec3::splat(i as f32 * 1e-30)).collect::<Vec<_>>(), 6);
        check(&(0..50).map(|i| Vec3::splat(i as f32 * 1e16)).collect::<Vec<_>>(), 6);
    }

    proptest! {
        #[test]
        fn agrees_with_the_definition(
            points in prop::collection::vec(prop::array::uniform3(-8_i8..8), 0..300),
            count in 1_usize..20,
            size in 1e-9_f32..1e9,
        ) {
            check(&points.iter().map(|p| Vec3::from(p.map(f32::from)) * size).collect::<Vec<_>>(), count);
        }
    }
}

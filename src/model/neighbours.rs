//! Nearest neighbours among the distinct points of a cloud.
//!
//! The kd-tree merges equal points first, so that many copies cost nothing and a neighbour is always another place.
//! Ties in distance are broken by index, so the result depends neither on threads nor on the computer.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::options::Progress;
use super::order::morton_codes;

/// Points below which a subtree is searched linearly; 4, 8 and 16 are about equally fast.
const LEAF: usize = 8;
/// Points above which a subtree is built by two threads.
const FORK: usize = 4096;
/// Points whose neighbours one task finds.
const CHUNK: usize = 4096;

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

#[derive(Clone, Copy)]
struct Node {
    position: Vec3,
    index: u32,
}

/// A balanced kd-tree without pointers. The root of the range a..b is its middle, which splits along `axis[middle]`.
pub(super) struct Tree {
    nodes: Vec<Node>,
    axis: Vec<u8>,
}

impl Tree {
    /// Builds the tree of (position, index) pairs in O(n log n), in parallel. Positions must be finite.
    pub(super) fn new(points: impl Iterator<Item = (Vec3, u32)>) -> Self {
        let mut nodes: Vec<Node> = points.map(|(position, index)| Node { position, index }).collect();
        let mut axis = vec![0; nodes.len()];
        build(&mut nodes, &mut axis);
        Self { nodes, axis }
    }

    /// Fills `found` with the squared distances and indices of the (at most) `count` points nearest to `p`. The nearest
    /// is first; among equals the lower index is first. A point of index `except` does not count.
    pub(super) fn nearest(&self, p: Vec3, except: u32, count: usize, found: &mut Vec<(f64, u32)>) {
        found.clear();
        if count > 0 {
            let mut query = Query { p: p.as_dvec3(), except, count, found };
            self.search(0, self.nodes.len(), DVec3::ZERO, &mut query);
        }
    }

    /// Searches a range. `offset` is the componentwise distance of the query from the box of the range. Every point in
    /// the box is at least that far along each axis, and rounding is monotonic, so no point is missed.
    fn search(&self, from: usize, to: usize, offset: DVec3, query: &mut Query<'_>) {
        if to - from <= LEAF {
            self.nodes[from..to].iter().for_each(|node| query.offer(node));
            return;
        }
        let middle = from.midpoint(to);
        let axis = usize::from(self.axis[middle]);
        let node = &self.nodes[middle];
        query.offer(node);
        let across = query.p[axis] - f64::from(node.position[axis]);
        let (near, far) =
            if across < 0.0 { ((from, middle), (middle + 1, to)) } else { ((middle + 1, to), (from, middle)) };
        self.search(near.0, near.1, offset, query);
        let mut offset = offset;
        offset[axis] = across;
        if offset.length_squared() <= query.farthest() {
            self.search(far.0, far.1, offset, query);
        }
    }
}

struct Query<'a> {
    p: DVec3,
    except: u32,
    count: usize,
    found: &'a mut Vec<(f64, u32)>,
}

impl Query<'_> {
    fn farthest(&self) -> f64 {
        if self.found.len() < self.count { f64::INFINITY } else { self.found[self.count - 1].0 }
    }

    fn offer(&mut self, node: &Node) {
        let candidate = ((self.p - node.position.as_dvec3()).length_squared(), node.index);
        if candidate.0 > self.farthest() || node.index == self.except {
            return;
        }
        let nearer = self.found.iter().rev().position(|f| *f < candidate);
        let place = nearer.map_or(0, |back| self.found.len() - back);
        self.found.insert(place, candidate);
        self.found.truncate(self.count);
    }
}

fn build(nodes: &mut [Node], axis: &mut [u8]) {
    if nodes.len() <= LEAF {
        return;
    }
    let (min, max) =
        nodes.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), n| (lo.min(n.position), hi.max(n.position)));
    let along = (max - min).max_position();
    let middle = nodes.len() / 2;
    nodes.select_nth_unstable_by(middle, |a, b| {
        a.position[along].total_cmp(&b.position[along]).then(a.index.cmp(&b.index))
    });
    axis[middle] = along as u8;
    let parallel = nodes.len() > FORK;
    let (left, right) = nodes.split_at_mut(middle);
    let (left_axis, right_axis) = axis.split_at_mut(middle);
    let (right, right_axis) = (&mut right[1..], &mut right_axis[1..]);
    if parallel {
        rayon::join(|| build(left, left_axis), || build(right, right_axis));
    } else {
        build(left, left_axis);
        build(right, right_axis);
    }
}

/// The nearest neighbours of every point, the same number for each.
pub(super) struct Neighbours {
    row: usize,
    index: Vec<u32>,
}

impl Neighbours {
    /// Finds the `count` nearest other points of each of some distinct points, or all others where there are fewer.
    ///
    /// The search is that of Arya and Mount 1993, which updates distances to boxes incrementally. It needs 4 bytes for
    /// each neighbour.
    pub(super) fn new(points: &[Vec3], count: usize, progress: Progress<'_>) -> Self {
        let row = count.min(points.len().saturating_sub(1));
        if row == 0 {
            return Self { row, index: Vec::new() };
        }
        let tree = Tree::new(points.iter().zip(0..).map(|(&p, i)| (p, i)));
        let mut index = vec![0; points.len() * row];
        let done = AtomicUsize::new(0);
        index.par_chunks_mut(CHUNK * row).enumerate().for_each(|(chunk, rows)| {
            let mut found = Vec::with_capacity(row + 1);
            for (i, row_of_i) in (chunk * CHUNK..).zip(rows.chunks_exact_mut(row)) {
                tree.nearest(points[i], i as u32, row, &mut found);
                row_of_i.iter_mut().zip(&found).for_each(|(to, &(_, from))| *to = from);
            }
            let share = done.fetch_add(rows.len(), Ordering::Relaxed) + rows.len();
            progress("finding neighbours", share as f32 / (points.len() * row) as f32);
        });
        Self { row, index }
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

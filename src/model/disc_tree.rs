//! A tree of discs: which of them may reach a box or a point?
//!
//! Discs of all sizes lie in one tree, and a search has a budget. Where too many discs overlap, a search can take every
//! 8th, 64th, ... disc instead of all. So no set of discs makes searches slow, not even a million in one place.

use glam::Vec3;
use rayon::prelude::*;

/// Discs of a lowest node, and children of any other node.
const FAN: usize = 8;
/// Discs above which two threads sort a part of them.
const FORK: usize = 4096;

/// A box in `f32`. Comparisons with NaN are false: such a box overlaps nothing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    min: Vec3,
    max: Vec3,
}

impl Extent {
    const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The box of all points that are at most `half` away from `centre` along each axis.
    pub(super) fn around(centre: Vec3, half: Vec3) -> Self {
        Self { min: centre - half, max: centre + half }
    }

    fn merged(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    fn overlaps(&self, other: &Self) -> bool {
        (self.min.cmple(other.max) & other.min.cmple(self.max)).all()
    }
}

/// A disc while the tree is sorted.
#[derive(Clone, Copy)]
struct Item {
    centre: Vec3,
    reach: f32,
    index: u32,
}

/// The order of the discs in a tree: parts of any power of two, counted from the start, lie together.
///
/// Each part is halved at its median along the axis on which it is longest. Size is one of the axes, so huge discs
/// among small ones get parts of their own. Ties are broken by index, so the order depends only on the discs.
pub(crate) fn order(centre: &[Vec3], reach: &[f32]) -> Vec<u32> {
    let mut items: Vec<Item> =
        (0..).zip(centre).zip(reach).map(|((index, &centre), &reach)| Item { centre, reach, index }).collect();
    sort(&mut items);
    items.into_par_iter().map(|item| item.index).collect()
}

fn sort(items: &mut [Item]) {
    if items.len() <= FAN {
        // Selection leaves an order that depends on the one before it.
        let key = |i: &Item| (i.centre.x, i.centre.y, i.centre.z, i.reach);
        let compare = |a: (f32, f32, f32, f32), b: (f32, f32, f32, f32)| {
            a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2)).then(a.3.total_cmp(&b.3))
        };
        items.sort_unstable_by(|a, b| compare(key(a), key(b)).then(a.index.cmp(&b.index)));
        return;
    }
    let none = (Extent::EMPTY, f32::INFINITY, 0.0_f32);
    let (extent, least, most) = items.iter().fold(none, |(extent, least, most), item| {
        let point = Extent { min: item.centre, max: item.centre };
        (extent.merged(point), least.min(item.reach), most.max(item.reach))
    });
    let sides = extent.max - extent.min;
    let along = sides.max_position();
    // A box is longer than its centres say by the reach of the largest disc on both sides.
    let by_size = 2.0 * (most - least) > sides[along];
    let key = |item: &Item| if by_size { item.reach } else { item.centre[along] };
    let middle = items.len().next_power_of_two() / 2;
    items.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)).then(a.index.cmp(&b.index)));
    let fork = items.len() > FORK;
    let (left, right) = items.split_at_mut(middle);
    if fork {
        rayon::join(|| sort(left), || sort(right));
    } else {
        sort(left);
        sort(right);
    }
}

/// Boxes over discs that stand in the order of [`order`].
#[derive(Debug)]
pub(super) struct DiscTree {
    discs: usize,
    /// The boxes of each level: over `FAN` discs, over `FAN` of these, and so on up to one.
    levels: Vec<Vec<Extent>>,
}

impl DiscTree {
    /// Builds the tree of `discs` discs, whose boxes `extent` gives.
    pub(super) fn new(discs: usize, extent: impl Fn(usize) -> Extent + Sync) -> Self {
        let merged = |range: std::ops::Range<usize>, of: &dyn Fn(usize) -> Extent| {
            range.fold(Extent::EMPTY, |merged, i| merged.merged(of(i)))
        };
        let part = |node: usize, count: usize| node * FAN..(node * FAN + FAN).min(count);
        let lowest = (0..discs.div_ceil(FAN)).into_par_iter().map(|node| merged(part(node, discs), &extent)).collect();
        let mut levels: Vec<Vec<Extent>> = vec![lowest];
        while let Some(below) = levels.last().filter(|below| below.len() > 1) {
            let count = below.len();
            let level = (0..count.div_ceil(FAN)).map(|node| merged(part(node, count), &|i| below[i])).collect();
            levels.push(level);
        }
        Self { discs, levels }
    }

    /// Gives `found` the runs of discs whose box overlaps `target`, in order, and the number of discs that the first
    /// of a run stands for. With `skip` 0 a run is a whole lowest node, and each disc stands for itself. Otherwise a
    /// run is one disc of 8^`skip`.
    ///
    /// The result is false as soon as more than `budget` boxes and discs were touched. A search with the highest `skip`
    /// always succeeds.
    pub(super) fn search(
        &self,
        target: &Extent,
        skip: usize,
        budget: usize,
        mut found: impl FnMut(std::ops::Range<usize>, f32),
    ) -> bool {
        let top = self.levels.len() - 1;
        let stop = skip.saturating_sub(1).min(top);
        let mut left = if skip > top { usize::MAX } else { budget };
        let mut path = [(0, 0); 16];
        // Each entry of the path is a range of nodes of one level that are still to be visited.
        let mut depth = 0;
        path[0] = (0, self.levels[top].len());
        loop {
            let (node, end) = path[depth];
            if node == end {
                if depth == 0 {
                    return true;
                }
                depth -= 1;
                continue;
            }
            path[depth].0 += 1;
            let level = top - depth;
            let Some(rest) = left.checked_sub(1) else { return false };
            left = rest;
            if !self.levels[level][node].overlaps(target) {
                continue;
            }
            if level > stop {
                depth += 1;
                path[depth] = (node * FAN, (node * FAN + FAN).min(self.levels[level - 1].len()));
            } else if skip == 0 {
                let run = node * FAN..(node * FAN + FAN).min(self.discs);
                let Some(rest) = left.checked_sub(run.len()) else { return false };
                left = rest;
                found(run, 1.0);
            } else {
                let size = FAN.pow(stop as u32 + 1);
                let first = node * size;
                let size = size.min(self.discs - first);
                // Any one of them, so that they do not all lie on the same side of what they stand for.
                let one = first + (node.wrapping_mul(0x9e37_79b9) >> 7) % size;
                found(one..one + 1, size as f32);
            }
        }
    }

    /// The greatest `skip` that makes a difference.
    pub(super) fn highest(&self) -> usize {
        self.levels.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    /// Boxes of many sizes, one of them huge, in the order of their tree.
    fn boxes(n: usize) -> Vec<Extent> {
        let mut random = Random(5);
        let centre: Vec<Vec3> = (0..n).map(|_| random.vector()).collect();
        let reach: Vec<f32> = (0..n).map(|i| if i == n / 3 { 50.0 } else { 0.01 + 0.1 * random.next() }).collect();
        let order = order(&centre, &reach);
        let mut seen = vec![false; n];
        for &i in &order {
            seen[i as usize] = true;
        }
        assert!(seen.iter().all(|seen| *seen) && order.len() == n);
        order.iter().map(|&i| Extent::around(centre[i as usize], Vec3::splat(reach[i as usize]))).collect()
    }

    #[test]
    fn a_search_misses_nothing() {
        for n in [0, 1, 7, 8, 9, 64, 65, 1000, 5000] {
            let boxes = boxes(n);
            let tree = DiscTree::new(n, |i| boxes[i]);
            let mut random = Random(6);
            for _ in 0..20 {
                let target = Extent::around(random.vector(), Vec3::splat(0.1));
                let mut found = vec![false; n];
                let all = tree.search(&target, 0, usize::MAX, |run, one| {
                    assert!(one == 1.0);
                    found[run].fill(true);
                });
                assert!(all);
                assert!((0..n).all(|i| found[i] || !boxes[i].overlaps(&target)));
                // A leaf has 8, and the huge disc is in one: more would mean that boxes say nothing.
                assert!(n < 1000 || found.iter().filter(|found| **found).count() < n / 5);
            }
        }
    }

    #[test]
    fn some_stand_for_all() {
        for n in [1, 9, 64, 65, 1000, 5000] {
            let boxes = boxes(n);
            let tree = DiscTree::new(n, |i| boxes[i]);
            for skip in 0..=tree.highest() {
                let (mut stood_for, mut runs) = (0.0, 0);
                let everything = Extent::around(Vec3::ZERO, Vec3::splat(2.0));
                assert!(tree.search(&everything, skip, usize::MAX, |run, each| {
                    assert!(run.end <= n);
                    stood_for += each * run.len() as f32;
                    runs += 1;
                }));
                assert_eq!((stood_for, runs), (n as f32, n.div_ceil(FAN.pow(skip.max(1) as u32))));
            }
        }
    }

    /// A hundred huge discs lie over 5000 small ones. Measured: 300 to 500 boxes and discs are touched, and more
    /// than 1000 where size is not an axis.
    #[test]
    fn huge_discs_get_parts_of_their_own() {
        let mut random = Random(7);
        let centre: Vec<Vec3> = (0..5000).map(|_| random.vector()).collect();
        let reach: Vec<f32> = (0..5000).map(|i| if i % 50 == 0 { 9.0 } else { 0.02 }).collect();
        let order: Vec<usize> = order(&centre, &reach).into_iter().map(|i| i as usize).collect();
        let tree = DiscTree::new(5000, |i| Extent::around(centre[order[i]], Vec3::splat(reach[order[i]])));
        assert!(tree.search(&Extent::around(Vec3::ZERO, Vec3::splat(0.02)), 0, 500, |_, _| ()));
    }

    #[test]
    fn the_budget_ends_a_search_but_not_the_coarsest() {
        let boxes = boxes(1000);
        let tree = DiscTree::new(1000, |i| boxes[i]);
        let everything = Extent::around(Vec3::ZERO, Vec3::splat(2.0));
        assert!(!tree.search(&everything, 0, 1000, |_, _| ()));
        assert!(tree.search(&everything, 0, 1000 + 125 + 16 + 2 + 1, |_, _| ()));
        assert!(tree.search(&everything, 1, 200, |_, _| ()));
        assert!(tree.search(&everything, tree.highest(), 0, |_, _| ()));
    }
}

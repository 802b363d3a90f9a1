//! What receives shadows in each part of a light's plane: how far behind the ground it lies at the most. What is
//! farther behind casts no shadow that anybody sees, and is not drawn. So a floor is not drawn on its own map.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

use glam::Vec3;

use super::run::Run;
use super::view::LightView;
use crate::backend::cpu::columns::dot;
use crate::backend::cpu::tiles::{LANES, Lanes};

/// Cells of a side of the plane.
const SIDE: usize = 64;
/// Runs that may be taken for a part of the ground.
const CANDIDATES: usize = 8;
/// Cosine between the normals of parts of one plane, at the least.
const SAME_NORMAL: f32 = 0.999;
/// Cosine, or its like, between rays and the ground, below which distances to it say nothing.
const FLAT: f32 = 0.02;

/// The plane that most of what the camera sees lies on, as a view of a light has it. It only decides what is culled.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ground {
    /// A place p is as far behind the plane as `linear` times p says; of a point light it is -(1 + `linear` times p)
    /// over its distance along the axis of the view.
    linear: Vec3,
    /// The same for directions of the world.
    in_world: Vec3,
    is_point: bool,
}

impl Ground {
    /// The middle and the normal of the run that is about on one plane with most of what the camera sees of `runs`:
    /// each with its weight.
    pub(super) fn vote(runs: &[(&Run<'_>, f32)]) -> Option<[Vec3; 2]> {
        let flat: Vec<_> = runs.iter().filter(|(run, _)| run.normal != Vec3::ZERO).collect();
        let mut heaviest: Vec<usize> = (0..flat.len()).collect();
        heaviest.sort_by(|&a, &b| flat[b].1.total_cmp(&flat[a].1));
        let votes = |candidate: usize| {
            let (of, _) = flat[candidate];
            let agrees = |run: &Run<'_>| {
                let height = of.normal.dot(run.middle - of.middle).abs();
                of.normal.dot(run.normal).abs() > SAME_NORMAL && height <= of.object.epsilon
            };
            flat.iter().filter(|(run, _)| agrees(run)).map(|(_, weight)| *weight).sum::<f32>()
        };
        let counted = heaviest.into_iter().take(CANDIDATES).map(|candidate| (candidate, votes(candidate)));
        let best = counted.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        best.map(|(best, _)| [flat[best].0.middle, flat[best].0.normal])
    }

    /// How `view` sees the plane through a place with a normal; across its axis if there is none.
    pub(super) fn seen_by(view: &LightView, plane: Option<[Vec3; 2]>) -> Self {
        let plane = plane.map(|[middle, normal]| [view.place(middle), view.turned(normal)]);
        let linear = match plane {
            Some([middle, normal]) if view.is_point && normal.dot(middle).abs() > FLAT * middle.length() => {
                -normal / normal.dot(middle)
            }
            Some([_, normal]) if !view.is_point && normal.z.abs() > FLAT => normal / normal.z,
            _ if view.is_point => Vec3::ZERO,
            _ => Vec3::Z,
        };
        Self { linear, in_world: view.turned_back(linear), is_point: view.is_point }
    }

    /// Half of what `linear` changes by within discs with these axes, as the view has them.
    #[inline(always)]
    pub(super) fn of_discs(&self, axes: &[[Lanes; 3]; 2]) -> Lanes {
        let [u, v] = [&axes[0], &axes[1]].map(|axis| dot(self.linear, axis));
        let mut half = [0.0; LANES];
        for l in 0..LANES {
            half[l] = (u[l] * u[l] + v[l] * v[l]).sqrt();
        }
        half
    }

    /// The same for spheres with these radii.
    pub(super) fn of_balls(&self, radii: &Lanes) -> Lanes {
        let length = self.linear.length();
        radii.map(|radius| length * radius)
    }

    /// The same for a box of the world.
    pub(super) fn of_box(&self, half: Vec3) -> f32 {
        self.in_world.abs().dot(half)
    }

    /// How far behind the ground something lies at the least and at the most: around `place` of the view, with a
    /// radius, and with half of what `linear` changes by within it.
    pub(super) fn behind(&self, place: Vec3, radius: f32, half: f32) -> [f32; 2] {
        let middle = self.linear.dot(place);
        if !self.is_point {
            return [middle - half, middle + half];
        }
        let [near, far] = [place.z - radius, place.z + radius];
        if near <= 1e-3 * far {
            return [f32::NEG_INFINITY, f32::INFINITY];
        }
        let ends = [-(1.0 + middle - half), -(1.0 + middle + half)];
        let ends = [ends[0] / near, ends[0] / far, ends[1] / near, ends[1] / far];
        [ends.into_iter().fold(f32::INFINITY, f32::min), ends.into_iter().fold(f32::NEG_INFINITY, f32::max)]
    }

    /// How far behind the ground discs lie in the middle, where rays are parallel.
    #[inline(always)]
    pub(super) fn middles(&self, places: &[Lanes; 3]) -> Lanes {
        dot(self.linear, places)
    }

    /// By how much an end of light that is moved away by `tolerance` at `distance` lies farther behind the ground, at
    /// the least, where it is no farther along the axis of the view than `far`.
    pub(super) fn moved(&self, tolerance: f32, distance: f32, far: f32) -> f32 {
        if !self.is_point {
            return tolerance;
        }
        let part = tolerance / distance;
        part / ((1.0 + part) * far)
    }
}

/// A part of a light's plane in cells.
#[derive(Debug)]
pub(super) struct Cells {
    /// Least x, then y.
    first: [f32; 2],
    /// Cells to a unit of length.
    scale: [f32; 2],
    /// How far behind the ground receivers of a cell are at the most, as [`key`] has it; 0 where there are none. Not
    /// made before there are any.
    behind: OnceLock<Box<[AtomicU32]>>,
}

impl Cells {
    /// Cells of a rectangle: least and greatest x, then y.
    pub(super) fn new(bounds: [[f32; 2]; 2]) -> Self {
        let scale = bounds.map(|[low, high]| if high > low { SIDE as f32 / (high - low) } else { 0.0 });
        Self { first: bounds.map(|[low, _]| low), scale, behind: OnceLock::new() }
    }

    /// First and last column, then row, of the cells that touch a rectangle.
    fn touched(&self, bounds: [[f32; 2]; 2]) -> Option<[[usize; 2]; 2]> {
        let mut touched = [[0; 2]; 2];
        for c in 0..2 {
            let [low, high] = bounds[c].map(|end| (end - self.first[c]) * self.scale[c]);
            if low > SIDE as f32 || high < 0.0 {
                return None;
            }
            if low.is_nan() || high.is_nan() {
                touched[c] = [0, SIDE - 1];
                continue;
            }
            touched[c] = [low, high].map(|end| (end.max(0.0) as usize).min(SIDE - 1));
        }
        Some(touched)
    }

    /// Something within a rectangle receives shadows, and is so far behind the ground at the most.
    pub(super) fn receive(&self, bounds: [[f32; 2]; 2], behind: f32) {
        let Some([[left, right], [top, bottom]]) = self.touched(bounds) else { return };
        for row in top..=bottom {
            for column in left..=right {
                self.raise(row * SIDE + column, key(behind));
            }
        }
    }

    /// Makes sure that a cell has at least this key.
    fn raise(&self, cell: usize, key: u32) {
        let cells = self.behind.get_or_init(|| (0..SIDE * SIDE).map(|_| AtomicU32::new(0)).collect());
        // Most change nothing, and to look is cheaper.
        if cells[cell].load(Ordering::Relaxed) < key {
            cells[cell].fetch_max(key, Ordering::Relaxed);
        }
    }

    /// The same of several: those whose mark is not 0.
    #[inline(always)]
    pub(super) fn receive_all(&self, bounds: &[[Lanes; 2]; 2], behind: &Lanes, marks: &[u32; LANES]) {
        let mut cells = [[[0; LANES]; 2]; 2];
        for c in 0..2 {
            for end in 0..2 {
                for l in 0..LANES {
                    cells[c][end][l] = ((bounds[c][end][l] - self.first[c]) * self.scale[c]) as i32;
                }
            }
        }
        let marked = || (0..LANES).filter(|&l| marks[l] != 0);
        let Some(first) = marked().next() else { return };
        let [[left, right], [top, bottom]] = cells.map(|ends| ends.map(|end| end[first]));
        let is_same = |l: usize| cells.map(|ends| ends.map(|end| end[l])) == [[left; 2], [top; 2]];
        // Neighbours are mostly in the same cell.
        let is_one = right == left && bottom == top && [left, top].iter().all(|at| (1..SIDE as i32).contains(at));
        if is_one && marked().all(is_same) {
            let most = marked().map(|l| key(behind[l])).max().unwrap_or(0);
            self.raise(top as usize * SIDE + left as usize, most);
            return;
        }
        for l in marked() {
            self.receive(bounds.map(|ends| ends.map(|end| end[l])), behind[l]);
        }
    }

    /// Is all that receives shadows within a rectangle before something that lies so far behind the ground at the
    /// least?
    pub(super) fn hides(&self, bounds: [[f32; 2]; 2], behind: f32) -> bool {
        let Some([[left, right], [top, bottom]]) = self.touched(bounds) else { return true };
        let Some(cells) = self.behind.get() else { return true };
        let behind = if behind.is_finite() { key(behind) } else { 1 };
        let rows = cells.chunks_exact(SIDE).take(bottom + 1).skip(top);
        rows.flat_map(|row| &row[left..=right]).all(|cell| cell.load(Ordering::Relaxed) <= behind)
    }
}

/// A positive number that is greater for a greater number; greatest for what is no number.
fn key(number: f32) -> u32 {
    let bits = number.to_bits();
    if number.is_nan() {
        u32::MAX
    } else if bits >> 31 == 0 {
        bits | 1 << 31
    } else {
        !bits
    }
}

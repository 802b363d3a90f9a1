//! Where a surface ends: at the rim of an open one, where it turns sharply, and where its colour changes.
//!
//! A merged disc reaches over those below it. Within a surface of one colour nobody sees that, since its neighbours are
//! there; at a rim it moves an outline.

use std::collections::HashMap;
use std::f32::consts::TAU;
use std::hash::{BuildHasherDefault, Hasher};
use std::ops::Range;

use glam::{IVec3, Vec3};
use rayon::prelude::*;

use super::grid::Grid;
use super::merge::{AGREE, Disc, displayed};
use crate::model::surfels::Surfels;

/// Distances from the middle of a disc at one of which its surface must go on, in edges of a cell: two points so far
/// apart along a plane share no cell.
const AWAY: [f32; 2] = [1.5, 2.25];
/// Share of the semi-axes of a disc of the model within which it holds cells.
const COVERED: f32 = 0.7;
/// Directions in which it must.
const DIRECTIONS: usize = 8;
/// How far off its plane it may, in edges of a cell.
const OFF: [f32; 3] = [0.0, 0.75, -0.75];

/// Discs whose cells are found together.
const PART: usize = 1 << 14;

/// Cells of one size that hold discs of a model, with the fronts of these.
#[derive(Debug, Default)]
pub(super) struct Occupied {
    /// Two to this is the edge of a cell, in cells of the codes.
    pub(super) shift: u32,
    cells: Vec<Cell>,
    /// Index in `cells` by place.
    index: HashMap<u64, u32, BuildHasherDefault<Mixer>>,
}

/// A cell that holds discs.
#[derive(Clone, Copy, Debug)]
struct Cell {
    place: IVec3,
    /// Discs with like fronts, of one side and of another.
    sides: [Side; 2],
}

/// Sums over discs with like fronts.
#[derive(Clone, Copy, Debug, Default)]
struct Side {
    front: Vec3,
    /// Colours as they are displayed.
    shown: Vec3,
    discs: f32,
}

impl Side {
    /// Do discs of these fronts lie on one side?
    fn agrees(&self, front: Vec3) -> bool {
        self.discs > 0.0 && self.front.dot(front) >= AGREE * self.front.length() * front.length()
    }
}

impl Occupied {
    /// The cells of `surfels` with an edge of 2 to `shift`.
    pub(super) fn of(surfels: &Surfels, grid: &Grid, shift: u32) -> Self {
        // Parts of a length of their own: sums do not depend on the number of threads.
        let parts: Vec<Range<usize>> =
            (0..surfels.len()).step_by(PART).map(|first| first..(first + PART).min(surfels.len())).collect();
        let parts: Vec<Self> = parts.into_par_iter().map(|part| Self::of_part(surfels, part, grid, shift)).collect();
        let mut all = Self { shift, ..Self::default() };
        for part in &parts {
            all.add_all(part, 0);
        }
        all
    }

    fn of_part(surfels: &Surfels, part: Range<usize>, grid: &Grid, shift: u32) -> Self {
        let mut occupied = Self { shift, ..Self::default() };
        for i in part {
            let (position, u, v) = (surfels.position[i], surfels.axis_u[i], surfels.axis_v[i]);
            let front = u.cross(v).normalize_or_zero();
            let side = Side { front, shown: displayed(surfels.colour[i]), discs: 1.0 };
            let own = grid.place(position, shift);
            occupied.add(own, side);
            for to in [u, -u, v, -v] {
                let place = grid.place(position + to * COVERED, shift);
                if place != own {
                    occupied.add(place, side);
                }
            }
        }
        occupied
    }

    /// The same with cells with an edge of 2 to `shift`, which are larger.
    pub(super) fn coarser(&self, shift: u32) -> Self {
        let mut coarse = Self { shift, ..Self::default() };
        coarse.add_all(self, shift - self.shift);
        coarse
    }

    /// Adds all that `other` holds, whose cells are 2 to `by` times smaller.
    fn add_all(&mut self, other: &Self, by: u32) {
        for cell in &other.cells {
            cell.sides.iter().filter(|side| side.discs > 0.0).for_each(|&side| self.add(cell.place >> by, side));
        }
    }

    fn add(&mut self, place: IVec3, of: Side) {
        // Most often it is the cell of the disc before.
        let cell = match self.cells.last_mut() {
            Some(last) if last.place == place => last,
            _ => {
                let at = *self.index.entry(key(place)).or_insert(self.cells.len() as u32) as usize;
                if at == self.cells.len() {
                    self.cells.push(Cell { place, sides: [Side::default(); 2] });
                }
                &mut self.cells[at]
            }
        };
        let [one, other] = &mut cell.sides;
        let side = if one.discs == 0.0 || one.agrees(of.front) { one } else { other };
        side.front += of.front;
        side.shown += of.shown;
        side.discs += of.discs;
    }

    /// What shows where a disc of a cell of this size reaches over its neighbours: 1 where its surface ends, else how
    /// far their colours are from its own, as a share of white as it is displayed.
    pub(super) fn contrast(&self, disc: &Disc, grid: &Grid) -> f32 {
        let front = disc.front();
        if front == Vec3::ZERO {
            return 1.0;
        }
        let edge = grid.edge(self.shift);
        let (right, up) = front.any_orthonormal_pair();
        let own = displayed(disc.colour);
        let mut contrast: f32 = 0.0;
        for i in 0..DIRECTIONS {
            let (sin, cos) = (i as f32 * (TAU / DIRECTIONS as f32)).sin_cos();
            let towards = right * cos + up * sin;
            let places = AWAY.iter().flat_map(|away| OFF.iter().map(move |off| (away, off)));
            let side = places.into_iter().find_map(|(away, off)| {
                let beside = disc.position + towards * (away * edge + COVERED * disc.radius) + front * (off * edge);
                self.side(grid.place(beside, self.shift), front)
            });
            let Some(side) = side else { return 1.0 };
            contrast = contrast.max((side.shown / side.discs - own).length_squared() / 3.0);
        }
        contrast.sqrt().min(1.0)
    }

    /// The discs of a cell on the side of a front.
    fn side(&self, place: IVec3, front: Vec3) -> Option<&Side> {
        let cell = self.index.get(&key(place)).map(|&at| &self.cells[at as usize])?;
        cell.sides.iter().find(|side| side.agrees(front))
    }
}

/// A number of its own for each place of 21 bits an axis, and for those beside them.
fn key(place: IVec3) -> u64 {
    let bits = |number: i32| u64::from(number as u32) & ((1 << 21) - 1);
    bits(place.x) << 42 | bits(place.y) << 21 | bits(place.z)
}

/// A hash for places: the standard one took a quarter of the build.
#[derive(Clone, Copy, Debug, Default)]
struct Mixer(u64);

impl Hasher for Mixer {
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u64(byte.into());
        }
    }

    fn write_u64(&mut self, number: u64) {
        let mixed = (self.0 ^ number).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ (mixed >> 32);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

//! Where a surface ends: at the rim of an open one, where it turns sharply, and where its colour changes.
//!
//! A merged disc reaches over those below it. Within a surface of one colour nobody sees that, since its neighbours are
//! there; at a rim it moves an outline.

use std::collections::HashMap;
use std::ops::Range;

use glam::{IVec3, Vec3};
use rayon::prelude::*;

use super::grid::Grid;
use super::merge::{AGREE, DIRECTIONS, Disc, displayed};
use crate::model::order::BITS;
use crate::model::surfels::Surfels;

/// Distances from the middle of a disc at one of which its surface must go on in each direction, in edges of a cell:
/// two points so far apart share no cell.
const AWAY: [f32; 2] = [1.75, 2.5];
/// How far off its plane it may, in edges of a cell.
const OFF: [f32; 3] = [0.0, 0.75, -0.75];
/// Share of the semi-axes of a disc of the model within which it holds cells.
const COVERED: f32 = 0.7;

/// Two to this is the edge of a brick, cells. What lies close together is found in one brick.
const BRICK: u32 = 2;
/// Cells of a brick.
const BRICK_CELLS: usize = 1 << (3 * BRICK);
/// A cell of a brick that holds nothing.
const NONE: u32 = u32::MAX;

/// Discs whose cells are found by one thread.
const PART: usize = 1 << 14;
/// Parts of so many discs whose cells are held at once.
const AT_ONCE: usize = 16;

/// Cells of one size that hold discs of a model, with the fronts of these.
#[derive(Debug, Default)]
pub(super) struct Occupied {
    /// Two to this is the edge of a cell, in cells of the codes.
    pub(super) shift: u32,
    cells: Vec<Cell>,
    /// Indices in `cells`, or [`NONE`].
    bricks: Vec<[u32; BRICK_CELLS]>,
    /// Index in `bricks` by place.
    index: HashMap<u64, u32>,
}

/// The brick that was looked for last, by its key: most often the next cell lies in it, too.
type Last = Option<(u64, Option<u32>)>;

/// A cell that holds discs.
#[derive(Clone, Copy, Debug)]
struct Cell {
    place: IVec3,
    /// Discs with like fronts, of one side and of another.
    sides: [Side; 2],
}

/// Discs with like fronts.
#[derive(Clone, Copy, Debug, Default)]
struct Side {
    /// Sum of their fronts.
    front: Vec3,
    /// Sum of their colours, weighted by their areas.
    colour: Vec3,
    area: f32,
    /// Mean of their colours, as it is displayed.
    shown: Vec3,
}

impl Side {
    fn is_empty(&self) -> bool {
        self.front == Vec3::ZERO
    }

    /// Do discs of these fronts lie on one side?
    fn agrees(&self, front: Vec3) -> bool {
        let dot = self.front.dot(front);
        dot > 0.0 && dot >= AGREE * self.front.length() * front.length()
    }
}

impl Occupied {
    /// The cells of `surfels` with an edge of 2 to `shift`.
    pub(super) fn of(surfels: &Surfels, grid: &Grid, shift: u32) -> Self {
        // Parts of a length of their own: sums do not depend on the number of threads.
        let parts: Vec<Range<usize>> =
            (0..surfels.len()).step_by(PART).map(|first| first..(first + PART).min(surfels.len())).collect();
        let mut all = Self { shift, ..Self::default() };
        for parts in parts.chunks(AT_ONCE) {
            let parts = parts.par_iter().map(|part| Self::of_part(surfels, part.clone(), grid, shift));
            for part in &parts.collect::<Vec<_>>() {
                all.add_all(part, 0);
            }
        }
        all.displayed()
    }

    fn of_part(surfels: &Surfels, part: Range<usize>, grid: &Grid, shift: u32) -> Self {
        let mut occupied = Self { shift, ..Self::default() };
        let mut last = None;
        for i in part {
            let (position, u, v) = (surfels.position[i], surfels.axis_u[i], surfels.axis_v[i]);
            let cross = u.cross(v);
            let (front, area) = (cross.normalize_or_zero(), cross.length());
            if front == Vec3::ZERO || !area.is_finite() {
                continue;
            }
            let side = Side { front, colour: surfels.colour[i] * area, area, ..Side::default() };
            let own = grid.place(position, shift);
            occupied.add(own, side, &mut last);
            for to in [u, -u, v, -v] {
                let place = grid.place(position + to * COVERED, shift);
                if place != own {
                    occupied.add(place, side, &mut last);
                }
            }
        }
        occupied
    }

    /// The same with cells with an edge of 2 to `shift`, which are larger.
    pub(super) fn coarser(&self, shift: u32) -> Self {
        let mut coarse = Self { shift, ..Self::default() };
        coarse.add_all(self, shift - self.shift);
        coarse.displayed()
    }

    /// Adds all that `other` holds, whose cells are 2 to `by` times smaller.
    fn add_all(&mut self, other: &Self, by: u32) {
        let mut last = None;
        for cell in &other.cells {
            for &side in cell.sides.iter().filter(|side| !side.is_empty()) {
                self.add(cell.place >> by, side, &mut last);
            }
        }
    }

    /// The same, with what is displayed of each side.
    fn displayed(mut self) -> Self {
        for side in self.cells.iter_mut().flat_map(|cell| &mut cell.sides) {
            side.shown = displayed(side.colour / side.area);
        }
        self
    }

    fn add(&mut self, place: IVec3, of: Side, last: &mut Last) {
        let Some((key, slot)) = key(place) else { return };
        let brick = match *last {
            Some((of_last, Some(brick))) if of_last == key => brick,
            _ => *self.index.entry(key).or_insert(self.bricks.len() as u32),
        };
        *last = Some((key, Some(brick)));
        if brick as usize == self.bricks.len() {
            self.bricks.push([NONE; BRICK_CELLS]);
        }
        let at = &mut self.bricks[brick as usize][slot];
        if *at == NONE {
            *at = self.cells.len() as u32;
            self.cells.push(Cell { place, sides: [Side::default(); 2] });
        }
        let cell = &mut self.cells[*at as usize];
        let [one, other] = &mut cell.sides;
        // What belongs to a third side is left out: there the surface seems to end.
        let Some(side) = [one, other].into_iter().find(|side| side.is_empty() || side.agrees(of.front)) else { return };
        side.front += of.front;
        side.colour += of.colour;
        side.area += of.area;
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
        let mut last = None;
        for to in DIRECTIONS {
            let towards = right * to.x + up * to.y;
            let places = AWAY.iter().flat_map(|away| OFF.iter().map(move |off| (away, off)));
            let side = places.into_iter().find_map(|(away, off)| {
                let beside = disc.position + towards * (away * edge + COVERED * disc.radius) + front * (off * edge);
                self.side(grid.place(beside, self.shift), front, &mut last)
            });
            let Some(side) = side else { return 1.0 };
            contrast = contrast.max((side.shown - own).length_squared() / 3.0);
        }
        contrast.sqrt().min(1.0)
    }

    /// The discs of a cell on the side of a front.
    fn side(&self, place: IVec3, front: Vec3, last: &mut Last) -> Option<&Side> {
        let (key, slot) = key(place)?;
        let brick = match *last {
            Some((of_last, brick)) if of_last == key => brick,
            _ => self.index.get(&key).copied(),
        };
        *last = Some((key, brick));
        let cell = self.cells.get(self.bricks[brick? as usize][slot] as usize)?;
        cell.sides.iter().find(|side| side.agrees(front))
    }
}

/// A number of its own for each brick within the model, and the cell in it; `None` outside.
fn key(place: IVec3) -> Option<(u64, usize)> {
    let inside = place.cmpge(IVec3::ZERO).all() && place.cmplt(IVec3::splat(1 << BITS)).all();
    let [x, y, z] = (place >> BRICK).to_array().map(|number| u64::from(number as u32));
    let [i, j, k] = (place & ((1 << BRICK) - 1)).to_array().map(|number| number as usize);
    inside.then_some((x << (2 * BITS) | y << BITS | z, (i << BRICK | j) << BRICK | k))
}

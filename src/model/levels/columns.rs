//! The tree as columns of numbers, as a file has it, and back.

use std::ops::Range;

use glam::{Mat3, Vec3};

use super::{Levels, Node, Rates};
use crate::limits::MAX_COORDINATE;
use crate::model::order::BITS;
use crate::model::surfels::Surfels;

/// Columns of a tree but for its merged surfels. The first five have a row for each node, the others for each of these.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::model) struct TreeColumns {
    /// First surfel, the one behind the last, first child, the one behind the last.
    pub(in crate::model) ranges: Vec<[i64; 4]>,
    /// Least and greatest corner.
    pub(in crate::model) corners: Vec<[f32; 6]>,
    pub(in crate::model) axis: Vec<Vec3>,
    /// Spacing, deviation, rest, turns.
    pub(in crate::model) errors: Vec<[f32; 4]>,
    /// Rows of the upper triangle: xx, xy, xz, yy, yz, zz.
    pub(in crate::model) along: Vec<[f32; 6]>,
    /// Velocities and accelerations, where the model has them: least and greatest corner, mean, stray.
    pub(in crate::model) rates: [Vec<[f32; 10]>; 2],
    pub(in crate::model) share: Vec<f32>,
    pub(in crate::model) alike: Vec<f32>,
}

/// A fault in a row of a column.
#[derive(Debug)]
pub(in crate::model) struct Wrong {
    /// Name of the column without `level_`.
    pub(in crate::model) column: &'static str,
    pub(in crate::model) row: usize,
    pub(in crate::model) expected: &'static str,
}

impl Levels {
    /// Columns of the nodes, and of what merged surfels have beside their own.
    pub(in crate::model) fn columns(&self) -> TreeColumns {
        let nodes = || self.nodes.iter();
        let rates = |order: usize| nodes().map(|node| node.rates[order].row()).collect();
        let [velocity, acceleration] = self.merged.rates().map(|column| !column.is_empty());
        let ends = |of: &Range<u32>| [of.start.into(), of.end.into()];
        TreeColumns {
            ranges: nodes()
                .map(|node| {
                    let ([first, end], [child, last]) = (ends(&node.surfels), ends(&node.children));
                    [first, end, child, last]
                })
                .collect(),
            corners: nodes()
                .map(|node| {
                    let [low, high] = node.corners;
                    [low.x, low.y, low.z, high.x, high.y, high.z]
                })
                .collect(),
            axis: nodes().map(|node| node.axis).collect(),
            errors: nodes().map(|node| [node.spacing, node.deviation, node.rest, node.turns]).collect(),
            along: nodes()
                .map(|node| {
                    let Mat3 { x_axis: x, y_axis: y, z_axis: z } = node.along;
                    [x.x, x.y, x.z, y.y, y.z, z.z]
                })
                .collect(),
            rates: [if velocity { rates(0) } else { Vec::new() }, if acceleration { rates(1) } else { Vec::new() }],
            share: self.share.clone(),
            alike: self.alike.clone(),
        }
    }

    /// The merged surfels of all nodes.
    pub(in crate::model) fn merged(&self) -> &Surfels {
        &self.merged
    }

    /// The tree over `count` surfels that these columns describe. Merged surfels are known to be sound, and the columns
    /// to have rows for all.
    ///
    /// # Errors
    /// The first row that makes no tree.
    pub(in crate::model) fn from_columns(columns: TreeColumns, merged: Surfels, count: usize) -> Result<Self, Wrong> {
        let ranges = ranges(&columns.ranges, merged.len(), count)?;
        check_numbers(&columns)?;
        let nodes = ranges.into_iter().enumerate().map(|(i, [surfels, children])| {
            let [low_x, low_y, low_z, high_x, high_y, high_z] = columns.corners[i];
            let [spacing, deviation, rest, turns] = columns.errors[i];
            let [xx, xy, xz, yy, yz, zz] = columns.along[i];
            Node {
                corners: [Vec3::new(low_x, low_y, low_z), Vec3::new(high_x, high_y, high_z)],
                axis: columns.axis[i],
                spacing,
                deviation,
                rest,
                turns,
                along: Mat3::from_cols(Vec3::new(xx, xy, xz), Vec3::new(xy, yy, yz), Vec3::new(xz, yz, zz)),
                rates: [0, 1].map(|order| columns.rates[order].get(i).map(Rates::of_row).unwrap_or_default()),
                surfels,
                children,
            }
        });
        Ok(Self { nodes: nodes.collect(), merged, share: columns.share, alike: columns.alike })
    }
}

impl Rates {
    fn row(&self) -> [f32; 10] {
        let ([low, high], mean) = (self.corners, self.mean);
        [low.x, low.y, low.z, high.x, high.y, high.z, mean.x, mean.y, mean.z, self.stray]
    }

    fn of_row(&[low_x, low_y, low_z, high_x, high_y, high_z, x, y, z, stray]: &[f32; 10]) -> Self {
        let corners = [Vec3::new(low_x, low_y, low_z), Vec3::new(high_x, high_y, high_z)];
        Self { corners, mean: Vec3::new(x, y, z), stray }
    }
}

/// Surfels and children of each node. Each node but the first has one parent, before it; the leaves hold each surfel of
/// the model once, in its order, and the other nodes no more than the merged ones.
fn ranges(rows: &[[i64; 4]], merged: usize, count: usize) -> Result<Vec<[Range<u32>; 2]>, Wrong> {
    let wrong = |row, expected| Wrong { column: "node", row, expected };
    let mut ranges = Vec::with_capacity(rows.len());
    let (mut next, mut left) = (1, merged as u64);
    for (row, ends) in rows.iter().enumerate() {
        let numbers = ends.map(|end| u32::try_from(end).ok());
        let [Some(first), Some(end), Some(child), Some(last)] = numbers else {
            return Err(wrong(row, "numbers from 0 to 4294967295"));
        };
        if first >= end || child > last {
            return Err(wrong(row, "one surfel at least, and no range that ends before it begins"));
        }
        if child < last {
            if child as usize != next || child as usize <= row || last as usize > rows.len() {
                return Err(wrong(row, "children that follow those of the nodes before"));
            }
            next = last as usize;
            left = left
                .checked_sub(u64::from(end - first))
                .filter(|_| end as usize <= merged)
                .ok_or_else(|| wrong(row, "merged surfels of its own"))?;
        } else if child != 0 {
            return Err(wrong(row, "zeros where there are no children"));
        }
        ranges.push([first..end, child..last]);
    }
    if next != rows.len() {
        return Err(wrong(next.min(rows.len().saturating_sub(1)), "a parent"));
    }
    // A cut goes down one call for each level.
    let (mut open, mut covered) = (vec![(0, 0)], 0);
    while let Some((row, depth)) = open.pop() {
        let [surfels, children] = &ranges[row as usize];
        if depth > BITS {
            return Err(wrong(row as usize, "at most 22 levels"));
        }
        if children.is_empty() {
            if surfels.start != covered {
                return Err(wrong(row as usize, "the surfels that follow those of the leaf before"));
            }
            covered = surfels.end;
        }
        open.extend(children.clone().rev().map(|child| (child, depth + 1)));
    }
    if covered as usize == count { Ok(ranges) } else { Err(wrong(0, "leaves that hold all surfels")) }
}

/// Numbers that a cut can work with.
fn check_numbers(columns: &TreeColumns) -> Result<(), Wrong> {
    fn first<T>(
        column: &'static str,
        rows: &[T],
        is_right: impl Fn(&T) -> bool,
        expected: &'static str,
    ) -> Result<(), Wrong> {
        rows.iter().position(|row| !is_right(row)).map_or(Ok(()), |row| Err(Wrong { column, row, expected }))
    }
    let limit = MAX_COORDINATE as f32;
    // Corners of boxes around discs may lie outside by an axis.
    let place = |x: &f32| x.abs() <= 4.0 * limit;
    // Not NaN. Sums of squares of large discs may be infinite.
    let positive = |x: &f32| *x >= 0.0;
    let small = |x: &f32| x.abs() <= 2.0;
    let is_box = |c: &[f32]| c.iter().all(place) && (0..3).all(|axis| c[axis] <= c[axis + 3]);
    let is_rates =
        |row: &[f32; 10]| is_box(&row[..6]) && row[6..9].iter().all(place) && positive(&row[9]) && row[9].is_finite();
    first("velocities", &columns.rates[0], is_rates, "corners of a box, a mean, a number of at least 0")?;
    first("accelerations", &columns.rates[1], is_rates, "corners of a box, a mean, a number of at least 0")?;
    first("box", &columns.corners, |row| is_box(row), "corners of a box")?;
    first("axis", &columns.axis, |axis| axis.is_finite() && axis.length_squared() < 1.01, "a length of at most 1")?;
    first("errors", &columns.errors, |errors| errors.iter().all(positive), "numbers of at least 0")?;
    first("along", &columns.along, |along| along.iter().all(small), "numbers from -2 to 2")?;
    first("share", &columns.share, positive, "a number of at least 0")?;
    first("alike", &columns.alike, |alike| (0.0..=1.0).contains(alike), "a number from 0 to 1")
}

//! The band along sharp edges, where surfels are finer: what reaches beyond an edge is as much smaller.
//!
//! Distances are those of shadows along the axis of the rays. Discs of the coarse grid stand so far from every edge
//! that they reach no farther beyond it than fine discs do. Fine discs cover what the coarse ones leave.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::edges::{Edges, INSET};
use super::facets::{TriangleShape, shadow};

/// No point is farther from a grid, spacings.
const GRID: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Edges of a cell that count, the longest ones. A heap of edges has no outline.
const CROWD: usize = 64;

/// The bands of all levels.
pub(super) struct Bands(Vec<Band>);

/// Sharp edges of a level, sorted by cells of a grid.
pub(super) struct Band {
    /// Distance of the coarse rays, model units.
    coarse: f64,
    /// Distance of the fine rays, coarse spacings; 1 without any.
    ratio: f64,
    segments: Vec<[DVec3; 2]>,
    /// Edges that are near a cell, by cells.
    cells: Vec<([i32; 3], u32)>,
}

/// Coarse surfels are so far from each edge, coarse spacings.
pub(super) fn coarse_from(fine: f64) -> f64 {
    1.0 - (1.0 - INSET) * fine
}

/// The coarse grid covers all that is so far from each edge, coarse spacings.
fn covered_from(fine: f64) -> f64 {
    coarse_from(fine) + GRID
}

/// Fine surfels are so far from an edge at most, coarse spacings. `fine` is their spacing, coarse spacings.
pub(super) fn reach(fine: f64) -> f64 {
    covered_from(fine) + GRID * fine
}

impl Bands {
    /// Without fine surfels. `coarse` is the spacing of level 0.
    pub(super) fn none(coarse: f64, levels: usize) -> Self {
        Self((0..levels).map(|level| Band::none(of_level(coarse, level))).collect())
    }

    /// Gives a level another band.
    pub(super) fn set(&mut self, level: usize, band: Band) {
        self.0[level] = band;
    }

    /// The band of a level.
    pub(super) fn of(&self, level: u8) -> &Band {
        &self.0[usize::from(level)]
    }

    /// The bands of all levels, from the finest on.
    pub(super) fn levels(&self) -> impl Iterator<Item = &Band> {
        self.0.iter()
    }
}

/// The spacing of a level, where `coarse` is that of level 0.
fn of_level(coarse: f64, level: usize) -> f64 {
    coarse * (1_u64 << level) as f64
}

impl Band {
    /// Without fine surfels.
    fn none(coarse: f64) -> Self {
        Self { coarse, ratio: 1.0, segments: Vec::new(), cells: Vec::new() }
    }

    /// The band at the edges around a level, not refined yet. Edges that are shorter than the coarse spacing do not
    /// count, nor those of levels that are not beside this one. `None` if they have more than `most` parts as long as a
    /// cell.
    pub(super) fn with_edges(&self, edges: &Edges, level: usize, most: f64) -> Option<Self> {
        let coarse = self.coarse;
        let counts = |([a, b], of_edge): &(&[DVec3; 2], &u8)| {
            a.distance_squared(*b) >= coarse * coarse && level.abs_diff(usize::from(**of_edge)) <= 1
        };
        let edges = edges.segments.par_iter().zip(&edges.levels).filter(counts);
        let mut segments: Vec<[DVec3; 2]> = edges.map(|(segment, _)| *segment).collect();
        // A stable sort: equally long ones stay in their order.
        segments.par_sort_by(|[a, b], [c, d]| c.distance_squared(*d).total_cmp(&a.distance_squared(*b)));
        let mut band = Self { segments, ..Self::none(coarse) };
        let (width, margin) = (band.width(), 0.5 * band.width());
        let steps = |[a, b]: &[DVec3; 2]| (a.distance(*b) / width).ceil().max(1.0);
        // The sum of whole numbers does not depend on threads.
        if band.segments.par_iter().map(steps).sum::<f64>() > most {
            return None;
        }
        let of_segment = |(index, [a, b]): (usize, &[DVec3; 2])| {
            let (index, steps, a, b) = (index as u32, steps(&[*a, *b]), *a, *b);
            let piece = move |step: u64| {
                let at = |step: f64| a + (b - a) * (step / steps);
                let (p, q) = (at(step as f64), at(step as f64 + 1.0));
                cells(p.min(q) - margin, p.max(q) + margin, width)
            };
            let mut near: Vec<[i32; 3]> = (0..steps as u64).flat_map(piece).collect();
            near.sort_unstable();
            near.dedup();
            near.into_iter().map(move |cell| (cell, index))
        };
        let mut cells: Vec<_> = band.segments.par_iter().enumerate().flat_map_iter(of_segment).collect();
        cells.par_sort_unstable();
        let mut count = 0;
        let mut last = None;
        cells.retain(|(cell, _)| {
            count = if last == Some(*cell) { count + 1 } else { 0 };
            last = Some(*cell);
            count < CROWD
        });
        band.cells = cells;
        Some(band)
    }

    /// The same with a fine grid, whose spacing is less than 1 coarse spacing.
    pub(super) fn refined(self, ratio: f64) -> Self {
        Self { ratio, ..self }
    }

    /// Distance of the rays of a grid.
    pub(super) fn spacing(&self, fine: bool) -> f64 {
        if fine { self.coarse * self.ratio } else { self.coarse }
    }

    /// Width of a cell. Half of it is more than the band is wide on any slope.
    fn width(&self) -> f64 {
        2.0 * 3_f64.sqrt() * reach(1.0) * self.coarse
    }

    /// The sharp edges that may be near a triangle.
    pub(super) fn near(&self, shape: &TriangleShape) -> Vec<[DVec3; 2]> {
        if self.cells.is_empty() {
            return Vec::new();
        }
        let [low, high] = box_of(shape.corner);
        if (high - low).max_element() <= self.width() {
            let mut indices: Vec<u32> = self.in_box(low, high).collect();
            indices.sort_unstable();
            indices.dedup();
            return indices.into_iter().map(|index| self.segments[index as usize]).collect();
        }
        let mut found = Found::new(self.segments.len());
        self.search(shape.corner, &mut found);
        found.indices().map(|index| self.segments[index]).collect()
    }

    /// Cuts a triangle until its box is no larger than a cell. A needle of a million cells has few edges of its own: a
    /// part with no edge near that is not found yet has nothing to find.
    fn search(&self, corner: [DVec3; 3], found: &mut Found) {
        let [low, high] = box_of(corner);
        // An edge is in the cells that half a width around it meets. They reach one width farther; the rest is slack.
        let margin = DVec3::splat(2.0 * self.width());
        let is_new = |(index, [p, q]): (usize, &[DVec3; 2])| {
            let is_near = (p.min(*q) - margin).cmple(high).all() && (p.max(*q) + margin).cmpge(low).all();
            is_near && !found.contains(index)
        };
        if self.segments.len() <= CROWD && !self.segments.iter().enumerate().any(is_new) {
            return;
        }
        if (high - low).max_element() > self.width() {
            let lengths = [0, 1, 2].map(|k| corner[k].distance_squared(corner[(k + 1) % 3]));
            let k = (0..3).max_by(|&i, &j| lengths[i].total_cmp(&lengths[j])).unwrap_or(0);
            let [from, to, tip] = [0, 1, 2].map(|i| corner[(k + i) % 3]);
            let middle = 0.5 * (from + to);
            self.search([from, middle, tip], found);
            self.search([middle, to, tip], found);
            return;
        }
        self.in_box(low, high).for_each(|index| found.add(index as usize));
    }

    /// The edges of the cells that a box overlaps, some of them more than once.
    fn in_box(&self, low: DVec3, high: DVec3) -> impl Iterator<Item = u32> + '_ {
        let [low, high] = [low, high].map(|place| cell(place, self.width()));
        (low[0]..=high[0]).flat_map(move |x| (low[1]..=high[1]).map(move |y| (x, y))).flat_map(move |(x, y)| {
            // Cells of one x and y lie one behind the other.
            let start = self.cells.partition_point(|(other, _)| *other < [x, y, low[2]]);
            let run = self.cells[start..].iter().take_while(move |(other, _)| *other <= [x, y, high[2]]);
            run.map(|(_, index)| *index)
        })
    }

    /// True if a surfel at a place that no ray found is to be fine. `near` are the edges around its triangle.
    pub(super) fn is_fine(&self, near: &[[DVec3; 2]], at: DVec3, axis: usize) -> bool {
        let within = covered_from(self.ratio) * self.coarse;
        let shadow = |p: DVec3| shadow(p, axis);
        near.iter().any(|segment| distance(shadow(at), segment.map(shadow)) < within)
    }
}

/// Indices below a bound. A long edge lies in thousands of cells, and is found in each of them.
struct Found(Vec<u64>);

impl Found {
    fn new(bound: usize) -> Self {
        Self(vec![0; bound.div_ceil(64)])
    }

    fn add(&mut self, index: usize) {
        self.0[index / 64] |= 1 << (index % 64);
    }

    fn contains(&self, index: usize) -> bool {
        self.0[index / 64] >> (index % 64) & 1 == 1
    }

    /// Rising.
    fn indices(&self) -> impl Iterator<Item = usize> + '_ {
        self.0.iter().enumerate().flat_map(|(word, &bits)| {
            let rest = |bits: &u64| Some(bits & (bits - 1)).filter(|bits| *bits != 0);
            let each = std::iter::successors(Some(bits).filter(|bits| *bits != 0), rest);
            each.map(move |bits| 64 * word + bits.trailing_zeros() as usize)
        })
    }
}

/// The box of a triangle.
fn box_of([a, b, c]: [DVec3; 3]) -> [DVec3; 2] {
    [a.min(b).min(c), a.max(b).max(c)]
}

/// The cell of a place.
fn cell(place: DVec3, width: f64) -> [i32; 3] {
    (place / width).floor().to_array().map(|x| x as i32)
}

/// The cells that a box overlaps.
fn cells(low: DVec3, high: DVec3, width: f64) -> impl Iterator<Item = [i32; 3]> {
    let [low, high] = [low, high].map(|place| cell(place, width));
    let [xs, ys, zs] = [0, 1, 2].map(|k| low[k]..=high[k]);
    xs.flat_map(move |x| {
        let zs = zs.clone();
        ys.clone().flat_map(move |y| zs.clone().map(move |z| [x, y, z]))
    })
}

/// Distance of a point from a line segment.
fn distance(p: DVec2, [a, b]: [DVec2; 2]) -> f64 {
    let along = b - a;
    let t = (p - a).dot(along) / along.length_squared();
    // A segment along the axis has no shadow but a point.
    p.distance(if t.is_finite() { a + t.clamp(0.0, 1.0) * along } else { a })
}

/// The parts of the rows of a grid in which it has hits, from row to row upwards.
pub(super) struct Spans {
    /// Shadows of edges in units of the grid, by their lowest end.
    segments: Vec<[DVec2; 2]>,
    /// How many of them have been seen.
    next: usize,
    /// Those that the row may meet.
    active: Vec<[DVec2; 2]>,
    radius: f64,
    /// Hits are within the radius around edges, and not beyond.
    within: bool,
    row: Vec<[f64; 2]>,
}

impl Spans {
    /// The spans of one triangle, near which there are edges.
    pub(super) fn new(near: &[[DVec3; 2]], fine: bool, band: &Band, axis: usize) -> Self {
        let radius = if fine { reach(band.ratio) / band.ratio } else { coarse_from(band.ratio) };
        Self::around(near, band.spacing(fine), axis, radius, fine)
    }

    /// The places of a grid that are `within` a radius around edges, or those that are not.
    pub(super) fn around(near: &[[DVec3; 2]], spacing: f64, axis: usize, radius: f64, within: bool) -> Self {
        let upwards = |[a, b]: [DVec2; 2]| if a.y <= b.y { [a, b] } else { [b, a] };
        let place = |p: DVec3| shadow(p, axis) / spacing - 0.5;
        let mut segments: Vec<[DVec2; 2]> = near.iter().map(|segment| upwards(segment.map(place))).collect();
        segments.sort_by(|a, b| a[0].y.total_cmp(&b[0].y));
        Self { segments, next: 0, active: Vec::new(), radius, within, row: Vec::new() }
    }

    /// The parts of the row at this height, which is greater than that before.
    pub(super) fn of_row(&mut self, y: f64) -> &[[f64; 2]] {
        let radius = self.radius;
        while let Some(segment) = self.segments.get(self.next).filter(|segment| segment[0].y - radius <= y) {
            self.active.push(*segment);
            self.next += 1;
        }
        self.active.retain(|segment| segment[1].y + radius >= y);
        let mut around: Vec<[f64; 2]> = self.active.iter().filter_map(|&segment| within(segment, radius, y)).collect();
        around.sort_by(|a, b| a[0].total_cmp(&b[0]));
        self.row.clear();
        let mut end = f64::NEG_INFINITY;
        for [from, to] in around {
            match self.row.last_mut() {
                // Spans that touch are one.
                Some(last) if self.within && from <= last[1] => last[1] = last[1].max(to),
                _ if self.within => self.row.push([from, to]),
                _ => {
                    if end < from {
                        self.row.push([end, from]);
                    }
                    end = end.max(to);
                }
            }
        }
        if !self.within {
            self.row.push([end, f64::INFINITY]);
        }
        &self.row
    }
}

/// The part of a row that lies within a distance of a segment, which points upwards.
fn within([a, b]: [DVec2; 2], radius: f64, y: f64) -> Option<[f64; 2]> {
    let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut add = |x: f64| {
        from = from.min(x);
        to = to.max(x);
    };
    for end in [a, b] {
        let square = radius * radius - (y - end.y) * (y - end.y);
        if square >= 0.0 {
            add(end.x - square.sqrt());
            add(end.x + square.sqrt());
        }
    }
    let side = (b - a).normalize_or_zero().perp() * radius;
    for side in [side, -side] {
        let t = (y - a.y - side.y) / (b.y - a.y);
        // A level segment gives no number, and its ends reach as far.
        if (0.0..=1.0).contains(&t) {
            add(a.x + side.x + t * (b.x - a.x));
        }
    }
    (from <= to).then_some([from, to])
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// Rows against the distance of each place from each segment.
    #[test]
    fn spans_are_the_places_near_segments() {
        let mut random = Pcg64Mcg::seed_from_u64(4);
        let mut counts = [0; 2];
        for round in 0..200 {
            let mut place = || DVec3::new(random.random_range(-9.0..9.0), random.random_range(-9.0..9.0), 0.3);
            let mut segments: Vec<[DVec3; 2]> = (0..=round % 7).map(|_| [place(), place()]).collect();
            // Level, upright, and a point.
            let ends = segments[0];
            segments.push([ends[0], ends[0] + DVec3::X * 3.0]);
            segments.push([ends[1], ends[1] - DVec3::Y * 2.0]);
            segments.push([ends[1], ends[1] + DVec3::Z]);
            let radius = 0.2 + 0.01 * f64::from(round);
            for within in [false, true] {
                let mut spans = Spans::around(&segments, 0.5, 2, radius, within);
                for y in -30..30 {
                    let row = spans.of_row(f64::from(y)).to_vec();
                    for x in (-60..60).map(|x| 0.5 * f64::from(x)) {
                        let place = DVec2::new(x + 0.5, f64::from(y) + 0.5) * 0.5;
                        let near = |segment: &[DVec3; 2]| distance(place, segment.map(|p| shadow(p, 2)));
                        let least = segments.iter().map(near).fold(f64::INFINITY, f64::min) / 0.5;
                        if (least - radius).abs() > 1e-9 {
                            let found = row.iter().any(|[from, to]| (*from..=*to).contains(&x));
                            assert_eq!(found, (least < radius) == within, "{x} {y} {least} {radius} {segments:?}");
                            counts[usize::from(found)] += 1;
                        }
                    }
                }
            }
        }
        assert!(counts.iter().all(|count| *count > 100_000), "{counts:?}");
    }
}

//! Points of a mesh that no ray finds: parts smaller than the spacing, tips of corners, thin strips.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::facets::{Facets, Shape};
use super::raster::Hit;

/// Part of the radius within which a tested point must have a surfel. The rest is for the points between tested ones.
const NEAR: f64 = 0.8;

/// A surfel that no ray made.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extra {
    /// What its colour and normal are those of.
    pub(super) hit: Hit,
    /// Relative to the origin of the facets.
    pub(super) position: DVec3,
    /// Cut-off radius.
    pub(super) radius: f64,
}

/// Surfels that are missing after `hits`, whose positions are `position`. Every vertex is then within 0.8 `radius`
/// of a surfel, and so is the middle line of every thin triangle; a connected part without any hit has a surfel at its
/// centre.
pub(super) fn extras(
    facets: &Facets<'_>,
    welded: &[u32],
    hits: &[Hit],
    position: &[Vec3],
    spacing: f64,
    radius: f64,
) -> Vec<Extra> {
    let mut hit = vec![false; facets.kept.len()];
    let mut at = 0;
    for run in hits.chunk_by(|a, b| a.triangle == b.triangle) {
        // Hits come in the order of the triangles.
        while facets.kept[at] != run[0].triangle {
            at += 1;
        }
        hit[at] = true;
    }
    let mut extras: Vec<Extra> = facets.missed(welded, &hit).iter().map(|part| middle(facets, part, radius)).collect();
    let cells = Cells::new(position, 2.0 * radius);
    let bare: Vec<(Hit, DVec3)> = facets
        .kept
        .par_iter()
        .flat_map_iter(|&i| {
            let shape = facets.shape(i);
            candidates(i, &shape, spacing).map(move |hit| (hit, hit.position(&shape.corner)))
        })
        .filter(|&(_, p)| !cells.any_within(p, NEAR * radius))
        .collect();
    // Few are left, and each covers its neighbours.
    let mut added = Sparse::new(2.0 * radius);
    for extra in &extras {
        if !added.any_within(extra.position, radius) {
            added.add(extra.position);
        }
    }
    for (hit, position) in bare {
        if !added.any_within(position, NEAR * radius) {
            added.add(position);
            extras.push(Extra { hit, position, radius });
        }
    }
    extras
}

/// The surfel of a part of a mesh: at its centre of area, as large as the part, like its largest triangle.
fn middle(facets: &Facets<'_>, part: &[u32], radius: f64) -> Extra {
    let shapes = || part.iter().map(|&i| (i, facets.shape(i)));
    let (mut sum, mut area) = (DVec3::ZERO, 0.0);
    let mut largest = (0.0, 0);
    for (i, shape) in shapes() {
        sum += shape.area() * shape.centre();
        area += shape.area();
        if shape.area() > largest.0 {
            largest = (shape.area(), i);
        }
    }
    let position = sum / area;
    let reach = shapes().flat_map(|(_, shape)| shape.corner).map(|p| p.distance(position)).fold(0.0, f64::max);
    let third = 1.0 / 3.0;
    Extra { hit: Hit::of(largest.1, [third, third]), position, radius: reach.min(radius) }
}

/// Points of a triangle that rays may miss: its corners, and steps along the middle of a thin one.
fn candidates(triangle: u32, shape: &Shape, spacing: f64) -> impl Iterator<Item = Hit> + use<> {
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let thin = shape.height() < 2.0 * spacing && shape.longest > spacing;
    let steps = if thin { (2.0 * shape.longest / spacing).ceil() as u64 } else { 0 };
    // From the tip opposite the shortest edge to the middle of that edge.
    let [a, b, c] = shape.corner;
    let edges = [b.distance(c), c.distance(a), a.distance(b)];
    let tip = (0..3).min_by(|&i, &j| edges[i].total_cmp(&edges[j])).unwrap_or(0);
    let [from, left, right] = [0, 1, 2].map(|k| corners[(tip + k) % 3]);
    let along = (0..steps).map(move |step| {
        let t = (step as f64 + 0.5) / steps as f64;
        [0, 1].map(|k| from[k] + t * (0.5 * (left[k] + right[k]) - from[k]))
    });
    corners.into_iter().chain(along).map(move |weight| Hit::of(triangle, weight))
}

/// Points sorted by cells of a grid, one for each of 4 x 4 x 4 parts of a cell: a pile of points costs no more than a
/// sheet of them.
struct Cells {
    width: f64,
    sorted: Vec<([i32; 3], Vec3)>,
}

fn cell(p: DVec3, width: f64) -> [i32; 3] {
    (p / width).floor().to_array().map(|x| x as i32)
}

/// The cells that are less than half a cell away from `p`, the one around it first.
fn near(p: DVec3, width: f64) -> impl Iterator<Item = [i32; 3]> {
    let home = cell(p, width);
    let side = (p / width).fract_gl().to_array().map(|x| if x < 0.5 { -1 } else { 1 });
    (0..8).map(move |bits| [0, 1, 2].map(|k| home[k].saturating_add(if bits >> k & 1 == 1 { side[k] } else { 0 })))
}

impl Cells {
    fn new(position: &[Vec3], width: f64) -> Self {
        let part = |p: &Vec3| cell(p.as_dvec3(), 0.25 * width);
        let mut order: Vec<([i32; 3], u32)> = position.par_iter().map(part).zip(0..position.len() as u32).collect();
        order.par_sort_unstable();
        order.dedup_by_key(|(part, _)| *part);
        // A right shift rounds down, as the parts do.
        let mut sorted: Vec<_> =
            order.into_iter().map(|(part, i)| (part.map(|x| x >> 2), position[i as usize])).collect();
        sorted.par_sort_by_key(|(cell, _)| *cell);
        Self { width, sorted }
    }

    /// True if a point is at most `radius` away, which is at most half the width of a cell.
    fn any_within(&self, p: DVec3, radius: f64) -> bool {
        near(p, self.width).any(|cell| {
            let start = self.sorted.partition_point(|(other, _)| *other < cell);
            let run = self.sorted[start..].iter().take_while(|(other, _)| *other == cell);
            run.into_iter().any(|(_, q)| q.as_dvec3().distance_squared(p) <= radius * radius)
        })
    }
}

/// Points that are added one by one.
struct Sparse {
    width: f64,
    points: std::collections::HashMap<[i32; 3], Vec<DVec3>>,
}

impl Sparse {
    fn new(width: f64) -> Self {
        Self { width, points: std::collections::HashMap::new() }
    }

    fn add(&mut self, p: DVec3) {
        self.points.entry(cell(p, self.width)).or_default().push(p);
    }

    fn any_within(&self, p: DVec3, radius: f64) -> bool {
        near(p, self.width)
            .filter_map(|cell| self.points.get(&cell))
            .flatten()
            .any(|q| q.distance_squared(p) <= radius * radius)
    }
}

//! The hits of a layered depth cube: three families of parallel rays, and every triangle that each ray meets (Pfister
//! et al. 2000, sections 5.1 and 6.2).
//!
//! The rays of a family stand on a grid. So a triangle's hits are the grid points within its projection, row by row,
//! and no tree of boxes is needed. The ends of a row are where it crosses two edges. Two triangles compute the crossing
//! with a shared edge from the same numbers in the same order, so no point falls between them, whatever is rounded.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::facets::{Facets, Shape};

/// A point of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    pub(super) triangle: u32,
    /// Weights of its second and third corner, >= 0, in sum at most 1.
    pub(super) weight: [f32; 2],
}

impl Hit {
    pub(super) fn of(triangle: u32, [b, c]: [f64; 2]) -> Self {
        let (b, c) = (b.clamp(0.0, 1.0), c.clamp(0.0, 1.0));
        let sum = (b + c).max(1.0);
        Self { triangle, weight: [(b / sum) as f32, (c / sum) as f32] }
    }

    /// The mean of three values at the corners.
    pub(super) fn position(&self, corner: &[DVec3; 3]) -> DVec3 {
        let [b, c] = self.weight.map(f64::from);
        corner[0] + b * (corner[1] - corner[0]) + c * (corner[2] - corner[0])
    }
}

/// A hit on an edge, which the triangle beyond it may have found too.
#[derive(Clone, Copy)]
struct OnEdge {
    /// The axis and the grid point of the ray, and the side that it sees.
    ray: (usize, i64, i64, bool),
    depth: f64,
    hit: usize,
}

/// Triangles of one task. Nothing depends on it.
const CHUNK: usize = 256;

/// All hits of rays with `spacing`, in the order of the triangles. Grid lines are half a spacing away from the middle
/// of the box, so that none lies in a plane of symmetry.
///
/// `reduce`: each triangle is hit only along the axis that it faces most. Two hits of one axis are at least a spacing
/// apart, unless one ray made both.
pub(super) fn hits(facets: &Facets<'_>, spacing: f64, reduce: bool) -> Vec<Hit> {
    let chunks: Vec<(Vec<Hit>, Vec<OnEdge>)> = facets
        .kept
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut out = (Vec::new(), Vec::new());
            for &triangle in chunk {
                let shape = facets.shape(triangle);
                for axis in shape.axes(reduce) {
                    scan(triangle, &shape, axis, spacing, &mut out);
                }
            }
            out
        })
        .collect();
    let mut hits = Vec::with_capacity(chunks.iter().map(|(hits, _)| hits.len()).sum());
    let mut on_edges = Vec::new();
    for (of_chunk, edges) in chunks {
        on_edges.extend(edges.into_iter().map(|edge| OnEdge { hit: edge.hit + hits.len(), ..edge }));
        hits.extend(of_chunk);
    }
    drop_twins(&mut hits, on_edges, spacing);
    hits
}

/// Drops all but the first of several hits of one ray at one place: it met an edge, and both triangles at it.
fn drop_twins(hits: &mut Vec<Hit>, mut on_edges: Vec<OnEdge>, spacing: f64) {
    on_edges.par_sort_unstable_by(|a, b| a.ray.cmp(&b.ray).then(a.depth.total_cmp(&b.depth)).then(a.hit.cmp(&b.hit)));
    let same = |a: &OnEdge, b: &OnEdge| a.ray == b.ray && (b.depth - a.depth).abs() <= 1e-6 * spacing;
    let mut drop: Vec<usize> = on_edges
        .chunk_by(same)
        .flat_map(|run| {
            let first = run.iter().map(|edge| edge.hit).min();
            run.iter().map(|edge| edge.hit).filter(move |hit| Some(*hit) != first)
        })
        .collect();
    if drop.is_empty() {
        return;
    }
    drop.sort_unstable();
    let mut drop = drop.into_iter().peekable();
    let mut index = 0;
    hits.retain(|_| {
        index += 1;
        drop.next_if_eq(&(index - 1)).is_none()
    });
}

/// Adds the hits of one triangle along one axis.
fn scan(triangle: u32, shape: &Shape, axis: usize, spacing: f64, (hits, on_edges): &mut (Vec<Hit>, Vec<OnEdge>)) {
    let (right, up) = ((axis + 1) % 3, (axis + 2) % 3);
    // Rays are at whole numbers.
    let p = shape.corner.map(|corner| DVec2::new(corner[right], corner[up]) / spacing - 0.5);
    let (e, f) = (p[1] - p[0], p[2] - p[0]);
    let area = e.perp_dot(f);
    if area == 0.0 {
        return;
    }
    let low = p[0].y.min(p[1].y).min(p[2].y).ceil();
    let high = p[0].y.max(p[1].y).max(p[2].y).floor();
    let mut y = low;
    while y <= high {
        let (mut from, mut to, mut along) = (f64::INFINITY, f64::NEG_INFINITY, false);
        for (a, b) in [(p[0], p[1]), (p[1], p[2]), (p[2], p[0])] {
            if let Some([first, last]) = crossing(a, b, y) {
                along |= a.y == b.y;
                from = from.min(first);
                to = to.max(last);
            }
        }
        let mut x = from.ceil();
        while x <= to {
            let q = DVec2::new(x, y) - p[0];
            let weight = [q.perp_dot(f) / area, e.perp_dot(q) / area];
            if along || x == from || x == to {
                let hit = Hit::of(triangle, weight);
                let depth = hit.position(&shape.corner)[axis];
                let ray = (axis, y as i64, x as i64, shape.across[axis] > 0.0);
                on_edges.push(OnEdge { ray, depth, hit: hits.len() });
            }
            hits.push(Hit::of(triangle, weight));
            x += 1.0;
        }
        y += 1.0;
    }
}

/// Where the row `y` meets the edge from `a` to `b`: from the least x to the greatest.
fn crossing(a: DVec2, b: DVec2, y: f64) -> Option<[f64; 2]> {
    let (low, high) = if (a.y, a.x) <= (b.y, b.x) { (a, b) } else { (b, a) };
    if y < low.y || y > high.y {
        return None;
    }
    if low.y == high.y {
        return Some([low.x, high.x]);
    }
    let x = if y == high.y { high.x } else { low.x + (y - low.y) / (high.y - low.y) * (high.x - low.x) };
    let x = x.clamp(low.x.min(high.x), low.x.max(high.x));
    Some([x, x])
}

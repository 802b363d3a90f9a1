//! The hits of a layered depth cube: three families of parallel rays, and every triangle that each ray meets (Pfister
//! et al. 2000, sections 5.1 and 6.2).
//!
//! The rays of a family stand on a grid. So a triangle's hits are the grid points within its projection, row by row,
//! and no tree of boxes is needed. The ends of a row are where it crosses two edges. Two triangles compute the crossing
//! with a shared edge from the same numbers in the same order, so no point falls between them, whatever is rounded.

use glam::DVec2;
use rayon::prelude::*;

use super::band::{Band, Bands, Spans};
use super::facets::{Facets, Hit, TriangleShape, shadow};

/// A hit on an edge, which the triangle beyond it may have found too.
#[derive(Clone, Copy)]
struct OnEdge {
    /// The axis, the grid and the grid point of the ray, and the side that it sees.
    ray: (usize, u8, bool, i64, i64, bool),
    depth: f64,
    hit: usize,
}

/// Triangles of one task. Nothing depends on it.
const CHUNK: usize = 256;

/// Difference of two depths that are the same, fine spacings.
pub(super) const SAME_DEPTH: f64 = 1e-6;

/// Bits of a place of a ray on its grid. A grid has fewer than 2^25 places on each side of its middle.
const PLACE_BITS: u32 = 27;
/// Bits of a level.
const LEVEL_BITS: u32 = 7;

/// What hits are found.
#[derive(Default)]
struct Found {
    hits: Vec<Hit>,
    /// The ray of each hit.
    rays: Vec<u64>,
    on_edges: Vec<OnEdge>,
}

/// A ray as a number: its axis, its grid, and its place there.
fn ray_of(Grid { axis, level, fine, .. }: Grid, y: i64, x: i64) -> u64 {
    let place = |x: i64| x as u64 & ((1 << PLACE_BITS) - 1);
    let grid = ((axis as u64) << LEVEL_BITS | u64::from(level)) << 1 | u64::from(fine);
    grid << (2 * PLACE_BITS) | place(y) << PLACE_BITS | place(x)
}

/// The axis of a ray.
pub(super) fn axis_of(ray: u64) -> usize {
    (ray >> (2 * PLACE_BITS + 1 + LEVEL_BITS)) as usize
}

/// All hits of rays, in the order of the triangles, and the ray of each as a number. Grid lines are half a spacing away
/// from the middle of the box, so that none lies in a plane of symmetry.
///
/// `reduce`: each triangle is hit only along the axis that it faces most. Two hits of one axis and grid are at least a
/// spacing apart, unless one ray made both.
pub(super) fn hits(facets: &Facets<'_>, bands: &Bands, reduce: bool) -> (Vec<Hit>, Vec<u64>) {
    let chunks: Vec<Found> = facets
        .kept
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut out = Found::default();
            for &triangle in chunk {
                let (shape, level) = (facets.shape(triangle), facets.level(triangle));
                let band = bands.of(level);
                let near = band.near(&shape);
                for axis in shape.axes(reduce) {
                    let grids: &[bool] = if near.is_empty() { &[false] } else { &[false, true] };
                    for &fine in grids {
                        let spans = (!near.is_empty()).then(|| Spans::new(&near, fine, band, axis));
                        let grid = Grid { axis, level, fine, spacing: band.spacing(fine) };
                        scan(triangle, &shape, grid, spans, &mut out);
                    }
                }
            }
            out
        })
        .collect();
    let count = chunks.iter().map(|found| found.hits.len()).sum();
    let mut all = Found { hits: Vec::with_capacity(count), rays: Vec::with_capacity(count), on_edges: Vec::new() };
    for Found { hits, rays, on_edges } in chunks {
        let before = all.hits.len();
        all.on_edges.extend(on_edges.into_iter().map(|edge| OnEdge { hit: edge.hit + before, ..edge }));
        all.hits.extend(hits);
        all.rays.extend(rays);
    }
    let Found { mut hits, mut rays, on_edges } = all;
    let twins = twins(on_edges, bands.of(0).spacing(true));
    drop_at(&twins, &mut hits);
    drop_at(&twins, &mut rays);
    (hits, rays)
}

/// All but the first of several hits of one ray at one place: it met an edge, and both triangles at it. Rising.
fn twins(mut on_edges: Vec<OnEdge>, spacing: f64) -> Vec<usize> {
    on_edges.par_sort_unstable_by(|a, b| a.ray.cmp(&b.ray).then(a.depth.total_cmp(&b.depth)).then(a.hit.cmp(&b.hit)));
    let same = |a: &OnEdge, b: &OnEdge| a.ray == b.ray && (b.depth - a.depth).abs() <= SAME_DEPTH * spacing;
    let mut twins: Vec<usize> = on_edges
        .chunk_by(same)
        .flat_map(|run| {
            let first = run.iter().map(|edge| edge.hit).min();
            run.iter().map(|edge| edge.hit).filter(move |hit| Some(*hit) != first)
        })
        .collect();
    twins.sort_unstable();
    twins
}

/// Drops the items at some indices, which rise.
pub(super) fn drop_at<T>(indices: &[usize], items: &mut Vec<T>) {
    if indices.is_empty() {
        return;
    }
    let (mut indices, mut index) = (indices.iter().peekable(), 0);
    items.retain(|_| {
        index += 1;
        indices.next_if_eq(&&(index - 1)).is_none()
    });
}

/// A family of rays.
#[derive(Clone, Copy)]
struct Grid {
    axis: usize,
    level: u8,
    fine: bool,
    spacing: f64,
}

impl Grid {
    /// The corners of a triangle as the rays see them, which are at whole numbers.
    fn places(self, shape: &TriangleShape) -> [DVec2; 3] {
        shape.corner.map(|corner| shadow(corner, self.axis) / self.spacing - 0.5)
    }
}

/// How many hits of the coarse rays of a level are within `reach` of sharp edges, coarse spacings.
pub(super) fn count(facets: &Facets<'_>, level: u8, band: &Band, reach: f64, reduce: bool) -> u64 {
    let of_triangle = |&triangle: &u32| {
        if facets.level(triangle) != level {
            return 0;
        }
        let shape = facets.shape(triangle);
        let near = band.near(&shape);
        if near.is_empty() {
            return 0;
        }
        let (mut count, spacing) = (0, band.spacing(false));
        for axis in shape.axes(reduce) {
            let spans = Spans::around(&near, spacing, axis, reach, true);
            rows(&shape, Grid { axis, level, fine: false, spacing }, Some(spans), |row| {
                count += row.hits().count() as u64;
            });
        }
        count
    };
    facets.kept.par_iter().map(of_triangle).sum()
}

/// Adds the hits of one triangle: those within the spans, if there are any.
fn scan(triangle: u32, shape: &TriangleShape, grid: Grid, spans: Option<Spans>, out: &mut Found) {
    let Grid { axis, level, fine, .. } = grid;
    let p = grid.places(shape);
    let (e, f) = (p[1] - p[0], p[2] - p[0]);
    let area = e.perp_dot(f);
    rows(shape, grid, spans, |row| {
        for x in row.hits() {
            let q = DVec2::new(x, row.y) - p[0];
            let hit = Hit::of(triangle, fine, [q.perp_dot(f) / area, e.perp_dot(q) / area]);
            if row.along || x == row.from || x == row.to {
                let depth = hit.position(&shape.corner)[axis];
                let ray = (axis, level, fine, row.y as i64, x as i64, shape.across[axis] > 0.0);
                out.on_edges.push(OnEdge { ray, depth, hit: out.hits.len() });
            }
            out.rays.push(ray_of(grid, row.y as i64, x as i64));
            out.hits.push(hit);
        }
    });
}

/// A part of a row of rays.
struct Row {
    y: f64,
    /// Where the row meets the edges of the triangle.
    from: f64,
    to: f64,
    /// An edge lies in the row.
    along: bool,
    /// The part of the row that is wanted.
    span: [f64; 2],
}

impl Row {
    /// The rays that meet the triangle.
    fn hits(&self) -> impl Iterator<Item = f64> + use<> {
        let end = self.span[1].min(self.to);
        std::iter::successors(Some(self.span[0].max(self.from).ceil()), |x| Some(x + 1.0))
            .take_while(move |x| *x <= end)
    }
}

/// Visits the rows of a triangle within the spans.
fn rows(shape: &TriangleShape, grid: Grid, mut spans: Option<Spans>, mut visit: impl FnMut(&Row)) {
    let p = grid.places(shape);
    if (p[1] - p[0]).perp_dot(p[2] - p[0]) == 0.0 {
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
        let whole = [[from, to]];
        for &span in spans.as_mut().map_or(whole.as_slice(), |spans| spans.of_row(y)) {
            visit(&Row { y, from, to, along, span });
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

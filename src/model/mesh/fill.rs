//! Points of a mesh that no ray finds: parts smaller than the spacing, tips of corners, thin strips.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::band::{Band, Bands};
use super::edges::Edges;
use super::facets::{Facets, Hit, TriangleShape};

/// Part of a disc within which a tested point must lie. The rest is for the points between tested ones.
const NEAR: f64 = 0.8;

/// Greatest distance of a tested point from the plane of the disc that covers it, spacings.
const DEPTH: f64 = 0.5;

/// Cosine of the greatest angle between a disc and a large triangle that it covers: no face covers the one beyond an
/// edge.
const AGREE: f32 = 0.8;

/// A surfel that no ray made.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extra {
    /// What its colour and normal are those of.
    pub(super) hit: Hit,
    /// Relative to the origin of the facets.
    pub(super) position: DVec3,
    /// Cut-off radius of its shadow.
    pub(super) radius: f64,
}

/// A disc, whose shadow along the axis that it faces most is a circle of one spacing of its grid.
#[derive(Clone, Copy)]
struct Disc {
    at: DVec3,
    spacing: f64,
    face: Vec3,
    axis: usize,
}

impl Disc {
    fn new(at: DVec3, shape: &TriangleShape, spacing: f64) -> Self {
        Self { at, spacing, face: shape.across.normalize().as_vec3(), axis: shape.axis() }
    }

    /// True if it covers the place of `other`. `faces`: only if both face nearly the same way.
    fn covers(&self, other: &Self, faces: bool) -> bool {
        let away = other.at - self.at;
        let shadow = away.length_squared() - away[self.axis] * away[self.axis];
        shadow <= (NEAR * self.spacing).powi(2)
            && away.dot(self.face.as_dvec3()).abs() <= DEPTH * self.spacing
            && (!faces || self.face.dot(other.face) >= AGREE)
    }
}

/// Surfels that are missing after `hits`, whose positions are `position`. Every vertex is then covered, and so are the
/// edges of every triangle and its middle where it is thin; a connected part without any hit has a surfel at its
/// centre.
pub(super) fn extras(facets: &Facets<'_>, edges: &Edges, bands: &Bands, hits: &[Hit], position: &[Vec3]) -> Vec<Extra> {
    let mut hit = vec![false; facets.kept.len()];
    let mut at = 0;
    for run in hits.chunk_by(|a, b| a.triangle == b.triangle) {
        // Hits come in the order of the triangles.
        while facets.kept[at] != run[0].triangle {
            at += 1;
        }
        hit[at] = true;
    }
    let spacing = |triangle: u32| bands.of(facets.level(triangle)).spacing(false);
    let mut extras: Vec<Extra> = facets.missed(&hit).iter().map(|part| middle(facets, part, spacing)).collect();
    let of_level = |(level, band): (u8, &Band)| {
        [false, true].map(|fine| Cells::new(&discs(facets, level, fine, band, hits, position), band.spacing(fine)))
    };
    let cells: Vec<[Cells; 2]> = (0..).zip(bands.levels()).map(of_level).collect();
    let bare: Vec<(Hit, Disc, bool)> = facets
        .kept
        .par_iter()
        .flat_map_iter(|&i| {
            let (shape, level) = (facets.shape(i), facets.level(i));
            let band = bands.of(level);
            let near = band.near(&shape);
            let step = band.spacing(!near.is_empty());
            // Triangles smaller than the spacing may be crumpled: then any disc will do.
            let faces = shape.height() > band.spacing(false);
            candidates(i, &shape, step).map(move |hit| {
                let at = hit.position(&shape.corner);
                let fine = band.is_fine(&near, at, shape.axis());
                (Hit { fine, ..hit }, Disc::new(at, &shape, band.spacing(fine)), faces)
            })
        })
        .filter(|(hit, disc, faces)| {
            // Most are covered by discs of their own level.
            let level = facets.level(hit.triangle);
            let own = cells[usize::from(level)].iter().rev();
            !own.chain(beside(&cells, level).iter().flatten()).any(|cells| cells.any_covers(disc, *faces))
        })
        .collect();
    // Few are left, and each covers its neighbours.
    let mut added: Vec<Sparse> =
        bands.levels().map(|band| Sparse { spacing: band.spacing(false), discs: HashMap::new() }).collect();
    for extra in &extras {
        let triangle = extra.hit.triangle;
        let disc = Disc::new(extra.position, &facets.shape(triangle), spacing(triangle));
        added[usize::from(facets.level(triangle))].add(disc);
    }
    for (hit, disc, faces) in bare {
        let level = facets.level(hit.triangle);
        if !beside(&added, level).iter().any(|added| added.any_covers(&disc, faces)) {
            let shape = facets.shape(hit.triangle);
            let inside = edges.moved(hit, &shape, disc.spacing);
            let moved = Disc { at: inside.position(&shape.corner), ..disc };
            // Away from the tip of a corner it would not cover it.
            let (hit, disc) = if moved.covers(&disc, false) { (inside, moved) } else { (hit, disc) };
            added[usize::from(level)].add(disc);
            extras.push(Extra { hit, position: disc.at, radius: disc.spacing });
        }
    }
    extras
}

/// What belongs to a level and those beside it.
fn beside<T>(all: &[T], level: u8) -> &[T] {
    let level = usize::from(level);
    &all[level.saturating_sub(1)..(level + 2).min(all.len())]
}

/// The discs of the hits of a level's grid at their positions.
fn discs(facets: &Facets<'_>, level: u8, fine: bool, band: &Band, hits: &[Hit], position: &[Vec3]) -> Vec<Disc> {
    let mut start = 0;
    let mut runs: Vec<(&[Hit], &[Vec3])> = Vec::new();
    for run in hits.chunk_by(|a, b| a.triangle == b.triangle) {
        let end = start + run.len();
        if facets.level(run[0].triangle) == level {
            runs.push((run, &position[start..end]));
        }
        start = end;
    }
    let of_run = |(run, position): &(&[Hit], &[Vec3])| {
        let disc = Disc::new(DVec3::ZERO, &facets.shape(run[0].triangle), band.spacing(fine));
        let own = run.iter().zip(*position).filter(|(hit, _)| hit.fine == fine);
        own.map(|(_, at)| Disc { at: at.as_dvec3(), ..disc }).collect::<Vec<_>>()
    };
    runs.par_iter().flat_map_iter(of_run).collect()
}

/// The surfel of a part of a mesh: at its centre of area, as large as the part, like its largest triangle.
fn middle(facets: &Facets<'_>, part: &[u32], spacing: impl Fn(u32) -> f64) -> Extra {
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
    Extra { hit: Hit::of(largest.1, false, [third, third]), position, radius: reach.min(spacing(largest.1)) }
}

/// Points of a triangle that rays may miss: its corners, steps along its edges, and steps along the middle where it is
/// thin.
fn candidates(triangle: u32, shape: &TriangleShape, spacing: f64) -> impl Iterator<Item = Hit> + use<> {
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let lengths = [0, 1, 2].map(|k| shape.corner[k].distance(shape.corner[(k + 1) % 3]));
    let on_edges = (0..3).flat_map(move |k| {
        let (from, to) = (corners[k], corners[(k + 1) % 3]);
        let steps = (2.0 * lengths[k] / spacing).ceil() as u64;
        (1..steps).map(move |step| {
            let t = step as f64 / steps as f64;
            [0, 1].map(|i| from[i] + t * (to[i] - from[i]))
        })
    });
    // From the tip opposite the shortest edge towards the middle of that edge.
    let [a, b, c] = shape.corner;
    let edges = [b.distance(c), c.distance(a), a.distance(b)];
    let tip = (0..3).min_by(|&i, &j| edges[i].total_cmp(&edges[j])).unwrap_or(0);
    let thin = if shape.longest > spacing { (2.0 * spacing / edges[tip]).min(1.0) } else { 0.0 };
    let steps = (2.0 * shape.longest * thin / spacing).ceil() as u64;
    let [from, left, right] = [0, 1, 2].map(|k| corners[(tip + k) % 3]);
    let along = (0..steps).map(move |step| {
        let t = thin * (step as f64 + 0.5) / steps as f64;
        [0, 1].map(|k| from[k] + t * (0.5 * (left[k] + right[k]) - from[k]))
    });
    corners.into_iter().chain(on_edges).chain(along).map(move |weight| Hit::of(triangle, false, weight))
}

/// Width of a cell, spacings. Half of it is more than a disc reaches, sqrt(3) spacings.
const CELL: f64 = 3.5;

/// Discs sorted by cells of a grid, one for each of 16 x 16 x 16 parts of a cell: a pile of discs costs no more than a
/// sheet of them.
struct Cells {
    spacing: f64,
    sorted: Vec<([i32; 3], Disc)>,
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
    fn new(discs: &[Disc], spacing: f64) -> Self {
        let part = |disc: &Disc| cell(disc.at, CELL * spacing / 16.0);
        let mut order: Vec<([i32; 3], u32)> = discs.par_iter().map(part).zip(0..discs.len() as u32).collect();
        order.par_sort_unstable();
        order.dedup_by_key(|(part, _)| *part);
        // A right shift rounds down, as the parts do.
        let mut sorted: Vec<_> = order.into_iter().map(|(part, i)| (part.map(|x| x >> 4), discs[i as usize])).collect();
        sorted.par_sort_by_key(|(cell, _)| *cell);
        Self { spacing, sorted }
    }

    fn any_covers(&self, disc: &Disc, faces: bool) -> bool {
        near(disc.at, CELL * self.spacing).any(|cell| {
            let start = self.sorted.partition_point(|(other, _)| *other < cell);
            let run = self.sorted[start..].iter().take_while(|(other, _)| *other == cell);
            run.into_iter().any(|(_, other)| other.covers(disc, faces))
        })
    }
}

/// Discs that are added one by one.
struct Sparse {
    spacing: f64,
    discs: HashMap<[i32; 3], Vec<Disc>>,
}

impl Sparse {
    fn add(&mut self, disc: Disc) {
        self.discs.entry(cell(disc.at, CELL * self.spacing)).or_default().push(disc);
    }

    fn any_covers(&self, disc: &Disc, faces: bool) -> bool {
        near(disc.at, CELL * self.spacing)
            .filter_map(|cell| self.discs.get(&cell))
            .flatten()
            .any(|other| other.covers(disc, faces))
    }
}

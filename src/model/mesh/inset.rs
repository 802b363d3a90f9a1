//! Surfels at sharp edges: a disc that stands on an edge reaches beyond it, and makes an outline wider.

use rayon::prelude::*;

use super::facets::{Facets, Shape};
use super::raster::Hit;

/// Distance from a sharp edge that a surfel keeps, spacings, as its shadow shows it. The disc still covers the edge, .8
/// spacings along it.
const INSET: f64 = 0.6;

/// Cosine of the least angle between two triangles that meet at a sharp edge: 30 degrees.
const SHARP: f64 = 0.866;

/// Which edges of the triangles of a mesh are sharp: those of one triangle alone, or of more than two, too.
pub(super) struct Inset {
    /// Bit k of a triangle: its edge from corner k to the next.
    sharp: Vec<u8>,
}

impl Inset {
    /// `welded` is [`Facets::welded`].
    pub(super) fn new(facets: &Facets<'_>, welded: &[u32]) -> Self {
        let mut edges: Vec<([u32; 2], u32, u8)> = facets
            .kept
            .par_iter()
            .flat_map_iter(|&i| {
                let corners = facets.mesh.triangles[i as usize].corners.map(|v| welded[v as usize]);
                [0, 1, 2].map(|k| {
                    let (a, b) = (corners[k], corners[(k + 1) % 3]);
                    ([a.min(b), a.max(b)], i, 1 << k)
                })
            })
            .collect();
        edges.par_sort_unstable();
        let mut sharp = vec![0; facets.mesh.triangles.len()];
        let normal = |i: u32| facets.shape(i).across.normalize();
        for run in edges.chunk_by(|a, b| a.0 == b.0) {
            let smooth = matches!(run, [a, b] if normal(a.1).dot(normal(b.1)) >= SHARP);
            if !smooth {
                for &(_, i, bit) in run {
                    sharp[i as usize] |= bit;
                }
            }
        }
        Self { sharp }
    }

    /// The hit, moved away from the sharp edges of its triangle. A small triangle keeps it near its middle.
    pub(super) fn moved(&self, hit: Hit, shape: &Shape, spacing: f64) -> Hit {
        let sharp = self.sharp[hit.triangle as usize];
        if sharp == 0 {
            return hit;
        }
        let axis = shape.axis();
        let [b, c] = hit.weight.map(f64::from);
        let mut weight = [1.0 - b - c, b, c];
        for k in (0..3).filter(|k| sharp >> k & 1 == 1) {
            let mut edge = shape.corner[(k + 1) % 3] - shape.corner[k];
            edge[axis] = 0.0;
            // The weight of the corner beyond is the distance from the edge, in heights.
            let tip = (k + 2) % 3;
            let least = (INSET * spacing * edge.length() / shape.across[axis].abs()).min(1.0 / 3.0);
            if weight[tip] < least {
                let scale = (1.0 - least) / (1.0 - weight[tip]);
                weight = weight.map(|w| w * scale);
                weight[tip] = least;
            }
        }
        Hit::of(hit.triangle, [weight[1], weight[2]])
    }
}

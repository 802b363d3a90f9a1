//! The sharp edges of a mesh. A disc that reaches beyond one makes an outline wider.

use glam::DVec3;
use rayon::prelude::*;

use super::facets::{Facets, Hit, TriangleShape, shadow};
use super::{Mesh, Triangle};

/// Distance from a sharp edge that a surfel keeps, spacings, as its shadow shows it. The disc still covers the edge, .8
/// spacings along it.
pub(super) const INSET: f64 = 0.6;

/// Cosine of the least angle between two triangles that meet at a sharp edge: 30 degrees.
const SHARP: f64 = 0.866;

/// Which edges of the triangles of a mesh are sharp: those of one triangle alone, or of more than two, too.
pub(super) struct Edges {
    /// Bit k of a triangle: its edge from corner k to the next.
    sharp: Vec<u8>,
    /// Each of them once, relative to [`Facets::origin`].
    pub(super) segments: Vec<[DVec3; 2]>,
    /// The least level of the triangles at each segment.
    pub(super) levels: Vec<u8>,
}

impl Edges {
    pub(super) fn new(facets: &Facets<'_>) -> Self {
        let welded = facets.welded.as_slice();
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
        let (mut segments, mut levels) = (Vec::new(), Vec::new());
        let normal = |i: u32| facets.shape(i).across.normalize();
        for run in edges.chunk_by(|a, b| a.0 == b.0) {
            let smooth = matches!(run, [a, b] if normal(a.1).dot(normal(b.1)) >= SHARP);
            let seam = matches!(run, [a, b] if is_seam(facets.mesh, welded, [a.1, b.1], a.0));
            if !smooth || seam {
                segments.push(run[0].0.map(|v| facets.mesh.position[v as usize] - facets.origin));
                levels.push(run.iter().map(|&(_, i, _)| facets.level(i)).min().unwrap_or(0));
                for &(_, i, bit) in run {
                    sharp[i as usize] |= bit;
                }
            }
        }
        Self { sharp, segments, levels }
    }

    /// Edges of a triangle that are sharp: the corners from which they start.
    pub(super) fn of(&self, triangle: u32) -> impl Iterator<Item = usize> + use<> {
        let sharp = self.sharp[triangle as usize];
        (0..3).filter(move |k| sharp >> k & 1 == 1)
    }

    /// The hit, moved straight away from the sharp edges of its triangle. Between two of them it comes to the middle.
    pub(super) fn moved(&self, hit: Hit, shape: &TriangleShape, spacing: f64) -> Hit {
        let sharp = self.sharp[hit.triangle as usize];
        if sharp == 0 {
            return hit;
        }
        let corner = shape.corner.map(|p| shadow(p, shape.axis()));
        let twice_area = (corner[1] - corner[0]).perp_dot(corner[2] - corner[0]);
        // How the weight of each corner changes along the axes of the shadow.
        let gradient = [0, 1, 2].map(|i| (corner[(i + 2) % 3] - corner[(i + 1) % 3]).perp() / twice_area);
        let [b, c] = hit.weight.map(f64::from);
        let mut weight = [1.0 - b - c, b, c];
        for k in self.of(hit.triangle) {
            let tip = (k + 2) % 3;
            let height = gradient[tip].length().recip();
            let distance = weight[tip] * height;
            if distance >= INSET * spacing {
                continue;
            }
            let rate = gradient.map(|other| other.dot(gradient[tip]) * height);
            // Where the way ends, and how much of its length is free.
            let (mut room, mut free) = (f64::INFINITY, 1.0);
            for i in [k, (k + 1) % 3] {
                let to_edge = weight[i] / -rate[i];
                if rate[i] < 0.0 && to_edge < room {
                    room = to_edge;
                    free = if sharp >> ((i + 1) % 3) & 1 == 1 { 0.5 } else { 0.99 };
                }
            }
            let step = (INSET * spacing).min(free * (distance + room)) - distance;
            if step > 0.0 {
                weight = [0, 1, 2].map(|i| weight[i] + step * rate[i]);
            }
        }
        Hit::of(hit.triangle, hit.fine, [weight[1], weight[2]])
    }
}

/// True if two triangles look different along their common edge, which is given by welded vertices: of other materials,
/// or at other places of a texture.
fn is_seam(mesh: &Mesh, welded: &[u32], triangles: [u32; 2], edge: [u32; 2]) -> bool {
    let [a, b] = triangles.map(|i| mesh.triangles[i as usize]);
    let uv = |triangle: &Triangle, vertex: u32| {
        let corner = triangle.corners.into_iter().find(|v| welded[*v as usize] == vertex);
        corner.and_then(|v| mesh.uv.get(v as usize))
    };
    a.material != b.material || edge.into_iter().any(|vertex| uv(&a, vertex) != uv(&b, vertex))
}

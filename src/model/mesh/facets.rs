//! The triangles of a mesh that have an area, and how they hang together.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::Mesh;
use crate::math::Bounds;
use crate::model::tidy::MAX_COORDINATE;

/// Least height of a triangle, in its longest edges: below it the direction of the normal is rounding.
const FLAT: f64 = 1e-12;

/// The usable triangles of a mesh.
pub(super) struct Facets<'a> {
    pub(super) mesh: &'a Mesh,
    /// Middle of the box of the usable triangles, model space. Their corners are relative to it.
    pub(super) origin: DVec3,
    /// Edge lengths of that box.
    pub(super) size: DVec3,
    /// Indices of the usable triangles, rising; only the first of equal ones.
    pub(super) kept: Vec<u32>,
    /// Indices of the usable triangles that are equal to an earlier one, rising.
    pub(super) repeated: Vec<u32>,
    /// For each vertex the first one at the same place: seams of textures and normals do not part a surface.
    pub(super) welded: Vec<u32>,
    /// The level of each triangle of the mesh ([`super::fineness`]). Empty where all have level 0.
    level: Vec<u8>,
    levels: usize,
}

/// A point as rays along an axis see it.
pub(super) fn shadow(p: DVec3, axis: usize) -> DVec2 {
    DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3])
}

/// A triangle, relative to [`Facets::origin`].
#[derive(Clone, Copy, Debug)]
pub(super) struct TriangleShape {
    pub(super) corner: [DVec3; 3],
    /// Along the normal by the winding; its length is twice the area.
    pub(super) across: DVec3,
    /// Length of the longest edge.
    pub(super) longest: f64,
}

impl TriangleShape {
    fn new(corner: [DVec3; 3]) -> Self {
        let [a, b, c] = corner;
        let longest = [b - a, c - b, a - c].map(DVec3::length).into_iter().fold(0.0, f64::max);
        Self { corner, across: (b - a).cross(c - a), longest }
    }

    pub(super) fn area(&self) -> f64 {
        0.5 * self.across.length()
    }

    /// Height over the longest edge.
    pub(super) fn height(&self) -> f64 {
        self.across.length() / self.longest
    }

    pub(super) fn centre(&self) -> DVec3 {
        (self.corner[0] + self.corner[1] + self.corner[2]) / 3.0
    }

    /// The axis along which the triangle is largest; the first of equal ones, also where rounding tells them apart, so
    /// that triangles of one plane agree.
    pub(super) fn axis(&self) -> usize {
        const SAME: f64 = 1.0 + 1e-9;
        let size = self.across.abs();
        let first = usize::from(size.y > size.x * SAME);
        if size.z > size[first] * SAME { 2 } else { first }
    }

    /// Axes of the rays that sample the triangle.
    pub(super) fn axes(&self, reduce: bool) -> std::ops::Range<usize> {
        let axis = self.axis();
        if reduce { axis..axis + 1 } else { 0..3 }
    }
}

/// A point of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    pub(super) triangle: u32,
    /// It is of the finer grid, which stands at sharp edges.
    pub(super) fine: bool,
    /// Weights of its second and third corner, >= 0, in sum at most 1.
    pub(super) weight: [f32; 2],
}

impl Hit {
    pub(super) fn of(triangle: u32, fine: bool, [b, c]: [f64; 2]) -> Self {
        let (b, c) = (b.clamp(0.0, 1.0), c.clamp(0.0, 1.0));
        let sum = (b + c).max(1.0);
        Self { triangle, fine, weight: [(b / sum) as f32, (c / sum) as f32] }
    }

    /// True if the other one is of the same triangle and grid.
    pub(super) fn is_beside(&self, other: &Self) -> bool {
        self.triangle == other.triangle && self.fine == other.fine
    }

    /// The mean of three values at the corners.
    pub(super) fn position(&self, corner: &[DVec3; 3]) -> DVec3 {
        let [b, c] = self.weight.map(f64::from);
        corner[0] + b * (corner[1] - corner[0]) + c * (corner[2] - corner[0])
    }
}

impl<'a> Facets<'a> {
    pub(super) fn new(mesh: &'a Mesh) -> Self {
        let usable: Vec<u32> = (0..mesh.triangles.len() as u32)
            .into_par_iter()
            .filter(|&i| {
                let corner = mesh.triangles[i as usize].corners.map(|v| mesh.position[v as usize]);
                // NaN fails the comparisons.
                let near = corner.iter().all(|p| p.abs().cmple(DVec3::splat(MAX_COORDINATE)).all());
                let shape = TriangleShape::new(corner);
                near && shape.height() > FLAT * shape.longest
            })
            .collect();
        let welded = welded(mesh);
        let repeated = repeated(mesh, &welded, &usable);
        let kept = if repeated.is_empty() {
            usable
        } else {
            usable.into_iter().filter(|i| repeated.binary_search(i).is_err()).collect()
        };
        let corners = kept.iter().flat_map(|&i| mesh.triangles[i as usize].corners);
        let bounds: Bounds = corners.map(|v| mesh.position[v as usize]).collect();
        Self {
            mesh,
            origin: bounds.centre(),
            size: bounds.size(),
            kept,
            repeated,
            welded,
            level: Vec::new(),
            levels: 1,
        }
    }

    /// The same with levels, one for each triangle of the mesh.
    pub(super) fn with_levels(self, level: Vec<u8>) -> Self {
        let levels = level.iter().max().map_or(1, |&most| usize::from(most) + 1);
        Self { level, levels, ..self }
    }

    /// The level of a triangle.
    pub(super) fn level(&self, triangle: u32) -> u8 {
        self.level.get(triangle as usize).copied().unwrap_or(0)
    }

    /// How many levels there are.
    pub(super) fn levels(&self) -> usize {
        self.levels
    }

    pub(super) fn shape(&self, triangle: u32) -> TriangleShape {
        TriangleShape::new(
            self.mesh.triangles[triangle as usize].corners.map(|v| self.mesh.position[v as usize] - self.origin),
        )
    }

    /// True if an edge belongs to one triangle alone.
    pub(super) fn is_open(&self) -> bool {
        let mut edges: Vec<(u32, u32)> = self
            .mesh
            .triangles
            .par_iter()
            .zip(0_u32..self.mesh.triangles.len() as u32)
            .flat_map_iter(|(triangle, i)| {
                let [a, b, c] = triangle.corners.map(|v| self.welded[v as usize]);
                let none = a == b || b == c || c == a || self.repeated.binary_search(&i).is_ok();
                let edges = [(a, b), (b, c), (c, a)].map(|(a, b)| (a.min(b), a.max(b)));
                edges.into_iter().take(if none { 0 } else { 3 })
            })
            .collect();
        edges.par_sort_unstable();
        edges.chunk_by(|a, b| a == b).any(|run| run.len() == 1)
    }

    /// The connected parts of the mesh that none of `hit` belongs to: for each of them its triangles. `hit` says which
    /// of [`Self::kept`] have a surfel.
    pub(super) fn missed(&self, hit: &[bool]) -> Vec<Vec<u32>> {
        let mut parent: Vec<u32> = (0..self.welded.len() as u32).collect();
        let corners = |i: u32| self.mesh.triangles[i as usize].corners.map(|v| self.welded[v as usize]);
        for &i in &self.kept {
            let [a, b, c] = corners(i);
            join(&mut parent, a, b);
            join(&mut parent, a, c);
        }
        let mut seen = vec![false; self.welded.len()];
        for (&i, _) in self.kept.iter().zip(hit).filter(|(_, hit)| **hit) {
            seen[root(&mut parent, corners(i)[0]) as usize] = true;
        }
        let mut parts: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (&i, _) in self.kept.iter().zip(hit).filter(|(_, hit)| !**hit) {
            let root = root(&mut parent, corners(i)[0]);
            if !seen[root as usize] {
                parts.entry(root).or_default().push(i);
            }
        }
        parts.into_values().collect()
    }
}

/// See [`Facets::welded`].
fn welded(mesh: &Mesh) -> Vec<u32> {
    // Adding 0 makes one zero of two.
    let key = |&v: &u32| (mesh.position[v as usize] + 0.0).to_array().map(f64::to_bits);
    let mut order: Vec<u32> = (0..mesh.position.len() as u32).collect();
    order.par_sort_unstable_by_key(|v| (key(v), *v));
    let mut first = vec![0; order.len()];
    for run in order.chunk_by(|a, b| key(a) == key(b)) {
        for &v in run {
            first[v as usize] = run[0];
        }
    }
    first
}

/// The usable triangles that are equal to an earlier one: the same corners in the same winding, whichever is first, and
/// the same material, normals, texture coordinates and colours. Rising.
fn repeated(mesh: &Mesh, welded: &[u32], usable: &[u32]) -> Vec<u32> {
    // Corners of a triangle with an area differ, so one of them is the least.
    let turned = |i: u32| {
        let triangle = mesh.triangles[i as usize];
        let places = triangle.corners.map(|v| welded[v as usize]);
        let first = (0..3).min_by_key(|&k| places[k]).unwrap_or(0);
        (0..3).map(move |k| (places[(first + k) % 3], triangle.corners[(first + k) % 3]))
    };
    let mut order: Vec<([u32; 4], u32)> = usable
        .par_iter()
        .map(|&i| {
            let mut places = turned(i).map(|(place, _)| place);
            let mut next = || places.next().unwrap_or_default();
            ([next(), next(), next(), mesh.triangles[i as usize].material], i)
        })
        .collect();
    order.par_sort_unstable();
    // The bits of all that vertices have beside their places.
    let looks = |i: u32| -> Vec<u32> {
        let of_vertex = |v: usize| {
            let normal = mesh.normal.get(v).map(Vec3::to_array);
            let uv = mesh.uv.get(v).map(Vec2::to_array);
            let colour = mesh.colour.get(v).map(Vec4::to_array);
            let numbers = normal.into_iter().flatten().chain(uv.into_iter().flatten());
            numbers.chain(colour.into_iter().flatten()).map(|x| (x + 0.0).to_bits())
        };
        turned(i).flat_map(|(_, v)| of_vertex(v as usize)).collect()
    };
    let mut repeated = Vec::new();
    for run in order.chunk_by(|a, b| a.0 == b.0).filter(|run| run.len() > 1) {
        let mut run: Vec<(Vec<u32>, u32)> = run.par_iter().map(|&(_, i)| (looks(i), i)).collect();
        run.par_sort_unstable();
        for equal in run.chunk_by(|a, b| a.0 == b.0) {
            repeated.extend(equal[1..].iter().map(|(_, i)| i));
        }
    }
    repeated.par_sort_unstable();
    repeated
}

/// The vertex that stands for all that `v` is joined with: the one of the lowest index.
fn root(parent: &mut [u32], mut v: u32) -> u32 {
    while parent[v as usize] != v {
        parent[v as usize] = parent[parent[v as usize] as usize];
        v = parent[v as usize];
    }
    v
}

fn join(parent: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b) as usize] = a.min(b);
}

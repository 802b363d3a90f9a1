//! A tree of levels of detail: fewer, larger surfels in place of many small ones.
//!
//! Each node of an octree over a model's surfels has surfels of its own that replace all below it (Pfister et al. 2000,
//! section 6.1, where coarse blocks hold every second sample). Here they are merged, so that areas, middles and mean
//! colours stay. A picture takes a cut through the tree: one node of each branch.

mod build;
mod columns;
pub(super) mod grid;
mod kept;
mod merge;
pub(super) mod octree;
mod rims;
#[cfg(test)]
mod tests;

use std::ops::Range;
use std::sync::Arc;

use glam::{Mat3, Vec3};

use super::normalisation::LARGEST;
use super::surfels::{Material, Normalisation, Surfels};

pub(super) use columns::TreeColumns;
pub(super) use kept::{VERSION, fingerprint, keep};

/// Least change of the peaks of highlights, the mean of a cut as a share of white in linear light, for which surfels
/// have materials of their own where the model has none: these cost time.
const HIGHLIGHT: f32 = 0.02;

/// The tree of a model.
#[derive(Clone, Debug, Default)]
pub(crate) struct Levels {
    /// The root first, and children behind their parent.
    nodes: Vec<Node>,
    /// The surfels of all nodes that have children: those of a node one after the other. Their origin is the model's.
    merged: Surfels,
    /// Area of the discs of the model below each of them, over its own.
    share: Vec<f32>,
    /// How alike the shading normals of these are: the length of their mean, from 0 to 1.
    alike: Vec<f32>,
}

/// A node of the tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Node {
    /// Corners of a box around all discs of the model below it, relative to the model's origin.
    pub(crate) corners: [Vec3; 2],
    /// Mean front of its discs, unit length; zero where there is none, or no children.
    pub(crate) axis: Vec3,
    /// Edge of its cells, which is the distance of its surfels, model units. 0 without children.
    pub(crate) spacing: f32,
    /// How far its surfels lie from those below them, and reach over them where that shows, model units (root of the
    /// sum of both mean squares). 0 without children.
    pub(crate) deviation: f32,
    /// What its surfels leave out of the colours below, as a share of white as it is displayed (root mean square). 0
    /// without children.
    pub(crate) rest: f32,
    /// How far the fronts below are from those of its surfels, each of length 1 (root mean square). 0 without children.
    pub(crate) turns: f32,
    /// Share of what is left out that changes along a unit vector d: d . (`along` d). Its trace is 1, or 0.
    pub(crate) along: Mat3,
    /// Velocities and accelerations below it; zero in a model without any.
    pub(crate) rates: [Rates; 2],
    /// Its surfels: of the model where it has no children, else of the merged ones.
    surfels: Range<u32>,
    /// Its children, by number; empty where it has none.
    pub(crate) children: Range<u32>,
}

/// Velocities of the surfels of a model below a node, or accelerations, model units per unit of time (squared).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Rates {
    /// Corners of a box around them.
    pub(crate) corners: [Vec3; 2],
    /// Their mean.
    pub(crate) mean: Vec3,
    /// How far they are from those of the node's surfels (root mean square). 0 without children.
    pub(crate) stray: f32,
}

impl Node {
    /// Has it no children?
    pub(crate) fn is_leaf(&self) -> bool {
        self.children.is_empty()
    }

    /// Number of its surfels.
    pub(crate) fn len(&self) -> usize {
        self.surfels.len()
    }
}

impl Levels {
    /// All nodes: the root first, and children behind their parent.
    pub(crate) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Memory of the tree, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.merged.bytes() + (size_of_val(&*self.nodes) + size_of_val(&*self.share) + size_of_val(&*self.alike)) as u64
    }

    /// The surfels of the nodes `cut` of the tree of `model`, in their order. They have materials where highlights
    /// differ: those of the model, or `own` for all of it.
    pub(crate) fn gather(self: &Arc<Self>, model: &Arc<Surfels>, cut: &[u32], own: Option<Material>) -> Surfels {
        let (levels, whole, nodes) = (Arc::clone(self), Arc::clone(model), cut.to_vec());
        let factors = move || levels.factors(&whole, &nodes);
        let vectors = |of: fn(&Surfels) -> &Vec<Vec3>| self.column(model, cut, of);
        Surfels {
            origin: model.origin,
            position: vectors(|of| &of.position),
            axis_u: vectors(|of| &of.axis_u),
            axis_v: vectors(|of| &of.axis_v),
            normal: vectors(|of| &of.normal),
            colour: vectors(|of| &of.colour),
            opacity: self.column(model, cut, |of| &of.opacity),
            material: self.materials(model, cut, own),
            velocity: vectors(|of| &of.velocity),
            acceleration: vectors(|of| &of.acceleration),
            velocity_unit: model.velocity_unit,
            normalisation: Normalisation::later(factors),
            two_sided: model.two_sided,
            signs_estimated: model.signs_estimated,
            ..Surfels::default()
        }
    }

    /// A column of the surfels of some nodes. Merged surfels have a column where the model does.
    fn column<T: Copy>(&self, model: &Surfels, cut: &[u32], of: fn(&Surfels) -> &Vec<T>) -> Vec<T> {
        if of(model).is_empty() {
            return Vec::new();
        }
        let parts = || cut.iter().map(|&node| &self.nodes[node as usize]);
        let mut column = Vec::with_capacity(parts().map(Node::len).sum());
        for node in parts() {
            let from = of(if node.is_leaf() { model } else { &self.merged });
            column.extend_from_slice(&from[node.surfels.start as usize..node.surfels.end as usize]);
        }
        column
    }

    /// Materials of the surfels of some nodes: of the model, or `whole` for all of it. None where it has none and
    /// merged surfels hardly change the highlights of `whole`.
    fn materials(&self, model: &Surfels, cut: &[u32], whole: Option<Material>) -> Vec<Material> {
        let whole = whole.or_else(|| model.material.is_empty().then(Material::default));
        let nodes = || cut.iter().map(|&node| &self.nodes[node as usize]);
        let merged = |node: &Node| &self.alike[node.surfels.start as usize..node.surfels.end as usize];
        if let Some(whole) = whole {
            let change = |alike: &f32| whole.specular - gloss(whole, *alike).specular;
            let inner = nodes().filter(|node| !node.is_leaf());
            let sum: f32 = inner.flat_map(|node| merged(node).iter().map(change)).sum();
            if sum <= HIGHLIGHT * nodes().map(Node::len).sum::<usize>() as f32 {
                return Vec::new();
            }
        }
        let mut column = Vec::with_capacity(nodes().map(Node::len).sum());
        for node in nodes() {
            let surfels = node.surfels.start as usize..node.surfels.end as usize;
            let own = |of: &Surfels, i: usize| whole.unwrap_or_else(|| of.material[i]);
            if node.is_leaf() {
                column.extend(surfels.map(|i| own(model, i)));
            } else {
                column.extend(surfels.map(|i| gloss(own(&self.merged, i), self.alike[i])));
            }
        }
        column
    }

    /// Factors that normalise the kernels of the surfels of some nodes. A merged surfel stands for the area of those
    /// below it, each of which counts as the mean of the model.
    fn factors(&self, model: &Surfels, cut: &[u32]) -> Vec<f32> {
        let (own, mean) = (model.normalisation(), model.mean_normalisation());
        let mut factors = Vec::new();
        for node in cut.iter().map(|&node| &self.nodes[node as usize]) {
            let surfels = node.surfels.start as usize..node.surfels.end as usize;
            if node.is_leaf() {
                factors.extend_from_slice(&own[surfels]);
            } else {
                factors.extend(self.share[surfels].iter().map(|share| (mean * share).min(LARGEST)));
            }
        }
        factors
    }
}

/// The material of a surfel in place of several whose shading normals have a mean of length `alike`. The highlight is
/// wider and lower, with the same light in total (Toksvig 2005, for the reflected ray, which turns twice as far).
fn gloss(of: Material, alike: f32) -> Material {
    if of.shininess <= 0.0 {
        return of;
    }
    // Each number may be as large as a float can be.
    let shininess = (alike / (alike / of.shininess + 4.0 * (1.0 - alike))).min(of.shininess);
    Material { shininess, specular: of.specular * (1.0 + shininess) / (1.0 + of.shininess), ..of }
}

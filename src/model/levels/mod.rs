//! A tree of levels of detail: fewer, larger surfels in place of many small ones.
//!
//! Each node of an octree over a model's surfels has surfels of its own that replace all below it (Pfister et al. 2000,
//! section 6.1, where coarse blocks hold every second sample). Here they are merged, so that areas, middles and mean
//! colours stay. A picture takes a cut through the tree: one node of each branch.

mod build;
mod grid;
mod merge;
mod rims;
#[cfg(test)]
mod tests;

use std::ops::Range;
use std::sync::Arc;

use glam::{Mat3, Vec3};

use super::normalisation::LARGEST;
use super::surfels::{Normalisation, Surfels};

/// Cells of a node along each axis. The surfels of a cell with like fronts are merged into one.
const CELLS: u32 = 8;
/// Most surfels of a node that is not divided: on a surface, two for each cell.
const FEW: usize = 2 * (CELLS * CELLS) as usize;

/// The tree of a model.
#[derive(Clone, Debug, Default)]
pub(crate) struct Levels {
    /// The root first, and children behind their parent.
    nodes: Vec<Node>,
    /// The surfels of all nodes that have children: those of a node one after the other.
    merged: Surfels,
    /// Area of the discs of the model below each of them, over its own.
    share: Vec<f32>,
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
    /// Its surfels: of the model where it has no children, else of the merged ones.
    surfels: Range<u32>,
    /// Its children, by number; empty where it has none.
    pub(crate) children: Range<u32>,
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
        self.merged.bytes() + (size_of_val(&*self.nodes) + size_of_val(&*self.share)) as u64
    }

    /// The surfels of the nodes `cut` of the tree of `model`, in their order.
    pub(crate) fn gather(self: &Arc<Self>, model: &Arc<Surfels>, cut: &[u32]) -> Surfels {
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
            material: self.column(model, cut, |of| &of.material),
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

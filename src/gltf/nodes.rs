//! The tree of nodes: who is whose parent, and where the nodes of the scene stand.

use glam::DAffine3;

use super::document::Document;
use super::error::{GltfError, named, wrong};

/// The nodes as a tree. It has no cycles, and no node has two parents.
pub(crate) struct Tree {
    parents: Vec<Option<usize>>,
}

impl Tree {
    pub(crate) fn new(document: &Document) -> Result<Self, GltfError> {
        let nodes = &document.nodes;
        let mut parents = vec![None; nodes.len()];
        for (index, node) in nodes.iter().enumerate() {
            for &child in &node.children {
                named(nodes, child, "node")?;
                if let Some(other) = parents[child].replace(index) {
                    let found = format!("node {child} a second time, below the nodes {other} and {index}");
                    return Err(wrong(found, "a tree without cycles"));
                }
            }
        }
        // Every node has one parent at most, so whatever no root reaches is a cycle.
        let mut reached = vec![false; nodes.len()];
        let mut open: Vec<usize> = (0..nodes.len()).filter(|&index| parents[index].is_none()).collect();
        while let Some(index) = open.pop() {
            reached[index] = true;
            open.extend(&nodes[index].children);
        }
        if let Some(index) = reached.iter().position(|reached| !reached) {
            return Err(wrong(format!("node {index} a second time"), "a tree without cycles"));
        }
        Ok(Self { parents })
    }

    /// The parent of a node; `None` for a root.
    pub(crate) fn parent(&self, node: usize) -> Option<usize> {
        self.parents.get(node).copied().flatten()
    }

    /// Nodes of the default scene in file order of the tree, with their transforms to the world at rest.
    pub(crate) fn placed(&self, document: &Document) -> Result<Vec<(usize, DAffine3)>, GltfError> {
        let Document { scene, scenes, nodes, .. } = document;
        let roots: Vec<usize> = if scenes.is_empty() && scene.is_none() {
            (0..nodes.len()).filter(|&index| self.parents[index].is_none()).collect()
        } else {
            named(scenes, scene.unwrap_or(0), "scene")?.nodes.clone()
        };
        let mut seen = vec![false; nodes.len()];
        let mut placed = Vec::new();
        let mut open: Vec<_> = roots.into_iter().rev().map(|root| (root, DAffine3::IDENTITY)).collect();
        while let Some((index, parent)) = open.pop() {
            let node = named(nodes, index, "node")?;
            if std::mem::replace(&mut seen[index], true) {
                return Err(wrong(format!("node {index} a second time"), "a tree without cycles"));
            }
            let affine =
                parent * node.transform().map_err(|found| wrong(format!("node {index}, {found}"), "a transform"))?;
            open.extend(node.children.iter().rev().map(|child| (*child, affine)));
            placed.push((index, affine));
        }
        Ok(placed)
    }
}

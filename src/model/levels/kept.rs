//! The tree of a model that a file brought along.

use std::fmt;
use std::sync::Arc;

use super::Levels;
use crate::model::surfels::{KeptLevels, Surfels, Tree};

/// The version of the rules by which trees are made. A program makes trees of other versions anew, so that a file and
/// its model give the same picture.
pub(in crate::model) const VERSION: i64 = 2;

/// A tree, and the surfels that it is of.
struct KeptTree {
    /// [`fingerprint`] of the surfels.
    of: u32,
    tree: Arc<Levels>,
}

impl fmt::Debug for KeptTree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} nodes", self.tree.nodes.len())
    }
}

impl Tree for KeptTree {
    fn bytes(&self) -> u64 {
        self.tree.bytes()
    }
}

/// Keeps the tree of surfels with the fingerprint `of`.
pub(in crate::model) fn keep(of: u32, tree: Levels) -> KeptLevels {
    KeptLevels::new(KeptTree { of, tree: Arc::new(tree) })
}

impl Surfels {
    /// The tree of levels: the kept one if it is of these surfels, else a new one. `None` where there can be none.
    pub(crate) fn tree(&self) -> Option<Arc<Levels>> {
        match self.levels.tree::<KeptTree>() {
            Some(kept) if kept.of == fingerprint(self) => Some(Arc::clone(&kept.tree)),
            _ => Levels::of(self).map(Arc::new),
        }
    }

    /// Is `tree` the one that a file brought along?
    pub(crate) fn keeps(&self, tree: &Arc<Levels>) -> bool {
        self.levels.tree::<KeptTree>().is_some_and(|kept| Arc::ptr_eq(&kept.tree, tree))
    }
}

/// CRC-32 of all columns that a tree depends on.
pub(in crate::model) fn fingerprint(surfels: &Surfels) -> u32 {
    let mut sum = crc32fast::Hasher::new();
    let columns = [&surfels.position, &surfels.axis_u, &surfels.axis_v, &surfels.normal, &surfels.colour];
    for column in columns.into_iter().chain(surfels.rates()) {
        sum.update(bytemuck::cast_slice(column));
    }
    sum.update(bytemuck::cast_slice(&surfels.opacity));
    for material in &surfels.material {
        let coefficients = [material.ambient, material.diffuse, material.specular, material.shininess];
        sum.update(bytemuck::cast_slice(&coefficients));
    }
    sum.finalize()
}

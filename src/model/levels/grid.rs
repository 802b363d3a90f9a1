//! Cells of space.

use glam::{IVec3, Vec3};

/// The cells of the codes of a model in space.
pub(in crate::model) struct Grid {
    corner: Vec3,
    /// Edge of a cell.
    edge: f32,
    /// Cells of a length of 1.
    cells: f32,
}

impl Grid {
    /// Cells with this edge from a corner on.
    pub(in crate::model) fn new(corner: Vec3, edge: f32) -> Self {
        Self { corner, edge, cells: edge.max(f32::MIN_POSITIVE).recip() }
    }

    /// The place of a point among cells that are 2 to `shift` times as large.
    pub(in crate::model) fn place(&self, point: Vec3, shift: u32) -> IVec3 {
        // Without `floor`, which is a call: a point less than a cell of the codes outside counts as inside.
        ((point - self.corner) * self.cells).as_ivec3() >> shift
    }

    /// Edge of a cell that is 2 to `shift` times as large.
    pub(in crate::model) fn edge(&self, shift: u32) -> f32 {
        self.edge * (1_u32 << shift) as f32
    }
}

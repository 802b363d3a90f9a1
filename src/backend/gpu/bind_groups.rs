//! Bind groups that are kept from frame to frame, because the buffers stay.

use std::collections::HashMap;

use wgpu::{BindGroup, Buffer, BufferBinding, BufferSize};

use super::passes::Program;
use super::slots::Slot;

/// Rounds of binding for which bind groups are kept that nobody asks for. Mode auto binds for each of its renderings,
/// and cuts of detail take turns with the rooms of models ([`models`](super::models)). A bind group may name buffers
/// that were destroyed, and holds no memory of theirs.
const KEPT: u64 = 64;

/// What a program is bound to: the buffers of its uniforms, and its other buffers or parts of them.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) struct Bound {
    program: Program,
    uniforms: [Buffer; 2],
    buffers: Vec<(Slot, Buffer, u64, Option<BufferSize>)>,
}

impl Bound {
    pub(super) fn new(program: Program, uniforms: [&Buffer; 2], buffers: &[(Slot, BufferBinding<'_>)]) -> Self {
        let part = |(slot, part): &(Slot, BufferBinding<'_>)| (*slot, part.buffer.clone(), part.offset, part.size);
        Self { program, uniforms: uniforms.map(Clone::clone), buffers: buffers.iter().map(part).collect() }
    }
}

/// The two bind groups of a program, of its uniforms and of its buffers.
pub(in crate::backend) type Pair = [BindGroup; 2];

/// Bind groups that were made, and the round in which they were last asked for.
#[derive(Debug, Default)]
pub(in crate::backend) struct BindGroups {
    made: HashMap<Bound, (Pair, u64)>,
    round: u64,
}

impl BindGroups {
    /// Begins the binding of a frame, or of a chunk that needs more room.
    pub(super) fn begin(&mut self) {
        self.round += 1;
        let round = self.round;
        self.made.retain(|_, (_, asked)| *asked + KEPT >= round);
    }

    /// The bind groups of what is bound, which `make` makes if they are not there.
    pub(super) fn of(&mut self, bound: Bound, make: impl FnOnce() -> Pair) -> Pair {
        let (pair, asked) = self.made.entry(bound).or_insert_with(|| (make(), 0));
        *asked = self.round;
        pair.clone()
    }
}

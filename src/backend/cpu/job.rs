//! What a pass works on: one tile, its splats, and where it writes.

use super::bin::Binned;
use super::chunk::Chunk;
use super::tile_buffers::TileBuffers;
use super::tiles::TileRect;

/// One tile in one pass.
pub(in crate::backend) struct Job<'a, S, O> {
    pub chunks: &'a [Chunk<'a>],
    /// The splats of `chunks`.
    pub binned: &'a [Binned<S>],
    pub tile: TileRect,
    /// Number of the tile in its band.
    pub index: usize,
    pub buffers: &'a mut TileBuffers,
    pub scratch: &'a mut Vec<u32>,
    pub out: &'a mut O,
    /// Are these the first splats of the pass in the tile? It starts what it writes from nothing then.
    pub first: bool,
}

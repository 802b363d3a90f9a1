//! What lies still, splatted and swept once for all intervals that share a sample position (docs/architecture.md, "What lies still").
//!
//! In: the splats and kernels of the objects that lie still. Out: their part of the map, and for each tile of the image their sums
//! and when they cover. A kernel without motion looks itself up at its own pixel, so its sums are those of another interval where the
//! map there is the same; else a tile's still kernels are added up anew, first, as without a layer. So both are the same to the bit.

use super::map::{Map, MapTile};
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::tiles::{Presence, ROWS, STRIDE, TileBuffers, TileRect};
use crate::backend::cpu::work::Chunk;
use crate::layout::{Splat, SweptSplat};

/// The objects that lie still, at one sample position.
#[derive(Debug, Default)]
pub(in crate::backend::cpu) struct SweptLayer {
    pub chunks: Vec<Chunk>,
    /// The splats of `chunks` on the map.
    pub splats: Vec<Binned<Splat>>,
    /// The kernels of `chunks` on the band.
    pub kernels: Vec<Binned<SweptSplat>>,
    /// What the map is without anything else.
    pub map: Map,
    /// One a tile of the map.
    pub depths: Vec<LayerDepths>,
    /// One a tile of the band.
    pub sums: Vec<LayerSums>,
}

/// One tile of the map; empty where nothing lies still.
#[derive(Clone, Debug, Default)]
pub(in crate::backend::cpu) struct LayerDepths {
    threshold: Vec<f32>,
    /// Sums of weights; empty where none are wanted.
    density: Vec<f32>,
}

impl LayerDepths {
    /// Of what `buffers` hold after passes `visibility` and `density`.
    pub(in crate::backend::cpu) fn of(buffers: &TileBuffers) -> Self {
        Self { threshold: buffers.threshold.clone(), density: buffers.sums.clone() }
    }

    /// Starts pass `visibility`: `threshold` is +inf.
    pub(in crate::backend::cpu) fn begin(&self, threshold: &mut [f32]) {
        if !self.threshold.is_empty() {
            threshold.copy_from_slice(&self.threshold);
        }
    }

    /// Starts pass `density` with the sums of what lies still, once all thresholds are known; false where it must be added up anew, as
    /// something before it hides some of it.
    pub(in crate::backend::cpu) fn recall(&self, buffers: &mut TileBuffers) -> bool {
        if self.threshold.is_empty() {
            return true;
        }
        let same = self.threshold == buffers.threshold;
        if same {
            buffers.sums.copy_from_slice(&self.density);
        }
        same
    }
}

/// One tile of the band; empty where nothing lies still.
#[derive(Clone, Debug, Default)]
pub(in crate::backend::cpu) struct LayerSums {
    sums: Vec<f32>,
    presence: Presence,
}

impl LayerSums {
    /// Of what `buffers` hold after pass `attribute`.
    pub(in crate::backend::cpu) fn of(buffers: &TileBuffers) -> Self {
        Self { sums: buffers.sums.clone(), presence: buffers.presence.clone() }
    }

    /// Does nothing lie still here?
    pub(in crate::backend::cpu) const fn is_empty(&self) -> bool {
        self.sums.is_empty()
    }

    /// Starts pass `attribute` with what lies still.
    pub(in crate::backend::cpu) fn begin(&self, buffers: &mut TileBuffers) {
        buffers.sums.copy_from_slice(&self.sums);
        buffers.presence.clone_from(&self.presence);
    }
}

impl SweptLayer {
    /// Bytes of `guarded` tiles of the map and `tiles` of the band, beside splats and kernels.
    pub(in crate::backend::cpu) const fn bytes(guarded: u64, tiles: u64, channels: usize) -> u64 {
        const PLANE: u64 = (ROWS * STRIDE * size_of::<f32>()) as u64;
        guarded * (2 * PLANE + size_of::<MapTile>() as u64) + tiles * (channels as u64 + 3) * PLANE
    }

    /// Is `map` in `tile` what it is without anything else?
    pub(in crate::backend::cpu) fn is_map_of(&self, map: &Map, tile: &TileRect) -> bool {
        let [left, top] = tile.corner;
        let columns = left..left + tile.width as i32;
        (top..top + tile.height as i32).all(|y| columns.clone().all(|x| map.at(x, y) == self.map.at(x, y)))
    }
}

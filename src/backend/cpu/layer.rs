//! What lies still, splatted once for all groups that share a sample position (docs/architecture.md, "What lies still").
//!
//! In: the splats of the objects that lie still. Out: for each tile their thresholds and sums, from which each group starts. Sums
//! are those of one pass over all splats, still ones first, to the bit: where what moves hides all of a pixel's sums they are zero,
//! where it hides none they are the layer's, and where it hides some they are added up anew.

use super::bin::Binned;
use super::resolve::TileFilm;
use super::tiles::{ROWS, STRIDE, TILE, TileBuffers};
use super::work::Chunk;

/// The objects that lie still, at one sample position.
#[derive(Debug)]
pub(super) struct Layer {
    pub chunks: Vec<Chunk>,
    /// The splats of `chunks`.
    pub binned: Vec<Binned>,
    /// One a tile of the band.
    pub tiles: Vec<LayerTile>,
}

/// One tile; empty where nothing lies still.
#[derive(Clone, Debug, Default)]
pub(super) struct LayerTile {
    threshold: Vec<f32>,
    sums: Vec<f32>,
    reach: Vec<f32>,
    /// Least depth of what the sums hold.
    nearest: Vec<f32>,
    /// The tile resolved with weight 1, for groups of one sample in which nothing else moves into it; empty where it depends on
    /// the sample.
    pub film: TileFilm,
}

impl LayerTile {
    /// Bytes of one tile.
    pub(super) const fn bytes(channels: usize, samples: usize, planes: usize) -> u64 {
        let reach = if samples > 1 { 1 } else { 0 };
        ((2 + channels + reach) * ROWS * STRIDE * size_of::<f32>()) as u64 + TileFilm::bytes(planes)
    }

    /// Of what `buffers` hold after passes `visibility` and `attribute`, with the least depths.
    pub(super) fn of(buffers: &TileBuffers, nearest: &[f32], film: TileFilm) -> Self {
        Self {
            threshold: buffers.threshold.clone(),
            sums: buffers.sums.clone(),
            reach: buffers.union.reach.clone(),
            nearest: nearest.to_vec(),
            film,
        }
    }

    /// Does nothing lie still here?
    pub(super) const fn is_empty(&self) -> bool {
        self.threshold.is_empty()
    }

    /// Starts pass `visibility`: `threshold` is +inf.
    pub(super) fn begin(&self, threshold: &mut [f32]) {
        if !self.is_empty() {
            threshold.copy_from_slice(&self.threshold);
        }
    }

    /// Starts pass `attribute` once all thresholds are known: the sums of what is still visible; `buffers` are clear. Returns the
    /// thresholds of the pixels whose sums must be added up anew, none elsewhere; nothing where there are no such pixels.
    pub(super) fn recall(&self, channels: usize, buffers: &mut TileBuffers) -> Option<Vec<f32>> {
        if self.is_empty() {
            return None;
        }
        let lowered = |at: usize| buffers.threshold[at] < self.threshold[at];
        let mut anew: Option<Vec<f32>> = None;
        for y in 0..TILE {
            let row = y * STRIDE;
            let old = &self.sums[row * channels..][..STRIDE * channels];
            let new = &mut buffers.sums[row * channels..][..STRIDE * channels];
            if !(row..row + TILE).any(lowered) {
                new.copy_from_slice(old);
                if let Some(reach) = buffers.union.reach.get_mut(row..row + STRIDE) {
                    reach.copy_from_slice(&self.reach[row..][..STRIDE]);
                }
                continue;
            }
            for x in 0..TILE {
                let at = row + x;
                if !lowered(at) {
                    for channel in 0..channels {
                        new[channel * STRIDE + x] = old[channel * STRIDE + x];
                    }
                    if let (Some(reach), Some(&old)) = (buffers.union.reach.get_mut(at), self.reach.get(at)) {
                        *reach = old;
                    }
                    continue;
                }
                // What is hidden covers all the same.
                if let Some(reach) = buffers.union.reach.get_mut(at) {
                    *reach = if self.threshold[at] < f32::INFINITY { 1.0 } else { 0.0 };
                }
                if buffers.threshold[at] >= self.nearest[at] {
                    let limits = anew.get_or_insert_with(|| vec![f32::NEG_INFINITY; ROWS * STRIDE]);
                    limits[at] = buffers.threshold[at];
                }
            }
        }
        anew
    }
}

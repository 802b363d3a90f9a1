//! Static objects of one tile, splatted once for several groups or intervals (docs/architecture.md, "Static objects").
//!
//! Sums of a group that starts from a layer are equal, to the bit, to those of one pass over all splats, static ones
//! first. Where moving splats hide all static splats of a pixel, its sums start from zero. Where they hide none, its
//! sums start from the layer's. Where they hide some, its sums are recomputed.

use super::bin::Binned;
use super::chunk::Chunk;
use super::resolve::TileFilm;
use super::tile_buffers::TileBuffers;
use super::tiles::{ROWS, STRIDE, TILE, TileRect};

/// The static objects of one sample position; empty where there are none, or no room for them.
#[derive(Debug, Default)]
pub(in crate::backend) struct StaticLayer {
    pub chunks: Vec<Chunk>,
    /// The splats of `chunks`.
    pub binned: Vec<Binned>,
    /// One a tile of the band.
    pub tiles: Vec<StaticTile>,
}

/// One tile; empty where no static object shows.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct StaticTile {
    /// T(x) of static objects alone, as in [`TileBuffers`].
    pub threshold: Vec<f32>,
    /// The tile resolved with weight 1; empty where each group resolves it differently.
    pub film: TileFilm,
    /// As in [`TileBuffers`]; empty where nothing is added to them.
    sums: Vec<f32>,
    /// Coverage of a group of several samples, likewise.
    sample_coverage: Vec<f32>,
    /// Least depth of what the sums hold, likewise; +inf where they hold nothing.
    pub nearest: Vec<f32>,
}

impl StaticTile {
    /// Bytes of one tile with sums.
    pub(in crate::backend) const fn bytes_with_sums(channels: usize, samples: usize, planes: usize) -> u64 {
        let sample_coverage = if samples > 1 { 1 } else { 0 };
        ((2 + channels + sample_coverage) * ROWS * STRIDE * size_of::<f32>()) as u64 + TileFilm::bytes(planes)
    }

    /// Bytes of one tile without sums.
    pub(in crate::backend) const fn bytes(planes: usize) -> u64 {
        (ROWS * STRIDE * size_of::<f32>()) as u64 + TileFilm::bytes(planes)
    }

    /// What `buffers` hold after passes `visibility` and `attribute`, with the least depths of the sums.
    pub(in crate::backend) fn with_sums(buffers: &TileBuffers, nearest: Vec<f32>) -> Self {
        Self {
            threshold: buffers.threshold.clone(),
            film: TileFilm::default(),
            sums: buffers.sums.clone(),
            sample_coverage: buffers.group_coverage.sample_coverage.clone(),
            nearest,
        }
    }

    /// Thresholds alone; the film is added later.
    pub(in crate::backend) fn with_threshold(threshold: &[f32]) -> Self {
        Self { threshold: threshold.to_vec(), ..Self::default() }
    }

    /// Whether no static object shows here.
    pub(in crate::backend) const fn is_empty(&self) -> bool {
        self.threshold.is_empty()
    }

    /// Starts thresholds from those of static objects: `threshold` is +inf.
    pub(in crate::backend) fn start_threshold(&self, threshold: &mut [f32]) {
        if !self.is_empty() {
            threshold.copy_from_slice(&self.threshold);
        }
    }

    /// Starts sums once all thresholds are known, in clear `buffers`. Returns the thresholds of the pixels whose sums
    /// must be recomputed, and -inf for the others; `None` if there are no such pixels.
    pub(in crate::backend) fn restore(&self, channels: usize, buffers: &mut TileBuffers) -> Option<Vec<f32>> {
        if self.is_empty() {
            return None;
        }
        let lowered = |at: usize| buffers.threshold[at] < self.threshold[at];
        let mut limits: Option<Vec<f32>> = None;
        for y in 0..TILE {
            let row = y * STRIDE;
            let old = &self.sums[row * channels..][..STRIDE * channels];
            let new = &mut buffers.sums[row * channels..][..STRIDE * channels];
            if !(row..row + TILE).any(lowered) {
                new.copy_from_slice(old);
                if let Some(sample_coverage) = buffers.group_coverage.sample_coverage.get_mut(row..row + STRIDE) {
                    sample_coverage.copy_from_slice(&self.sample_coverage[row..][..STRIDE]);
                }
                continue;
            }
            for x in 0..TILE {
                let at = row + x;
                if !lowered(at) {
                    for channel in 0..channels {
                        new[channel * STRIDE + x] = old[channel * STRIDE + x];
                    }
                    if let (Some(sample_coverage), Some(&old)) =
                        (buffers.group_coverage.sample_coverage.get_mut(at), self.sample_coverage.get(at))
                    {
                        *sample_coverage = old;
                    }
                    continue;
                }
                // Hidden splats cover, too.
                if let Some(sample_coverage) = buffers.group_coverage.sample_coverage.get_mut(at) {
                    *sample_coverage = if self.threshold[at] < f32::INFINITY { 1.0 } else { 0.0 };
                }
                if buffers.threshold[at] >= self.nearest[at] {
                    let limits = limits.get_or_insert_with(|| vec![f32::NEG_INFINITY; ROWS * STRIDE]);
                    limits[at] = buffers.threshold[at];
                }
            }
        }
        limits
    }

    /// Adds the part of the film that kernels in motion leave uncovered in an interval of weight `weight`. `coverage`:
    /// what they cover, `STRIDE` floats a row, empty where there are none. `weights`: plane of the sum of weights, if
    /// colours are divided by that sum at the end.
    pub(in crate::backend) fn show(
        &self,
        weight: f32,
        coverage: &[f32],
        weights: Option<usize>,
        tile: &TileRect,
        film: &mut TileFilm,
    ) {
        let values = &self.film.values;
        film.values.resize(film.values.len().max(values.len()), 0.0);
        let rows = values.chunks_exact(TILE).zip(film.values.chunks_exact_mut(TILE)).enumerate();
        for (row, (values, film)) in rows {
            let covered = coverage.get(row % TILE * STRIDE..).unwrap_or_default();
            add_uncovered(weight, covered, &values[..tile.width], film);
        }
        if let (Some(plane), false) = (weights, values.is_empty()) {
            // What shows weighs what it covers.
            for y in 0..TILE {
                let covered = coverage.get(y * STRIDE..).unwrap_or_default();
                let alpha = &values[(3 * TILE + y) * TILE..][..tile.width];
                add_uncovered(weight, covered, alpha, &mut film.values[(plane * TILE + y) * TILE..][..TILE]);
            }
        }
    }
}

/// film += what `covered` leaves of `weight`, times `values`.
fn add_uncovered(weight: f32, covered: &[f32], values: &[f32], film: &mut [f32]) {
    if covered.is_empty() {
        film.iter_mut().zip(values).for_each(|(film, value)| *film += weight * value);
        return;
    }
    for ((film, value), covered) in film.iter_mut().zip(values).zip(covered) {
        // Sums of weights may be more than there is.
        *film += (weight - covered).max(0.0) * value;
    }
}

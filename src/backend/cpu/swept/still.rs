//! What lies still beside kernels in motion: its picture and its depth thresholds, at the pixels themselves (docs/math.md, section 7).
//!
//! In: the splats of the objects that lie still, which went through the passes of what is not swept. Out: for each tile of the image
//! the film of one exposure and its thresholds; to the film of an interval, what of that is left beside kernels in motion.

use crate::backend::cpu::resolve::TileFilm;
use crate::backend::cpu::tiles::{ROWS, STRIDE, TILE, TileRect};

/// One tile; empty where nothing lies still.
#[derive(Clone, Debug, Default)]
pub(in crate::backend::cpu) struct StillTile {
    /// T(x) of what lies still alone, as in `TileBuffers`.
    pub threshold: Vec<f32>,
    /// With weight 1.
    pub film: TileFilm,
}

impl StillTile {
    /// Bytes of one tile.
    pub(in crate::backend::cpu) const fn bytes(planes: usize) -> u64 {
        (ROWS * STRIDE * size_of::<f32>()) as u64 + TileFilm::bytes(planes)
    }

    /// Starts the thresholds that kernels in motion are held against: `threshold` is +inf.
    pub(in crate::backend::cpu) fn begin(&self, threshold: &mut [f32]) {
        if !self.threshold.is_empty() {
            threshold.copy_from_slice(&self.threshold);
        }
    }

    /// Adds what shows of it in an interval of weight `weight`, in which kernels in motion cover for `coverage` (`STRIDE` floats a row;
    /// empty where there are none). `weights`: plane of the sum of weights, where colours are divided by them at the end.
    pub(in crate::backend::cpu) fn show(
        &self,
        weight: f32,
        coverage: &[f32],
        weights: Option<usize>,
        tile: &TileRect,
        film: &mut TileFilm,
    ) {
        let still = &self.film.values;
        film.values.resize(film.values.len().max(still.len()), 0.0);
        let rows = still.chunks_exact(TILE).zip(film.values.chunks_exact_mut(TILE)).enumerate();
        for (row, (still, film)) in rows {
            let covered = coverage.get(row % TILE * STRIDE..).unwrap_or_default();
            add_left(weight, covered, &still[..tile.width], film);
        }
        if let (Some(plane), false) = (weights, still.is_empty()) {
            // What shows weighs what it covers.
            for y in 0..TILE {
                let covered = coverage.get(y * STRIDE..).unwrap_or_default();
                let alpha = &still[(3 * TILE + y) * TILE..][..tile.width];
                add_left(weight, covered, alpha, &mut film.values[(plane * TILE + y) * TILE..][..TILE]);
            }
        }
    }
}

/// film += what `covered` leaves of `weight`, times `still`.
fn add_left(weight: f32, covered: &[f32], still: &[f32], film: &mut [f32]) {
    if covered.is_empty() {
        film.iter_mut().zip(still).for_each(|(film, still)| *film += weight * still);
        return;
    }
    for ((film, still), covered) in film.iter_mut().zip(still).zip(covered) {
        // Sums of weights may be more than there is.
        *film += (weight - covered).max(0.0) * still;
    }
}

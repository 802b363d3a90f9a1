//! Pass `resolve` of instants with low-pass discs (Wolf 2008, 4.1.1 and 4.2.3): normalise, shade, add to the film with
//! the time weight.
//!
//! In: a tile's sums and thresholds. Out: the tile's film. One sample position at a time, order-free.

use crate::backend::cpu::mirror::Rows;
use crate::backend::cpu::paint::{APRON_STRIDE, DepthLayer, PaintBuffers};
use crate::backend::cpu::resolve::{Resolve, TileFilm, add_lanes};
use crate::backend::cpu::tiles::{LANES, STRIDE, TILE, TileRect, lanes};
use crate::math::simd::dispatch;

dispatch! {
    /// Adds one group's share of the exposure to `film`. `coverage`: that of a group's samples together, weights
    /// included; empty for a group of one sample.
    pub(in crate::backend) fn resolve(
        resolve: &Resolve<'_>, tile: &TileRect, buffers: &PaintBuffers, coverage: &[f32], film: &mut TileFilm,
    ) = resolve_body
}

#[inline(always)]
fn resolve_body(resolve: &Resolve<'_>, tile: &TileRect, buffers: &PaintBuffers, coverage: &[f32], film: &mut TileFilm) {
    film.values.resize(resolve.planes.count * TILE * TILE, 0.0);
    for y in 0..tile.height {
        for x in (0..tile.width).step_by(LANES) {
            let rows = Rows::new(&buffers.sums[DepthLayer::Band as usize], buffers.row, y, tile);
            let weights = lanes(&rows.own[x..]);
            if weights.iter().all(|&weight| weight == 0.0) {
                continue;
            }
            let limit = lanes(&buffers.threshold[y * APRON_STRIDE + x..]);
            let mut inverse = [0.0; LANES];
            let mut share = [0.0; LANES];
            for l in 0..LANES {
                let w = weights[l];
                inverse[l] = if w > 0.0 { 1.0 / w } else { 0.0 };
                // Where no splat covers, only low-pass discs have weight: the sum of their weights is the coverage.
                let partial = if w < 1.0 { w } else { 1.0 };
                let covered = if limit[l] < f32::INFINITY { 1.0 } else { partial };
                share[l] = if w > 0.0 { covered } else { 0.0 };
            }
            let mut weight = resolve.weight;
            if let Some(coverage) = coverage.get(y * STRIDE + x..).filter(|rest| !rest.is_empty()) {
                share = lanes(coverage);
                weight = 1.0;
            }
            add_lanes(resolve, tile, [x, y], rows, &inverse, &share, weight, film);
        }
    }
}

//! Pass `resolve` of step `Paint`: normalises and shades (Wolf 2008, 4.1.1, eq. 4.14), composites the layers of a
//! pixel, front to back, and adds them to the film with the time weight (docs/math.md, section 3).
//!
//! In: a tile's sums and depths. Out: the tile's film.

use super::buffers::{APRON_STRIDE, DISC, DepthLayer, PEAK, PaintBuffers, SIDE};
use crate::backend::cpu::mirror::Rows;
use crate::backend::cpu::resolve::{Resolve, TileFilm, add_lanes};
use crate::backend::cpu::tiles::{LANES, STRIDE, TILE, TileRect, lanes};
use crate::math::simd::dispatch;

dispatch! {
    /// Adds one group's share of the exposure to `film`. `start`: where the tile begins in planes with an apron.
    /// `coverage`: that of a group's samples together, weights included; empty for a group of one sample.
    pub(in crate::backend) fn resolve(
        resolve: &Resolve<'_>, tile: &TileRect, start: usize, buffers: &PaintBuffers, coverage: &[f32],
        film: &mut TileFilm,
    ) = resolve_body
}

#[inline(always)]
fn resolve_body(
    resolve: &Resolve<'_>,
    tile: &TileRect,
    start: usize,
    buffers: &PaintBuffers,
    group_coverage: &[f32],
    film: &mut TileFilm,
) {
    let channels = resolve.channels.count;
    let row = buffers.row;
    film.values.resize(resolve.planes.count * TILE * TILE, 0.0);
    for y in 0..tile.height {
        for x in (0..tile.width).step_by(LANES) {
            let open = buffers.open[y] >> x & 0xff;
            let rim = buffers.rim[y] >> x & 0xff;
            let mut left = [1.0_f32; LANES];
            let last = if open == 0 { [0; LANES] } else { last_layers(buffers, y * row + x) };
            for layer in DepthLayer::ALL {
                if open == 0 && layer != DepthLayer::Band {
                    continue;
                }
                let rows = Rows::new(&buffers.sums[layer as usize], row, y, tile).of_layer(layer == DepthLayer::Band);
                let sums = rows.own;
                let plane = |channel: usize| lanes(&sums[channel * STRIDE + x..]);
                let weights = plane(0);
                if weights.iter().all(|&weight| weight == 0.0) {
                    continue;
                }
                let inverse = weights.map(|weight| if weight > 0.0 { 1.0 / weight } else { 0.0 });
                let mut share = [0.0; LANES];
                if open == 0 {
                    // Solid: the band covers all.
                    share = weights.map(|weight| if weight > 0.0 { 1.0 } else { 0.0 });
                } else {
                    let first = lanes(&buffers.threshold[start + y * APRON_STRIDE + x..]);
                    let covered = match layer {
                        DepthLayer::Front => [false; LANES],
                        DepthLayer::Band => first.map(|depth| depth < f32::INFINITY),
                        DepthLayer::Second => {
                            lanes(&buffers.second[y * STRIDE + x..]).map(|depth| depth < f32::INFINITY)
                        }
                        DepthLayer::Rest => plane(channels + DISC).map(|discs| discs > 0.0),
                    };
                    let (peaks, sides) = (plane(channels + PEAK), plane(channels + SIDE));
                    for l in 0..LANES {
                        let weight = weights[l];
                        let coverage = coverage(weight, sides[l], peaks[l] * inverse[l], covered[l]);
                        // Where discs cover all around, the last layer closes what is left: the surface has no holes.
                        let closes = open >> l & 1 == 0 || rim >> l & 1 == 0 && last[l] == layer as u8;
                        let coverage = if closes { 1.0 } else { coverage };
                        let coverage = if coverage < left[l] { coverage } else { left[l] };
                        share[l] = if weight > 0.0 { coverage } else { 0.0 };
                        left[l] -= share[l];
                    }
                }
                let mut weight = resolve.weight;
                if let Some(coverage) = group_coverage.get(y * STRIDE + x..).filter(|rest| !rest.is_empty()) {
                    share = lanes(coverage);
                    weight = 1.0;
                }
                add_lanes(resolve, tile, [x, y], rows, &inverse, &share, weight, film);
            }
        }
    }
}

/// Share of a pixel that a group of splats covers: `weight` and `side` are its sums, `peak` is what filtering leaves of
/// the kernels' peaks in the mean, and `covered` says whether a disc covers the pixel.
#[inline(always)]
pub(in crate::backend) fn coverage(weight: f32, side: f32, peak: f32, covered: bool) -> f32 {
    // A thin sheet has both sides, which cover once.
    let sum = 0.5 * (weight + side.abs());
    // Discs tell outlines better than sums, which miss what kernels lose towards their rims. Where filtering leaves a
    // share p of the peaks, discs count p + p (1 - p).
    let lost = 1.0 - peak;
    let hard = 1.0 - lost * lost;
    hard * f32::from(covered) + (1.0 - hard) * if sum < 1.0 { sum } else { 1.0 }
}

/// For each of the pixels whose sums begin at `at` the last layer that has weight.
#[inline(always)]
fn last_layers(buffers: &PaintBuffers, at: usize) -> [u8; LANES] {
    let mut last = [0; LANES];
    for (layer, sums) in (0..).zip(&buffers.sums) {
        if let Some(weights) = sums.get(at..at + LANES) {
            (0..LANES).for_each(|l| last[l] = if weights[l] > 0.0 { layer } else { last[l] });
        }
    }
    last
}

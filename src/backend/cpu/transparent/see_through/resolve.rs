//! Pass `resolve` of a layer that was peeled off: its groups of splats, normalised and shaded, become a film of their
//! own, as what the layer adds to what is behind it (docs/math.md, section 12).
//!
//! In: a tile's sums and depths, what covers it so far. Out: the layer's film and its depths.

use super::super::accumulators::OPAQUE;
use super::cover::Cover;
use crate::backend::cpu::mirror::Rows;
use crate::backend::cpu::paint::{self, APRON_STRIDE, DepthLayer, PEAK, PaintBuffers, SIDE};
use crate::backend::cpu::resolve::{Resolve, TileFilm, add_lanes};
use crate::backend::cpu::tiles::{LANES, ROWS, STRIDE, TILE, TileRect, lanes};
use crate::math::simd::dispatch;

/// What was summed up of a layer.
#[derive(Clone, Copy)]
pub(super) struct Peeled<'a> {
    /// Where the tile begins in planes with an apron.
    pub start: usize,
    pub buffers: &'a PaintBuffers,
    /// Coverage by a group's samples together, weights included; empty for a group of one sample.
    pub group_coverage: &'a [f32],
    /// What makes that a mean.
    pub scale: f32,
    /// T(x) of opaque surfels; empty where there are none.
    pub ceiling: &'a [f32],
}

/// What was found in a layer.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Found {
    /// Does it show anything?
    pub shown: bool,
    /// May anything show behind it?
    pub more: bool,
}

dispatch! {
    /// Makes the film of a layer.
    pub(super) fn resolve(
        resolve: &Resolve<'_>, tile: &TileRect, peeled: &Peeled<'_>, cover: &mut Cover, film: &mut TileFilm,
    ) -> Found = resolve_body
}

#[inline(always)]
fn resolve_body(
    resolve: &Resolve<'_>,
    tile: &TileRect,
    peeled: &Peeled<'_>,
    cover: &mut Cover,
    film: &mut TileFilm,
) -> Found {
    let &Peeled { start, buffers, group_coverage, scale, ceiling } = peeled;
    let channels = resolve.channels.count;
    let opacity = resolve.channels.opacity.unwrap_or(0);
    let row = buffers.row;
    film.values.resize(resolve.planes.count * TILE * TILE, 0.0);
    film.threshold.resize(ROWS * STRIDE, f32::INFINITY);
    let mut found = Found::default();
    for y in 0..tile.height {
        for x in (0..tile.width).step_by(LANES) {
            let open = buffers.open[y] >> x & 0xff;
            let at = y * STRIDE + x;
            let depth = lanes(&buffers.threshold[start + y * APRON_STRIDE + x..]);
            film.threshold[at..at + LANES].copy_from_slice(&depth);
            let mut covers = cover.load(at);
            let before: [f32; LANES] = std::array::from_fn(|l| covers.through(l));
            for layer in [DepthLayer::Front, DepthLayer::Band] {
                if open == 0 && layer == DepthLayer::Front {
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
                let (peaks, sides) = (plane(channels + PEAK), plane(channels + SIDE));
                let opacities = plane(opacity);
                let mut share = [0.0; LANES];
                for l in 0..LANES {
                    let covered = layer == DepthLayer::Band && depth[l] < f32::INFINITY;
                    let soft = paint::resolve::coverage(weights[l], sides[l], peaks[l] * inverse[l], covered);
                    let coverage = if open >> l & 1 == 0 { 1.0 } else { soft };
                    let coverage = group_coverage.get(at + l).map_or(coverage, |coverage| coverage * scale);
                    if weights[l] > 0.0 && before[l] >= OPAQUE {
                        let own = opacities[l] * inverse[l];
                        share[l] = own * covers.put(l, coverage, own) / before[l];
                        found.shown |= share[l] > 0.0;
                    }
                }
                add_lanes(resolve, tile, [x, y], rows, &inverse, &share, 1.0, film);
            }
            cover.store(at, &covers);
            for l in 0..LANES.min(tile.width - x) {
                let hidden = ceiling.get(at + l).is_some_and(|&ceiling| depth[l] > ceiling);
                found.more |= depth[l] < f32::INFINITY && !hidden && covers.through(l) >= OPAQUE;
            }
        }
    }
    found
}

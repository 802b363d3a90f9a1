//! Pass `resolve`, swept: the coverage mask becomes coverage; colours that are normalised once are pooled
//! (docs/math.md, section 7).
//!
//! In: a tile's sums and coverage mask. Out: its coverage, or its film. One sample position at a time, order-free.

use crate::backend::cpu::resolve::{TileFilm, resolve};
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::tile_buffers::CoverageMask;
use crate::backend::cpu::tiles::{LANES, STRIDE, TILE, TileRect};
use crate::film::FilmPlanes;
use crate::layout::Channels;
use crate::math::simd::dispatch;
use crate::options::Normalise;
use crate::plan::PosedInterval;

/// What an interval contributes.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct IntervalExposure<'a> {
    pub interval: &'a PosedInterval,
    /// The interval's share of the exposure.
    pub weight: f32,
    /// Coverage is the sum of weights.
    pub sum: bool,
}

/// By how much sums of weights on a surface may be off from 1, over the square of the mean peak of the kernels. The
/// filter evens out small kernels, which are many.
pub(in crate::backend) const NOISE: f32 = 2.0;

dispatch! {
    /// The share of the exposure that each pixel of a tile is covered for, `TILE` rows of `STRIDE`.
    pub(in crate::backend) fn coverage(
        exposure: &IntervalExposure<'_>, coverage_mask: &CoverageMask, out: &mut Vec<f32>,
    ) = coverage_body
}

#[inline(always)]
fn coverage_body(exposure: &IntervalExposure<'_>, coverage_mask: &CoverageMask, out: &mut Vec<f32>) {
    out.clear();
    out.resize(TILE * STRIDE, 0.0);
    let CoverageMask { surface, filtered, loose, peak, side } = coverage_mask;
    if exposure.sum {
        out.iter_mut().zip(loose).for_each(|(out, loose)| *out = exposure.weight * loose);
        return;
    }
    let bits = surface.chunks_exact(LANES).zip(filtered.chunks_exact(LANES));
    let weights = loose.chunks_exact(LANES).zip(peak.chunks_exact(LANES)).zip(side.chunks_exact(LANES));
    for (((surface, filtered), ((sum, peak), side)), out) in bits.zip(weights).zip(out.chunks_exact_mut(LANES)) {
        let mut by_discs = [0.0_f32; LANES];
        let mut most = [0.0_f32; LANES];
        for (i, &share) in exposure.interval.moments.iter().enumerate() {
            for l in 0..LANES {
                let bit = surface[l] >> i & 1;
                let any = (surface[l] | filtered[l]) >> i & 1;
                by_discs[l] += if bit == 1 { share } else { 0.0 };
                most[l] += if any == 1 { share } else { 0.0 };
            }
        }
        for l in 0..LANES {
            let by_discs = if surface[l] == u32::MAX { exposure.weight } else { by_discs[l] };
            let most = if surface[l] | filtered[l] == u32::MAX { exposure.weight } else { most[l] };
            let large = if sum[l] > 0.0 { peak[l] / sum[l] } else { 1.0 };
            let hard = 1.0 - (1.0 - large) * (1.0 - large);
            // A thin two-sided sheet counts with the larger of its sides' sums.
            let weight = exposure.weight * (0.5 * (sum[l] + side[l].abs()));
            // The time for which discs cover, as far as the weights may be off by noise.
            let noise = 1.0 + NOISE * (large * large);
            let (low, high) = (weight / noise, weight * noise);
            let soft = if by_discs < high { by_discs } else { high };
            let soft = if soft > low { soft } else { low };
            let soft = if soft < most { soft } else { most };
            out[l] = hard * by_discs + (1.0 - hard) * soft;
        }
    }
}

/// Adds one interval to the tile's film: normalised and shaded, or pooled with the other intervals where colours are
/// divided once.
pub(in crate::backend::cpu) fn add_to_film(
    scope: &Scope<'_>,
    normalise: Normalise,
    tile: &TileRect,
    sums: &[f32],
    coverage: &[f32],
    film: &mut TileFilm,
) {
    match normalise {
        Normalise::Once => pool(scope.weight(), scope.channels, scope.planes, tile, sums, coverage, &mut film.values),
        Normalise::Interval => resolve(&scope.resolve(), tile, sums, coverage, film),
    }
}

/// Adds one interval's sums, as they are, to the tile's film.
fn pool(
    weight: f32,
    channels: &Channels,
    planes: &FilmPlanes,
    tile: &TileRect,
    sums: &[f32],
    coverage: &[f32],
    film: &mut Vec<f32>,
) {
    film.resize(planes.count * TILE * TILE, 0.0);
    let mut places = vec![(1, 0), (2, 1), (3, 2)];
    places.extend(planes.weight.map(|plane| (0, plane)));
    places.extend(channels.depth.zip(planes.depth));
    places
        .extend(channels.normal.zip(planes.normal).into_iter().flat_map(|(c, p)| (0..3).map(move |i| (c + i, p + i))));
    places.extend(
        channels.velocity.zip(planes.velocity).into_iter().flat_map(|(c, p)| (0..2).map(move |i| (c + i, p + i))),
    );
    for y in 0..tile.height {
        let row = &sums[y * channels.count * STRIDE..][..channels.count * STRIDE];
        let out = |plane: usize| (plane * TILE + y) * TILE..(plane * TILE + y) * TILE + tile.width;
        for &(channel, plane) in &places {
            let sums = &row[channel * STRIDE..][..tile.width];
            film[out(plane)].iter_mut().zip(sums).for_each(|(film, sum)| *film += weight * sum);
        }
        let coverage = &coverage[y * STRIDE..][..tile.width];
        film[out(3)].iter_mut().zip(coverage).for_each(|(film, coverage)| *film += coverage);
    }
}

/// After all intervals: clamps coverage, and divides what was pooled by the sum of weights.
pub(in crate::backend) fn finish(planes: &FilmPlanes, film: &mut [f32]) {
    if film.is_empty() {
        return;
    }
    for pixel in 0..TILE * TILE {
        let at = |plane: usize| plane * TILE * TILE + pixel;
        let alpha = film[at(3)].min(1.0);
        let total = film[at(planes.weight.unwrap_or(3))];
        let scale = if total > 0.0 { alpha / total } else { 0.0 };
        for plane in (0..planes.count).filter(|&plane| plane != 3) {
            film[at(plane)] *= scale;
        }
        film[at(3)] = alpha;
    }
}

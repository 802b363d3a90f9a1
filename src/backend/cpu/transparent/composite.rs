//! Pass `composite`: the splats of a tile, front to back: C += T a c, then T *= 1 - a (docs/math.md, section 9).
//!
//! In: splats in the order of depth; depth thresholds of opaque surfels. Out: premultiplied colour and transmittance of
//! each pixel. The order of splats matters; pixels do not know one another.

use super::project::FAINTEST;
use crate::backend::cpu::tiles::{LANES, STRIDE, TILE, TileRect};
use crate::layout::GaussianSplat;
use crate::math::fast;
use crate::math::simd::dispatch;

/// Largest alpha of a splat (Kerbl et al. 2023, their program).
const MOST_ALPHA: f32 = 0.99;
/// A pixel whose transmittance is below this takes no more.
const OPAQUE: f32 = 1e-4;

/// What the pixels of a tile accumulate: for each of `TILE` rows, for each channel, `STRIDE` floats.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Composite {
    values: Vec<f32>,
    channels: usize,
}

/// Channels: transmittance, red, green, blue, and where they are wanted the depth, then the velocity.
const COLOUR: usize = 1;
const DEPTH: usize = 4;

impl Composite {
    /// Floats of one pixel row of a tile, at most.
    const MOST_CHANNELS: usize = 7;

    /// Bytes of one tile at most.
    pub(super) const BYTES: u64 = (TILE * STRIDE * Self::MOST_CHANNELS * size_of::<f32>()) as u64;

    /// Empties it. `depth`, `velocity`: are they wanted?
    pub(super) fn clear(&mut self, depth: bool, velocity: bool) {
        self.channels = match (depth, velocity) {
            (_, true) => 7,
            (true, false) => 5,
            (false, false) => 4,
        };
        self.values.clear();
        self.values.resize(TILE * STRIDE * self.channels, 0.0);
        for row in self.values.chunks_exact_mut(STRIDE * self.channels) {
            row[..STRIDE].fill(1.0);
        }
    }

    /// `LANES` pixels of a channel, from pixel `[x, y]` of the tile on.
    #[inline(always)]
    pub(super) fn lanes(&self, channel: usize, [x, y]: [usize; 2]) -> [f32; LANES] {
        let mut out = [0.0; LANES];
        out.copy_from_slice(&self.values[(y * self.channels + channel) * STRIDE + x..][..LANES]);
        out
    }

    /// First of three channels.
    pub(super) const fn colour() -> usize {
        COLOUR
    }

    /// That of depth, if it has one.
    pub(super) fn depth(&self) -> Option<usize> {
        (self.channels > DEPTH).then_some(DEPTH)
    }

    /// First of two channels, if it has them.
    pub(super) fn velocity(&self) -> Option<usize> {
        (self.channels > DEPTH + 1).then_some(DEPTH + 1)
    }
}

/// Splats of one tile that are composited together.
#[derive(Debug, Default)]
pub(super) struct Batch {
    splats: Vec<GaussianSplat>,
    velocities: Vec<[f32; 2]>,
}

impl Batch {
    /// Splats of a full one.
    pub(super) const SIZE: usize = 64;

    pub(super) fn clear(&mut self) {
        self.splats.clear();
        self.velocities.clear();
    }

    pub(super) fn push(&mut self, splat: &GaussianSplat, velocity: Option<&[f32; 2]>) {
        self.splats.push(*splat);
        self.velocities.extend(velocity);
    }

    pub(super) fn is_full(&self) -> bool {
        self.splats.len() >= Self::SIZE
    }

    pub(super) fn is_empty(&self) -> bool {
        self.splats.is_empty()
    }
}

/// A tile and where its pixels are sampled.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place<'a> {
    pub tile: &'a TileRect,
    /// Offset of the sample position from the pixels' centres, raster pixels.
    pub offset: [f32; 2],
    /// T(x) of opaque surfels, as `TileBuffers` have it; empty where there are none.
    pub threshold: &'a [f32],
}

dispatch! {
    /// Composites the splats of `batch` behind what is there. Says whether any pixel can take more.
    pub(super) fn composite(batch: &Batch, place: &Place<'_>, out: &mut Composite) -> bool = composite_body
}

#[inline(always)]
fn composite_body(batch: &Batch, place: &Place<'_>, out: &mut Composite) -> bool {
    match (out.channels, place.threshold.is_empty()) {
        (4, true) => all::<4, false>(batch, place, out),
        (4, false) => all::<4, true>(batch, place, out),
        (5, true) => all::<5, false>(batch, place, out),
        (5, false) => all::<5, true>(batch, place, out),
        (_, true) => all::<7, false>(batch, place, out),
        (_, false) => all::<7, true>(batch, place, out),
    }
    let furthest = batch.splats.last().map_or(0.0, |splat| splat.depth);
    let tile = place.tile;
    (0..tile.height).any(|y| {
        let through = &out.values[y * out.channels * STRIDE..][..tile.width];
        match place.threshold.get(y * STRIDE..) {
            Some(limits) if !limits.is_empty() => {
                through.iter().zip(limits).any(|(&through, &limit)| through >= OPAQUE && limit >= furthest)
            }
            _ => through.iter().any(|&through| through >= OPAQUE),
        }
    })
}

#[inline(always)]
fn all<const CHANNELS: usize, const BEHIND: bool>(batch: &Batch, place: &Place<'_>, out: &mut Composite) {
    for (index, splat) in batch.splats.iter().enumerate() {
        let velocity = if CHANNELS > 5 { batch.velocities[index] } else { [0.0; 2] };
        one::<CHANNELS, BEHIND>(splat, velocity, place, &mut out.values);
    }
}

/// One splat. `BEHIND`: some of it may lie behind opaque surfels.
#[inline(always)]
fn one<const CHANNELS: usize, const BEHIND: bool>(
    splat: &GaussianSplat,
    velocity: [f32; 2],
    place: &Place<'_>,
    out: &mut [f32],
) {
    let [left, top] = place.tile.origin;
    let [x0, x1, y0, y1] = splat.bounds.map(usize::from);
    let (x0, x1) = (x0.max(left) - left, x1.min(left + place.tile.width - 1) - left);
    let (y0, y1) = (y0.max(top) - top, y1.min(top + place.tile.height - 1) - top);
    let faintest = -FAINTEST.log2();
    let &GaussianSplat { along, slope, across, peak, depth, colour, .. } = splat;
    let shift = |axis: usize, pixel: usize| pixel as f32 + 0.5 - splat.reference[axis] + place.offset[axis];
    let mut first = [0.0; LANES];
    for l in 0..LANES {
        first[l] = shift(0, left + x0) + l as f32;
    }
    for y in y0..=y1 {
        let dy = shift(1, top + y);
        let row = &mut out[y * CHANNELS * STRIDE..][..CHANNELS * STRIDE];
        let mut x = x0;
        while x <= x1 {
            let step = (x - x0) as f32;
            let mut through = [0.0; LANES];
            through.copy_from_slice(&row[x..x + LANES]);
            let mut limit = [0.0; LANES];
            if BEHIND {
                limit.copy_from_slice(&place.threshold[y * STRIDE + x..][..LANES]);
            }
            let mut share = [0.0; LANES];
            for l in 0..LANES {
                let dx = first[l] + step;
                let away = dy - slope * dx;
                let power = peak - along * (dx * dx) - across * (away * away);
                let alpha = fast::exp2_of_small(power);
                let alpha = if alpha < MOST_ALPHA { alpha } else { MOST_ALPHA };
                let mut shows = (power >= faintest) & (through[l] >= OPAQUE);
                if BEHIND {
                    shows &= depth <= limit[l];
                }
                let alpha = if shows { alpha } else { 0.0 };
                share[l] = through[l] * alpha;
                through[l] -= share[l];
            }
            row[x..x + LANES].copy_from_slice(&through);
            let mut add = |channel: usize, value: f32| {
                let out = &mut row[channel * STRIDE + x..][..LANES];
                for l in 0..LANES {
                    out[l] += share[l] * value;
                }
            };
            add(COLOUR, colour[0]);
            add(COLOUR + 1, colour[1]);
            add(COLOUR + 2, colour[2]);
            if CHANNELS > DEPTH {
                add(DEPTH, depth);
            }
            if CHANNELS > DEPTH + 1 {
                add(DEPTH + 1, velocity[0]);
                add(DEPTH + 2, velocity[1]);
            }
            x += LANES;
        }
    }
}

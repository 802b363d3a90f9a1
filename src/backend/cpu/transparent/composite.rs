//! Pass `composite`: the splats of a tile, front to back: C += T a c, then T *= 1 - a (docs/math.md, section 11).
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
    /// A bit for each block of `BLOCK` pixels, row by row, in which no pixel can take more.
    closed: u32,
}

/// Columns and rows of pixels that are closed together. A tile has 4 x 8 of them, as many as a mask has bits.
const BLOCK: [usize; 2] = [8, 4];
const BLOCKS_X: usize = TILE / BLOCK[0];
const _: () = assert!(BLOCKS_X == 4 && TILE / BLOCK[1] == 8);

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
        self.closed = 0;
        self.values.clear();
        self.values.resize(TILE * STRIDE * self.channels, 0.0);
        for row in self.values.chunks_exact_mut(STRIDE * self.channels) {
            row[..STRIDE].fill(1.0);
        }
    }

    /// Can pixels within `bounds` take more? `bounds` are those of a splat that touches the tile.
    #[inline(always)]
    pub(super) fn is_open(&self, bounds: [u16; 4], tile: &TileRect) -> bool {
        blocks(within(bounds, tile)) & !self.closed != 0
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

    /// Splats that still fit.
    pub(super) fn room(&self) -> usize {
        Self::SIZE.saturating_sub(self.splats.len())
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
    /// Do depths rise? Those of a bucket's samples need not: their order is that of its middle.
    pub rising: bool,
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
    let last = batch.splats.last().filter(|_| place.rising);
    let furthest = last.map_or(f32::NEG_INFINITY, |splat| splat.depth);
    out.close(place, furthest);
    out.closed != u32::MAX
}

impl Composite {
    /// Finds the blocks that take nothing from depth `furthest` on.
    #[inline(always)]
    fn close(&mut self, place: &Place<'_>, furthest: f32) {
        let [columns, rows] = [place.tile.width, place.tile.height];
        for block in 0..u32::BITS as usize {
            if self.closed >> block & 1 == 1 {
                continue;
            }
            let [x, y] = [block % BLOCKS_X * BLOCK[0], block / BLOCKS_X * BLOCK[1]];
            let mut open = false;
            for y in y..(y + BLOCK[1]).min(rows) {
                let through = &self.values[y * self.channels * STRIDE + x..][..BLOCK[0]];
                let mut least = [f32::INFINITY; BLOCK[0]];
                if let Some(limits) = place.threshold.get(y * STRIDE + x..y * STRIDE + x + BLOCK[0]) {
                    least.copy_from_slice(limits);
                }
                for l in 0..BLOCK[0] {
                    open |= (through[l] >= OPAQUE) & (least[l] >= furthest) & (x + l < columns);
                }
            }
            self.closed |= u32::from(!open) << block;
        }
    }
}

/// Columns and rows of `bounds` within a tile, counted from its corner.
#[inline(always)]
fn within(bounds: [u16; 4], tile: &TileRect) -> [usize; 4] {
    let [left, top] = tile.origin;
    let [x0, x1, y0, y1] = bounds.map(usize::from);
    let (right, bottom) = (left + tile.width - 1, top + tile.height - 1);
    [x0.max(left) - left, x1.min(right) - left, y0.max(top) - top, y1.min(bottom) - top]
}

/// The blocks of the pixels between columns `x0` and `x1` and rows `y0` and `y1`.
#[inline(always)]
const fn blocks([x0, x1, y0, y1]: [usize; 4]) -> u32 {
    let columns = (2 << (x1 / BLOCK[0])) - (1 << (x0 / BLOCK[0]));
    let below = u32::MAX << (y0 / BLOCK[1] * BLOCKS_X);
    let above = u32::MAX >> ((TILE / BLOCK[1] - 1 - y1 / BLOCK[1]) * BLOCKS_X);
    (columns * 0x1111_1111) & below & above
}

#[inline(always)]
fn all<const CHANNELS: usize, const BEHIND: bool>(batch: &Batch, place: &Place<'_>, out: &mut Composite) {
    for (index, splat) in batch.splats.iter().enumerate() {
        let velocity = if CHANNELS > 5 { batch.velocities[index] } else { [0.0; 2] };
        one::<CHANNELS, BEHIND>(splat, velocity, place, out);
    }
}

/// One splat. `BEHIND`: some of it may lie behind opaque surfels.
#[inline(always)]
fn one<const CHANNELS: usize, const BEHIND: bool>(
    splat: &GaussianSplat,
    velocity: [f32; 2],
    place: &Place<'_>,
    out: &mut Composite,
) {
    let [left, top] = place.tile.origin;
    let [x0, x1, y0, y1] = within(splat.bounds, place.tile);
    if blocks([x0, x1, y0, y1]) & !out.closed == 0 {
        return;
    }
    let out = &mut out.values;
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

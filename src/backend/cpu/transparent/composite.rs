//! Pass `composite`: the splats of a tile, front to back: C += T a c, then T *= 1 - a (docs/math.md, sections 11 and
//! 12).
//!
//! In: splats in the order of depth; depth thresholds of opaque surfels; layers of see-through surfels. Out:
//! premultiplied colour and transmittance of each pixel. The order of splats matters; pixels do not know one another.

use super::accumulators::{COLOUR, Composite, DEPTH, Surfels, blocks, within};
use super::project::{FAINTEST, least_power};
use crate::backend::cpu::tiles::{LANES, STRIDE, TileRect};
use crate::layout::GaussianSplat;
use crate::math::fast;
use crate::math::simd::dispatch;

/// Largest alpha of a splat (Kerbl et al. 2023, their program).
const MOST_ALPHA: f32 = 0.99;
/// A pixel whose transmittance is below this takes no more.
pub(super) const OPAQUE: f32 = 1e-4;

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
    pub surfels: Surfels<'a>,
}

dispatch! {
    /// Composites the splats of `batch` behind what is there. Says whether any pixel can take more.
    pub(super) fn composite(batch: &Batch, place: &Place<'_>, out: &mut Composite) -> bool = composite_body
}

#[inline(always)]
fn composite_body(batch: &Batch, place: &Place<'_>, out: &mut Composite) -> bool {
    match (out.own_channels(), out.limit.is_empty()) {
        (4, true) => all::<4, false>(batch, place, out),
        (4, false) => all::<4, true>(batch, place, out),
        (5, true) => all::<5, false>(batch, place, out),
        (5, false) => all::<5, true>(batch, place, out),
        (_, true) => all::<7, false>(batch, place, out),
        (_, false) => all::<7, true>(batch, place, out),
    }
    let last = batch.splats.last().filter(|_| place.rising);
    let furthest = last.map_or(f32::NEG_INFINITY, |splat| splat.depth);
    out.close(place.tile, furthest);
    out.closed != u32::MAX
}

#[inline(always)]
fn all<const CHANNELS: usize, const SURFELS: bool>(batch: &Batch, place: &Place<'_>, out: &mut Composite) {
    for (index, splat) in batch.splats.iter().enumerate() {
        let velocity = if CHANNELS > 5 { batch.velocities[index] } else { [0.0; 2] };
        if splat.layer > 0.0 {
            one::<CHANNELS, SURFELS, true>(splat, velocity, place, out);
        } else {
            one::<CHANNELS, SURFELS, false>(splat, velocity, place, out);
        }
    }
}

/// One splat. `SURFELS`: there may be surfels in front of it. `VOLUME`: it is a kernel of a volume.
#[inline(always)]
fn one<const CHANNELS: usize, const SURFELS: bool, const VOLUME: bool>(
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
    let &GaussianSplat { along, slope, across, peak, depth, colour, .. } = splat;
    let faintest = if VOLUME { least_power(peak) } else { -FAINTEST.log2() };
    let with_volumes = !out.open.is_empty();
    let row_length = out.channels * STRIDE;
    let shift = |axis: usize, pixel: usize| pixel as f32 + 0.5 - splat.reference[axis] + place.offset[axis];
    let mut first = [0.0; LANES];
    for l in 0..LANES {
        first[l] = shift(0, left + x0) + l as f32;
    }
    for y in y0..=y1 {
        let dy = shift(1, top + y);
        let mut x = x0;
        while x <= x1 {
            let step = (x - x0) as f32;
            let at = y * row_length + x;
            let mut through = [0.0; LANES];
            through.copy_from_slice(&out.values[at..at + LANES]);
            let mut value = [0.0; LANES];
            let mut limit = [f32::INFINITY; LANES];
            if SURFELS {
                limit.copy_from_slice(&out.limit[y * STRIDE + x..][..LANES]);
            }
            for l in 0..LANES {
                let dx = first[l] + step;
                let away = dy - slope * dx;
                let power = peak - along * (dx * dx) - across * (away * away);
                let own = if VOLUME { fast::exp2(power) } else { fast::exp2_of_small(power) };
                let own = if VOLUME || own < MOST_ALPHA { own } else { MOST_ALPHA };
                let mut shows = (power >= faintest) & (through[l] >= OPAQUE);
                if SURFELS {
                    shows &= depth <= limit[l];
                }
                value[l] = if shows { own } else { 0.0 };
            }
            if SURFELS && pass_surfels(place, out, [x, y], depth, &value) {
                through.copy_from_slice(&out.values[at..at + LANES]);
            }
            if VOLUME {
                add_kernel::<CHANNELS>(splat, velocity, out, [x, y], &value);
            } else {
                if with_volumes && close_layers(out, [x, y], &value) {
                    through.copy_from_slice(&out.values[at..at + LANES]);
                }
                let row = &mut out.values[at..];
                for l in 0..LANES {
                    value[l] *= through[l];
                    through[l] -= value[l];
                }
                row[..LANES].copy_from_slice(&through);
                add::<CHANNELS>(row, &value, colour, depth, velocity);
            }
            x += LANES;
        }
    }
}

/// Adds a splat's channels times `shares` to `LANES` pixels of `row`.
#[inline(always)]
fn add<const CHANNELS: usize>(
    row: &mut [f32],
    shares: &[f32; LANES],
    colour: [f32; 3],
    depth: f32,
    velocity: [f32; 2],
) {
    let mut add = |channel: usize, value: f32| {
        let out = &mut row[channel * STRIDE..][..LANES];
        for l in 0..LANES {
            out[l] += shares[l] * value;
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
}

/// Adds a kernel of a volume to the open layers of `LANES` pixels, or opens new ones where it lies behind them.
#[inline(always)]
fn add_kernel<const CHANNELS: usize>(
    splat: &GaussianSplat,
    velocity: [f32; 2],
    out: &mut Composite,
    [x, y]: [usize; 2],
    optical_depth: &[f32; LANES],
) {
    let mut behind = [false; LANES];
    let mut any = false;
    for (l, until) in out.until[y * STRIDE + x..][..LANES].iter().enumerate() {
        behind[l] = (splat.depth > *until) & (optical_depth[l] > 0.0);
        any |= behind[l];
    }
    if any {
        out.close_layers([x, y], &behind);
        let until = &mut out.until[y * STRIDE + x..][..LANES];
        for l in 0..LANES {
            until[l] = if behind[l] { splat.depth + splat.layer } else { until[l] };
        }
    }
    let row = &mut out.open[y * out.channels * STRIDE + x..];
    for l in 0..LANES {
        row[l] += optical_depth[l];
    }
    add::<CHANNELS>(row, optical_depth, splat.colour, splat.depth, velocity);
}

/// Composites the open layers of volumes that a splat with these alphas lies behind. Says whether there were any.
#[inline(always)]
fn close_layers(out: &mut Composite, [x, y]: [usize; 2], alpha: &[f32; LANES]) -> bool {
    let mut wanted = [false; LANES];
    let mut any = false;
    for (l, until) in out.until[y * STRIDE + x..][..LANES].iter().enumerate() {
        wanted[l] = (alpha[l] > 0.0) & (*until > f32::NEG_INFINITY);
        any |= wanted[l];
    }
    if any {
        out.close_layers([x, y], &wanted);
    }
    any
}

/// Composites the layers of surfels before `depth` where a splat shows. Says whether there were any.
#[inline(always)]
fn pass_surfels(place: &Place<'_>, out: &mut Composite, [x, y]: [usize; 2], depth: f32, shown: &[f32; LANES]) -> bool {
    let mut before = [false; LANES];
    let mut any = false;
    for (l, next) in out.next_depth[y * STRIDE + x..][..LANES].iter().enumerate() {
        before[l] = (*next < depth) & (shown[l] > 0.0);
        any |= before[l];
    }
    if any {
        for l in (0..LANES).filter(|&l| before[l]) {
            out.pass_surfels(&place.surfels, [x + l, y], depth);
        }
    }
    any
}

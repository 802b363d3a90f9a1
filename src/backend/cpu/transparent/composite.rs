//! Pass `composite`: the splats of a tile, front to back: C += T a c, then T *= 1 - a (docs/math.md, sections 11 and
//! 12).
//!
//! In: splats in the order of depth; depth thresholds of opaque surfels; layers of see-through surfels. Out:
//! premultiplied colour and transmittance of each pixel. The order of splats matters; pixels do not know one another.

use super::accumulators::{COLOUR, Composite, DEPTH, OPAQUE, RUNS, SurfelLayers, blocks, within};
use super::project::{FAINTEST, Projected, least_power};
use crate::backend::cpu::tiles::{LANES, STRIDE, TileRect, lanes};
use crate::backend::{Pixels, Waste};
use crate::layout::GaussianSplat;
use crate::math::fast;
use crate::math::simd::dispatch;

/// Largest alpha of a splat (Kerbl et al. 2023, their program).
pub(in crate::backend) const MOST_ALPHA: f32 = 0.99;

/// Splats of one tile that are composited together.
#[derive(Debug, Default)]
pub(super) struct SplatBatch {
    splats: Vec<GaussianSplat>,
    velocities: Vec<[f32; 2]>,
}

impl SplatBatch {
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
pub(super) struct SampledTile<'a> {
    pub tile: &'a TileRect,
    /// Offset of the sample position from the pixels' centres, raster pixels.
    pub offset: [f32; 2],
    /// Do depths rise? In a bucket they need not: all its samples have the order of its middle.
    pub rising: bool,
    pub surfels: SurfelLayers<'a>,
}

dispatch! {
    /// Composites the splats of `batch` behind what is there. Says whether any pixel can take more.
    pub(super) fn composite(batch: &SplatBatch, place: &SampledTile<'_>, out: &mut Composite) -> bool = composite_body
}

#[inline(always)]
fn composite_body(batch: &SplatBatch, place: &SampledTile<'_>, out: &mut Composite) -> bool {
    let surfels = !out.limit.is_empty();
    match (out.own_channels(), surfels, out.open.is_empty()) {
        (4, false, true) => all::<4, false, false>(batch, place, out),
        (4, false, false) => all::<4, false, true>(batch, place, out),
        (4, true, true) => all::<4, true, false>(batch, place, out),
        (4, true, false) => all::<4, true, true>(batch, place, out),
        (5, false, true) => all::<5, false, false>(batch, place, out),
        (5, false, false) => all::<5, false, true>(batch, place, out),
        (5, true, true) => all::<5, true, false>(batch, place, out),
        (5, true, false) => all::<5, true, true>(batch, place, out),
        (_, false, true) => all::<7, false, false>(batch, place, out),
        (_, false, false) => all::<7, false, true>(batch, place, out),
        (_, true, true) => all::<7, true, false>(batch, place, out),
        (_, true, false) => all::<7, true, true>(batch, place, out),
    }
    let last = batch.splats.last().filter(|_| place.rising);
    let furthest = last.map_or(f32::NEG_INFINITY, |splat| splat.depth);
    out.close(place.tile, furthest);
    out.closed != u32::MAX
}

/// `SURFELS`: there may be surfels. `VOLUMES`: there may be kernels of volumes.
#[inline(always)]
fn all<const CHANNELS: usize, const SURFELS: bool, const VOLUMES: bool>(
    batch: &SplatBatch,
    place: &SampledTile<'_>,
    out: &mut Composite,
) {
    for (index, splat) in batch.splats.iter().enumerate() {
        let velocity = if CHANNELS > DEPTH + 1 { batch.velocities[index] } else { [0.0; 2] };
        if VOLUMES && splat.layer > 0 {
            one::<CHANNELS, SURFELS, VOLUMES, true>(splat, velocity, place, out);
        } else {
            one::<CHANNELS, SURFELS, VOLUMES, false>(splat, velocity, place, out);
        }
    }
}

type Lanes = [f32; LANES];

/// One splat, in runs of `LANES` pixels that begin at multiples of that: what was written just before is then read as
/// it was written. `VOLUME`: it is a kernel of a volume.
#[inline(always)]
fn one<const CHANNELS: usize, const SURFELS: bool, const VOLUMES: bool, const VOLUME: bool>(
    splat: &GaussianSplat,
    velocity: [f32; 2],
    place: &SampledTile<'_>,
    out: &mut Composite,
) {
    let [left, top] = place.tile.origin;
    let [x0, x1, y0, y1] = within(splat.bounds, place.tile);
    if blocks([x0, x1, y0, y1]) & !out.closed == 0 {
        return;
    }
    let form = Form::of(splat, place.offset);
    let faintest = if VOLUME { least_power(splat.peak) } else { -FAINTEST.log2() };
    let [first, last] = [x0 / LANES * LANES, x1 / LANES * LANES + LANES - 1];
    let has_ladder = VOLUME && form.suits_ladder([left + first, left + last], [top + y0, top + y1]);
    for run in x0 / LANES..=x1 / LANES {
        let x = run * LANES;
        let dx: Lanes = std::array::from_fn(|l| form.dx(left + x + l));
        let mut ladder = Ladder::default();
        if has_ladder {
            ladder = Ladder::start(&form, &dx, form.dy(top + y0));
        }
        for y in y0..=y1 {
            let mut value = [0.0; LANES];
            if has_ladder {
                value = ladder.values(faintest);
                ladder.step();
            } else {
                let dy = form.dy(top + y);
                for l in 0..LANES {
                    let power = form.power(dx[l], dy);
                    let own = fast::exp2_within(power);
                    value[l] = if power >= faintest { own } else { 0.0 };
                }
            }
            if out.is_closed([x, y]) {
                continue;
            }
            if SURFELS {
                let limit = lanes(&out.limit[y * STRIDE + x..]);
                let next = lanes(&out.next_depth[y * STRIDE + x..]);
                for l in 0..LANES {
                    value[l] = if splat.depth <= limit[l] { value[l] } else { 0.0 };
                }
                if any(|l| (value[l] > 0.0) & (next[l] < splat.depth)) {
                    for l in (0..LANES).filter(|&l| value[l] > 0.0 && next[l] < splat.depth) {
                        out.pass_surfels(&place.surfels, [x + l, y], splat.depth);
                    }
                }
            }
            if VOLUME {
                // Pixels that have nothing of the layer before do not change.
                if out.opened[y * RUNS + run] != splat.layer {
                    out.close_layers([x, y], [true; LANES]);
                    out.opened[y * RUNS + run] = splat.layer;
                }
                let open = &mut out.open[y * out.channels * STRIDE + x..];
                let mut depths = lanes(open);
                (0..LANES).for_each(|l| depths[l] += value[l]);
                open[..LANES].copy_from_slice(&depths);
                add::<CHANNELS>(open, &value, splat, velocity);
            } else {
                if VOLUMES {
                    out.close_layers([x, y], std::array::from_fn(|l| value[l] > 0.0));
                }
                let row = &mut out.values[y * out.channels * STRIDE + x..];
                let mut through = lanes(row);
                for l in 0..LANES {
                    let alpha = if value[l] < MOST_ALPHA { value[l] } else { MOST_ALPHA };
                    let alpha = if through[l] >= OPAQUE { alpha } else { 0.0 };
                    value[l] = alpha * through[l];
                    through[l] -= value[l];
                }
                row[..LANES].copy_from_slice(&through);
                add::<CHANNELS>(row, &value, splat, velocity);
            }
        }
    }
}

/// Adds what a splat has, times `shares`, to all channels of `LANES` pixels but the first.
#[inline(always)]
fn add<const CHANNELS: usize>(row: &mut [f32], shares: &Lanes, splat: &GaussianSplat, velocity: [f32; 2]) {
    let [r, g, b] = splat.colour;
    let values = [r, g, b, splat.depth, velocity[0], velocity[1]];
    for (channel, value) in (COLOUR..CHANNELS).zip(values) {
        let out = &mut row[channel * STRIDE..][..LANES];
        for l in 0..LANES {
            out[l] += shares[l] * value;
        }
    }
}

/// The exponent of a splat as a function of the pixel.
struct Form {
    reference: [f32; 2],
    offset: [f32; 2],
    along: f32,
    slope: f32,
    across: f32,
    peak: f32,
}

impl Form {
    #[inline(always)]
    fn of(splat: &GaussianSplat, offset: [f32; 2]) -> Self {
        let &GaussianSplat { reference, along, slope, across, peak, .. } = splat;
        Self { reference, offset, along, slope, across, peak }
    }

    #[inline(always)]
    fn dx(&self, column: usize) -> f32 {
        column as f32 + 0.5 - self.reference[0] + self.offset[0]
    }

    #[inline(always)]
    fn dy(&self, row: usize) -> f32 {
        row as f32 + 0.5 - self.reference[1] + self.offset[1]
    }

    #[inline(always)]
    fn power(&self, dx: f32, dy: f32) -> f32 {
        let away = dy - self.slope * dx;
        self.peak - self.along * (dx * dx) - self.across * (away * away)
    }

    /// Are all numbers of a [`Ladder`] between columns and rows of the raster, all included, in the range of floats?
    #[inline(always)]
    fn suits_ladder(&self, columns: [usize; 2], rows: [usize; 2]) -> bool {
        const MOST: f32 = 100.0;
        let larger = |[a, b]: [f32; 2]| if a.abs() > b.abs() { a.abs() } else { b.abs() };
        let (dx, dy) = (larger(columns.map(|x| self.dx(x))), larger(rows.map(|y| self.dy(y))));
        let tilt = self.slope.abs() * dx;
        let falls = self.along * (dx * dx) + self.across * ((dy + tilt) * (dy + tilt)) - self.peak;
        (falls < MOST) & (2.0 * self.across * tilt < MOST) & (self.across * (2.0 * dy + 1.0) < MOST)
    }
}

/// The values of a splat, row after row, by one product for each: the exponent is quadratic, so the factor from one row
/// to the next changes by a factor that stays.
#[derive(Default)]
struct Ladder {
    values: Lanes,
    /// Factor to the next row: a part that depends on the column, and one that does not.
    factor: Lanes,
    common: f32,
    /// Factor of the second part from row to row.
    change: f32,
}

impl Ladder {
    #[inline(always)]
    fn start(form: &Form, dx: &Lanes, dy: f32) -> Self {
        let (mut values, mut factor) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            values[l] = fast::exp2(form.power(dx[l], dy));
            factor[l] = fast::exp2(2.0 * form.across * form.slope * dx[l]);
        }
        let common = fast::exp2(-form.across * (2.0 * dy + 1.0));
        Self { values, factor, common, change: fast::exp2(-2.0 * form.across) }
    }

    /// Those that are not below 2^`faintest`.
    #[inline(always)]
    fn values(&self, faintest: f32) -> Lanes {
        let least = fast::exp2(faintest);
        self.values.map(|value| if value >= least { value } else { 0.0 })
    }

    #[inline(always)]
    fn step(&mut self) {
        for l in 0..LANES {
            self.values[l] *= self.factor[l] * self.common;
        }
        self.common *= self.change;
    }
}

/// What bounds of splats waste whose places of samples are `offset` from the middles of pixels.
pub(super) fn waste(projected: &Projected, offset: [f32; 2]) -> Waste {
    let mut composite = Pixels::default();
    for (splat, bounds) in projected.splats.iter().zip(&projected.bounds) {
        let form = Form::of(splat, offset);
        let faintest = if splat.layer > 0 { least_power(splat.peak) } else { -FAINTEST.log2() };
        let [x0, x1, y0, y1] = bounds.map(usize::from);
        for (x, y) in (y0..=y1).flat_map(|y| (x0..=x1).map(move |x| (x, y))) {
            composite.bounded += 1;
            composite.covered += u64::from(form.power(form.dx(x), form.dy(y)) >= faintest);
        }
    }
    Waste { composite, ..Waste::default() }
}

#[inline(always)]
fn any(holds: impl Fn(usize) -> bool) -> bool {
    let mut any = false;
    for l in 0..LANES {
        any |= holds(l);
    }
    any
}

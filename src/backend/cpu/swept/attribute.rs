//! Pass `attribute`, swept: weighted sums of the attributes of kernels in motion whose source passes the depth test
//! (Wolf 2008, 4.1.2 and 4.2.2; docs/math.md, section 7).
//!
//! In: swept splats of a tile's list, the map of the group, thresholds of static objects, attributes of surfels. Out:
//! the tile's sums, and when the kernels cover. Sums are in list order; the coverage mask is order-free.

use super::hull::Hull;
use super::map::Map;
use crate::backend::cpu::attribute::{Attributes, add};
use crate::backend::cpu::tiles::{CoverageMask, LANES, STRIDE, TileRect};
use crate::layout::{FLAG_LOW_PASS, SweptSplat};
use crate::math::simd::dispatch;
use crate::math::sweep::{Path, Sweep, chord_intensity, ellipsoid_weight, moments, tube_weight};
use crate::options::{KernelShape, KernelWeight, SweptKernel};

/// How kernels weigh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::backend) enum Footprint {
    /// Integral of the tube.
    Tube,
    /// Integral of the ellipsoid.
    Ellipsoid,
    /// The ellipsoid's chord (Wolf 2008, eq. 4.12).
    Chord,
}

impl Footprint {
    /// That of `kernel`.
    pub(in crate::backend) const fn of(kernel: SweptKernel) -> Self {
        match (kernel.weight, kernel.shape) {
            (KernelWeight::Chord, _) => Self::Chord,
            (KernelWeight::Integral, KernelShape::Tube) => Self::Tube,
            (KernelWeight::Integral, KernelShape::Ellipsoid) => Self::Ellipsoid,
        }
    }
}

/// What the pass needs beside splats.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Swept<'a> {
    pub attributes: Attributes<'a>,
    pub footprint: Footprint,
    /// Places of a kernel on one ray whose sources are looked up.
    pub source_samples: u32,
    /// Change of the time weight from the middle of the interval to its end, over its mean.
    pub slope: f32,
    /// Write the sum of weights instead of the times at which kernels cover.
    pub sum: bool,
    pub map: &'a Map,
}

dispatch! {
    /// Adds the swept splats that `list` names to `sums` and `coverage_mask`.
    pub(in crate::backend) fn attribute(
        splats: &[SweptSplat], list: &[u32], swept: &Swept<'_>, tile: &TileRect, threshold: &[f32], sums: &mut [f32],
        coverage_mask: &mut CoverageMask,
    ) = attribute_body
}

#[inline(always)]
fn attribute_body(
    splats: &[SweptSplat],
    list: &[u32],
    swept: &Swept<'_>,
    tile: &TileRect,
    threshold: &[f32],
    sums: &mut [f32],
    coverage_mask: &mut CoverageMask,
) {
    let low_pass = swept.attributes.low_pass > 0.0;
    match swept.footprint {
        Footprint::Tube if low_pass => add_all::<TUBE, true>(splats, list, swept, tile, threshold, sums, coverage_mask),
        Footprint::Tube => add_all::<TUBE, false>(splats, list, swept, tile, threshold, sums, coverage_mask),
        Footprint::Ellipsoid if low_pass => {
            add_all::<ELLIPSOID, true>(splats, list, swept, tile, threshold, sums, coverage_mask);
        }
        Footprint::Ellipsoid => add_all::<ELLIPSOID, false>(splats, list, swept, tile, threshold, sums, coverage_mask),
        Footprint::Chord if low_pass => {
            add_all::<CHORD, true>(splats, list, swept, tile, threshold, sums, coverage_mask);
        }
        Footprint::Chord => add_all::<CHORD, false>(splats, list, swept, tile, threshold, sums, coverage_mask),
    }
}

const TUBE: u8 = 0;
const ELLIPSOID: u8 = 1;
const CHORD: u8 = 2;

#[inline(always)]
fn add_all<const FOOTPRINT: u8, const LOW_PASS: bool>(
    splats: &[SweptSplat],
    list: &[u32],
    swept: &Swept<'_>,
    tile: &TileRect,
    threshold: &[f32],
    sums: &mut [f32],
    coverage_mask: &mut CoverageMask,
) {
    let attributes = &swept.attributes;
    let channels = attributes.channels.count;
    let [left, top] = tile.corner;
    for &index in list {
        let splat = &splats[index as usize];
        let values = attributes.of(index);
        let hull = Hull::of(splat);
        let ray = Ray::of(splat, attributes.near, attributes.low_pass);
        let [_, _, y0, y1] = splat.bounds.map(i32::from);
        for row in y0.max(top)..=y1.min(top + tile.height as i32 - 1) {
            let [x0, x1] = hull.columns(row as f32, row as f32);
            let (x0, x1) = (x0.max(left), x1.min(left + tile.width as i32 - 1));
            let y = (row - top) as usize;
            let out = &mut sums[y * channels * STRIDE..][..channels * STRIDE];
            let mut pixel = x0;
            while pixel <= x1 {
                let x = (pixel - left) as usize;
                for part in 0..swept.source_samples {
                    let mut lanes = Lanes::default();
                    for l in 0..LANES {
                        // As floats: checked additions would block vector code.
                        let place = [pixel as f32 + l as f32, row as f32];
                        ray.meet::<FOOTPRINT, LOW_PASS>(splat, swept, part, place, x1 as f32, &mut lanes, l);
                    }
                    if lanes.covers == [0; LANES] {
                        continue;
                    }
                    lanes.hide(&threshold[y * STRIDE + x..]);
                    lanes.test::<FOOTPRINT>(swept);
                    lanes.mark(swept.sum, y * STRIDE + x, coverage_mask);
                    for (value, plane) in values.iter().zip(out.chunks_exact_mut(STRIDE)) {
                        add(&mut plane[x..], &lanes.weight, *value);
                    }
                    if let Some(depth) = attributes.channels.depth {
                        for l in 0..LANES {
                            lanes.depth[l] *= lanes.weight[l];
                        }
                        add(&mut out[depth * STRIDE + x..], &lanes.depth, 1.0);
                    }
                }
                pixel += LANES as i32;
            }
        }
    }
}

/// Share of its weight that a hidden kernel has. It is nothing beside a visible kernel's weight. Without it a pixel
/// would have no colour where the map, which has one sample a pixel, hides all kernels that cover the pixel.
const HIDDEN: f32 = 1.0 / (1 << 24) as f32;

/// A kernel on the rays through neighbouring pixels. A lane whose ray does not meet it has weight 0 and covers nothing.
#[derive(Default)]
struct Lanes {
    /// Of the colour: the weight, and what it may be at the most however sparse the kernels.
    weight: [f32; LANES],
    most: [f32; LANES],
    /// Of the coverage: what the low-pass disc adds, or for sums the whole weight.
    loose: [f32; LANES],
    /// Mean depth on the ray.
    depth: [f32; LANES],
    /// The pixel nearest the source point, and the depth there that is compared.
    source: [[i32; LANES]; 2],
    source_depth: [f32; LANES],
    /// When the kernel covers, and when its low-pass disc does.
    surface: [u32; LANES],
    low_pass: [u32; LANES],
    /// 1 where anything is met.
    covers: [u32; LANES],
}

/// What is the same for all rays of a splat.
struct Ray {
    near: f32,
    /// (1 + k tau) / w is the depth at tau.
    k: f32,
    /// 1 / k, or as good as infinite.
    inverse_k: f32,
    /// The low-pass disc: its radius, the motion of its centre over the centre's depth (x, y, depth), and the times at
    /// which it is beyond `near`.
    disc: f32,
    drift: [f32; 3],
    disc_span: [f32; 2],
}

impl Ray {
    #[inline(always)]
    fn of(splat: &SweptSplat, near: f32, low_pass: f32) -> Self {
        let i = splat.inverse_depth;
        let m = splat.motion;
        let k = i[0] * m[0] + i[1] * m[1] + i[2] * m[2];
        let inverse_k = reciprocal(k);
        let drift = [m[0] * i[2], m[1] * i[2], m[2] * i[2]];
        let disc = if splat.flags & FLAG_LOW_PASS != 0 { low_pass } else { 0.0 };
        let disc_span = beyond_near(near * i[2] - 1.0, drift[2], reciprocal(drift[2]), [-1.0, 1.0]);
        Self { near, k, inverse_k, disc, drift, disc_span }
    }

    /// Part `part` of the kernel on the ray through the sample position of `pixel`; nothing beyond column `last`.
    #[inline(always)]
    #[allow(clippy::too_many_arguments, reason = "one loop body")]
    fn meet<const FOOTPRINT: u8, const LOW_PASS: bool>(
        &self,
        splat: &SweptSplat,
        swept: &Swept<'_>,
        part: u32,
        pixel: [f32; 2],
        last: f32,
        lanes: &mut Lanes,
        l: usize,
    ) {
        let (x, y) = (pixel[0] + 0.5 - splat.reference[0], pixel[1] + 0.5 - splat.reference[1]);
        let form = |c: [f32; 3]| c[0] * x + (c[1] * y + c[2]);
        let w = form(splat.inverse_depth);
        let path = Path { at: [form(splat.u), form(splat.v)], rate: [form(splat.u_rate), form(splat.v_rate)], w };
        let tube = Sweep::tube(path);
        let span = beyond_near(self.near * w - 1.0, self.k, self.inverse_k, tube.covered());
        let (sweep, weighed) = if FOOTPRINT == TUBE {
            (tube, span)
        } else {
            let ellipsoid = Sweep::ellipsoid(path);
            (ellipsoid, beyond_near(self.near * w - 1.0, self.k, self.inverse_k, ellipsoid.covered()))
        };
        let wanted = pixel[0] <= last;
        let met = wanted & (w > 0.0) & (weighed[0] < weighed[1]);
        let weighed = cut(weighed, part, swept.source_samples);
        let span = if FOOTPRINT == TUBE { weighed } else { cut(span, part, swept.source_samples) };
        let (weight, most, intensity) = weigh::<FOOTPRINT>(&sweep, weighed);
        let tau = 0.5 * (weighed[0] + weighed[1]);
        let time = 1.0 + swept.slope * tau;

        // The low-pass disc: a disc of fixed size in space that faces the viewer, so that it, too, is a swept kernel.
        let d = self.drift;
        let disc = Path { at: [x, y], rate: [x * d[2] - d[0], y * d[2] - d[1]], w: self.disc };
        let disc_sweep = if FOOTPRINT == TUBE { Sweep::tube(disc) } else { Sweep::ellipsoid(disc) };
        let disc_span = disc_sweep.covered();
        let disc_span = [
            if disc_span[0] > self.disc_span[0] { disc_span[0] } else { self.disc_span[0] },
            if disc_span[1] < self.disc_span[1] { disc_span[1] } else { self.disc_span[1] },
        ];
        let disc_met = LOW_PASS & wanted & (self.disc > 0.0) & (disc_span[0] < disc_span[1]);
        let disc_span = cut(disc_span, part, swept.source_samples);
        let (disc_weight, disc_most, disc_intensity) = weigh::<FOOTPRINT>(&disc_sweep, disc_span);
        let disc_tau = 0.5 * (disc_span[0] + disc_span[1]);
        let disc_time = 1.0 + swept.slope * disc_tau;

        let weight = if met { weight * time } else { 0.0 };
        let disc_weight = if disc_met { disc_weight * disc_time } else { 0.0 };
        let larger = disc_weight > weight;
        lanes.weight[l] = if larger { disc_weight } else { weight };
        lanes.most[l] = if larger { disc_most * disc_time } else { most * time };
        lanes.loose[l] = if swept.sum {
            let (all, disc_all) = (weight * intensity, disc_weight * disc_intensity);
            if larger { disc_all } else { all }
        } else if larger {
            disc_weight - weight
        } else {
            0.0
        };

        // The source point, on the splat at mid-interval; of the low-pass disc where the kernel itself is not met.
        let depth = (1.0 + self.k * tau) / w;
        let m = splat.motion;
        let source_depth = depth - m[2] * tau;
        let over = 1.0 / source_depth;
        let near_x = if met { (depth * x - m[0] * tau) * over } else { x + disc_tau * disc.rate[0] };
        let near_y = if met { (depth * y - m[1] * tau) * over } else { y + disc_tau * disc.rate[1] };
        let (column, sample_x) = nearest_sample(near_x, splat.reference[0]);
        let (row, sample_y) = nearest_sample(near_y, splat.reference[1]);
        let i = splat.inverse_depth;
        let there = i[0] * sample_x + (i[1] * sample_y + i[2]);
        let plane_depth = if there > 0.0 { 1.0 / there } else { source_depth };
        let centre_depth = 1.0 / i[2];
        lanes.source[0][l] = column;
        lanes.source[1][l] = row;
        lanes.source_depth[l] = if met { plane_depth } else { centre_depth };
        lanes.depth[l] = if met { depth } else { centre_depth * (1.0 + d[2] * disc_tau) };
        lanes.surface[l] = if met { moments(span) } else { 0 };
        lanes.low_pass[l] = if disc_met { moments(disc_span) } else { 0 };
        lanes.covers[l] = u32::from(met | disc_met);
    }
}

impl Lanes {
    /// Removes kernels that are behind static objects. `threshold`: that of static objects, from the first lane's pixel
    /// on.
    #[inline(always)]
    fn hide(&mut self, threshold: &[f32]) {
        let Some(threshold) = threshold.first_chunk::<LANES>() else { return };
        for l in 0..LANES {
            let shows = if self.depth[l] <= threshold[l] { u32::MAX } else { 0 };
            self.covers[l] &= shows;
            self.surface[l] &= shows;
            self.low_pass[l] &= shows;
            self.loose[l] = if shows == 0 { 0.0 } else { self.loose[l] };
        }
    }

    /// Compares the sources with the map. A hidden kernel loses its weight, but covers, as the surface before it
    /// covers. Weights become shares of the surface at the source.
    #[inline(always)]
    fn test<const FOOTPRINT: u8>(&mut self, swept: &Swept<'_>) {
        let mut limit = [0.0_f32; LANES];
        let mut inverse_density = [0.0_f32; LANES];
        for l in 0..LANES {
            [limit[l], inverse_density[l]] = swept.map.at(self.source[0][l], self.source[1][l]);
        }
        for l in 0..LANES {
            let covers = self.covers[l] != 0;
            let passes = covers & (self.source_depth[l] <= limit[l]);
            let weight = self.weight[l];
            let share = if FOOTPRINT == CHORD { weight } else { weight * inverse_density[l] };
            let share = if (FOOTPRINT == CHORD) | (share < self.most[l]) { share } else { self.most[l] };
            let share = if passes { share } else { share * HIDDEN };
            self.weight[l] = if covers { share } else { 0.0 };
            self.loose[l] = if passes { self.loose[l] } else { 0.0 };
            self.depth[l] = if covers { self.depth[l] } else { 0.0 };
            self.low_pass[l] &= if passes { u32::MAX } else { 0 };
        }
    }

    /// Adds when the lanes are covered, for the pixels from `first` on.
    #[inline(always)]
    fn mark(&self, sum: bool, first: usize, coverage_mask: &mut CoverageMask) {
        if let Some(loose) = coverage_mask.loose.get_mut(first..).and_then(<[f32]>::first_chunk_mut::<LANES>) {
            for l in 0..LANES {
                loose[l] += self.loose[l];
            }
        }
        if sum {
            return;
        }
        for (plane, bits) in
            [(&mut coverage_mask.surface, &self.surface), (&mut coverage_mask.low_pass, &self.low_pass)]
        {
            if let Some(plane) = plane.get_mut(first..).and_then(<[u32]>::first_chunk_mut::<LANES>) {
                for l in 0..LANES {
                    plane[l] |= bits[l];
                }
            }
        }
    }
}

/// Weight over the interval, its greatest value for kernels of peak 1, and what makes it an intensity.
#[inline(always)]
fn weigh<const FOOTPRINT: u8>(sweep: &Sweep, span: [f32; 2]) -> (f32, f32, f32) {
    match FOOTPRINT {
        TUBE => (tube_weight(sweep.mean(span), span), tube_weight(1.0, span), 1.0),
        ELLIPSOID => (ellipsoid_weight(sweep.mean(span), span), ellipsoid_weight(1.0, span), 1.0),
        _ => (sweep.chord(), 1.0, chord_intensity(sweep)),
    }
}

/// `span` without the times at which (1 + k tau) / w is nearer than `near`, given near w - 1.
#[inline(always)]
fn beyond_near(lacks: f32, k: f32, inverse_k: f32, [first, last]: [f32; 2]) -> [f32; 2] {
    let at = lacks * inverse_k;
    let (lower, upper) = if k < 0.0 { (-1.0, at) } else { (at, 1.0) };
    [if first > lower { first } else { lower }, if last < upper { last } else { upper }]
}

/// 1 / v, and large but finite where that is not.
#[inline(always)]
fn reciprocal(v: f32) -> f32 {
    if v.abs() > 1e-30 { 1.0 / v } else { 1e30 }
}

/// Part `part` of `parts` equal ones.
#[inline(always)]
fn cut([first, last]: [f32; 2], part: u32, parts: u32) -> [f32; 2] {
    if parts == 1 {
        return [first, last];
    }
    let step = (last - first) / parts as f32;
    [first + part as f32 * step, first + (part + 1) as f32 * step]
}

/// Index of the pixel whose sample is nearest `offset` from `reference`, and that sample's own offset.
#[inline(always)]
fn nearest_sample(offset: f32, reference: f32) -> (i32, f32) {
    /// Adding it leaves the nearest integer in the low mantissa bits (a saturating cast would block vector code).
    const ROUND: f32 = 12_582_912.0; // 1.5 * 2^23
    const FAR: f32 = 1e6;
    let index = offset + reference - 0.5;
    let index = if index > -FAR { index } else { -FAR };
    let index = if index < FAR { index } else { FAR };
    let shifted = index + ROUND;
    let whole = shifted - ROUND;
    (shifted.to_bits().wrapping_sub(ROUND.to_bits()) as i32, whole + 0.5 - reference)
}

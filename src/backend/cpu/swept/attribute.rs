//! Pass `attribute`, swept: weighted sums of the attributes of kernels in motion that pass the depth test
//! (Wolf 2008, 4.1.2 and 4.2.2; docs/math.md, section 7).
//!
//! In: swept splats of a tile's list, the map of the group, thresholds of static objects and of the interval's slices,
//! attributes of surfels. Out: the tile's sums, and when the kernels cover. Sums are in list order; the coverage mask
//! is order-free.

use super::hull::Hull;
use super::map::Map;
use super::ray::{CHORD, ELLIPSOID, LINE, Lanes, Ray, Sight, TUBE};
use super::slices::{covered, times};
use crate::backend::cpu::attribute::{Attributes, add};
use crate::backend::cpu::tile_buffers::{CoverageMask, Slices};
use crate::backend::cpu::tiles::{LANES, STRIDE, TileRect};
use crate::frame::Raster;
use crate::layout::SweptSplat;
use crate::math::simd::dispatch;
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
    /// The line integral through the ellipsoid (Wolf 2008, eq. C.38).
    Line,
}

impl Footprint {
    /// That of `kernel`.
    pub(in crate::backend) const fn of(kernel: SweptKernel) -> Self {
        match (kernel.weight, kernel.shape) {
            (KernelWeight::Chord, _) => Self::Chord,
            (KernelWeight::Line, _) => Self::Line,
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
    pub raster: &'a Raster,
}

dispatch! {
    /// Adds the swept splats that `list` names to `sums` and `coverage_mask`. The chord and the line have no slices.
    #[allow(clippy::too_many_arguments, reason = "what the loops read and write")]
    pub(in crate::backend) fn attribute(
        splats: &[SweptSplat], list: &[u32], swept: &Swept<'_>, tile: &TileRect, threshold: &[f32], slices: &Slices,
        sums: &mut [f32], coverage_mask: &mut CoverageMask,
    ) = attribute_body
}

#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "what the loops read and write")]
fn attribute_body(
    splats: &[SweptSplat],
    list: &[u32],
    swept: &Swept<'_>,
    tile: &TileRect,
    threshold: &[f32],
    slices: &Slices,
    sums: &mut [f32],
    coverage_mask: &mut CoverageMask,
) {
    let low_pass = swept.attributes.low_pass > 0.0;
    match swept.footprint {
        Footprint::Tube if low_pass => {
            add_all::<TUBE, true>(splats, list, swept, tile, threshold, slices, sums, coverage_mask);
        }
        Footprint::Tube => add_all::<TUBE, false>(splats, list, swept, tile, threshold, slices, sums, coverage_mask),
        Footprint::Ellipsoid if low_pass => {
            add_all::<ELLIPSOID, true>(splats, list, swept, tile, threshold, slices, sums, coverage_mask);
        }
        Footprint::Ellipsoid => {
            add_all::<ELLIPSOID, false>(splats, list, swept, tile, threshold, slices, sums, coverage_mask);
        }
        Footprint::Chord if low_pass => {
            add_all::<CHORD, true>(splats, list, swept, tile, threshold, slices, sums, coverage_mask);
        }
        Footprint::Chord => add_all::<CHORD, false>(splats, list, swept, tile, threshold, slices, sums, coverage_mask),
        Footprint::Line if low_pass => {
            add_all::<LINE, true>(splats, list, swept, tile, threshold, slices, sums, coverage_mask);
        }
        Footprint::Line => add_all::<LINE, false>(splats, list, swept, tile, threshold, slices, sums, coverage_mask),
    }
}

#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "what the loops read and write")]
fn add_all<const FOOTPRINT: u8, const LOW_PASS: bool>(
    splats: &[SweptSplat],
    list: &[u32],
    swept: &Swept<'_>,
    tile: &TileRect,
    threshold: &[f32],
    slices: &Slices,
    sums: &mut [f32],
    coverage_mask: &mut CoverageMask,
) {
    let attributes = &swept.attributes;
    let channels = attributes.channels.count;
    let Raster { axis, offset, focal, .. } = *swept.raster;
    let axis = [axis[0] - offset[0], axis[1] - offset[1]];
    let sight = Sight { source_samples: swept.source_samples, slope: swept.slope, sum: swept.sum, axis, focal };
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
                        ray.meet::<FOOTPRINT, LOW_PASS>(splat, &sight, part, place, x1 as f32, &mut lanes, l);
                    }
                    if lanes.covers == [0; LANES] {
                        continue;
                    }
                    lanes.hide(&threshold[y * STRIDE + x..]);
                    if FOOTPRINT == CHORD || FOOTPRINT == LINE {
                        lanes.test(swept.map);
                    } else {
                        lanes.weigh(swept.map, slices, y, x);
                    }
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
pub(super) const HIDDEN: f32 = 1.0 / (1 << 24) as f32;

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
    /// covers.
    #[inline(always)]
    fn test(&mut self, map: &Map) {
        let mut limit = [0.0_f32; LANES];
        for l in 0..LANES {
            [limit[l], _] = map.at(self.source[0][l], self.source[1][l]);
        }
        for l in 0..LANES {
            let covers = self.covers[l] != 0;
            let passes = covers & (self.source_depth[l] <= limit[l]);
            let weight = if passes { self.weight[l] } else { self.weight[l] * HIDDEN };
            self.weight[l] = if covers { weight } else { 0.0 };
            self.loose[l] = if passes { self.loose[l] } else { 0.0 };
            self.depth[l] = if covers { self.depth[l] } else { 0.0 };
            self.low_pass[l] &= if passes { u32::MAX } else { 0 };
        }
    }

    /// Weighs the kernel by the slices in which it is visible. Where it is hidden it loses its weight, but covers, as
    /// the surface before it covers. Weights become shares of the surface at the source.
    #[inline(always)]
    fn weigh(&mut self, map: &Map, slices: &Slices, y: usize, x: usize) {
        let count = slices.count;
        let bits = 32 / count as u32;
        let of_slice = u32::MAX >> (32 - bits);
        let mut inverse_density = [0.0_f32; LANES];
        for l in 0..LANES {
            [_, inverse_density[l]] = map.at(self.source[0][l], self.source[1][l]);
        }
        let mut shown = [0.0_f32; LANES];
        let mut when = [0_u32; LANES];
        let [from, to] = covered(count, &self.first, &self.last);
        for slice in from..=to {
            let at = (y * count + slice) * STRIDE + x;
            let Some(limit) = slices.threshold.get(at..).and_then(<[f32]>::first_chunk::<LANES>) else { return };
            let share = self.visible(times(count, slice), limit);
            let mask = of_slice << (slice as u32 * bits);
            for l in 0..LANES {
                shown[l] += share[l];
                when[l] |= if share[l] > 0.0 { mask } else { 0 };
            }
        }
        for l in 0..LANES {
            let covers = self.covers[l] != 0;
            let share = self.weight[l] * inverse_density[l];
            let share = if share < self.most[l] { share } else { self.most[l] };
            let part = shown[l] / (self.last[l] - self.first[l]);
            let passes = shown[l] > 0.0;
            let share = share * if passes { part } else { HIDDEN };
            self.weight[l] = if covers { share } else { 0.0 };
            self.loose[l] = if passes { self.loose[l] * part } else { 0.0 };
            self.depth[l] = if covers { self.depth[l] } else { 0.0 };
            self.low_pass[l] &= when[l];
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

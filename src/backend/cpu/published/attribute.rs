//! Pass `attribute` of published kernels in motion: weighted sums of the attributes of those that pass the depth test
//! (Wolf 2008, 4.1.2 and 4.2.2; docs/math.md, section 7).
//!
//! In: swept splats of a tile's list, the map of the group, attributes of surfels. Out: the tile's sums, and when the
//! kernels cover. Sums are in list order; the coverage mask is order-free.

use super::map::Map;
use super::mask::PublishedMask;
use super::ray::{Lanes, Ray, RaySettings};
use crate::backend::cpu::attribute::{Attributes, add};
use crate::backend::cpu::swept::Hull;
use crate::backend::cpu::swept::attribute::HIDDEN;
use crate::backend::cpu::tiles::{LANES, STRIDE, TileRect};
use crate::frame::Raster;
use crate::layout::SweptSplat;
use crate::math::simd::dispatch;

/// What the pass needs beside splats.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Swept<'a> {
    pub attributes: Attributes<'a>,
    pub near: f32,
    /// Radius of low-pass discs, raster pixels; +0 without them.
    pub low_pass: f32,
    /// Does the line integral weigh (Wolf 2008, eq. C.38), instead of the chord (eq. 4.12)?
    pub line: bool,
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
    /// Adds the swept splats that `list` names to `sums` and `mask`.
    pub(in crate::backend) fn attribute(
        splats: &[SweptSplat], list: &[u32], swept: &Swept<'_>, tile: &TileRect, sums: &mut [f32],
        mask: &mut PublishedMask,
    ) = attribute_body
}

#[inline(always)]
fn attribute_body(
    splats: &[SweptSplat],
    list: &[u32],
    swept: &Swept<'_>,
    tile: &TileRect,
    sums: &mut [f32],
    mask: &mut PublishedMask,
) {
    match (swept.line, swept.low_pass > 0.0) {
        (true, true) => add_all::<true, true>(splats, list, swept, tile, sums, mask),
        (true, false) => add_all::<true, false>(splats, list, swept, tile, sums, mask),
        (false, true) => add_all::<false, true>(splats, list, swept, tile, sums, mask),
        (false, false) => add_all::<false, false>(splats, list, swept, tile, sums, mask),
    }
}

#[inline(always)]
fn add_all<const LINE: bool, const LOW_PASS: bool>(
    splats: &[SweptSplat],
    list: &[u32],
    swept: &Swept<'_>,
    tile: &TileRect,
    sums: &mut [f32],
    mask: &mut PublishedMask,
) {
    let attributes = &swept.attributes;
    let channels = attributes.channels.count;
    let Raster { axis, offset, focal, .. } = *swept.raster;
    let axis = [axis[0] - offset[0], axis[1] - offset[1]];
    let sight = RaySettings { source_samples: swept.source_samples, slope: swept.slope, sum: swept.sum, axis, focal };
    let [left, top] = tile.corner;
    for &index in list {
        let splat = &splats[index as usize];
        let values = attributes.of(index);
        let hull = Hull::of(splat);
        let ray = Ray::of(splat, swept.near, swept.low_pass);
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
                        ray.meet::<LINE, LOW_PASS>(splat, &sight, part, place, x1 as f32, &mut lanes, l);
                    }
                    if lanes.covers == [0; LANES] {
                        continue;
                    }
                    lanes.test(swept.map);
                    lanes.mark(swept.sum, y * STRIDE + x, mask);
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

impl Lanes {
    /// Compares the sources with the map. A hidden kernel loses its weight, but covers, as the surface before it
    /// covers.
    #[inline(always)]
    fn test(&mut self, map: &Map) {
        let mut limit = [0.0_f32; LANES];
        for l in 0..LANES {
            limit[l] = map.at(self.source[0][l], self.source[1][l]);
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

    /// Adds when the lanes are covered, for the pixels from `first` on.
    #[inline(always)]
    fn mark(&self, sum: bool, first: usize, mask: &mut PublishedMask) {
        if let Some(loose) = mask.loose.get_mut(first..).and_then(<[f32]>::first_chunk_mut::<LANES>) {
            for l in 0..LANES {
                loose[l] += self.loose[l];
            }
        }
        if sum {
            return;
        }
        for (plane, bits) in [(&mut mask.surface, &self.surface), (&mut mask.low_pass, &self.low_pass)] {
            if let Some(plane) = plane.get_mut(first..).and_then(<[u32]>::first_chunk_mut::<LANES>) {
                for l in 0..LANES {
                    plane[l] |= bits[l];
                }
            }
        }
    }
}

//! Slices of an interval: what of the kernels in motion is visible at a pixel, slice by slice (docs/math.md, section
//! 7).
//!
//! Pass `visibility`: the depth threshold of each slice at each pixel, and the least depth where objects have several
//! tolerances. In: swept splats of a tile's list. Out: the tile's thresholds. Order-free (minima).

use super::hull::Hull;
use super::ray::{Lanes, Ray};
use crate::backend::cpu::depths::Depths;
use crate::backend::cpu::tile_buffers::Slices;
use crate::backend::cpu::tiles::{LANES, STRIDE, TileRect};
use crate::layout::SweptSplat;
use crate::math::simd::dispatch;

/// First and last slice that any lane's kernel covers; none if the first is larger.
#[inline(always)]
pub(super) fn covered(count: usize, first: &[f32; LANES], last: &[f32; LANES]) -> [usize; 2] {
    let (mut low, mut high) = (1.0_f32, -1.0_f32);
    for l in 0..LANES {
        low = if first[l] < low { first[l] } else { low };
        high = if last[l] > high { last[l] } else { high };
    }
    let scale = 0.5 * count as f32;
    let from = ((low + 1.0) * scale) as usize;
    let to = ((high + 1.0) * scale) as usize;
    [from, if to < count { to } else { count - 1 }]
}

/// Begin, middle and end of slice `slice` of `count`.
#[inline(always)]
pub(super) fn times(count: usize, slice: usize) -> [f32; 3] {
    let step = 2.0 / count as f32;
    let begin = slice as f32 * step - 1.0;
    [begin, begin + 0.5 * step, begin + step]
}

dispatch! {
    /// Lowers the thresholds of `slices` by the swept splats that `list` names.
    pub(in crate::backend) fn visibility(
        splats: &[SweptSplat], list: &[u32], depths: Depths, tile: &TileRect, slices: &mut Slices,
    ) = visibility_body
}

#[inline(always)]
fn visibility_body(splats: &[SweptSplat], list: &[u32], depths: Depths, tile: &TileRect, slices: &mut Slices) {
    if slices.nearest.is_empty() {
        lower::<false>(splats, list, depths, tile, slices);
    } else {
        lower::<true>(splats, list, depths, tile, slices);
    }
}

/// `NEAREST`: lowers the least depths, too.
#[inline(always)]
fn lower<const NEAREST: bool>(
    splats: &[SweptSplat],
    list: &[u32],
    depths: Depths,
    tile: &TileRect,
    slices: &mut Slices,
) {
    let count = slices.count;
    let [left, top] = tile.corner;
    for &index in list {
        let splat = &splats[index as usize];
        let hull = Hull::of(splat);
        let ray = Ray::of(splat, depths.near);
        let [_, _, y0, y1] = splat.bounds.map(i32::from);
        for row in y0.max(top)..=y1.min(top + tile.height as i32 - 1) {
            let [x0, x1] = hull.columns(row as f32, row as f32);
            let (x0, x1) = (x0.max(left), x1.min(left + tile.width as i32 - 1));
            let y = (row - top) as usize;
            let row_of = |y: usize| y * count * STRIDE..(y + 1) * count * STRIDE;
            let out = &mut slices.threshold[row_of(y)];
            let nearest = if NEAREST { &mut slices.nearest[row_of(y)] } else { &mut [][..] };
            let mut pixel = x0;
            while pixel <= x1 {
                let x = (pixel - left) as usize;
                let (mut first, mut last) = ([0.0; LANES], [0.0; LANES]);
                let mut plane = [[0.0; LANES]; 2];
                for l in 0..LANES {
                    let place = [pixel as f32 + l as f32, row as f32];
                    let (span, at) = ray.cover(splat, place, x1 as f32);
                    (first[l], last[l], plane[0][l], plane[1][l]) = (span[0], span[1], at[0], at[1]);
                }
                let [from, to] = covered(count, &first, &last);
                for slice in from..=to {
                    let [_, middle, _] = times(count, slice);
                    let Some(out) = out.get_mut(slice * STRIDE + x..).and_then(<[f32]>::first_chunk_mut::<LANES>)
                    else {
                        break;
                    };
                    for l in 0..LANES {
                        let depth = plane[0][l] + middle * plane[1][l];
                        let candidate = depth + depths.tolerance(depth);
                        let covers = (first[l] < middle) & (middle < last[l]);
                        let candidate = if covers { candidate } else { f32::INFINITY };
                        out[l] = if candidate < out[l] { candidate } else { out[l] };
                    }
                    if NEAREST
                        && let Some(out) = nearest.get_mut(slice * STRIDE + x..)
                        && let Some(out) = out.first_chunk_mut::<LANES>()
                    {
                        for l in 0..LANES {
                            let depth = plane[0][l] + middle * plane[1][l];
                            let covers = (first[l] < middle) & (middle < last[l]);
                            let candidate = if covers { depth } else { f32::INFINITY };
                            out[l] = if candidate < out[l] { candidate } else { out[l] };
                        }
                    }
                }
                pixel += LANES as i32;
            }
        }
    }
}

impl Lanes {
    /// How long each lane's kernel is visible during a slice, in tau. `first`: T of the slice. `NEAREST`: the kernel's
    /// object has a limit of its own; `nearest`: the least depth of the slice.
    #[inline(always)]
    pub(super) fn visible<const NEAREST: bool>(
        &self,
        [begin, middle, end]: [f32; 3],
        depths: Depths,
        first: &[f32; LANES],
        nearest: &[f32; LANES],
    ) -> [f32; LANES] {
        let mut out = [0.0; LANES];
        for l in 0..LANES {
            let from = if self.first[l] > begin { self.first[l] } else { begin };
            let to = if self.last[l] < end { self.last[l] } else { end };
            let depth = self.plane[0][l] + middle * self.plane[1][l];
            let limit = if NEAREST { depths.limit(depth, first[l], nearest[l]) } else { first[l] };
            let passes = (from < to) & (depth <= limit) & (self.covers[l] != 0);
            out[l] = if passes { to - from } else { 0.0 };
        }
        out
    }
}

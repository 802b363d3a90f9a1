//! Pass `attribute`: weighted sums of the attributes of the splats that pass the depth test (Wolf 2008, 4.1.1 and
//! 4.2.3; docs/math.md, section 5).
//!
//! In: splats of a tile's list, all of one time sample, the tile's thresholds, the surfels' attributes. Out: the tile's
//! sums and, in a group of several samples, the sample's coverage. In list order.

use super::patch::{self, NARROW, Patch, Touched};
use super::tiles::{LANES, STRIDE, TileRect};
use crate::layout::{Channels, Splat};
use crate::math::fast;
use crate::math::simd::dispatch;

/// What the pass needs beside splats and thresholds.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Attributes<'a> {
    pub channels: &'a Channels,
    pub near: f32,
    /// Radius of the low-pass disc, raster pixels; +0 without it.
    pub low_pass: f32,
    /// The sample's share of its group's weight.
    pub share: f32,
    /// Of each splat a number for each channel; empty where there are only weights.
    pub values: &'a [f32],
}

impl Attributes<'_> {
    /// Numbers for the channels of splat `splat` of the chunk.
    #[inline(always)]
    pub(in crate::backend) fn of(&self, splat: u32) -> &[f32] {
        let count = self.channels.count;
        if self.values.is_empty() { &[1.0] } else { &self.values[splat as usize * count..][..count] }
    }
}

/// Where a tile's splats are added up; see `TileBuffers`.
#[derive(Debug)]
pub(in crate::backend) struct Tally<'a> {
    pub sums: &'a mut [f32],
    /// Coverage by the current sample; empty where it is not wanted.
    pub sample_coverage: &'a mut [f32],
    /// Least depth of what passes, +inf where nothing does; empty where it is not wanted.
    pub nearest: &'a mut [f32],
}

dispatch! {
    /// Adds the splats that `list` names to `tally`.
    pub(in crate::backend) fn attribute(
        splats: &[Splat], list: &[u32], attributes: &Attributes<'_>, tile: &TileRect, threshold: &[f32],
        tally: &mut Tally<'_>,
    ) = attribute_body
}

#[inline(always)]
fn attribute_body(
    splats: &[Splat],
    list: &[u32],
    attributes: &Attributes<'_>,
    tile: &TileRect,
    threshold: &[f32],
    tally: &mut Tally<'_>,
) {
    for &index in list {
        let splat = &splats[index as usize];
        let touched = Touched::of(splat, tile);
        let values = attributes.of(index);
        // A missing second row would cost as much as one that is there, for every channel.
        if touched.is_narrow() && touched.is_high() {
            add_splat::<NARROW>(splat, &touched, values, attributes, tile, threshold, tally);
        } else {
            add_splat::<LANES>(splat, &touched, values, attributes, tile, threshold, tally);
        }
    }
}

/// Adds one splat, a patch of `W` columns at a time.
#[inline(always)]
fn add_splat<const W: usize>(
    splat: &Splat,
    touched: &Touched,
    values: &[f32],
    attributes: &Attributes<'_>,
    tile: &TileRect,
    threshold: &[f32],
    tally: &mut Tally<'_>,
) {
    let Tally { sums, sample_coverage, nearest } = tally;
    // Without the low-pass disc its distance counts as infinite.
    let with_low_pass = attributes.low_pass > 0.0;
    let low_pass_scale = 1.0 / (attributes.low_pass * attributes.low_pass);
    let most_inverse_depth = 1.0 / attributes.near;
    let row = attributes.channels.count * STRIDE;
    let mut y = touched.y0;
    while y <= touched.y1 {
        let mut x = touched.x0;
        while x <= touched.x1 {
            let patch = Patch::<W>::new(touched, tile, x, y);
            let at = y * STRIDE + x;
            let limit = patch::load::<W>(&threshold[at..], STRIDE);
            let mut weights = [0.0_f32; LANES];
            let mut depths = [0.0_f32; LANES];
            let mut covered = [0.0_f32; LANES];
            for l in 0..LANES {
                let hit = patch.at(splat, l);
                let plane_depth = 1.0 / hit.inverse_depth;
                let inside = hit.inside & (hit.inverse_depth <= most_inverse_depth);
                let r3d = hit.scaled_r2 * (plane_depth * plane_depth);
                let d2 = (hit.x * hit.x + hit.y * hit.y) * low_pass_scale;
                let r2d = if with_low_pass { d2 } else { f32::INFINITY };
                let depth = if inside { plane_depth } else { splat.centre_depth };
                let r3d = if inside { r3d } else { f32::INFINITY };
                let r2d = if splat.centre_depth > 0.0 { r2d } else { f32::INFINITY };
                let r2 = if r2d < r3d { r2d } else { r3d };
                let passes = (inside | (r2 <= 1.0)) & (depth <= limit[l]) & hit.wanted;
                let r2 = if r2 < 1.0 { r2 } else { 1.0 };
                let weight = if passes { fast::kernel(r2) } else { 0.0 };
                // A hidden splat covers the pixel, too: what hides it covers it.
                covered[l] = if inside & hit.wanted { 1.0 } else { weight };
                weights[l] = weight * attributes.share;
                depths[l] = if passes { depth } else { 0.0 };
            }
            if !sample_coverage.is_empty() {
                add_patch::<W>(&mut sample_coverage[at..], STRIDE, &covered, 1.0);
            }
            if !nearest.is_empty() {
                let mut least = patch::load::<W>(&nearest[at..], STRIDE);
                for l in 0..LANES {
                    let closer = (weights[l] > 0.0) & (depths[l] < least[l]);
                    least[l] = if closer { depths[l] } else { least[l] };
                }
                patch::store::<W>(&mut nearest[at..], STRIDE, &least);
            }
            // No early exit where nothing passes: a branch that is often wrong costs more than adding zeros.
            let out = &mut sums[y * row + x..];
            for (channel, value) in values.iter().enumerate() {
                add_patch::<W>(&mut out[channel * STRIDE..], row, &weights, *value);
            }
            if let Some(depth) = attributes.channels.depth {
                for l in 0..LANES {
                    depths[l] *= weights[l];
                }
                add_patch::<W>(&mut out[depth * STRIDE..], row, &depths, 1.0);
            }
            x += W;
        }
        y += LANES / W;
    }
}

/// plane += weights * value, for the patch that starts where `plane` does, of rows `stride` apart.
#[inline(always)]
pub(in crate::backend) fn add_patch<const W: usize>(
    plane: &mut [f32],
    stride: usize,
    weights: &[f32; LANES],
    value: f32,
) {
    let mut sum = patch::load::<W>(plane, stride);
    for l in 0..LANES {
        sum[l] += weights[l] * value;
    }
    patch::store::<W>(plane, stride, &sum);
}

/// plane += weights * value, for the first `LANES` pixels of `plane`.
#[inline(always)]
pub(in crate::backend) fn add(plane: &mut [f32], weights: &[f32; LANES], value: f32) {
    if let Some(plane) = plane.first_chunk_mut::<LANES>() {
        let old = *plane;
        for l in 0..LANES {
            plane[l] = old[l] + weights[l] * value;
        }
    }
}

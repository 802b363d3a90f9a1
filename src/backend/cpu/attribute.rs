//! Pass `attribute`: weighted sums of the attributes of the splats that pass the depth test (thesis 4.1.1, 4.2.3).
//!
//! In: splats of a tile's list, all of one time sample, the tile's thresholds, the surfels' attributes. Out: the tile's sums and,
//! in a group of several samples, where the sample covers. In list order.

use glam::Vec3;

use super::tiles::{LANES, STRIDE, TileRect};
use super::visibility::{Row, Touched};
use crate::frame::{FrameObject, PosedObject, PosedSample};
use crate::layout::{Channels, FLAG_BACK, Splat};
use crate::math::fast;
use crate::math::simd::dispatch;
use crate::model::Material;

/// What the pass needs beside splats and thresholds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attributes<'a> {
    pub sample: &'a PosedSample,
    pub posed: &'a PosedObject,
    pub object: &'a FrameObject<'a>,
    pub channels: &'a Channels,
    pub near: f32,
    /// Radius of the low-pass disc, raster pixels; +0 without it.
    pub low_pass: f32,
    /// Pixels of the image to one of the raster.
    pub stride: f32,
    /// The sample's share of its group's weight.
    pub share: f32,
    /// Of each splat what it shows under the lights; empty where pixels are shaded.
    pub lit: &'a [Vec3],
}

/// Where a tile's splats are added up; see `TileBuffers`.
#[derive(Debug)]
pub(super) struct Tally<'a> {
    pub sums: &'a mut [f32],
    /// Coverage by the current sample; empty where it is not wanted.
    pub reach: &'a mut [f32],
    /// Least depth of what passes, +inf where nothing does; empty where it is not wanted.
    pub nearest: &'a mut [f32],
}

dispatch! {
    /// Adds the splats that `list` names to `tally`.
    pub(super) fn attribute(
        splats: &[Splat], list: &[u32], attributes: &Attributes<'_>, tile: &TileRect, threshold: &[f32], tally: &mut Tally<'_>,
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
    let Tally { sums, reach, nearest } = tally;
    // Without the low-pass disc its distance counts as infinite.
    let with_low_pass = attributes.low_pass > 0.0;
    let low_pass_scale = 1.0 / (attributes.low_pass * attributes.low_pass);
    let most_inverse_depth = 1.0 / attributes.near;
    let channels = attributes.channels.count;
    for &index in list {
        let splat = &splats[index as usize];
        let Touched { x0, x1, y0, y1 } = Touched::of(splat, tile);
        let values = splat_values(index, splat.surfel, splat.flags, attributes);
        for y in y0..=y1 {
            let row = Row::of(splat, tile.corner[1] + y as i32);
            let out = &mut sums[y * channels * STRIDE..][..channels * STRIDE];
            let mut x = x0;
            while x <= x1 {
                let limit = &threshold[y * STRIDE + x..][..LANES];
                let first = (tile.corner[0] + x as i32) as f32;
                let last = (tile.corner[0] + x1 as i32) as f32;
                let mut weights = [0.0_f32; LANES];
                let mut depths = [0.0_f32; LANES];
                let mut reaches = [0.0_f32; LANES];
                for l in 0..LANES {
                    let pixel = first + l as f32;
                    let hit = row.at(splat, pixel);
                    let plane_depth = 1.0 / hit.inverse_depth;
                    let inside = hit.inside & (hit.inverse_depth <= most_inverse_depth);
                    let r3d = hit.scaled_r2 * (plane_depth * plane_depth);
                    let d2 = (hit.x * hit.x + row.y * row.y) * low_pass_scale;
                    let r2d = if with_low_pass { d2 } else { f32::INFINITY };
                    let depth = if inside { plane_depth } else { splat.centre_depth };
                    let r3d = if inside { r3d } else { f32::INFINITY };
                    let r2d = if splat.centre_depth > 0.0 { r2d } else { f32::INFINITY };
                    let r2 = if r2d < r3d { r2d } else { r3d };
                    let passes = (inside | (r2 <= 1.0)) & (depth <= limit[l]) & (pixel <= last);
                    let r2 = if r2 < 1.0 { r2 } else { 1.0 };
                    let weight = if passes { fast::kernel(r2) } else { 0.0 };
                    // What covers the pixel is part of its coverage even if it is hidden: something before it covers, too.
                    reaches[l] = if inside & (pixel <= last) { 1.0 } else { weight };
                    weights[l] = weight * attributes.share;
                    depths[l] = if passes { depth } else { 0.0 };
                }
                if !reach.is_empty() {
                    add(&mut reach[y * STRIDE + x..], &reaches, 1.0);
                }
                if let Some(nearest) = nearest.get_mut(y * STRIDE + x..).and_then(<[f32]>::first_chunk_mut::<LANES>) {
                    for l in 0..LANES {
                        let closer = (weights[l] > 0.0) & (depths[l] < nearest[l]);
                        nearest[l] = if closer { depths[l] } else { nearest[l] };
                    }
                }
                // No early exit where nothing passes: a branch that is often wrong costs more than adding zeros.
                for (value, plane) in values.iter().zip(out.chunks_exact_mut(STRIDE)) {
                    add(&mut plane[x..], &weights, *value);
                }
                if let Some(depth) = attributes.channels.depth {
                    for l in 0..LANES {
                        depths[l] *= weights[l];
                    }
                    add(&mut out[depth * STRIDE + x..], &depths, 1.0);
                }
                x += LANES;
            }
        }
    }
}

/// plane += weights * value, for the first `LANES` pixels of `plane`.
#[inline(always)]
pub(super) fn add(plane: &mut [f32], weights: &[f32; LANES], value: f32) {
    if let Some(plane) = plane.first_chunk_mut::<LANES>() {
        let old = *plane;
        for l in 0..LANES {
            plane[l] = old[l] + weights[l] * value;
        }
    }
}

/// The value of splat `splat` of the chunk for each channel (0 for depth, which differs from pixel to pixel).
#[inline(always)]
pub(super) fn splat_values(splat: u32, surfel: u32, flags: u32, attributes: &Attributes<'_>) -> [f32; Channels::MOST] {
    let surfels = attributes.object.surfels;
    let i = surfel as usize;
    let colour = attributes.lit.get(splat as usize).copied().unwrap_or(surfels.colour[i]);
    let mut values = [0.0; Channels::MOST];
    values[0] = 1.0;
    values[1..4].copy_from_slice(&colour.to_array());
    let channels = attributes.channels;
    if let Some(at) = channels.normal {
        let turned = unit(attributes.posed.normal_matrix * surfels.normal[i]);
        let normal = if flags & FLAG_BACK == 0 { turned } else { -turned };
        values[at..at + 3].copy_from_slice(&normal.to_array());
    }
    if let Some(at) = channels.velocity {
        values[at..at + 2].copy_from_slice(&velocity(surfels.position[i], attributes).map(|v| v * attributes.stride));
    }
    if let Some(at) = channels.material {
        let m = material(attributes, i);
        values[at..at + 4].copy_from_slice(&[m.ambient, m.diffuse, m.specular, m.shininess]);
    }
    values
}

/// The vector with length 1; a zero vector stays zero. Without `glam`'s branches.
#[inline(always)]
fn unit(v: Vec3) -> Vec3 {
    let d2 = v.x * v.x + v.y * v.y + v.z * v.z;
    v * (1.0 / (if d2 > 1e-30 { d2 } else { 1e-30 }).sqrt())
}

pub(super) fn material(attributes: &Attributes<'_>, surfel: usize) -> Material {
    attributes.object.material.or_else(|| attributes.object.surfels.material.get(surfel).copied()).unwrap_or_default()
}

/// Screen velocity of a surfel's centre, raster pixels per shutter: the derivative of (x, y) = (X, Y) / depth. 0 where the centre has
/// no image, being nearer than `near`.
fn velocity(position: Vec3, attributes: &Attributes<'_>) -> [f32; 2] {
    let posed = attributes.posed;
    let p = posed.screen_from_model * position + posed.screen_origin;
    let rate = posed.screen_rate * position + posed.screen_origin_rate;
    if p.z < attributes.near {
        return [0.0; 2];
    }
    let over = 1.0 / p.z;
    [(rate.x - p.x * over * rate.z) * over, (rate.y - p.y * over * rate.z) * over]
}

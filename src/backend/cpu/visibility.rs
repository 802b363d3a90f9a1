//! Pass `visibility`: T(x, t) = min over splats covering x of (depth + epsilon), per pixel (design section 2; thesis 4.1.1).
//!
//! In: splats of a tile's list. Out: the tile's thresholds. Order-free (a minimum).

use super::tiles::{LANES, STRIDE, TileRect};
use crate::layout::Splat;
use crate::math::simd::dispatch;

/// Smallest depth tolerance, as a share of the depth: 4 units in the last place.
const LEAST_EPSILON: f32 = 4.0 * f32::EPSILON;

/// What of the camera the pass needs, and the depth tolerance of the splats' object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Depths {
    pub near: f32,
    pub epsilon: f32,
}

dispatch! {
    /// Lowers `threshold` by the splats that `list` names.
    pub(super) fn visibility(splats: &[Splat], list: &[u32], depths: Depths, tile: &TileRect, threshold: &mut [f32]) = visibility_body
}

#[inline(always)]
fn visibility_body(splats: &[Splat], list: &[u32], depths: Depths, tile: &TileRect, threshold: &mut [f32]) {
    let most_inverse_depth = 1.0 / depths.near;
    for &index in list {
        let splat = &splats[index as usize];
        let Touched { x0, x1, y0, y1 } = Touched::of(splat, tile);
        for y in y0..=y1 {
            let row = Row::of(splat, tile.corner[1] + y as i32);
            let mut x = x0;
            while x <= x1 {
                let out = &mut threshold[y * STRIDE + x..][..LANES];
                let first = (tile.corner[0] + x as i32) as f32;
                let last = (tile.corner[0] + x1 as i32) as f32;
                for l in 0..LANES {
                    let pixel = first + l as f32;
                    let hit = row.at(splat, pixel);
                    let depth = 1.0 / hit.inverse_depth;
                    let least = LEAST_EPSILON * depth;
                    let epsilon = if depths.epsilon > least { depths.epsilon } else { least };
                    let covers = hit.inside & (hit.inverse_depth <= most_inverse_depth) & (pixel <= last);
                    let candidate = if covers { depth + epsilon } else { f32::INFINITY };
                    out[l] = if candidate < out[l] { candidate } else { out[l] };
                }
                x += LANES;
            }
        }
    }
}

/// Pixels of a tile that a splat may touch: first and last column and row, counted from the tile's corner.
pub(super) struct Touched {
    pub x0: usize,
    pub x1: usize,
    pub y0: usize,
    pub y1: usize,
}

impl Touched {
    #[inline(always)]
    pub(super) fn of(splat: &Splat, tile: &TileRect) -> Self {
        let [x0, x1, y0, y1] = splat.bounds.map(usize::from);
        Self {
            x0: x0.max(tile.origin[0]) - tile.origin[0],
            x1: x1.min(tile.origin[0] + tile.width - 1) - tile.origin[0],
            y0: y0.max(tile.origin[1]) - tile.origin[1],
            y1: y1.min(tile.origin[1] + tile.height - 1) - tile.origin[1],
        }
    }
}

/// A splat's linear forms along one pixel row.
pub(super) struct Row {
    pub y: f32,
    inverse_depth: f32,
    u: f32,
    v: f32,
}

/// A splat's plane on the ray through one sample position.
pub(super) struct Hit {
    /// Horizontal distance from the splat's reference, pixels.
    pub x: f32,
    pub inverse_depth: f32,
    /// (u^2 + v^2) times the squared inverse depth.
    pub scaled_r2: f32,
    /// In front of the camera and within the cut-off radius.
    pub inside: bool,
}

impl Row {
    #[inline(always)]
    pub(super) fn of(splat: &Splat, pixel_row: i32) -> Self {
        let y = pixel_row as f32 + 0.5 - splat.reference[1];
        let form = |c: [f32; 3]| c[1] * y + c[2];
        Self { y, inverse_depth: form(splat.inverse_depth), u: form(splat.u), v: form(splat.v) }
    }

    #[inline(always)]
    pub(super) fn at(&self, splat: &Splat, pixel: f32) -> Hit {
        let x = pixel + 0.5 - splat.reference[0];
        let inverse_depth = splat.inverse_depth[0] * x + self.inverse_depth;
        let u = splat.u[0] * x + self.u;
        let v = splat.v[0] * x + self.v;
        let scaled_r2 = u * u + v * v;
        let inside = (inverse_depth > 0.0) & (scaled_r2 <= inverse_depth * inverse_depth);
        Hit { x, inverse_depth, scaled_r2, inside }
    }
}

//! Pass `visibility`: T(x, t) = min over splats covering x of (depth + epsilon), per pixel (Wolf 2008, 4.1.1;
//! docs/math.md, section 4).
//!
//! In: splats of a tile's list. Out: the tile's thresholds. Order-free (a minimum).

use super::patch::{self, NARROW, Patch, Touched};
use super::tiles::{LANES, STRIDE, TileRect};
use crate::layout::Splat;
use crate::math::simd::dispatch;

/// Smallest depth tolerance, as a share of the depth: 4 units in the last place.
const LEAST_EPSILON: f32 = 4.0 * f32::EPSILON;

/// What of the camera the pass needs, and the depth tolerance of the splats' object.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Depths {
    pub near: f32,
    pub epsilon: f32,
}

impl Depths {
    /// The tolerance of a splat at `depth`.
    #[inline(always)]
    pub(in crate::backend) fn tolerance(self, depth: f32) -> f32 {
        let least = LEAST_EPSILON * depth;
        if self.epsilon > least { self.epsilon } else { least }
    }
}

dispatch! {
    /// Lowers `threshold` by the splats that `list` names.
    pub(in crate::backend) fn visibility(
        splats: &[Splat], list: &[u32], depths: Depths, tile: &TileRect, threshold: &mut [f32],
    ) = visibility_body
}

#[inline(always)]
fn visibility_body(splats: &[Splat], list: &[u32], depths: Depths, tile: &TileRect, threshold: &mut [f32]) {
    for &index in list {
        let splat = &splats[index as usize];
        let touched = Touched::of(splat, tile);
        if touched.is_narrow() {
            lower::<NARROW>(splat, &touched, depths, tile, threshold);
        } else {
            lower::<LANES>(splat, &touched, depths, tile, threshold);
        }
    }
}

/// Lowers `threshold` by one splat, a patch of `W` columns at a time.
#[inline(always)]
fn lower<const W: usize>(splat: &Splat, touched: &Touched, depths: Depths, tile: &TileRect, threshold: &mut [f32]) {
    let most_inverse_depth = 1.0 / depths.near;
    let mut y = touched.y0;
    while y <= touched.y1 {
        let mut x = touched.x0;
        while x <= touched.x1 {
            let patch = Patch::<W>::new(touched, tile, x, y);
            let mut out = patch::load::<W>(&threshold[y * STRIDE + x..], STRIDE);
            for l in 0..LANES {
                let hit = patch.at(splat, l);
                let depth = 1.0 / hit.inverse_depth;
                let epsilon = depths.tolerance(depth);
                let covers = hit.inside & (hit.inverse_depth <= most_inverse_depth) & hit.wanted;
                let candidate = if covers { depth + epsilon } else { f32::INFINITY };
                out[l] = if candidate < out[l] { candidate } else { out[l] };
            }
            patch::store::<W>(&mut threshold[y * STRIDE + x..], STRIDE, &out);
            x += W;
        }
        y += LANES / W;
    }
}

//! When published kernels in motion and their low-pass discs cover (docs/math.md, section 7).
//!
//! In: a tile's mask. Out: its coverage. One sample position at a time, order-free.

use super::mask::PublishedMask;
use crate::backend::cpu::swept::IntervalExposure;
use crate::backend::cpu::tiles::{LANES, STRIDE, TILE};
use crate::math::simd::dispatch;

dispatch! {
    /// The share of the exposure that each pixel of a tile is covered for, `TILE` rows of `STRIDE`.
    pub(in crate::backend) fn coverage(
        exposure: &IntervalExposure<'_>, mask: &PublishedMask, out: &mut Vec<f32>,
    ) = coverage_body
}

#[inline(always)]
fn coverage_body(exposure: &IntervalExposure<'_>, mask: &PublishedMask, out: &mut Vec<f32>) {
    out.clear();
    out.resize(TILE * STRIDE, 0.0);
    let lanes = mask.surface.chunks_exact(LANES).zip(mask.low_pass.chunks_exact(LANES));
    let lanes = lanes.zip(mask.loose.chunks_exact(LANES)).zip(out.chunks_exact_mut(LANES));
    for (((surface, low_pass), loose), out) in lanes {
        if exposure.sum {
            for l in 0..LANES {
                out[l] = exposure.weight * loose[l];
            }
            continue;
        }
        let mut covered = [0.0_f32; LANES];
        let mut by_discs = [0.0_f32; LANES];
        for (i, &share) in exposure.interval.moments.iter().enumerate() {
            for l in 0..LANES {
                let bit = surface[l] >> i & 1;
                let other = low_pass[l] >> i & !bit & 1;
                covered[l] += if bit == 1 { share } else { 0.0 };
                by_discs[l] += if other == 1 { share } else { 0.0 };
            }
        }
        for l in 0..LANES {
            // Where only low-pass discs cover, the sum of their weights is the coverage, but at most the time for which
            // they cover.
            let loose = exposure.weight * loose[l];
            let loose = if loose < by_discs[l] { loose } else { by_discs[l] };
            out[l] = if surface[l] == u32::MAX { exposure.weight } else { covered[l] + loose };
        }
    }
}

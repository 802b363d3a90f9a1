//! Pass `project` of published kernels in motion: ellipsoids and their low-pass discs, projected, bounded and culled
//! (Wolf 2008, 4.1.2 and 4.2.3; docs/math.md, section 7).
//!
//! In: surfels of one object, its pose at mid-interval and its motion. Out: swept splats in surfel order. Order-free.

use std::ops::Range;

use crate::backend::cpu::project::SurfelView;
use crate::backend::cpu::swept::project::{Moving, all_posed, boxes, crossing, moving};
use crate::layout::{FLAG_LOW_PASS, SweptSplat};
use crate::math::simd::dispatch;
use crate::model::Surfels;

dispatch! {
    /// Appends the swept splats of `surfels[range]` that may touch the wanted pixels, in surfel order.
    pub(super) fn project(
        view: &SurfelView<'_>, surfels: &Surfels, range: Range<usize>, out: &mut Vec<SweptSplat>,
    ) = project_body
}

#[inline(always)]
fn project_body(view: &SurfelView<'_>, surfels: &Surfels, range: Range<usize>, out: &mut Vec<SweptSplat>) {
    out.extend(all_posed(view, surfels, range).filter_map(|(i, posed)| match moving(view, &posed)? {
        Moving::Ordinary(kernel) => {
            let low_pass = if posed.centre.z >= view.near { view.centre_disc } else { 0.0 };
            let mut splat = kernel.splat(view, &boxes(view, true, &posed, low_pass), i as u32)?;
            splat.flags |= if low_pass > 0.0 { FLAG_LOW_PASS } else { 0 };
            Some(splat)
        }
        Moving::Crossing => crossing(view, &posed, i as u32),
    }));
}

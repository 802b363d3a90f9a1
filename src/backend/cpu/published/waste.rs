//! What bounds of published kernels in motion waste: pixels within their hulls.

use super::ray::{Lanes, Ray, RaySettings};
use crate::backend::Waste;
use crate::backend::cpu::swept::{count, covered};
use crate::layout::SweptSplat;
use crate::math::simd::dispatch;

dispatch! {
    /// The counts of `splats`, with low-pass discs of radius `low_pass` raster pixels.
    pub(in crate::backend) fn waste_of(splats: &[SweptSplat], near: f32, low_pass: f32) -> Waste = waste_of_body
}

#[inline(always)]
fn waste_of_body(splats: &[SweptSplat], near: f32, low_pass: f32) -> Waste {
    let sight = RaySettings { source_samples: 1, slope: 0.0, sum: false, axis: [0.0; 2], focal: 1.0 };
    let mut waste = Waste::default();
    let mut lanes = Lanes::default();
    for splat in splats {
        waste.visibility += covered(splat, near);
        let ray = Ray::of(splat, near, low_pass);
        waste.attribute += count(splat, |place, last| {
            ray.meet::<false, true>(splat, &sight, 0, place, last, &mut lanes, 0);
            lanes.covers[0] != 0
        });
    }
    waste
}

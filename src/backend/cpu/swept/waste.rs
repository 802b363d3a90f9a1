//! What bounds of kernels in motion waste: pixels within their hulls.

use super::attribute::Footprint;
use super::filtered::Pair;
use super::hull::Hull;
use super::ray::{ELLIPSOID, Lanes, Ray, Sight, TUBE};
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::waste::{self, Wasteful};
use crate::backend::{Pixels, Waste};
use crate::layout::{SweptFilter, SweptSplat};
use crate::math::simd::dispatch;

impl Wasteful for SweptSplat {
    fn waste(binned: &Binned<Self>, sight: &waste::Sight<'_>) -> Waste {
        let Some(kernel) = sight.swept else { return Waste::default() };
        let kernels = (&binned.splats[..], &binned.filters[..]);
        match Footprint::of(kernel) {
            Footprint::Tube => of_tubes(kernels, sight.near, sight.low_pass),
            // The chord and the line are of the ellipsoid.
            Footprint::Ellipsoid | Footprint::Chord | Footprint::Line => {
                of_ellipsoids(kernels, sight.near, sight.low_pass)
            }
        }
    }
}

dispatch! {
    fn of_tubes(kernels: (&[SweptSplat], &[SweptFilter]), near: f32, low_pass: f32) -> Waste = of_kernels::<TUBE>
}

dispatch! {
    fn of_ellipsoids(kernels: (&[SweptSplat], &[SweptFilter]), near: f32, low_pass: f32) -> Waste =
        of_kernels::<ELLIPSOID>
}

/// `filters` is empty where kernels are not filtered.
#[inline(always)]
fn of_kernels<const FOOTPRINT: u8>(
    (splats, filters): (&[SweptSplat], &[SweptFilter]),
    near: f32,
    low_pass: f32,
) -> Waste {
    let sight = Sight { source_samples: 1, slope: 0.0, sum: false, axis: [0.0; 2], focal: 1.0 };
    let mut waste = Waste::default();
    for (index, splat) in splats.iter().enumerate() {
        let [disc, ray] = [0.0, low_pass].map(|low_pass| Ray::of(splat, near, low_pass));
        waste.visibility += count(splat, |place, last| {
            let ([first, end], _) = disc.cover(splat, place, last);
            first < end
        });
        let mut lanes = Lanes::default();
        waste.attribute += if let Some(filter) = filters.get(index) {
            let pair = Pair::of(splat, filter, near);
            count(splat, |place, last| {
                pair.meet::<FOOTPRINT>(splat, 0.0, place, last, &mut lanes, 0);
                lanes.covers[0] != 0
            })
        } else {
            count(splat, |place, last| {
                ray.meet::<FOOTPRINT, true>(splat, &sight, 0, place, last, &mut lanes, 0);
                lanes.covers[0] != 0
            })
        };
    }
    waste
}

/// Pixels of a kernel's hull, and those of them that it covers at some time.
#[inline(always)]
fn count(splat: &SweptSplat, mut covers: impl FnMut([f32; 2], f32) -> bool) -> Pixels {
    let hull = Hull::of(splat);
    let [_, _, first, last] = splat.bounds.map(i32::from);
    let mut pixels = Pixels::default();
    for row in first..=last {
        let [x0, x1] = hull.columns(row as f32, row as f32);
        for x in x0..=x1 {
            pixels.bounded += 1;
            pixels.covered += u64::from(covers([x as f32, row as f32], x1 as f32));
        }
    }
    pixels
}

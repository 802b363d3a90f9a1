//! What bounds of kernels in motion waste: pixels within their hulls.

use super::attribute::Pair;
use super::hull::Hull;
use super::ray::{Lanes, Ray};
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::published;
use crate::backend::cpu::waste::{self, Wasteful};
use crate::backend::{Pixels, Waste};
use crate::layout::{SweptFilter, SweptSplat};
use crate::math::simd::dispatch;
use crate::options::{KernelShape, KernelWeight};

impl Wasteful for SweptSplat {
    fn waste(binned: &Binned<Self>, sight: &waste::WasteView<'_>) -> Waste {
        let Some(kernel) = sight.swept else { return Waste::default() };
        let kernels = (&binned.splats[..], &binned.filters[..]);
        match (kernel.weight, kernel.shape) {
            (KernelWeight::Integral, KernelShape::Tube) => of_tubes(kernels, sight.near),
            (KernelWeight::Integral, KernelShape::Ellipsoid) => of_ellipsoids(kernels, sight.near),
            (KernelWeight::Chord | KernelWeight::Line, _) => {
                published::waste_of(&binned.splats, sight.near, sight.low_pass)
            }
        }
    }
}

dispatch! {
    fn of_tubes(kernels: (&[SweptSplat], &[SweptFilter]), near: f32) -> Waste = of_kernels::<false>
}

dispatch! {
    fn of_ellipsoids(kernels: (&[SweptSplat], &[SweptFilter]), near: f32) -> Waste = of_kernels::<true>
}

#[inline(always)]
fn of_kernels<const ELLIPSOID: bool>((splats, filters): (&[SweptSplat], &[SweptFilter]), near: f32) -> Waste {
    let mut waste = Waste::default();
    let mut lanes = Lanes::default();
    for (splat, filter) in splats.iter().zip(filters) {
        waste.visibility += covered(splat, near);
        let pair = Pair::of(splat, filter, near);
        waste.attribute += count(splat, |place, last| {
            pair.meet::<ELLIPSOID>(splat, 0.0, place, last, &mut lanes, 0);
            lanes.covers[0] != 0
        });
    }
    waste
}

/// Pixels of a kernel's hull, and those of them that its disc covers at some time.
#[inline(always)]
pub(in crate::backend::cpu) fn covered(splat: &SweptSplat, near: f32) -> Pixels {
    let disc = Ray::of(splat, near);
    count(splat, |place, last| {
        let ([first, end], _) = disc.cover(splat, place, last);
        first < end
    })
}

/// Pixels of a kernel's hull, and those of them that it covers at some time.
#[inline(always)]
pub(in crate::backend::cpu) fn count(splat: &SweptSplat, mut covers: impl FnMut([f32; 2], f32) -> bool) -> Pixels {
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

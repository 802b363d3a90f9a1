//! A kernel in motion on the rays through neighbouring pixels (docs/math.md, section 7, eq. 11 to 15).

use crate::backend::cpu::tiles::LANES;
use crate::layout::SweptSplat;
use crate::math::sweep::{Path, Sweep};

/// A kernel on the rays through neighbouring pixels. A lane whose ray does not meet it has weight 0 and covers nothing.
#[derive(Default)]
pub(super) struct Lanes {
    /// Weight over the interval.
    pub weight: [f32; LANES],
    /// What the weight may be at the most, however sparse the kernels.
    pub most: [f32; LANES],
    /// First and last time at which what weighs covers.
    pub first: [f32; LANES],
    pub last: [f32; LANES],
    /// Weight of what covers.
    pub loose: [f32; LANES],
    /// Mean depth on the ray.
    pub depth: [f32; LANES],
    /// Depth of the plane on the ray at tau = 0, and its change to tau = 1.
    pub plane: [[f32; LANES]; 2],
    /// When the disc covers, and when the filtered kernel does.
    pub surface: [u32; LANES],
    pub filtered: [u32; LANES],
    /// 1 where anything is met.
    pub covers: [u32; LANES],
}

/// The numbers that all rays of a splat share.
pub(super) struct Ray {
    near: f32,
    /// (1 + k tau) / w is the depth at tau.
    k: f32,
    /// 1 / k, or as good as infinite.
    inverse_k: f32,
}

impl Ray {
    /// First and last time at which the tube covers the ray through the sample position of `pixel`, and the depth of
    /// its plane there at tau = 0 and its change to tau = 1. The first is not less than the last where it never covers.
    #[inline(always)]
    pub(super) fn cover(&self, splat: &SweptSplat, pixel: [f32; 2], last: f32) -> ([f32; 2], [f32; 2]) {
        let (x, y) = (pixel[0] + 0.5 - splat.reference[0], pixel[1] + 0.5 - splat.reference[1]);
        let form = |c: [f32; 3]| c[0] * x + (c[1] * y + c[2]);
        let w = form(splat.inverse_depth);
        let path = Path { at: [form(splat.u), form(splat.v)], rate: [form(splat.u_rate), form(splat.v_rate)], w };
        let span = beyond_near(self.near * w - 1.0, self.k, self.inverse_k, Sweep::tube(path).covered());
        let met = (pixel[0] <= last) & (w > 0.0) & (span[0] < span[1]);
        ([if met { span[0] } else { 1.0 }, if met { span[1] } else { -1.0 }], [1.0 / w, self.k / w])
    }

    #[inline(always)]
    pub(super) fn of(splat: &SweptSplat, near: f32) -> Self {
        let i = splat.inverse_depth;
        let m = splat.motion;
        let k = i[0] * m[0] + i[1] * m[1] + i[2] * m[2];
        Self { near, k, inverse_k: reciprocal(k) }
    }
}

/// `span` without the times at which (1 + k tau) / w is nearer than `near`, given near w - 1.
#[inline(always)]
pub(in crate::backend::cpu) fn beyond_near(lacks: f32, k: f32, inverse_k: f32, [first, last]: [f32; 2]) -> [f32; 2] {
    let at = lacks * inverse_k;
    let (lower, upper) = if k < 0.0 { (-1.0, at) } else { (at, 1.0) };
    [if first > lower { first } else { lower }, if last < upper { last } else { upper }]
}

/// 1 / v, and large but finite where that is not.
#[inline(always)]
pub(in crate::backend::cpu) fn reciprocal(v: f32) -> f32 {
    if v.abs() > 1e-30 { 1.0 / v } else { 1e30 }
}

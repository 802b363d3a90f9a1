//! Screen bounds: extents of kernels, and the pixels that they may touch (docs/math.md, section 2).

use glam::Vec3;

/// Slack of screen bounds, pixels plus a share of the size: they must not be too small by rounding.
pub(in crate::backend) const SLACK: f32 = 1e-3;
pub(in crate::backend) const SLACK_SHARE: f32 = 1e-5;

/// Ends of the ellipse along one axis, relative to the projected centre and widened to a disc of radius `disc` around
/// it: the roots of d22 k^2 - 2 d02 k + d00 = 0 for d22 < 0. `inverse22`: 1 / d22. It comes first, as products of
/// lengths may be too large for a number.
#[inline(always)]
pub(super) fn extent(d00: f32, d02: f32, inverse22: f32, disc: f32) -> (f32, f32) {
    let middle = d02 * inverse22;
    let square = middle * middle - d00 * inverse22;
    let half = (if square > 0.0 { square } else { 0.0 }).sqrt();
    let (low, high) = (middle - half, middle + half);
    (if low < -disc { low } else { -disc }, if high > disc { high } else { disc })
}

/// Pixel indices of [low, high] about `reference`, with slack and not rounded.
#[inline(always)]
pub(super) fn index_range(reference: f32, low: f32, high: f32) -> (f32, f32) {
    let slack = SLACK + SLACK_SHARE * (high - low) + reference.abs() * f32::EPSILON;
    (reference + low - slack - 0.5, reference + high + slack - 0.5)
}

/// First and last pixel whose sample position may be in [low, high] about `reference`, cut to [first, last]. None where
/// the first is after the last, or a NaN.
#[inline(always)]
pub(super) fn pixel_range(reference: f32, low: f32, high: f32, first: i32, last: i32) -> (f32, f32) {
    let (a, b) = index_range(reference, low, high);
    let (a, b) = (a.ceil(), b.floor());
    // A NaN stays one, and fails the comparison of first with last.
    let a = if a < first as f32 { first as f32 } else { a };
    let b = if b > last as f32 { last as f32 } else { b };
    (a, b)
}

/// A whole number from 0 to 65535 as an integer. A cast saturates, which would block vector code.
#[inline(always)]
pub(super) fn whole(x: f32) -> u16 {
    /// 2^23: adding it leaves the number in the low bits of the mantissa.
    const SHIFT: f32 = 8_388_608.0;
    ((x + SHIFT).to_bits() & 0xffff) as u16
}

/// Rounding of a coordinate of a disc, as a share of the coordinates that it is made of.
pub(in crate::backend) const ROUNDING: f32 = 8.0 * f32::EPSILON;

/// Half the side of the regular octagon about a circle of radius 1: its corners are (+-1, +-this) and (+-this, +-1).
pub(in crate::backend) const HALF_SIDE: f32 = 0.414_213_57;

/// Corners of that octagon, in order.
pub(in crate::backend) const OCTAGON: [[f32; 2]; 8] = [
    [1.0, -HALF_SIDE],
    [1.0, HALF_SIDE],
    [HALF_SIDE, 1.0],
    [-HALF_SIDE, 1.0],
    [-1.0, HALF_SIDE],
    [-1.0, -HALF_SIDE],
    [-HALF_SIDE, -1.0],
    [HALF_SIDE, -1.0],
];

/// A disc in homogeneous pixel coordinates (x, y, depth), counted from the camera's axis: its centre and half axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    pub centre: Vec3,
    pub u: Vec3,
    pub v: Vec3,
}

impl Disc {
    /// Does the disc lie on the outer side of the plane through the eye and through all places `slope` along image axis
    /// `i`? `side`: 1.0 where higher places are outside, -1.0 where lower ones are.
    ///
    /// With h the normal of that plane, h.c + sqrt((h.u)^2 + (h.v)^2) < 0.
    #[inline(always)]
    fn is_beyond(&self, i: usize, slope: f32, side: f32) -> bool {
        let along = |p: Vec3| side * (slope * p.z - p[i]);
        let (u, v) = (along(self.u), along(self.v));
        let slack = ROUNDING * (self.size(i) + slope.abs() * self.size(2));
        along(self.centre) + (u * u + v * v).sqrt() < -slack
    }

    /// Least and greatest place along image axes x and y of the part at depths of at least `near`: the box about what
    /// `near` leaves of an octagon around the disc. `None` where nothing is left.
    pub(super) fn beyond_near(&self, near: f32) -> Option<[[f32; 2]; 2]> {
        let corner = |[a, b]: [f32; 2]| self.centre + self.u * a + self.v * b;
        let mut out = [[f32::MAX, -f32::MAX]; 2];
        let mut widen = |x: f32, y: f32| {
            for (ends, at) in out.iter_mut().zip([x, y]) {
                *ends = [if at < ends[0] { at } else { ends[0] }, if at > ends[1] { at } else { ends[1] }];
            }
        };
        for k in 0..OCTAGON.len() {
            let (p, q) = (corner(OCTAGON[k]), corner(OCTAGON[(k + 1) % OCTAGON.len()]));
            if p.z >= near {
                widen(p.x / p.z, p.y / p.z);
            }
            if (p.z >= near) != (q.z >= near) {
                let t = (near - p.z) / (q.z - p.z);
                widen((p.x + (q.x - p.x) * t) / near, (p.y + (q.y - p.y) * t) / near);
            }
        }
        if out[0][0] > out[0][1] {
            return None;
        }
        let over = ROUNDING / near;
        for (i, [low, high]) in out.iter_mut().enumerate() {
            *low -= (self.size(i) + low.abs() * self.size(2)) * over;
            *high += (self.size(i) + high.abs() * self.size(2)) * over;
        }
        Some(out)
    }

    /// Sum of the sizes of coordinate `i`.
    #[inline(always)]
    fn size(&self, i: usize) -> f32 {
        self.centre[i].abs() + self.u[i].abs() + self.v[i].abs()
    }
}

/// Do all discs lie outside the plane through the eye along the first, or all outside that along the last, of the
/// `wanted` pixels along image axis `i`? Then so does their hull. Pixels are counted from `origin`; `margin`: pixels by
/// which the discs are wider.
pub(super) fn is_outside(discs: &[Disc], i: usize, origin: f32, wanted: [i32; 2], margin: f32) -> bool {
    let margin = margin + SLACK + origin.abs() * f32::EPSILON;
    let slope = |pixel: i32| pixel as f32 + 0.5 - origin;
    let all = |slope: f32, side: f32| discs.iter().all(|disc| disc.is_beyond(i, slope, side));
    all(slope(wanted[0]) - margin, -1.0) || all(slope(wanted[1]) + margin, 1.0)
}

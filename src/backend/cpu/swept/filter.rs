//! Kernels in motion, each convolved with the low-pass filter of full EWA (Wolf 2008, eq. 3.41; docs/math.md,
//! section 7).
//!
//! J is the derivative of pixels by (u, v) at the centre at mid-interval, V = J J^T / 4, and V' = V + sigma^2 I. A disc
//! with the derivative J', J' J'^T / 4 = V', is the filtered kernel. J' is taken triangular: so it is regular for a
//! disc that is edge-on, too.

use glam::Vec3;

use super::posed::{Posed, forms};
use crate::backend::cpu::paint::share::Share;
use crate::layout::SweptFilter;

/// How a kernel is filtered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filter {
    /// Standard deviation of the low-pass filter, pixels.
    pub sigma: f32,
    /// What the surfel counts.
    pub share: Share,
}

impl Filter {
    /// The kernel without a filter: its disc.
    #[inline(always)]
    pub(super) fn none(self) -> SweptFilter {
        SweptFilter::unfiltered(self.share.unfiltered())
    }
}

/// A filtered kernel in screen space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filtered {
    /// With the axes of the filtered disc.
    pub posed: Posed,
    /// The axes, sheared so that the centre's ray is the axis: x and y times depth, depth.
    axes: [[f32; 3]; 2],
    peak: f32,
    weight: f32,
    coverage: f32,
}

impl Filtered {
    /// Filters a kernel that lies before the camera plane.
    #[inline(always)]
    pub(super) fn of(posed: &Posed, filter: Filter) -> Self {
        let &Posed { centre, u, v, .. } = posed;
        let inverse = 1.0 / centre.z;
        let (x, y) = (centre.x * inverse, centre.y * inverse);
        // J, pixels a unit of u and of v.
        let (jux, juy) = ((u.x - x * u.z) * inverse, (u.y - y * u.z) * inverse);
        let (jvx, jvy) = ((v.x - x * v.z) * inverse, (v.y - y * v.z) * inverse);
        let variance = filter.sigma * filter.sigma;
        let xx = 0.25 * (jux * jux + jvx * jvx) + variance;
        let xy = 0.25 * (jux * juy + jvx * jvy);
        let yy = 0.25 * (juy * juy + jvy * jvy) + variance;
        // |V'| from sums of squares alone, so that nothing cancels: |V| + sigma^2 tr V + sigma^4.
        let area = 0.25 * (jux * jvy - juy * jvx);
        let det = area * area + variance * (xx + yy - variance);
        // J' = ((l0, 0), (l1, l2)).
        let l0 = 2.0 * xx.sqrt();
        let over0 = 1.0 / l0;
        let l1 = 4.0 * xy * over0;
        let l2 = 4.0 * det.sqrt() * over0;
        // The depths of its axes, J'^-1 J a, where a holds those of the disc's.
        let (sx, sy) = (jux * u.z + jvx * v.z, juy * u.z + jvy * v.z);
        let uz = sx * over0;
        let vz = (sy - l1 * uz) / l2;
        let axes = [[l0 * centre.z, l1 * centre.z, uz], [0.0, l2 * centre.z, vz]];
        let unsheared = |[ax, ay, az]: [f32; 3]| Vec3::new(ax + x * az, ay + y * az, az);
        let peak = (area * area / det).sqrt();
        Self {
            posed: Posed { u: unsheared(axes[0]), v: unsheared(axes[1]), ..*posed },
            axes,
            peak,
            weight: filter.share.weight(peak),
            coverage: filter.share.coverage(peak),
        }
    }

    /// Its forms; `motion` is sheared as the axes are.
    #[inline(always)]
    pub(super) fn forms(&self, motion: [f32; 3]) -> SweptFilter {
        let inverse = 1.0 / self.posed.centre.z;
        let [i, u, v, u_rate, v_rate] = forms(self.axes[0], self.axes[1], motion, inverse);
        SweptFilter {
            inverse_depth: [i[0], i[1]],
            u: [u[0], u[1]],
            v: [v[0], v[1]],
            u_rate,
            v_rate,
            k: i[0] * motion[0] + i[1] * motion[1] + i[2] * motion[2],
            peak: self.peak,
            weight: self.weight,
            coverage: self.coverage,
        }
    }
}

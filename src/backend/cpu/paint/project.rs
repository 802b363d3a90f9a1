//! Pass `project` of filtered kernels: surfels to splats, each convolved with the low-pass filter of the sample grid
//! (Ren et al. 2002, eq. 7 and 8; Zwicker et al. 2002, eq. 35; docs/math.md, section 3).
//!
//! A kernel exp(-2 (u^2 + v^2)) is a Gaussian of variance 1/4. J is the derivative of pixels by (u, v) at the centre,
//! V = J J^T / 4, and V' = V + sigma^2 I. The weight is sqrt(|V| / |V'|) exp(-q / 2), cut where q > 4.

use std::ops::Range;

use super::share::Shares;
use crate::backend::cpu::bounds::{pixel_range, whole};
use crate::backend::cpu::project::{LANES, Projected, Sink, SurfelView, project_body};
use crate::frame::PixelRect;
use crate::layout::{EwaSplat, Splat};
use crate::math::simd::dispatch;
use crate::model::Surfels;

/// Takes splats and filters them.
pub(super) struct Filtered<'a> {
    /// Standard deviation of the low-pass filter, pixels.
    pub sigma: f32,
    /// The pixels that are wanted, without the apron.
    pub pixels: PixelRect,
    /// The pixels of the image around them.
    pub guarded: PixelRect,
    /// What the surfels of the model count.
    pub shares: Shares<'a>,
    pub out: &'a mut Vec<EwaSplat>,
}

dispatch! {
    /// Appends the splats of `surfels[range]` that may touch the wanted pixels or their apron, in surfel order.
    pub(super) fn project(
        view: &SurfelView<'_>, surfels: &Surfels, range: Range<usize>, out: &mut Filtered<'_>,
    ) = project_body
}

/// Filtered splats of `LANES` surfels, field by field.
#[derive(Default)]
pub(super) struct FilteredLanes {
    u: [Lanes; 2],
    v: [Lanes; 2],
    shrink: [Lanes; 2],
    p: [Lanes; 3],
    peak: Lanes,
    /// First and last column, first and last row, of the disc and of the filtered kernel.
    disc: [[u16; LANES]; 4],
    filtered: [[u16; LANES]; 4],
}

type Lanes = [f32; LANES];

impl Sink for Filtered<'_> {
    type Lanes = FilteredLanes;

    #[inline(always)]
    fn lane(&self, projected: &Projected, l: usize, out: &mut FilteredLanes) {
        let &Projected { reference, inverse, u, v, ends, .. } = projected;
        // J, pixels a unit of u and of v.
        let (jux, juy) = (u[0] * inverse, u[1] * inverse);
        let (jvx, jvy) = (v[0] * inverse, v[1] * inverse);
        let variance = self.sigma * self.sigma;
        let xx = 0.25 * (jux * jux + jvx * jvx) + variance;
        let xy = 0.25 * (jux * juy + jvx * jvy);
        let yy = 0.25 * (juy * juy + jvy * jvy) + variance;
        // |V'| from sums of squares alone, so that nothing cancels: |V| + sigma^2 tr V + sigma^4.
        let area = 0.25 * (jux * jvy - juy * jvx);
        let det = area * area + variance * (xx + yy - variance);
        let over = 1.0 / det;
        let p = [yy * over, -xy * over, xx * over];
        let across = |jx: f32, jy: f32| [0.25 * (jx * p[0] + jy * p[1]), 0.25 * (jx * p[1] + jy * p[2])];
        let (form_u, form_v) = (across(jux, juy), across(jvx, jvy));
        for i in 0..2 {
            out.u[i][l] = form_u[i];
            out.v[i][l] = form_v[i];
            out.shrink[i][l] = (u[2] * form_u[i] + v[2] * form_v[i]) * inverse;
        }
        for i in 0..3 {
            out.p[i][l] = p[i];
        }
        out.peak[l] = (area * area * over).sqrt();
        let disc = pixels(reference, ends, &self.guarded);
        let [columns, rows] = ends;
        let filtered_ends =
            [filtered_extent(columns, 4.0 * xx, self.sigma), filtered_extent(rows, 4.0 * yy, self.sigma)];
        let filtered = pixels(reference, filtered_ends, &self.pixels);
        for i in 0..4 {
            out.disc[i][l] = disc[i];
            out.filtered[i][l] = filtered[i];
        }
    }

    #[inline(always)]
    fn push(&mut self, splat: Splat, lanes: &FilteredLanes, l: usize) {
        if splat.centre_depth <= 0.0 {
            return self.push_crossing(splat);
        }
        let peak = lanes.peak[l];
        if !(peak > 0.0 && peak.is_finite()) {
            return;
        }
        let bounds = |of: &[[u16; LANES]; 4]| [of[0][l], of[1][l], of[2][l], of[3][l]];
        self.out.push(EwaSplat {
            disc: Splat { bounds: bounds(&lanes.disc), ..splat },
            u: [lanes.u[0][l], lanes.u[1][l]],
            v: [lanes.v[0][l], lanes.v[1][l]],
            shrink: [lanes.shrink[0][l], lanes.shrink[1][l]],
            p: [lanes.p[0][l], lanes.p[1][l], lanes.p[2][l]],
            peak,
            weight: self.shares.at(splat.surfel as usize).weight(peak),
            filtered_bounds: bounds(&lanes.filtered),
            listed_bounds: splat.bounds,
            crossing: 0,
        });
    }

    fn push_crossing(&mut self, splat: Splat) {
        self.out.push(EwaSplat {
            disc: splat,
            peak: 1.0,
            weight: self.shares.at(splat.surfel as usize).unfiltered(),
            filtered_bounds: splat.bounds,
            listed_bounds: splat.bounds,
            crossing: 1,
            ..bytemuck::Zeroable::zeroed()
        });
    }
}

/// The ends of the filtered kernel along one axis, from the ends of its disc. `affine`: the square of its extent
/// without perspective (docs/math.md, section 3).
#[inline(always)]
fn filtered_extent((low, high): (f32, f32), affine: f32, sigma: f32) -> (f32, f32) {
    let reach = 2.0 * sigma;
    let extent = |disc: f32| {
        let square = disc * disc + reach * reach;
        let extent = (if square > affine { square } else { affine }).sqrt();
        if extent < disc + reach { extent } else { disc + reach }
    };
    (-extent(-low), extent(high))
}

/// The pixels of `rect` that `ends` may touch; none where the first is after the last.
#[inline(always)]
fn pixels(reference: [f32; 2], ends: [(f32, f32); 2], rect: &PixelRect) -> [u16; 4] {
    let [(left, right), (top, bottom)] = ends;
    let columns = pixel_range(reference[0], left, right, rect.first_column, rect.last_column);
    let rows = pixel_range(reference[1], top, bottom, rect.first_row, rect.last_row);
    let any = (columns.0 <= columns.1) & (rows.0 <= rows.1);
    [(columns.0, 1), (columns.1, 0), (rows.0, 1), (rows.1, 0)]
        .map(|(pixel, none)| if any { whole(pixel) } else { none })
}

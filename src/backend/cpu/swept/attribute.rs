//! Pass `attribute`, swept: weighted sums of the attributes of kernels in motion that pass the depth test (Wolf 2008,
//! 4.1.2; docs/math.md, section 7). Where the filter is zero, each filtered kernel is its disc.
//!
//! In: swept splats of a tile's list, their filtered kernels, thresholds of the interval's slices, attributes of
//! surfels. Out: the tile's sums, when discs and filtered kernels cover, and how much. In list order. The filtered
//! kernel weighs; the disc alone says where the surface is, and how deep.

use super::hull::Hull;
use super::ray::{Lanes, beyond_near, reciprocal};
use super::slices::{covered, times};
use crate::backend::cpu::attribute::{Attributes, add};
use crate::backend::cpu::depths::Depths;
use crate::backend::cpu::tile_buffers::{CoverageMask, Slices};
use crate::backend::cpu::tiles::{LANES, STRIDE, TileRect};
use crate::layout::{FLAG_BACK, SweptFilter, SweptSplat};
use crate::math::simd::dispatch;
use crate::math::sweep::{Path, Sweep, ellipsoid_weight, moments, tube_weight};

/// What the pass needs beside splats.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Swept<'a> {
    pub attributes: Attributes<'a>,
    pub depths: Depths,
    /// Do kernels sweep the ellipsoid instead of the tube?
    pub ellipsoid: bool,
    /// Change of the time weight from the middle of the interval to its end, over its mean.
    pub slope: f32,
    /// Write the sum of weights instead of the times at which kernels cover.
    pub sum: bool,
}

/// Share of its weight that a hidden kernel has. It is nothing beside a visible kernel's weight. Without it a pixel
/// would have no colour where all kernels that cover it are hidden between the times, or at the source pixels, that are
/// looked at.
pub(in crate::backend) const HIDDEN: f32 = 1.0 / (1 << 24) as f32;

dispatch! {
    /// Adds the swept splats that `list` names, and their filtered kernels, to `sums` and `coverage_mask`.
    pub(in crate::backend) fn attribute(
        kernels: (&[SweptSplat], &[SweptFilter]), list: &[u32], swept: &Swept<'_>, tile: &TileRect, slices: &Slices,
        sums: &mut [f32], coverage_mask: &mut CoverageMask,
    ) = attribute_body
}

#[inline(always)]
fn attribute_body(
    kernels: (&[SweptSplat], &[SweptFilter]),
    list: &[u32],
    swept: &Swept<'_>,
    tile: &TileRect,
    slices: &Slices,
    sums: &mut [f32],
    coverage_mask: &mut CoverageMask,
) {
    macro_rules! add_all {
        ($ellipsoid:expr, $nearest:expr) => {
            add_all::<$ellipsoid, $nearest>(kernels, list, swept, tile, slices, sums, coverage_mask)
        };
    }
    match (swept.ellipsoid, !slices.nearest.is_empty()) {
        (false, false) => add_all!(false, false),
        (false, true) => add_all!(false, true),
        (true, false) => add_all!(true, false),
        (true, true) => add_all!(true, true),
    }
}

#[inline(always)]
fn add_all<const ELLIPSOID: bool, const NEAREST: bool>(
    (splats, filters): (&[SweptSplat], &[SweptFilter]),
    list: &[u32],
    swept: &Swept<'_>,
    tile: &TileRect,
    slices: &Slices,
    sums: &mut [f32],
    coverage_mask: &mut CoverageMask,
) {
    let attributes = &swept.attributes;
    let channels = attributes.channels.count;
    let [left, top] = tile.corner;
    for &index in list {
        let splat = &splats[index as usize];
        let pair = Pair::of(splat, &filters[index as usize], swept.depths.near);
        let values = attributes.of(index);
        let hull = Hull::of(splat);
        let [_, _, y0, y1] = splat.bounds.map(i32::from);
        for row in y0.max(top)..=y1.min(top + tile.height as i32 - 1) {
            let [x0, x1] = hull.columns(row as f32, row as f32);
            let (x0, x1) = (x0.max(left), x1.min(left + tile.width as i32 - 1));
            let y = (row - top) as usize;
            let out = &mut sums[y * channels * STRIDE..][..channels * STRIDE];
            let mut pixel = x0;
            while pixel <= x1 {
                let x = (pixel - left) as usize;
                let mut lanes = Lanes::default();
                for l in 0..LANES {
                    // As floats: checked additions would block vector code.
                    let place = [pixel as f32 + l as f32, row as f32];
                    pair.meet::<ELLIPSOID>(splat, swept.slope, place, x1 as f32, &mut lanes, l);
                }
                if lanes.covers != [0; LANES] {
                    lanes.show::<NEAREST>(slices, swept, y, x);
                    pair.mark(&lanes, swept.sum, y * STRIDE + x, coverage_mask);
                    for (value, plane) in values.iter().zip(out.chunks_exact_mut(STRIDE)) {
                        add(&mut plane[x..], &lanes.weight, *value);
                    }
                    if let Some(depth) = attributes.channels.depth {
                        for l in 0..LANES {
                            lanes.depth[l] *= lanes.weight[l];
                        }
                        add(&mut out[depth * STRIDE + x..], &lanes.depth, 1.0);
                    }
                }
                pixel += LANES as i32;
            }
        }
    }
}

/// A disc and its filtered kernel: what is the same for all rays.
pub(super) struct Pair {
    near: f32,
    /// Forms of the filtered kernel: inverse depth, u, v, and the rates of u and v.
    forms: [[f32; 3]; 5],
    /// For the filtered kernel, then for the disc: (1 + k tau) / w is the depth at tau; 1 / k, or as good as infinite.
    k: [f32; 2],
    inverse_k: [f32; 2],
    /// Depth of the centre at tau = 0, and its change to tau = 1.
    centre: [f32; 2],
    weight: f32,
    coverage: f32,
    peak: f32,
    /// -1 for a kernel that shows its back, else 1.
    side: f32,
}

impl Pair {
    #[inline(always)]
    pub(super) fn of(splat: &SweptSplat, filter: &SweptFilter, near: f32) -> Self {
        let i = splat.inverse_depth;
        let m = splat.motion;
        let k = i[0] * m[0] + i[1] * m[1] + i[2] * m[2];
        let centre_depth = 1.0 / i[2];
        let unfiltered = filter.is_unfiltered();
        let form = |[x, y]: [f32; 2], one: f32| [x, y, one];
        let filtered =
            [form(filter.inverse_depth, i[2]), form(filter.u, 0.0), form(filter.v, 0.0), filter.u_rate, filter.v_rate];
        let own = [i, splat.u, splat.v, splat.u_rate, splat.v_rate];
        let filtered_k = if unfiltered { k } else { filter.k };
        Self {
            near,
            forms: if unfiltered { own } else { filtered },
            k: [filtered_k, k],
            inverse_k: [reciprocal(filtered_k), reciprocal(k)],
            centre: [centre_depth, centre_depth * (m[2] * i[2])],
            weight: filter.weight,
            coverage: if unfiltered { filter.weight } else { filter.coverage },
            peak: filter.peak,
            side: if splat.flags & FLAG_BACK == 0 { 1.0 } else { -1.0 },
        }
    }

    /// The kernel on the ray through the sample position of `pixel`; nothing beyond column `last`.
    #[inline(always)]
    pub(super) fn meet<const ELLIPSOID: bool>(
        &self,
        splat: &SweptSplat,
        slope: f32,
        pixel: [f32; 2],
        last: f32,
        lanes: &mut Lanes,
        l: usize,
    ) {
        let (x, y) = (pixel[0] + 0.5 - splat.reference[0], pixel[1] + 0.5 - splat.reference[1]);
        let form = |c: [f32; 3]| c[0] * x + (c[1] * y + c[2]);
        let wanted = pixel[0] <= last;

        // The disc: when it covers.
        let w = form(splat.inverse_depth);
        let path = Path { at: [form(splat.u), form(splat.v)], rate: [form(splat.u_rate), form(splat.v_rate)], w };
        let disc_span = beyond_near(self.near * w - 1.0, self.k[1], self.inverse_k[1], Sweep::tube(path).covered());
        let disc_met = (w > 0.0) & (disc_span[0] < disc_span[1]);

        // The filtered kernel: what it weighs.
        let [inverse_depth, u, v, u_rate, v_rate] = self.forms;
        let own_w = form(inverse_depth);
        let path = Path { at: [form(u), form(v)], rate: [form(u_rate), form(v_rate)], w: own_w };
        let tube = Sweep::tube(path);
        let lacks = self.near * own_w - 1.0;
        let tube_span = beyond_near(lacks, self.k[0], self.inverse_k[0], tube.covered());
        let met = wanted & (own_w > 0.0) & (tube_span[0] < tube_span[1]);
        let tau = 0.5 * (tube_span[0] + tube_span[1]);
        let time = 1.0 + slope * tau;
        let in_tube = tube_weight(tube.mean(tube_span), tube_span) * time;
        lanes.loose[l] = if met { self.coverage * in_tube } else { 0.0 };
        if ELLIPSOID {
            let ellipsoid = Sweep::ellipsoid(path);
            let span = beyond_near(lacks, self.k[0], self.inverse_k[0], ellipsoid.covered());
            let met = met & (span[0] < span[1]);
            let time = 1.0 + slope * (0.5 * (span[0] + span[1]));
            let weight = self.weight * ellipsoid_weight(ellipsoid.mean(span), span) * time;
            lanes.weight[l] = if met { weight } else { 0.0 };
            lanes.most[l] = ellipsoid_weight(1.0, span) * time;
            lanes.first[l] = if met { span[0] } else { 1.0 };
            lanes.last[l] = if met { span[1] } else { -1.0 };
        } else {
            lanes.weight[l] = if met { self.weight * in_tube } else { 0.0 };
            lanes.most[l] = tube_weight(1.0, tube_span) * time;
            lanes.first[l] = if met { tube_span[0] } else { 1.0 };
            lanes.last[l] = if met { tube_span[1] } else { -1.0 };
        }

        // The depth is that of the disc's plane, also outside the disc; the centre's where the ray misses the plane.
        let on_plane = (w > 0.0) & (self.near * w <= 1.0);
        let over = 1.0 / w;
        let depth = if on_plane { over } else { self.centre[0] };
        let change = if on_plane { self.k[1] * over } else { self.centre[1] };
        lanes.plane[0][l] = depth;
        lanes.plane[1][l] = change;
        lanes.depth[l] = if met { depth + tau * change } else { 0.0 };
        lanes.surface[l] = if disc_met & met { moments(disc_span) } else { 0 };
        lanes.filtered[l] = if met { moments(tube_span) } else { 0 };
        lanes.covers[l] = u32::from(met);
    }

    /// Adds when the lanes are covered, and by how much, for the pixels from `first` on.
    #[inline(always)]
    fn mark(&self, lanes: &Lanes, sum: bool, first: usize, coverage_mask: &mut CoverageMask) {
        let CoverageMask { surface, filtered, loose, peak, side } = coverage_mask;
        for (plane, factor) in [(loose, 1.0), (peak, self.peak), (side, self.side)] {
            if let Some(plane) = plane.get_mut(first..) {
                add(plane, &lanes.loose, factor);
            }
        }
        if sum {
            return;
        }
        for (plane, bits) in [(surface, &lanes.surface), (filtered, &lanes.filtered)] {
            if let Some(plane) = plane.get_mut(first..).and_then(<[u32]>::first_chunk_mut::<LANES>) {
                for l in 0..LANES {
                    plane[l] |= bits[l];
                }
            }
        }
    }
}

impl Lanes {
    /// Weighs the filtered kernel by the slices in which it is visible. A hidden kernel loses its weight and keeps its
    /// coverage, because the surface before it covers as much.
    #[inline(always)]
    fn show<const NEAREST: bool>(&mut self, slices: &Slices, swept: &Swept<'_>, y: usize, x: usize) {
        let count = slices.count;
        let mut shown = [0.0_f32; LANES];
        let [from, to] = covered(count, &self.first, &self.last);
        for slice in from..=to {
            let at = (y * count + slice) * STRIDE + x;
            let planes = [&slices.threshold, if NEAREST { &slices.nearest } else { &slices.threshold }];
            let planes = planes.map(|plane| plane.get(at..).and_then(<[f32]>::first_chunk::<LANES>));
            let [Some(first), Some(nearest)] = planes else { break };
            let share = self.visible::<NEAREST>(times(count, slice), swept.depths, first, nearest);
            for l in 0..LANES {
                shown[l] += share[l];
            }
        }
        for l in 0..LANES {
            let covers = self.first[l] < self.last[l];
            let weight = self.weight[l];
            let share = if weight < self.most[l] { weight } else { self.most[l] };
            let part = shown[l] / (self.last[l] - self.first[l]);
            let passes = shown[l] > 0.0;
            let share = share * if passes { part } else { HIDDEN };
            // A tube that is met beside the ellipsoid covers, and gives a colour where there is no other.
            self.weight[l] = if covers { share } else { self.loose[l] * HIDDEN };
            if swept.sum {
                self.loose[l] = if passes { weight * part } else { 0.0 };
            }
        }
    }
}

//! Pass `project`, swept: surfels to kernels in motion over an interval; projected, bounded and culled.
//!
//! Math: docs/math.md, section 7. In: surfels of one object, its pose at mid-interval and its motion. Out: swept
//! splats in surfel order. Order-free.

use std::ops::Range;

use glam::Vec3;

use super::filter::{Filter, Filtered};
use super::posed::{Posed, forms};
use crate::backend::cpu::bounds::{Disc, SLACK_SHARE, extent, index_range, is_outside};
use crate::backend::cpu::paint::share::Shares;
use crate::backend::cpu::project::SurfelView;
use crate::layout::{FLAG_BACK, FLAG_CROSSING, SweptFilter, SweptSplat};
use crate::math::simd::dispatch;
use crate::model::Surfels;

dispatch! {
    /// Appends the swept splats of `surfels[range]` that may touch the wanted pixels, in surfel order, and the filtered
    /// kernel of each. `ellipsoid`: kernels sweep the ellipsoid instead of the tube.
    pub(in crate::backend) fn project(
        view: &SurfelView<'_>, ellipsoid: bool, surfels: &Surfels, range: Range<usize>, out: &mut Vec<SweptSplat>,
        filters: &mut Vec<SweptFilter>,
    ) = project_body
}

#[inline(always)]
fn project_body(
    view: &SurfelView<'_>,
    ellipsoid: bool,
    surfels: &Surfels,
    range: Range<usize>,
    out: &mut Vec<SweptSplat>,
    filters: &mut Vec<SweptFilter>,
) {
    let shares = Shares::of(surfels);
    for (i, posed) in all_posed(view, surfels, range) {
        let filter = Filter { sigma: view.raster.sigma, share: shares.at(i) };
        if let Some((splat, filtered)) = sweep(view, ellipsoid, &posed, i as u32, filter) {
            out.push(splat);
            filters.push(filtered);
        }
    }
}

/// The kernels of `surfels[range]`, and their numbers.
#[inline(always)]
pub(in crate::backend::cpu) fn all_posed(
    view: &SurfelView<'_>,
    surfels: &Surfels,
    range: Range<usize>,
) -> impl Iterator<Item = (usize, Posed)> {
    let object = view.object;
    range.map(move |i| {
        let place = view.paths.place(surfels.position[i], i, object.elapsed);
        let advance = object.centre_from_model * view.paths.sum(i, object.advance);
        let posed = Posed {
            centre: object.centre_from_model * place + object.centre_origin,
            motion: object.motion_from_model * place + object.motion_origin + advance,
            u: object.screen_from_model * surfels.axis_u[i],
            v: object.screen_from_model * surfels.axis_v[i],
        };
        (i, posed)
    })
}

/// Where a kernel lies that may be seen.
pub(in crate::backend::cpu) enum Moving {
    /// Before the camera plane over the whole interval.
    Ordinary(Sheared),
    /// It reaches that plane.
    Crossing,
}

/// A kernel that lies before the camera plane, sheared so that its centre's ray is the axis at mid-interval.
pub(in crate::backend::cpu) struct Sheared {
    /// Where the centre is on the screen at mid-interval, counted from the camera's axis.
    centre: [f32; 2],
    /// One over the centre's depth.
    inverse: f32,
    /// Axes and motion: x and y times depth, depth.
    u: [f32; 3],
    v: [f32; 3],
    motion: [f32; 3],
    /// Signed area of the projected axes.
    area: f32,
}

/// Boxes at both ends, as [`end`] has them, and one box about the whole kernel.
pub(in crate::backend::cpu) struct Boxes {
    ends: [[f32; 4]; 2],
    hull: [f32; 4],
}

/// Where a kernel lies; none if it shows the wrong face at mid-interval, or is nearer than `near`.
#[inline(always)]
pub(in crate::backend::cpu) fn moving(view: &SurfelView<'_>, posed: &Posed) -> Option<Moving> {
    let &Posed { centre, motion, u, v } = posed;
    let depth_extent2 = u.z * u.z + v.z * v.z;
    let depths = [centre.z - motion.z, centre.z + motion.z];
    if (if depths[0] > depths[1] { depths[0] } else { depths[1] }) + depth_extent2.sqrt() < view.near {
        return None;
    }
    // False with a NaN.
    let before = |depth: f32| depth > 0.0 && depth_extent2 - depth * depth <= -1e-3 * depth * depth;
    if !(before(depths[0]) && before(depths[1])) {
        return Some(Moving::Crossing);
    }
    let inverse = 1.0 / centre.z;
    let (x, y) = (centre.x * inverse, centre.y * inverse);
    let (ux, uy) = (u.x - x * u.z, u.y - y * u.z);
    let (vx, vy) = (v.x - x * v.z, v.y - y * v.z);
    let (mx, my) = (motion.x - x * motion.z, motion.y - y * motion.z);
    let area = ux * vy - uy * vx;
    let det = area * centre.z * view.object.handedness;
    let facing = if view.two_sided { det.abs() > 0.0 } else { det < 0.0 };
    facing.then_some(Moving::Ordinary(Sheared {
        centre: [x, y],
        inverse,
        u: [ux, uy, u.z],
        v: [vx, vy, v.z],
        motion: [mx, my, motion.z],
        area,
    }))
}

/// The splat of one kernel, and its filtered kernel; none if it cannot be seen, or nowhere touches the wanted pixels.
#[inline(always)]
pub(super) fn sweep(
    view: &SurfelView<'_>,
    ellipsoid: bool,
    posed: &Posed,
    surfel: u32,
    filter: Filter,
) -> Option<(SweptSplat, SweptFilter)> {
    let kernel = match moving(view, posed)? {
        Moving::Ordinary(kernel) => kernel,
        Moving::Crossing => return Some((crossing(view, posed, surfel)?, filter.none())),
    };
    let mut own = boxes(view, ellipsoid, posed, 0.0);
    let wide = (filter.sigma > 0.0).then(|| Filtered::of(posed, filter));
    if let Some(wide) = &wide {
        let filtered = boxes(view, ellipsoid, &wide.posed, 0.0);
        own.ends = [0, 1].map(|i| about(&own.ends[i], &filtered.ends[i]));
        own.hull = about(&own.hull, &filtered.hull);
    }
    let splat = kernel.splat(view, &own, surfel)?;
    Some((splat, wide.map_or_else(|| filter.none(), |wide| wide.forms(kernel.motion))))
}

impl Sheared {
    /// Its splat within the boxes; none where these hold no wanted pixel.
    #[inline(always)]
    pub(in crate::backend::cpu) fn splat(
        &self,
        view: &SurfelView<'_>,
        boxes: &Boxes,
        surfel: u32,
    ) -> Option<SweptSplat> {
        let bounds = within(view, boxes.hull);
        // False with a NaN.
        if !(bounds[0] <= bounds[1] && bounds[2] <= bounds[3]) {
            return None;
        }
        let [inverse_depth, u, v, u_rate, v_rate] = forms(self.u, self.v, self.motion, self.inverse);
        Some(SweptSplat {
            reference: [0, 1].map(|i| view.raster.axis[i] + self.centre[i] - view.raster.offset[i]),
            inverse_depth,
            u,
            v,
            u_rate,
            v_rate,
            motion: self.motion,
            ends: boxes.ends,
            bounds: bounds.map(|bound| bound as u16),
            surfel,
            flags: if self.area * view.object.handedness < 0.0 { 0 } else { FLAG_BACK },
        })
    }
}

/// The boxes of a kernel before the camera plane. `low_pass`: radius of its low-pass disc, where it is published.
#[inline(always)]
pub(in crate::backend::cpu) fn boxes(view: &SurfelView<'_>, ellipsoid: bool, posed: &Posed, low_pass: f32) -> Boxes {
    let &Posed { centre, motion, u, v } = posed;
    let depth_extent2 = u.z * u.z + v.z * v.z;
    let depths = [centre.z - motion.z, centre.z + motion.z];
    // On the screen the disc grows as it nears: in space it keeps its size.
    let mut ends = [centre - motion, centre + motion].map(|at| end(view, at, u, v, low_pass * (centre.z / at.z)));
    if (if depths[0] < depths[1] { depths[0] } else { depths[1] }) - depth_extent2.sqrt() < view.near {
        ends = clipped(view, posed, low_pass * centre.z).unwrap_or(ends);
    }
    let mut hull = about(&ends[0], &ends[1]);
    if ellipsoid {
        // The dual conic T diag(1, 1, 1, -1) T^t with T = [u v motion centre] (Sigg et al. 2006), and that of the
        // low-pass disc.
        let inverse = 1.0 / centre.z;
        let (x, y) = (centre.x * inverse, centre.y * inverse);
        let reference =
            [view.raster.axis[0] + x - view.raster.offset[0], view.raster.axis[1] + y - view.raster.offset[1]];
        let disc = low_pass * centre.z;
        let d22 = depth_extent2 + motion.z * motion.z - centre.z * centre.z;
        let disc22 = motion.z * motion.z - centre.z * centre.z;
        let low = |a: f32, b: f32| if a < b { a } else { b };
        let high = |a: f32, b: f32| if a > b { a } else { b };
        let bound = |at: f32, [pu, pv, pm]: [f32; 3], reference: f32| {
            let (u_on, v_on, m_on) = (pu - at * u.z, pv - at * v.z, pm - at * motion.z);
            let across = u_on * u_on + v_on * v_on + m_on * m_on;
            let kernel = extent(across, u_on * u.z + v_on * v.z + m_on * motion.z, 1.0 / d22, 0.0);
            let disc = extent(disc * disc + m_on * m_on, m_on * motion.z, 1.0 / disc22, 0.0);
            index_range(reference, low(kernel.0, disc.0), high(kernel.1, disc.1))
        };
        let columns = bound(x, [u.x, v.x, motion.x], reference[0]);
        let rows = bound(y, [u.y, v.y, motion.y], reference[1]);
        hull = [high(hull[0], columns.0), low(hull[1], columns.1), high(hull[2], rows.0), low(hull[3], rows.1)];
    }
    Boxes { ends, hull }
}

/// Pixel columns and rows that bound the kernel and its low-pass disc when its centre is `centre`: the dual conic of
/// the ellipse, as for a splat that does not move. `low_pass` is the disc's radius there.
#[inline(always)]
fn end(view: &SurfelView<'_>, centre: Vec3, u: Vec3, v: Vec3, low_pass: f32) -> [f32; 4] {
    let inverse = 1.0 / centre.z;
    let d22 = u.z * u.z + v.z * v.z - centre.z * centre.z;
    let inverse22 = 1.0 / d22;
    let range = |u: f32, v: f32, centre: f32, i: usize, [uz, vz]: [f32; 2]| {
        let x = centre * inverse;
        let (u, v) = (u - x * uz, v - x * vz);
        let (first, last) = extent(u * u + v * v, u * uz + v * vz, inverse22, low_pass);
        index_range(view.raster.axis[i] + x - view.raster.offset[i], first, last)
    };
    let columns = range(u.x, v.x, centre.x, 0, [u.z, v.z]);
    let rows = range(u.y, v.y, centre.y, 1, [u.z, v.z]);
    [columns.0, columns.1, rows.0, rows.1]
}

/// The box about two boxes.
#[inline(always)]
fn about(a: &[f32; 4], b: &[f32; 4]) -> [f32; 4] {
    [0, 1, 2, 3].map(|i| {
        let lower = a[i] < b[i];
        if lower == (i % 2 == 0) { a[i] } else { b[i] }
    })
}

/// First and last wanted pixel of a box; none where the first is after the last, or a NaN.
#[inline(always)]
fn within(view: &SurfelView<'_>, hull: [f32; 4]) -> [f32; 4] {
    let low = |a: f32, b: f32| if a < b { a } else { b };
    let high = |a: f32, b: f32| if a > b { a } else { b };
    let [x0, x1, y0, y1] = view.pixels.to_array().map(|pixel| pixel as f32);
    [high(hull[0].ceil(), x0), low(hull[1].floor(), x1), high(hull[2].ceil(), y0), low(hull[3].floor(), y1)]
}

/// Boxes wider than that, in pixels, would be too coarse to number pixels.
pub(in crate::backend) const REACH: f32 = 1e9;

/// Pixel columns and rows, as [`end`] has them, that bound at both ends the part of a kernel beyond `near`. Where an
/// end comes nearer, its box holds the places at which the kernel passes `near`. `disc`: radius of the low-pass disc in
/// space. None where there is no such part, or it is too wide.
///
/// The tube lies within the hull of the parallelograms around its ends. What `near` leaves of a hull of points is the
/// hull of the points beyond, and of the places where lines between two points pass `near`.
#[inline(never)]
fn clipped(view: &SurfelView<'_>, posed: &Posed, disc: f32) -> Option<[[f32; 4]; 2]> {
    let &Posed { centre, motion, u, v } = posed;
    let corners = [centre - motion, centre + motion].map(|at| {
        let of_disc = |x: f32, y: f32| Vec3::new(at.x + x, at.y + y, at.z);
        [
            at + u + v,
            at + u - v,
            at - u + v,
            at - u - v,
            of_disc(disc, disc),
            of_disc(disc, -disc),
            of_disc(-disc, disc),
            of_disc(-disc, -disc),
        ]
    });
    let low = |a: f32, b: f32| if a < b { a } else { b };
    let high = |a: f32, b: f32| if a > b { a } else { b };
    let mut boxes = [[f32::MAX, -f32::MAX, f32::MAX, -f32::MAX]; 2];
    for (corners_of_end, out) in corners.iter().zip(&mut boxes) {
        let mut widen = |x: f32, y: f32| *out = [low(out[0], x), high(out[1], x), low(out[2], y), high(out[3], y)];
        for p in corners_of_end {
            if p.z >= view.near {
                widen(p.x / p.z, p.y / p.z);
                continue;
            }
            for q in corners.as_flattened().iter().filter(|q| q.z >= view.near) {
                let t = (view.near - p.z) / (q.z - p.z);
                widen((p.x + (q.x - p.x) * t) / view.near, (p.y + (q.y - p.y) * t) / view.near);
            }
        }
    }
    let with_slack = |[x0, x1, y0, y1]: [f32; 4]| {
        let range = |i: usize, first: f32, last: f32| {
            let (first, last) = (first - SLACK_SHARE * first.abs(), last + SLACK_SHARE * last.abs());
            index_range(view.raster.axis[i] - view.raster.offset[i], first, last)
        };
        let (columns, rows) = (range(0, x0, x1), range(1, y0, y1));
        [columns.0, columns.1, rows.0, rows.1]
    };
    let any = boxes.iter().all(|[x0, x1, ..]| x0 <= x1);
    let ends = boxes.map(with_slack);
    // False with a NaN.
    let bounded = ends.as_flattened().iter().all(|pixel| pixel.abs() <= REACH);
    (any && bounded).then_some(ends)
}

/// A kernel that crosses the camera plane. Pixels are counted from the camera's axis. Where no boxes bound it, its
/// bounds are all wanted pixels.
#[inline(never)]
pub(in crate::backend::cpu) fn crossing(view: &SurfelView<'_>, posed: &Posed, surfel: u32) -> Option<SweptSplat> {
    let &Posed { centre, motion, u, v } = posed;
    let normal = u.cross(v);
    let det = normal.dot(centre);
    let turned = det * view.object.handedness;
    let facing = if view.two_sided { turned.abs() > 0.0 } else { turned < 0.0 };
    let over = 1.0 / det;
    if !(facing && over.is_finite()) {
        return None;
    }
    // The tube is the hull of the discs at its ends.
    let [x0, x1, y0, y1] = view.pixels.to_array();
    let discs = [centre - motion, centre + motion].map(|centre| Disc { centre, u, v });
    let outside =
        |i: usize, wanted: [i32; 2]| is_outside(&discs, i, view.raster.axis[i] - view.raster.offset[i], wanted, 0.0);
    if outside(0, [x0, x1]) || outside(1, [y0, y1]) {
        return None;
    }
    let clipped = clipped(view, posed, 0.0);
    let ends = clipped.unwrap_or_default();
    let mut bounds = view.pixels.bounds([0; 2]);
    if clipped.is_some() {
        let within = within(view, about(&ends[0], &ends[1]));
        // False with a NaN.
        if !(within[0] <= within[1] && within[2] <= within[3]) {
            return None;
        }
        bounds = within.map(|bound| bound as u16);
    }
    Some(SweptSplat {
        reference: [0, 1].map(|i| view.raster.axis[i] - view.raster.offset[i]),
        inverse_depth: (normal * over).to_array(),
        u: (v.cross(centre) * over).to_array(),
        v: (centre.cross(u) * over).to_array(),
        u_rate: (v.cross(motion) * over).to_array(),
        v_rate: (motion.cross(u) * over).to_array(),
        motion: motion.to_array(),
        ends,
        bounds,
        surfel,
        flags: if clipped.is_some() { 0 } else { FLAG_CROSSING } | if turned < 0.0 { 0 } else { FLAG_BACK },
    })
}

//! Pass `project`: surfels to splats; posed, projected, bounded and culled.
//!
//! Math: docs/math.md, "A splat on the screen". In: surfels of one object and its pose. Out: splats in surfel order.
//! Order-free.

use std::ops::Range;

use glam::Vec3;

use super::bounds::{Disc, extent, is_outside, pixel_range, whole};
use super::columns::{Columns, Points, RUN, add_rates, lanes, transform};
use super::land::{Landing, Strip};
use crate::backend::clusters::{Clusters, Window};
use crate::frame::{Blocks, PixelRect, PosedObject, Raster};
use crate::layout::{FLAG_BACK, Splat};
use crate::math::simd::dispatch;
use crate::math::sphere;
use crate::model::Surfels;
use crate::model::paths::Paths;

/// Surfels worked on at once.
pub(in crate::backend) const LANES: usize = 16;
type Lanes = [f32; LANES];
const _: () = assert!(RUN.is_multiple_of(LANES));

/// What `project` needs beside the surfels.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct SurfelView<'a> {
    pub object: &'a PosedObject,
    /// As [`PosedObject::eyes`].
    pub eyes: [Vec3; 2],
    /// By value. Behind a reference its fields are loaded again for every lane, and the pass takes 1.5 times as long.
    pub raster: Raster,
    /// The pixels that are wanted.
    pub pixels: PixelRect,
    /// Pixel from which bounds are counted.
    pub corner: [i32; 2],
    /// Blocks of those pixels that are wanted; `None`: all.
    pub wanted: Option<&'a Blocks>,
    pub near: f32,
    /// Radius of a disc around each centre beyond `near` that bounds hold, too, pixels; +0 without.
    pub centre_disc: f32,
    /// Pixels by which bounds are wider than what a splat touches.
    pub margin: f32,
    pub two_sided: bool,
    /// How the surfels move by themselves.
    pub paths: Paths<'a>,
    /// Clusters of the object's model, where they are known.
    pub clusters: Option<&'a Clusters>,
}

impl SurfelView<'_> {
    /// The strip that is read out while the object moves; `None` where it rests, or all pixels are exposed at once.
    pub(in crate::backend) fn strip(&self) -> Option<Strip> {
        Strip::of(&self.raster).filter(|_| self.object.moves)
    }

    /// May a cluster of the model show anything? Always true over an interval, and where surfels move by themselves:
    /// `Window` knows no motion of either.
    #[inline(never)]
    fn may_show(&self, cluster: usize) -> bool {
        let Some(clusters) = self.clusters.filter(|_| self.paths.is_empty()) else { return true };
        if self.object.moves && self.raster.readout.is_none() {
            return true;
        }
        let (object, raster, blocks) = (self.object, &self.raster, self.wanted);
        let window = Window { object, eyes: self.eyes, raster, pixels: self.pixels, near: self.near, blocks };
        clusters.may_show(cluster, &window, !self.two_sided)
    }

    /// Does a splat with `bounds` touch a block that is wanted? Where blocks are wanted, `corner` is 0.
    #[inline(always)]
    pub(in crate::backend) fn wants(&self, bounds: [u16; 4]) -> bool {
        let Some(blocks) = self.wanted else { return true };
        blocks.touch(self.raster.first, bounds.map(usize::from))
    }
}

/// Numbers of a surfel beside its splat. All but `reference` are about the projected centre, in homogeneous pixel
/// coordinates.
#[derive(Clone, Copy)]
pub(in crate::backend) struct Projected {
    /// Pixel position of the centre.
    pub reference: [f32; 2],
    /// One over the depth of the centre.
    pub inverse: f32,
    /// Axes u and v (x, y, depth).
    pub u: [f32; 3],
    pub v: [f32; 3],
    /// Left and right end of the bounds, then top and bottom: pixels.
    pub ends: [(f32, f32); 2],
}

/// Where splats go to.
pub(in crate::backend) trait Sink {
    /// What it makes of `LANES` surfels, field by field, beside their splats.
    type Lanes: Default;

    /// Makes lane `l`. This is for all surfels, so that the loop over lanes becomes vectors.
    fn lane(&self, projected: &Projected, l: usize, out: &mut Self::Lanes);

    /// Takes an ordinary splat, that of lane `l`.
    fn push(&mut self, splat: Splat, lanes: &Self::Lanes, l: usize);

    /// Takes a splat that crosses the camera plane.
    fn push_crossing(&mut self, splat: Splat);
}

impl Sink for Vec<Splat> {
    type Lanes = ();

    #[inline(always)]
    fn lane(&self, _projected: &Projected, _l: usize, _out: &mut ()) {}

    #[inline(always)]
    fn push(&mut self, splat: Splat, _lanes: &(), _l: usize) {
        self.push(splat);
    }

    fn push_crossing(&mut self, splat: Splat) {
        self.push(splat);
    }
}

dispatch! {
    /// Appends the splats of `surfels[range]` that may touch the wanted pixels, in surfel order.
    pub(in crate::backend) fn project(
        view: &SurfelView<'_>, surfels: &Surfels, range: Range<usize>, out: &mut Vec<Splat>,
    ) = project_body
}

#[inline(always)]
pub(in crate::backend) fn project_body(
    view: &SurfelView<'_>,
    surfels: &Surfels,
    range: Range<usize>,
    out: &mut impl Sink,
) {
    let strip = view.strip();
    let mut run = Run::default();
    let mut first = range.start;
    while first < range.end {
        let at = first..(first / RUN * RUN + RUN).min(range.end);
        if !view.may_show(first / RUN) {
            first = at.end;
            continue;
        }
        run.load(view, surfels, at.clone());
        for lane in (0..at.len()).step_by(LANES) {
            let n = (at.len() - lane).min(LANES);
            match strip {
                None => project_lanes(view, &run, lane, n, (first + lane) as u32, out),
                Some(strip) if strip.axis == 0 => {
                    project_landing::<0, _>(view, &strip, &run, lane, n, (first + lane) as u32, out);
                }
                Some(strip) => project_landing::<1, _>(view, &strip, &run, lane, n, (first + lane) as u32, out),
            }
        }
        first = at.end;
    }
}

/// Surfels of the model, coordinate by coordinate.
struct Run {
    columns: Columns,
    /// How far they travel by themselves from the middle of a strip to its last row.
    advance: Points,
}

impl Default for Run {
    fn default() -> Self {
        Self { columns: Columns::default(), advance: [[0.0; RUN]; 3] }
    }
}

impl Run {
    /// Lanes beyond the range hold surfels of an earlier one.
    #[inline(always)]
    fn load(&mut self, view: &SurfelView<'_>, surfels: &Surfels, range: Range<usize>) {
        self.columns.load(surfels, range.clone());
        add_rates(&mut self.columns.position, &view.paths, range.clone(), view.object.elapsed);
        if view.raster.readout.is_some() && !view.paths.is_empty() {
            self.advance = [[0.0; RUN]; 3];
            add_rates(&mut self.advance, &view.paths, range, view.object.advance);
        }
    }
}

/// `n` surfels, from surfel `first` of the run on; `surfel` is the index of that one in the model.
#[inline(always)]
fn project_lanes<S: Sink>(view: &SurfelView<'_>, run: &Run, first: usize, n: usize, surfel: u32, out: &mut S) {
    let [position, axis_u, axis_v] = run.columns.lanes(first);
    if !view.two_sided && !view.object.moves && all_face_away(view.object.eye, &position, &axis_u, &axis_v) {
        return;
    }
    let mut posed = PosedLanes {
        centre: transform(&view.object.centre_from_model, view.object.centre_origin, &position),
        u: transform(&view.object.screen_from_model, Vec3::ZERO, &axis_u),
        v: transform(&view.object.screen_from_model, Vec3::ZERO, &axis_v),
        sine: [0.0; LANES],
    };
    if view.object.spheres != 0.0 {
        (0..LANES).for_each(|l| posed.face_eye(view, &axis_u, l));
    }
    let mut shape = SplatLanes::default();
    let mut of_sink = S::Lanes::default();
    for l in 0..LANES {
        let projected = project_lane::<1>(view, &posed, l, None, &mut shape);
        out.lane(&projected, l, &mut of_sink);
    }
    push_lanes(view, &posed, &shape, &of_sink, n, surfel, out);
}

/// The same on a strip that is read out while the object moves: each surfel is posed when the row is read out on which
/// it lands.
#[inline(always)]
fn project_landing<const AXIS: usize, S: Sink>(
    view: &SurfelView<'_>,
    strip: &Strip,
    run: &Run,
    first: usize,
    n: usize,
    surfel: u32,
    out: &mut S,
) {
    let object = view.object;
    let [position, axis_u, axis_v] = run.columns.lanes(first);
    let away = |eye: Vec3| all_face_away(eye, &position, &axis_u, &axis_v);
    if !view.two_sided && view.paths.is_empty() && away(object.eye) && view.eyes.into_iter().all(away) {
        return;
    }
    let mut posed = PosedLanes {
        centre: transform(&object.centre_from_model, object.centre_origin, &position),
        u: transform(&object.screen_from_model, Vec3::ZERO, &axis_u),
        v: transform(&object.screen_from_model, Vec3::ZERO, &axis_v),
        sine: [0.0; LANES],
    };
    let motion = [
        transform(&object.motion_from_model, object.motion_origin, &position),
        transform(&object.motion_from_model, Vec3::ZERO, &axis_u),
        transform(&object.motion_from_model, Vec3::ZERO, &axis_v),
    ];
    let advance = transform(&object.centre_from_model, Vec3::ZERO, &lanes(&run.advance, first));
    let mut shape = SplatLanes::default();
    let mut of_sink = S::Lanes::default();
    for l in 0..LANES {
        let of = |m: &[Lanes; 3]| [m[0][l], m[1][l], m[2][l]];
        let [moved, by_itself] = [of(&motion[0]), of(&advance)];
        let travel = [moved[0] + by_itself[0], moved[1] + by_itself[1], moved[2] + by_itself[2]];
        let landing = Landing::new::<AXIS>(strip, of(&posed.centre), travel);
        for i in 0..3 {
            posed.centre[i][l] += landing.time * travel[i];
            posed.u[i][l] += landing.time * motion[1][i][l];
            posed.v[i][l] += landing.time * motion[2][i][l];
        }
        if object.spheres != 0.0 {
            posed.face_eye(view, &axis_u, l);
        }
        let projected = project_lane::<AXIS>(view, &posed, l, Some(&landing), &mut shape);
        out.lane(&projected, l, &mut of_sink);
    }
    push_lanes(view, &posed, &shape, &of_sink, n, surfel, out);
}

/// Hands those of `n` lanes on that show anything.
#[inline(always)]
fn push_lanes<S: Sink>(
    view: &SurfelView<'_>,
    posed: &PosedLanes,
    shape: &SplatLanes,
    of_sink: &S::Lanes,
    n: usize,
    surfel: u32,
    out: &mut S,
) {
    // Bits instead of a test for each lane, which would often be predicted wrong.
    let mut shown = 0_u32;
    for l in 0..LANES {
        shown |= u32::from(shape.kind[l] != CULLED) << l;
    }
    shown &= (1 << n) - 1;
    while shown != 0 {
        let l = shown.trailing_zeros() as usize & (LANES - 1);
        shown &= shown - 1;
        if shape.kind[l] == CROSSING {
            push_crossing(view, posed, l, surfel + l as u32, out);
            continue;
        }
        let bounds = [shape.bounds[0][l], shape.bounds[1][l], shape.bounds[2][l], shape.bounds[3][l]];
        if view.wants(bounds) {
            let splat = ordinary(shape, l, bounds, surfel + l as u32);
            out.push(splat, of_sink, l);
        }
    }
}

/// Screen-space centres and axes of `LANES` surfels: homogeneous pixel coordinates (x, y, depth).
struct PosedLanes {
    centre: [Lanes; 3],
    u: [Lanes; 3],
    v: [Lanes; 3],
    /// Radius over distance, of spheres; else 0.
    sine: Lanes,
}

impl PosedLanes {
    /// Turns a disc into that of a sphere, whose radius is the length of `axis` in the model.
    #[inline(always)]
    fn face_eye(&mut self, view: &SurfelView<'_>, axis: &[Lanes; 3], l: usize) {
        let focal = view.raster.focal;
        let radius = (axis[0][l] * axis[0][l] + axis[1][l] * axis[1][l] + axis[2][l] * axis[2][l]).sqrt();
        let [x, y, depth] = [0, 1, 2].map(|i: usize| self.centre[i][l]);
        let disc = sphere::outline([x / focal, y / focal, depth], radius * view.object.spheres);
        let [u, v] = disc.across;
        for i in 0..3 {
            let scale = disc.radius * if i < 2 { focal } else { 1.0 };
            self.centre[i][l] *= disc.nearer;
            (self.u[i][l], self.v[i][l]) = (u[i] * scale, v[i] * scale);
        }
        self.sine[l] = disc.sine;
    }
}

/// Does every surfel clearly show its back to the eye, by more than rounding? In model space.
///
/// A quick way out on the far side of a model: neighbours in memory are neighbours in space.
#[inline(always)]
fn all_face_away(eye: Vec3, p: &[Lanes; 3], u: &[Lanes; 3], v: &[Lanes; 3]) -> bool {
    const MARGIN: f32 = 1e-3;
    let eye = eye.to_array();
    let mut may_face = 0_u32;
    for l in 0..LANES {
        let n = [
            u[1][l] * v[2][l] - u[2][l] * v[1][l],
            u[2][l] * v[0][l] - u[0][l] * v[2][l],
            u[0][l] * v[1][l] - u[1][l] * v[0][l],
        ];
        let d = [p[0][l] - eye[0], p[1][l] - eye[1], p[2][l] - eye[2]];
        let towards = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
        let n2 = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        let d2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        let away = (towards > 0.0) & (towards * towards > MARGIN * MARGIN * (n2 * d2));
        may_face |= u32::from(!away);
    }
    may_face == 0
}

/// No splat is made of the surfel.
pub(in crate::backend) const CULLED: u32 = 0;
/// The surfel lies before the camera plane.
pub(in crate::backend) const ORDINARY: u32 = 1;
/// The surfel reaches the camera plane.
pub(in crate::backend) const CROSSING: u32 = 2;

/// The splats of `LANES` surfels, field by field.
#[derive(Default)]
struct SplatLanes {
    kind: [u32; LANES],
    reference: [Lanes; 2],
    inverse_depth: [Lanes; 3],
    u: [Lanes; 2],
    v: [Lanes; 2],
    centre_depth: Lanes,
    /// As `PixelRect::bounds` has them, counted from the view's corner.
    bounds: [[u16; LANES]; 4],
    flags: [u32; LANES],
}

/// Culls by facing, depth and pixels wanted; bounds the ellipse by its dual conic, D = T diag(1, 1, -1) T^t with
/// T = [u v centre] (Sigg et al. 2006; docs/math.md): exact in perspective.
#[inline(always)]
fn project_lane<const AXIS: usize>(
    view: &SurfelView<'_>,
    posed: &PosedLanes,
    l: usize,
    landing: Option<&Landing>,
    shape: &mut SplatLanes,
) -> Projected {
    let depth = posed.centre[2][l];
    let inverse = 1.0 / depth;
    let x = posed.centre[0][l] * inverse;
    let y = posed.centre[1][l] * inverse;
    let (ud, vd) = (posed.u[2][l], posed.v[2][l]);
    let (ux, uy) = (posed.u[0][l] - x * ud, posed.u[1][l] - y * ud);
    let (vx, vy) = (posed.v[0][l] - x * vd, posed.v[1][l] - y * vd);
    // Signed area of the projected axes. A splat with det [u v centre] < 0 faces the viewer. One that is seen edge-on,
    // or has a NaN, covers nothing.
    let area = ux * vy - uy * vx;
    let det = area * depth * view.object.handedness;
    let facing = if view.two_sided { det.abs() > 0.0 } else { det < 0.0 };
    let shows_back = area * view.object.handedness >= 0.0;
    // What rows beside the centre's see, they see earlier or later.
    let (mut recede, mut shift) = ([0.0; 2], [0.0; 2]);
    let ([ux, uy], [vx, vy], area) = match landing {
        None => ([ux, uy], [vx, vy], area),
        Some(landing) => {
            recede[AXIS] = landing.recede;
            shift = landing.shift;
            let (u, v) = (landing.displaced::<AXIS>([ux, uy]), landing.displaced::<AXIS>([vx, vy]));
            (u, v, landing.along * area)
        }
    };

    let depth_extent2 = ud * ud + vd * vd;
    let d22 = depth_extent2 - depth * depth;
    let behind = depth + depth_extent2.sqrt() < view.near;
    let crossing = (depth <= 0.0) | (d22 > -1e-3 * depth * depth);
    let disc = if depth >= view.near { view.centre_disc } else { 0.0 };
    let inverse22 = 1.0 / d22;
    let mut reference_x = view.raster.axis[0] + x - view.raster.offset[0];
    let mut reference_y = view.raster.axis[1] + y - view.raster.offset[1];
    if landing.is_some() {
        reference_x += shift[0];
        reference_y += shift[1];
    }
    let PixelRect { first_column, last_column, first_row, last_row } = view.pixels;
    let (left, right) = extent(ux * ux + vx * vx, ux * ud + vx * vd, inverse22, disc);
    let (top, bottom) = extent(uy * uy + vy * vy, uy * ud + vy * vd, inverse22, disc);
    let margin = view.margin;
    let columns = pixel_range(reference_x, left - margin, right + margin, first_column, last_column);
    let rows = pixel_range(reference_y, top - margin, bottom + margin, first_row, last_row);
    let seen = (columns.0 <= columns.1) & (rows.0 <= rows.1);

    let over_area = 1.0 / area;
    let over_both = over_area * inverse;
    shape.reference[0][l] = reference_x;
    shape.reference[1][l] = reference_y;
    shape.inverse_depth[0][l] = (uy * vd - ud * vy) * over_both;
    shape.inverse_depth[1][l] = (ud * vx - ux * vd) * over_both;
    if landing.is_some() {
        shape.inverse_depth[0][l] -= recede[0] * inverse * inverse;
        shape.inverse_depth[1][l] -= recede[1] * inverse * inverse;
    }
    shape.inverse_depth[2][l] = inverse;
    shape.u[0][l] = vy * over_area;
    shape.u[1][l] = -vx * over_area;
    shape.v[0][l] = -uy * over_area;
    shape.v[1][l] = ux * over_area;
    let of_disc = if depth >= view.near { depth } else { 0.0 };
    shape.centre_depth[l] = if posed.sine[l] > 0.0 { -posed.sine[l] } else { of_disc };
    let corner = [view.corner[0] as f32, view.corner[1] as f32];
    shape.bounds[0][l] = whole(columns.0 - corner[0]);
    shape.bounds[1][l] = whole(columns.1 - corner[0]);
    shape.bounds[2][l] = whole(rows.0 - corner[1]);
    shape.bounds[3][l] = whole(rows.1 - corner[1]);
    shape.flags[l] = if shows_back { FLAG_BACK } else { 0 };
    let ordinary = if seen { ORDINARY } else { CULLED };
    let kind = if crossing { CROSSING } else { ordinary };
    shape.kind[l] = if facing & !behind { kind } else { CULLED };
    Projected {
        reference: [reference_x, reference_y],
        inverse,
        u: [ux, uy, ud],
        v: [vx, vy, vd],
        ends: [(left, right), (top, bottom)],
    }
}

#[inline(always)]
fn ordinary(shape: &SplatLanes, l: usize, bounds: [u16; 4], surfel: u32) -> Splat {
    let three = |form: &[Lanes; 3]| [form[0][l], form[1][l], form[2][l]];
    Splat {
        reference: [shape.reference[0][l], shape.reference[1][l]],
        inverse_depth: three(&shape.inverse_depth),
        u: [shape.u[0][l], shape.u[1][l], 0.0],
        v: [shape.v[0][l], shape.v[1][l], 0.0],
        centre_depth: shape.centre_depth[l],
        bounds,
        surfel,
        flags: shape.flags[l],
    }
}

/// A splat that crosses the camera plane. It is bounded by the part of its disc beyond `near`, and pixels are counted
/// from the camera's axis.
#[inline(never)]
fn push_crossing(view: &SurfelView<'_>, posed: &PosedLanes, l: usize, surfel: u32, out: &mut impl Sink) {
    let column = |m: &[Lanes; 3]| Vec3::new(m[0][l], m[1][l], m[2][l]);
    let (c, u, v) = (column(&posed.centre), column(&posed.u), column(&posed.v));
    let normal = u.cross(v);
    let det = normal.dot(c);
    let over = 1.0 / det;
    if !over.is_finite() {
        return;
    }
    let Some(bounds) = crossing_bounds(view, &Disc { centre: c, u, v }).filter(|&bounds| view.wants(bounds)) else {
        return;
    };
    out.push_crossing(Splat {
        reference: [0, 1].map(|i| view.raster.axis[i] - view.raster.offset[i]),
        inverse_depth: (normal * over).to_array(),
        u: (v.cross(c) * over).to_array(),
        v: (c.cross(u) * over).to_array(),
        centre_depth: 0.0 - posed.sine[l],
        bounds,
        surfel,
        flags: if det * view.object.handedness < 0.0 { 0 } else { FLAG_BACK },
    });
}

/// Bounds of a disc that crosses the camera plane; `None` where it shows on no wanted pixel.
fn crossing_bounds(view: &SurfelView<'_>, disc: &Disc) -> Option<[u16; 4]> {
    let [x0, x1, y0, y1] = view.pixels.to_array();
    let origin = [0, 1].map(|i| view.raster.axis[i] - view.raster.offset[i]);
    let wanted = [[x0, x1], [y0, y1]];
    if (0..2).any(|i| is_outside(&[*disc], i, origin[i], wanted[i], view.margin)) {
        return None;
    }
    let ends = disc.beyond_near(view.near)?;
    if !ends.as_flattened().iter().all(|end| end.is_finite()) {
        // Numbers beyond the range of floats bound nothing.
        return Some(view.pixels.bounds(view.corner));
    }
    let [columns, rows] = [0, 1].map(|i| {
        let [low, high] = ends[i];
        let (first, last) = pixel_range(origin[i], low - view.margin, high + view.margin, wanted[i][0], wanted[i][1]);
        [first, last]
    });
    let seen = columns[0] <= columns[1] && rows[0] <= rows[1];
    let corner = view.corner.map(|c| c as f32);
    let from_corner = [columns[0] - corner[0], columns[1] - corner[0], rows[0] - corner[1], rows[1] - corner[1]];
    seen.then(|| from_corner.map(whole))
}

#[cfg(test)]
#[allow(clippy::print_stdout, reason = "tests may report")]
mod tests;

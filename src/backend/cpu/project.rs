//! Pass `project`: surfels to splats; posed, projected, bounded and culled.
//!
//! Math: docs/math.md, "A splat on the screen". In: surfels of one object and its pose. Out: splats in surfel order.
//! Order-free.

use std::ops::Range;

use glam::{Mat3, Vec3};

use crate::backend::clusters::{CLUSTER, Clusters, Window};
use crate::frame::{Blocks, PosedObject, Raster};
use crate::layout::{FLAG_BACK, Splat};
use crate::math::simd::dispatch;
use crate::model::Surfels;

/// Surfels worked on at once.
const LANES: usize = 16;
type Lanes = [f32; LANES];
/// Surfels turned from points into coordinates at once; whole blocks.
const RUN: usize = CLUSTER;
const _: () = assert!(RUN.is_multiple_of(LANES));

/// Slack of screen bounds, pixels plus a share of the size: they must not be too small by rounding.
const SLACK: f32 = 1e-3;
const SLACK_SHARE: f32 = 1e-5;

/// What `project` needs beside the surfels.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct View<'a> {
    pub object: &'a PosedObject,
    /// By value: behind a reference its fields are loaded anew for every lane, which took half as long again.
    pub raster: Raster,
    /// First and last pixel column, first and last row, of what is wanted.
    pub pixels: [i32; 4],
    /// Pixel from which bounds are counted.
    pub corner: [i32; 2],
    /// Blocks of those pixels that are wanted; `None`: all.
    pub wanted: Option<&'a Blocks>,
    pub near: f32,
    /// With the low-pass disc?
    pub low_pass: bool,
    pub two_sided: bool,
    /// Of the object's model, where it is known.
    pub clusters: Option<&'a Clusters>,
}

impl View<'_> {
    /// May a cluster of the model show anything? Over an interval centres travel apart from what `Window` holds.
    #[inline(never)]
    fn may_show(&self, cluster: usize) -> bool {
        let Some(clusters) = self.clusters.filter(|_| !self.object.moves) else { return true };
        let (object, raster, blocks) = (self.object, &self.raster, self.wanted);
        let window = Window { object, raster, pixels: self.pixels, near: self.near, blocks };
        clusters.may_show(cluster, &window, !self.two_sided)
    }

    /// Does a splat touch a block that is wanted? `bounds`: first and last pixel column, first and last row, from `corner`, which is 0
    /// where blocks are wanted.
    #[inline(always)]
    pub(in crate::backend) fn wants(&self, bounds: [u16; 4]) -> bool {
        let Some(blocks) = self.wanted else { return true };
        let [x0, x1, y0, y1] = bounds.map(usize::from);
        let of = |first: usize, last: usize| first / Blocks::EDGE..=last / Blocks::EDGE;
        of(y0, y1).any(|y| of(x0, x1).any(|x| blocks.at(x, y)))
    }
}

dispatch! {
    /// Appends the splats of `surfels[range]` that may touch the wanted pixels, in surfel order.
    pub(in crate::backend) fn project(view: &View<'_>, surfels: &Surfels, range: Range<usize>, out: &mut Vec<Splat>) = project_body
}

#[inline(always)]
fn project_body(view: &View<'_>, surfels: &Surfels, range: Range<usize>, out: &mut Vec<Splat>) {
    let mut run = Run::default();
    let mut first = range.start;
    while first < range.end {
        let at = first..(first / RUN * RUN + RUN).min(range.end);
        if !view.may_show(first / RUN) {
            first = at.end;
            continue;
        }
        run.load(surfels, at.clone());
        for block in (0..at.len()).step_by(LANES) {
            let n = (at.len() - block).min(LANES);
            project_block(view, &run, block, n, (first + block) as u32, out);
        }
        first = at.end;
    }
}

/// Surfels of the model, coordinate by coordinate.
struct Run {
    position: [[f32; RUN]; 3],
    axis_u: [[f32; RUN]; 3],
    axis_v: [[f32; RUN]; 3],
}

impl Default for Run {
    fn default() -> Self {
        Self { position: [[0.0; RUN]; 3], axis_u: [[0.0; RUN]; 3], axis_v: [[0.0; RUN]; 3] }
    }
}

impl Run {
    /// What lies beyond the range is left of an earlier one.
    #[inline(always)]
    fn load(&mut self, surfels: &Surfels, range: Range<usize>) {
        split(&surfels.position[range.clone()], &mut self.position);
        split(&surfels.axis_u[range.clone()], &mut self.axis_u);
        split(&surfels.axis_v[range], &mut self.axis_v);
    }
}

/// A loop over many points, as compilers turn few of them into single moves.
#[inline(always)]
fn split(points: &[Vec3], [x, y, z]: &mut [[f32; RUN]; 3]) {
    let flat: &[[f32; 3]] = bytemuck::cast_slice(points);
    for (((point, x), y), z) in flat.iter().zip(x).zip(y).zip(z) {
        [*x, *y, *z] = *point;
    }
}

/// `n` surfels that begin at `first` of the run.
#[inline(always)]
fn project_block(view: &View<'_>, run: &Run, first: usize, n: usize, surfel: u32, out: &mut Vec<Splat>) {
    let (position, axis_u, axis_v) =
        (lanes(&run.position, first), lanes(&run.axis_u, first), lanes(&run.axis_v, first));
    if !view.two_sided && !view.object.moves && all_face_away(view.object, &position, &axis_u, &axis_v) {
        return;
    }
    let block = Block {
        centre: transform(&view.object.centre_from_model, view.object.centre_origin, &position),
        u: transform(&view.object.screen_from_model, Vec3::ZERO, &axis_u),
        v: transform(&view.object.screen_from_model, Vec3::ZERO, &axis_v),
    };
    let mut shape = Shape::default();
    for l in 0..LANES {
        project_lane(view, &block, l, &mut shape);
    }
    // Bits instead of a test for each lane, which would often be predicted wrong.
    let mut kept = 0_u32;
    for l in 0..LANES {
        kept |= u32::from(shape.kind[l] != CULLED) << l;
    }
    kept &= (1 << n) - 1;
    while kept != 0 {
        let l = kept.trailing_zeros() as usize & (LANES - 1);
        kept &= kept - 1;
        if shape.kind[l] == CROSSING {
            push_crossing(view, &block, l, surfel + l as u32, out);
            continue;
        }
        let bounds = [shape.bounds[0][l], shape.bounds[1][l], shape.bounds[2][l], shape.bounds[3][l]];
        if view.wants(bounds) {
            push_ordinary(&shape, l, bounds, surfel + l as u32, out);
        }
    }
}

/// Screen-space centre and axes of a block of surfels: homogeneous pixel coordinates (x, y, depth).
struct Block {
    centre: [Lanes; 3],
    u: [Lanes; 3],
    v: [Lanes; 3],
}

#[inline(always)]
fn lanes(run: &[[f32; RUN]; 3], first: usize) -> [Lanes; 3] {
    let mut out = [[0.0; LANES]; 3];
    for c in 0..3 {
        out[c].copy_from_slice(&run[c][first..][..LANES]);
    }
    out
}

/// m p + origin, for `N` points coordinate by coordinate.
#[inline(always)]
pub(in crate::backend) fn transform<const N: usize>(m: &Mat3, origin: Vec3, p: &[[f32; N]; 3]) -> [[f32; N]; 3] {
    let m = m.to_cols_array_2d();
    let origin = origin.to_array();
    let mut out = [[0.0; N]; 3];
    for row in 0..3 {
        for l in 0..N {
            out[row][l] = m[0][row] * p[0][l] + m[1][row] * p[1][l] + m[2][row] * p[2][l] + origin[row];
        }
    }
    out
}

/// A quick way out for blocks that lie on the far side (neighbours in memory are neighbours in space): true only if every
/// surfel clearly shows its back, by more than rounding, to the eye in model space.
#[inline(always)]
fn all_face_away(object: &PosedObject, p: &[Lanes; 3], u: &[Lanes; 3], v: &[Lanes; 3]) -> bool {
    const MARGIN: f32 = 1e-3;
    let eye = object.eye.to_array();
    let mut kept = 0_u32;
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
        kept |= u32::from(!away);
    }
    kept == 0
}

const CULLED: u32 = 0;
const ORDINARY: u32 = 1;
const CROSSING: u32 = 2;

/// A block's splats, field by field.
#[derive(Default)]
struct Shape {
    kind: [u32; LANES],
    reference: [Lanes; 2],
    inverse_depth: [Lanes; 3],
    u: [Lanes; 2],
    v: [Lanes; 2],
    centre_depth: Lanes,
    /// First and last pixel column, then first and last row, from the view's corner.
    bounds: [[u16; LANES]; 4],
    flags: [u32; LANES],
}

/// Culls by facing, depth and pixels wanted; bounds the ellipse by its dual conic, D = T diag(1, 1, -1) T^t with
/// T = [u v centre] (Sigg et al. 2006; docs/math.md): exact in perspective.
#[inline(always)]
fn project_lane(view: &View<'_>, block: &Block, l: usize, shape: &mut Shape) {
    let depth = block.centre[2][l];
    let inverse = 1.0 / depth;
    let x = block.centre[0][l] * inverse;
    let y = block.centre[1][l] * inverse;
    let (ud, vd) = (block.u[2][l], block.v[2][l]);
    let (ux, uy) = (block.u[0][l] - x * ud, block.u[1][l] - y * ud);
    let (vx, vy) = (block.v[0][l] - x * vd, block.v[1][l] - y * vd);
    // Signed area of the projected axes. det [u v centre] < 0 faces the viewer; a splat seen edge-on (or with a NaN) covers
    // nothing.
    let area = ux * vy - uy * vx;
    let det = area * depth * view.object.handedness;
    let facing = if view.two_sided { det.abs() > 0.0 } else { det < 0.0 };

    let reach2 = ud * ud + vd * vd;
    let d22 = reach2 - depth * depth;
    let behind = depth + reach2.sqrt() < view.near;
    let crossing = (depth <= 0.0) | (d22 > -1e-3 * depth * depth);
    let low_pass = if view.low_pass & (depth >= view.near) { view.raster.low_pass } else { 0.0 };
    let inverse22 = 1.0 / d22;
    let reference_x = view.raster.axis[0] + x - view.raster.offset[0];
    let reference_y = view.raster.axis[1] + y - view.raster.offset[1];
    let [x0, x1, y0, y1] = view.pixels;
    let (left, right) = extent(ux * ux + vx * vx, ux * ud + vx * vd, d22, inverse22, low_pass);
    let (top, bottom) = extent(uy * uy + vy * vy, uy * ud + vy * vd, d22, inverse22, low_pass);
    let columns = pixel_range(reference_x, left, right, x0, x1);
    let rows = pixel_range(reference_y, top, bottom, y0, y1);
    let seen = (columns.0 <= columns.1) & (rows.0 <= rows.1);

    let over_area = 1.0 / area;
    let over_both = over_area * inverse;
    shape.reference[0][l] = reference_x;
    shape.reference[1][l] = reference_y;
    shape.inverse_depth[0][l] = (uy * vd - ud * vy) * over_both;
    shape.inverse_depth[1][l] = (ud * vx - ux * vd) * over_both;
    shape.inverse_depth[2][l] = inverse;
    shape.u[0][l] = vy * over_area;
    shape.u[1][l] = -vx * over_area;
    shape.v[0][l] = -uy * over_area;
    shape.v[1][l] = ux * over_area;
    shape.centre_depth[l] = if depth >= view.near { depth } else { 0.0 };
    let corner = [view.corner[0] as f32, view.corner[1] as f32];
    shape.bounds[0][l] = whole(columns.0 - corner[0]);
    shape.bounds[1][l] = whole(columns.1 - corner[0]);
    shape.bounds[2][l] = whole(rows.0 - corner[1]);
    shape.bounds[3][l] = whole(rows.1 - corner[1]);
    shape.flags[l] = if area * view.object.handedness < 0.0 { 0 } else { FLAG_BACK };
    let ordinary = if seen { ORDINARY } else { CULLED };
    let kind = if crossing { CROSSING } else { ordinary };
    shape.kind[l] = if facing & !behind { kind } else { CULLED };
}

/// Ends of the ellipse along one axis, relative to the projected centre and widened to the low-pass disc: the roots of
/// d22 k^2 - 2 d02 k + d00 = 0 for d22 < 0.
#[inline(always)]
pub(in crate::backend) fn extent(d00: f32, d02: f32, d22: f32, inverse22: f32, low_pass: f32) -> (f32, f32) {
    let disc = d02 * d02 - d00 * d22;
    let half = (if disc > 0.0 { disc } else { 0.0 }).sqrt() * -inverse22;
    let middle = d02 * inverse22;
    let (low, high) = (middle - half, middle + half);
    (if low < -low_pass { low } else { -low_pass }, if high > low_pass { high } else { low_pass })
}

/// First and last pixel whose sample position may lie in [low, high] about `reference`, cut to [first, last]; none if the
/// first is not at most the last (also with a NaN).
#[inline(always)]
fn pixel_range(reference: f32, low: f32, high: f32, first: i32, last: i32) -> (f32, f32) {
    let slack = SLACK + SLACK_SHARE * (high - low) + reference.abs() * f32::EPSILON;
    let a = (reference + low - slack - 0.5).ceil();
    let b = (reference + high + slack - 0.5).floor();
    // A NaN stays one, and fails the comparison of first with last.
    let a = if a < first as f32 { first as f32 } else { a };
    let b = if b > last as f32 { last as f32 } else { b };
    (a, b)
}

/// A whole number from 0 to 65535 as an integer: a cast, which saturates, would block vector code.
#[inline(always)]
fn whole(x: f32) -> u16 {
    /// 2^23: adding it leaves the number in the low bits of the mantissa.
    const SHIFT: f32 = 8_388_608.0;
    ((x + SHIFT).to_bits() & 0xffff) as u16
}

#[inline(always)]
fn push_ordinary(shape: &Shape, l: usize, bounds: [u16; 4], surfel: u32, out: &mut Vec<Splat>) {
    let three = |form: &[Lanes; 3]| [form[0][l], form[1][l], form[2][l]];
    out.push(Splat {
        reference: [shape.reference[0][l], shape.reference[1][l]],
        inverse_depth: three(&shape.inverse_depth),
        u: [shape.u[0][l], shape.u[1][l], 0.0],
        v: [shape.v[0][l], shape.v[1][l], 0.0],
        centre_depth: shape.centre_depth[l],
        bounds,
        surfel,
        flags: shape.flags[l],
    });
}

/// Pixels, as bounds counted from the view's corner.
#[inline(always)]
pub(in crate::backend) fn bounds(view: &View<'_>, [x0, x1, y0, y1]: [i32; 4]) -> [u16; 4] {
    let [x, y] = view.corner;
    [(x0 - x) as u16, (x1 - x) as u16, (y0 - y) as u16, (y1 - y) as u16]
}

/// A splat that reaches the camera plane: its bounds are all that is wanted, and pixels are counted from the camera's axis.
#[inline(never)]
fn push_crossing(view: &View<'_>, block: &Block, l: usize, surfel: u32, out: &mut Vec<Splat>) {
    let column = |m: &[Lanes; 3]| Vec3::new(m[0][l], m[1][l], m[2][l]);
    let (c, u, v) = (column(&block.centre), column(&block.u), column(&block.v));
    let normal = u.cross(v);
    let det = normal.dot(c);
    let over = 1.0 / det;
    if !over.is_finite() {
        return;
    }
    out.push(Splat {
        reference: [0, 1].map(|i| view.raster.axis[i] - view.raster.offset[i]),
        inverse_depth: (normal * over).to_array(),
        u: (v.cross(c) * over).to_array(),
        v: (c.cross(u) * over).to_array(),
        centre_depth: 0.0,
        bounds: bounds(view, view.pixels),
        surfel,
        flags: if det * view.object.handedness < 0.0 { 0 } else { FLAG_BACK },
    });
}

#[cfg(test)]
#[allow(clippy::print_stdout, reason = "tests may report")]
mod tests {
    use std::sync::Arc;

    use glam::Quat;

    use super::*;
    use crate::backend::clusters::ClusterStore;
    use crate::math::random::Random;

    /// A sphere of round surfels.
    fn ball(n: u32) -> Surfels {
        let mut surfels = Surfels::default();
        for i in 0..n {
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / n as f32;
            let (sin, cos) = (i as f32 * 2.399_963).sin_cos();
            let normal = Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
            let (u, v) = normal.any_orthonormal_pair();
            surfels.position.push(normal);
            surfels.axis_u.push(u * 4.0 / (n as f32).sqrt());
            surfels.axis_v.push(v * 4.0 / (n as f32).sqrt());
            surfels.normal.push(normal);
            surfels.colour.push(Vec3::ONE);
        }
        surfels.spatially_ordered()
    }

    /// Clusters that are left out hold no splat: near and far, partly off the image, mirrored, seen from within, with wild surfels.
    #[test]
    fn pieces_that_are_left_out_hold_nothing() {
        let mut random = Random(5);
        let mut ball = ball(20_000);
        for wild in [f32::NAN, f32::INFINITY, 1e30] {
            let at = (random.next() * ball.len() as f32) as usize;
            ball.position[at].x = wild;
            let other = ball.len() - 1 - at;
            ball.axis_u[other].y = wild;
        }
        let ball = Arc::new(ball);
        let clusters = ClusterStore::default().of(&ball);
        let (mut left_out, mut all, mut kept) = (0, 0, 0);
        for case in 0..200 {
            let mut linear = Mat3::from_quat(Quat::from_vec4(random.vector().extend(random.next()).normalize()));
            let handedness = if case % 3 == 0 { -1.0 } else { 1.0 };
            linear.x_axis *= handedness * (0.5 + random.next());
            let origin = random.vector() * Vec3::new(1.5, 1.5, 3.0) - 2.5 * Vec3::Z;
            let k = Mat3::from_diagonal(Vec3::new(90.0, -90.0, -1.0));
            let (screen_from_model, screen_origin) = (k * linear, k * origin);
            let object = PosedObject {
                visible: true,
                screen_from_model,
                screen_origin,
                centre_from_model: screen_from_model,
                centre_origin: screen_origin,
                motion_from_model: Mat3::ZERO,
                motion_origin: Vec3::ZERO,
                moves: false,
                eye: -(screen_from_model.inverse() * screen_origin),
                screen_rate: Mat3::ZERO,
                screen_origin_rate: Vec3::ZERO,
                normal_matrix: Mat3::IDENTITY,
                world_from_model: linear,
                world_origin: origin,
                handedness,
                epsilon: 0.0,
            };
            let raster = Raster {
                size: [64; 2],
                phase: [0; 2],
                axis: [32.0; 2],
                focal: 90.0,
                low_pass: std::f32::consts::SQRT_2,
                offset: [0.3, -0.4],
            };
            let whole = View {
                object: &object,
                raster,
                pixels: [0, 63, 0, 63],
                corner: [0; 2],
                wanted: None,
                near: 0.1,
                low_pass: case % 2 == 0,
                two_sided: case % 5 == 0,
                clusters: None,
            };
            let view = View { clusters: Some(&clusters), ..whole };
            let (mut want, mut got) = (Vec::new(), Vec::new());
            project(&whole, &ball, 0..ball.len(), &mut want);
            project(&view, &ball, 0..ball.len(), &mut got);
            assert!(got == want, "case {case}: {} of {} splats", got.len(), want.len());
            let count = ball.len().div_ceil(CLUSTER);
            all += count;
            left_out += (0..count).filter(|&cluster| !view.may_show(cluster)).count();
            kept += want.len();
        }
        println!("{left_out} of {all} clusters left out, {kept} splats");
        assert!(left_out * 3 > all && kept > 100_000);
    }
}

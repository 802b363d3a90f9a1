//! Pass `project`: surfels to splats; posed, projected, bounded and culled.
//!
//! Math: docs/math.md, "A splat on the screen". In: surfels of one object and its pose. Out: splats in surfel order.
//! Order-free.

use std::ops::Range;

use glam::{Mat3, Vec3};

use crate::frame::PosedObject;
use crate::layout::{FLAG_BACK, Splat};
use crate::math::simd::dispatch;
use crate::model::Surfels;

/// Surfels worked on at once.
const LANES: usize = 16;
type Lanes = [f32; LANES];

/// Radius of the low-pass disc of the approximate EWA filter, pixels (Botsch et al. 2005; thesis 4.2.3).
pub(super) const LOW_PASS: f32 = std::f32::consts::SQRT_2;

/// Slack of screen bounds, pixels plus a share of the size: they must not be too small by rounding.
const SLACK: f32 = 1e-3;
const SLACK_SHARE: f32 = 1e-5;

/// What `project` needs beside the surfels.
#[derive(Clone, Copy, Debug)]
pub(super) struct View<'a> {
    pub object: &'a PosedObject,
    /// Image size, pixels.
    pub size: [u32; 2],
    /// Sub-pixel offset of the sample.
    pub offset: [f32; 2],
    /// First and last pixel column, first and last row, of what is wanted.
    pub pixels: [i32; 4],
    pub near: f32,
    /// With the low-pass disc?
    pub low_pass: bool,
    pub two_sided: bool,
}

dispatch! {
    /// Appends the splats of `surfels[range]` that may touch the wanted pixels, in surfel order.
    fn project(view: &View<'_>, surfels: &Surfels, range: Range<usize>, out: &mut Vec<Splat>) = project_body
}

#[inline(always)]
fn project_body(view: &View<'_>, surfels: &Surfels, range: Range<usize>, out: &mut Vec<Splat>) {
    let mut first = range.start;
    while first < range.end {
        let n = (range.end - first).min(LANES);
        let at = first..first + n;
        let mut block = Block::default();
        let (position, axis_u, axis_v) =
            (&surfels.position[at.clone()], &surfels.axis_u[at.clone()], &surfels.axis_v[at]);
        transform(&view.object.screen_from_model, view.object.screen_origin, position, &mut block.centre);
        transform(&view.object.screen_from_model, Vec3::ZERO, axis_u, &mut block.u);
        transform(&view.object.screen_from_model, Vec3::ZERO, axis_v, &mut block.v);
        let mut shape = Shape::default();
        for l in 0..LANES {
            project_lane(view, &block, l, &mut shape);
        }
        for l in 0..n {
            let surfel = (first + l) as u32;
            if shape.kind[l] == ORDINARY {
                push_ordinary(view, &block, &shape, l, surfel, out);
            } else if shape.kind[l] == CROSSING {
                push_crossing(view, &block, l, surfel, out);
            }
        }
        first += n;
    }
}

/// Screen-space centre and axes of a block of surfels: homogeneous pixel coordinates (x, y, depth).
#[derive(Default)]
struct Block {
    centre: [Lanes; 3],
    u: [Lanes; 3],
    v: [Lanes; 3],
}

#[inline(always)]
fn transform(m: &Mat3, origin: Vec3, points: &[Vec3], out: &mut [Lanes; 3]) {
    let mut p = [[0.0; LANES]; 3];
    for (l, point) in points.iter().enumerate() {
        p[0][l] = point.x;
        p[1][l] = point.y;
        p[2][l] = point.z;
    }
    let m = m.to_cols_array_2d();
    let origin = origin.to_array();
    for row in 0..3 {
        for l in 0..LANES {
            out[row][l] = m[0][row] * p[0][l] + m[1][row] * p[1][l] + m[2][row] * p[2][l] + origin[row];
        }
    }
}

const CULLED: u32 = 0;
const ORDINARY: u32 = 1;
const CROSSING: u32 = 2;

/// What is known of a block's splats after the vectorised part.
#[derive(Default)]
struct Shape {
    kind: [u32; LANES],
    /// Projected centre, pixels from the image's centre.
    x: Lanes,
    y: Lanes,
    /// Signed area of the projected axes: negative faces the viewer, if not mirrored.
    area: Lanes,
    /// Bounds relative to the centre.
    left: Lanes,
    right: Lanes,
    top: Lanes,
    bottom: Lanes,
}

/// Culls by facing and depth and bounds the ellipse by its dual conic, D = T diag(1, 1, -1) T^t with T = [u v centre]
/// (Sigg et al. 2006; docs/math.md): exact in perspective.
#[inline(always)]
fn project_lane(view: &View<'_>, block: &Block, l: usize, shape: &mut Shape) {
    let depth = block.centre[2][l];
    let inverse = 1.0 / depth;
    let x = block.centre[0][l] * inverse;
    let y = block.centre[1][l] * inverse;
    let (ud, vd) = (block.u[2][l], block.v[2][l]);
    let (ux, uy) = (block.u[0][l] - x * ud, block.u[1][l] - y * ud);
    let (vx, vy) = (block.v[0][l] - x * vd, block.v[1][l] - y * vd);
    let area = ux * vy - uy * vx;
    // det [u v centre] < 0 faces the viewer; a splat seen edge-on (or with a NaN) covers nothing.
    let det = area * depth * view.object.handedness;
    let facing = if view.two_sided { det.abs() > 0.0 } else { det < 0.0 };

    let reach2 = ud * ud + vd * vd;
    let d22 = reach2 - depth * depth;
    let behind = depth + reach2.sqrt() < view.near;
    let crossing = (depth <= 0.0) | (d22 > -1e-3 * depth * depth);
    let inverse22 = 1.0 / d22;
    let (d02, d12) = (ux * ud + vx * vd, uy * ud + vy * vd);
    let half = |d00: f32, d02: f32| {
        let disc = d02 * d02 - d00 * d22;
        (if disc > 0.0 { disc } else { 0.0 }).sqrt() * -inverse22
    };
    let (mid_x, mid_y) = (d02 * inverse22, d12 * inverse22);
    let (half_x, half_y) = (half(ux * ux + vx * vx, d02), half(uy * uy + vy * vy, d12));
    let low_pass = if view.low_pass & (depth >= view.near) { LOW_PASS } else { 0.0 };
    let (left, right) = (mid_x - half_x, mid_x + half_x);
    let (top, bottom) = (mid_y - half_y, mid_y + half_y);
    shape.left[l] = if left < -low_pass { left } else { -low_pass };
    shape.right[l] = if right > low_pass { right } else { low_pass };
    shape.top[l] = if top < -low_pass { top } else { -low_pass };
    shape.bottom[l] = if bottom > low_pass { bottom } else { low_pass };
    shape.x[l] = x;
    shape.y[l] = y;
    shape.area[l] = area;
    let kind = if crossing { CROSSING } else { ORDINARY };
    shape.kind[l] = if facing & !behind { kind } else { CULLED };
}

/// Pixels whose sample position lies in [low, high], cut to [first, last]; `None` if there are none (or with a NaN).
#[inline(always)]
fn pixel_range(low: f32, high: f32, first: i32, last: i32) -> Option<[u16; 2]> {
    let a = (low - 0.5).ceil();
    let b = (high - 0.5).floor();
    let a = if a > first as f32 { a } else { first as f32 };
    let b = if b < last as f32 { b } else { last as f32 };
    (a <= b).then_some([a as u16, b as u16])
}

#[inline(always)]
fn push_ordinary(view: &View<'_>, block: &Block, shape: &Shape, l: usize, surfel: u32, out: &mut Vec<Splat>) {
    let reference = [
        0.5 * view.size[0] as f32 + shape.x[l] - view.offset[0],
        0.5 * view.size[1] as f32 + shape.y[l] - view.offset[1],
    ];
    let slack_x = SLACK + SLACK_SHARE * (shape.right[l] - shape.left[l]) + reference[0].abs() * f32::EPSILON;
    let slack_y = SLACK + SLACK_SHARE * (shape.bottom[l] - shape.top[l]) + reference[1].abs() * f32::EPSILON;
    let [x0, x1, y0, y1] = view.pixels;
    let Some(columns) =
        pixel_range(reference[0] + shape.left[l] - slack_x, reference[0] + shape.right[l] + slack_x, x0, x1)
    else {
        return;
    };
    let Some(rows) =
        pixel_range(reference[1] + shape.top[l] - slack_y, reference[1] + shape.bottom[l] + slack_y, y0, y1)
    else {
        return;
    };
    let depth = block.centre[2][l];
    let (x, y, area) = (shape.x[l], shape.y[l], shape.area[l]);
    let (ud, vd) = (block.u[2][l], block.v[2][l]);
    let (ux, uy) = (block.u[0][l] - x * ud, block.u[1][l] - y * ud);
    let (vx, vy) = (block.v[0][l] - x * vd, block.v[1][l] - y * vd);
    let over_area = 1.0 / area;
    let over_depth = 1.0 / depth;
    let over_both = over_area * over_depth;
    out.push(Splat {
        reference,
        inverse_depth: [(uy * vd - ud * vy) * over_both, (ud * vx - ux * vd) * over_both, over_depth],
        u: [vy * over_area, -vx * over_area, 0.0],
        v: [-uy * over_area, ux * over_area, 0.0],
        centre_depth: if depth >= view.near { depth } else { f32::NAN },
        bounds: [columns[0], columns[1], rows[0], rows[1]],
        surfel,
        flags: if area * view.object.handedness < 0.0 { 0 } else { FLAG_BACK },
    });
}

/// A splat that reaches the camera plane: its bounds are all that is wanted, and pixels are counted from the image's centre.
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
    let [x0, x1, y0, y1] = view.pixels;
    out.push(Splat {
        reference: [0.5 * view.size[0] as f32 - view.offset[0], 0.5 * view.size[1] as f32 - view.offset[1]],
        inverse_depth: (normal * over).to_array(),
        u: (v.cross(c) * over).to_array(),
        v: (c.cross(u) * over).to_array(),
        centre_depth: f32::NAN,
        bounds: [x0 as u16, x1 as u16, y0 as u16, y1 as u16],
        surfel,
        flags: if det * view.object.handedness < 0.0 { 0 } else { FLAG_BACK },
    });
}

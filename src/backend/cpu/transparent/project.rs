//! Pass `project` of Gaussians: posed, projected, widened by the filter, bounded and culled.
//!
//! Math: docs/math.md, section 11. In: Gaussians of one object and its pose. Out: splats in the order of the model.
//! Order-free.

use std::ops::Range;

use glam::{DVec3, Vec3};

use super::harmonics;
use crate::backend::cpu::bounds::{pixel_range, whole};
use crate::backend::cpu::project::transform;
use crate::film::Blending;
use crate::frame::{Blocks, FrameObject, PixelRect, PosedObject, Raster};
use crate::layout::GaussianSplat;
use crate::math::simd::dispatch;
use crate::math::{fast, srgb};
use crate::model::Gaussians;

/// Gaussians worked on at once.
const LANES: usize = 16;
type Lanes = [f32; LANES];

/// What turns a power of e with the factor 1/2 into one of 2.
const HALF_LOG2_E: f32 = 0.5 * std::f32::consts::LOG2_E;

/// Variance by which the filter widens a Gaussian, pixels^2 of the image (Kerbl et al. 2023, their program).
const DILATION: f32 = 0.3;
/// Alphas below 1 / this are 0.
pub(in crate::backend) const FAINTEST: f32 = 255.0;
/// The derivative of the projection is taken no farther from the axis than this many half fields of view (their
/// program): beyond, splats would grow without bounds.
const FIELD: f32 = 1.3;

/// What `project` needs beside the Gaussians.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct View<'a> {
    pub object: &'a FrameObject,
    pub posed: &'a PosedObject,
    /// Least depth that is drawn, scene units; infinite for an object that is hidden.
    pub near: f32,
    pub raster: Raster,
    /// Size of the image, pixels.
    pub size: [u32; 2],
    /// Pixels of the image to one of the raster.
    pub stride: f32,
    /// The pixels that are wanted.
    pub pixels: PixelRect,
    /// Blocks of those pixels that are wanted; `None`: all.
    pub wanted: Option<&'a Blocks>,
    /// Least and greatest offset of the sample positions that the splats are for, raster pixels.
    pub offsets: [[f32; 2]; 2],
    /// The numbers in which the image is composited.
    pub blending: Blending,
    /// With velocities of centres?
    pub velocity: bool,
    /// Index of the object's first Gaussian among all of the frame.
    pub first: u32,
    /// Leave nothing out, so that splat `i` is Gaussian `i` of the range.
    pub all: bool,
}

/// The splats of a run of Gaussians.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Projected {
    /// In the order of the model.
    pub splats: Vec<GaussianSplat>,
    /// The pixels that each may touch, apart from all else, as they are asked for more often. [`NOWHERE`] for none.
    pub bounds: Vec<[u16; 4]>,
    /// Screen velocity of each centre, pixels of the image per shutter; empty where it is not wanted.
    pub velocities: Vec<[f32; 2]>,
}

impl Projected {
    /// Bytes of one Gaussian at most.
    pub(in crate::backend) const BYTES: usize = size_of::<GaussianSplat>() + 2 * size_of::<[f32; 2]>();

    fn clear(&mut self, most: usize, velocity: bool) {
        let Self { splats, bounds, velocities } = self;
        splats.clear();
        splats.reserve_exact(most);
        bounds.clear();
        bounds.reserve_exact(most);
        velocities.clear();
        velocities.reserve_exact(if velocity { most } else { 0 });
    }
}

/// Bounds of what touches no pixel: its first column comes after its last.
pub(in crate::backend) const NOWHERE: [u16; 4] = [1, 0, 1, 0];

/// The splats of `range`.
pub(in crate::backend) fn project(view: &View<'_>, gaussians: &Gaussians, range: Range<usize>, out: &mut Projected) {
    out.clear(range.len(), view.velocity);
    for first in range.clone().step_by(LANES) {
        let n = (range.end - first).min(LANES);
        let mut shape = Shape::default();
        project_lanes(view, gaussians, first, n, &mut shape);
        let mut shown = if view.all { (1 << n) - 1 } else { shape.seen & ((1 << n) - 1) };
        while shown != 0 {
            let l = shown.trailing_zeros() as usize & (LANES - 1);
            shown &= shown - 1;
            push(view, gaussians, first + l, l, &shape, out);
        }
    }
}

/// The splats of `LANES` Gaussians, field by field.
#[derive(Default)]
struct Shape {
    x: Lanes,
    y: Lanes,
    along: Lanes,
    slope: Lanes,
    across: Lanes,
    peak: Lanes,
    depth: Lanes,
    bounds: [[u16; LANES]; 4],
    /// A bit for each that touches wanted pixels.
    seen: u32,
}

fn push(view: &View<'_>, gaussians: &Gaussians, index: usize, l: usize, shape: &Shape, out: &mut Projected) {
    let bounds = [shape.bounds[0][l], shape.bounds[1][l], shape.bounds[2][l], shape.bounds[3][l]];
    let seen = shape.seen >> l & 1 == 1 && wants(view, bounds);
    if !seen && !view.all {
        return;
    }
    out.splats.push(GaussianSplat {
        reference: [shape.x[l], shape.y[l]],
        along: shape.along[l],
        slope: shape.slope[l],
        across: shape.across[l],
        peak: shape.peak[l],
        depth: shape.depth[l],
        colour: if seen { colour(view, gaussians, index) } else { [0.0; 3] },
        bounds,
        index: view.first + index as u32,
    });
    out.bounds.push(if seen { bounds } else { NOWHERE });
    if view.velocity {
        out.velocities.push(velocity(view, gaussians.position[index]));
    }
}

/// Does what has these bounds touch a block that is wanted?
fn wants(view: &View<'_>, bounds: [u16; 4]) -> bool {
    let Some(blocks) = view.wanted else { return true };
    let [x0, x1, y0, y1] = bounds.map(|pixel| usize::from(pixel) / Blocks::EDGE);
    (y0..=y1).any(|y| (x0..=x1).any(|x| blocks.at(x, y)))
}

/// The colour of a Gaussian as the eye sees it, in the numbers of the image.
fn colour(view: &View<'_>, gaussians: &Gaussians, index: usize) -> [f32; 3] {
    let capture = &view.object.capture;
    if let Some(flat) = capture.flat {
        return flat.to_array();
    }
    let direction = || (gaussians.position[index] - view.posed.eye).normalize_or_zero();
    let own = gaussians.colour(index) + harmonics::sum(gaussians, index, capture.harmonics, direction);
    let own = own.max(Vec3::ZERO).to_array();
    if gaussians.linear && view.blending == Blending::Coded { own.map(srgb::from_linear) } else { own }
}

/// Screen velocity of a centre, pixels of the image per shutter: the derivative of (x, y) = (X, Y) / depth.
fn velocity(view: &View<'_>, position: Vec3) -> [f32; 2] {
    let posed = view.posed;
    let p = posed.screen_from_model * position + posed.screen_origin;
    let rate = posed.screen_rate * position + posed.screen_origin_rate;
    let over = 1.0 / p.z;
    [(rate.x - p.x * over * rate.z) * over, (rate.y - p.y * over * rate.z) * over].map(|v| v * view.stride)
}

dispatch! {
    /// `n` Gaussians, from `first` on.
    fn project_lanes(view: &View<'_>, gaussians: &Gaussians, first: usize, n: usize, shape: &mut Shape) =
        project_lanes_body
}

#[inline(always)]
fn project_lanes_body(view: &View<'_>, gaussians: &Gaussians, first: usize, n: usize, shape: &mut Shape) {
    let mut position = [[0.0; LANES]; 3];
    let mut sigma = [[0.0; LANES]; 3];
    let mut turn = [[0.0; LANES]; 4];
    let mut opacity = [0.0; LANES];
    for (l, p) in gaussians.position[first..][..n].iter().enumerate() {
        (position[0][l], position[1][l], position[2][l]) = (*p).into();
    }
    for (l, s) in gaussians.sigma[first..][..n].iter().enumerate() {
        (sigma[0][l], sigma[1][l], sigma[2][l]) = (*s).into();
    }
    for (l, q) in gaussians.rotation[first..][..n].iter().enumerate() {
        [turn[0][l], turn[1][l], turn[2][l], turn[3][l]] = q.to_array();
    }
    opacity[..n].copy_from_slice(&gaussians.opacity[first..][..n]);

    let capture = &view.object.capture;
    let factor = capture.opacity as f32;
    let antialias = capture.antialias.unwrap_or(gaussians.antialiased);
    let [low, high] = capture.crop.map_or([Vec3::NEG_INFINITY, Vec3::INFINITY], |crop| crop.map(DVec3::as_vec3));
    let centre = transform(&view.posed.screen_from_model, view.posed.screen_origin, &position);
    let m = view.posed.screen_from_model.to_cols_array_2d();
    let half = [0, 1].map(|i| FIELD * 0.5 * view.size[i] as f32 / view.stride);
    let dilation = DILATION / (view.stride * view.stride);
    let [least, most] = view.offsets;
    let PixelRect { first_column, last_column, first_row, last_row } = view.pixels;
    let faintest = FAINTEST.log2();
    let mut seen = [0_u32; LANES];
    for l in 0..LANES {
        let depth = centre[2][l];
        let over = 1.0 / depth;
        let (x, y) = (centre[0][l] * over, centre[1][l] * over);
        let (jx, jy) = (clamp(x, half[0]), clamp(y, half[1]));
        // The axes of the Gaussian in the model, one standard deviation long.
        let (qx, qy, qz, qw) = (turn[0][l], turn[1][l], turn[2][l], turn[3][l]);
        let s = [sigma[0][l], sigma[1][l], sigma[2][l]];
        let axes = [
            [1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qw * qz), 2.0 * (qx * qz - qw * qy)],
            [2.0 * (qx * qy - qw * qz), 1.0 - 2.0 * (qx * qx + qz * qz), 2.0 * (qy * qz + qw * qx)],
            [2.0 * (qx * qz + qw * qy), 2.0 * (qy * qz - qw * qx), 1.0 - 2.0 * (qx * qx + qy * qy)],
        ];
        // The same on the screen, pixels.
        let mut u = [0.0; 3];
        let mut v = [0.0; 3];
        for k in 0..3 {
            let on_screen = |row: usize| m[0][row] * axes[k][0] + m[1][row] * axes[k][1] + m[2][row] * axes[k][2];
            let scale = s[k] * over;
            let away = on_screen(2);
            u[k] = (on_screen(0) - jx * away) * scale;
            v[k] = (on_screen(1) - jy * away) * scale;
        }
        let xx = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
        let yy = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        let xy = u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
        // |V| as the square of a vector product: the difference of products would cancel for long thin splats.
        let c = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let unfiltered = c[0] * c[0] + c[1] * c[1] + c[2] * c[2];
        let determinant = unfiltered + dilation * (xx + yy) + dilation * dilation;
        let wide_xx = xx + dilation;
        let wide_yy = yy + dilation;
        let lost = if antialias { (unfiltered / determinant).sqrt() } else { 1.0 };
        let peak = opacity[l] * factor * lost;
        let solid = peak * FAINTEST > 1.0;
        let peak = fast::log2(if solid { peak } else { 1.0 });
        let over_xx = 1.0 / wide_xx;
        shape.along[l] = HALF_LOG2_E * over_xx;
        shape.slope[l] = xy * over_xx;
        shape.across[l] = HALF_LOG2_E * wide_xx / determinant;
        shape.peak[l] = peak;
        shape.depth[l] = depth;
        let reach = (peak + faintest) * (1.0 / HALF_LOG2_E);
        let (reach_x, reach_y) = ((reach * wide_xx).sqrt(), (reach * wide_yy).sqrt());
        let (x, y) = (view.raster.axis[0] + x, view.raster.axis[1] + y);
        shape.x[l] = x;
        shape.y[l] = y;
        let columns = pixel_range(x, -reach_x - most[0], reach_x - least[0], first_column, last_column);
        let rows = pixel_range(y, -reach_y - most[1], reach_y - least[1], first_row, last_row);
        let p = [position[0][l], position[1][l], position[2][l]];
        let inside = (p[0] >= low.x)
            & (p[1] >= low.y)
            & (p[2] >= low.z)
            & (p[0] <= high.x)
            & (p[1] <= high.y)
            & (p[2] <= high.z);
        let on_image = (columns.0 <= columns.1) & (rows.0 <= rows.1);
        let touches = solid & inside & on_image & (depth >= view.near) & (determinant < f32::INFINITY);
        shape.bounds[0][l] = whole(columns.0);
        shape.bounds[1][l] = whole(columns.1);
        shape.bounds[2][l] = whole(rows.0);
        shape.bounds[3][l] = whole(rows.1);
        seen[l] = u32::from(touches);
    }
    shape.seen = (0..LANES).fold(0, |bits, l| bits | seen[l] << l);
}

#[inline(always)]
fn clamp(x: f32, half: f32) -> f32 {
    let x = if x > -half { x } else { -half };
    if x < half { x } else { half }
}

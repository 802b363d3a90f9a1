//! Pass `project` of Gaussians: posed, projected, widened by the filter, bounded and culled.
//!
//! Math: docs/math.md, sections 11 and 12. In: Gaussians of one object and its pose. Out: splats in the order of the
//! model. Order-free.

use std::ops::Range;

use glam::{DVec3, Vec3};

use super::emission;
use super::view::GaussianView;
use crate::backend::cpu::bounds::{pixel_range, whole};
use crate::backend::cpu::columns::transform;
use crate::backend::cpu::land::{Landing, Strip};
use crate::frame::PixelRect;
use crate::layout::GaussianSplat;
use crate::math::fast;
use crate::math::simd::dispatch;
use crate::model::{Gaussians, Optics};

/// Gaussians worked on at once.
const LANES: usize = 16;
type Lanes = [f32; LANES];

/// What turns a power of e with the factor 1/2 into one of 2.
pub(in crate::backend) const HALF_LOG2_E: f32 = 0.5 * std::f32::consts::LOG2_E;

/// Variance by which the filter widens a Gaussian, pixels^2 of the image (Kerbl et al. 2023, their program).
const DILATION: f32 = 0.3;
/// Alphas below 1 / this are 0.
pub(in crate::backend) const FAINTEST: f32 = 255.0;
/// The derivative of the projection is taken no farther from the axis than this many half fields of view (their
/// program): beyond, splats would grow without bounds.
const FIELD: f32 = 1.3;

/// log2 of the optical depth, in powers of 1/2, below which a volume's kernel is cut. The rest of the kernel is scaled
/// up, so that the whole keeps its mass.
pub(in crate::backend) const FAINTEST_DEPTH: f32 = -13.0;
/// log2 of the largest optical depth of a kernel, likewise: a float still holds what it lets through next to its rim.
pub(in crate::backend) const MOST_DEPTH: f32 = 40.0;
/// Most that the factor of perspective on a volume's kernel differs from 1: beyond, the series says nothing.
pub(in crate::backend) const MOST_BEND: f32 = 0.5;
/// A volume's kernel keeps at least these powers of 1/2 below its centre: two standard deviations.
pub(in crate::backend) const LEAST_REACH: f32 = 2.0 * std::f32::consts::LOG2_E;

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

    /// Takes the layers from where the same Gaussians are in `other`.
    pub(super) fn layers_of(&mut self, other: &Self) {
        self.splats.iter_mut().zip(&other.splats).for_each(|(own, other)| own.layer = other.layer);
    }

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
pub(in crate::backend) fn project(
    view: &GaussianView<'_>,
    gaussians: &Gaussians,
    range: Range<usize>,
    out: &mut Projected,
) {
    out.clear(range.len(), view.velocity);
    for first in range.clone().step_by(LANES) {
        let n = (range.end - first).min(LANES);
        let mut shape = KernelLanes::default();
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
struct KernelLanes {
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

fn push(
    view: &GaussianView<'_>,
    gaussians: &Gaussians,
    index: usize,
    l: usize,
    shape: &KernelLanes,
    out: &mut Projected,
) {
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
        colour: if seen { emission::colour(view, gaussians, index) } else { [0.0; 3] },
        bounds,
        index: view.first + index as u32,
        layer: match gaussians.optics {
            Optics::Alpha => 0,
            Optics::Extinction { .. } => 1 + (shape.depth[l] / view.layer) as u32,
        },
    });
    out.bounds.push(if seen { bounds } else { NOWHERE });
    if view.velocity {
        out.velocities.push(velocity(view, gaussians.position[index]));
    }
}

/// Does what has these bounds touch a block that is wanted?
fn wants(view: &GaussianView<'_>, bounds: [u16; 4]) -> bool {
    let Some(blocks) = view.wanted else { return true };
    blocks.touch(view.raster.first, bounds.map(usize::from))
}

/// Screen velocity of a centre, pixels of the image per shutter: the derivative of (x, y) = (X, Y) / depth.
fn velocity(view: &GaussianView<'_>, position: Vec3) -> [f32; 2] {
    let posed = view.posed;
    let p = posed.screen_from_model * position + posed.screen_origin;
    let rate = posed.screen_rate * position + posed.screen_origin_rate;
    let over = 1.0 / p.z;
    [(rate.x - p.x * over * rate.z) * over, (rate.y - p.y * over * rate.z) * over].map(|v| v * view.stride)
}

dispatch! {
    /// `n` Gaussians, from `first` on.
    fn project_lanes(view: &GaussianView<'_>, gaussians: &Gaussians, first: usize, n: usize, shape: &mut KernelLanes) =
        project_lanes_body
}

#[inline(always)]
#[allow(clippy::too_many_lines, reason = "one loop over lanes, which a call would keep from becoming vectors")]
fn project_lanes_body(view: &GaussianView<'_>, gaussians: &Gaussians, first: usize, n: usize, shape: &mut KernelLanes) {
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

    let drawing = &view.drawing;
    let factor = drawing.opacity as f32;
    let antialias = drawing.antialias.unwrap_or(gaussians.antialiased);
    let [low, high] = drawing.crop.map_or([Vec3::NEG_INFINITY, Vec3::INFINITY], |crop| crop.map(DVec3::as_vec3));
    let strip = Strip::of(&view.raster).filter(|_| view.posed.moves);
    let (mut centre, mut motion) =
        (transform(&view.posed.screen_from_model, view.posed.screen_origin, &position), [[0.0; LANES]; 3]);
    let m = view.posed.screen_from_model.to_cols_array_2d();
    let turn_of_m = view.posed.motion_from_model.to_cols_array_2d();
    if strip.is_some() {
        centre = transform(&view.posed.centre_from_model, view.posed.centre_origin, &position);
        motion = transform(&view.posed.motion_from_model, view.posed.motion_origin, &position);
    }
    let half = [0, 1].map(|i| FIELD * 0.5 * view.size[i] as f32 / view.stride);
    let volume = gaussians.optics != Optics::Alpha;
    let dilation = if volume { view.variance } else { DILATION / (view.stride * view.stride) };
    // For volumes: area on the raster over that in the model, at depth 1 on the axis, and over 2 pi in powers of 1/2.
    let area = view.posed.screen_from_model.determinant().abs();
    let area = area * (std::f32::consts::LOG2_E / std::f32::consts::TAU);
    let inverse_focal2 = 1.0 / (view.raster.focal * view.raster.focal);
    let [least, most] = view.offsets;
    let PixelRect { first_column, last_column, first_row, last_row } = view.pixels;
    let faintest = FAINTEST.log2();
    let mut seen = [0_u32; LANES];
    for l in 0..LANES {
        let of = |v: &[Lanes; 3]| [v[0][l], v[1][l], v[2][l]];
        let landing = strip.as_ref().map(|strip| match strip.axis {
            0 => (0, Landing::new::<0>(strip, of(&centre), of(&motion))),
            axis => (axis, Landing::new::<1>(strip, of(&centre), of(&motion))),
        });
        let time = landing.map_or(0.0, |(_, landing)| landing.time);
        if landing.is_some() {
            for c in 0..3 {
                centre[c][l] += time * motion[c][l];
            }
        }
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
        let mut e = [0.0; 3];
        for k in 0..3 {
            let apply = |m: &[[f32; 3]; 3], row: usize| {
                m[0][row] * axes[k][0] + m[1][row] * axes[k][1] + m[2][row] * axes[k][2]
            };
            let on_screen = |row: usize| match landing {
                None => apply(&m, row),
                Some(_) => apply(&m, row) + time * apply(&turn_of_m, row),
            };
            let scale = s[k] * over;
            let away = on_screen(2);
            u[k] = (on_screen(0) - jx * away) * scale;
            v[k] = (on_screen(1) - jy * away) * scale;
            e[k] = away * scale;
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
        // Zwicker et al. 2002, eq. 33: the integral of the kernel over the ray at its centre. A ray away from the axis
        // is longer than its depth.
        let longer2 = 1.0 + (x * x + y * y) * inverse_focal2;
        let bend = Bend::of(&u, &v, &e, [x, y], longer2, inverse_focal2);
        let integral = area * longer2.sqrt() * (over * over) / determinant.sqrt() * bend.mass;
        let peak = opacity[l] * factor * if volume { integral } else { lost };
        let solid = if volume { peak >= f32::MIN_POSITIVE } else { peak * FAINTEST > 1.0 };
        let peak = fast::log2(if solid { peak } else { 1.0 });
        let kept = 1.0 - fast::exp2(least_power(peak) - peak);
        let peak = if volume { peak - fast::log2(kept) } else { peak };
        // Nothing gets through more.
        let peak = if volume & (peak > MOST_DEPTH) { MOST_DEPTH } else { peak };
        let faintest = if volume { -least_power(peak) } else { faintest };
        // Rows beside the centre's see it displaced, as the filter has widened it.
        let (wide_xx, xy, wide_yy, determinant) = match landing {
            None => (wide_xx, xy, wide_yy, determinant),
            Some((axis, landing)) => {
                let wide = [wide_xx, xy, wide_yy];
                let [xx, xy, yy] = if axis == 0 { landing.spread::<0>(wide) } else { landing.spread::<1>(wide) };
                (xx, xy, yy, determinant * landing.along * landing.along)
            }
        };
        let over_xx = 1.0 / wide_xx;
        shape.along[l] = HALF_LOG2_E * over_xx;
        shape.slope[l] = xy * over_xx;
        shape.across[l] = HALF_LOG2_E * wide_xx / determinant;
        shape.peak[l] = peak;
        shape.depth[l] = depth;
        let reach = (peak + faintest) * (1.0 / HALF_LOG2_E);
        let (reach_x, reach_y) = ((reach * wide_xx).sqrt(), (reach * wide_yy).sqrt());
        let [mut shift_x, mut shift_y] = if volume { bend.shift } else { [0.0; 2] };
        if let Some((_, landing)) = landing {
            shift_x += landing.shift[0];
            shift_y += landing.shift[1];
        }
        let (x, y) = (view.raster.axis[0] + x + shift_x, view.raster.axis[1] + y + shift_y);
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
        let touches = solid & inside & on_image & (depth >= view.near);
        let touches = touches & (determinant > 0.0) & (determinant < f32::INFINITY);
        shape.bounds[0][l] = whole(columns.0);
        shape.bounds[1][l] = whole(columns.1);
        shape.bounds[2][l] = whole(rows.0);
        shape.bounds[3][l] = whole(rows.1);
        seen[l] = u32::from(touches);
    }
    shape.seen = (0..LANES).fold(0, |bits, l| bits | seen[l] << l);
}

/// What the affine image of a kernel misses of perspective, to second order in the angle at which the eye sees it
/// (docs/math.md, section 12).
struct Bend {
    /// Factor on the integral over the screen.
    mass: f32,
    /// Shift of the mean place on the screen, pixels.
    shift: [f32; 2],
}

impl Bend {
    /// `u`, `v`: the image of the axes, pixels; `e`: their depths over that of the centre, which is at `place`.
    /// `longer2`: square of the length of the ray over its depth.
    #[inline(always)]
    fn of(u: &[f32; 3], v: &[f32; 3], e: &[f32; 3], [x, y]: [f32; 2], longer2: f32, inverse_focal2: f32) -> Self {
        let over = inverse_focal2 / longer2;
        let (mut mass, mut shift) = (0.0, [0.0; 2]);
        for k in 0..3 {
            // Along the ray, over its length.
            let across = (u[k] * x + v[k] * y) * over;
            let along = across + e[k];
            let (px, py) = (u[k] + x * e[k], v[k] + y * e[k]);
            let length2 = (px * px + py * py) * over + e[k] * e[k] / longer2;
            mass += 0.5 * (length2 - along * along - 6.0 * along * e[k] + 12.0 * e[k] * e[k]);
            shift[0] += u[k] * (across - 3.0 * e[k]);
            shift[1] += v[k] * (across - 3.0 * e[k]);
        }
        let size = if mass > 0.0 { mass } else { -mass };
        let trust = if size > MOST_BEND { MOST_BEND / size } else { 1.0 };
        Self { mass: 1.0 + mass * trust, shift: shift.map(|shift| shift * trust) }
    }
}

/// Where the kernel of a volume with the centre 2^`peak` is cut.
#[inline(always)]
pub(super) fn least_power(peak: f32) -> f32 {
    let least = peak - LEAST_REACH;
    if least < FAINTEST_DEPTH { least } else { FAINTEST_DEPTH }
}

#[inline(always)]
fn clamp(x: f32, half: f32) -> f32 {
    let x = if x > -half { x } else { -half };
    if x < half { x } else { half }
}

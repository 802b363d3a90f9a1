//! The objects that a tile of pixels may see, and when, so that samples which can hit nothing cost nothing.
//!
//! The shutter is cut into subintervals. In each of them an object lies in a sphere ([`ObjectPoser::swept_sphere`]). A
//! tile may see the object then if the cone from the eye around the tile meets the cone around the sphere. The test is
//! conservative: it never leaves out an object that a sample could hit.

use glam::DVec3;

use super::posed::{Body, CameraPose, Form, World};

/// Subintervals of the shutter: the bits of a mask.
const SUBINTERVALS: usize = 64;

/// Margin against rounding, far larger than rounding itself. It is added to the sines of angles, and to radii as a
/// share of the distances that are subtracted.
const MARGIN: f64 = 1e-9;

/// A cone with its tip in the eye. It is narrower than a half-space.
#[derive(Clone, Copy, Debug)]
struct Cone {
    /// Unit vector in camera space.
    axis: DVec3,
    /// Sine and cosine of the angle between the axis and the side.
    sin: f64,
    cos: f64,
}

/// The directions in which an object may be seen.
#[derive(Clone, Debug)]
enum Extent {
    Nowhere,
    /// The directions are not known, or the object surrounds the eye.
    Everywhere,
    /// In this cone. If the list is not empty, then in each subinterval in the cone that it names; `None` stands for
    /// everywhere.
    Cone(Cone, Vec<Option<Cone>>),
}

/// Cones from the eye that hold the objects of a frame.
#[derive(Debug)]
pub(super) struct ObjectCones {
    open: f64,
    subintervals_per_frame: f64,
    extents: Vec<Extent>,
}

/// The objects that a tile may see.
#[derive(Clone, Debug, Default)]
pub(super) struct Candidates {
    /// Number of an object, and the mask of the subintervals in which it may be seen.
    pub bodies: Vec<(usize, u64)>,
    /// The subintervals in which any object may be seen.
    pub any: u64,
}

impl ObjectCones {
    pub(super) fn new(world: &World<'_>, frame: f64) -> Self {
        let [open, close] = world.scene.shutter.whole_exposure(frame);
        let cones = Self { open, subintervals_per_frame: SUBINTERVALS as f64 / (close - open), extents: Vec::new() };
        let extents = world.bodies.iter().map(|body| cones.extent(world, body, close)).collect();
        Self { extents, ..cones }
    }

    fn extent(&self, world: &World<'_>, body: &Body<'_>, close: f64) -> Extent {
        // Captures and volumes have trees of their own.
        if matches!(body.form, Form::Gaussians(_) | Form::Volume(_) | Form::Nothing) {
            return Extent::Nowhere;
        }
        let Some(camera) = world.camera_of(body) else { return Extent::Everywhere };
        let cone = |from: f64, to: f64| {
            let (centre, radius) = match body.form {
                Form::Model(model) => world.models[model].sphere([from, to].map(|time| body.elapsed(time)[0])),
                Form::Sphere(sphere) => (DVec3::ZERO, sphere.radius),
                Form::Gaussians(_) | Form::Volume(_) | Form::Nothing => return None,
            };
            let (centre, radius) = body.swept_sphere(centre, radius, from, to)?;
            Cone::around(&camera, centre, radius)
        };
        let Some(whole) = cone(self.open, close) else { return Extent::Everywhere };
        let edge = |subinterval: usize, outwards: f64| {
            self.open + (subinterval as f64 + outwards) / self.subintervals_per_frame
        };
        let moves = body.object.blur && !body.object.shape.paths().is_empty();
        let subintervals = if body.is_fixed() && !moves { 0 } else { SUBINTERVALS };
        Extent::Cone(
            whole,
            (0..subintervals)
                .map(|subinterval| cone(edge(subinterval, -MARGIN), edge(subinterval + 1, MARGIN)))
                .collect(),
        )
    }

    /// Number of the subinterval of a scene time (frames).
    pub(super) fn subinterval(&self, time: f64) -> u32 {
        // The cast saturates below 0, and takes NaN (from a shutter without length) to 0.
        (((time - self.open) * self.subintervals_per_frame) as u32).min(SUBINTERVALS as u32 - 1)
    }

    /// Finds the objects that a rectangle of pixels may see: `size` columns and rows from `corner` (column, row) on.
    /// Samples lie as far outside as the pixel filter reaches.
    pub(super) fn candidates(&self, world: &World<'_>, corner: [usize; 2], size: [usize; 2], out: &mut Candidates) {
        let at = |i: usize, j: usize| [i, j].map(|c| c as f64);
        let [[left, top], [right, bottom]] =
            [corner, [corner[0] + size[0], corner[1] + size[1]]].map(|[i, j]| at(i, j));
        let beyond = (world.options.look.filter.reach() - 0.5).max(0.0);
        let ([left, top], [right, bottom]) = ([left - beyond, top - beyond], [right + beyond, bottom + beyond]);
        let axis = world.direction([0.5 * (left + right), 0.5 * (top + bottom)]).normalize();
        // The point of a plane's rectangle that is farthest from the axis is a corner.
        let corners = [[left, top], [right, top], [left, bottom], [right, bottom]];
        let cos = corners.map(|c| world.direction(c).normalize().dot(axis)).into_iter().fold(1.0, f64::min);
        let tile = Cone { axis, sin: (1.0 - cos * cos).max(0.0).sqrt() + MARGIN, cos };
        out.bodies.clear();
        // Rays find captures and volumes by themselves, and where anything is see-through every sample has a colour to
        // record.
        out.any = if world.is_see_through() { u64::MAX } else { 0 };
        for (number, extent) in self.extents.iter().enumerate() {
            let subintervals = match extent {
                Extent::Nowhere => 0,
                Extent::Everywhere => u64::MAX,
                Extent::Cone(whole, _) if !whole.meets(&tile) => 0,
                Extent::Cone(_, subintervals) if subintervals.is_empty() => u64::MAX,
                Extent::Cone(_, subintervals) => {
                    subintervals.iter().enumerate().fold(0, |mask, (subinterval, cone)| {
                        mask | u64::from(cone.is_none_or(|cone| cone.meets(&tile))) << subinterval
                    })
                }
            };
            if subintervals != 0 {
                out.bodies.push((number, subintervals));
                out.any |= subintervals;
            }
        }
    }
}

impl Cone {
    /// The cone around a sphere in the world; `None` if the eye is inside the sphere.
    fn around(camera: &CameraPose, centre: DVec3, radius: f64) -> Option<Self> {
        let offset = camera.world_from_camera.transpose() * (centre - camera.eye);
        let radius = radius + MARGIN * (radius + centre.length() + camera.eye.length());
        let distance = offset.length();
        let sin = radius / distance;
        // The test also fails where a number is not finite.
        let outside = (0.0..1.0).contains(&sin) && distance.is_finite();
        outside.then(|| Self { axis: offset / distance, sin: sin + MARGIN, cos: (1.0 - sin * sin).max(0.0).sqrt() })
    }

    /// True if the cones meet: the angle between the axes is at most the sum of the cones' angles, each below a right
    /// angle.
    fn meets(&self, other: &Self) -> bool {
        self.axis.dot(other.axis) >= self.cos * other.cos - self.sin * other.sin - MARGIN
    }
}

//! What a tile of pixels may see, and when, so that samples which can hit nothing cost nothing.
//!
//! The shutter is cut into subintervals. In each subinterval an object lies in a sphere ([`ObjectPoser::swept_sphere`]), and a tile may see it
//! then if the cone from the eye around the tile meets the cone around the sphere. Nothing that could be hit is left out.

use glam::DVec3;

use super::posed::{Body, CameraPose, Shape, World};

/// Slots of the shutter: bits of a mask.
const SUBINTERVALS: usize = 64;

/// Added to the sine of angles and, as a share of the distances that are subtracted, to radii: far more than rounding takes away.
const MARGIN: f64 = 1e-9;

/// A cone with its tip in the eye, less than a half-space.
#[derive(Clone, Copy, Debug)]
struct Cone {
    /// Camera space, unit.
    axis: DVec3,
    /// Of the angle between axis and side.
    sin: f64,
    cos: f64,
}

/// Where an object may be seen.
#[derive(Clone, Debug)]
enum Extent {
    Nowhere,
    /// Not known, or around the eye.
    Everywhere,
    /// In this cone, and if there are some, in each subinterval in one of its own; `None`: everywhere.
    Cone(Cone, Vec<Option<Cone>>),
}

/// Where the objects of a frame may be seen.
#[derive(Debug)]
pub(super) struct ObjectCones {
    open: f64,
    subintervals_per_frame: f64,
    extents: Vec<Extent>,
}

/// The objects that a tile may see.
#[derive(Clone, Debug, Default)]
pub(super) struct Candidates {
    /// Number of the object, and a mask of the subintervals.
    pub bodies: Vec<(usize, u64)>,
    /// Slots in which there is any.
    pub any: u64,
}

impl ObjectCones {
    pub(super) fn new(world: &World<'_>, frame: f64) -> Self {
        let shutter = &world.scene.shutter;
        let (open, close) = (shutter.frame_time(frame, 0.0), shutter.frame_time(frame, 1.0));
        let cones = Self { open, subintervals_per_frame: SUBINTERVALS as f64 / (close - open), extents: Vec::new() };
        let extents = world.bodies.iter().map(|body| cones.extent(world, body, close)).collect();
        Self { extents, ..cones }
    }

    fn extent(&self, world: &World<'_>, body: &Body<'_>, close: f64) -> Extent {
        let (centre, radius) = match body.shape {
            Shape::Model(model) => (world.models[model].centre, world.models[model].radius),
            Shape::Sphere(sphere) => (DVec3::ZERO, sphere.radius),
            Shape::Nothing => return Extent::Nowhere,
        };
        let Some(camera) = world.camera_of(body) else { return Extent::Everywhere };
        let cone = |from: f64, to: f64| {
            let (centre, radius) = body.swept_sphere(centre, radius, from, to)?;
            Cone::around(&camera, centre, radius)
        };
        let Some(whole) = cone(self.open, close) else { return Extent::Everywhere };
        let edge = |subinterval: usize, outwards: f64| {
            self.open + (subinterval as f64 + outwards) / self.subintervals_per_frame
        };
        let subintervals = if body.is_fixed() { 0 } else { SUBINTERVALS };
        Extent::Cone(
            whole,
            (0..subintervals)
                .map(|subinterval| cone(edge(subinterval, -MARGIN), edge(subinterval + 1, MARGIN)))
                .collect(),
        )
    }

    /// The subinterval of a scene time (frames).
    pub(super) fn subinterval(&self, time: f64) -> u32 {
        // The cast saturates below, and takes NaN (a shutter without length) to 0.
        (((time - self.open) * self.subintervals_per_frame) as u32).min(SUBINTERVALS as u32 - 1)
    }

    /// The objects that the pixels from `corner` (column, row) on, `size` of them, may see.
    pub(super) fn candidates(&self, world: &World<'_>, corner: [usize; 2], size: [usize; 2], out: &mut Candidates) {
        let at = |i: usize, j: usize| [i, j].map(|c| c as f64);
        let [[left, top], [right, bottom]] =
            [corner, [corner[0] + size[0], corner[1] + size[1]]].map(|[i, j]| at(i, j));
        let axis = world.direction([0.5 * (left + right), 0.5 * (top + bottom)]).normalize();
        // A plane's rectangle is farthest from the axis at a corner.
        let corners = [[left, top], [right, top], [left, bottom], [right, bottom]];
        let cos = corners.map(|c| world.direction(c).normalize().dot(axis)).into_iter().fold(1.0, f64::min);
        let tile = Cone { axis, sin: (1.0 - cos * cos).max(0.0).sqrt() + MARGIN, cos };
        out.bodies.clear();
        out.any = 0;
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
    /// Around a sphere in the world; `None` if the eye is in it.
    fn around(camera: &CameraPose, centre: DVec3, radius: f64) -> Option<Self> {
        let offset = camera.world_from_camera.transpose() * (centre - camera.eye);
        let radius = radius + MARGIN * (radius + centre.length() + camera.eye.length());
        let distance = offset.length();
        let sin = radius / distance;
        // Also false where a number is not finite.
        let outside = (0.0..1.0).contains(&sin) && distance.is_finite();
        outside.then(|| Self { axis: offset / distance, sin: sin + MARGIN, cos: (1.0 - sin * sin).max(0.0).sqrt() })
    }

    /// The angle of the axes is at most the sum of the cones' angles, each below a right angle.
    fn meets(&self, other: &Self) -> bool {
        self.axis.dot(other.axis) >= self.cos * other.cos - self.sin * other.sin - MARGIN
    }
}

//! What captures and volumes let through on the way from a place to a light: exact along the ray.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use glam::{DMat3, DVec3};

use super::gaussians::beam::{Beam, BeamRay};
use super::gaussians::tree::{GaussianKernel, LEAST_ALPHA, MOST_ALPHA, Tree};
use super::posed::BodyPose;
use super::volumes::kernel::{REACH, VolumeKernel};

/// A ray to a light, in the model of a capture or volume relative to the model's origin. Its parameter is the distance
/// in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightRay {
    origin: DVec3,
    direction: DVec3,
    /// The parameter at which a place p of the model is nearest: `forward` . p + `offset`.
    forward: DVec3,
    offset: f64,
    /// Where it begins and ends.
    ends: [f64; 2],
}

impl LightRay {
    /// The ray from `place` along the unit vector `towards`, between two distances.
    pub(super) fn new(pose: &BodyPose, place: DVec3, towards: DVec3, ends: [f64; 2]) -> Self {
        let offset = pose.world_from_model.translation - place;
        Self {
            origin: pose.model_from_world * -offset,
            direction: pose.model_from_world * towards,
            forward: pose.world_from_model.matrix3.transpose() * towards,
            offset: towards.dot(offset),
            ends,
        }
    }

    /// The share of light that a capture lets through: the product of 1 - alpha of all Gaussians whose centres lie on
    /// the way. Alpha is that of the picture from the light, without its filter (docs/math.md, eq. 23).
    pub(super) fn through_capture(&self, tree: &Tree<GaussianKernel>, stack: &mut Vec<(u32, u32)>) -> f64 {
        let mut share = 1.0;
        let (right, up) = self.direction.normalize_or_zero().any_orthonormal_pair();
        self.visit(tree, stack, |kernel: &GaussianKernel| {
            let centre = kernel.centre.as_dvec3();
            let depth = self.forward.dot(centre) + self.offset;
            let [xx, xy, xz, yy, yz, zz] = kernel.covariance;
            let covariance = DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz));
            let from = self.origin - centre;
            let (a, b) = (covariance * right, covariance * up);
            let (aa, ab, bb) = (right.dot(a), right.dot(b), up.dot(b));
            let (x, y) = (right.dot(from), up.dot(from));
            let q = (bb * x * x - 2.0 * ab * x * y + aa * y * y) / (aa * bb - ab * ab);
            let alpha = (kernel.opacity * libm::exp(-0.5 * q)).min(MOST_ALPHA);
            // The comparisons also fail where a number is none.
            if q >= 0.0 && alpha >= LEAST_ALPHA && depth >= self.ends[0] && depth <= self.ends[1] {
                share *= 1.0 - alpha;
            }
        });
        share
    }

    /// The share of light that a volume lets through (docs/math.md, eq. 28 and 29).
    pub(super) fn through_volume(&self, tree: &Tree<VolumeKernel>, stack: &mut Vec<(u32, u32)>) -> f64 {
        let mut depths = 0.0;
        let form = |[xx, xy, xz, yy, yz, zz]: [f64; 6], u: DVec3, v: DVec3| {
            let image = DVec3::new(
                xx * v.x + xy * v.y + xz * v.z,
                xy * v.x + yy * v.y + yz * v.z,
                xz * v.x + yz * v.y + zz * v.z,
            );
            u.dot(image)
        };
        self.visit(tree, stack, |kernel: &VolumeKernel| {
            let from = self.origin - kernel.centre.as_dvec3();
            let a = form(kernel.adjugate, self.direction, self.direction);
            let across = from.cross(self.direction);
            let q = form(kernel.covariance, across, across) / a;
            let centre = -form(kernel.adjugate, from, self.direction) / a;
            let sigma = kernel.root / a.sqrt();
            // The comparisons also fail where a number is none, as where a flat kernel is seen edge-on.
            if !(a > 0.0 && q <= REACH * REACH && centre.is_finite()) {
                return;
            }
            let whole = kernel.mass / (TAU * a.sqrt()) * libm::exp(-0.5 * q);
            // Of a sheet all is at its centre.
            let before = |end: f64| {
                let deviations = (end - centre) / sigma;
                if deviations.is_nan() { 0.5 } else { 0.5 * libm::erfc(-FRAC_1_SQRT_2 * deviations) }
            };
            depths += whole * (before(self.ends[1]) - before(self.ends[0]));
        });
        libm::exp(-depths)
    }

    /// Calls `found` with all kernels that it may meet.
    fn visit<K: super::gaussians::tree::Placed>(
        &self,
        tree: &Tree<K>,
        stack: &mut Vec<(u32, u32)>,
        mut found: impl FnMut(&K),
    ) {
        let &Self { origin, direction, forward, offset, .. } = self;
        // The point that is nearest to a centre by the measure of its kernel may be anywhere on the line.
        let ray = BeamRay { origin, direction, forward, offset, near: f64::NEG_INFINITY, growth: 1.0, slope: 0.0 };
        let Some(beam) = Beam::around(std::iter::once(ray), f64::INFINITY, tree.extent) else { return };
        tree.visit(&beam, stack, |_, kernel| {
            let centre = kernel.centre().as_dvec3();
            if beam.meets([centre, centre], kernel.radius()) {
                found(kernel);
            }
        });
    }
}

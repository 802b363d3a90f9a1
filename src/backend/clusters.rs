//! Clusters of a model, with boxes around them and cones around their normals.
//!
//! A cluster need not be projected if it is apart from the pixels that are wanted, or shows its back.

use std::ops::Range;
use std::sync::{Arc, Weak};

use glam::Vec3;
use rayon::prelude::*;

use crate::frame::{Blocks, Frame, FrameObject, PixelRect, PosedObject, Raster};
use crate::model::Surfels;

/// Surfels of a cluster; neighbours in memory are neighbours in space.
pub(super) const CLUSTER_SURFELS: usize = 256;

/// Slack of a box on the screen, pixels, against rounding.
const SLACK: f32 = 1.0;

/// Motion of a box while a strip is read out, as a multiple of that from its middle to its last row: kernels that land
/// beside the strip reach into it.
const BEYOND: f32 = 1.5;

/// Angle by which normals must at least be turned away, against rounding.
const TURN: f32 = 2e-3;

/// The clusters of the models that were rendered.
#[derive(Debug, Default)]
pub(super) struct ClusterStore {
    /// A weak reference keeps a model's address from another model, and frees its surfels.
    models: Vec<(Weak<Surfels>, Arc<Clusters>)>,
}

impl ClusterStore {
    /// The clusters of each object of `frame`.
    pub(super) fn of_frame(&mut self, frame: &Frame) -> Vec<Arc<Clusters>> {
        self.models.retain(|(model, _)| model.strong_count() > 0);
        let of = |object: &FrameObject| match object.shape.surfels() {
            Some(model) if model.paths().is_empty() => self.of(model.surfels()),
            // Surfels that move by themselves leave their clusters.
            _ => Arc::default(),
        };
        frame.objects.iter().map(of).collect()
    }

    /// The clusters of a model, made when it is first seen.
    pub(super) fn of(&mut self, surfels: &Arc<Surfels>) -> Arc<Clusters> {
        if let Some((_, clusters)) = self.models.iter().find(|(model, _)| model.as_ptr() == Arc::as_ptr(surfels)) {
            return Arc::clone(clusters);
        }
        let clusters = Arc::new(Clusters::of(surfels));
        self.models.push((Arc::downgrade(surfels), Arc::clone(&clusters)));
        clusters
    }
}

/// The clusters of a model.
#[derive(Clone, Debug, Default)]
pub(super) struct Clusters(Vec<Cluster>);

/// Neighbouring surfels, in model space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cluster {
    /// Least and greatest corner of their kernels; a kernel that is not finite shows nothing.
    pub corners: [Vec3; 2],
    /// About the mean direction of their normals, u x v.
    pub axis: Vec3,
    /// Greatest angle of a normal to the axis; more than half a turn where it is not known.
    pub spread: f32,
}

impl Cluster {
    /// The cluster of `surfels` in a range, with these centres.
    pub(super) fn of(surfels: &Surfels, range: Range<usize>, position: impl IntoIterator<Item = Vec3>) -> Self {
        let (u, v) = (&surfels.axis_u[range.clone()], &surfels.axis_v[range]);
        let mut corners = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        for (p, (u, v)) in position.into_iter().zip(u.iter().zip(v)) {
            let extent = if surfels.spheres { Vec3::splat(u.length()) } else { u.abs() + v.abs() };
            if p.is_finite() && extent.is_finite() {
                corners = [corners[0].min(p - extent), corners[1].max(p + extent)];
            }
        }
        // A surfel without a normal covers nothing.
        let normals = || u.iter().zip(v).filter_map(|(u, v)| u.cross(*v).try_normalize());
        let axis = normals().sum::<Vec3>().normalize_or_zero();
        let least = normals().map(|n| n.dot(axis)).fold(1.0, f32::min);
        let spread = if axis == Vec3::ZERO { f32::INFINITY } else { libm::acosf(least.max(-1.0)) };
        Self { corners, axis, spread }
    }

    /// Do all surfels clearly show their backs to `eye`?
    fn faces_away(&self, eye: Vec3) -> bool {
        let [low, high] = self.corners;
        let from_eye = 0.5 * (low + high) - eye;
        let (distance, radius) = (from_eye.length(), 0.5 * (high - low).length());
        // How far directions to the surfels, and then normals, may be turned from those of the middle.
        let slack = self.spread + libm::asinf((radius / distance).min(1.0)) + TURN;
        slack < std::f32::consts::FRAC_PI_2 && self.axis.dot(from_eye) > distance * libm::sinf(slack)
    }
}

impl Clusters {
    fn of(surfels: &Surfels) -> Self {
        let cluster = |(index, position): (usize, &[Vec3])| {
            let first = index * CLUSTER_SURFELS;
            Cluster::of(surfels, first..first + position.len(), position.iter().copied())
        };
        Self(surfels.position.par_chunks(CLUSTER_SURFELS).enumerate().map(cluster).collect())
    }

    /// Cluster `index`; `None` where clusters are not known.
    pub(super) fn get(&self, index: usize) -> Option<Cluster> {
        self.0.get(index).copied()
    }

    /// May cluster `index` show anything? `one_sided`: only what faces the eye does.
    pub(super) fn may_show(&self, index: usize, window: &Window<'_>, one_sided: bool) -> bool {
        self.0.get(index).is_none_or(|cluster| {
            let away = |eye: &Vec3| cluster.faces_away(*eye);
            let hidden = one_sided && away(&window.object.eye) && window.eyes.iter().all(away);
            !hidden && window.touches(&cluster.corners)
        })
    }
}

/// An object before the pixels that are wanted.
pub(super) struct Window<'a> {
    pub object: &'a PosedObject,
    /// As [`PosedObject::eyes`].
    pub eyes: [Vec3; 2],
    pub raster: &'a Raster,
    pub pixels: PixelRect,
    pub near: f32,
    /// Blocks of those pixels that are wanted; `None`: all.
    pub blocks: Option<&'a Blocks>,
}

impl Window<'_> {
    /// May anything in the box touch a wanted pixel? A box that reaches `near` has no bounds on the screen: it may,
    /// unless all of it is nearer, or outside one of the side planes of the view.
    fn touches(&self, [low, high]: &[Vec3; 2]) -> bool {
        let margin = SLACK + self.raster.low_pass.max(self.raster.apron() as f32);
        let [x0, x1, y0, y1] = self.pixels.to_array().map(|pixel| pixel as f32);
        let origin = [0, 1].map(|c| self.raster.axis[c] - self.raster.offset[c]);
        // Places along image axes x and y beyond which nothing is wanted, by at least a pixel.
        let slopes = [[x0, x1], [y0, y1]];
        let slopes = [0, 1].map(|c| [slopes[c][0] - margin - origin[c], slopes[c][1] + 1.0 + margin - origin[c]]);
        let (mut nearer, mut reaches_near, mut outside) = (true, false, [[true; 2]; 2]);
        let mut bounds = [f32::INFINITY, f32::NEG_INFINITY, f32::INFINITY, f32::NEG_INFINITY];
        let object = self.object;
        for corner in 0..8 {
            let pick = |c: usize| if corner >> c & 1 == 0 { low[c] } else { high[c] };
            let point = Vec3::new(pick(0), pick(1), pick(2));
            let middle = object.screen_from_model * point + object.screen_origin;
            let mut places = [middle; 3];
            if object.moves {
                let motion = (object.motion_from_model * point + object.motion_origin) * BEYOND;
                places = [middle - motion, middle, middle + motion];
            }
            for p in places {
                nearer &= p.z < self.near;
                reaches_near |= p.z.is_nan() || p.z <= self.near;
                for c in 0..2 {
                    outside[c][0] &= p[c] < slopes[c][0] * p.z;
                    outside[c][1] &= p[c] > slopes[c][1] * p.z;
                    let pixel = self.raster.axis[c] + p[c] / p.z - self.raster.offset[c];
                    bounds[2 * c] = bounds[2 * c].min(pixel);
                    bounds[2 * c + 1] = bounds[2 * c + 1].max(pixel);
                }
            }
        }
        if nearer || outside.as_flattened().contains(&true) {
            return false;
        }
        if reaches_near {
            return true;
        }
        let [left, right] = [(bounds[0] - margin).max(x0), (bounds[1] + margin).min(x1)];
        let [top, bottom] = [(bounds[2] - margin).max(y0), (bounds[3] + margin).min(y1)];
        let bounds = [left, right, top, bottom].map(|pixel| pixel as usize);
        let wanted = || self.blocks.is_none_or(|blocks| blocks.touch(self.raster.first, bounds));
        left <= right && top <= bottom && wanted()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cluster_shows_its_back_to_eyes_behind_it() {
        let corners = [Vec3::new(4.9, -0.1, -0.1), Vec3::new(5.1, 0.1, 0.1)];
        let cluster = Cluster { corners, axis: Vec3::X, spread: 0.1 };
        for x in [-20.0, 0.0, 3.0] {
            assert!(cluster.faces_away(Vec3::X * x), "from {x}");
        }
        for x in [7.0, 10.0, 20.0] {
            assert!(!cluster.faces_away(Vec3::X * x), "from {x}");
        }
        // From the side its surfels may show.
        assert!(!cluster.faces_away(Vec3::new(5.0, 9.0, 0.0)));
    }
}

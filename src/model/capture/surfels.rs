//! Captures taken as opaque surfels.
//!
//! The surfel has the two larger axes of a Gaussian at two sigma, where our kernel ends. The smallest axis is its
//! normal, whose sign the file does not say. Its colour is the part that is the same from all sides.

use glam::{DMat3, DVec3, Vec3};

use super::Gaussians;
use crate::model::cloud::{Cloud, ColourStorage};
use crate::model::tidy::retain;

/// Least alpha. Fainter Gaussians are dropped: as opaque surfels they would hide what should shine through them.
const LEAST_ALPHA: f32 = 0.35;

/// Largest sigma as a share of the model's size. Gaussians above it are dropped: as opaque surfels they are blobs.
///
/// Measured on a capture of a guitar, where the best looking limit is 2.7 % of the size (it drops 1 % of the Gaussians
/// that are left).
const LARGEST_SIGMA: f64 = 1.0 / 40.0;

/// Fewest Gaussians of a model with a meaningful size. Smaller models have no limit on sigma.
const FEWEST_FOR_SIZE: usize = 100;

impl Gaussians {
    /// Opaque surfels in their place.
    ///
    /// Colours are sRGB-encoded by custom (captures are trained on 8-bit images as they are), and marked so, unless the
    /// file says that they are linear.
    pub(in crate::model) fn into_cloud(self) -> Cloud {
        let solid: Vec<bool> = self.opacity.iter().map(|alpha| *alpha > LEAST_ALPHA).collect();
        let faint = solid.iter().filter(|s| !**s).count();
        let position: Vec<DVec3> = self.position.iter().map(|p| p.as_dvec3()).collect();
        let size = model_size(&position, &solid);
        let centre = middle(&position, &solid);
        let mut cloud = Cloud { position, notes: self.notes.clone(), ..Cloud::default() };
        let mut keep = Vec::with_capacity(self.len());
        let (mut large, mut broken) = (0_usize, self.dropped);
        for (index, solid) in solid.into_iter().enumerate() {
            let sigma = self.sigma[index].as_dvec3();
            let mut axes = [(sigma.x, 0), (sigma.y, 1), (sigma.z, 2)];
            axes.sort_by(|a, b| b.0.total_cmp(&a.0));
            let sane = axes[1].0 > 1e-30;
            let small = size.is_none_or(|size| axes[0].0 <= LARGEST_SIGMA * size);
            broken += usize::from(solid && !sane);
            large += usize::from(solid && sane && !small);
            keep.push(solid && sane && small);

            let frame = DMat3::from_quat(self.rotation[index].as_dquat().normalize());
            cloud.colour.push(self.colour(index).clamp(Vec3::ZERO, Vec3::ONE));
            let normal = frame.col(axes[2].1);
            let outward = if normal.dot(cloud.position[index] - centre) < 0.0 { -normal } else { normal };
            cloud.normal.push(outward.as_vec3());
            let [u, v] = [axes[0], axes[1]].map(|(sigma, i)| (frame.col(i) * (2.0 * sigma)).as_vec3());
            cloud.axes.push([u, v]);
        }
        retain(&mut cloud, &keep);
        cloud.colour_storage = if self.linear { ColourStorage::Float } else { ColourStorage::Integer };
        cloud.two_sided = true;
        let total = self.len() + self.dropped;
        cloud.notes.push(format!(
            "Gaussian splats drawn as opaque surfels: {} of {total} kept; \
             dropped {faint} with opacity up to {LEAST_ALPHA}, \
             {large} with a sigma above {}% of the model's size, \
             {broken} with a bad scale or rotation or another number that is none",
            cloud.position.len(),
            100.0 * LARGEST_SIGMA,
        ));
        if self.degree > 0 {
            cloud.notes.push(format!("Gaussian splats: harmonics of degrees 1 to {} ignored", self.degree));
        }
        let space = if self.linear { "linear light" } else { "sRGB" };
        cloud.notes.push(format!(
            "Gaussian splats: colours taken as {space}; normals (the smallest axes) have no sign: both sides are shown"
        ));
        cloud
    }
}

/// Diagonal of the box that leaves out the outermost 2 % on each side, as captures have stray splats far away.
fn model_size(positions: &[DVec3], solid: &[bool]) -> Option<f64> {
    let spans = [0, 1, 2].map(|axis| {
        let mut line = coordinates(positions, solid, axis);
        if line.len() < FEWEST_FOR_SIZE {
            return None;
        }
        let last = line.len() - 1;
        let low = *line.select_nth_unstable_by(last / 50, f64::total_cmp).1;
        let high = *line.select_nth_unstable_by(last - last / 50, f64::total_cmp).1;
        Some(high - low)
    });
    let [Some(x), Some(y), Some(z)] = spans else { return None };
    Some(DVec3::new(x, y, z).length()).filter(|size| *size > 0.0)
}

/// Median of each coordinate.
fn middle(positions: &[DVec3], solid: &[bool]) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| {
        let mut line = coordinates(positions, solid, axis);
        let half = line.len() / 2;
        if line.is_empty() { 0.0 } else { *line.select_nth_unstable_by(half, f64::total_cmp).1 }
    }))
}

fn coordinates(positions: &[DVec3], solid: &[bool], axis: usize) -> Vec<f64> {
    let kept = positions.iter().zip(solid).filter(|(p, solid)| **solid && p.is_finite());
    kept.map(|(p, _)| p[axis]).collect()
}

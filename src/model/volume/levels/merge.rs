//! One kernel in place of several.

use glam::{DMat3, DQuat, DVec3, Mat3, Quat, Vec3};

use crate::model::capture::Gaussians;
use crate::model::variance::eigen;

/// A kernel while it is merged.
#[derive(Clone, Debug)]
pub(super) struct Kernel {
    pub(super) position: Vec3,
    /// Model units^2.
    covariance: Mat3,
    /// The integral of extinction: [`Gaussians::opacity`].
    extinction: f32,
    base: Vec3,
    /// The mean of normals, which is shorter the more they differ; `None` where the volume emits.
    normal: Option<Vec3>,
}

/// The covariance of a kernel with these standard deviations along the axes of a rotation.
pub(super) fn covariance(sigma: Vec3, rotation: Quat) -> Mat3 {
    let axes = Mat3::from_quat(rotation) * Mat3::from_diagonal(sigma);
    axes * axes.transpose()
}

impl Kernel {
    /// Kernel `i` of a volume.
    pub(super) fn of(volume: &Gaussians, i: usize) -> Self {
        Self {
            position: volume.position[i],
            covariance: covariance(volume.sigma[i], volume.rotation[i]),
            extinction: volume.opacity[i],
            base: volume.base[i],
            normal: volume.normal.get(i).copied(),
        }
    }

    /// One in place of several: with all their extinction, and with the mean, the covariance and the mean colour that
    /// they have together. Each counts by its extinction; all alike where there is none.
    pub(super) fn merge<'a>(kernels: &(impl Iterator<Item = &'a Self> + Clone)) -> Self {
        let extinction: f32 = kernels.clone().map(|kernel| kernel.extinction).sum();
        let equal = (kernels.clone().count() as f32).recip();
        let share = |kernel: &Self| if extinction > 0.0 { kernel.extinction / extinction } else { equal };
        let mean = |of: fn(&Self) -> Vec3| kernels.clone().map(|kernel| of(kernel) * share(kernel)).sum();
        // Relative to one of them, and within their box: rounding does not move what lies in a plane.
        let places = || kernels.clone().map(|kernel| kernel.position);
        let (low, high) = (places().reduce(Vec3::min), places().reduce(Vec3::max));
        let (low, high) = (low.unwrap_or_default(), high.unwrap_or_default());
        let away: Vec3 = kernels.clone().map(|kernel| (kernel.position - low) * share(kernel)).sum();
        let position = (low + away).clamp(low, high);
        let spread = |kernel: &Self| {
            let away = kernel.position - position;
            (kernel.covariance + Mat3::from_cols(away * away.x, away * away.y, away * away.z)) * share(kernel)
        };
        let lit = kernels.clone().any(|kernel| kernel.normal.is_some());
        Self {
            position,
            covariance: kernels.clone().map(spread).sum(),
            extinction,
            base: mean(|kernel| kernel.base),
            normal: lit.then(|| mean(|kernel| kernel.normal.unwrap_or_default())),
        }
    }

    /// Adds it to kernels.
    pub(super) fn push(&self, to: &mut Gaussians) {
        let (variances, [x, y, z]) = eigen(self.covariance.as_dmat3());
        let turn = DMat3::from_cols(x, y, if x.cross(y).dot(z) < 0.0 { -z } else { z });
        to.position.push(self.position);
        to.sigma.push(DVec3::from_array(variances.map(|variance| variance.max(0.0).sqrt())).as_vec3());
        to.rotation.push(DQuat::from_mat3(&turn).normalize().as_quat());
        to.opacity.push(self.extinction);
        to.base.push(self.base);
        // Rounding may make it longer than 1.
        to.normal.extend(self.normal.map(|normal| normal.clamp_length_max(1.0)));
    }
}

//! A kernel of a volume in model space.

use glam::{DMat3, DVec3, Vec3};

use crate::model::Gaussians;
use crate::reference::gaussians::tree::Placed;
use crate::scene::Drawing;

/// Standard deviations from its centre within which a kernel counts. Beyond it has 1.5e-8 of its peak.
pub(in crate::reference) const REACH: f64 = 6.0;

/// A kernel that can be seen.
#[derive(Clone, Copy, Debug)]
pub(in crate::reference) struct VolumeKernel {
    pub centre: Vec3,
    /// Number in the volume.
    pub index: u32,
    /// Covariance V: xx, xy, xz, yy, yz, zz.
    pub covariance: [f64; 6],
    /// |V| V^-1, in the same order. It is finite where V is flat.
    pub adjugate: [f64; 6],
    /// The root of |V|.
    pub root: f64,
    /// Integral of its extinction over space: extinction per scene unit times model units^3.
    pub mass: f64,
    /// [`REACH`] times the greatest standard deviation, model units.
    pub radius: f64,
}

impl Placed for VolumeKernel {
    fn centre(&self) -> Vec3 {
        self.centre
    }

    fn radius(&self) -> f64 {
        self.radius
    }
}

impl VolumeKernel {
    /// Kernel `index` of a volume. `None` where it has no mass, where it is a line or a point, which no ray meets, or
    /// where it is not finite.
    pub(in crate::reference) fn of(gaussians: &Gaussians, drawing: &Drawing, index: u32) -> Option<Self> {
        let i = index as usize;
        let axes = DMat3::from_quat(gaussians.rotation[i].as_dquat().normalize());
        let [x, y, z] = gaussians.sigma[i].as_dvec3().abs().to_array();
        let with = |diagonal: DVec3| {
            let m = axes * DMat3::from_diagonal(diagonal) * axes.transpose();
            [m.x_axis.x, m.x_axis.y, m.x_axis.z, m.y_axis.y, m.y_axis.z, m.z_axis.z]
        };
        let kernel = Self {
            centre: gaussians.position[i],
            index,
            covariance: with(DVec3::new(x * x, y * y, z * z)),
            adjugate: with(DVec3::new(y * y * z * z, x * x * z * z, x * x * y * y)),
            root: x * y * z,
            mass: f64::from(gaussians.opacity[i]) * drawing.opacity,
            radius: REACH * x.max(y).max(z),
        };
        let is_flat_at_most = kernel.adjugate.iter().any(|value| *value != 0.0);
        let numbers = kernel.covariance.iter().chain(&kernel.adjugate).chain([&kernel.root, &kernel.mass]);
        let is_finite = kernel.centre.is_finite() && numbers.copied().all(f64::is_finite);
        (kernel.mass > 0.0 && is_flat_at_most && is_finite).then_some(kernel)
    }
}

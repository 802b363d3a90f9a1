//! Kernels along one ray.
//!
//! The ray is e + z d relative to the centre of a kernel; z is camera depth. With the adjugate M = |V| V^-1 and A = d^T
//! M d the kernel along the ray is a Gaussian of depth with the centre -d^T M e / A and the variance |V| / A. The
//! square of its distance from the ray, in standard deviations, is q = c^T V c / A with c = e x d. Neither cancels
//! where the kernel is thin, and a flat one (|V| = 0) is nothing special.

use glam::DVec3;

use super::kernel::VolumeKernel;
use crate::math::simd::dispatch;

/// Most kernels that are looked at together.
pub(super) const BATCH: usize = 128;

/// Kernels of one volume, value by value.
#[derive(Clone, Debug)]
pub(super) struct KernelBatch {
    centre: [[f64; BATCH]; 3],
    covariance: [[f64; BATCH]; 6],
    adjugate: [[f64; BATCH]; 6],
    pub root: [f64; BATCH],
    pub mass: [f64; BATCH],
    pub radius: [f64; BATCH],
    /// Places in the tree.
    pub place: [u32; BATCH],
    /// Colours in the numbers of the image's blending, if all rays see the same.
    pub colour: Option<[DVec3; BATCH]>,
    pub count: usize,
    /// Number of the volume.
    pub volume: usize,
}

impl Default for KernelBatch {
    fn default() -> Self {
        Self {
            centre: [[0.0; BATCH]; 3],
            covariance: [[0.0; BATCH]; 6],
            adjugate: [[0.0; BATCH]; 6],
            root: [0.0; BATCH],
            mass: [0.0; BATCH],
            radius: [0.0; BATCH],
            place: [0; BATCH],
            colour: None,
            count: 0,
            volume: 0,
        }
    }
}

impl KernelBatch {
    /// Adds one; there must be room.
    pub(super) fn push(&mut self, kernel: &VolumeKernel, place: u32) {
        let i = self.count;
        for (values, value) in self.centre.iter_mut().zip(kernel.centre.to_array()) {
            values[i] = f64::from(value);
        }
        for (values, value) in self.covariance.iter_mut().zip(kernel.covariance) {
            values[i] = value;
        }
        for (values, value) in self.adjugate.iter_mut().zip(kernel.adjugate) {
            values[i] = value;
        }
        (self.root[i], self.mass[i], self.radius[i]) = (kernel.root, kernel.mass, kernel.radius);
        self.place[i] = place;
        self.count += 1;
    }
}

/// Kernels of a batch along a ray.
#[derive(Clone, Debug)]
pub(super) struct Along {
    /// Camera depth of the greatest extinction.
    pub depth: [f64; BATCH],
    /// Square of the distance from the ray, in standard deviations.
    pub q: [f64; BATCH],
    /// A; the variance of depth is |V| / A.
    pub a: [f64; BATCH],
}

impl Default for Along {
    fn default() -> Self {
        Self { depth: [0.0; BATCH], q: [0.0; BATCH], a: [0.0; BATCH] }
    }
}

dispatch! {
    /// Looks at all kernels of a batch from `eye` along `d`, in the model.
    pub(super) fn look(batch: &KernelBatch, eye: DVec3, d: DVec3, out: &mut Along) = look_body
}

#[inline(always)]
fn look_body(batch: &KernelBatch, eye: DVec3, d: DVec3, out: &mut Along) {
    let form = |m: &[[f64; BATCH]; 6], i: usize, u: [f64; 3], v: [f64; 3]| {
        let [x, y, z] = [
            m[0][i] * v[0] + m[1][i] * v[1] + m[2][i] * v[2],
            m[1][i] * v[0] + m[3][i] * v[1] + m[4][i] * v[2],
            m[2][i] * v[0] + m[4][i] * v[1] + m[5][i] * v[2],
        ];
        u[0] * x + u[1] * y + u[2] * z
    };
    let d = d.to_array();
    for i in 0..batch.count.min(BATCH) {
        let e = [eye.x - batch.centre[0][i], eye.y - batch.centre[1][i], eye.z - batch.centre[2][i]];
        let c = [e[1] * d[2] - e[2] * d[1], e[2] * d[0] - e[0] * d[2], e[0] * d[1] - e[1] * d[0]];
        let a = form(&batch.adjugate, i, d, d);
        out.depth[i] = -form(&batch.adjugate, i, e, d) / a;
        out.q[i] = form(&batch.covariance, i, c, c) / a;
        out.a[i] = a;
    }
}

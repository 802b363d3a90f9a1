//! How one ray sees Gaussians of one object: their depths and their exponents q = D^T V'^-1 D.
//!
//! V' = J W S W^T J^T + 0.3 pixels^2 (Kerbl et al. 2023, their program; Zwicker et al. 2001, eq. 24): J is the
//! derivative of the projection at the centre, whose tangents are kept within 1.3 of the half field of view.
//!
//! All is multiplied by (z / f)^2. The centre is at (x, y, z) in the camera, and e = z u - (x, y) for the tangents u of
//! the film point. The transform has the rows X, Y and Z, and J the tangents s and t: together they leave the rows
//! a = X - s Z and b = Y - t Z. With d = 0.3 z^2 / f^2, q = e^T (aSa + d, aSb; aSb, bSb + d)^-1 e.

use glam::DVec3;

use super::tree::GaussianKernel;
use crate::math::simd::dispatch;

/// Most Gaussians that are looked at together.
pub(super) const BATCH: usize = 128;

/// Gaussians of one object, value by value.
#[derive(Clone, Debug)]
pub(super) struct GaussianBatch {
    centre: [[f64; BATCH]; 3],
    covariance: [[f64; BATCH]; 6],
    pub count: usize,
}

impl Default for GaussianBatch {
    fn default() -> Self {
        Self { centre: [[0.0; BATCH]; 3], covariance: [[0.0; BATCH]; 6], count: 0 }
    }
}

impl GaussianBatch {
    /// Adds one; there must be room.
    pub(super) fn push(&mut self, kernel: &GaussianKernel) {
        for (values, value) in self.centre.iter_mut().zip(kernel.centre.to_array()) {
            values[self.count] = f64::from(value);
        }
        for (values, value) in self.covariance.iter_mut().zip(kernel.covariance) {
            values[self.count] = value;
        }
        self.count += 1;
    }
}

/// What a ray has in common for all Gaussians of an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    /// Rows of the transform from the model to the camera: right, down, forward.
    pub rows: [DVec3; 3],
    /// Place of the model's origin: right, down, forward.
    pub offset: DVec3,
    /// Tangents of the film point: right, down.
    pub tangent: [f64; 2],
    /// Bounds of the tangents of J.
    pub bounds: [f64; 2],
    /// 0.3 pixels^2, as a square of tangents.
    pub dilation: f64,
}

/// Gaussians of a batch as a ray sees them.
#[derive(Clone, Debug)]
pub(super) struct Seen {
    /// Camera depth of the centre.
    pub depth: [f64; BATCH],
    pub q: [f64; BATCH],
    /// |V| / |V'|, the square of what antialiasing multiplies opacities by.
    pub shrink: [f64; BATCH],
}

impl Default for Seen {
    fn default() -> Self {
        Self { depth: [0.0; BATCH], q: [0.0; BATCH], shrink: [0.0; BATCH] }
    }
}

dispatch! {
    /// Looks at all Gaussians of a batch.
    pub(super) fn look(batch: &GaussianBatch, sight: &Sight, out: &mut Seen) = look_body
}

#[inline(always)]
fn look_body(batch: &GaussianBatch, sight: &Sight, out: &mut Seen) {
    let Sight { rows: [right, down, forward], offset, tangent, bounds, dilation } = *sight;
    for i in 0..batch.count.min(BATCH) {
        let [cx, cy, cz] = [batch.centre[0][i], batch.centre[1][i], batch.centre[2][i]];
        let x = right.x * cx + right.y * cy + right.z * cz + offset.x;
        let y = down.x * cx + down.y * cy + down.z * cz + offset.y;
        let z = forward.x * cx + forward.y * cy + forward.z * cz + offset.z;
        let over = 1.0 / z;
        let tx = (x * over).max(-bounds[0]).min(bounds[0]);
        let ty = (y * over).max(-bounds[1]).min(bounds[1]);
        let [ax, ay, az] = [right.x - tx * forward.x, right.y - tx * forward.y, right.z - tx * forward.z];
        let [bx, by, bz] = [down.x - ty * forward.x, down.y - ty * forward.y, down.z - ty * forward.z];
        let [xx, xy, xz] = [batch.covariance[0][i], batch.covariance[1][i], batch.covariance[2][i]];
        let [yy, yz, zz] = [batch.covariance[3][i], batch.covariance[4][i], batch.covariance[5][i]];
        let [sax, say, saz] = [xx * ax + xy * ay + xz * az, xy * ax + yy * ay + yz * az, xz * ax + yz * ay + zz * az];
        let [sbx, sby, sbz] = [xx * bx + xy * by + xz * bz, xy * bx + yy * by + yz * bz, xz * bx + yz * by + zz * bz];
        let (aa, ab, bb) =
            (ax * sax + ay * say + az * saz, bx * sax + by * say + bz * saz, bx * sbx + by * sby + bz * sbz);
        let d = dilation * z * z;
        let (va, vb) = (aa + d, bb + d);
        let determinant = va * vb - ab * ab;
        let (ex, ey) = (z * tangent[0] - x, z * tangent[1] - y);
        out.depth[i] = z;
        out.q[i] = (vb * ex * ex - 2.0 * ab * ex * ey + va * ey * ey) / determinant;
        out.shrink[i] = (aa * bb - ab * ab) / determinant;
    }
}

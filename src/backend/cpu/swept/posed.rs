//! A kernel in motion in screen space, and its linear forms (docs/math.md, eq. 11).

use glam::Vec3;

/// A kernel in screen space: homogeneous pixel coordinates (x, y, depth) about the camera's axis.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend::cpu) struct Posed {
    /// Centre at tau = 0.
    pub centre: Vec3,
    /// From there to tau = 1.
    pub motion: Vec3,
    pub u: Vec3,
    pub v: Vec3,
}

/// The linear forms of a kernel with axes `u` and `v`, sheared as `motion` is: inverse depth, u, v, and the rates of u
/// and v (docs/math.md, eq. 11). `inverse`: 1 over the centre's depth.
#[inline(always)]
pub(super) fn forms(
    [ux, uy, uz]: [f32; 3],
    [vx, vy, vz]: [f32; 3],
    [mx, my, mz]: [f32; 3],
    inverse: f32,
) -> [[f32; 3]; 5] {
    let over_area = 1.0 / (ux * vy - uy * vx);
    let over_both = over_area * inverse;
    [
        [(uy * vz - uz * vy) * over_both, (uz * vx - ux * vz) * over_both, inverse],
        [vy * over_area, -vx * over_area, 0.0],
        [-uy * over_area, ux * over_area, 0.0],
        [(vy * mz - vz * my) * over_both, (vz * mx - vx * mz) * over_both, (vx * my - vy * mx) * over_both],
        [(my * uz - mz * uy) * over_both, (mz * ux - mx * uz) * over_both, (mx * uy - my * ux) * over_both],
    ]
}

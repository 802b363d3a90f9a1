//! The shape of a point's neighbourhood: its principal axes, and how flat it is.

use glam::{DMat3, DVec3, Vec3};

/// Neighbours that the shape of a surface around a point is told from.
pub(super) const NEAREST: usize = 16;

/// Share of the least variance of a point and its neighbours in all of their variance: 0 for a plane, at most 1/3.
pub(super) fn flatness(position: &[Vec3], i: usize, near: &[u32]) -> f64 {
    principal(position, i, near).map_or(0.0, |(variance, _)| variance[0] / (variance[0] + variance[1] + variance[2]))
}

/// Variances of a point and its neighbours along their principal axes, ascending, and these axes; `None` if all are in
/// one place.
pub(super) fn principal(position: &[Vec3], i: usize, near: &[u32]) -> Option<([f64; 3], [DVec3; 3])> {
    let centre = position[i].as_dvec3();
    let offset = |&j: &u32| position[j as usize].as_dvec3() - centre;
    let mean = near.iter().map(offset).sum::<DVec3>() / (near.len() + 1) as f64;
    // The point itself has the offset zero. The neighbourhood is scaled to size 1, so that squares neither overflow nor
    // underflow.
    let size = near.iter().map(|j| offset(j).abs().max_element()).fold(0.0, f64::max);
    if size == 0.0 {
        return None;
    }
    let outer = |d: DVec3| DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    let covariance = near.iter().fold(outer(mean / size), |sum, j| sum + outer((offset(j) - mean) / size));
    Some(eigen(covariance))
}

/// Eigenvalues, ascending, and unit eigenvectors of a symmetric matrix by cyclic Jacobi rotations (Golub and Van Loan,
/// *Matrix Computations*, 8.5). They need no function but square roots, so the bits are the same on every computer.
pub(super) fn eigen(mut a: DMat3) -> ([f64; 3], [DVec3; 3]) {
    let mut v = DMat3::IDENTITY;
    // The rotations converge quadratically. No input has needed more than five sweeps.
    for _ in 0..12 {
        let off = a.y_axis.x.abs() + a.z_axis.x.abs() + a.z_axis.y.abs();
        let diagonal = a.x_axis.x.abs() + a.y_axis.y.abs() + a.z_axis.z.abs();
        if off <= 1e-17 * diagonal {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let apq = a.col(q)[p];
            if apq == 0.0 {
                continue;
            }
            let theta = (a.col(q)[q] - a.col(p)[p]) / (2.0 * apq);
            let t = 1.0_f64.copysign(theta) / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            let mut rotation = DMat3::IDENTITY;
            rotation.col_mut(p)[p] = c;
            rotation.col_mut(q)[q] = c;
            rotation.col_mut(q)[p] = s;
            rotation.col_mut(p)[q] = -s;
            a = rotation.transpose() * a * rotation;
            v *= rotation;
        }
    }
    let values = [a.x_axis.x, a.y_axis.y, a.z_axis.z];
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
    (order.map(|i| values[i]), order.map(|i| v.col(i)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn eigenvectors_solve_their_equation(m in prop::array::uniform6(-1.0_f64..1.0), zeros in 0_u8..64) {
            let m: [f64; 6] = std::array::from_fn(|i| if zeros >> i & 1 == 1 { 0.0 } else { m[i] });
            let a = DMat3::from_cols_array(&[m[0], m[1], m[2], m[1], m[3], m[4], m[2], m[4], m[5]]);
            let (values, vectors) = eigen(a);
            prop_assert!(values[0] <= values[1] && values[1] <= values[2]);
            for (value, vector) in values.iter().zip(vectors) {
                prop_assert!((a * vector - vector * *value).length() < 1e-14);
                prop_assert!((vector.length() - 1.0).abs() < 1e-14);
            }
        }
    }
}

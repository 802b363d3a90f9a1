//! 3D Gaussian-splat captures (Kerbl et al. 2023) in the plain PLY layout, taken as opaque surfels.
//!
//! A splat has sigma = e^scale along the three axes of a rotation (w, x, y, z), alpha = 1 / (1 + e^-opacity), and the
//! colour 0.5 + `SH_C0` `f_dc` for the direction-independent term. Higher terms are ignored. The surfel has the two
//! larger axes at two sigma, where our kernel ends. The smallest axis is its normal, whose sign the file does not say.

use glam::{DMat3, DQuat, DVec3, Vec3};

use super::cloud::{Cloud, ColourStorage};
use super::tidy::retain;

/// Least alpha. Fainter splats are dropped: as opaque surfels they would hide what should shine through them.
const LEAST_ALPHA: f64 = 0.35;

/// Largest sigma as a share of the model's size. Splats above it are dropped: as opaque surfels they are blobs.
///
/// Measured on a capture of a guitar, where the best looking limit is 2.7 % of the size (it drops 1 % of the splats
/// that are left).
const LARGEST_SIGMA: f64 = 1.0 / 40.0;

/// Fewest splats of a model with a meaningful size. Smaller models have no limit on sigma.
const FEWEST_FOR_SIZE: usize = 100;

/// The spherical harmonic of degree 0: 1 / (2 sqrt(pi)).
const SH_C0: f64 = 0.282_094_791_773_878_14;

/// Fills in the attributes of `cloud`, which already has the positions. `splats` holds `f_dc` 0..2, opacity, scale 0..2
/// and rot 0..3.
///
/// Colours are sRGB-encoded by custom (captures are trained on 8-bit images as they are), and marked so.
pub(super) fn fill(cloud: &mut Cloud, splats: &[[f64; 11]]) {
    let solid: Vec<bool> = splats.iter().map(|s| 1.0 / (1.0 + (-s[3]).exp()) > LEAST_ALPHA).collect();
    let faint = solid.iter().filter(|s| !**s).count();
    let size = model_size(&cloud.position, &solid);
    let mut keep = Vec::with_capacity(splats.len());
    let (mut large, mut broken) = (0_usize, 0_usize);
    let centre = middle(&cloud.position, &solid);
    for ((splat, position), solid) in splats.iter().zip(&cloud.position).zip(solid) {
        let [dc0, dc1, dc2, _, s0, s1, s2, w, x, y, z] = *splat;
        let mut axes = [(s0.exp(), 0), (s1.exp(), 1), (s2.exp(), 2)];
        axes.sort_by(|a, b| b.0.total_cmp(&a.0));
        let rotation = DQuat::from_xyzw(x, y, z, w);
        let sane = axes[0].0 < 1e18 && axes[1].0 > 1e-30 && (1e-30..1e30).contains(&rotation.length_squared());
        let small = size.is_none_or(|size| axes[0].0 <= LARGEST_SIGMA * size);
        broken += usize::from(solid && !sane);
        large += usize::from(solid && sane && !small);
        keep.push(solid && sane && small);

        let frame = if sane { DMat3::from_quat(rotation.normalize()) } else { DMat3::IDENTITY };
        let colour = DVec3::new(dc0, dc1, dc2) * SH_C0 + 0.5;
        cloud.colour.push(colour.clamp(DVec3::ZERO, DVec3::ONE).as_vec3());
        let normal = frame.col(axes[2].1);
        let outward = if normal.dot(*position - centre) < 0.0 { -normal } else { normal };
        cloud.normal.push(outward.as_vec3());
        let [u, v] = [axes[0], axes[1]].map(|(sigma, i)| (frame.col(i) * (2.0 * sigma)).as_vec3());
        cloud.axes.push(if sane { [u, v] } else { [Vec3::X, Vec3::Y] });
    }
    retain(cloud, &keep);
    cloud.colour_storage = ColourStorage::Integer;
    cloud.two_sided = true;
    let total = splats.len();
    cloud.notes.push(format!(
        "Gaussian splats drawn as opaque surfels: {} of {total} kept; \
         dropped {faint} with opacity up to {LEAST_ALPHA}, \
         {large} with a sigma above {}% of the model's size, {broken} with a bad scale or rotation",
        cloud.position.len(),
        100.0 * LARGEST_SIGMA,
    ));
    cloud.notes.push(
        "Gaussian splats: colours taken as sRGB; normals (the smallest axes) have no sign: both sides are shown"
            .to_owned(),
    );
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

//! Stand-in until the branch that estimates normals and radii is merged.

use glam::Vec3;

use super::{Cloud, ColourSpace, ColourStorage, LoadOptions, ModelError, Progress, Surfels};
use crate::math::{Bounds, srgb};

/// Completes a cloud.
pub(super) fn complete(
    cloud: Cloud,
    options: &LoadOptions,
    _progress: Progress<'_>,
) -> Result<(Surfels, Vec<String>), ModelError> {
    let n = cloud.position.len();
    if n == 0 {
        return Err(ModelError::NoPoints);
    }
    let origin = cloud.position.iter().copied().collect::<Bounds>().centre();
    let srgb = options.colour_space.map_or(cloud.colour_storage == ColourStorage::Integer, |c| c == ColourSpace::Srgb);
    let normal: Vec<Vec3> = if cloud.normal.is_empty() { vec![Vec3::Z; n] } else { cloud.normal };
    let normal: Vec<Vec3> = normal.into_iter().map(|n| if n == Vec3::ZERO { Vec3::Z } else { n }).collect();
    let scale = options.radius_scale as f32;
    let mut s = Surfels { origin, material: cloud.material, velocity: cloud.velocity, ..Surfels::default() };
    for (i, n) in normal.iter().enumerate() {
        s.position.push((cloud.position[i] - origin).as_vec3());
        let radius = cloud.radius.get(i).copied().filter(|r| *r > 0.0).unwrap_or(0.01);
        let pair = n.any_orthonormal_pair();
        let axes = cloud.axes.get(i).copied().filter(|a| a[0] != Vec3::ZERO);
        let [u, v] = axes.unwrap_or([pair.0 * radius, pair.1 * radius]);
        s.axis_u.push(u * scale);
        s.axis_v.push(v * scale);
        let c = cloud.colour.get(i).copied().unwrap_or(Vec3::ONE);
        s.colour.push(if srgb { Vec3::from_array(c.to_array().map(srgb::to_linear)) } else { c });
    }
    s.normal = normal;
    Ok((s, Vec::new()))
}

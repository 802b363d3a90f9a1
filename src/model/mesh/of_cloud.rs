//! A mesh of vertices that a point format read.

use glam::{Vec3, Vec4};

use super::smooth::smooth;
use super::{AlphaMode, Mesh, MeshMaterial, Triangle};
use crate::math::srgb;
use crate::model::cloud::{Cloud, ColourStorage, PLAIN};
use crate::model::options::ColourSpace;
use crate::model::tidy::clamp_colours;

/// A mesh of one material. Colours are taken in `space`, or else as the file stores them: integers are sRGB, floats are
/// linear. Opacities that are all 0 say nothing.
pub(crate) fn of_cloud(mut cloud: Cloud, triangles: Vec<[u32; 3]>, space: Option<ColourSpace>) -> Mesh {
    clamp_colours(&mut cloud);
    let by_storage = match cloud.colour_storage {
        ColourStorage::Integer => ColourSpace::Srgb,
        ColourStorage::Float => ColourSpace::Linear,
    };
    let is_linear = space.unwrap_or(by_storage) == ColourSpace::Linear;
    let curve = |x: f32| if is_linear { x } else { srgb::to_linear(x) };
    let opacity = if cloud.opacity.iter().any(|opacity| *opacity > 0.0) { cloud.opacity } else { Vec::new() };
    let coloured = !cloud.colour.is_empty() || !opacity.is_empty();
    let colour = |i: usize| {
        let colour = cloud.colour.get(i).filter(|c| c.is_finite()).copied().unwrap_or(Vec3::ONE);
        let opacity = opacity.get(i).copied().filter(|o| (0.0..=1.0).contains(o)).unwrap_or(1.0);
        Vec4::new(curve(colour.x), curve(colour.y), curve(colour.z), opacity)
    };
    let mut notes = cloud.notes;
    if cloud.colour.is_empty() {
        notes.push("no colours: grey".to_owned());
    }
    let alpha = if opacity.is_empty() { AlphaMode::Opaque } else { AlphaMode::Blend };
    let grey = Vec3::splat(PLAIN).extend(1.0);
    let colour_of_all = if cloud.colour.is_empty() { grey } else { Vec4::ONE };
    let mut mesh = Mesh {
        normal: cloud.normal.into_iter().map(|n| n.try_normalize().unwrap_or(Vec3::ZERO)).collect(),
        colour: (0..if coloured { cloud.position.len() } else { 0 }).map(colour).collect(),
        position: cloud.position,
        uv: Vec::new(),
        triangles: triangles.into_iter().map(|corners| Triangle { corners, material: 0 }).collect(),
        materials: vec![MeshMaterial {
            colour: colour_of_all,
            alpha,
            two_sided: cloud.two_sided,
            ..MeshMaterial::default()
        }],
        textures: Vec::new(),
        notes,
    };
    smooth(&mut mesh);
    mesh
}

//! The colour of a Gaussian as the eye sees it: its own, by direction, or lit by the lights of the sample.

use glam::Vec3;

use super::harmonics;
use super::view::GaussianView;
use crate::film::Blending;
use crate::math::srgb;
use crate::model::{Gaussians, Material};
use crate::shading::shade;

/// In the numbers of the image.
pub(super) fn colour(view: &GaussianView<'_>, gaussians: &Gaussians, index: usize) -> [f32; 3] {
    let drawing = &view.drawing;
    if let Some(flat) = drawing.flat {
        return flat.to_array();
    }
    let direction = || (gaussians.position[index] - view.posed.eye).normalize_or_zero();
    let own = gaussians.colour(index) + harmonics::sum(gaussians, index, drawing.harmonics, direction);
    let own = own.max(Vec3::ZERO);
    let own = gaussians.normal.get(index).map_or(own, |&normal| lit(view, own, normal, gaussians.position[index]));
    let own = own.to_array();
    if gaussians.linear && view.blending == Blending::Coded { own.map(srgb::from_linear) } else { own }
}

/// `colour` lit once for the whole kernel, with the normal on the side of the eye (Zwicker et al. 2002, sections 4.2
/// and 7.1). Ambient light alone reaches what has no normal.
fn lit(view: &GaussianView<'_>, colour: Vec3, normal: Vec3, position: Vec3) -> Vec3 {
    let posed = view.posed;
    let material = view.object.material.unwrap_or_default();
    let position = posed.world_from_model * position + posed.world_origin;
    let normal = (posed.normal_matrix * normal).normalize_or_zero();
    let normal = if normal.dot(position) > 0.0 { -normal } else { normal };
    let material = if normal == Vec3::ZERO { Material { diffuse: 0.0, specular: 0.0, ..material } } else { material };
    shade(&view.sample.lights, &material, colour, normal, position)
}

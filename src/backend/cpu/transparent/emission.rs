//! The colour of a Gaussian as the eye sees it: its own, by direction, or lit by the lights of the sample.

use glam::Vec3;

use super::harmonics;
use super::view::{GaussianView, Shaded};
use crate::film::Blending;
use crate::math::srgb;
use crate::model::{Gaussians, Material};
use crate::shading::{ShadingLight, shade_by, towards_point};

/// In the numbers of the image.
pub(super) fn colour(view: &GaussianView<'_>, gaussians: &Gaussians, index: usize) -> [f32; 3] {
    let drawing = &view.drawing;
    if let Some(flat) = drawing.flat {
        return flat.to_array();
    }
    let direction = || (gaussians.position[index] - view.posed.eye).normalize_or_zero();
    let own = gaussians.colour(index) + harmonics::sum(gaussians, index, drawing.harmonics, direction);
    let own = own.max(Vec3::ZERO);
    let own = gaussians.normal.get(index).map_or(own, |&normal| lit(view, gaussians, index, own, normal));
    let own = own.to_array();
    let coded = view.blending == Blending::Coded;
    let own = if gaussians.linear && coded { own.map(srgb::from_linear) } else { own };
    let shaded = view.shaded.filter(|_| !view.object.is_volume());
    let Some(left) = shaded.and_then(|shaded| light_left(&shaded, gaussians.position[index])) else { return own };
    let darkened = |c: usize| {
        let linear = if coded { srgb::to_linear_nearly(own[c]) } else { own[c] };
        if coded { srgb::from_linear_nearly(left[c] * linear) } else { left[c] * linear }
    };
    [darkened(0), darkened(1), darkened(2)]
}

/// The share of all light that reaches a place of the model in spite of shadows, without any normal; `None` where all
/// does (docs/math.md, eq. 54).
fn light_left(shaded: &Shaded<'_>, position: Vec3) -> Option<Vec3> {
    let Shaded { shadows, sample, posed } = *shaded;
    let place = posed.world_from_model * position + posed.world_origin;
    let depth = -sample.world_from_camera.z_axis.dot(place);
    let (mut all, mut taken) = (Vec3::ZERO, Vec3::ZERO);
    for (number, light) in sample.lights.iter().enumerate() {
        let radiance = match *light {
            ShadingLight::Ambient { colour } | ShadingLight::Directional { colour, .. } => colour,
            // What it shows a normal is 1/4 of it in the mean over normals.
            ShadingLight::Harmonics { terms } => 4.0 * terms[0],
            ShadingLight::Point { position, colour, .. } => {
                towards_point(position.to_array(), place.to_array()).1 * colour
            }
        };
        all += radiance;
        if light.has_shadows() && !shadows.reaches(number, place, depth, true) {
            taken += radiance;
        }
    }
    let left = |all: f32, taken: f32| {
        if all > taken {
            1.0 - taken / all
        } else if taken > 0.0 {
            0.0
        } else {
            1.0
        }
    };
    (taken != Vec3::ZERO).then(|| Vec3::new(left(all.x, taken.x), left(all.y, taken.y), left(all.z, taken.z)))
}

/// `colour` lit once for the whole kernel, with the normal on the side of the eye (Zwicker et al. 2002, sections 4.2
/// and 7.1). Ambient light alone reaches what has no normal. Where shadows fall on it, it is lit as in the middle of
/// its group, by the light that reaches its centre through itself and others (docs/math.md, section 17).
fn lit(view: &GaussianView<'_>, gaussians: &Gaussians, index: usize, colour: Vec3, normal: Vec3) -> Vec3 {
    let shaded = view.shaded.filter(|_| view.object.is_volume());
    let (sample, posed) = shaded.map_or((view.sample, view.posed), |shaded| (shaded.sample, shaded.posed));
    let material = view.object.material.unwrap_or_default();
    let place = posed.world_from_model * gaussians.position[index] + posed.world_origin;
    let normal = (posed.normal_matrix * normal).normalize_or_zero();
    let normal = if normal.dot(place) > 0.0 { -normal } else { normal };
    let material = if normal == Vec3::ZERO { Material { diffuse: 0.0, specular: 0.0, ..material } } else { material };
    let depth = -sample.world_from_camera.z_axis.dot(place);
    let reaching = |number: usize, towards: Vec3| {
        let Some(Shaded { shadows, .. }) = shaded.filter(|_| sample.lights[number].has_shadows()) else { return 1.0 };
        f32::from(u8::from(normal.dot(towards) > 0.0 && shadows.reaches(number, place, depth, false)))
    };
    shade_by(&sample.lights, &material, colour, normal, place, reaching)
}

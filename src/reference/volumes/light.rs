//! The light of a kernel: its own colour, or what lights make of it.

use glam::{DMat4, DVec3};

use super::kernel::VolumeKernel;
use crate::math::srgb;
use crate::reference::gaussians::colour::colour;
use crate::reference::gaussians::place::ModelPlace;
use crate::reference::posed::{BodyPose, Volume, World};
use crate::shading::{ShadingLight, shade};

/// How a ray sees a volume.
#[derive(Clone, Copy, Debug)]
pub(super) struct VolumeView {
    pub pose: BodyPose,
    pub place: ModelPlace,
    /// The eye in the world.
    pub eye: DVec3,
    /// Length of the ray in the world for a depth of 1.
    pub length: f64,
    pub time: f64,
    /// Change of the model's place relative to the camera, per shutter; made when it is asked for.
    pub rate: Option<DMat4>,
}

/// The lights relative to an eye.
#[derive(Debug, Default)]
pub(super) struct Lights {
    eye: Option<DVec3>,
    all: Vec<ShadingLight>,
    /// Those that need no normal.
    ambient: Vec<ShadingLight>,
}

impl Lights {
    /// Linear light of a kernel: its own colour, or that which lights give it where the volume has normals.
    pub(super) fn colour(
        &mut self,
        world: &World<'_>,
        volume: &Volume<'_>,
        kernel: &VolumeKernel,
        view: &VolumeView,
    ) -> DVec3 {
        let (body, gaussians, index) = (&world.bodies[volume.body], volume.gaussians, kernel.index as usize);
        let own = colour(gaussians, &body.drawing, index, view.place.eye);
        let own = if gaussians.linear { own } else { own.map(srgb::linear) };
        let Some(&normal) = gaussians.normal.get(index) else { return own };
        if self.eye != Some(view.eye) {
            self.eye = Some(view.eye);
            world.lights(view.eye, &mut self.all);
            let ambient = self.all.iter().filter(|light| matches!(light, ShadingLight::Ambient { .. }));
            self.ambient = ambient.copied().collect();
        }
        let from_eye = view.pose.world_from_model.transform_point3(kernel.centre.as_dvec3()) - view.eye;
        let normal = view.pose.normal(normal.as_dvec3());
        let normal = if normal.dot(from_eye) > 0.0 { -normal } else { normal };
        let lights = if normal == DVec3::ZERO { &self.ambient } else { &self.all };
        let material = body.material(index);
        shade(lights, &material, own.as_vec3(), normal.as_vec3(), from_eye.as_vec3()).as_dvec3()
    }
}

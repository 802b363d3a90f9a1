//! The light of a kernel: its own colour, or what lights make of it.

use glam::{DMat4, DVec3};

use super::kernel::VolumeKernel;
use crate::math::srgb;
use crate::reference::gaussians::colour::colour;
use crate::reference::gaussians::place::ModelPlace;
use crate::reference::posed::{BodyPose, Volume, World};
use crate::reference::sampler::LightNumbers;
use crate::reference::shadows::{Receiver, Shadows};
use crate::shading::{ShadingLight, shade};

/// Rays to lights from kernels on a ray, for each unit of its optical depth.
const LIGHT_RAYS: f64 = 4.0;

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
    /// What the ray's points on lights follow from.
    pub lights: LightNumbers,
    /// Change of the model's place relative to the camera, per shutter; made when it is asked for.
    pub rate: Option<DMat4>,
}

/// The lights relative to an eye.
#[derive(Debug)]
pub(super) struct Lights<'w, 'a> {
    eye: Option<DVec3>,
    all: Vec<ShadingLight>,
    /// Those that need no normal.
    ambient: Vec<ShadingLight>,
    /// What keeps light from kernels; `None` where there are no shadows.
    shadows: Option<Shadows<'w, 'a>>,
    /// Has it the points on lights of the current ray?
    has_begun: bool,
}

impl<'w, 'a> Lights<'w, 'a> {
    pub(super) fn new(world: &'w World<'a>) -> Self {
        let shadows = Shadows::new(world);
        Self { eye: None, all: Vec::new(), ambient: Vec::new(), shadows, has_begun: false }
    }

    /// Goes on to another ray.
    pub(super) const fn next_ray(&mut self) {
        self.has_begun = false;
    }

    /// Do shadows fall on a volume? One that is held is elsewhere than it is shown, and one without normals shows light
    /// of its own.
    pub(super) fn shade(&self, world: &World<'_>, volume: &Volume<'_>) -> bool {
        let body = &world.bodies[volume.body];
        let is_lit = !volume.gaussians.normal.is_empty() && body.drawing.flat.is_none();
        self.shadows.is_some() && is_lit && body.object.receive_shadows && !world.is_held(body)
    }

    /// Linear light of a kernel: its own colour, or that which lights give it where the volume has normals.
    ///
    /// A ray may meet thousands of kernels that show little of themselves. Those whose optical depth `depth` on it is
    /// small take part in shadows by chance: one asks what light reaches it with the probability p, and shows what
    /// that takes from it divided by p. The mean is right, though a ray may show less than no light. Coded numbers have
    /// no such mean: there all ask.
    pub(super) fn colour(
        &mut self,
        world: &World<'_>,
        volume: &Volume<'_>,
        kernel: &VolumeKernel,
        view: &VolumeView,
        depth: f64,
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
        let place = view.pose.world_from_model.transform_point3(kernel.centre.as_dvec3());
        let from_eye = place - view.eye;
        let normal = view.pose.normal(normal.as_dvec3());
        let normal = if normal.dot(from_eye) > 0.0 { -normal } else { normal };
        let material = body.material(index);
        let lit = |lights: &[ShadingLight]| {
            shade(lights, &material, own.as_vec3(), normal.as_vec3(), from_eye.as_vec3()).as_dvec3()
        };
        if normal == DVec3::ZERO {
            return lit(&self.ambient);
        }
        let is_shaded = self.shade(world, volume);
        let Some(shadows) = self.shadows.as_mut().filter(|_| is_shaded) else { return lit(&self.all) };
        if !std::mem::replace(&mut self.has_begun, true) {
            shadows.begin(view.eye, view.time, view.lights);
        }
        let asks = if world.blend.is_linear() { (LIGHT_RAYS * depth).min(1.0) } else { 1.0 };
        let at = Receiver { place, normal, eye: view.eye, own: u32::MAX, hits: &[] };
        if asks >= 1.0 {
            return lit(shadows.reaching(&at));
        }
        let all = lit(shadows.all());
        if view.lights.of_kernel(volume.body, kernel.index) >= asks {
            return all;
        }
        all + (lit(shadows.reaching(&at)) - all) / asks
    }
}

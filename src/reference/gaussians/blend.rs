//! The space in which one instant is composited: that of the whole image.

use glam::DVec3;

use crate::film::{Background, Blending};
use crate::math::srgb;
use crate::scene::Scene;

/// The blending of an image, and what lies behind all.
#[derive(Clone, Copy, Debug)]
pub(in crate::reference) struct Blend {
    space: Blending,
    background: Background,
}

impl Blend {
    /// Coded as soon as one capture has coded colours.
    pub(in crate::reference) fn of(scene: &Scene) -> Self {
        let mut captures = scene.objects.iter().filter_map(|object| object.shape.gaussians());
        let space = if captures.any(|model| !model.gaussians().linear) { Blending::Coded } else { Blending::Linear };
        let background = Background { colour: scene.image.background, transparent: scene.image.transparent };
        Self { space, background }
    }

    /// Are colours composited as linear light?
    pub(in crate::reference) fn is_linear(&self) -> bool {
        self.space == Blending::Linear
    }

    /// Linear light in the numbers of the image's blending.
    pub(in crate::reference) fn of_light(&self, colour: DVec3) -> DVec3 {
        match self.space {
            Blending::Coded => colour.map(srgb::encoded),
            Blending::Linear => colour,
        }
    }

    /// A capture's colour in the numbers of the image's blending. If one capture is coded, so is the image.
    pub(super) fn of_capture(&self, colour: DVec3, linear: bool) -> DVec3 {
        if linear { self.of_light(colour) } else { colour }
    }

    /// A colour in the numbers of the blending, of which the shares `left` of the light are left.
    pub(super) fn scaled(&self, colour: DVec3, left: DVec3) -> DVec3 {
        match self.space {
            Blending::Coded => (colour.map(srgb::linear) * left).map(srgb::encoded),
            Blending::Linear => colour * left,
        }
    }

    /// Premultiplied linear light of a finished ray: what `sum`, composited in the image's blending with the coverage
    /// `alpha`, adds to (1 - alpha) background.
    ///
    /// Decoding is not linear, so that share of the background is taken off again; who adds it gets the exact colour,
    /// also for means over rays.
    pub(in crate::reference) fn finish(&self, sum: DVec3, alpha: f64) -> DVec3 {
        let Background { colour, transparent } = self.background;
        match self.space {
            Blending::Linear => sum,
            Blending::Coded if transparent => alpha * (sum / alpha).map(srgb::linear),
            Blending::Coded => {
                let through = 1.0 - alpha;
                (sum + through * colour.map(srgb::encoded)).map(srgb::linear) - through * colour
            }
        }
    }
}

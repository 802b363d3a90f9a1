//! The light of one ray, composited front to back.

use glam::{DVec2, DVec3};

use super::gaussians::blend::Blend;
use super::trace::Seen;

/// Transmittance at which a ray ends. Surfaces behind would change a colour by less than this.
pub(super) const OPAQUE: f64 = 1e-6;

/// What a ray has met so far. Colours are in the numbers of the image's blending, and all sums are premultiplied.
#[derive(Clone, Copy, Debug)]
pub(super) struct Composite {
    pub transmittance: f64,
    pub colour: DVec3,
    pub depth: f64,
    pub normal: DVec3,
    pub velocity: DVec2,
    /// True if anything was composited.
    pub any: bool,
}

impl Default for Composite {
    fn default() -> Self {
        Self {
            transmittance: 1.0,
            colour: DVec3::ZERO,
            depth: 0.0,
            normal: DVec3::ZERO,
            velocity: DVec2::ZERO,
            any: false,
        }
    }
}

impl Composite {
    /// True if nothing behind shows any more.
    pub(super) fn is_opaque(&self) -> bool {
        self.transmittance < OPAQUE
    }

    /// Adds what hides the share `opacity` of all behind it. `part` is not premultiplied, and its colour is in the
    /// numbers of the blending.
    pub(super) fn add(&mut self, opacity: f64, part: &Seen) {
        let weight = self.transmittance * opacity;
        self.colour += weight * part.colour;
        self.depth += weight * part.depth;
        self.normal += weight * part.normal;
        self.velocity += weight * part.velocity;
        self.transmittance *= 1.0 - opacity;
        self.any = true;
    }

    /// What the ray sees, with an opaque surface behind all or none.
    pub(super) fn over(&self, opaque: Option<Seen>, blend: &Blend) -> Seen {
        let through = self.transmittance;
        match opaque {
            Some(opaque) if !self.any => opaque,
            // A shadow catcher covers in part, and with black.
            Some(opaque) if opaque.coverage < 1.0 => {
                let coverage = 1.0 - through * (1.0 - opaque.coverage);
                if coverage <= 0.0 {
                    return Seen::NOTHING;
                }
                let own = opaque.colour / opaque.coverage.max(f64::MIN_POSITIVE);
                let behind = opaque.coverage * blend.of_light(own);
                Seen {
                    colour: blend.finish(self.colour + through * behind, coverage),
                    coverage,
                    depth: self.depth + through * opaque.depth,
                    normal: self.normal + through * opaque.normal,
                    velocity: self.velocity + through * opaque.velocity,
                }
            }
            Some(opaque) => Seen {
                colour: blend.finish(self.colour + through * blend.of_light(opaque.colour), 1.0),
                coverage: 1.0,
                depth: self.depth + through * opaque.depth,
                normal: self.normal + through * opaque.normal,
                velocity: self.velocity + through * opaque.velocity,
            },
            // Without a share there is no colour.
            None if through >= 1.0 => Seen::NOTHING,
            None => Seen {
                colour: blend.finish(self.colour, 1.0 - through),
                coverage: 1.0 - through,
                depth: self.depth,
                normal: self.normal,
                velocity: self.velocity,
            },
        }
    }
}

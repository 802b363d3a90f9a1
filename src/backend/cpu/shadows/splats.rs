//! Gaussians of captures and volumes as casters: discs, drawn by chance.
//!
//! At the distance r from its centre, in standard deviations, and seen from the light, a Gaussian stops the share a(r)
//! of it. A sample draws a number u for it. Where a(r) > u it stops all light, else none. So it is an elliptic disc:
//! one of a capture across the light, at the depth of its centre. A kernel of a volume stops light all along its depth,
//! and a sample draws where. The mean over samples is the product of transmittances, whatever overlaps (stochastic
//! transparency: Enderton et al. 2010). Math: docs/math.md, section 17.

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::view::LightView;
use crate::backend::cpu::columns::RUN;
use crate::frame::{Frame, PosedObject, PosedSample};
use crate::math::fast;
use crate::model::{Gaussians, Optics};
use crate::sampling::{chance, hash, mix};
use crate::scene::Drawing;

/// Least and greatest alpha of a Gaussian of a capture that counts, as in pictures.
pub(in crate::backend) const LEAST_ALPHA: f32 = 1.0 / 255.0;
pub(in crate::backend) const MOST_ALPHA: f32 = 0.99;
/// Least share of a kernel before or behind the place where it stops light.
pub(in crate::backend) const LEAST_TAIL: f32 = 1e-6;

/// A disc, relative to the eye in world axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    pub centre: Vec3,
    pub axes: [Vec3; 2],
}

/// Discs of neighbouring Gaussians, with a box around them.
pub(super) struct Splats {
    /// Are they of a capture? Else of a volume.
    pub of_capture: bool,
    pub discs: Vec<Disc>,
    pub middle: Vec3,
    /// Half the size of the box.
    pub half: Vec3,
}

/// A capture or volume at a time sample, before a light.
struct Cast<'a> {
    gaussians: &'a Gaussians,
    drawing: Drawing,
    posed: &'a PosedObject,
    /// The origin of its model relative to the eye, world axes.
    origin: Vec3,
    /// The light's first view: all have rays from the same place, or parallel ones.
    view: &'a LightView,
    /// Number of the sample, and seed of its Gaussians.
    number: u32,
    seed: u32,
}

impl Splats {
    /// The discs of all Gaussians that stop any of a light at `sample`: those of volumes before those of captures.
    pub(super) fn all(frame: &Frame, sample: &PosedSample, view: &LightView, light: u64) -> Vec<Self> {
        let mut all = Vec::new();
        for (index, (object, posed)) in frame.objects.iter().zip(&sample.objects).enumerate() {
            let Some((gaussians, drawing)) = object.drawn().filter(|_| posed.visible && frame.casts_splats(object))
            else {
                continue;
            };
            let (number, seed) = (sample.number as u32, mix(seed_of_light(sample, light) ^ mix(index as u32)));
            let origin = frame.place_of(index, sample);
            let cast = Cast { gaussians, drawing, posed, origin, view, number, seed };
            let starts: Vec<_> = (0..gaussians.len()).step_by(RUN).collect();
            all.par_extend(starts.par_iter().filter_map(|&first| cast.splats(first)));
        }
        all.sort_by_key(|splats| splats.of_capture);
        all
    }
}

/// Distances from the eye within which the Gaussians of objects that cast have their centres.
pub(in crate::backend) fn reaches<'a>(frame: &'a Frame, sample: &'a PosedSample) -> impl Iterator<Item = f32> + 'a {
    let all = frame.objects.iter().zip(&sample.objects).enumerate();
    all.filter(|(_, (object, posed))| posed.visible && frame.casts_splats(object)).map(|(index, (object, posed))| {
        let origin = frame.place_of(index, sample);
        let corners = object.shape.bounds().corners().map(|corner| (corner - object.shape.origin()).as_vec3());
        let lengths = corners.map(|corner| (posed.world_from_model * corner + origin).length());
        lengths.into_iter().fold(0.0, f32::max)
    })
}

/// Seed of the numbers that all Gaussians draw before a light: 24 bits, which a float holds.
pub(in crate::backend) fn seed_of_light(sample: &PosedSample, light: u64) -> u32 {
    // Classes of pixels differ in the upper half. The first streams are for layers of surfels.
    hash(sample.number >> 32, 1 << 32 | light) >> 8
}

impl Cast<'_> {
    /// The discs of a run of Gaussians, if any is drawn.
    fn splats(&self, first: usize) -> Option<Splats> {
        let end = (first + RUN).min(self.gaussians.len());
        let discs: Vec<_> = (first..end).filter_map(|i| self.disc(i)).collect();
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for Disc { centre, axes: [u, v] } in &discs {
            let extent = u.abs() + v.abs();
            (low, high) = (low.min(*centre - extent), high.max(*centre + extent));
        }
        let of_capture = self.gaussians.optics == Optics::Alpha;
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        (!discs.is_empty()).then_some(Splats { of_capture, discs, middle, half })
    }

    /// The disc of Gaussian `i`; `None` where none is drawn.
    fn disc(&self, i: usize) -> Option<Disc> {
        let position = self.gaussians.position[i];
        let place = position.as_dvec3();
        if self.drawing.crop.is_some_and(|[low, high]| !(place.cmpge(low).all() && place.cmple(high).all())) {
            return None;
        }
        let linear = self.posed.world_from_model;
        let centre = linear * position + self.origin;
        let axes = linear * Mat3::from_quat(self.gaussians.rotation[i]) * Mat3::from_diagonal(self.gaussians.sigma[i]);
        let along = self.view.rays_at(centre);
        let (right, up) = along.any_orthonormal_pair();
        let [x, y] = [right, up].map(|axis| axes.transpose() * axis);
        let (xx, xy) = (x.length_squared(), x.dot(y));
        // The square of a vector product: the difference of products would cancel for long thin ones.
        let normal = x.cross(y);
        let area = normal.length();
        let root = xx.sqrt();
        let mut u = right * root + up * (xy / root);
        let mut v = up * (area / root);
        let drawn = chance(self.number, mix(i as u32) ^ self.seed);
        let opacity = self.gaussians.opacity[i] * self.drawing.opacity as f32;
        let mut stopped_at = centre;
        let radius = if self.gaussians.optics == Optics::Alpha {
            radius_of_alpha(opacity, drawn)
        } else {
            let depth = opacity * linear.determinant().abs() / (std::f32::consts::TAU * area);
            // On rays beside the centre the kernel has its middle nearer or farther.
            let seen = axes.transpose() * along;
            u += along * (seen.dot(x) / root);
            v += along * (seen.dot(normal.cross(x)) / (area * root));
            let place = deviations(depth, chance(self.number, mix(!(i as u32)) ^ self.seed));
            stopped_at += along * (place * axes.determinant().abs() / area);
            radius_of_depth(depth, drawn)
        };
        let (u, v) = (u * radius, v * radius);
        // What is flat and seen edge-on is nothing here.
        let is_finite = stopped_at.is_finite() && u.is_finite() && v.is_finite();
        (radius > 0.0 && is_finite).then_some(Disc { centre: stopped_at, axes: [u, v] })
    }
}

/// The distance, in standard deviations, to which a Gaussian of a capture has an alpha above `drawn`; 0 where it has
/// none.
fn radius_of_alpha(opacity: f32, drawn: f32) -> f32 {
    let least = if drawn > LEAST_ALPHA { drawn } else { LEAST_ALPHA };
    if drawn < MOST_ALPHA && opacity > least { radius_of(opacity / least) } else { 0.0 }
}

/// The same for a kernel of a volume whose optical depth is `depth` at its centre.
fn radius_of_depth(depth: f32, drawn: f32) -> f32 {
    // The optical depth that stops the share `drawn`.
    let least = fast::log2(1.0 - drawn) / -std::f32::consts::LOG2_E;
    if depth > least && least > 0.0 { radius_of(depth / least) } else { 0.0 }
}

/// Where a kernel of this optical depth stops light that it does stop, in standard deviations from its middle on the
/// ray. `drawn`: the share of that light that it stops before, in [0, 1).
fn deviations(depth: f32, drawn: f32) -> f32 {
    let stopped = 1.0 - fast::exp2(-std::f32::consts::LOG2_E * depth);
    // The share of the optical depth that the light has passed there.
    let passed = fast::log2(1.0 - drawn * stopped) / (-std::f32::consts::LOG2_E * depth);
    let tail = passed.min(1.0 - passed).max(LEAST_TAIL);
    // Abramowitz and Stegun, 26.2.23: right to 4.5e-4.
    let t = (fast::log2(tail) * (-2.0 / std::f32::consts::LOG2_E)).sqrt();
    let below =
        (2.515_517 + t * (0.802_853 + t * 0.010_328)) / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)));
    let distance = t - below;
    if passed < 0.5 { -distance } else { distance }
}

/// The distance from its peak at which a Gaussian is lower by a factor, in standard deviations.
fn radius_of(factor: f32) -> f32 {
    (fast::log2(factor) * (2.0 / std::f32::consts::LOG2_E)).sqrt()
}

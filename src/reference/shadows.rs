//! Shadows on opaque surfaces: the points of a sample on the lights, and what stands before them.
//!
//! A sample has one point on each light that has shadows, and the light shines from there alone. Opaque surfels,
//! triangles and ideal spheres keep it away, each posed at the sample's time. See-through surfels weaken it: their
//! layers on the ray, counted from the light, each by the share 1 - opacity. So do captures and volumes
//! ([`super::haze`]). Of all that captures alone receive, and not from captures.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};

use super::haze::LightRay;
use super::posed::{BodyPose, Form, World};
use super::sampler::LightNumbers;
use super::traverse::{Found, Hit, LEAST_EPSILON, MOST_LAYERS, ModelRay, Waiting, intersect_sphere};
use crate::model::paths::Elapsed;
use crate::scene::Light;
use crate::shading::ShadingLight;

/// Finds the lights that reach places, on one thread.
#[derive(Debug)]
pub(super) struct Shadows<'w, 'a> {
    world: &'w World<'a>,
    /// Numbers of the bodies that cast: opaque ones, see-through surfels, and captures and volumes; and where the first
    /// two end.
    casters: Vec<usize>,
    opaque: usize,
    surfaces: usize,
    /// Their poses at the sample's time; empty until a ray needs them.
    poses: Vec<Option<(BodyPose, Elapsed<f64>)>>,
    time: f64,
    /// The lights of the sample, and from where those with shadows shine.
    lights: Vec<(ShadingLight, Option<Source>)>,
    reaching: Vec<ShadingLight>,
    found: [Found; 1],
    stack: Vec<Waiting>,
    places: Vec<(u32, u32)>,
}

/// Least square of a distance to a light: at the light itself its radiance would be infinite.
const LEAST_SQUARE: f64 = 1e-30;

/// From where a light shines, world space.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// From infinitely far: the unit vector towards it.
    Towards(DVec3),
    Place(DVec3),
}

impl Source {
    /// The unit vector from a place to it, and its distance.
    fn from(self, at: DVec3) -> (DVec3, f64) {
        match self {
            Self::Towards(towards) => (towards, f64::INFINITY),
            Self::Place(place) => ((place - at).normalize_or_zero(), place.distance(at)),
        }
    }
}

/// Luminance of linear light (Rec. 709).
fn luminance(colour: DVec3) -> f64 {
    colour.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// What a white surface with the unit normal `n` shows of light from all around (docs/math.md, eq. 53).
fn smooth(terms: &[Vec3; 9], n: DVec3) -> DVec3 {
    let DVec3 { x, y, z } = n;
    let of_normal = [1.0, x, y, z, x * y, y * z, 2.0 * x * z, x * x - z * z, 2.0 * y * y - x * x - z * z];
    let sum: DVec3 = terms.iter().zip(of_normal).map(|(term, factor)| term.as_dvec3() * factor).sum();
    sum.max(DVec3::ZERO)
}

/// A place of a surface that is shaded.
#[derive(Clone, Copy, Debug)]
pub(super) struct Receiver<'h> {
    /// Place in the world.
    pub place: DVec3,
    /// Unit normal in the world, on the side that is seen.
    pub normal: DVec3,
    /// The eye that sees it.
    pub eye: DVec3,
    /// Number of the object that the place belongs to.
    pub own: u32,
    /// All hits of the surface, which may be of other objects too.
    pub hits: &'h [Hit],
}

/// Which hits of a body are in the way.
#[derive(Clone, Copy, Debug)]
struct Blocking {
    /// Least distance from the place.
    near: f64,
    /// Hits from behind are in the way too.
    two_sided: bool,
}

impl<'w, 'a> Shadows<'w, 'a> {
    /// `None` where there are no shadows.
    pub(super) fn new(world: &'w World<'a>) -> Option<Self> {
        let any = world.options.look.shadows && world.scene.has_shadows();
        let kind = |number: usize| match world.bodies[number].form {
            Form::Model(_) | Form::Sphere(_) if world.bodies[number].see_through => Some(1),
            Form::Model(_) | Form::Sphere(_) => Some(0),
            Form::Gaussians(_) | Form::Volume(_) => Some(2),
            Form::Nothing => None,
        };
        let all = |of: i32| {
            let casts = move |&number: &usize| kind(number) == Some(of) && world.bodies[number].object.cast_shadows;
            (0..world.bodies.len()).filter(casts)
        };
        any.then(|| Self {
            world,
            casters: all(0).chain(all(1)).chain(all(2)).collect(),
            opaque: all(0).count(),
            surfaces: all(0).chain(all(1)).count(),
            poses: Vec::new(),
            time: 0.0,
            lights: Vec::new(),
            reaching: Vec::new(),
            found: [Found::default()],
            stack: Vec::new(),
            places: Vec::new(),
        })
    }

    /// Takes a sample at scene time `time` (frames). Its lights are relative to `eye`.
    pub(super) fn begin(&mut self, eye: DVec3, time: f64, numbers: LightNumbers) {
        self.time = time;
        self.poses.clear();
        let mut plain = std::mem::take(&mut self.reaching);
        self.world.lights(eye, &mut plain);
        self.lights.clear();
        let lights = (0..).zip(&self.world.scene.lights).zip(&plain);
        self.lights.extend(lights.map(|((number, light), &plain)| match *light {
            Light::Directional { direction, angle, shadows: true, colour } => {
                let towards = in_cone(-direction, angle, numbers.at(number));
                let (colour, shadows) = (colour.as_vec3(), true);
                let light = ShadingLight::Directional { towards: towards.as_vec3(), colour, shadows };
                (light, Some(Source::Towards(towards)))
            }
            Light::Point { position, radius, shadows: true, colour } => {
                let place = position + radius * in_ball(numbers.at(number));
                let (colour, shadows) = (colour.as_vec3(), true);
                let light = ShadingLight::Point { position: (place - eye).as_vec3(), colour, shadows };
                (light, Some(Source::Place(place)))
            }
            Light::Directional { .. } | Light::Point { .. } | Light::Ambient { .. } => (plain, None),
        }));
        let number = self.world.scene.lights.len();
        if let Some(sky) = &self.world.sky {
            let [across, down, _] = numbers.at(number as u64);
            let (light, towards) = sky.light([across, down]);
            self.lights.push((light, Some(Source::Towards(towards))));
        } else if let Some(&smooth) = plain.get(number) {
            self.lights.push((smooth, None));
        }
        self.reaching = plain;
    }

    /// All lights of the sample, whatever is in their way.
    pub(super) fn all(&mut self) -> &[ShadingLight] {
        self.reaching.clear();
        self.reaching.extend(self.lights.iter().map(|&(light, _)| light));
        &self.reaching
    }

    /// The lights of the sample that reach a place.
    pub(super) fn reaching(&mut self, at: &Receiver<'_>) -> &[ShadingLight] {
        self.reaching.clear();
        for i in 0..self.lights.len() {
            let (light, source) = self.lights[i];
            let share = source.map_or(1.0, |source| self.share(source, at));
            if share > 0.0 {
                self.reaching.push(dimmed(light, share as f32));
            }
        }
        &self.reaching
    }

    /// The light that falls on a white surface with these factors for ambient and for diffuse light, and what of it
    /// shadows take away: luminances. One direction of a sky says nothing about how much light comes from all; that is
    /// what the sky shows without shadows.
    pub(super) fn caught(&mut self, at: &Receiver<'_>, [ambient, diffuse]: [f64; 2]) -> [f64; 2] {
        let (mut all, mut taken) = (0.0, 0.0);
        for i in 0..self.lights.len() {
            let (light, source) = self.lights[i];
            let (from, colour) = match light {
                ShadingLight::Ambient { colour } => {
                    all += ambient * luminance(colour.as_dvec3());
                    continue;
                }
                ShadingLight::Harmonics { terms } => {
                    all += diffuse * luminance(smooth(&terms, at.normal));
                    continue;
                }
                ShadingLight::Directional { towards, colour, .. } => {
                    (source.unwrap_or(Source::Towards(towards.as_dvec3())), colour)
                }
                ShadingLight::Point { position, colour, .. } => {
                    (source.unwrap_or(Source::Place(at.eye + position.as_dvec3())), colour)
                }
            };
            let (towards, square) = match from {
                Source::Towards(towards) => (towards, 1.0),
                Source::Place(place) => ((place - at.place).normalize_or_zero(), place.distance_squared(at.place)),
            };
            let falls = diffuse * at.normal.dot(towards).max(0.0) * luminance(colour.as_dvec3()) / square;
            let is_sky = i == self.world.scene.lights.len();
            let smooth_sky = self.world.smooth_sky().filter(|_| is_sky);
            all += smooth_sky.map_or(falls, |terms| diffuse * luminance(smooth(&terms, at.normal)));
            if falls > 0.0 {
                taken += source.map_or(0.0, |source| falls * (1.0 - self.share(source, at)));
            }
        }
        [all, taken]
    }

    /// The share of all light, channel by channel, that reaches a place of a capture, which has no normal; `None` where
    /// all does.
    pub(super) fn light_left(&mut self, place: DVec3, eye: DVec3) -> Option<DVec3> {
        let at = Receiver { place, normal: DVec3::ZERO, eye, own: u32::MAX, hits: &[] };
        let (mut all, mut hidden) = (DVec3::ZERO, DVec3::ZERO);
        for i in 0..self.lights.len() {
            let (light, source) = self.lights[i];
            let radiance = match (light, source) {
                (ShadingLight::Ambient { colour } | ShadingLight::Directional { colour, .. }, _) => colour.as_dvec3(),
                // A white surface shows 1/4 of it in the mean over all normals.
                (ShadingLight::Harmonics { terms }, _) => terms[0].as_dvec3() * 4.0,
                (ShadingLight::Point { colour, .. }, Some(Source::Place(from))) => {
                    colour.as_dvec3() / from.distance_squared(place).max(LEAST_SQUARE)
                }
                (ShadingLight::Point { colour, position, .. }, _) => {
                    colour.as_dvec3() / (eye + position.as_dvec3()).distance_squared(place).max(LEAST_SQUARE)
                }
            };
            all += radiance;
            hidden += source.map_or(0.0, |source| 1.0 - self.let_through(source, &at, true)) * radiance;
        }
        let share = |all: f64, hidden: f64| if all > 0.0 { 1.0 - hidden / all } else { 1.0 };
        (hidden != DVec3::ZERO)
            .then(|| DVec3::new(share(all.x, hidden.x), share(all.y, hidden.y), share(all.z, hidden.z)))
    }

    /// The share of a light that reaches a surface. One that faces away from the light is in its own shadow, highlights
    /// too: it takes no ray.
    fn share(&mut self, source: Source, at: &Receiver<'_>) -> f64 {
        // The comparison also fails where it is no number.
        let is_lit = at.normal.dot(source.from(at.place).0) > 0.0;
        if is_lit { self.let_through(source, at, false) } else { 0.0 }
    }

    /// The share of a light that nothing on the way to a place keeps away. Captures keep none from the places of
    /// captures, whose colours were photographed in their own shadows.
    fn let_through(&mut self, source: Source, at: &Receiver<'_>, of_capture: bool) -> f64 {
        let (towards, distance) = source.from(at.place);
        if self.poses.is_empty() {
            let posed = |&caster: &usize| {
                let body = &self.world.bodies[caster];
                Some((body.pose_at(self.time)?, body.elapsed(self.time)))
            };
            self.poses.extend(self.casters.iter().map(posed));
        }
        if (0..self.opaque).any(|caster| self.blocks(caster, at, towards, distance)) {
            return 0.0;
        }
        let mut share = 1.0;
        if self.opaque < self.surfaces {
            share *= self.through_layers(at, towards, distance);
        }
        let near = LEAST_EPSILON * at.place.distance(at.eye);
        for caster in self.surfaces..self.casters.len() {
            let Some((pose, _)) = &self.poses[caster] else { continue };
            let ray = LightRay::new(pose, at.place, towards, [near, distance]);
            share *= match self.world.bodies[self.casters[caster]].form {
                Form::Gaussians(_) if of_capture => 1.0,
                Form::Gaussians(tree) => ray.through_capture(&self.world.trees[tree], &mut self.places),
                Form::Volume(tree) => ray.through_volume(&self.world.volume_trees[tree], &mut self.places),
                Form::Model(_) | Form::Sphere(_) | Form::Nothing => 1.0,
            };
        }
        share
    }

    /// The share of light that see-through surfels let through from a light at `distance` along the unit vector
    /// `towards`. Their layers are those of an eye at the light ([`super::layers`]).
    fn through_layers(&mut self, at: &Receiver<'_>, towards: DVec3, distance: f64) -> f64 {
        let near = LEAST_EPSILON * at.place.distance(at.eye);
        self.found[0].clear();
        self.found[0].limit = distance;
        for caster in self.opaque..self.surfaces {
            let Some((pose, elapsed)) = self.poses[caster] else { continue };
            let number = self.casters[caster];
            // What light passes through hides nothing that is behind it.
            let ray = ModelRay { epsilon: f64::INFINITY, ..model_ray(number, (&pose, elapsed), at, towards, near) };
            if let Form::Model(model) = self.world.bodies[number].form {
                self.world.models[model].meet(&[ray], &mut self.found, &mut self.stack);
            }
        }
        let mut hits = std::mem::take(&mut self.found[0].hits);
        let tolerance = |hit: &Hit| {
            let caster = (self.opaque..self.surfaces).find(|&caster| self.casters[caster] == hit.object as usize);
            let pose = caster.and_then(|caster| self.poses[caster]);
            pose.map_or(0.0, |(pose, _)| pose.epsilon).max(LEAST_EPSILON * hit.depth)
        };
        // Nearer than its tolerance an object of the place is the layer of the place.
        let is_of_place = |hit: &Hit| at.hits.iter().any(|own| own.object == hit.object);
        hits.retain(|hit| !is_of_place(hit) || hit.depth > tolerance(hit));
        hits.sort_unstable_by(|a, b| b.depth.total_cmp(&a.depth));
        let (mut share, mut rest) = (1.0, &hits[..]);
        for _ in 0..MOST_LAYERS {
            let end = rest.iter().map(|hit| hit.depth - tolerance(hit)).fold(f64::NEG_INFINITY, f64::max);
            let (layer, behind) = rest.split_at(rest.partition_point(|hit| hit.depth >= end));
            if layer.is_empty() {
                break;
            }
            let weight: f64 = layer.iter().map(Hit::weight).sum();
            let opacity: f64 = layer.iter().map(|hit| hit.weight() * self.world.opacity(hit)).sum();
            share *= 1.0 - opacity / weight;
            rest = behind;
        }
        self.found[0].hits = hits;
        share
    }

    /// Is a caster in the way from a place to the light at `distance` along the unit vector `towards`?
    ///
    /// A place lies on its surface only within the depth tolerance (epsilon) of the object, because surfels that
    /// overlap are blended. So there are three rules. "Nearer" is the distance along the ray to the light.
    ///
    /// - The object of the place: what is nearer than its epsilon is the surface itself, and not in the way. Of a
    ///   one-sided object only what the ray enters through the front is: a ray from a closed model enters it again
    ///   before it leaves it, so backs show that it began a little below the surface. Backs are not seen either. A
    ///   two-sided object casts on itself with both sides.
    /// - Another object casts with both sides, however near it is, or contacts would come apart. So a sheet has a
    ///   shadow whatever its sides, and that of a closed model is the same. Only rounding is left out.
    /// - Another object with a part in the surface of the place, which lies about as deep: nearer than its epsilon it
    ///   is in the way if the ray enters it through the front, as beside a contact. Its backs are those of a sheet on
    ///   the surface, with which the place is blended.
    fn blocks(&mut self, caster: usize, at: &Receiver<'_>, towards: DVec3, distance: f64) -> bool {
        let Some((pose, elapsed)) = self.poses[caster] else { return false };
        let number = self.casters[caster];
        let body = &self.world.bodies[number];
        let rounding = LEAST_EPSILON * at.place.distance(at.eye);
        let near = pose.epsilon.max(rounding);
        let from = |near: f64, two_sided: bool| Blocking { near, two_sided };
        let rules = if number == at.own as usize {
            [Some(from(near, self.world.options.look.two_sided || body.surface.two_sided)), None]
        } else if at.hits.iter().any(|hit| hit.object as usize == number) {
            [Some(from(rounding, false)), Some(from(near, true))]
        } else {
            [Some(from(rounding, true)), None]
        };
        rules.into_iter().flatten().any(|Blocking { near, two_sided }| {
            let ray = ModelRay { two_sided, ..model_ray(number, (&pose, elapsed), at, towards, near) };
            self.found[0].clear();
            self.found[0].limit = distance;
            match body.form {
                Form::Model(model) => self.world.models[model].meet(&[ray], &mut self.found, &mut self.stack),
                Form::Sphere(sphere) => intersect_sphere(&sphere, &ray, &mut self.found[0]),
                Form::Gaussians(_) | Form::Volume(_) | Form::Nothing => {}
            }
            !self.found[0].hits.is_empty()
        })
    }
}

/// A light of which this share is left.
fn dimmed(mut light: ShadingLight, share: f32) -> ShadingLight {
    if let ShadingLight::Directional { colour, .. } | ShadingLight::Point { colour, .. } = &mut light {
        *colour *= share;
    }
    light
}

/// The ray from a place along the unit vector `towards`, from the distance `near` on, in the model of body `number`.
/// It meets both sides, and what it meets first hides the rest.
fn model_ray(
    number: usize,
    (pose, elapsed): (&BodyPose, Elapsed<f64>),
    at: &Receiver<'_>,
    towards: DVec3,
    near: f64,
) -> ModelRay {
    ModelRay {
        origin: pose.model_from_world * (at.place - pose.world_from_model.translation),
        direction: pose.model_from_world * towards,
        near,
        epsilon: 0.0,
        two_sided: true,
        object: number as u32,
        lane: 0,
        elapsed,
    }
}

/// A unit vector at most half of `angle` away from the unit vector `axis`. Equal areas of the unit square become equal
/// solid angles: a disc, and Lambert's azimuthal projection backwards.
fn in_cone(axis: DVec3, angle: f64, [area, turn, _]: [f64; 3]) -> DVec3 {
    let rim = 2.0 * libm::sin(0.25 * angle);
    let (radius, turn) = (rim * area.sqrt(), TAU * turn);
    let (right, up) = axis.any_orthonormal_pair();
    let aside = right * libm::cos(turn) + up * libm::sin(turn);
    let square = radius * radius;
    axis * (1.0 - 0.5 * square) + aside * (radius * (1.0 - 0.25 * square).sqrt())
}

/// Three coordinates of a unit quaternion that is drawn evenly (Shoemake 1992). From everywhere the unit ball is an
/// even disc then.
fn in_ball([share, first, second]: [f64; 3]) -> DVec3 {
    let [a, b] = [first, second].map(|turn| TAU * turn);
    let [long, short] = [share, 1.0 - share].map(f64::sqrt);
    DVec3::new(long * libm::cos(a), long * libm::sin(a), short * libm::cos(b))
}

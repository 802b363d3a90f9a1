//! Flow: where the surface that a pixel shows at one instant lies at another.
//!
//! A ray through the middle of the pixel finds the surface at the first instant. Its point there is carried along with
//! its object (and, where the surfels move by themselves, by the mean of their paths) to the second instant, posed
//! exactly, and projected: nothing is linear in between. Where light passes through, the surface is that at which
//! transmittance falls to a half: a layer of see-through surfels, or a Gaussian of a capture at the depth of its
//! centre. Another ray tells whether the point is seen at the second instant. Before a rolling shutter an instant is
//! another time for each row: a point is followed to the time of the row on which it lands.

use glam::DVec3;
use rayon::prelude::*;

use super::cull::{Candidates, ObjectCones};
use super::error::ReferenceError;
use super::gaussians::veil::{Taken, Veil};
use super::layers::Surfaces;
use super::options::ReferenceOptions;
use super::posed::{Body, BodyPose, CameraPose, World};
use super::sampler::LightNumbers;
use super::trace::{SamplePoint, Target, Tracer};
use super::traverse::{Hit, SPHERE};
use crate::options::{Look, PixelFilter};
use crate::scene::Scene;
use crate::time::FrameNumber;

/// Where the surfaces of pixels go from one instant to another: row-major planes of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Flow {
    /// Motion, pixels to the right; 0 where it is not valid.
    pub x: Vec<f32>,
    /// Motion, pixels down; 0 where it is not valid.
    pub y: Vec<f32>,
    /// 1 where the pixel shows a surface at the first instant, and that surface is before the camera at the second one;
    /// else 0.
    pub valid: Vec<f32>,
    /// 1 where the surface is seen at the second instant too: inside the image, not turned away, not hidden; else 0.
    pub visible: Vec<f32>,
}

/// Transmittance at which light has met the surface of a pixel.
const HALF: f64 = 0.5;

/// Least transmittance before a point that is seen: half of what a surface may have before it.
const SEEN: f64 = 0.25;

/// The flows of one frame between pairs of instants: shares of the shutter, 0 where it opens and 1 where it closes. In
/// `options` only the depth tolerance, the visible sides and how meshes are traced count.
///
/// # Errors
/// The scene holds a volume, which has no surface, or no reference can be made of it.
pub fn flows(
    scene: &Scene,
    frame: impl Into<FrameNumber>,
    pairs: &[[f64; 2]],
    options: &ReferenceOptions,
) -> Result<Vec<Flow>, ReferenceError> {
    let options = ReferenceOptions {
        look: Look { filter: PixelFilter::Point, shadows: false, aovs: Vec::new(), ..options.look.clone() },
        ..options.clone()
    };
    let (frame, scene) = options.enter(scene, frame.into())?;
    let scene = &*scene;
    let world = World::new(scene, frame, &options, (&|_| (), None))?;
    if let Some(volume) = world.volumes.first() {
        return Err(ReferenceError::Flow { object: world.bodies[volume.body].object.name.clone() });
    }
    let cones = ObjectCones::new(&world, frame.get());
    let flow = |pair: &[f64; 2]| {
        let rows = (0..world.size[1]).into_par_iter().map_init(
            || Follower::new(&world, &cones, frame.get()),
            |follower, y| (0..world.size[0]).map(|x| follower.flow([x, y], *pair)).collect::<Vec<_>>(),
        );
        let pixels: Vec<Option<Followed>> = rows.flatten_iter().collect();
        let plane = |value: fn(&Followed) -> f32| pixels.iter().map(|of| of.as_ref().map_or(0.0, value)).collect();
        Flow {
            x: plane(|of| of.motion[0] as f32),
            y: plane(|of| of.motion[1] as f32),
            valid: plane(|_| 1.0),
            visible: plane(|of| f32::from(of.visible)),
        }
    };
    Ok(pairs.iter().map(flow).collect())
}

/// The surface of a pixel, followed to the second instant.
struct Followed {
    /// Pixels.
    motion: [f64; 2],
    visible: bool,
}

/// Something on a ray that takes light.
#[derive(Clone, Copy)]
struct Event {
    what: What,
    opacity: f64,
    /// What lies deeper is behind it.
    limit: f64,
}

#[derive(Clone, Copy)]
enum What {
    Opaque,
    /// See-through surfels between these depths.
    Layer(f64, f64),
    /// A Gaussian of a capture, by the numbers of its body and its depth.
    Gaussian(usize, f64),
}

/// A point of an object at the first instant.
struct Point<'h> {
    body: usize,
    pose: BodyPose,
    /// Relative to the model's origin, model space.
    model: DVec3,
    /// The surfels that it lies on, and how they were met.
    hits: Vec<&'h Hit>,
    target: Option<Target>,
}

/// Follows surfaces on one thread.
struct Follower<'w, 'a> {
    world: &'w World<'a>,
    cones: &'w ObjectCones,
    /// The number of the frame.
    frame: f64,
    tracer: Tracer<'w, 'a>,
    veil: Option<Veil<'w, 'a>>,
    surfaces: Surfaces,
    candidates: Candidates,
    /// What the last ray met, nearest first.
    events: Vec<Event>,
}

impl<'w, 'a> Follower<'w, 'a> {
    fn new(world: &'w World<'a>, cones: &'w ObjectCones, frame: f64) -> Self {
        Self {
            world,
            cones,
            frame,
            tracer: Tracer::new(world),
            veil: (!world.captures.is_empty()).then(|| Veil::new(world)),
            surfaces: Surfaces::default(),
            candidates: Candidates::default(),
            events: Vec::new(),
        }
    }

    /// A film point at a share of the shutter, when it is read out.
    fn at(&self, film: [f64; 2], share: f64) -> SamplePoint {
        let shutter = &self.world.scene.shutter;
        let axis = shutter.readout.direction.axis();
        let rolls = shutter.readout.rolls();
        let delay = if rolls { shutter.readout.delay(film[axis] / f64::from(self.world.size[axis])) } else { 0.0 };
        // Shadows are left out here.
        let lights = LightNumbers::default();
        SamplePoint { film, time: shutter.frame_time(self.frame, share) + delay, lights }
    }

    /// As [`Self::land`], at a share of the shutter. The time is that of the row on which the point lands, which is
    /// found by trying: `None` where the point keeps pace with the read-out, and lands on no row or on many.
    fn land_at(&self, point: &Point<'_>, from: SamplePoint, share: f64) -> Option<([f64; 2], f64, bool, bool)> {
        /// Tries, and how near two of them must be, pixels.
        const TRIES: u32 = 64;
        const NEAR: f64 = 1e-7;
        let mut film = from.film;
        for _ in 0..TRIES {
            let landed = self.land(point, from.time, self.at(film, share).time)?;
            let apart = (0..2).map(|axis| (landed.0[axis] - film[axis]).abs()).fold(0.0, f64::max);
            if apart < NEAR || !self.world.scene.shutter.readout.rolls() {
                return Some(landed);
            }
            film = landed.0;
        }
        None
    }

    fn flow(&mut self, pixel: [u32; 2], [first, second]: [f64; 2]) -> Option<Followed> {
        let film = pixel.map(|c| f64::from(c) + 0.5);
        let from = self.at(film, first);
        self.trace(from);
        let ((landed, depth, faces, two_sided), body) = {
            let hits: Vec<Hit> = self.hits().copied().collect();
            let point = self.point(from, &hits)?;
            (self.land_at(&point, from, second)?, &self.world.bodies[point.body])
        };
        let to = self.at(landed, second);
        let motion = [0, 1].map(|axis| landed[axis] - film[axis]);
        let inside = (0..2).all(|axis| (0.0..f64::from(self.world.size[axis])).contains(&landed[axis]));
        let visible = inside && (faces || two_sided) && {
            self.trace(to);
            // Opaque surfaces hide it behind the limit of its own object.
            let epsilon = at_time(self.world, body, to.time).map_or(0.0, |(_, pose)| pose.epsilon);
            let limit = |event: &&Event| match event.what {
                What::Opaque => self.tracer.limit(0, epsilon, depth),
                What::Layer(..) | What::Gaussian(..) => event.limit,
            };
            let before = self.events.iter().filter(|event| limit(event) < depth);
            before.map(|event| 1.0 - event.opacity).product::<f64>() >= SEEN
        };
        Some(Followed { motion, visible })
    }

    /// Lists what the ray through a point meets.
    fn trace(&mut self, point: SamplePoint) {
        let pixel = [0, 1].map(|axis| (point.film[axis].max(0.0) as usize).min(self.world.size[axis] as usize - 1));
        self.cones.candidates(self.world, pixel, [1, 1], &mut self.candidates);
        self.tracer.hits(&[point], &self.candidates, self.cones);
        self.surfaces.clear();
        self.surfaces.add(&mut self.tracer, 0);
        let opaque = self.surfaces.opaque[0].is_some();
        let limit = self.surfaces.limits[0];
        let mut taken = Vec::new();
        if let Some(veil) = &mut self.veil {
            veil.taken = Some(Vec::new());
            veil.composite(&[point], &mut self.surfaces);
            taken = veil.taken.take().unwrap_or_default();
        }
        self.events.clear();
        let mut taken = taken.into_iter().peekable();
        let mut begin = f64::NEG_INFINITY;
        for layer in self.surfaces.layers(0) {
            // As light meets them: a Gaussian at the limit of a layer is before it.
            while let Some(gaussian) = taken.next_if(|gaussian| gaussian.depth <= layer.limit) {
                self.events.push(self.gaussian(&gaussian, point.time));
            }
            let what = What::Layer(begin, layer.limit);
            self.events.push(Event { what, opacity: layer.opacity, limit: layer.limit });
            begin = layer.limit;
        }
        for gaussian in taken {
            self.events.push(self.gaussian(&gaussian, point.time));
        }
        if opaque {
            self.events.push(Event { what: What::Opaque, opacity: 1.0, limit });
        }
    }

    fn gaussian(&self, taken: &Taken, time: f64) -> Event {
        let body = self.world.captures[taken.capture].body;
        let epsilon = self.world.bodies[body].pose_at(time).map_or(0.0, |pose| pose.epsilon);
        let what = What::Gaussian(body, taken.depth);
        Event { what, opacity: taken.alpha, limit: taken.depth + epsilon }
    }

    /// All surfels and triangles that the last ray met.
    fn hits(&self) -> impl Iterator<Item = &Hit> {
        self.tracer.found[0].hits.iter().chain(&self.tracer.found[0].see_through)
    }

    /// The point that the last ray, through `at`, shows; `hits` are all that it met.
    fn point<'h>(&self, SamplePoint { film, time, .. }: SamplePoint, hits: &'h [Hit]) -> Option<Point<'h>> {
        let world = self.world;
        let mut through = 1.0;
        let event = self.events.iter().find(|event| {
            through *= 1.0 - event.opacity;
            through <= HALF
        })?;
        let see_through = |hit: &Hit| world.bodies[hit.object as usize].see_through;
        let of_surface: Vec<&Hit> = match event.what {
            What::Opaque => hits.iter().filter(|hit| !see_through(hit)).collect(),
            What::Layer(from, to) => {
                hits.iter().filter(|hit| see_through(hit) && from < hit.depth && hit.depth <= to).collect()
            }
            What::Gaussian(body, depth) => {
                let pose = world.bodies[body].pose_at(time)?;
                let camera = camera_at(world, &world.bodies[body], time);
                let place = camera.eye + camera.world_from_camera * world.direction(film) * depth;
                let model = pose.model_from_world * (place - pose.world_from_model.translation);
                return Some(Point { body, pose, model, hits: Vec::new(), target: None });
            }
        };
        // Where several objects touch, the one with the largest share moves the pixel.
        let share = |body: u32| of_surface.iter().filter(|hit| hit.object == body).map(|hit| hit.weight()).sum();
        let shares = of_surface.iter().map(|hit| (hit.object, share(hit.object)));
        let (body, weight): (u32, f64) = shares.reduce(|a, b| if b.1 > a.1 { b } else { a })?;
        let hits: Vec<&Hit> = of_surface.into_iter().filter(|hit| hit.object == body).collect();
        let target = *self.tracer.target(0, hits.first()?)?;
        let depth = hits.iter().map(|hit| hit.weight() * hit.depth).sum::<f64>() / weight;
        let place = target.eye + target.direction * depth;
        let model = target.pose.model_from_world * (place - target.pose.world_from_model.translation);
        Some(Point { body: body as usize, pose: target.pose, model, hits, target: Some(target) })
    }

    /// Where a point of time `from` lies at time `to`: its film point and depth, whether it still shows the same side,
    /// and whether both sides show. `None` where it is not before the camera, or not known.
    fn land(&self, point: &Point<'_>, from: f64, to: f64) -> Option<([f64; 2], f64, bool, bool)> {
        let world = self.world;
        let body = &world.bodies[point.body];
        let (later, pose) = at_time(world, body, to)?;
        let elapsed = later.elapsed(to);
        let (mut weight, mut shift, mut normal) = (0.0, DVec3::ZERO, DVec3::ZERO);
        for hit in &point.hits {
            let w = hit.weight();
            weight += w;
            if hit.element == SPHERE {
                normal += point.model * w;
                continue;
            }
            if let Some(surface) = world.surface(body) {
                normal += surface.point(hit.element, [hit.u, hit.v]).normal.as_dvec3() * w;
                continue;
            }
            let i = hit.element as usize;
            let place =
                |body: &Body<'_>, elapsed| body.object.shape.paths().exact_place(body.surfels.position[i], i, elapsed);
            let before = place(body, point.target?.elapsed);
            let own = if body.surfels.spheres { point.model - before } else { body.surfels.normal[i].as_dvec3() };
            normal += own * w;
            shift += (place(later, elapsed) - before) * w;
        }
        let shift = if weight > 0.0 { shift / weight } else { shift };
        let cameras = [camera_at(world, body, from), camera_at(world, later, to)];
        let places = [(&point.pose, point.model), (&pose, point.model + shift)];
        // Which side the eye is on, at either time.
        let side = [0, 1].map(|i| {
            let (pose, model) = places[i];
            pose.normal(normal).dot(cameras[i].eye - pose.world_from_model.transform_point3(model)) < 0.0
        });
        let [_, camera] = cameras;
        let (pose, model) = places[1];
        let place = pose.world_from_model.transform_point3(model) - camera.eye;
        let p = camera.world_from_camera.transpose() * place;
        let depth = -p.z;
        if depth.is_nan() || depth < world.scene.camera.near {
            return None;
        }
        let film = world.film(p);
        // Nobody sees the back of a sphere of points.
        let both = (world.options.look.two_sided || later.surface.two_sided) && !body.surfels.spheres;
        film.iter().all(|c| c.is_finite()).then_some((film, depth, side[0] == side[1], both))
    }
}

/// The camera that sees an object at a time.
fn camera_at(world: &World<'_>, body: &Body<'_>, time: f64) -> CameraPose {
    if body.object.blur { world.camera(time) } else { world.frame_camera }
}

/// What shows the points of `body` at `time`, and its pose: the body itself or, where it is a part of a sequence,
/// another part with the points of the same file. The end of its part counts.
fn at_time<'w, 'a>(world: &'w World<'a>, body: &'w Body<'a>, time: f64) -> Option<(&'w Body<'a>, BodyPose)> {
    let same = |other: &&Body<'_>| {
        std::ptr::eq(*other, body)
            || body.object.piece().is_some()
                && other.object.name == body.object.name
                && std::ptr::eq(other.surfels, body.surfels)
    };
    let shown = |time: f64| world.bodies.iter().filter(same).find_map(|body| Some((body, body.pose_at(time)?)));
    let ends = |body: &Body<'_>| body.object.piece().is_some_and(|piece| piece.window[1] == time);
    shown(time).or_else(|| if world.bodies.iter().filter(same).any(ends) { shown(time.next_down()) } else { None })
}

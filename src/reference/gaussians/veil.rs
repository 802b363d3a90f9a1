//! Composites the Gaussians of captures, layers of see-through surfels and volumes over what rays see of opaque
//! surfaces.
//!
//! A group of rays, near each other in place and time, shares one list of Gaussians that any of them may meet, sorted
//! by a lower bound of depth. The list is taken batch by batch. Each ray sees each Gaussian of a batch exactly at its
//! own time, and composites what is surely nearer than all batches to come. So what one ray sees depends on nothing
//! else than that ray, and memory does not grow with what is hidden. A volume is marched through between all that, so
//! where there is one all hits wait for the end.

use glam::{DAffine3, DMat4, DVec3};

use super::beam::{Beam, BeamRay};
use super::colour::colour;
use super::place::ModelPlace;
use super::sight::{BATCH, GaussianBatch, Seen as SeenBatch, Sight, look};
use super::tree::{LEAST_ALPHA, MOST_ALPHA};
use crate::film::Aov;
use crate::math::norm;
use crate::reference::composite::{Composite, OPAQUE};
use crate::reference::layers::{RayLayer, Surfaces};
use crate::reference::posed::{CameraPose, World};
use crate::reference::sampler::LightNumbers;
use crate::reference::shadows::Shadows;
use crate::reference::trace::{SamplePoint, Seen};
use crate::reference::volumes::march::March;
use crate::scene::pose::object_velocity;

/// Variance that is added on the screen, pixels^2.
const DILATION: f64 = 0.3;

/// Tangents of the projection's derivative are kept within so many half fields of view.
const FIELD: f64 = 1.3;

/// Centres nearer than this share of the object's scale are not drawn.
const NEAREST: f64 = 0.2;

/// Waiting hits of one ray from which on those are dropped that are surely hidden.
const MANY: usize = 8192;

/// A Gaussian that a ray was shown, with its share.
#[derive(Clone, Copy, Debug)]
pub(in crate::reference) struct Taken {
    /// Number of the capture, and of the Gaussian in its model.
    pub capture: usize,
    pub index: usize,
    /// Camera depth of the centre.
    pub depth: f64,
    pub alpha: f64,
    /// Transmittance of what is before it.
    pub transmittance: f64,
    /// Colour in the space of the capture.
    pub colour: DVec3,
}

/// What a group of rays sees, on one thread.
#[derive(Debug)]
pub(in crate::reference) struct Veil<'w, 'a> {
    world: &'w World<'a>,
    rays: Vec<Ray>,
    /// For each ray its view of each capture; `None` where the object is hidden.
    views: Vec<Option<CaptureView>>,
    list: Vec<Candidate>,
    stack: Vec<(u32, u32)>,
    batch: GaussianBatch,
    seen: SeenBatch,
    /// What keeps light from captures, and the ray that it is at; `None` where there are no shadows.
    shadows: Option<Shadows<'w, 'a>>,
    shaded_ray: Option<usize>,
    /// Volumes; `None` where there are none.
    march: Option<March<'w, 'a>>,
    /// What was composited, in its order, if that is wanted.
    pub taken: Option<Vec<Taken>>,
}

/// A ray, and what it has met so far.
#[derive(Clone, Debug, Default)]
struct Ray {
    time: f64,
    /// What its points on lights follow from.
    lights: LightNumbers,
    /// Centres behind this depth are hidden by opaque surfaces.
    limit: f64,
    live: bool,
    sum: Composite,
    /// Hits that are not composited yet.
    waiting: Vec<Hit>,
    /// Layers of see-through surfels that are composited.
    layers: usize,
}

/// How a ray sees the object of one capture.
#[derive(Clone, Copy, Debug)]
struct CaptureView {
    sight: Sight,
    place: ModelPlace,
    world_from_model: DAffine3,
    near: f64,
    beam: BeamRay,
    /// Change of the model's place relative to the camera, per shutter; made when it is asked for.
    rate: Option<DMat4>,
}

#[derive(Clone, Copy, Debug)]
struct Candidate {
    /// Lower bound of the depth at which any ray sees it.
    nearest: f64,
    capture: u32,
    place: u32,
}

#[derive(Clone, Copy, Debug)]
struct Hit {
    depth: f64,
    alpha: f64,
    /// Number of the capture's object, and of the Gaussian in its model: the order among equal depths.
    capture: u32,
    index: u32,
}

impl<'w, 'a> Veil<'w, 'a> {
    pub(in crate::reference) fn new(world: &'w World<'a>) -> Self {
        Self {
            world,
            rays: Vec::new(),
            views: Vec::new(),
            list: Vec::new(),
            stack: Vec::new(),
            batch: GaussianBatch::default(),
            seen: SeenBatch::default(),
            shadows: Shadows::new(world),
            shaded_ray: None,
            march: (!world.volumes.is_empty()).then(|| March::new(world)),
            taken: None,
        }
    }

    /// Composites captures and see-through layers over what each sample sees of opaque surfaces, and writes the result
    /// there. Samples that see nothing get a colour without coverage.
    pub(in crate::reference) fn composite(&mut self, points: &[SamplePoint], surfaces: &mut Surfaces) {
        self.begin(points, &surfaces.limits);
        self.gather();
        let mut batches = std::mem::take(&mut self.list);
        let mut first = 0;
        while first < batches.len() && self.rays.iter().any(|ray| ray.live) {
            let end = (first + BATCH).min(batches.len());
            let next = batches.get(end).map_or(f64::INFINITY, |candidate| candidate.nearest);
            self.meet(&mut batches[first..end]);
            for ray in 0..self.rays.len() {
                self.settle(ray, next, surfaces.layers(ray), false);
            }
            first = end;
        }
        self.list = batches;
        // What a shadow catcher shows tells no depth where it shows nothing.
        let end = |(opaque, &limit): (&Option<Seen>, &f64)| match opaque {
            Some(opaque) if opaque.coverage < 1.0 => limit,
            Some(opaque) => opaque.depth,
            None => f64::INFINITY,
        };
        if let Some(march) = &mut self.march {
            march.begin(points, surfaces.opaque.iter().zip(&surfaces.limits).map(end));
        }
        for ray in 0..self.rays.len() {
            // The limit of the last layers may be greater than that of the opaque surface: they wait for this.
            let opaque = surfaces.opaque[ray];
            if let Some(march) = &mut self.march {
                march.begin_ray(ray, end((&opaque, &surfaces.limits[ray])));
            }
            self.settle(ray, f64::INFINITY, surfaces.layers(ray), true);
            let sum = &mut self.rays[ray].sum;
            if let Some(march) = &mut self.march {
                march.advance(f64::INFINITY, sum);
            }
            surfaces.opaque[ray] = Some(sum.over(opaque, &self.world.blend));
        }
    }

    fn begin(&mut self, points: &[SamplePoint], limits: &[f64]) {
        let world = self.world;
        self.rays.resize_with(points.len(), Ray::default);
        self.views.clear();
        self.shaded_ray = None;
        for (ray, (&SamplePoint { film, time, lights }, &limit)) in self.rays.iter_mut().zip(points.iter().zip(limits))
        {
            let mut waiting = std::mem::take(&mut ray.waiting);
            waiting.clear();
            *ray = Ray { time, lights, limit, live: true, waiting, ..Ray::default() };
            let camera = world.camera(time);
            self.views.extend(world.captures.iter().map(|capture| {
                let body = &world.bodies[capture.body];
                let camera = if body.object.blur { &camera } else { &world.frame_camera };
                CaptureView::new(world, capture.body, capture.reach, camera, film, time)
            }));
        }
    }

    /// Lists what any ray may meet.
    fn gather(&mut self) {
        let world = self.world;
        self.list.clear();
        let captures = world.captures.len();
        let far = self.rays.iter().map(|ray| ray.limit).fold(0.0, f64::max);
        for (number, capture) in world.captures.iter().enumerate() {
            let tree = &world.trees[capture.tree];
            let rays = self.views.iter().skip(number).step_by(captures).flatten().map(|view| view.beam);
            let Some(beam) = Beam::around(rays, far, tree.extent) else { continue };
            tree.visit(&beam, &mut self.stack, |place, kernel| {
                if let Some(nearest) = beam.nearest(kernel.centre.as_dvec3(), kernel.radius) {
                    self.list.push(Candidate { nearest, capture: number as u32, place });
                }
            });
        }
        self.list.sort_unstable_by(|a, b| {
            a.nearest.total_cmp(&b.nearest).then((a.capture, a.place).cmp(&(b.capture, b.place)))
        });
    }

    /// Lets each ray look at some candidates, and keeps what it meets.
    fn meet(&mut self, candidates: &mut [Candidate]) {
        let world = self.world;
        if world.captures.len() > 1 {
            candidates.sort_by_key(|candidate| candidate.capture);
        }
        let (batch, candidates) = (&mut self.batch, &*candidates);
        for run in candidates.chunk_by(|a, b| a.capture == b.capture) {
            let number = run[0].capture;
            let capture = &world.captures[number as usize];
            let kernels = world.trees[capture.tree].kernels();
            batch.count = 0;
            for candidate in run {
                batch.push(&kernels[candidate.place as usize]);
            }
            let views = self.views.iter().skip(number as usize).step_by(world.captures.len());
            for (ray, view) in self.rays.iter_mut().zip(views) {
                let (true, Some(view)) = (ray.live, view) else { continue };
                look(batch, &view.sight, &mut self.seen);
                for (i, candidate) in run.iter().enumerate() {
                    let kernel = &kernels[candidate.place as usize];
                    let depth = self.seen.depth[i];
                    // The comparisons also fail where a number is NaN.
                    if !(self.seen.q[i] <= kernel.reach && depth >= view.near && depth <= ray.limit) {
                        continue;
                    }
                    let share = if capture.antialias { self.seen.shrink[i].max(0.0).sqrt() } else { 1.0 };
                    let alpha = (kernel.opacity * share * libm::exp(-0.5 * self.seen.q[i])).min(MOST_ALPHA);
                    if alpha >= LEAST_ALPHA {
                        ray.waiting.push(Hit { depth, alpha, capture: number, index: kernel.index });
                    }
                }
            }
        }
    }

    /// Composites the waiting hits and the `layers` of a ray that are nearer than `next`, where all that is still to
    /// come begins. A Gaussian at the limit of a layer is before it. Where there is a volume this waits for the `last`
    /// call.
    fn settle(&mut self, number: usize, next: f64, layers: &[RayLayer], last: bool) {
        if !self.rays[number].live && !last {
            return;
        }
        let mut waiting = std::mem::take(&mut self.rays[number].waiting);
        waiting
            .sort_unstable_by(|a, b| a.depth.total_cmp(&b.depth).then((a.capture, a.index).cmp(&(b.capture, b.index))));
        let mut done = 0;
        let waits = self.march.is_some() && !last;
        while !waits && !self.rays[number].sum.is_opaque() {
            let hit = waiting.get(done).filter(|hit| hit.depth < next);
            let layer = layers.get(self.rays[number].layers);
            let layer = layer.filter(|layer| next.is_infinite() || layer.limit < next);
            let hit = hit.filter(|hit| layer.is_none_or(|layer| hit.depth <= layer.limit));
            // A Gaussian may be behind a layer's depth and before its limit.
            let depth = layer.map_or(f64::INFINITY, |layer| layer.seen.depth);
            let depth = hit.map_or(depth, |hit| depth.min(hit.depth));
            if hit.is_none() && layer.is_none() {
                break;
            }
            if let Some(march) = &mut self.march {
                march.advance(depth, &mut self.rays[number].sum);
            }
            if let Some(hit) = hit {
                self.add(number, hit);
                done += 1;
            } else if let Some(RayLayer { seen, opacity, .. }) = layer {
                let colour = self.world.blend.of_light(seen.colour);
                self.rays[number].sum.add(*opacity, &Seen { colour, ..*seen });
                self.rays[number].layers += 1;
            }
        }
        waiting.drain(..done);
        let ray = &mut self.rays[number];
        if waiting.len() > MANY {
            // Gaussians that are still to come can only hide more.
            let mut transmittance = ray.sum.transmittance;
            let ends = waiting.iter().position(|hit| {
                let hidden = transmittance < OPAQUE;
                transmittance *= 1.0 - hit.alpha;
                hidden
            });
            waiting.truncate(ends.unwrap_or(waiting.len()));
        }
        ray.live = !ray.sum.is_opaque() && next <= ray.limit;
        ray.waiting = waiting;
    }

    /// Composites one hit behind those before it.
    fn add(&mut self, number: usize, hit: &Hit) {
        let world = self.world;
        let capture = &world.captures[hit.capture as usize];
        let body = &world.bodies[capture.body];
        let (gaussians, options) = (capture.gaussians, &body.drawing);
        let ray_number = number;
        let at = number * world.captures.len() + hit.capture as usize;
        let (ray, Some(view)) = (&mut self.rays[number], &mut self.views[at]) else { return };
        let transmittance = ray.sum.transmittance;
        let &Hit { depth, alpha, capture: number, index } = hit;
        let own = colour(gaussians, options, index as usize, view.beam.origin);
        if let Some(taken) = &mut self.taken {
            let (capture, index) = (number as usize, index as usize);
            taken.push(Taken { capture, index, depth, alpha, transmittance, colour: own });
        }
        let mut shown = world.blend.of_capture(own, gaussians.linear);
        let receives = body.object.receive_shadows && options.flat.is_none() && !world.is_held(body);
        if let Some(shadows) = self.shadows.as_mut().filter(|_| receives) {
            let eye = world.camera(ray.time).eye;
            if self.shaded_ray.replace(ray_number) != Some(ray_number) {
                shadows.begin(eye, ray.time, ray.lights);
            }
            let place = view.world_from_model.transform_point3(gaussians.position[index as usize].as_dvec3());
            if let Some(left) = shadows.light_left(place, eye) {
                shown = world.blend.scaled(shown, left);
            }
        }
        let mut part = Seen { colour: shown, depth, ..Seen::NOTHING };
        if body.object.blur && world.options.look.aovs.contains(&Aov::Velocity) {
            let rate = *view.rate.get_or_insert_with(|| object_velocity(world.scene, body.object, ray.time));
            let centre = gaussians.position[hit.index as usize].as_dvec3();
            part.velocity = world.focal * view.place.velocity(centre, &rate);
        }
        ray.sum.add(alpha, &part);
    }
}

impl CaptureView {
    fn new(world: &World<'_>, body: usize, reach: f64, camera: &CameraPose, film: [f64; 2], time: f64) -> Option<Self> {
        let pose = world.bodies[body].pose_at(time)?;
        let place = ModelPlace::new(&pose, camera, world.direction(film));
        let linear = pose.world_from_model.matrix3;
        let size = world.size.map(f64::from);
        let half = size.map(|pixels| 0.5 * pixels / world.focal);
        let bounds = half.map(|half| FIELD * half);
        let sight = Sight {
            rows: place.rows,
            offset: place.offset,
            tangent: [0, 1].map(|axis| film[axis] / world.focal - half[axis]),
            bounds,
            dilation: DILATION / (world.focal * world.focal),
        };
        let scale = libm::cbrt(linear.determinant().abs());
        let near = world.scene.camera.near.max(NEAREST * scale);
        // |e| <= sqrt(reach) (|P| |W| sigma + sqrt(d)), with |P|^2 <= 1 + s^2 + t^2 of the bounds; in the model
        // lengths grow by the norm of the inverse.
        let back = norm(&pose.model_from_world);
        let slant = (1.0 + bounds[0] * bounds[0] + bounds[1] * bounds[1]).sqrt();
        let beam = BeamRay {
            origin: place.eye,
            direction: place.direction,
            forward: place.rows[2],
            offset: place.offset.z,
            near,
            growth: slant * norm(&linear) * back,
            slope: (reach * sight.dilation).sqrt() * back,
        };
        Some(Self { sight, place, world_from_model: pose.world_from_model, near, beam, rate: None })
    }
}

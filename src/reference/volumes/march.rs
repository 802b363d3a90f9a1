//! Light through the volumes along rays (Zwicker et al. 2002, eq. 9).
//!
//! A group of rays shares a list of kernels that any of them may meet. For each ray those that it meets become
//! Gaussians of depth, sorted by where they begin. The ray goes through them block by block; the least standard
//! deviation in a block says how fine its steps are. What one ray sees depends on nothing else than that ray.

use glam::{DVec2, DVec3};

use super::block::{Block, Line, PANELS};
use super::buckets::Buckets;
use super::kernel::REACH;
use super::light::{Lights, VolumeView};
use super::line::{Along, BATCH, KernelBatch, look};
use crate::film::Aov;
use crate::reference::composite::Composite;
use crate::reference::gaussians::beam::{Beam, BeamRay};
use crate::reference::gaussians::place::ModelPlace;
use crate::reference::posed::World;
use crate::reference::trace::{SamplePoint, Seen};
use crate::scene::pose::object_velocity;

/// Steps in a standard deviation along the ray. Measured: colours are right to 8e-7 (tests/reference/volumes.rs).
const FINE: f64 = 4.0;

/// A kernel whose standard deviation along the ray is less than this share of its greatest one is a sheet: all of it is
/// at one depth.
const THIN: f64 = 1e-3;

/// Sheets whose depths differ by less than this share are at one depth.
const SAME: f64 = 1e-9;

/// Greatest optical depth of a panel. Denser blocks are divided.
const DENSE: f64 = 0.5;

/// Greatest extinction and optical depth of a kernel, that sums stay finite.
const MOST: f64 = 1e100;

/// 1 / (2 pi), and 1 / sqrt(2 pi).
const OVER_TAU: f64 = 1.0 / std::f64::consts::TAU;
const OVER_ROOT: f64 = 0.398_942_280_401_432_7;

/// The volumes of the world for a group of rays, on one thread.
#[derive(Debug)]
pub(in crate::reference) struct March<'w, 'a> {
    world: &'w World<'a>,
    /// For each ray its view of each volume; `None` where the object is hidden.
    views: Vec<Option<VolumeView>>,
    /// Kernels that any ray may meet, of volume after volume; how many batches have some.
    batches: Vec<KernelBatch>,
    used: usize,
    stack: Vec<(u32, u32)>,
    along: Along,
    ray: Ray,
    lights: Lights<'w, 'a>,
}

/// The ray that is looked at.
#[derive(Debug)]
struct Ray {
    number: usize,
    /// Depth that was reached, and where the ray ends.
    at: f64,
    end: f64,
    /// What it meets.
    met: Vec<Met>,
    /// Numbers in `met` of those that have an extent, by where they begin; how many were begun.
    order: Vec<(f64, u32)>,
    begun: usize,
    /// Those that were begun and did not end.
    active: Vec<Line>,
    /// Depths and numbers in `met` of the sheets, the nearest first; how many were passed.
    sheets: Vec<(f64, u32)>,
    passed: usize,
    block: Block,
    buckets: Buckets,
}

/// A kernel that a ray meets. `sigma` is 0 for a sheet.
#[derive(Clone, Copy, Debug)]
struct Met {
    /// Its number in the batches.
    number: u32,
    depth: f64,
    sigma: f64,
    /// Half of the depths at which it counts.
    half: f64,
    /// The integral of its extinction along a ray through its centre, and the square of the distance of this ray, in
    /// standard deviations.
    tau: f64,
    q: f64,
}

impl<'w, 'a> March<'w, 'a> {
    pub(in crate::reference) fn new(world: &'w World<'a>) -> Self {
        let ray = Ray {
            number: 0,
            at: 0.0,
            end: 0.0,
            met: Vec::new(),
            order: Vec::new(),
            begun: 0,
            active: Vec::new(),
            sheets: Vec::new(),
            passed: 0,
            block: Block::new(world.options.look.aovs.contains(&Aov::Velocity)),
            buckets: Buckets::default(),
        };
        Self {
            world,
            views: Vec::new(),
            batches: Vec::new(),
            used: 0,
            stack: Vec::new(),
            along: Along::default(),
            ray,
            lights: Lights::new(world),
        }
    }

    /// Lists what the rays through `points` may meet before the depths `ends`, at which they end.
    pub(in crate::reference) fn begin(&mut self, points: &[SamplePoint], ends: impl Iterator<Item = f64>) {
        let world = self.world;
        self.views.clear();
        for &SamplePoint { film, time, lights } in points {
            let camera = world.camera(time);
            self.views.extend(world.volumes.iter().map(|volume| {
                let body = &world.bodies[volume.body];
                let camera = if body.object.blur { &camera } else { &world.frame_camera };
                let pose = body.pose_at(time)?;
                let direction = world.direction(film);
                let (place, length) = (ModelPlace::new(&pose, camera, direction), direction.length());
                Some(VolumeView { pose, place, eye: camera.eye, length, time, lights, rate: None })
            }));
        }
        let far = ends.fold(0.0, f64::max);
        self.used = 0;
        for (number, volume) in world.volumes.iter().enumerate() {
            let tree = &world.volume_trees[volume.tree];
            let views = self.views.iter().skip(number).step_by(world.volumes.len()).flatten();
            // A kernel is met where a point of a ray is within its radius.
            let rays = views.map(|view| BeamRay {
                origin: view.place.eye,
                direction: view.place.direction,
                forward: view.place.rows[2],
                offset: view.place.offset.z,
                near: world.scene.camera.near,
                growth: 1.0,
                slope: 0.0,
            });
            let Some(beam) = Beam::around(rays, far, tree.extent) else { continue };
            let first = self.used;
            let (batches, used) = (&mut self.batches, &mut self.used);
            let mut room = 0;
            tree.visit(&beam, &mut self.stack, |place, kernel| {
                let centre = kernel.centre.as_dvec3();
                if !beam.meets([centre, centre], kernel.radius) {
                    return;
                }
                if room == 0 {
                    if batches.len() == *used {
                        batches.push(KernelBatch::default());
                    }
                    let batch = &mut batches[*used];
                    (batch.count, batch.volume, batch.colour) = (0, number, None);
                    *used += 1;
                    room = BATCH;
                }
                batches[*used - 1].push(kernel, place);
                room -= 1;
            });
            // What does not depend on the ray is computed once.
            let body = &world.bodies[volume.body];
            let gaussians = volume.gaussians;
            let fixed = body.is_fixed() && world.camera_of(body).is_some();
            let plain = gaussians.normal.is_empty() && (gaussians.degree == 0 || body.drawing.flat.is_some());
            let view = self.views.iter().skip(number).step_by(world.volumes.len()).flatten().next();
            let is_own = (fixed || plain) && !self.lights.shade(world, volume);
            if let Some(view) = view.filter(|_| is_own) {
                for batch in &mut self.batches[first..self.used] {
                    let mut colours = [DVec3::ZERO; BATCH];
                    for (colour, &place) in colours.iter_mut().zip(&batch.place[..batch.count]) {
                        let kernel = &tree.kernels()[place as usize];
                        *colour = world.blend.of_light(self.lights.colour(world, volume, kernel, view, 0.0));
                    }
                    batch.colour = Some(colours);
                }
            }
        }
    }

    /// Puts a ray of the group before all volumes. It ends at the depth `end`.
    pub(in crate::reference) fn begin_ray(&mut self, number: usize, end: f64) {
        let world = self.world;
        let near = world.scene.camera.near;
        let ray = &mut self.ray;
        (ray.number, ray.at, ray.end, ray.begun, ray.passed) = (number, near, end, 0, 0);
        self.lights.next_ray();
        ray.met.clear();
        ray.order.clear();
        ray.sheets.clear();
        ray.active.clear();
        for (at, batch) in self.batches[..self.used].iter().enumerate() {
            let Some(view) = &self.views[number * world.volumes.len() + batch.volume] else { continue };
            look(batch, view.place.eye, view.place.direction, &mut self.along);
            // Standard deviation along the ray below which a kernel is thin in the world, relative to its radius.
            let thin = THIN / (REACH * view.place.direction.length());
            let length = view.length * OVER_TAU;
            for i in 0..batch.count {
                let (depth, q, a) = (self.along.depth[i], self.along.q[i], self.along.a[i]);
                // The comparison also fails where a number is NaN, as where a flat kernel is seen edge-on.
                if !(q <= REACH * REACH && a > 0.0) {
                    continue;
                }
                let over = 1.0 / a.sqrt();
                let sigma = batch.root[i] * over;
                let half = sigma * (REACH * REACH - q).sqrt();
                if depth + half < near || depth - half > end {
                    continue;
                }
                if !depth.is_finite() {
                    continue;
                }
                let tau = (batch.mass[i] * length * over).min(MOST);
                let (index, number) = (ray.met.len() as u32, (at * BATCH + i) as u32);
                if sigma < thin * batch.radius[i] {
                    if depth >= near && depth <= end {
                        ray.sheets.push((depth, index));
                        ray.met.push(Met { number, depth, sigma: 0.0, half, tau, q });
                    }
                } else {
                    ray.order.push((depth - half, index));
                    ray.met.push(Met { number, depth, sigma, half, tau, q });
                }
            }
        }
        ray.buckets.sort(&mut ray.order);
        ray.buckets.sort(&mut ray.sheets);
    }

    /// Composites the volumes up to the depth `to`, or up to the end of the ray if that is nearer.
    pub(in crate::reference) fn advance(&mut self, to: f64, sum: &mut Composite) {
        let to = to.min(self.ray.end);
        while let Some(&(depth, _)) = self.ray.sheets.get(self.ray.passed).filter(|sheet| sheet.0 <= to) {
            self.pass(depth, sum);
            self.sheet(depth, sum);
        }
        self.pass(to, sum);
    }

    /// Composites the sheets at the depth of the next one: their extinctions add up, and their colours are blended by
    /// them.
    fn sheet(&mut self, depth: f64, sum: &mut Composite) {
        let (mut tau, mut colour, mut velocity) = (0.0, DVec3::ZERO, DVec2::ZERO);
        while let Some(&(other, index)) = self.ray.sheets.get(self.ray.passed) {
            if other - depth > SAME * depth {
                break;
            }
            self.ray.passed += 1;
            if sum.is_opaque() {
                continue;
            }
            let met = self.ray.met[index as usize];
            let (c, v) = self.looks(&met);
            let own = met.tau * libm::exp(-0.5 * met.q);
            tau += own;
            colour += own * c;
            velocity += own * v;
        }
        if tau > 0.0 {
            let seen = Seen { colour: colour / tau, depth, velocity: velocity / tau, ..Seen::NOTHING };
            sum.add(-libm::expm1(-tau), &seen);
        }
    }

    /// Composites all but sheets up to the depth `to`.
    fn pass(&mut self, to: f64, sum: &mut Composite) {
        while self.ray.at < to && !sum.is_opaque() {
            let at = self.ray.at;
            self.begin_up_to(at);
            self.ray.active.retain(|line| line.end > at);
            let next = self.ray.order.get(self.ray.begun).map_or(f64::INFINITY, |begins| begins.0);
            let least = self.ray.active.iter().map(|line| line.sigma).fold(f64::INFINITY, f64::min);
            if least == f64::INFINITY {
                self.ray.at = next.min(to);
                continue;
            }
            let mut step = least / FINE;
            let mut end = (at + 2.0 * PANELS as f64 * step).min(to);
            // A finer kernel that begins later ends the block.
            while let Some(&(start, index)) = self.ray.order.get(self.ray.begun).filter(|begins| begins.0 < end) {
                if self.ray.met[index as usize].sigma < 0.999 * least {
                    end = start;
                    break;
                }
                self.begin_one();
            }
            let mut panels = ((end - at) / (2.0 * step)).ceil().clamp(1.0, PANELS as f64);
            step = (end - at) / (2.0 * panels);
            self.ray.block.fill(&self.ray.active, at, step, panels as usize);
            let dense = self.ray.block.densest();
            if dense > DENSE && step > 1e-6 * least {
                // The first panels decide: light ends within few of them.
                step = (step * DENSE / dense).max(1e-6 * least);
                panels = PANELS as f64;
                end = at + 2.0 * panels * step;
                if end > to {
                    end = to;
                    step = (end - at) / (2.0 * panels);
                }
                self.ray.block.fill(&self.ray.active, at, step, panels as usize);
            }
            self.ray.block.shine(sum);
            // A step below the resolution of depths goes on too.
            self.ray.at = end.max(at.next_up());
        }
        self.ray.at = self.ray.at.max(to);
    }

    fn begin_up_to(&mut self, depth: f64) {
        while self.ray.order.get(self.ray.begun).is_some_and(|begins| begins.0 <= depth) {
            self.begin_one();
        }
    }

    /// Lets the next kernel begin.
    fn begin_one(&mut self) {
        let (start, index) = self.ray.order[self.ray.begun];
        self.ray.begun += 1;
        let met = self.ray.met[index as usize];
        let end = met.depth + met.half;
        if end <= self.ray.at {
            return;
        }
        let (colour, velocity) = self.looks(&met);
        self.ray.active.push(Line {
            start,
            end,
            centre: met.depth,
            sigma: met.sigma,
            peak: (met.tau * OVER_ROOT / met.sigma).min(MOST),
            q: met.q,
            colour: colour.to_array(),
            velocity: velocity.to_array(),
        });
    }

    /// Colour of a kernel in the numbers of the image's blending, and its velocity on the film, pixels per shutter.
    fn looks(&mut self, met: &Met) -> (DVec3, DVec2) {
        let world = self.world;
        let (batch, i) = (&self.batches[met.number as usize / BATCH], met.number as usize % BATCH);
        let moves = self.ray.block.moves;
        if let Some(colours) = batch.colour.as_ref().filter(|_| !moves) {
            return (colours[i], DVec2::ZERO);
        }
        let volume = &world.volumes[batch.volume];
        let kernel = &world.volume_trees[volume.tree].kernels()[batch.place[i] as usize];
        let body = &world.bodies[volume.body];
        let Some(view) = &mut self.views[self.ray.number * world.volumes.len() + batch.volume] else {
            return Default::default();
        };
        let light = if let Some(colours) = &batch.colour {
            colours[i]
        } else {
            let depth = met.tau * libm::exp(-0.5 * met.q);
            world.blend.of_light(self.lights.colour(world, volume, kernel, view, depth))
        };
        let mut velocity = DVec2::ZERO;
        if body.object.blur && moves {
            let rate = *view.rate.get_or_insert_with(|| object_velocity(world.scene, body.object, view.time));
            velocity = world.focal * view.place.velocity(kernel.centre.as_dvec3(), &rate);
        }
        (light, velocity)
    }
}

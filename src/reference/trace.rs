//! Traces samples: from a film point and a time to what is seen there (docs/math.md, eq. 4 to 7).
//!
//! T = min over the surfels of all objects on the ray of (depth + epsilon); colour = sum(w c) / sum(w) over the surfels
//! with depth <= T, and no farther behind the nearest one than the epsilon of their own object. The sums are taken in
//! the order of objects and surfels, so they do not depend on the hierarchy.
//! Opaque surfels set T; see-through ones before it are found afterwards, for `layers`.

use glam::{DVec2, DVec3, Vec3};

use super::boxes::PACKET;
use super::cull::{Candidates, ObjectCones};
use super::posed::{Body, BodyPose, CameraPose, Form, World};
use super::sampler::LightNumbers;
use super::shadows::{Receiver, Shadows};
use super::traverse::{Found, Hit, LEAST_EPSILON, ModelRay, Waiting, intersect_sphere};
use crate::film::Aov;
use crate::model::Material;
use crate::model::mesh::SurfacePoint;
use crate::model::paths::Elapsed;
use crate::options::Shading;
use crate::scene::pose::object_velocity;
use crate::shading::{ShadingLight, shade};

/// What one sample sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// Shaded colour, linear Rec.709, premultiplied by `coverage` like all below.
    pub colour: DVec3,
    /// 1 for opaque surfaces, 1 - transmittance where light passes through all that is seen.
    pub coverage: f64,
    /// Mean camera depth.
    pub depth: f64,
    /// Averaged normal: a unit vector in world axes. Captures and volumes have none.
    pub normal: DVec3,
    /// Mean screen velocity, pixels per shutter; 0 unless the AOV is wanted.
    pub velocity: DVec2,
}

impl Seen {
    /// Nothing at all.
    pub(super) const NOTHING: Self =
        Self { colour: DVec3::ZERO, coverage: 0.0, depth: 0.0, normal: DVec3::ZERO, velocity: DVec2::ZERO };
}

/// An object that the ray of a lane meets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target {
    pub pose: BodyPose,
    /// The eye that sees the object. For an object that does not blur it is that of the frame number.
    pub eye: DVec3,
    /// Direction of depth 1 in world space.
    pub direction: DVec3,
    /// Factors on the columns of the paths of surfels that move by themselves.
    pub elapsed: Elapsed<f64>,
}

/// Where and when a sample looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SamplePoint {
    /// Film point, pixels.
    pub film: [f64; 2],
    /// Scene time, frames.
    pub time: f64,
    /// What its points on lights follow from.
    pub lights: LightNumbers,
}

/// Traces samples on one thread. Up to [`PACKET`] of them go together, each in a lane.
#[derive(Debug)]
pub(super) struct Tracer<'w, 'a> {
    world: &'w World<'a>,
    /// The hits of each lane.
    pub found: Vec<Found>,
    views: Vec<LaneView>,
    /// The objects of each lane. An entry has meaning only if the lane hits the object.
    targets: Vec<Option<Target>>,
    rays: Vec<ModelRay>,
    stack: Vec<Waiting>,
    lights: Vec<ShadingLight>,
    /// Present where any light has shadows.
    shadows: Option<Shadows<'w, 'a>>,
}

/// The view of a lane's sample.
#[derive(Clone, Copy, Debug)]
struct LaneView {
    camera: CameraPose,
    /// Direction of depth 1 in camera space.
    direction: DVec3,
    time: f64,
    lights: LightNumbers,
}

impl<'w, 'a> Tracer<'w, 'a> {
    pub(super) fn new(world: &'w World<'a>) -> Self {
        let mut lights = Vec::new();
        world.lights(world.frame_camera.eye, &mut lights);
        Self {
            world,
            found: vec![Found::default(); PACKET],
            views: Vec::new(),
            targets: vec![None; PACKET * world.bodies.len()],
            rays: Vec::new(),
            stack: Vec::new(),
            lights,
            shadows: Shadows::new(world),
        }
    }

    /// Collects hits and the limits T of the rays through `points`, at most [`PACKET`]. Each point becomes a lane.
    pub(super) fn hits(&mut self, points: &[SamplePoint], candidates: &Candidates, cones: &ObjectCones) {
        let world = self.world;
        self.views.clear();
        self.views.extend(points.iter().map(|&SamplePoint { film, time, lights }| LaneView {
            camera: world.camera(time),
            direction: world.direction(film),
            time,
            lights,
        }));
        self.found.iter_mut().for_each(Found::clear);
        self.meet(candidates, cones, false);
        // A ray meets its nearest surfel whatever the order: no limit is before it.
        for found in &mut self.found {
            found.nearest = found.hits.iter().map(|hit| hit.depth).fold(f64::INFINITY, f64::min);
        }
        if world.bodies.iter().any(|body| body.see_through) {
            let swap = |found: &mut Found| std::mem::swap(&mut found.hits, &mut found.see_through);
            self.found.iter_mut().for_each(swap);
            self.meet(candidates, cones, true);
            self.found.iter_mut().for_each(swap);
        }
    }

    /// Adds the hits of all objects that are see-through, or of all others.
    fn meet(&mut self, candidates: &Candidates, cones: &ObjectCones, see_through: bool) {
        let world = self.world;
        for &(number, subintervals) in &candidates.bodies {
            let body = &world.bodies[number];
            if body.see_through != see_through {
                continue;
            }
            self.rays.clear();
            for (lane, view) in self.views.iter().enumerate() {
                if subintervals >> cones.subinterval(view.time) & 1 == 0 {
                    continue;
                }
                let Some(pose) = body.pose_at(view.time) else { continue };
                let camera = if body.object.blur { &view.camera } else { &world.frame_camera };
                let elapsed = body.elapsed(view.time);
                let (eye, direction) = (camera.eye, camera.world_from_camera * view.direction);
                self.rays.push(ModelRay {
                    origin: pose.model_from_world * (eye - pose.world_from_model.translation),
                    direction: pose.model_from_world * direction,
                    near: world.scene.camera.near,
                    // An infinite tolerance lowers no limit.
                    epsilon: if see_through { f64::INFINITY } else { pose.epsilon },
                    two_sided: world.options.look.two_sided || body.surface.two_sided,
                    object: number as u32,
                    lane,
                    elapsed,
                });
                self.targets[lane * world.bodies.len() + number] = Some(Target { pose, eye, direction, elapsed });
            }
            match body.form {
                Form::Model(model) => world.models[model].meet(&self.rays, &mut self.found, &mut self.stack),
                Form::Sphere(sphere) => {
                    self.rays.iter().for_each(|ray| intersect_sphere(&sphere, ray, &mut self.found[ray.lane]));
                }
                Form::Gaussians(_) | Form::Volume(_) | Form::Nothing => {}
            }
        }
    }

    /// The object of a lane's hit.
    pub(super) fn target(&self, lane: usize, hit: &Hit) -> Option<&Target> {
        self.targets[lane * self.world.bodies.len() + hit.object as usize].as_ref()
    }

    /// The depth up to which an opaque object with this tolerance shows on the ray of a lane, for what lies at `depth`
    /// (docs/math.md, eq. 5).
    pub(super) fn limit(&self, lane: usize, epsilon: f64, depth: f64) -> f64 {
        let Found { limit, nearest, .. } = self.found[lane];
        limit.min(nearest + epsilon.max(LEAST_EPSILON * depth))
    }

    /// Does an opaque hit of a lane contribute?
    pub(super) fn shows(&self, lane: usize, hit: &Hit) -> bool {
        let epsilon = self.target(lane, hit).map_or(0.0, |target| target.pose.epsilon);
        hit.depth <= self.limit(lane, epsilon, hit.depth)
    }

    /// What a lane sees of opaque surfaces: the weighted mean of its hits that show, shaded (docs/math.md, eq. 6 and
    /// 7).
    pub(super) fn seen(&mut self, lane: usize) -> Option<Seen> {
        let mut hits = std::mem::take(&mut self.found[lane].hits);
        hits.retain(|hit| self.shows(lane, hit));
        let seen = self.surface(lane, &mut hits);
        self.found[lane].hits = hits;
        seen
    }

    /// One surface of a lane: the weighted mean of `hits`, shaded; `None` without hits. The hits are sorted.
    pub(super) fn surface(&mut self, lane: usize, hits: &mut [Hit]) -> Option<Seen> {
        if hits.is_empty() {
            return None;
        }
        hits.sort_unstable_by_key(|hit| (hit.object, hit.element));
        let LaneView { camera, direction, time, lights } = self.views[lane];
        let direction = camera.world_from_camera * direction;
        if !self.world.fixed_lights() {
            self.world.lights(camera.eye, &mut self.lights);
        }
        let mut shadows = self.shadows.take();
        if let Some(shadows) = &mut shadows {
            shadows.begin(camera.eye, time, lights);
        }
        let (mut unshadowed, mut caught) = (0.0, 0.0);
        let (mut weight, mut colour, mut normal, mut depth) = (0.0, DVec3::ZERO, DVec3::ZERO, 0.0);
        let (mut material, mut velocity, mut reflection) = ([0.0; 4], DVec2::ZERO, 0.0);
        for hit in &*hits {
            let body = &self.world.bodies[hit.object as usize];
            let Some(target) = self.target(lane, hit) else { continue };
            let surface = HitPoint::of(self.world, target, hit);
            let w = hit.weight();
            let c = match self.world.options.look.shading {
                Shading::Phong => surface.colour,
                Shading::Gouraud => {
                    let (place, normal, eye) = (surface.centre(target), surface.normal, target.eye);
                    let position = (place - eye).as_vec3();
                    let lights = match &mut shadows {
                        Some(shadows) if body.object.receive_shadows => {
                            shadows.reaching(&Receiver { place, normal, eye, own: hit.object, hits })
                        }
                        Some(shadows) => shadows.all(),
                        None => &self.lights,
                    };
                    let lit = shade(lights, &surface.material, surface.colour, normal.as_vec3(), position);
                    let mirrors = self.mirrored(body.surface.reflection, normal, position.as_dvec3());
                    lit + mirrors.as_vec3()
                }
            };
            weight += w;
            unshadowed += if body.object.receive_shadows { 0.0 } else { w };
            if body.object.shadow_catcher && !body.see_through {
                caught += w;
            } else {
                colour += w * c.as_dvec3();
                reflection += w * body.surface.reflection;
            }
            normal += w * surface.normal;
            depth += w * hit.depth;
            let Material { ambient, diffuse, specular, shininess } = surface.material;
            for (sum, value) in material.iter_mut().zip([ambient, diffuse, specular, shininess]) {
                *sum += w * f64::from(value);
            }
            if self.world.options.look.aovs.contains(&Aov::Velocity) {
                velocity += w * self.velocity(body, target, &surface, time);
            }
        }
        let over = 1.0 / weight;
        let share = |sum: f64| if sum == weight { 1.0 } else { sum * over };
        let (receiving, caught) = (1.0 - share(unshadowed), share(caught));
        // Of what is not a shadow catcher.
        let of_rest = if caught < 1.0 { over / (1.0 - caught) } else { 0.0 };
        let (mut colour, normal, depth) = (colour * of_rest, normal.normalize_or_zero(), depth * over);
        let mut coverage = 1.0 - caught;
        let leading = leading(hits).and_then(|hit| Some((hit.object, self.target(lane, hit)?)));
        if let (true, Some(shadows), Some((own, &Target { eye, direction, .. }))) =
            (caught > 0.0, &mut shadows, leading)
        {
            let receiver = Receiver { place: eye + direction * depth, normal, eye, own, hits };
            let [all, taken] = shadows.caught(&receiver, [material[0] * over, material[1] * over]);
            coverage += caught * receiving * if all > 0.0 { taken / all } else { 0.0 };
        }
        if self.world.options.look.shading == Shading::Phong {
            let [ambient, diffuse, specular, shininess] = material.map(|sum| (sum * over) as f32);
            let material = Material { ambient, diffuse, specular, shininess };
            let position = (direction * depth).as_vec3();
            let shaded = |lights: &[ShadingLight]| {
                shade(lights, &material, colour.as_vec3(), normal.as_vec3(), position).as_dvec3()
            };
            let mut lit = DVec3::ZERO;
            if let (Some(shadows), Some((own, &Target { eye, direction, .. }))) = (&mut shadows, leading) {
                let receiver = Receiver { place: eye + direction * depth, normal, eye, own, hits };
                if receiving > 0.0 {
                    lit += receiving * shaded(shadows.reaching(&receiver));
                }
                if receiving < 1.0 {
                    lit += (1.0 - receiving) * shaded(shadows.all());
                }
            } else {
                lit = shaded(&self.lights);
            }
            colour = lit + self.mirrored(reflection * of_rest, normal, direction);
        }
        colour *= 1.0 - caught;
        self.shadows = shadows;
        let (normal, depth, velocity) = (normal * coverage, depth * coverage, velocity * over * coverage);
        Some(Seen { colour, coverage, depth, normal, velocity })
    }

    /// What a surface with the coefficient `reflection` and unit normal `normal` mirrors on a ray along `direction`, of
    /// any length: the environment's own pixels, without any filter.
    fn mirrored(&self, reflection: f64, normal: DVec3, direction: DVec3) -> DVec3 {
        let Some(environment) = self.world.scene.environment.as_ref().filter(|_| reflection > 0.0) else {
            return DVec3::ZERO;
        };
        let along = direction.normalize_or_zero();
        environment.radiance(along - normal * (2.0 * normal.dot(along))) * reflection
    }

    /// Mean opacity of see-through hits, weighted as their colours.
    pub(super) fn opacity(&self, hits: &[Hit]) -> f64 {
        let (mut sum, mut weight) = (0.0, 0.0);
        for hit in hits {
            let w = hit.weight();
            sum += w * self.world.opacity(hit);
            weight += w;
        }
        sum / weight
    }

    /// Screen velocity of a surfel's centre, pixels per shutter: the derivative of (f X, -f Y) / depth (docs/math.md,
    /// section 8).
    fn velocity(&self, body: &Body<'_>, target: &Target, surface: &HitPoint, time: f64) -> DVec2 {
        if !body.object.blur {
            return DVec2::ZERO;
        }
        let world = self.world;
        let camera = world.camera(time).world_from_camera.transpose();
        let p = camera * (surface.centre(target) - target.eye);
        // The rate is that of camera space relative to model space about the model's own origin.
        let rate = object_velocity(world.scene, body.object, time);
        let own = camera * (target.pose.world_from_model.matrix3 * surface.own_velocity);
        let v = rate.transform_vector3(surface.model + body.surfels.origin) + rate.w_axis.truncate() + own;
        let (x, y, d) = (world.focal * p.x, -world.focal * p.y, -p.z);
        let (dx, dy, dd) = (world.focal * v.x, -world.focal * v.y, -v.z);
        DVec2::new((dx - x / d * dd) / d, (dy - y / d * dd) / d)
    }
}

/// A hit of the object that has the largest share of a surface. The hits are sorted by objects.
fn leading(hits: &[Hit]) -> Option<&Hit> {
    let share = |hits: &[Hit]| hits.iter().map(Hit::weight).sum::<f64>();
    let objects = hits.chunk_by(|a, b| a.object == b.object);
    objects.max_by(|a, b| share(a).total_cmp(&share(b)))?.first()
}

impl Hit {
    /// The reconstruction kernel exp(-2 r^2) (docs/math.md, eq. 4); its peak for what is no surfel.
    pub(super) fn weight(&self) -> f64 {
        if self.is_even {
            return 1.0;
        }
        libm::exp(-2.0 * (self.u * self.u + self.v * self.v))
    }
}

/// The attributes that a hit contributes.
pub(super) struct HitPoint {
    pub colour: Vec3,
    /// Unit normal in world axes. It is turned to the viewer where the surface is seen from behind.
    pub normal: DVec3,
    /// Centre of the surfel (for a sphere and a triangle, the point hit) relative to the model's origin, in model axes.
    pub model: DVec3,
    /// Its velocity by itself, model units per shutter.
    own_velocity: DVec3,
    pub material: Material,
}

impl HitPoint {
    /// Centre of the surfel in the world.
    fn centre(&self, target: &Target) -> DVec3 {
        target.pose.world_from_model.transform_point3(self.model)
    }

    pub(super) fn of(world: &World<'_>, target: &Target, hit: &Hit) -> Self {
        let (pose, body) = (&target.pose, &world.bodies[hit.object as usize]);
        let mut own_velocity = DVec3::ZERO;
        let point = || {
            let point = target.eye + target.direction * hit.depth - pose.world_from_model.translation;
            pose.model_from_world * point
        };
        let (colour, normal, model) = if let Form::Sphere(sphere) = body.form {
            (sphere.colour, point(), point())
        } else if let Some(surface) = world.surface(body) {
            let SurfacePoint { colour, normal, .. } = surface.point(hit.element, [hit.u, hit.v]);
            (colour, normal.as_dvec3(), point())
        } else {
            let i = hit.element as usize;
            let paths = body.object.shape.paths();
            own_velocity = paths.velocity(i, target.elapsed.map(|factor| factor as f32)).as_dvec3() * body.pace;
            let place = paths.exact_place(body.surfels.position[i], i, target.elapsed);
            let normal = if body.surfels.spheres { point() - place } else { body.surfels.normal[i].as_dvec3() };
            (body.surfels.colour[i], normal, place)
        };
        let normal = pose.normal(normal);
        Self {
            colour,
            normal: if hit.back { -normal } else { normal },
            model,
            own_velocity,
            material: body.material(hit.element as usize),
        }
    }
}

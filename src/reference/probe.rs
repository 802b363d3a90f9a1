//! Shows everything about one pixel or one sample, for people who wonder about a value.

use std::fmt;

use glam::DVec3;

use super::cull::Candidates;
use super::error::ReferenceError;
use super::gaussians::veil::{Taken, Veil};
use super::integrator::Integrator;
use super::layers::Surfaces;
use super::options::ReferenceOptions;
use super::posed::{Form, World};
use super::sampler::{Points, SCRAMBLINGS};
use super::sums::{Sums, mean};
use super::trace::{HitPoint, SamplePoint, Tracer};
use crate::scene::Scene;
use crate::time::FrameNumber;

/// One sample and what it sees.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Number of the sample in its pixel.
    pub number: u64,
    /// Film point, pixels.
    pub film: [f64; 2],
    /// Scene time, frames.
    pub time: f64,
    /// Eye and direction (of depth 1) of the ray, world space.
    pub ray: [DVec3; 2],
    /// T of the visibility rule (docs/math.md, eq. 5): nothing deeper contributes. Infinite without an opaque hit.
    pub limit: f64,
    /// Surfels on the ray, nearest first. All that contribute are there, and others that were met on the way; farther
    /// ones may be missing.
    pub hits: Vec<ProbedHit>,
    /// Gaussians of captures that contribute, nearest first.
    pub gaussians: Vec<ProbedGaussian>,
    /// Linear colour, shaded, and premultiplied by the coverage; `None` where nothing is hit.
    pub colour: Option<DVec3>,
    /// 1 where an opaque surface is hit, 0 where nothing is.
    pub coverage: f64,
    /// Mean depth and normal (world axes) of what contributes. Captures and volumes have no normal.
    pub surface: Option<(f64, DVec3)>,
}

/// A surfel or a triangle on a probed ray.
#[derive(Clone, Debug)]
pub struct ProbedHit {
    /// Name of the object.
    pub object: String,
    /// Number of the surfel in the model, or of the triangle in its mesh; `None` for an ideal sphere.
    pub surfel: Option<u32>,
    /// It is a triangle.
    pub is_triangle: bool,
    /// Camera depth of its plane on the ray.
    pub depth: f64,
    /// Position on the surfel in units of its axes, or weights of the triangle's second and third corner.
    pub uv: [f64; 2],
    /// Kernel weight.
    pub weight: f64,
    /// Depth tolerance of its object, world units.
    pub epsilon: f64,
    /// True if the surfel contributes: its depth is at most T and, if it is opaque, within its own tolerance of the
    /// nearest opaque one; a see-through surfel has a layer.
    pub admitted: bool,
    /// Layer of a see-through surfel, 1 the nearest; `None` for an opaque one, and behind the last layer.
    pub layer: Option<usize>,
    /// Opacity, in [0, 1].
    pub opacity: f64,
    /// True if it is seen from behind.
    pub back: bool,
    /// Linear colour before shading.
    pub colour: DVec3,
    /// Unit normal, world axes.
    pub normal: DVec3,
}

/// A Gaussian on a probed ray.
#[derive(Clone, Debug)]
pub struct ProbedGaussian {
    /// Name of the object.
    pub object: String,
    /// Number of the Gaussian in the capture.
    pub index: usize,
    /// Camera depth of its centre.
    pub depth: f64,
    /// Share of the light behind it that it hides, 1/255 to 0.99.
    pub alpha: f64,
    /// Share of its light that what is before it lets through.
    pub transmittance: f64,
    /// Colour in the space of the capture.
    pub colour: DVec3,
}

/// One pixel, and one of its samples if that was asked for.
#[derive(Clone, Debug)]
pub struct Probe {
    /// Column and row.
    pub pixel: [u32; 2],
    /// Number of samples taken.
    pub samples: u64,
    /// Coverage of all samples: where nothing is see-through the number of samples that hit something.
    pub hits: f64,
    /// r, g, b as the picture has them (premultiplied, over its background), and coverage.
    pub mean: [f64; 4],
    /// The same for each scrambling alone.
    pub scramblings: [[f64; 4]; SCRAMBLINGS],
    /// Standard error of `mean`, as in the picture's layer of errors.
    pub error: [f64; 4],
    /// The sample that was asked for.
    pub sample: Option<Sample>,
}

/// Samples pixel (x, y) of a frame as [`super::render()`] does, and shows its sample number `sample`.
///
/// # Errors
/// The number of samples does not suit the scramblings, or the pixel or the sample is outside.
pub fn probe(
    scene: &Scene,
    frame: impl Into<FrameNumber>,
    options: &ReferenceOptions,
    pixel: [u32; 2],
    sample: Option<u64>,
) -> Result<Probe, ReferenceError> {
    options.check()?;
    let (frame, scene) = options.enter(scene, frame.into())?;
    let scene = &*scene;
    let samples = options.samples;
    let [width, height] = [scene.image.width, scene.image.height];
    if pixel[0] >= width || pixel[1] >= height {
        return Err(ReferenceError::NoPixel { x: pixel[0], y: pixel[1], width, height });
    }
    if let Some(sample) = sample.filter(|&sample| sample >= samples) {
        return Err(ReferenceError::NoSample { sample, samples });
    }
    let world = World::new(scene, frame, options, (&|_| (), None))?;
    // The neighbours are sampled too, because the error depends on what they saw.
    let origin = pixel.map(|c| c.saturating_sub(1));
    let [w, h] = [0, 1].map(|axis| (pixel[axis] + 2).min([width, height][axis]) - origin[axis]);
    let backdrop = world.backdrop(frame.get(), origin, [w, h]);
    let integrator = Integrator::new(&world, frame, origin, &backdrop);
    let mut sums = Sums::new([w, h], &[])?;
    integrator.add(&mut sums, samples, None, &|_| ());
    let at = ((pixel[1] - origin[1]) * w + pixel[0] - origin[0]) as usize;
    let scramblings = sums.seen(at, &backdrop);
    let mean = mean(&scramblings);
    let error = sums.error(at, &backdrop);
    let hits = sums.hits(at);
    let sample = sample.map(|number| {
        let (k, each) = (number / SCRAMBLINGS as u64, samples / SCRAMBLINGS as u64);
        let points = Points::new(options.sampler, options.look.seed, k, k + 1, each);
        let of_pixel = points.pixel(integrator.number(pixel));
        let scrambling = of_pixel.scrambling((number % SCRAMBLINGS as u64) as usize);
        let point = integrator.sample_point(pixel, scrambling.at(k), scrambling.lights(k));
        let mut candidates = Candidates::default();
        integrator.cones.candidates(&world, pixel.map(|c| c as usize), [1, 1], &mut candidates);
        let mut tracer = Tracer::new(&world);
        tracer.hits(&[point], &candidates, &integrator.cones);
        look(&world, &mut tracer, number, point)
    });
    Ok(Probe { pixel, samples, hits, mean, scramblings, error, sample })
}

fn look(world: &World<'_>, tracer: &mut Tracer<'_, '_>, number: u64, point: SamplePoint) -> Sample {
    let SamplePoint { film, time, .. } = point;
    let camera = world.camera(time);
    let direction = world.direction(film);
    let limit = tracer.found[0].limit;
    let mut hits: Vec<ProbedHit> = Vec::new();
    let mut all = tracer.found[0].hits.clone();
    let mut surfaces = Surfaces::default();
    surfaces.add(tracer, 0);
    all.extend(&tracer.found[0].see_through);
    for hit in &all {
        let body = &world.bodies[hit.object as usize];
        let Some(target) = tracer.target(0, hit) else { continue };
        let surface = HitPoint::of(world, target, hit);
        let layer = surfaces.layers(0).iter().position(|layer| hit.depth <= layer.limit);
        let layer = layer.filter(|_| body.see_through);
        hits.push(ProbedHit {
            object: body.object.name.clone(),
            surfel: (!matches!(body.form, Form::Sphere(_))).then_some(hit.element),
            is_triangle: world.surface(body).is_some(),
            depth: hit.depth,
            uv: [hit.u, hit.v],
            weight: hit.weight(),
            epsilon: target.pose.epsilon,
            admitted: if body.see_through { layer.is_some() } else { tracer.shows(0, hit) },
            layer: layer.map(|layer| layer + 1),
            opacity: if body.see_through { world.opacity(hit) } else { 1.0 },
            back: hit.back,
            colour: surface.colour.as_dvec3(),
            normal: surface.normal,
        });
    }
    hits.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let mut taken = Vec::new();
    if world.is_see_through() {
        let mut veil = Veil::new(world);
        veil.taken = Some(taken);
        veil.composite(&[point], &mut surfaces);
        taken = veil.taken.unwrap_or_default();
    }
    let seen = surfaces.opaque[0].filter(|seen| seen.coverage > 0.0);
    let of_capture = |taken: Taken| ProbedGaussian {
        object: world.bodies[world.captures[taken.capture].body].object.name.clone(),
        index: taken.index,
        depth: taken.depth,
        alpha: taken.alpha,
        transmittance: taken.transmittance,
        colour: taken.colour,
    };
    Sample {
        number,
        film,
        time,
        ray: [camera.eye, camera.world_from_camera * direction],
        limit,
        hits,
        gaussians: taken.into_iter().map(of_capture).collect(),
        colour: seen.map(|seen| seen.colour),
        coverage: seen.map_or(0.0, |seen| seen.coverage),
        surface: seen.map(|seen| (seen.depth / seen.coverage, seen.normal / seen.coverage)),
    }
}

impl fmt::Display for Probe {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "pixel {}, {}: {} of {} samples hit something",
            self.pixel[0], self.pixel[1], self.hits, self.samples
        )?;
        writeln!(f, "r g b of the picture (linear, premultiplied), coverage: {}", numbers(&self.mean))?;
        writeln!(f, "standard error: {}", numbers(&self.error))?;
        let Some(sample) = &self.sample else {
            for (r, mean) in self.scramblings.iter().enumerate() {
                writeln!(f, "  scrambling {r:>2}: {}", numbers(mean))?;
            }
            return Ok(());
        };
        writeln!(f, "sample {} (scrambling {}):", sample.number, sample.number % SCRAMBLINGS as u64)?;
        writeln!(f, "  film point {}, scene time {} frames", numbers(&sample.film), sample.time)?;
        let [eye, direction] = sample.ray.map(|v| numbers(&v.to_array()));
        writeln!(f, "  eye {eye}, direction of depth 1 {direction}")?;
        for hit in &sample.hits {
            let kind = if hit.is_triangle { "triangle" } else { "surfel" };
            let what = hit.surfel.map_or_else(|| "ideal sphere".to_owned(), |i| format!("{kind} {i}"));
            writeln!(
                f,
                "  {} `{}` {what}: depth {}, u v {}, weight {:.6}, epsilon {}{}{}, colour {}, normal {}",
                if hit.admitted { "takes " } else { "leaves" },
                hit.object,
                hit.depth,
                numbers(&hit.uv),
                hit.weight,
                hit.epsilon,
                if hit.back { ", from behind" } else { "" },
                hit.layer.map_or_else(String::new, |layer| format!(", layer {layer}, opacity {:.6}", hit.opacity)),
                numbers(&hit.colour.to_array()),
                numbers(&hit.normal.to_array()),
            )?;
        }
        for gaussian in &sample.gaussians {
            writeln!(
                f,
                "  takes  `{}` Gaussian {}: depth {}, alpha {:.6}, transmittance {:.6}, colour {}",
                gaussian.object,
                gaussian.index,
                gaussian.depth,
                gaussian.alpha,
                gaussian.transmittance,
                numbers(&gaussian.colour.to_array()),
            )?;
        }
        if let (Some(colour), Some((depth, normal))) = (sample.colour, sample.surface) {
            writeln!(f, "  T {}, mean depth {depth}, normal {}", sample.limit, numbers(&normal.to_array()))?;
            writeln!(f, "  colour {}", numbers(&colour.to_array()))
        } else {
            writeln!(f, "  nothing is hit")
        }
    }
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(|v| format!("{v:.9}")).collect::<Vec<_>>().join(" ")
}

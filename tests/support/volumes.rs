//! Pictures of volumes by the definition, in f64: each ray is marched through the sum of all kernels (Zwicker et al.
//! 2002, eq. 9). Shares no mathematics with the renderer, and of the library only what a model holds.

use glam::{DMat3, DVec3, Quat, Vec3};
use splatblur::model::{Gaussians, Optics};

use super::Random;

/// A pinhole camera; y is up.
pub struct VolumeCamera {
    pub eye: DVec3,
    pub at: DVec3,
    /// Vertical angle of view, degrees.
    pub fovy: f64,
    /// Width and height, pixels.
    pub size: [u32; 2],
}

/// Kernels farther from a ray than this many standard deviations do not count.
const REACH: f64 = 7.0;

impl VolumeCamera {
    /// Unit direction through a point of the film, pixels.
    fn direction(&self, [x, y]: [f64; 2]) -> DVec3 {
        let [width, height] = self.size.map(f64::from);
        let forward = (self.at - self.eye).normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let up = right.cross(forward);
        let focal = height / 2.0 / (self.fovy.to_radians() / 2.0).tan();
        (forward + right * ((x - width / 2.0) / focal) - up * ((y - height / 2.0) / focal)).normalize()
    }
}

/// What a ray meets of one kernel: a Gaussian along it.
struct OnRay {
    /// Integral over the ray.
    depth: f64,
    middle: f64,
    sigma: f64,
    colour: DVec3,
}

/// The volume before black at the centre of each pixel: premultiplied linear red, green and blue, and alpha.
pub fn picture(gaussians: &Gaussians, view: &VolumeCamera) -> Vec<[f64; 4]> {
    let [width, height] = view.size;
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
    pixels.map(|at| pixel(gaussians, view, at)).collect()
}

/// The same at the centre of one pixel.
pub fn pixel(gaussians: &Gaussians, view: &VolumeCamera, at: [u32; 2]) -> [f64; 4] {
    march(gaussians, view.eye, view.direction(at.map(|p| f64::from(p) + 0.5)))
}

fn march(gaussians: &Gaussians, eye: DVec3, direction: DVec3) -> [f64; 4] {
    let mut met: Vec<OnRay> = (0..gaussians.len()).filter_map(|i| on_ray(gaussians, i, eye, direction)).collect();
    met.sort_by(|a, b| (a.middle - REACH * a.sigma).total_cmp(&(b.middle - REACH * b.sigma)));
    let Some(first) = met.first() else { return [0.0; 4] };
    let start = first.middle - REACH * first.sigma;
    let end = met.iter().map(|k| k.middle + REACH * k.sigma).fold(start, f64::max);
    let step = met.iter().map(|k| k.sigma).fold(f64::INFINITY, f64::min) / 8.0;
    let (mut light, mut through) = (DVec3::ZERO, 1.0);
    let mut active: Vec<&OnRay> = Vec::new();
    let mut rest = met.iter().peekable();
    let mut s = start + step / 2.0;
    while s < end + step {
        while let Some(next) = rest.next_if(|next| next.middle - REACH * next.sigma <= s) {
            active.push(next);
        }
        active.retain(|k| k.middle + REACH * k.sigma >= s);
        let (mut sum, mut colour) = (0.0, DVec3::ZERO);
        for k in &active {
            let z = (s - k.middle) / k.sigma;
            let extinction = k.depth * (-0.5 * z * z).exp() / (k.sigma * std::f64::consts::TAU.sqrt());
            sum += extinction;
            colour += extinction * k.colour;
        }
        if sum > 0.0 {
            let alpha = 1.0 - (-sum * step).exp();
            light += through * alpha * (colour / sum);
            through *= 1.0 - alpha;
        }
        s += step;
    }
    [light.x, light.y, light.z, 1.0 - through]
}

fn on_ray(gaussians: &Gaussians, index: usize, eye: DVec3, direction: DVec3) -> Option<OnRay> {
    let sigma = gaussians.sigma[index].as_dvec3();
    let axes = DMat3::from_quat(gaussians.rotation[index].as_dquat().normalize());
    // In the axes of the kernel, in units of its standard deviations.
    let d = axes.transpose() * direction / sigma;
    let p = axes.transpose() * (eye - gaussians.position[index].as_dvec3()) / sigma;
    let middle = -p.dot(d) / d.length_squared();
    let q = (p + d * middle).length_squared();
    if q > REACH * REACH || middle < 0.0 {
        return None;
    }
    let mass = f64::from(gaussians.opacity[index]);
    let peak = mass / (std::f64::consts::TAU.powf(1.5) * sigma.element_product());
    let on_ray = 1.0 / d.length();
    Some(OnRay {
        depth: peak * (-0.5 * q).exp() * on_ray * std::f64::consts::TAU.sqrt(),
        middle,
        sigma: on_ray,
        colour: gaussians.colour(index).as_dvec3(),
    })
}

/// A wave: direction times frequency, and phase.
fn waves(random: &mut Random, count: usize, most: f64) -> Vec<(DVec3, f64)> {
    let mut wave = || (random.direction() * random.within(1.0, most), random.within(0.0, std::f64::consts::TAU));
    (0..count).map(|_| wave()).collect()
}

/// A cloud in the cube from -1 to 1 with `cells` cells a side: soft, ragged or like chequers, of two colours, thin or
/// nearly opaque, with light of its own or with normals.
pub fn cloud(random: &mut Random, cells: u32) -> Gaussians {
    let spacing = 2.0 / f64::from(cells);
    let shape = waves(random, 3, 8.0);
    let paint = waves(random, 2, 0.4 * f64::from(cells));
    let (ragged, hard) = (random.within(0.0, 0.4), random.next() < 0.3);
    let grain = if random.next() < 0.3 { random.within(0.0, 1.0) } else { 0.0 };
    let colours = [0, 1].map(|_| Vec3::new(random.next() as f32, random.next() as f32, random.next() as f32));
    let (depth, kernel) = (random.within(1.0, 30.0), random.within(0.5, 0.8));
    let lit = random.next() < 0.4;
    let value = |p: DVec3| {
        let waves: f64 = shape.iter().map(|(wave, phase)| (wave.dot(p) + phase).sin()).sum();
        let inside = 0.8 - p.length() + ragged * waves;
        if hard { f64::from(inside > 0.0) } else { (inside / 0.3).clamp(0.0, 1.0) }
    };
    let mut made = Gaussians {
        optics: Optics::Extinction { layer: (1.25 * spacing) as f32 },
        linear: true,
        ..Gaussians::default()
    };
    for i in 0..cells.pow(3) {
        let cell = [i % cells, i / cells % cells, i / cells.pow(2)];
        let p = DVec3::from_array(cell.map(|x| (f64::from(x) + 0.5) * spacing - 1.0));
        let extinction = depth * 0.5 * value(p) * (1.0 - grain * random.next());
        if extinction <= 0.0 {
            continue;
        }
        let share: f64 = paint.iter().map(|(wave, phase)| (wave.dot(p) + phase).sin()).sum();
        made.position.push(p.as_vec3());
        made.sigma.push(Vec3::splat((kernel * spacing) as f32));
        made.rotation.push(Quat::IDENTITY);
        made.opacity.push((extinction * spacing.powi(3)) as f32);
        let colour = colours[0].lerp(colours[1], (0.5 + 0.5 * share).clamp(0.0, 1.0) as f32);
        made.base.push(Gaussians::base_of(colour));
        if lit {
            let step = |axis: DVec3| value(p - axis * spacing) - value(p + axis * spacing);
            let normal = DVec3::new(step(DVec3::X), step(DVec3::Y), step(DVec3::Z));
            made.normal.push(normal.normalize_or_zero().as_vec3());
        }
    }
    made
}

//! The environment as background: a picture of its own, behind the film.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec3, Mat3, Vec3};
use rayon::prelude::*;

use crate::environment::{Environment, Surroundings};
use crate::math::{angle_between, focal_length};
use crate::options::PixelFilter;
use crate::scene::Scene;
use crate::scene::pose::camera_from_world;
use crate::time::FrameNumber;

/// Fewest and most times of the exposure at which a camera that turns sees the environment: multiples of four, so that
/// each half is its own mirror image.
const TIMES: [u32; 2] = [16, 128];
/// Pixels by which the environment moves on the image from one of them to the next, as far as there may be so many.
const STEP: f64 = 2.0;
/// Shorter paths are none, pixels.
const STILL: f64 = 0.01;
/// Parts of the exposure in which the camera turns by less than half a turn.
const PARTS: u32 = 64;

/// Most pixels of the map that a pixel of the image covers along an axis and that are looked up one by one.
const FEW: f64 = 4.0;

/// The environment behind a frame. It is averaged over the exposure on its own: where a camera turns while objects
/// cover it in part, what shows beside them is that mean.
#[derive(Clone, Debug)]
pub struct Panorama {
    environment: Environment,
    surroundings: Surroundings,
    /// Camera axes in world space, at times of equal weight: of all pixels, or of each row or column that is read out
    /// by itself.
    cameras: Vec<Vec<Mat3>>,
    /// The axis along which pixels are read out: 0 for columns, 1 for rows.
    readout: usize,
    size: [u32; 2],
    focal: f32,
    /// Pixel at which the camera's axis meets the image.
    axis: [f32; 2],
    /// Variance of the pixel filter along an axis, pixels^2.
    variance: f32,
    /// Places within a pixel at which the map itself is looked up, pixels; where the camera moves, one for each time.
    /// None where a pixel covers many of the map: there the filtered map serves, whose filter would soften fewer.
    offsets: Vec<[f32; 2]>,
}

impl Panorama {
    /// The panorama of frame `number`, or of one instant of it, `at` (scene time, frames). `None` where the environment
    /// is not the background.
    pub fn of(scene: &Scene, number: FrameNumber, at: Option<f64>, filter: PixelFilter) -> Option<Self> {
        let environment = scene.panorama()?;
        let size = [scene.image.width, scene.image.height];
        let readout = scene.shutter.readout.direction.axis();
        let focal = focal_length(f64::from(scene.image.height), scene.camera.fovy);
        // Pixels of the map along an axis of a pixel in the middle of the image.
        let covered = environment.map().width() as f64 / (TAU * focal);
        // The farthest corner of the image moves fastest.
        let farthest = [0, 1].map(|i| (0.5 + scene.camera.shift[i].abs()) * f64::from(size[i]));
        let longest = focal.hypot(farthest[0]).hypot(farthest[1]);
        let path = if at.is_some() { 0.0 } else { turn(scene, number) * longest };
        let times = if path > STILL { ((path / STEP) as u32).next_multiple_of(4).clamp(TIMES[0], TIMES[1]) } else { 1 };
        let cameras = cameras(scene, number, at, times, size[readout]);
        let of_filter = if filter == PixelFilter::Point { PixelFilter::Box } else { filter };
        Some(Self {
            environment: environment.clone(),
            surroundings: environment.surroundings(),
            cameras,
            readout,
            size,
            axis: [0, 1].map(|i| ((0.5 + scene.camera.shift[i]) * f64::from(size[i])) as f32),
            focal: focal as f32,
            variance: match filter {
                PixelFilter::Box | PixelFilter::Point => 1.0 / 12.0,
                PixelFilter::Gaussian { sigma } => (sigma * sigma) as f32,
            },
            offsets: match filter {
                _ if covered > FEW => Vec::new(),
                _ if times > 1 => in_halves(&of_filter.offsets(times, 0)),
                PixelFilter::Box | PixelFilter::Point => of_filter.offsets(if covered > 1.0 { 16 } else { 4 }, 0),
                PixelFilter::Gaussian { .. } => filter.offsets(16, 0),
            },
        })
    }

    /// Linear Rec.709, row by row.
    pub fn picture(&self) -> Vec<[f32; 3]> {
        self.pixels(|_| true)
    }

    /// The same from either half of the times, each its own mirror image; `None` where there is one time. Their mean is
    /// the picture.
    pub fn halves(&self) -> Option<[Vec<[f32; 3]>; 2]> {
        let several = self.cameras.first().is_some_and(|times| times.len() > 1);
        several.then(|| [0, 1].map(|half| self.pixels(|time| half_of(time) == half)))
    }

    /// Means over the times that are `taken`.
    fn pixels(&self, taken: impl Fn(usize) -> bool + Sync) -> Vec<[f32; 3]> {
        let [width, height] = self.size;
        let rows = (0..height).into_par_iter();
        let of_row = |y: u32| (0..width).map(move |x| [x as f32, y as f32]);
        rows.flat_map_iter(|y| of_row(y).map(|pixel| self.pixel(pixel, &taken).to_array())).collect()
    }

    fn pixel(&self, pixel: [f32; 2], taken: &impl Fn(usize) -> bool) -> Vec3 {
        let towards = |camera: &Mat3, dx: f32, dy: f32| {
            let [x, y] = [0, 1].map(|axis| pixel[axis] + 0.5 - self.axis[axis]);
            (*camera * Vec3::new(x + dx, -(y + dy), -self.focal)).normalize()
        };
        let mut sum = Vec3::ZERO;
        let read = (pixel[self.readout] as usize).min(self.cameras.len().saturating_sub(1));
        let Some(cameras) = self.cameras.get(read) else { return sum };
        if let ([camera], false) = (cameras.as_slice(), self.offsets.is_empty()) {
            let radiance = |&[dx, dy]: &[f32; 2]| self.environment.radiance(towards(camera, dx, dy).as_dvec3());
            let all: DVec3 = self.offsets.iter().map(radiance).sum();
            return (all / self.offsets.len() as f64).as_vec3();
        }
        let mut times = 0;
        for (i, camera) in cameras.iter().enumerate().filter(|(i, _)| taken(*i)) {
            times += 1;
            if let Some(&[dx, dy]) = self.offsets.get(i) {
                sum += self.environment.radiance_nearly(towards(camera, dx, dy));
                continue;
            }
            let middle = towards(camera, 0.0, 0.0);
            let beside = towards(camera, 1.0, 0.0).distance_squared(middle);
            let below = towards(camera, 0.0, 1.0).distance_squared(middle);
            // What passes by between two times is a part of the exposure, too.
            let next = cameras.get(i + 1).or_else(|| cameras.get(i.wrapping_sub(1)));
            let travelled = next.map_or(0.0, |next| towards(next, 0.0, 0.0).distance_squared(middle));
            let variance = 0.5 * self.variance * (beside + below) + travelled / 24.0;
            sum += self.surroundings.radiance(middle.to_array(), variance);
        }
        sum / times.max(1) as f32
    }
}

/// The half that a time belongs to: the outer two of four to one.
const fn half_of(time: usize) -> usize {
    time.div_ceil(2) % 2
}

/// The offsets of all times, so that those of each half follow one another in `offsets` and cover the pixel evenly.
fn in_halves(offsets: &[[f32; 2]]) -> Vec<[f32; 2]> {
    (0..offsets.len()).map(|time| offsets[half_of(time) * offsets.len() / 2 + time / 2]).collect()
}

/// By how much the camera turns during an exposure, radians, all turns together.
fn turn(scene: &Scene, number: FrameNumber) -> f64 {
    if scene.camera.rests() {
        return 0.0;
    }
    let delays = scene.shutter.readout.some_delays();
    let of_delay = |&delay: &f64| {
        let at = |i: u32| scene.shutter.frame_time(number.get(), f64::from(i) / f64::from(PARTS)) + delay;
        let turns = (0..=PARTS).map(|i| DQuat::from_mat4(&camera_from_world(scene, at(i)))).collect::<Vec<_>>();
        turns.windows(2).map(|pair| angle_between(pair[0], pair[1])).sum::<f64>()
    };
    delays.iter().map(of_delay).fold(0.0, f64::max)
}

/// [`Panorama::cameras`]: at `at`, or at so many `times` of the exposure; for each of `pixels` that are read out one
/// after another while the camera moves, else for all at once.
fn cameras(scene: &Scene, number: FrameNumber, at: Option<f64>, times: u32, pixels: u32) -> Vec<Vec<Mat3>> {
    let even = || {
        let shares: Vec<f64> = (0..times).map(|i| (f64::from(i) + 0.5) / f64::from(times)).collect();
        let times = scene.shutter.times_of(&shares).into_iter();
        times.map(|(t, _)| scene.shutter.frame_time(number.get(), t)).collect()
    };
    let times: Vec<f64> = at.map_or_else(even, |time| vec![time]);
    let camera = |time: f64| DMat3::from_mat4(camera_from_world(scene, time)).transpose().as_mat3();
    let readout = &scene.shutter.readout;
    let delays: Vec<f64> = if readout.rolls() && !scene.camera.rests() {
        (0..pixels).map(|pixel| readout.delay((f64::from(pixel) + 0.5) / f64::from(pixels))).collect()
    } else {
        vec![0.0]
    };
    let of_delay = |delay: f64| times.iter().map(|time| camera(time + delay)).collect();
    delays.into_iter().map(of_delay).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may stop")]
mod tests {
    use super::*;
    use crate::environment::studio;
    use crate::sampling::pixel_offsets;
    use crate::scene::Motion;
    use crate::time::Weight;

    /// Nothing but a studio behind an image of `size` pixels.
    fn studio_alone(size: [u32; 2]) -> Scene {
        let mut scene = Scene::new([]);
        let mut environment = Environment::new(studio());
        environment.background = true;
        scene.environment = Some(environment);
        [scene.image.width, scene.image.height] = size;
        scene
    }

    /// Before a resting camera that magnifies the map, a pixel is the mean of the map over its square.
    #[test]
    fn a_magnified_map_stays_sharp() {
        let mut scene = studio_alone([96, 64]);
        let environment = scene.environment.clone().unwrap();
        scene.camera.fovy = 15.0_f64.to_radians();
        let sharp = Panorama::of(&scene, 0.into(), None, PixelFilter::Box);
        let soft = sharp.clone().map(|panorama| Panorama { offsets: Vec::new(), ..panorama });
        let world_from_camera = DMat3::from_mat4(camera_from_world(&scene, 0.0)).transpose();
        let focal = focal_length(64.0, scene.camera.fovy);
        let offsets = pixel_offsets(256, 7);
        let wanted = |at: usize| {
            let [x, y] = [(at % 96) as f64 + 0.5 - 48.0, (at / 96) as f64 + 0.5 - 32.0];
            let towards = |[dx, dy]: [f32; 2]| DVec3::new(x + f64::from(dx), -(y + f64::from(dy)), -focal);
            let radiance = |&offset: &[f32; 2]| environment.radiance(world_from_camera * towards(offset).normalize());
            (offsets.iter().map(radiance).sum::<DVec3>() / 256.0).as_vec3()
        };
        let error = |panorama: &Option<Panorama>| {
            let found = panorama.as_ref().map(Panorama::picture).unwrap_or_default();
            assert_eq!(found.len(), 96 * 64);
            let square =
                |(at, found): (usize, &[f32; 3])| f64::from((wanted(at) - Vec3::from(*found)).length_squared());
            (found.iter().enumerate().map(square).sum::<f64>() / (3 * found.len()) as f64).sqrt()
        };
        let (sharp, soft) = (error(&sharp), error(&soft));
        println!("root mean square {sharp:.5}, with the filtered map {soft:.5}");
        assert!(sharp < 0.25 * soft, "{sharp}, with the filtered map {soft}");
    }

    /// Whatever the weight of the shutter, the mean of both halves is the picture, and neither is dark.
    #[test]
    fn halves_weigh_the_same() {
        let peak = [(0.49, 0.0), (0.5, 1.0), (0.51, 0.0)];
        for weight in [Weight::Box, Weight::Exponential { rate: 5.0, centre: 0.0 }, Weight::Curve(peak.to_vec())] {
            let mut scene = studio_alone([48, 32]);
            scene.camera.motions.push(Motion::Rotation { axis: DVec3::Y, per_frame: 0.3, centre: DVec3::ZERO });
            scene.shutter.weight = weight;
            let panorama = Panorama::of(&scene, 0.into(), None, PixelFilter::Box).unwrap();
            let whole = panorama.picture();
            let halves = panorama.halves().unwrap();
            for (at, wanted) in whole.iter().enumerate() {
                let of_halves = [halves[0][at], halves[1][at]].map(Vec3::from);
                let wanted = Vec3::from(*wanted);
                let mean = 0.5 * (of_halves[0] + of_halves[1]);
                assert!((mean - wanted).abs().max_element() <= 1e-5 * (1.0 + wanted.max_element()), "pixel {at}");
                assert!(of_halves.iter().all(|half| half.max_element() > 0.0));
            }
        }
    }
}

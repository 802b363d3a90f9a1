//! Random moving scenes from a seed: what the promises of mode auto are measured on.
//!
//! One to three objects move by up to 3 units and turn by up to 400 degrees an exposure. Some rest, blink, jump, or
//! follow keys inside the shutter; some scenes have a moving camera or a fence. All five weights occur.

use std::fmt::Write as _;
use std::path::Path;

use glam::{DVec3, Quat, Vec3};
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use splatblur::anim::{self, Interpolation};
use splatblur::environment::{Environment, studio};
use splatblur::math::Trs;
use splatblur::model::{self, Gaussians, Material};
use splatblur::scene::{AnimationBinding, Light, Motion, Object, Scene, Shape};
use splatblur::time::Weight;

use super::{default_lights, object, round_surfels, scene, sphere};

/// Models that random scenes share.
pub struct Models {
    ball: Shape,
    fence: Shape,
    wall: Shape,
    cow: Shape,
    statue: Shape,
    guitar: Shape,
    stick: Shape,
    studio: Environment,
}

impl Models {
    /// Reads the shipped ones, and makes the others.
    pub fn load() -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/models");
        let shipped = |name: &str| {
            let loaded = model::load(&folder.join(name), &model::LoadOptions::default(), &|_, _| {});
            Shape::from(loaded.expect("a shipped model"))
        };
        Self {
            ball: sphere(5000).spatially_ordered().into(),
            fence: slats().spatially_ordered().into(),
            wall: chequers().spatially_ordered().into(),
            cow: shipped("spot.sfl"),
            statue: shipped("guanyin.sfl"),
            studio: Environment::new(studio()),
            stick: stick().spatially_ordered().into(),
            guitar: thinned(&shipped("guitar.compressed.ply")),
        }
    }
}

/// Every sixth Gaussian of the guitar, larger, upright, about 2 high about the origin.
fn thinned(guitar: &Shape) -> Shape {
    let whole = guitar.gaussians().expect("a capture").gaussians();
    let every = |i: &usize| i.is_multiple_of(6);
    let picked: Vec<usize> = (0..whole.len()).filter(every).collect();
    let upright = Quat::from_rotation_x(std::f32::consts::PI);
    Gaussians {
        position: picked.iter().map(|&i| upright * (whole.position[i] - Vec3::new(0.0, -2.0, 0.0)) * 0.5).collect(),
        sigma: picked.iter().map(|&i| whole.sigma[i] * 0.5 * 1.8).collect(),
        rotation: picked.iter().map(|&i| upright * whole.rotation[i]).collect(),
        opacity: picked.iter().map(|&i| whole.opacity[i]).collect(),
        base: picked.iter().map(|&i| whole.base[i]).collect(),
        ..Gaussians::default()
    }
    .into()
}

/// Seven slats in z = 0, 0.2 wide, 2.4 high and 0.5 apart.
fn slats() -> splatblur::model::Surfels {
    let places = (0..7).flat_map(|slat| (0..8).flat_map(move |i| (0..96).map(move |k| (slat, i, k))));
    round_surfels(places.map(|(slat, i, k)| {
        let x = (f64::from(slat) - 3.0) * 0.7 + (f64::from(i) - 3.5) * 0.025;
        (DVec3::new(x, (f64::from(k) - 47.5) * 0.025, 0.0), DVec3::Z, 0.03, Vec3::new(0.8, 0.45, 0.06))
    }))
}

/// An upright stick, 2 high and 0.03 wide.
fn stick() -> splatblur::model::Surfels {
    let places = (0..3).flat_map(|i| (0..200).map(move |k| (i, k)));
    round_surfels(places.map(|(i, k)| {
        let place = DVec3::new((f64::from(i) - 1.0) * 0.01, (f64::from(k) - 99.5) * 0.01, 0.0);
        (place, DVec3::Z, 0.01, Vec3::new(0.9, 0.85, 0.7))
    }))
}

/// A square of side 4 in z = 0, in cells of 0.5.
fn chequers() -> splatblur::model::Surfels {
    round_surfels((0..100).flat_map(|i| (0..100).map(move |k| (i, k))).map(|(i, k)| {
        let light = (i * 8 / 100 + k * 8 / 100) % 2 == 0;
        let colour = if light { Vec3::new(0.8, 0.78, 0.7) } else { Vec3::new(0.05, 0.06, 0.1) };
        let place = DVec3::new(f64::from(i) - 49.5, f64::from(k) - 49.5, 0.0) * 0.04;
        (place, DVec3::Z, 0.05, colour)
    }))
}

/// Keys of one attribute: (frame, value), with the tangent type of all.
fn curve(out: &mut String, attribute: &str, unit: &str, tangent: &str, keys: &[(f64, f64)]) {
    let _ = write!(
        out,
        "anim {attribute} {} object1 0 1 0;\nanimData {{\n input time;\n output {unit};\n weighted 0;\n \
         preInfinity constant;\n postInfinity constant;\n keys {{\n",
        attribute.rsplit('.').next().unwrap_or_default()
    );
    for (frame, value) in keys {
        let _ = writeln!(out, "  {frame} {value} {tangent} {tangent} 1 1 0;");
    }
    out.push_str(" }\n}\n");
}

fn binding(curves: &str) -> AnimationBinding {
    let text = format!(
        "animVersion 1.1;\nmayaVersion 2008;\ntimeUnit film;\nlinearUnit cm;\nangularUnit deg;\nstartTime 0;\n\
         endTime 1;\n{curves}"
    );
    let animation = anim::parse(text.as_bytes(), Path::new("random.anim")).expect("sound keys");
    let node = animation.node(None).expect("one node").clone().into();
    AnimationBinding { path: "random.anim".into(), node, interpolation: Interpolation::default() }
}

/// A generator of numbers with words of its own.
struct Dice(Pcg64);

impl Dice {
    fn within(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.0.random::<f64>()
    }

    fn chance(&mut self, share: f64) -> bool {
        self.0.random::<f64>() < share
    }

    fn below(&mut self, n: u32) -> u32 {
        self.0.random_range(0..n)
    }

    fn direction(&mut self) -> DVec3 {
        let z = self.within(-1.0, 1.0);
        let (sin, cos) = self.within(0.0, std::f64::consts::TAU).sin_cos();
        let q = (1.0 - z * z).sqrt();
        DVec3::new(q * cos, q * sin, z)
    }

    /// Rising times within the shutter 0..1, at least `gap` apart.
    fn times(&mut self, n: u32, gap: f64) -> Vec<f64> {
        let mut times: Vec<f64> = (0..n).map(|_| self.within(0.02, 0.98 - gap * f64::from(n))).collect();
        times.sort_by(f64::total_cmp);
        times.iter().zip(0..).map(|(time, i)| time + gap * f64::from(i)).collect()
    }

    /// Keys inside the shutter: a path, jumps, or a change of visibility.
    fn keys(&mut self) -> AnimationBinding {
        let mut curves = String::new();
        match self.below(3) {
            0 => {
                let n = 2 + self.below(3);
                let times: Vec<f64> =
                    std::iter::once(0.0).chain(self.times(n, 0.08)).chain(std::iter::once(1.0)).collect();
                let tangent = ["linear", "spline", "step"][self.below(3) as usize];
                for axis in ["translate.translateX", "translate.translateY"] {
                    let keys: Vec<(f64, f64)> = times.iter().map(|&time| (time, self.within(-1.0, 1.0))).collect();
                    curve(&mut curves, axis, "linear", tangent, &keys);
                }
            }
            1 => {
                // Shown for a short time.
                let length = 0.03 * 20_f64.powf(self.within(0.0, 1.0));
                let from = self.within(0.0, 1.0 - length);
                curve(&mut curves, "visibility", "unitless", "step", &[(-1.0, 0.0), (from, 1.0), (from + length, 0.0)]);
            }
            _ => {
                // Blinks.
                let n = 2 + self.below(5);
                let first = self.below(2);
                let times = self.times(n, 0.03);
                let keys = std::iter::once((-1.0, f64::from(first)))
                    .chain(times.into_iter().zip(1..).map(|(time, i)| (time, f64::from((first + i) % 2))));
                curve(&mut curves, "visibility", "unitless", "step", &keys.collect::<Vec<_>>());
            }
        }
        binding(&curves)
    }

    fn motions(&mut self, centre: DVec3) -> Vec<Motion> {
        let mut motions = Vec::new();
        if self.chance(0.7) {
            let per_frame = self.within(-400.0, 400.0).to_radians();
            motions.push(Motion::Rotation { axis: self.direction(), per_frame, centre });
        }
        if self.chance(0.8) {
            let velocity = self.direction() * DVec3::new(1.0, 1.0, 0.6) * self.within(0.0, 3.0);
            motions.push(Motion::Linear { velocity });
        }
        motions
    }

    fn object(&mut self, models: &Models) -> Object {
        let kind = self.below(10);
        let (model, size) = match kind {
            0..4 => (&models.ball, 0.4),
            4..6 => (&models.cow, 0.6),
            6..8 => (&models.statue, 0.9),
            8 => (&models.wall, 0.5),
            _ => (&models.fence, 0.7),
        };
        let mut made = object(splatblur::model::Surfels::default());
        made.shape = model.clone();
        made.shape.surface_mut().expect("a surface").two_sided = true;
        made.shape.surface_mut().expect("a surface").material =
            Some(Material { ambient: 1.0, diffuse: 1.0, specular: 0.2, shininess: 20.0 });
        let place = DVec3::new(self.within(-1.4, 1.4), self.within(-0.8, 0.8), self.within(-1.5, 1.0));
        let turn = DVec3::new(0.0, self.within(0.0, 360.0), 0.0);
        let scale = DVec3::splat(size * self.within(0.5, 1.5));
        let animated = self.chance(0.3);
        if !self.chance(0.15) {
            made.motions = self.motions(if animated { DVec3::ZERO } else { place });
        }
        if animated {
            made.animation = Some(self.keys());
            made.transform = Trs { rotate: turn, scale, ..Trs::default() };
            made.place = Trs { translate: place, ..Trs::default() };
        } else {
            made.transform = Trs { translate: place, rotate: turn, scale, ..Trs::default() };
        }
        made
    }

    fn weight(&mut self) -> Weight {
        match self.below(7) {
            0..3 => Weight::Box,
            3 => Weight::Tent,
            4 => Weight::Gaussian { centre: 0.5, width: self.within(0.1, 0.3) },
            5 => Weight::Ramp { centre: 1.0 },
            _ => Weight::Exponential { rate: self.within(1.0, 6.0), centre: self.within(0.0, 1.0) },
        }
    }
}

/// Scene `index` of `seed`: 240 x 135 pixels, frame 0, shutter 0..1.
pub fn random(models: &Models, seed: u64, index: u64) -> Scene {
    let mut dice = Dice(Pcg64::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(index)));
    let objects = (0..=dice.below(3)).map(|_| dice.object(models)).collect();
    let mut made = scene(objects, [240, 135], DVec3::new(0.0, 0.0, 6.0), 35.0);
    for (object, number) in made.objects.iter_mut().zip(1..) {
        object.name = format!("object{number}");
    }
    made.name = format!("random_{seed}_{index}");
    made.lights = default_lights();
    made.lights.push(Light::Ambient { colour: DVec3::splat(0.1) });
    made.image.background = Vec3::new(0.5, 0.6, 0.8).as_dvec3() * dice.within(0.0, 0.6);
    made.shutter.weight = dice.weight();
    if dice.chance(0.2) {
        let mut curves = String::new();
        for (axis, middle) in [("translateX", 0.0), ("translateY", 0.0), ("translateZ", 6.0)] {
            let keys = [(0.0, middle + dice.within(-0.5, 0.5)), (1.0, middle + dice.within(-0.5, 0.5))];
            curve(&mut curves, &format!("translate.{axis}"), "linear", "linear", &keys);
        }
        let keys = [(0.0, dice.within(-6.0, 6.0)), (1.0, dice.within(-6.0, 6.0))];
        curve(&mut curves, "rotate.rotateY", "angular", "linear", &keys);
        made.camera.animation = Some(binding(&curves));
    }
    made
}

/// As [`random`], with what is hard for an estimate: motion that turns back, now and then in mid-exposure; highlights
/// of up to 10; an environment that is seen and mirrored; slivers; objects that appear or vanish.
pub fn random_hard(models: &Models, seed: u64, index: u64) -> Scene {
    let mut made = random(models, seed, index);
    let mut dice = Dice(Pcg64::seed_from_u64(seed.wrapping_mul(11_000_003).wrapping_add(index)));
    if dice.chance(0.25) {
        let mut sliver = dice.object(models);
        sliver.shape = models.stick.clone();
        sliver.transform.scale = DVec3::splat(dice.within(0.5, 1.5));
        "sliver".clone_into(&mut sliver.name);
        made.objects.push(sliver);
    }
    let count = made.objects.len() as u32;
    if dice.chance(0.35) {
        let object = &mut made.objects[dice.below(count) as usize];
        let turn = if dice.chance(0.5) { 0.5 } else { dice.within(0.1, 0.9) };
        let [x, y] = [0, 1].map(|_| dice.within(-1.0, 1.0));
        let mut curves = String::new();
        let ends = [dice.within(-1.2, 1.2), dice.within(-1.2, 1.2)];
        for ((axis, at), away) in [("X", x), ("Y", y)].into_iter().zip(ends) {
            let keys = [(0.0, at), (turn, at + away), (1.0, at)];
            curve(&mut curves, &format!("translate.translate{axis}"), "linear", "linear", &keys);
        }
        object.motions = Vec::new();
        object.transform.translate = DVec3::ZERO;
        object.animation = Some(binding(&curves));
    }
    if dice.chance(0.2) {
        let object = &mut made.objects[dice.below(count) as usize];
        let (time, first) = (dice.within(0.05, 0.95), f64::from(dice.below(2)));
        let mut curves = String::new();
        let keys = [(-1.0, first), (time, 1.0 - first)];
        curve(&mut curves, "visibility", "unitless", "step", &keys);
        if object.animation.is_none() {
            object.animation = Some(binding(&curves));
            object.place = Trs { translate: object.transform.translate, ..Trs::default() };
            object.transform.translate = DVec3::ZERO;
            object.motions = dice.motions(DVec3::ZERO);
        }
    }
    if dice.chance(0.25) {
        let specular = dice.within(2.0, 10.0) as f32;
        let object = &mut made.objects[dice.below(count) as usize];
        object.shape.surface_mut().expect("a surface").material =
            Some(Material { ambient: 1.0, diffuse: 1.0, specular, shininess: 40.0 });
    }
    if dice.chance(0.25) {
        let mut environment = models.studio.clone();
        environment.rotation = dice.within(0.0, 6.0);
        environment.background = dice.chance(0.7);
        made.environment = Some(environment);
        made.objects[dice.below(count) as usize].shape.surface_mut().expect("a surface").reflection =
            dice.within(0.1, 0.6);
    }
    made.name = format!("hard_{seed}_{index}");
    made
}

/// As [`random_hard`], over a floor or before a wall that rest, with one to three lights of any size that have shadows.
pub fn random_lit(models: &Models, seed: u64, index: u64) -> Scene {
    let mut made = random_hard(models, seed, index);
    let mut dice = Dice(Pcg64::seed_from_u64(seed.wrapping_mul(13_000_003).wrapping_add(index)));
    let mut ground = object(splatblur::model::Surfels::default());
    ground.shape = models.wall.clone();
    ground.shape.surface_mut().expect("a surface").two_sided = true;
    let scale = DVec3::splat(dice.within(1.0, 3.0));
    ground.transform = if dice.chance(0.7) {
        let translate = DVec3::new(0.0, -1.2, 0.0);
        let rotate = DVec3::new(dice.within(-100.0, -70.0), dice.within(-20.0, 20.0), 0.0);
        Trs { translate, rotate, scale, ..Trs::default() }
    } else {
        let rotate = DVec3::new(0.0, dice.within(-20.0, 20.0), 0.0);
        Trs { translate: DVec3::new(0.0, 0.0, -2.0), rotate, scale, ..Trs::default() }
    };
    "ground".clone_into(&mut ground.name);
    made.objects.push(ground);
    made.lights = vec![Light::Ambient { colour: DVec3::splat(0.3) }];
    for _ in 0..=dice.below(3) {
        let colour = DVec3::splat(dice.within(0.3, 0.9));
        let from = DVec3::new(dice.within(-1.5, 1.5), 1.0, dice.within(-0.5, 2.0));
        // From a point to what is a quarter of the sky wide.
        let size = if dice.chance(0.2) { 0.0 } else { dice.within(0.0, 1.0).powi(2) };
        made.lights.push(if dice.chance(0.6) {
            Light::Directional { direction: -from.normalize(), colour, angle: 1.5 * size, shadows: true }
        } else {
            let position = from * dice.within(1.5, 3.0);
            let colour = colour * position.length_squared();
            Light::Point { position, colour, radius: size, shadows: true }
        });
    }
    made.name = format!("lit_{seed}_{index}");
    made
}

/// As [`random`], with some of the objects captures, at least the first.
pub fn random_with_captures(models: &Models, seed: u64, index: u64) -> Scene {
    let mut made = random(models, seed, index);
    let mut dice = Dice(Pcg64::seed_from_u64(seed.wrapping_mul(7_000_003).wrapping_add(index)));
    for (number, object) in made.objects.iter_mut().enumerate() {
        if number == 0 || dice.chance(0.4) {
            object.shape = models.guitar.clone();
            object.transform.scale = DVec3::splat(dice.within(0.5, 1.3));
        }
    }
    made.name = format!("captures_{seed}_{index}");
    made
}

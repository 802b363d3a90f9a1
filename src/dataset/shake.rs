//! Shake of a camera in a hand.

use std::fmt;
use std::str::FromStr;

use glam::{DMat3, DMat4, DVec3};

use super::noise::{Random, normal};
use crate::limits::Invalid;
use crate::math::rotation;
use crate::sampling::hash;
use crate::scene::pose::{camera_from_world, fovy};
use crate::scene::{AnimationBinding, Scene};
use crate::time::FrameNumber;

/// Shake of a camera: each picture has a random path of its own.
///
/// The path is the Markov process of Kupyn et al. (2018, "`DeblurGAN`", algorithm 1), which follows Boracchi and Foi
/// (2012, "Modeling the performance of image restoration from motion blur"): a point goes at constant speed, is pushed
/// by Gaussian impulses, is drawn back to where it began, and sometimes turns round. They have it in the plane of the
/// image. Here one point goes in the space of rotations (axis times angle), another in that of translations, along the
/// camera's axes. A path is shifted so that its mean is 0, and scaled so that its largest excursion is what is asked
/// for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shake {
    /// Largest angle by which the camera is turned within an exposure, degrees, in [0, 45].
    pub degrees: f64,
    /// Largest distance by which it is shifted, scene units, >= 0.
    pub units: f64,
}

/// A text that is no shake.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{found}` is no shake: write degrees=ANGLE (at most 45), units=DISTANCE (scene units, at most 1e9) or both with a \
     comma, as in degrees=1,units=0.02"
)]
pub struct ShakeError {
    /// The text.
    found: String,
}

/// Steps of a path, as Kupyn et al. have them, and those between two poses of the camera.
const STEPS: usize = 2000;
const STRIDE: usize = 16;

impl Shake {
    /// Most of each.
    const MOST: [f64; 2] = [45.0, 1e9];

    /// The scene of frame `frame` with the camera shaken through the exposure of all rows. Between 126 poses it turns
    /// and goes straight. `seed` and `frame` choose the path.
    ///
    /// # Errors
    /// The camera's poses are out of their bounds.
    pub(super) fn shaken(self, scene: &Scene, frame: FrameNumber, seed: u64) -> Result<Scene, Invalid> {
        let number = frame.get();
        let [first, last] = scene.shutter.whole_exposure(number);
        let mut shaken = scene.clone();
        // An instant has no room for a path.
        if first < last {
            let [turns, shifts] = [0, 1].map(|which| path(seed, number.to_bits(), which));
            let count = turns.len() - 1;
            let times: Vec<f64> = (0..=count).map(|i| first + (last - first) * i as f64 / count as f64).collect();
            let pose = |((&time, turn), shift): ((&f64, &DVec3), &DVec3)| {
                let angle = self.degrees.to_radians() * turn.length();
                let turned = turn.try_normalize().map_or(DMat3::IDENTITY, |axis| rotation(axis, angle));
                let moved = DMat4::from_mat3_translation(turned, self.units * *shift);
                camera_from_world(scene, time).inverse() * moved
            };
            let poses: Vec<DMat4> = times.iter().zip(&turns).zip(&shifts).map(pose).collect();
            shaken.camera.fovy = fovy(scene, number);
            shaken.camera.animation = Some(AnimationBinding::from_poses(scene.frames.rate, &times, &poses)?);
            shaken.camera.motions.clear();
        }
        Ok(shaken)
    }
}

/// A path of mean 0, whose largest excursion is 1.
fn path(seed: u64, frame: u64, which: u64) -> Vec<DVec3> {
    /// Probability of an impulse at a step.
    const IMPULSE: f64 = 0.001;
    /// The strength of all is a share of the step.
    const STEP: f64 = 60.0 / (STEPS - 1) as f64;
    let [high, low] = [2 * which, 2 * which + 1].map(|stream| u64::from(hash(seed ^ frame, 0x5ade + stream)));
    let mut random = Random { seed: high << 32 | low, next: 0 };
    let inertia = 0.7 * random.uniform();
    let big = 0.2 * random.uniform();
    let gaussian = 0.7 * random.uniform();
    let mut velocity = STEP * gaussian_vector(&mut random).normalize_or(DVec3::X);
    let mut place = DVec3::ZERO;
    let mut path = vec![place];
    for step in 1..=STEPS {
        let (push, chance) = (gaussian_vector(&mut random), random.uniform());
        // Twice the velocity the other way, a little turned.
        let turn = if chance < big * IMPULSE { -2.0 * velocity + 0.5 * STEP * push } else { DVec3::ZERO };
        let change = turn + IMPULSE * (gaussian * push - inertia * STEP * place);
        velocity = STEP * (velocity + change).normalize_or(DVec3::X);
        place += velocity;
        if step % STRIDE == 0 {
            path.push(place);
        }
    }
    let mean = path.iter().sum::<DVec3>() / path.len() as f64;
    let most = path.iter().map(|place| (*place - mean).length()).fold(f64::MIN_POSITIVE, f64::max);
    path.iter().map(|place| (*place - mean) / most).collect()
}

/// A vector of three Gaussian variables of variance 1.
fn gaussian_vector(random: &mut Random) -> DVec3 {
    DVec3::new(normal(random), normal(random), normal(random))
}

impl fmt::Display for Shake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "degrees={},units={}", self.degrees, self.units)
    }
}

impl FromStr for Shake {
    type Err = ShakeError;

    fn from_str(text: &str) -> Result<Self, ShakeError> {
        let refused = || ShakeError { found: text.to_owned() };
        let mut values = [None; 2];
        for part in text.split(',') {
            let (name, value) = part.split_once('=').ok_or_else(refused)?;
            let at = ["degrees", "units"].iter().position(|known| *known == name).ok_or_else(refused)?;
            let value: f64 = value.parse().map_err(|_| refused())?;
            if values[at].is_some() || !(0.0..=Self::MOST[at]).contains(&value) {
                return Err(refused());
            }
            values[at] = Some(value);
        }
        let [degrees, units] = values.map(Option::unwrap_or_default);
        if degrees == 0.0 && units == 0.0 { Err(refused()) } else { Ok(Self { degrees, units }) }
    }
}

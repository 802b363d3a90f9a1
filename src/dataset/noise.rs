//! Noise of a camera's sensor.

use std::fmt;
use std::str::FromStr;

use crate::film::Picture;
use crate::sampling::hash;
use crate::time::FrameNumber;

/// Noise of a sensor, in linear light. 0: none of that kind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// Electrons of white (light 1), >= 0: shot noise is a Poisson variable in electrons.
    pub shot: f64,
    /// Standard deviation of the read noise, as a share of white, >= 0.
    pub read: f64,
}

/// A text that is no noise.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{found}` is no noise: write shot=ELECTRONS (of white, at most 1e9), read=DEVIATION (a share of white, at most 1) \
     or both with a comma, as in shot=10000,read=0.002"
)]
pub struct NoiseError {
    /// The text.
    found: String,
}

impl Noise {
    /// Is there any?
    pub fn is_any(self) -> bool {
        self != Self::default()
    }

    /// Adds it to a picture. Each value of each pixel has numbers of its own, which depend on `seed` and `frame` alone.
    pub fn add(self, picture: &mut Picture, seed: u64, frame: FrameNumber) {
        if !self.is_any() {
            return;
        }
        let bits = frame.get().to_bits();
        let of_frame = u64::from(hash(seed ^ bits, 0)) << 32 | u64::from(hash(bits, 1));
        for (pixel, values) in (0..).zip(&mut picture.rgba) {
            for (channel, value) in (0..).zip(&mut values[..3]) {
                let random = Random { seed: seed ^ of_frame, next: (pixel * 3 + channel) * NUMBERS };
                *value = self.of(f64::from(*value), random) as f32;
            }
        }
    }

    fn of(self, light: f64, mut random: Random) -> f64 {
        let mut noisy = light;
        if self.shot > 0.0 && light > 0.0 {
            noisy = poisson(light * self.shot, &mut random) / self.shot;
        }
        if self.read > 0.0 {
            noisy += self.read * normal(&mut random);
        }
        noisy
    }
}

/// Random numbers of a value, at most.
const NUMBERS: u64 = 4;

/// Numbers that depend on their place in a row alone.
pub(super) struct Random {
    pub(super) seed: u64,
    pub(super) next: u64,
}

impl Random {
    /// In (0, 1).
    pub(super) fn uniform(&mut self) -> f64 {
        self.next += 1;
        (f64::from(hash(self.seed, self.next)) + 0.5) / 4_294_967_296.0
    }
}

/// A Gaussian variable of variance 1 (Box and Muller 1958).
pub(super) fn normal(random: &mut Random) -> f64 {
    let (radius, angle) = (random.uniform(), random.uniform());
    (-2.0 * libm::log(radius)).sqrt() * libm::cos(std::f64::consts::TAU * angle)
}

/// Mean from which on a Poisson variable is taken for a rounded Gaussian one: their distributions differ by less than
/// 0.01 there.
const MANY: f64 = 200.0;

/// A Poisson variable.
fn poisson(mean: f64, random: &mut Random) -> f64 {
    if mean >= MANY {
        return (mean + mean.sqrt() * normal(random)).round().max(0.0);
    }
    // The count at which the distribution passes a uniform number.
    let uniform = random.uniform();
    let (mut count, mut share) = (0.0, libm::exp(-mean));
    let mut below = share;
    while below < uniform && share > 0.0 {
        count += 1.0;
        share *= mean / count;
        below += share;
    }
    count
}

/// As in `shot=10000,read=0.002`; `none` where there is none.
impl fmt::Display for Noise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.shot > 0.0, self.read > 0.0) {
            (true, true) => write!(f, "shot={},read={}", self.shot, self.read),
            (true, false) => write!(f, "shot={}", self.shot),
            (false, true) => write!(f, "read={}", self.read),
            (false, false) => f.write_str("none"),
        }
    }
}

impl FromStr for Noise {
    type Err = NoiseError;

    fn from_str(text: &str) -> Result<Self, NoiseError> {
        let refused = || NoiseError { found: text.to_owned() };
        let mut noise = Self::default();
        for part in text.split(',').filter(|_| text != "none") {
            let (name, value) = part.split_once('=').ok_or_else(refused)?;
            let value: f64 = value.parse().map_err(|_| refused())?;
            let (field, most) = match name {
                "shot" => (&mut noise.shot, 1e9),
                "read" => (&mut noise.read, 1.0),
                _ => return Err(refused()),
            };
            if *field > 0.0 || !(value > 0.0 && value <= most) {
                return Err(refused());
            }
            *field = value;
        }
        Ok(noise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(light: f32, pixels: u32) -> Picture {
        Picture { width: pixels, height: 1, rgba: vec![[light, light, light, 1.0]; pixels as usize], layers: vec![] }
    }

    /// Mean and variance of a noisy grey.
    fn moments(noise: Noise, light: f32) -> [f64; 2] {
        let mut picture = grey(light, 40_000);
        noise.add(&mut picture, 7, 12.into());
        let values: Vec<f64> = picture.rgba.iter().flat_map(|p| p[..3].iter().map(|&v| f64::from(v))).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        [mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)]
    }

    /// 120,000 values: the standard error of a mean is sigma / 346, that of a variance about 0.004 of it (more for
    /// few electrons).
    #[test]
    fn mean_and_variance_are_those_of_shot_and_read_noise() {
        for (shot, read, light) in [(1000.0, 0.0, 0.5), (50.0, 0.0, 0.02), (0.0, 0.01, 0.2), (400.0, 0.02, 0.7)] {
            let [mean, variance] = moments(Noise { shot, read }, light);
            let light = f64::from(light);
            let wanted = read * read + if shot > 0.0 { light / shot } else { 0.0 };
            // Seen: at most 1.7 standard errors of the mean, and variances within 0.007.
            assert!((mean - light).abs() < 4.0 * (wanted / 120_000.0).sqrt(), "{shot} {read}: {mean}");
            assert!((variance / wanted - 1.0).abs() < 0.02, "{shot} {read}: {variance}, wanted {wanted}");
        }
    }

    #[test]
    fn numbers_depend_on_pixel_frame_and_seed_alone() {
        let noise = Noise { shot: 1000.0, read: 0.01 };
        let noisy = |seed: u64, frame: f64, pixels: u32| {
            let mut picture = grey(0.5, pixels);
            noise.add(&mut picture, seed, frame.into());
            picture.rgba
        };
        let all = noisy(1, 3.0, 64);
        assert_eq!(noisy(1, 3.0, 32), all[..32]);
        for other in [noisy(2, 3.0, 64), noisy(1, 4.0, 64), noisy(1, 3.5, 64)] {
            let same = other.iter().flatten().zip(all.iter().flatten()).filter(|(a, b)| a == b).count();
            // Alpha, and what fell together.
            assert!(same < 64 + 20, "{same}");
        }
        let mut quiet = grey(0.5, 4);
        Noise::default().add(&mut quiet, 1, 0.into());
        assert_eq!(quiet, grey(0.5, 4));
    }

    #[test]
    fn texts() {
        for text in ["none", "shot=10000,read=0.002", "shot=500", "read=0.01"] {
            assert_eq!(text.parse::<Noise>().unwrap().to_string(), text);
        }
        for text in ["", "shot", "shot=0", "shot=-1", "read=2", "shot=1,shot=2", "shot=nan", "gain=2", "shot=1e10"] {
            assert!(text.parse::<Noise>().unwrap_err().to_string().contains("shot=ELECTRONS"), "{text}");
        }
    }
}

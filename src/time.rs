//! The shutter: the exposure interval, its time weight a(t), and the time samples it is cut into.
//!
//! Times inside the shutter are t in [0, 1]; frames are `f64`.

mod frame_number;
mod readout;

pub use self::frame_number::FrameNumber;
pub use self::readout::{Anchor, Direction, Readout};

use crate::limits::{self, Invalid};

/// Time weight a(t) over the shutter, each normalised to integral 1 (thesis 3.1; formulas in docs/math.md).
#[derive(Clone, Debug, PartialEq)]
pub enum Weight {
    /// a(t) = 1.
    Box,
    /// a(t) ~ min(t, 1 - t).
    Tent,
    /// a(t) ~ 1 - |t - centre|; `centre` 1 is thesis fig. 3.1c, 2t.
    Ramp {
        /// Peak, in [0, 1].
        centre: f64,
    },
    /// a(t) ~ exp(-rate |t - centre|).
    Exponential {
        /// Decay per shutter, > 0.
        rate: f64,
        /// Peak, in [0, 1].
        centre: f64,
    },
    /// a(t) ~ 1 - exp(-|t - centre|), 0 at the centre: what the caption of thesis fig. 3.1d says, word for word.
    OneMinusExponential {
        /// Where it is 0, in [0, 1].
        centre: f64,
    },
    /// a(t) ~ exp(-(t - centre)^2 / (2 width^2)).
    Gaussian {
        /// Peak, in [0, 1].
        centre: f64,
        /// Standard deviation, in shutters, > 0.
        width: f64,
    },
    /// Drawn: linear between (t, weight) points, constant outside them. The t rise strictly, in [0, 1]; the weights are
    /// >= 0 and not all 0.
    Curve(Vec<(f64, f64)>),
}

impl Weight {
    /// The unnormalised integral of a from 0 to `t`.
    fn primitive(&self, t: f64) -> f64 {
        match self {
            Self::Box => t,
            Self::Tent => {
                if t <= 0.5 {
                    0.5 * t * t
                } else {
                    0.25 - 0.5 * (1.0 - t) * (1.0 - t)
                }
            }
            Self::Ramp { centre } => t - 0.5 * ((t - centre) * (t - centre).abs() + centre * centre),
            Self::Exponential { rate, centre } => {
                // integral of exp(-rate |s|) from 0 to s
                let half = |s: f64| -libm::expm1(-rate * s.abs()) / rate * s.signum();
                half(t - centre) - half(-centre)
            }
            Self::OneMinusExponential { centre } => {
                // integral of 1 - exp(-|s|) from 0 to s
                let half = |s: f64| s + libm::expm1(-s.abs()) * s.signum();
                half(t - centre) - half(-centre)
            }
            Self::Gaussian { centre, width } => {
                let half = |s: f64| libm::erf(s / (width * std::f64::consts::SQRT_2));
                half(t - centre) - half(-centre)
            }
            Self::Curve(points) => curve_primitive(points, t),
        }
    }

    /// The area that a drawn curve must have, in words.
    pub(crate) const AREA: &str = "some weight above 0";

    /// False for weights that are all 0, or so nearly that their integral is: they cannot be normalised.
    pub(crate) fn has_area(&self) -> bool {
        (self.integral(0.0, 1.0) - 1.0).abs() < 1e-9
    }

    /// Checks the parameters.
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        let centre = |centre| limits::UNIT.check("centre", centre);
        match self {
            Self::Box | Self::Tent => Ok(()),
            Self::Ramp { centre: c } | Self::OneMinusExponential { centre: c } => centre(*c),
            Self::Exponential { rate, centre: c } => limits::STEEPNESS.check("rate", *rate).and_then(|()| centre(*c)),
            Self::Gaussian { centre: c, width } => limits::STEEPNESS.check("width", *width).and_then(|()| centre(*c)),
            Self::Curve(points) => self.check_curve(points),
        }
    }

    fn check_curve(&self, points: &[(f64, f64)]) -> Result<(), Invalid> {
        let mut before = None;
        for (i, &(time, weight)) in points.iter().enumerate() {
            limits::UNIT.check("time", time).map_err(|e| e.within(format_args!("curve[{i}]")))?;
            limits::LIGHT.check("weight", weight).map_err(|e| e.within(format_args!("curve[{i}]")))?;
            if let Some(before) = before.replace(time).filter(|&before| time <= before) {
                let expected = format!("more than that of the point before, {before}");
                return Err(Invalid::new("time", time, expected).within(format_args!("curve[{i}]")));
            }
        }
        if points.is_empty() {
            return Err(Invalid::new("curve", "empty", "at least one point"));
        }
        if self.has_area() { Ok(()) } else { Err(Invalid::new("curve", "0 everywhere", Self::AREA)) }
    }

    /// Integral of a(t) over [from, to], a sub-interval of [0, 1]; 1 over the whole shutter.
    pub fn integral(&self, from: f64, to: f64) -> f64 {
        (self.primitive(to) - self.primitive(from)) / self.primitive(1.0)
    }

    /// The time in [0, 1] before which `share` of the exposure lies, to 2^-53: the inverse of
    /// [`integral`](Self::integral) from 0. Where a(t) is 0 around it, the first such time.
    pub fn time_of(&self, share: f64) -> f64 {
        if *self == Self::Box {
            return share.clamp(0.0, 1.0);
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..53 {
            let middle = 0.5 * (low + high);
            if self.integral(0.0, middle) < share {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }
}

/// Integral from 0 to `t` of the polyline through `points`, constant before the first and after the last.
fn curve_primitive(points: &[(f64, f64)], t: f64) -> f64 {
    let Some(&(first_t, first_w)) = points.first() else { return t };
    let mut sum = first_w * first_t.min(t);
    for pair in points.windows(2) {
        let ((t0, w0), (t1, w1)) = (pair[0], pair[1]);
        let end = t1.min(t);
        if end <= t0 {
            return sum;
        }
        let w_end = w0 + (w1 - w0) * (end - t0) / (t1 - t0);
        sum += 0.5 * (w0 + w_end) * (end - t0);
    }
    let (last_t, last_w) = points[points.len() - 1];
    sum + last_w * (t - last_t).max(0.0)
}

/// The exposure interval around a frame, in frames relative to the frame number. By default half a frame around it.
#[derive(Clone, Debug, PartialEq)]
pub struct Shutter {
    /// Opening time, frames relative to the frame number.
    pub open: f64,
    /// Closing time, > `open`; the span may exceed a frame. Renderers take `open` itself too: an instant, and no blur.
    pub close: f64,
    /// Time weight.
    pub weight: Weight,
    /// When each row or column of the image is exposed, beside the others.
    pub readout: Readout,
}

impl Default for Shutter {
    fn default() -> Self {
        Self { open: -0.25, close: 0.25, weight: Weight::Box, readout: Readout::default() }
    }
}

impl Shutter {
    /// Scene time, in frames, of shutter time `t` in [0, 1] at frame `frame`.
    pub fn frame_time(&self, frame: f64, t: f64) -> f64 {
        frame + self.open + (self.close - self.open) * t
    }

    /// Checks the times, the weight and the read-out.
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        limits::SHUTTER.check("open", self.open)?;
        limits::SHUTTER.check("close", self.close)?;
        if self.close < self.open {
            return Err(Invalid::new("close", self.close, format!("more than `open`, {}", self.open)));
        }
        limits::READOUT.check("readout.duration", self.readout.duration)?;
        self.weight.check().map_err(|e| e.within("weight"))
    }

    /// First and last scene time, in frames, at which any pixel is exposed at frame `frame`.
    pub fn whole_exposure(&self, frame: f64) -> [f64; 2] {
        let [first, last] = self.readout.delays();
        [self.frame_time(frame, 0.0) + first, self.frame_time(frame, 1.0) + last]
    }

    /// The times before which `shares` of the exposure lie, each with the same weight; weights sum to 1.
    pub fn times_of(&self, shares: &[f64]) -> Vec<(f64, f64)> {
        shares.iter().map(|&share| (self.weight.time_of(share), 1.0 / shares.len() as f64)).collect()
    }

    /// Times `t_i = (i + place)/n`, `place` in [0, 1], and their weights, the integrals of a over the strata; weights
    /// sum to 1.
    pub fn strata(&self, n: u32, place: f64) -> Vec<(f64, f64)> {
        let n_f = f64::from(n);
        (0..n)
            .map(|i| {
                let i = f64::from(i);
                ((i + place) / n_f, self.weight.integral(i / n_f, (i + 1.0) / n_f))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Formula = fn(f64) -> f64;

    fn all() -> Vec<(Weight, Formula)> {
        vec![
            (Weight::Box, |_| 1.0),
            (Weight::Tent, |t| t.min(1.0 - t)),
            (Weight::Ramp { centre: 1.0 }, |t| 2.0 * t),
            (Weight::Ramp { centre: 0.3 }, |t| 1.0 - (t - 0.3).abs()),
            (Weight::Exponential { rate: 3.0, centre: 1.0 }, |t| (-3.0 * (t - 1.0).abs()).exp()),
            (Weight::Exponential { rate: 5.0, centre: 0.4 }, |t| (-5.0 * (t - 0.4).abs()).exp()),
            (Weight::OneMinusExponential { centre: 1.0 }, |t| 1.0 - (-(t - 1.0).abs()).exp()),
            (Weight::OneMinusExponential { centre: 0.4 }, |t| 1.0 - (-(t - 0.4).abs()).exp()),
            (Weight::Gaussian { centre: 0.5, width: 0.2 }, |t| (-(t - 0.5).powi(2) / 0.08).exp()),
            (Weight::Curve(vec![(0.2, 0.0), (0.5, 2.0), (0.6, 1.0)]), |t| {
                if t < 0.2 {
                    0.0
                } else if t < 0.5 {
                    2.0 * (t - 0.2) / 0.3
                } else if t < 0.6 {
                    2.0 - (t - 0.5) / 0.1
                } else {
                    1.0
                }
            }),
        ]
    }

    #[test]
    fn the_time_of_a_share_has_that_share_before_it() {
        for (weight, _) in all() {
            for share in [0.01, 0.25, 0.5, 0.73, 0.99] {
                let t = weight.time_of(share);
                assert!((weight.integral(0.0, t) - share).abs() < 1e-12, "{weight:?} at {share}: {t}");
            }
        }
    }

    /// Midpoint rule over [from, to].
    fn quadrature(f: fn(f64) -> f64, from: f64, to: f64) -> f64 {
        let n = 200_000;
        let h = (to - from) / f64::from(n);
        (0..n).map(|i| f(from + (f64::from(i) + 0.5) * h)).sum::<f64>() * h
    }

    #[test]
    fn integrals_match_quadrature() {
        for (weight, a) in all() {
            let whole = quadrature(a, 0.0, 1.0);
            for (from, to) in [(0.0, 1.0), (0.0, 0.35), (0.35, 0.55), (0.55, 1.0), (0.31, 0.32)] {
                let want = quadrature(a, from, to) / whole;
                let got = weight.integral(from, to);
                assert!((got - want).abs() < 1e-8, "{weight:?} over {from}..{to}: {got}, quadrature {want}");
            }
        }
    }

    #[test]
    fn strata_tile_the_shutter() {
        for (weight, _) in all() {
            let shutter = Shutter { weight, ..Shutter::default() };
            let strata = shutter.strata(7, 0.5);
            assert!((strata.iter().map(|s| s.1).sum::<f64>() - 1.0).abs() < 1e-12);
            assert!((strata[3].0 - 0.5).abs() < 1e-15);
        }
    }

    #[test]
    fn times_are_relative_to_the_frame() {
        let shutter = Shutter { open: -0.5, close: 1.0, ..Shutter::default() };
        assert_eq!(shutter.frame_time(10.0, 0.0), 9.5);
        assert_eq!(shutter.frame_time(10.0, 1.0), 11.0);
    }
}

//! The flight of a camera through views that a person chose.
//!
//! Eye, point looked at, up and the logarithm of the focal length each follow a cubic Hermite curve in the time of the
//! keys, whose slopes are those of Catmull and Rom (1974). [`PathTiming`] then says at what speed the curves are run
//! through.

use glam::{DMat3, DMat4, DVec3};

/// A view at a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathKey {
    /// Frame.
    pub frame: f64,
    /// Eye point, world space.
    pub eye: DVec3,
    /// Point looked at.
    pub at: DVec3,
    /// Up direction, of any length.
    pub up: DVec3,
    /// Vertical field of view, radians.
    pub fovy: f64,
}

/// At what speed a path is flown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathTiming {
    /// The eye has one speed all the way; else each key is reached at its frame.
    pub constant_speed: bool,
    /// Frames after the first key over which the speed rises from 0.
    pub ease_in: f64,
    /// Frames before the last key over which it falls to 0.
    pub ease_out: f64,
}

/// What the camera looks at wherever it goes.
#[derive(Clone, Debug, PartialEq)]
pub struct PathTarget {
    /// Name of the object.
    pub object: String,
    /// The middle of its shape, model space.
    pub centre: DVec3,
}

/// The camera of a path at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathView {
    /// Eye point.
    pub eye: DVec3,
    /// Point looked at.
    pub at: DVec3,
    /// Up direction.
    pub up: DVec3,
}

/// Why there is no path through some keys.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PathFault {
    /// The key; `None`: the timing.
    pub(crate) key: Option<usize>,
    /// The attribute of a scene file.
    pub(crate) attribute: &'static str,
    pub(crate) found: String,
    pub(crate) expected: String,
}

/// A camera that flies through keys.
#[derive(Clone, Debug)]
pub struct CameraPath {
    /// Takes the place of all [`PathKey::at`].
    pub target: Option<PathTarget>,
    keys: Vec<PathKey>,
    timing: PathTiming,
    /// Frames per second.
    rate: f64,
    eye: Curve,
    at: Curve,
    up: Curve,
    /// Logarithm of the focal length, in all axes; `None`: all keys have one.
    zoom: Option<Curve>,
    /// Length of the eye's curve up to each cell of it; empty where the speed is that of the keys.
    lengths: Vec<f64>,
}

/// Parts of the curve between two keys whose lengths are kept.
const CELLS: usize = 32;

impl CameraPath {
    /// A path in a scene of `rate` frames per second.
    ///
    /// # Errors
    /// There is no key, frames do not rise, easing takes longer than the path, or speed cannot be constant because the
    /// eye does not move between two keys.
    pub(crate) fn new(
        rate: f64,
        keys: Vec<PathKey>,
        timing: PathTiming,
        target: Option<PathTarget>,
    ) -> Result<Self, PathFault> {
        let fault = |key: Option<usize>, attribute, found: String, expected: String| PathFault {
            key,
            attribute,
            found,
            expected,
        };
        let (Some(first), Some(last)) = (keys.first(), keys.last()) else {
            return Err(fault(None, "key", "none".to_owned(), "one at least".to_owned()));
        };
        if let Some(i) = keys.windows(2).position(|pair| pair[1].frame <= pair[0].frame) {
            let expected = format!("more than that of the key before, {}", keys[i].frame);
            return Err(fault(Some(i + 1), "frame", keys[i + 1].frame.to_string(), expected));
        }
        let (span, easing) = (last.frame - first.frame, timing.ease_in + timing.ease_out);
        if easing > span {
            let attribute = if timing.ease_in > 0.0 { "easeIn" } else { "easeOut" };
            let expected = format!("together at most the {span} frames from the first key to the last");
            return Err(fault(None, attribute, format!("{easing} frames with `easeIn` and `easeOut`"), expected));
        }
        if timing.constant_speed
            && let Some(i) = keys.windows(2).position(|pair| pair[1].eye == pair[0].eye)
        {
            let expected = "another than that of the key before, with `speed=\"constant\"`".to_owned();
            return Err(fault(Some(i + 1), "eye", keys[i + 1].eye.to_string(), expected));
        }
        let curve = |value: &dyn Fn(&PathKey) -> DVec3| {
            Curve::new(keys.iter().map(|key| key.frame).collect(), keys.iter().map(value).collect())
        };
        let zooms = keys.iter().any(|key| key.fovy != first.fovy);
        let zoom = |key: &PathKey| DVec3::splat(-libm::log(libm::tan(0.5 * key.fovy)));
        let (eye, at) = (curve(&|key| key.eye), curve(&|key| key.at));
        let up = curve(&|key| key.up.normalize_or(DVec3::Y));
        let zoom = zooms.then(|| curve(&zoom));
        let lengths = if timing.constant_speed { eye.lengths() } else { Vec::new() };
        Ok(Self { target, keys, timing, rate, eye, at, up, zoom, lengths })
    }

    /// The keys, by frame.
    pub fn keys(&self) -> &[PathKey] {
        &self.keys
    }

    /// At what speed it is flown.
    pub fn timing(&self) -> PathTiming {
        self.timing
    }

    /// First and last key, seconds.
    pub fn range(&self) -> (f64, f64) {
        let [first, last] = self.ends().map(|frame| frame / self.rate);
        (first, last)
    }

    /// First and last key, frames.
    fn ends(&self) -> [f64; 2] {
        [self.keys.first(), self.keys.last()].map(|key| key.map_or(0.0, |key| key.frame))
    }

    /// Where the camera is at a time. Before the first key and after the last it rests.
    pub fn view(&self, seconds: f64) -> PathView {
        let place = self.place(seconds);
        PathView { eye: self.eye.at(place), at: self.at.at(place), up: self.up.at(place) }
    }

    /// Vertical field of view at a time, radians.
    pub fn fovy(&self, seconds: f64) -> f64 {
        let first = self.keys.first().map_or(1.0, |key| key.fovy);
        let zoom = |zoom: &Curve| 2.0 * libm::atan(libm::exp(-zoom.at(self.place(seconds)).x));
        self.zoom.as_ref().map_or(first, zoom)
    }

    /// Camera to world at a time; `target` takes the place of the point that the keys look at.
    pub fn at(&self, seconds: f64, target: Option<DVec3>) -> DMat4 {
        let PathView { eye, at, up } = self.view(seconds);
        let back = (eye - target.unwrap_or(at)).normalize_or(DVec3::Z);
        let right = up.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
        DMat4::from_mat3_translation(DMat3::from_cols(right, back.cross(right), back), eye)
    }

    /// The time of the keys, in frames, that is shown at `seconds`.
    fn place(&self, seconds: f64) -> f64 {
        let [first, last] = self.ends();
        let span = last - first;
        let passed = (seconds * self.rate).clamp(first, last) - first;
        let eased = self.timing.eased(passed, span);
        match self.lengths.last() {
            Some(&whole) if whole > 0.0 && span > 0.0 => self.eye.place_of(&self.lengths, whole * eased / span),
            _ => first + eased,
        }
    }
}

impl PathTiming {
    /// Frames of the path that are behind the camera `passed` frames after the first key, of `span` in all.
    ///
    /// The speed is V in the middle and V s(u) at the ends, with s(u) = 3u^2 - 2u^3 and u from 0 to 1 over the frames
    /// that easing takes. Half of these are lost, so V = span / (span - (in + out) / 2).
    fn eased(&self, passed: f64, span: f64) -> f64 {
        let (rise, fall) = (self.ease_in, self.ease_out);
        if rise <= 0.0 && fall <= 0.0 {
            return passed;
        }
        let speed = span / (span - 0.5 * (rise + fall));
        // The integral of s.
        let part = |u: f64| u * u * u * (1.0 - 0.5 * u);
        if passed < rise {
            speed * rise * part(passed / rise)
        } else if span - passed < fall {
            span - speed * fall * part((span - passed) / fall)
        } else {
            speed * (passed - 0.5 * rise)
        }
    }
}

/// A smooth curve through values at times.
#[derive(Clone, Debug)]
struct Curve {
    times: Vec<f64>,
    values: Vec<DVec3>,
    /// Change per frame at each time.
    slopes: Vec<DVec3>,
}

impl Curve {
    /// The slope at a key is that between its neighbours; at the ends it is that of the chord. It is at most three
    /// times that of the slower chord beside it, so that nothing overshoots where a slow part follows a fast one, and
    /// all is still between two keys that are alike.
    fn new(times: Vec<f64>, values: Vec<DVec3>) -> Self {
        let chord = |from: usize, to: usize| (values[to] - values[from]) / (times[to] - times[from]);
        let last = values.len().saturating_sub(1);
        let slope = |i: usize| {
            if last == 0 {
                return DVec3::ZERO;
            }
            let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
            let slope = chord(before, after);
            if i == 0 || i == last {
                return slope;
            }
            slope.clamp_length_max(3.0 * chord(before, i).length().min(chord(i, after).length()))
        };
        let slopes = (0..values.len()).map(slope).collect();
        Self { times, values, slopes }
    }

    /// The parts of the cubic a + b s + c s^2 + d s^3 from key `i` to the next, s from 0 to 1.
    fn cubic(&self, i: usize) -> [DVec3; 4] {
        let span = self.times[i + 1] - self.times[i];
        let (from, rise) = (self.values[i], self.values[i + 1] - self.values[i]);
        let (out, inward) = (self.slopes[i] * span, self.slopes[i + 1] * span);
        [from, out, 3.0 * rise - 2.0 * out - inward, out + inward - 2.0 * rise]
    }

    fn at(&self, time: f64) -> DVec3 {
        let next = self.times.partition_point(|&key| key <= time);
        if next == 0 || next == self.times.len() {
            let end = if next == 0 { self.values.first() } else { self.values.last() };
            return end.copied().unwrap_or_default();
        }
        let s = (time - self.times[next - 1]) / (self.times[next] - self.times[next - 1]);
        let [a, b, c, d] = self.cubic(next - 1);
        a + s * (b + s * (c + s * d))
    }

    /// Length of the curve from key `i` on, between two shares of the way to the next (5 points of Gauss and Legendre).
    fn length(&self, i: usize, from: f64, to: f64) -> f64 {
        const NODES: [(f64, f64); 5] = [
            (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
            (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
            (0.0, 0.568_888_888_888_888_9),
            (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
            (0.906_179_845_938_664, 0.236_926_885_056_189_1),
        ];
        let [_, b, c, d] = self.cubic(i);
        let half = 0.5 * (to - from);
        let speed = |s: f64| (b + s * (2.0 * c + s * 3.0 * d)).length();
        half * NODES.iter().map(|&(x, weight)| weight * speed(from + half * (1.0 + x))).sum::<f64>()
    }

    /// The length up to the end of each cell, 0 first.
    fn lengths(&self) -> Vec<f64> {
        let share = |k: usize| k as f64 / CELLS as f64;
        let cells = (0..self.times.len().saturating_sub(1)).flat_map(|i| (0..CELLS).map(move |k| (i, k)));
        let mut sum = 0.0;
        let mut lengths = vec![0.0];
        for (i, k) in cells {
            sum += self.length(i, share(k), share(k + 1));
            lengths.push(sum);
        }
        lengths
    }

    /// The time at which the curve is as long as `wanted`.
    fn place_of(&self, lengths: &[f64], wanted: f64) -> f64 {
        let cell = lengths.partition_point(|&length| length <= wanted).clamp(1, lengths.len() - 1) - 1;
        let (i, k) = (cell / CELLS, cell % CELLS);
        let start = k as f64 / CELLS as f64;
        let (mut low, mut high) = (start, (k + 1) as f64 / CELLS as f64);
        let part = lengths[cell + 1] - lengths[cell];
        let rest = wanted - lengths[cell];
        // The secant of the bracket, and its middle where the secant gains little.
        let mut s = if part > 0.0 { low + (high - low) * (rest / part).clamp(0.0, 1.0) } else { low };
        for _ in 0..60 {
            let over = self.length(i, start, s) - rest;
            if over.abs() <= 1e-13 * lengths[lengths.len() - 1] || (high - low).abs() < f64::EPSILON {
                break;
            }
            if over < 0.0 {
                low = s;
            } else {
                high = s;
            }
            let [_, b, c, d] = self.cubic(i);
            let newton = s - over / (b + s * (2.0 * c + s * 3.0 * d)).length();
            // NaN and infinity fail the test too.
            s = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        }
        self.times[i] + s * (self.times[i + 1] - self.times[i])
    }
}

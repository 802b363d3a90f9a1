//! One animation curve: its keys, and its value at any time, between the keys and beyond them.
//!
//! Times are in time units of the file (frames); values are in cm, degrees or plain numbers. Everything is f64: at
//! frame 1e8 the resolution is still 1.5e-8 frames.

use glam::DVec2;
use splines::interpolate::Interpolate;

use super::segment::{Segment, slope, steepness};
use super::tangent::{self, RawKey, Tangent};

/// How the values between keys are found. Step keys, and the rules beyond the first and last key, hold in every mode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Maya's rule, with the tangents and weights of the file.
    #[default]
    Maya,
    /// Straight lines between the keys.
    Linear,
    /// A Catmull-Rom cubic through the keys that respects uneven spacing. The slope at a key is that between the key's
    /// neighbours. At the ends, and beside a step, the slope is that of the segment itself, so two keys give a straight
    /// line.
    Spline,
}

/// What a curve does beyond its first or last key.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Infinity {
    /// Holds the end value.
    #[default]
    Constant,
    /// Continues along the outward tangent of the end key.
    Linear,
    /// Repeats, and jumps where the ends differ.
    Cycle,
    /// Repeats, each period starting where the last one ended.
    CycleRelative,
    /// Repeats, every other period running backwards.
    Oscillate,
}

/// How the value gets from a key to the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Hold {
    /// By interpolation.
    Not,
    /// The value holds until the next key.
    Until,
    /// The next key's value holds from just after this key.
    After,
}

/// A key whose tangents are vectors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Key {
    pub(super) point: DVec2,
    inward: DVec2,
    out: DVec2,
    pub(super) hold: Hold,
}

/// The properties of a curve besides its keys.
#[derive(Clone, Copy, Debug)]
pub(super) struct Options {
    pub(super) weighted: bool,
    pub(super) pre: Infinity,
    pub(super) post: Infinity,
    /// Factors on the file's times and values. They convert the file's units to frames of the animation and to cm or
    /// degrees.
    pub(super) factor: DVec2,
}

/// A curve with at least one key.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    /// Keys in rising order of time; no two have the same time.
    keys: Vec<Key>,
    weighted: bool,
    pub(super) pre: Infinity,
    pub(super) post: Infinity,
}

/// Greatest time, frames. Times beyond it are clamped to it, so that no infinity rule overflows.
const MAX_TIME: f64 = 1e18;

/// True if two times differ by no more than one conversion from frames to seconds and back rounds.
pub(super) fn same_time(a: f64, b: f64) -> bool {
    (a - b).abs() <= 2.0 * f64::EPSILON * a.abs()
}

impl Curve {
    /// Sorts the keys, resolves the tangents in file units and converts everything to the units of `options.factor`.
    /// `None` without keys.
    ///
    /// Where several keys have the same time, the last one in the file counts.
    pub(super) fn new(mut raw: Vec<RawKey>, options: &Options) -> Option<Self> {
        // The sort is stable, and quick on keys that are sorted already.
        raw.sort_by(|a, b| a.point.x.total_cmp(&b.point.x));
        // `dedup_by` drops `later` where the closure is true, so the content of `later` moves to the key that stays.
        raw.dedup_by(|later, kept| {
            let same = later.point.x == kept.point.x;
            if same {
                *kept = *later;
            }
            same
        });
        let keys: Vec<Key> = (0..raw.len())
            .map(|i| {
                let key = &raw[i];
                let previous = i.checked_sub(1).map(|p| raw[p].point);
                let next = raw.get(i + 1).map(|n| n.point);
                let (inward, out) = tangent::vectors(previous, key, next, options.weighted);
                let hold = match key.outward {
                    Tangent::Step => Hold::Until,
                    Tangent::StepNext => Hold::After,
                    _ => Hold::Not,
                };
                let f = options.factor;
                Key { point: key.point * f, inward: inward * f, out: out * f, hold }
            })
            .collect();
        (!keys.is_empty()).then_some(Self { keys, weighted: options.weighted, pre: options.pre, post: options.post })
    }

    pub(super) fn keys(&self) -> &[Key] {
        &self.keys
    }

    pub(super) fn first(&self) -> &Key {
        &self.keys[0]
    }

    pub(super) fn last(&self) -> &Key {
        &self.keys[self.keys.len() - 1]
    }

    /// Value at `time` (frames). It is finite for finite times; NaN counts as the first key's time.
    ///
    /// At a key the value is the key's own: a step has already happened, a step to the next value has not yet. A time
    /// that differs from a key's by the rounding of one conversion counts as the key's time.
    pub(super) fn at(&self, time: f64, mode: Interpolation) -> f64 {
        let (first, last) = (self.first().point, self.last().point);
        let time = if time.is_nan() { first.x } else { time.clamp(-MAX_TIME, MAX_TIME) };
        let (value, near) = if time > last.x && !same_time(time, last.x) {
            (self.beyond(time, self.post, mode), last.y)
        } else if time < first.x && !same_time(time, first.x) {
            (self.beyond(time, self.pre, mode), first.y)
        } else {
            (self.inside(time, mode), first.y)
        };
        // Only values near the limits of f64 are not finite here. A constant is better than infinity.
        if value.is_finite() { value } else { near }
    }

    /// Value by `rule` at a `time` before the first or after the last key.
    fn beyond(&self, time: f64, rule: Infinity, mode: Interpolation) -> f64 {
        let (first, last) = (self.first().point, self.last().point);
        let after = time > last.x;
        let end = if after { last } else { first };
        let period = last.x - first.x;
        // There is one key, or the unit conversion has made several keys one.
        if period <= 0.0 || rule == Infinity::Constant {
            return end.y;
        }
        // The remainder is exact. The count is therefore a whole number, however the division rounds.
        let past = (time - end.x).abs();
        let rest = libm::fmod(past, period);
        let count = libm::round((past - rest) / period) + 1.0;
        let forwards = self.inside(first.x + rest, mode);
        let backwards = self.inside(last.x - rest, mode);
        match rule {
            Infinity::Constant => end.y,
            Infinity::Linear => end.y + (time - end.x) * self.end_slope(after, mode),
            Infinity::Cycle if after => forwards,
            Infinity::Cycle => backwards,
            Infinity::CycleRelative if after => forwards + count * (last.y - first.y),
            Infinity::CycleRelative => backwards - count * (last.y - first.y),
            Infinity::Oscillate if (libm::fmod(count, 2.0) == 1.0) == after => backwards,
            Infinity::Oscillate => forwards,
        }
    }

    /// Slope with which `Infinity::Linear` continues. In Maya's mode it is that of the end key's outward tangent. In
    /// the linear and spline modes it is that of the curve next to the end key, which is the chord to the neighbour.
    fn end_slope(&self, after: bool, mode: Interpolation) -> f64 {
        if mode == Interpolation::Maya {
            return if after { slope(self.last().out) } else { slope(self.first().inward) };
        }
        let from = if after { self.keys.len() - 2 } else { 0 };
        if self.keys[from].hold == Hold::Not { slope(self.keys[from + 1].point - self.keys[from].point) } else { 0.0 }
    }

    /// Value at `time`, after `time` is moved into the range of the keys.
    fn inside(&self, time: f64, mode: Interpolation) -> f64 {
        let after = self.keys.partition_point(|key| key.point.x <= time);
        let Some(next) = self.keys.get(after) else { return self.last().point.y };
        let Some(i) = after.checked_sub(1) else { return self.first().point.y };
        let key = &self.keys[i];
        if same_time(time, key.point.x) {
            return key.point.y;
        }
        if same_time(time, next.point.x) {
            return next.point.y;
        }
        let segment = Segment { start: key.point, out: key.out, end: next.point, inward: next.inward };
        match (key.hold, mode) {
            (Hold::Until, _) => key.point.y,
            (Hold::After, _) => next.point.y,
            (Hold::Not, Interpolation::Linear) => {
                let s = (time - key.point.x) / (next.point.x - key.point.x);
                f64::lerp(s, key.point.y, next.point.y)
            }
            (Hold::Not, Interpolation::Spline) => self.spline(i, time),
            (Hold::Not, Interpolation::Maya) if self.weighted => segment.bezier(time),
            (Hold::Not, Interpolation::Maya) => segment.hermite(time),
        }
    }

    /// Upper bound of |slope| at times from `from` to `to` (frames); infinite where the value may jump.
    pub(super) fn steepness(&self, from: f64, to: f64, mode: Interpolation) -> f64 {
        // A time within the rounding of a key counts as the key's, so the range grows by that much.
        let (from, to) = (from - 4.0 * f64::EPSILON * from.abs(), to + 4.0 * f64::EPSILON * to.abs());
        let (first, last) = (self.first().point, self.last().point);
        // Also false for NaN.
        if !(-MAX_TIME <= from && from <= to && to <= MAX_TIME) {
            return f64::INFINITY;
        }
        let mut all = false;
        let mut steepest: f64 = 0.0;
        for (outside, after, rule) in [(from <= first.x, false, self.pre), (to >= last.x, true, self.post)] {
            match rule {
                _ if !outside || self.keys.len() < 2 => {}
                Infinity::Constant => {}
                Infinity::Linear => steepest = steepest.max(self.end_slope(after, mode).abs()),
                Infinity::Cycle if first.y != last.y => return f64::INFINITY,
                Infinity::Cycle | Infinity::CycleRelative | Infinity::Oscillate => all = true,
            }
        }
        for i in 0..self.keys.len() - 1 {
            let (key, next) = (&self.keys[i], &self.keys[i + 1]);
            if !all && (next.point.x < from || key.point.x > to) {
                continue;
            }
            let segment = Segment { start: key.point, out: key.out, end: next.point, inward: next.inward };
            let chord = slope(next.point - key.point);
            let here = match (key.hold, mode) {
                (Hold::Until, _) if !all && next.point.x > to => 0.0,
                (Hold::After, _) if !all && key.point.x < from => 0.0,
                (Hold::Until | Hold::After, _) => f64::INFINITY,
                (Hold::Not, Interpolation::Linear) => chord.abs(),
                (Hold::Not, Interpolation::Spline) => {
                    let [before, a, b, beyond] = self.neighbours(i);
                    steepness(slope(b - before), slope(beyond - a), chord)
                }
                (Hold::Not, Interpolation::Maya) if self.weighted => segment.bezier_steepness(),
                (Hold::Not, Interpolation::Maya) => segment.hermite_steepness(),
            };
            steepest = steepest.max(here);
        }
        // Values near the limits of f64 give NaN.
        if steepest.is_nan() { f64::INFINITY } else { steepest }
    }

    /// Catmull-Rom cubic between keys `i` and `i + 1`.
    ///
    /// It is the cubic Hermite whose slope at a key is that of the chord between the key's neighbours in time:
    /// (v[i+1] - v[i-1]) / (t[i+1] - t[i-1]). So it respects uneven spacing. At an end of the curve, and next to a step
    /// (which must not bend its neighbours), a neighbour is missing; the mirror image of the other neighbour takes its
    /// place. The slope there is that of the segment's own chord, and two keys give a straight line.
    fn spline(&self, i: usize, time: f64) -> f64 {
        let [before, a, b, beyond] = self.neighbours(i);
        let pair = |p: DVec2| (p.x, p.y);
        f64::cubic_hermite((time - a.x) / (b.x - a.x), pair(before), pair(a), pair(b), pair(beyond))
    }

    /// The keys `i` and `i + 1` (time, value), and on either side the neighbour that gives [`Self::spline`] its slope.
    fn neighbours(&self, i: usize) -> [DVec2; 4] {
        let (a, b) = (self.keys[i].point, self.keys[i + 1].point);
        let smooth = |from: usize| self.keys[from].hold == Hold::Not;
        let before = match i.checked_sub(1) {
            Some(previous) if smooth(previous) => self.keys[previous].point,
            _ => a - (b - a),
        };
        let beyond = match self.keys.get(i + 2) {
            Some(next) if smooth(i + 1) => next.point,
            _ => b + (b - a),
        };
        [before, a, b, beyond]
    }
}

#[cfg(test)]
mod tests;

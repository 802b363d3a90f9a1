//! One animation curve: keys, and the value at any time, inside the keys and beyond them.
//!
//! Times are in file time units (frames), values in cm, degrees or plain numbers. Everything is f64: frame 1e8 still has a
//! resolution of 1.5e-8 frames.

use glam::DVec2;
use splines::interpolate::Interpolate;

use super::segment::{Segment, slope, steepness};
use super::tangent::{self, RawKey, Tangent};

/// How values between keys are found. Step keys and the rules beyond the first and last key hold in every mode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// As Maya does: tangents and weights of the file.
    #[default]
    Maya,
    /// Straight lines between the keys.
    Linear,
    /// A Catmull-Rom cubic through the keys, for uneven spacing: the slope at a key is that between its neighbours. At the
    /// ends, and beside a step, the slope is that of the segment itself; two keys give a straight line.
    Spline,
}

/// What a curve does beyond its first or last key.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Infinity {
    /// Holds the end value.
    #[default]
    Constant,
    /// Goes on with the outward tangent of the end key.
    Linear,
    /// Repeats, and jumps where the ends differ.
    Cycle,
    /// Repeats, each period starting where the last one ended.
    CycleRelative,
    /// Repeats, every other period running backwards.
    Oscillate,
}

/// How a key leads to the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Hold {
    /// By interpolation.
    Not,
    /// The value holds until the next key.
    Until,
    /// The next key's value holds from just after this key.
    After,
}

/// A key, tangents as vectors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Key {
    pub(super) point: DVec2,
    inward: DVec2,
    out: DVec2,
    pub(super) hold: Hold,
}

/// What a curve says of itself besides its keys.
#[derive(Clone, Copy, Debug)]
pub(super) struct Options {
    pub(super) weighted: bool,
    pub(super) pre: Infinity,
    pub(super) post: Infinity,
    /// Multiplies times and values of the file: its units to frames of the animation and to cm or degrees.
    pub(super) factor: DVec2,
}

/// A curve with at least one key.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    /// Rising in time, no two equal.
    keys: Vec<Key>,
    weighted: bool,
    pub(super) pre: Infinity,
    pub(super) post: Infinity,
}

/// Times beyond this are not told apart from it, so that no infinity rule overflows; frames.
const MAX_TIME: f64 = 1e18;

/// True for times that differ by the rounding of one conversion from frames to seconds and back.
pub(super) fn same_time(a: f64, b: f64) -> bool {
    (a - b).abs() <= 2.0 * f64::EPSILON * a.abs()
}

impl Curve {
    /// Sorts the keys, resolves tangents in file units and converts to `options.factor`'s units. `None` without keys.
    ///
    /// Of keys at the same time the later one in the file counts.
    pub(super) fn new(mut raw: Vec<RawKey>, options: &Options) -> Option<Self> {
        // Stable, and quick on keys that are sorted already.
        raw.sort_by(|a, b| a.point.x.total_cmp(&b.point.x));
        // `dedup_by` drops `later` where true, so it hands its content to the one that stays.
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

    /// Value at `time` (frames). Finite for finite times; NaN counts as the first key's time.
    ///
    /// At a key the value is the key's own: a step has happened, a step to the next value has not yet. Times within the rounding of
    /// one conversion of a key count as the key.
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
        // Only numbers near the limits of f64 get here; a constant is better than infinity.
        if value.is_finite() { value } else { near }
    }

    /// Infinity rule `rule` at a `time` before the first or after the last key.
    fn beyond(&self, time: f64, rule: Infinity, mode: Interpolation) -> f64 {
        let (first, last) = (self.first().point, self.last().point);
        let after = time > last.x;
        let end = if after { last } else { first };
        let period = last.x - first.x;
        // One key, or keys that unit conversion made one.
        if period <= 0.0 || rule == Infinity::Constant {
            return end.y;
        }
        // The remainder is exact; the count is then a whole number whatever the division rounds to.
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

    /// Slope with which `Infinity::Linear` goes on. Maya: the outward tangent of the end key. Linear and spline: that of the curve
    /// next to the end key, which is the chord to the neighbour in both modes.
    fn end_slope(&self, after: bool, mode: Interpolation) -> f64 {
        if mode == Interpolation::Maya {
            return if after { slope(self.last().out) } else { slope(self.first().inward) };
        }
        let from = if after { self.keys.len() - 2 } else { 0 };
        if self.keys[from].hold == Hold::Not { slope(self.keys[from + 1].point - self.keys[from].point) } else { 0.0 }
    }

    /// Value at `time`, moved into the range of the keys.
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

    /// The greatest |slope| at times from `from` to `to` (frames), from above; infinite where the value may jump.
    pub(super) fn steepness(&self, from: f64, to: f64, mode: Interpolation) -> f64 {
        // Times within rounding of a key count as the key.
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
        // NaN from values near the limits of f64.
        if steepest.is_nan() { f64::INFINITY } else { steepest }
    }

    /// Catmull-Rom cubic between keys `i` and `i + 1`: cubic Hermite whose slope at a key is that of the chord between the key's
    /// neighbours in time, (v[i+1] - v[i-1]) / (t[i+1] - t[i-1]), so uneven spacing is respected. At an end of the curve, and next
    /// to a step (which must not bend its neighbours), the missing key is the mirror image of the other neighbour: the slope
    /// there is that of the segment's own chord, and two keys give a straight line.
    fn spline(&self, i: usize, time: f64) -> f64 {
        let [before, a, b, beyond] = self.neighbours(i);
        let pair = |p: DVec2| (p.x, p.y);
        f64::cubic_hermite((time - a.x) / (b.x - a.x), pair(before), pair(a), pair(b), pair(beyond))
    }

    /// The keys `i` and `i + 1` (time, value) between those that give [`Self::spline`] its slopes.
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

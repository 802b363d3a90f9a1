//! One animation curve: keys, and the value at any time, inside the keys and beyond them.
//!
//! Times are in file time units (frames), values in cm, degrees or plain numbers. Everything is f64: frame 1e8 still has a
//! resolution of 1.5e-8 frames.

use glam::DVec2;
use splines::interpolate::Interpolate;

use super::Interpolation;
use super::segment::{Segment, slope};
use super::tangent::{self, RawKey, Tangent};

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
        if period <= 0.0 {
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

    /// Catmull-Rom cubic between keys `i` and `i + 1`: cubic Hermite whose slope at a key is that of the chord between the key's
    /// neighbours in time, (v[i+1] - v[i-1]) / (t[i+1] - t[i-1]), so uneven spacing is respected. At an end of the curve, and next
    /// to a step (which must not bend its neighbours), the missing key is the mirror image of the other neighbour: the slope
    /// there is that of the segment's own chord, and two keys give a straight line.
    fn spline(&self, i: usize, time: f64) -> f64 {
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
        let pair = |p: DVec2| (p.x, p.y);
        f64::cubic_hermite((time - a.x) / (b.x - a.x), pair(before), pair(a), pair(b), pair(beyond))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(tangent: Tangent, pre: Infinity, post: Infinity, points: &[(f64, f64)]) -> Curve {
        let raw = points.iter().map(|&p| RawKey { point: p.into(), inward: tangent, outward: tangent }).collect();
        let options = Options { weighted: false, pre, post, factor: DVec2::ONE };
        Curve::new(raw, &options).expect("has keys")
    }

    /// Two straight segments: (1, 0), (3, 4), (5, 6); at 2 it is 2, at 4 it is 5.
    fn bent(rule: Infinity) -> Curve {
        curve(Tangent::Linear, rule, rule, &[(1.0, 0.0), (3.0, 4.0), (5.0, 6.0)])
    }

    #[track_caller]
    fn values(curve: &Curve, mode: Interpolation, expected: &[(f64, f64)]) {
        for &(t, v) in expected {
            let found = curve.at(t, mode);
            assert!((found - v).abs() < 1e-12, "at {t}: {found}, expected {v}");
        }
    }

    #[test]
    fn no_keys_are_no_curve_and_one_key_is_constant() {
        let options = Options { weighted: false, pre: Infinity::Linear, post: Infinity::Cycle, factor: DVec2::ONE };
        assert!(Curve::new(Vec::new(), &options).is_none());
        for rule in [Infinity::Linear, Infinity::Cycle, Infinity::CycleRelative, Infinity::Oscillate] {
            let one = curve(Tangent::Fixed(DVec2::ONE), rule, rule, &[(3.0, 7.0)]);
            values(&one, Interpolation::Maya, &[(-9.0, 7.0), (3.0, 7.0), (1e9, 7.0)]);
            values(&one, Interpolation::Spline, &[(-9.0, 7.0), (3.0, 7.0), (1e9, 7.0)]);
        }
    }

    #[test]
    fn keys_are_sorted_and_the_later_of_equal_times_counts() {
        let c = curve(
            Tangent::Linear,
            Infinity::Constant,
            Infinity::Constant,
            &[(5.0, 9.0), (1.0, 0.0), (3.0, 1.0), (5.0, 6.0), (3.0, 4.0)],
        );
        assert_eq!(c.keys().len(), 3);
        values(&c, Interpolation::Maya, &[(1.0, 0.0), (2.0, 2.0), (3.0, 4.0), (4.0, 5.0), (5.0, 6.0)]);
    }

    #[test]
    fn infinity_rules_follow_the_table() {
        let maya = Interpolation::Maya;
        values(&bent(Infinity::Constant), maya, &[(-3.5, 0.0), (0.0, 0.0), (6.0, 6.0), (100.0, 6.0)]);
        // Period 4: 6 is 2 again, 10 is 2, 0 is 4, -4 is 4.
        values(
            &bent(Infinity::Cycle),
            maya,
            &[(6.0, 2.0), (10.0, 2.0), (8.0, 5.0), (0.0, 5.0), (-4.0, 5.0), (-2.0, 2.0)],
        );
        values(&bent(Infinity::CycleRelative), maya, &[(6.0, 8.0), (10.0, 14.0), (0.0, -1.0), (-4.0, -7.0)]);
        // Mirrored: 6 is 4, 8 is 2, 10 is 2; 0 is 2, -2 is 4, -4 is 4.
        values(&bent(Infinity::Oscillate), maya, &[(6.0, 5.0), (8.0, 2.0), (10.0, 2.0), (12.0, 5.0)]);
        values(&bent(Infinity::Oscillate), maya, &[(0.0, 2.0), (-2.0, 5.0), (-4.0, 5.0), (-6.0, 2.0)]);
    }

    #[test]
    fn linear_infinity_follows_the_outward_tangent() {
        // Maya's linear tangents have no direction outwards; spline ones do.
        values(&bent(Infinity::Linear), Interpolation::Maya, &[(0.0, 0.0), (7.0, 6.0)]);
        let spline = curve(Tangent::Spline, Infinity::Linear, Infinity::Linear, &[(1.0, 0.0), (3.0, 4.0), (5.0, 6.0)]);
        values(&spline, Interpolation::Maya, &[(0.0, -2.0), (7.0, 8.0)]);
        // The other modes go on along the last chord, unless it is a step.
        values(&bent(Infinity::Linear), Interpolation::Linear, &[(0.0, -2.0), (7.0, 8.0)]);
        values(&bent(Infinity::Linear), Interpolation::Spline, &[(0.0, -2.0), (7.0, 8.0)]);
        let step = curve(Tangent::Step, Infinity::Linear, Infinity::Linear, &[(1.0, 0.0), (3.0, 4.0)]);
        values(&step, Interpolation::Linear, &[(0.0, 0.0), (7.0, 4.0)]);
    }

    #[test]
    fn far_away_times_keep_their_fraction() {
        let c = bent(Infinity::Cycle);
        values(&c, Interpolation::Maya, &[(1e8 + 2.25, 2.5), (-1e8 + 2.25, 2.5)]);
        let relative = bent(Infinity::CycleRelative);
        let found = relative.at(1e8 + 2.25, Interpolation::Maya);
        assert!((found - (2.5 + 6.0 * 1e8 / 4.0)).abs() < 1e-6, "{found}");
        let swing = bent(Infinity::Oscillate);
        values(&swing, Interpolation::Maya, &[(1e8 + 2.25, 2.5), (1e8 + 6.25, 4.75), (-1e8 + 2.25, 2.5)]);
        for t in [1e300, -1e300, f64::INFINITY, f64::NAN] {
            assert!(relative.at(t, Interpolation::Maya).is_finite());
        }
        // A cycle of very many, very short periods.
        let short = curve(Tangent::Linear, Infinity::CycleRelative, Infinity::Linear, &[(0.0, 0.0), (1e-300, 1e30)]);
        assert!(short.at(-1e18, Interpolation::Maya).is_finite());
        assert!(short.at(1e18, Interpolation::Linear).is_finite());
    }

    #[test]
    fn relative_cycles_do_not_slip_at_their_seams() {
        // Period 0.1 is not a binary fraction: count and remainder must agree at every seam.
        let c = curve(Tangent::Linear, Infinity::CycleRelative, Infinity::CycleRelative, &[(0.0, 0.0), (0.1, 1.0)]);
        for i in -2000..2000 {
            let t = f64::from(i) * 0.1;
            assert!((c.at(t, Interpolation::Maya) - t * 10.0).abs() < 1e-9, "{t}");
        }
    }

    #[test]
    fn steps_hold_in_every_mode() {
        for mode in [Interpolation::Maya, Interpolation::Linear, Interpolation::Spline] {
            let points = [(1.0, 5.0), (3.0, 7.0), (6.0, 2.0)];
            let step = curve(Tangent::Step, Infinity::Constant, Infinity::Constant, &points);
            values(&step, mode, &[(1.0, 5.0), (2.999, 5.0), (3.0, 7.0), (5.9, 7.0), (6.0, 2.0), (9.0, 2.0)]);
            let next = curve(Tangent::StepNext, Infinity::Constant, Infinity::Constant, &points);
            values(&next, mode, &[(1.0, 5.0), (1.001, 7.0), (3.0, 7.0), (3.001, 2.0), (6.0, 2.0)]);
            // A time one rounding away from a key is the key.
            assert_eq!(step.at(3.0f64.next_down(), mode), 7.0);
            assert_eq!(next.at(1.0f64.next_up(), mode), 5.0);
            assert_eq!(step.at(6.0f64.next_up(), mode), 2.0);
            assert_eq!(next.at(1.0f64.next_down(), mode), 5.0);
        }
    }

    #[test]
    fn linear_mode_ignores_tangents() {
        let flat = curve(Tangent::Flat, Infinity::Cycle, Infinity::Cycle, &[(1.0, 0.0), (3.0, 4.0), (5.0, 6.0)]);
        values(&flat, Interpolation::Linear, &[(1.5, 1.0), (2.0, 2.0), (4.5, 5.5), (6.0, 2.0), (0.0, 5.0)]);
    }

    #[test]
    fn spline_mode_is_a_catmull_rom_for_uneven_keys() {
        // Keys on a parabola, symmetric about the inner segment's keys only by luck: compare with a Hermite made by hand.
        let c = curve(
            Tangent::Flat,
            Infinity::Constant,
            Infinity::Constant,
            &[(0.0, 1.0), (1.0, 3.0), (4.0, 2.0), (6.0, 7.0)],
        );
        let (m0, m1) = ((2.0 - 1.0) / 4.0, (7.0 - 3.0) / 5.0);
        let by_hand = Segment {
            start: DVec2::new(1.0, 3.0),
            out: DVec2::new(1.0, m0),
            end: DVec2::new(4.0, 2.0),
            inward: DVec2::new(1.0, m1),
        };
        for i in 0..=30 {
            let t = 1.0 + f64::from(i) / 10.0;
            assert!((c.at(t, Interpolation::Spline) - by_hand.hermite(t)).abs() < 1e-13);
        }
        // At the end the slope is the chord's.
        let h = 1e-6;
        assert!(((c.at(h, Interpolation::Spline) - 1.0) / h - 2.0).abs() < 1e-4);
        // Two keys: a straight line.
        let two = curve(Tangent::Flat, Infinity::Constant, Infinity::Constant, &[(0.0, 1.0), (4.0, 3.0)]);
        values(&two, Interpolation::Spline, &[(1.0, 1.5), (3.0, 2.5)]);
    }

    #[test]
    fn a_step_does_not_bend_the_spline_beside_it() {
        let key = |t: f64, v: f64, outward| RawKey { point: DVec2::new(t, v), inward: Tangent::Auto, outward };
        let raw = vec![
            key(0.0, 50.0, Tangent::Step),
            key(1.0, 0.0, Tangent::Auto),
            key(2.0, 1.0, Tangent::Step),
            key(3.0, 90.0, Tangent::Auto),
        ];
        let options =
            Options { weighted: false, pre: Infinity::Constant, post: Infinity::Constant, factor: DVec2::ONE };
        let c = Curve::new(raw, &options).expect("has keys");
        values(&c, Interpolation::Spline, &[(0.5, 50.0), (1.25, 0.25), (1.75, 0.75), (2.5, 1.0), (3.0, 90.0)]);
    }

    #[test]
    fn units_scale_time_value_and_tangents() {
        let raw = |t| {
            vec![
                RawKey { point: DVec2::ZERO, inward: t, outward: t },
                RawKey { point: DVec2::new(2.0, 3.0), inward: t, outward: t },
            ]
        };
        for weighted in [false, true] {
            let build = |factor| {
                let options = Options { weighted, pre: Infinity::Linear, post: Infinity::Linear, factor };
                Curve::new(raw(Tangent::Fixed(DVec2::new(1.5, 4.0))), &options).expect("has keys")
            };
            let (plain, scaled) = (build(DVec2::ONE), build(DVec2::new(10.0, 100.0)));
            for i in -10..40 {
                let t = f64::from(i) / 10.0;
                let (a, b) = (plain.at(t, Interpolation::Maya), scaled.at(t * 10.0, Interpolation::Maya));
                assert!((a * 100.0 - b).abs() < 1e-9, "{weighted} {t}: {a} {b}");
            }
        }
    }

    #[test]
    fn steep_and_crowded_keys_stay_finite() {
        let vertical = Tangent::Fixed(DVec2::new(0.0, 1e30));
        let points = [(0.0, -1e30), (5e-324, 1e30), (1.0, -1e30), (1e30, 1e30)];
        for rule in [Infinity::Linear, Infinity::CycleRelative, Infinity::Oscillate] {
            for tangent in [vertical, Tangent::Auto, Tangent::AutoEase, Tangent::Spline, Tangent::Plateau] {
                let raw: Vec<_> =
                    points.iter().map(|&p| RawKey { point: p.into(), inward: tangent, outward: tangent }).collect();
                for weighted in [false, true] {
                    let factor = DVec2::new(1e-3, 1e5);
                    let c = Curve::new(raw.clone(), &Options { weighted, pre: rule, post: rule, factor });
                    let c = c.expect("has keys");
                    for t in [-1e30, -1.0, 0.0, 1e-200, 0.5, 2.0, 1e17, 1e29] {
                        for mode in [Interpolation::Maya, Interpolation::Linear, Interpolation::Spline] {
                            assert!(c.at(t, mode).is_finite(), "{tangent:?} {t} {mode:?}");
                        }
                    }
                }
            }
        }
    }
}

//! Times at which a curve jumps: at step keys, at the seams of cycles, and where a value that is read as a switch
//! changes.

use super::curve::{Curve, Hold, Infinity, Interpolation};

/// Most keys that one call looks at, repetitions included. A curve that repeats more often within one interval loses
/// its later jumps: no shutter could be split that finely.
const MAX_VISITS: usize = 1 << 16;

/// Parts into which the time between two keys is cut. A switch is seen to change at most once in each.
const PARTS: u32 = 16;

impl Curve {
    /// Times in (from, to), unsorted, at which the value jumps.
    pub(super) fn jumps(&self, from: f64, to: f64) -> Vec<f64> {
        let mut found = Vec::new();
        self.visit_keys(from, to, &mut |time, key| {
            if self.jumps_within(key) || self.is_seam(time, key) {
                found.push(time);
            }
        });
        found
    }

    /// Times in (from, to), unsorted, at which `switch` of the value changes. At most one change is found in each
    /// sixteenth of the time between two neighbouring keys.
    pub(super) fn changes(
        &self,
        from: f64,
        to: f64,
        mode: Interpolation,
        switch: impl Fn(f64) -> u32 + Copy,
    ) -> Vec<f64> {
        let mut marks = vec![from, to];
        self.visit_keys(from, to, &mut |time, _| marks.push(time));
        marks.sort_by(f64::total_cmp);
        marks.dedup();
        let mut found = Vec::new();
        let state = |t: f64| switch(self.at(t, mode));
        for (a, b) in marks.iter().zip(marks.iter().skip(1)) {
            let part = |i: u32| a + (b - a) * (f64::from(i) / f64::from(PARTS));
            // `jumps` finds the jumps at the marks themselves, so start and end lie just inside.
            let (mut start, end) = (a + (b - a) * 1e-9, b - (b - a) * 1e-9);
            for i in 1..=PARTS {
                let stop = if i == PARTS { end } else { part(i) };
                if state(start) != state(stop) {
                    found.push(bisect(start, stop, state));
                }
                start = stop;
            }
        }
        found
    }

    /// True if the value jumps at `key` within the range of the keys.
    fn jumps_within(&self, key: usize) -> bool {
        let keys = self.keys();
        let differ = |a: usize, b: usize| keys[a].point.y != keys[b].point.y;
        let arrives = key > 0 && keys[key - 1].hold == Hold::Until && differ(key - 1, key);
        let leaves = key + 1 < keys.len() && keys[key].hold == Hold::After && differ(key, key + 1);
        arrives || leaves
    }

    /// True if one cycle ends at this repetition of an end key and the next cycle starts at another value.
    fn is_seam(&self, time: f64, key: usize) -> bool {
        let (first, last) = (self.first().point, self.last().point);
        let at_end = key == 0 || key + 1 == self.keys().len();
        let repeats =
            (self.post == Infinity::Cycle && time >= last.x) || (self.pre == Infinity::Cycle && time <= first.x);
        at_end && repeats && first.y != last.y
    }

    /// Calls `visit(time, key)` for every key in (from, to), those of the repetitions beyond the ends included.
    fn visit_keys(&self, from: f64, to: f64, visit: &mut dyn FnMut(f64, usize)) {
        let mut budget = MAX_VISITS;
        let (first, last) = (self.first().point.x, self.last().point.x);
        self.visit_repetition(from, to, Repetition { offset: 0.0, mirrored: false }, &mut budget, visit);
        let period = last - first;
        // Also false for NaN.
        if !(period > 0.0 && from < to) {
            return;
        }
        for (rule, after) in [(self.pre, false), (self.post, true)] {
            if matches!(rule, Infinity::Constant | Infinity::Linear) {
                continue;
            }
            // Repetition m >= 1 covers [first + m period, last + m period], or the mirrored range before the start.
            let (near, far) =
                if after { (from.max(last) - last, to - last) } else { (first - to.min(first), first - from) };
            let mut m = libm::floor(near / period);
            while m * period <= far && budget > 0 {
                m += 1.0;
                let shift = if after { m * period } else { -m * period };
                let mirrored = rule == Infinity::Oscillate && libm::fmod(m, 2.0) == 1.0;
                // Mirroring maps t to first + last - t before the shift.
                let offset = if mirrored { first + last + shift } else { shift };
                self.visit_repetition(from, to, Repetition { offset, mirrored }, &mut budget, visit);
                // An empty repetition costs a little too, so that the loop always ends.
                budget = budget.saturating_sub(1);
            }
        }
    }

    fn visit_repetition(
        &self,
        from: f64,
        to: f64,
        repetition: Repetition,
        budget: &mut usize,
        visit: &mut dyn FnMut(f64, usize),
    ) {
        let (a, b) = (repetition.local(from), repetition.local(to));
        let (low, high) = (a.min(b), a.max(b));
        let start = self.keys().partition_point(|key| key.point.x < low);
        for (i, key) in self.keys().iter().enumerate().skip(start) {
            if key.point.x > high || *budget == 0 {
                return;
            }
            let time = repetition.image(key.point.x);
            if time > from && time < to {
                *budget -= 1;
                visit(time, i);
            }
        }
    }
}

/// One repetition of the keys: time = offset + local, or offset - local.
#[derive(Clone, Copy)]
struct Repetition {
    offset: f64,
    mirrored: bool,
}

impl Repetition {
    fn image(self, local: f64) -> f64 {
        if self.mirrored { self.offset - local } else { self.offset + local }
    }

    fn local(self, time: f64) -> f64 {
        if self.mirrored { self.offset - time } else { time - self.offset }
    }
}

fn bisect(mut low: f64, mut high: f64, state: impl Fn(f64) -> u32) -> f64 {
    let before = state(low);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if state(middle) == before {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::anim::curve::Options;
    use crate::anim::tangent::{RawKey, Tangent};

    fn curve(tangent: Tangent, rule: Infinity, points: &[(f64, f64)]) -> Curve {
        let raw = points.iter().map(|&p| RawKey { point: p.into(), inward: tangent, outward: tangent }).collect();
        let options = Options { weighted: false, pre: rule, post: rule, factor: DVec2::ONE };
        Curve::new(raw, &options).expect("has keys")
    }

    fn sorted(mut times: Vec<f64>) -> Vec<f64> {
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }

    fn jumps(curve: &Curve, from: f64, to: f64) -> Vec<f64> {
        sorted(curve.jumps(from, to))
    }

    const POINTS: [(f64, f64); 4] = [(1.0, 5.0), (3.0, 7.0), (4.0, 7.0), (6.0, 2.0)];

    #[test]
    fn steps_jump_where_values_differ() {
        let step = curve(Tangent::Step, Infinity::Constant, &POINTS);
        assert_eq!(jumps(&step, -99.0, 99.0), [3.0, 6.0]);
        let next = curve(Tangent::StepNext, Infinity::Constant, &POINTS);
        assert_eq!(jumps(&next, -99.0, 99.0), [1.0, 4.0]);
        assert!(jumps(&curve(Tangent::Auto, Infinity::Linear, &POINTS), -99.0, 99.0).is_empty());
        // The interval is open.
        assert!(jumps(&step, 3.0, 6.0).is_empty());
        assert_eq!(jumps(&step, 2.999, 3.001), [3.0]);
        assert!(jumps(&step, 9.0, -9.0).is_empty());
    }

    #[test]
    fn cycles_jump_at_their_seams() {
        let smooth = curve(Tangent::Linear, Infinity::Cycle, &POINTS);
        assert_eq!(jumps(&smooth, -10.0, 17.0), [-9.0, -4.0, 1.0, 6.0, 11.0, 16.0]);
        assert!(jumps(&curve(Tangent::Linear, Infinity::CycleRelative, &POINTS), -10.0, 17.0).is_empty());
        assert!(jumps(&curve(Tangent::Linear, Infinity::Oscillate, &POINTS), -10.0, 17.0).is_empty());
        let closed = curve(Tangent::Linear, Infinity::Cycle, &[(1.0, 2.0), (3.0, 7.0), (6.0, 2.0)]);
        assert!(jumps(&closed, -10.0, 17.0).is_empty());
        let far = jumps(&smooth, 1e8 - 1.0, 1e8 + 4.0);
        assert_eq!(far, [1e8 + 1.0]);
    }

    /// Trying values on both sides finds the same jumps. (Where an oscillation turns on a step, the key's value shows
    /// for an instant only.)
    #[test]
    fn jumps_are_where_the_values_jump() {
        let rules = [Infinity::Constant, Infinity::Cycle, Infinity::CycleRelative, Infinity::Oscillate];
        for rule in rules {
            for tangent in [Tangent::Step, Tangent::StepNext, Tangent::Linear] {
                let c = curve(tangent, rule, &POINTS);
                let seen: Vec<f64> = (-36..72)
                    .map(|i| f64::from(i) / 2.0)
                    .filter(|t| {
                        let at = |dt| c.at(t + dt, Interpolation::Maya);
                        [-1e-6, 1e-6].iter().any(|dt| (at(*dt) - at(0.0)).abs() > 1e-3)
                    })
                    .collect();
                assert_eq!(jumps(&c, -18.2, 35.7), seen, "{rule:?} {tangent:?}");
            }
        }
    }

    #[test]
    fn endless_repetition_is_cut_off() {
        let c = curve(Tangent::Step, Infinity::Cycle, &[(0.0, 0.0), (1e-9, 1.0)]);
        assert!(c.jumps(-1e9, 1e9).len() <= MAX_VISITS);
        let wide = curve(Tangent::Step, Infinity::Oscillate, &[(0.0, 0.0), (5e-324, 1.0)]);
        assert!(wide.jumps(-1e18, 1e18).len() <= MAX_VISITS);
    }

    #[test]
    fn switches_change_where_the_curve_crosses() {
        let on = |v: f64| u32::from(v > 0.5);
        let c = curve(Tangent::Linear, Infinity::Oscillate, &[(0.0, 0.0), (10.0, 1.0)]);
        let found = sorted(c.changes(-6.0, 26.0, Interpolation::Maya, on));
        assert_eq!(found.len(), 4, "{found:?}");
        for (a, b) in found.iter().zip([-5.0, 5.0, 15.0, 25.0]) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
        let still = curve(Tangent::Linear, Infinity::Constant, &[(0.0, 0.6), (10.0, 1.0)]);
        assert!(still.changes(-5.0, 25.0, Interpolation::Maya, on).is_empty());
    }
}
